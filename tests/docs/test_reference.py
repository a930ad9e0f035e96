"""Pages of the reference: every public name is on the page of the package, every key, file and option on its own."""

from __future__ import annotations

import importlib.util
import re

import pages
import pytest

import aerotri
from aerotri.cli.app import app
from aerotri.reference.block_keys import block_keys
from aerotri.reference.command_lines import command_lines
from aerotri.reference.files import described_files


@pytest.fixture(scope="module")
def made():
    """The extension that makes the pages."""
    spec = importlib.util.spec_from_file_location("pages_made", pages.DOCS / "_extensions" / "reference_pages.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_public_name_is_on_the_page(made):
    """By itself, or, of a module, with what it offers."""
    listed = re.findall(r"^   aerotri\.([A-Za-z_.]+)$", made.python_page(), re.MULTILINE)
    assert {name.partition(".")[0] for name in listed} == {name for name in aerotri.__all__ if name != "__version__"}
    assert "predict.volume" in listed
    assert len(listed) == len(set(listed))


def test_every_key_has_a_row(made):
    page = made.block_toml_page()
    assert page.count("\n| `") == len(block_keys()) + 3
    assert all(f"| `{key.name.rsplit('.', 1)[-1]}` |" in page for key in block_keys())


def test_every_file_has_a_place(made):
    """A file of a new place has to get a page; the tables of a block have their own."""
    places = {one.place for one in described_files()}
    assert places == {*made.GROUPS, "block folder"}
    text = made.block_tables_page() + "".join(made.output_page(page) for page, _ in made.GROUPS.values())
    for described in described_files():
        assert re.search(rf"^#+ `?{re.escape(described.name)}`?$", text, re.MULTILINE), described.label


def test_every_option_has_a_row(made):
    overview = made.commands_page(command_lines(app))
    for command in command_lines(app):
        assert f"[`aerotri {command.name}`]" in overview
        page = made.command_page(command)
        for option in command.options:
            assert f"| `{option.names[0]}`" in page


def test_parameters_of_a_docstring_stand_apart_from_what_they_are(made):
    lines = [
        "Adjust.",
        "",
        "Parameters",
        "----------",
        "block : a block,",
        "    or its folder.",
        "",
        "Raises",
        "------",
        "x : y",
    ]
    made.with_descriptions_apart(lines)
    assert lines[4:7] == ["block", "    a block,", "    or its folder."]
    assert lines[-1] == "x : y"
