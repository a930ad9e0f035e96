"""Small inputs that must be read rightly or refused, each in a copy of its folder."""

from __future__ import annotations

import shutil

import pytest
from typer.testing import CliRunner

from aerotri.cli import app
from places import SHARED_DATA


@pytest.fixture
def door(tmp_path, monkeypatch):
    """A function that goes into a copy of a folder."""

    def enter(name):
        source = SHARED_DATA / "doors" / name
        if not source.is_dir():
            pytest.skip(f"real data: {name} of the doors is not beside the project")
        folder = shutil.copytree(source, tmp_path / name)
        monkeypatch.chdir(folder)
        return folder

    return enter


@pytest.fixture
def run():
    """A function that runs a command in this process, with a line of words; what it raises comes through."""

    def invoke(line):
        return CliRunner().invoke(app, line.split(), catch_exceptions=False)

    return invoke
