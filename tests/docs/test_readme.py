"""The README: a screen and a half, and its commands and lines of Python as printed."""

import pages
import pytest
from matplotlib import pyplot

from places import PROJECT

README = PROJECT / "README.md"
LONGEST = 119
"""Lines; the project asks for fewer than 120."""


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A folder that looks like the repository."""
    (tmp_path / "blocks").symlink_to(PROJECT / "blocks", target_is_directory=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_it_is_short():
    assert len(README.read_text(encoding="utf-8").splitlines()) <= LONGEST


def test_its_two_commands():
    shell = [text for language, _, text in pages.fences(README) if language == "sh"]
    first, second = shell[0].splitlines()
    assert first.startswith("pip install . && aerotri adjust blocks/frederiksstad_ultracam")
    assert second == "pip install '.[test]' && pytest"


def test_its_lines_of_python(place, capsys):
    lines = [text for language, _, text in pages.fences(README) if language == "python"]
    assert len(lines) == 1
    exec(compile(lines[0], str(README), "exec"), {})
    pyplot.close("all")
    assert capsys.readouterr().out.startswith("accepted 1.1")
    assert (place / "errors.png").stat().st_size > 10_000
    assert (place / "out" / "report.html").is_file()


def test_the_run_is_that_of_the_drone_site():
    """tests/commands/test_drone_site.py follows it there."""
    beside = PROJECT / "blocks" / "drone_site" / "README.md"
    run = [words for words in pages.page_commands(README) if words[0] == "run"]
    there = [words for _, _, text in pages.fences(beside) for words in pages.commands(text) if words[0] == "run"]
    assert run == there
