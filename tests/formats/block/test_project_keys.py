"""[project] of block.toml: read, written and read again, in results, refused with a line where it is wrong."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

import aerotri
from aerotri.conventions import InputError
from aerotri.formats.block.folder import read_block, write_block
from aerotri.observations.project import Project
from rolling_blocks import rolling_block

HOSTILE = '<script>alert(1)</script> #read("/etc/passwd") *_$ "quoted" \\ end'
FULL = Project(HOSTILE, "Kieswerk Nörd", "A. Operator", "Survey & Co", "2026-05-12", "first line\nsecond *line*")


@pytest.fixture
def folder(tmp_path):
    """A block without [project]; each test appends it."""
    write_block(rolling_block(1)[0], tmp_path / "block")
    return tmp_path / "block"


def with_project(folder, text):
    """The block with lines of [project]."""
    path = folder / "block.toml"
    path.write_text(path.read_text(encoding="utf-8") + "\n[project]\n" + text + "\n", encoding="utf-8")
    return folder


def test_a_block_without_project_says_nothing_of_it(folder):
    assert "[project]" not in (folder / "block.toml").read_text()
    assert read_block(folder).project == Project()


def test_what_is_written_is_read_again(folder, tmp_path):
    write_block(replace(read_block(folder), project=FULL), tmp_path / "copy")
    assert read_block(tmp_path / "copy").project == FULL


@pytest.mark.parametrize(
    ("text", "key", "words"),
    [
        ("title = 3", "project.title", "names in quotes"),
        ("survey_date = 2026-05-12", "project.survey_date", "names in quotes"),
        ('survey_date = "12.05.2026"', "project.survey_date", "YYYY-MM-DD"),
        ('survey_date = "2026-02-30"', "project.survey_date", "YYYY-MM-DD"),
        ('customer = "x"', "project.customer", "client"),
        ('title = "a\\u0007b"', "project.title", "control characters"),
        ('notes = "a\\u001bb"', "project.notes", "control characters"),
        (f'client = "{"x" * 201}"', "project.client", "200"),
    ],
)
def test_refused_with_line(folder, text, key, words):
    with pytest.raises(InputError) as caught:
        read_block(with_project(folder, text))
    error = caught.value
    line = (folder / "block.toml").read_text().splitlines().index(text) + 1
    assert key in error.message
    assert words in f"{error.message} {error.remedy}"
    assert (error.file.name, error.line) == ("block.toml", line)


def test_results_carry_it(folder, tmp_path):
    write_block(replace(read_block(folder), project=FULL), tmp_path / "given")
    result = aerotri.adjust(tmp_path / "given")
    result.save(tmp_path / "result")
    assert json.loads((tmp_path / "result" / "adjustment.json").read_text())["project"] == FULL.as_dict()
    assert read_block(tmp_path / "result" / "block").project == FULL
    page = (tmp_path / "result" / "report.html").read_text()
    assert "&lt;script&gt;alert(1)" in page
    assert "<script>alert(1)" not in page
    assert "<dt>Client</dt><dd>Kieswerk Nörd</dd>" in page
    assert '<dd class="more">second *line*</dd>' in page
