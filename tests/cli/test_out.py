"""Every command refuses an --out that cannot be written, before its work begins."""

from __future__ import annotations

import os
import shlex
from pathlib import Path

import pytest

from aerotri.cli.app import app, invoke
from aerotri.conventions import InputError
from aerotri.reference.command_lines import command_lines

WITH_OUT = [one for one in command_lines(app) if any("--out" in option.names for option in one.options)]


@pytest.mark.skipif(os.name != "posix", reason="links of a system")
@pytest.mark.parametrize("command", WITH_OUT, ids=lambda one: one.name)
def test_an_impossible_out_is_refused_first(command, tmp_path, monkeypatch):
    """Nothing else is complained of, though nothing of what the example names is there."""
    monkeypatch.chdir(tmp_path)
    Path("loop").symlink_to("loop")
    Path("file").touch()
    words = shlex.split(command.example.removeprefix("aerotri "))
    for out, said in (("loop", "links form a loop"), ("n" * 300, "300 letters"), ("file/below", "'file' is no folder")):
        with pytest.raises(InputError, match=f"cannot be written: .*{said}"):
            invoke([*words, "--out", out])
    if command.name not in ("convert", "demcor"):
        with pytest.raises(InputError, match="file: is a file, a folder is to be written here"):
            invoke([*words, "--out", "file"])


def test_there_are_such_commands():
    assert len(WITH_OUT) > 15
