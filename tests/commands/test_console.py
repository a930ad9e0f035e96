"""What is said on the way: lines off a terminal, and a time left that does not jump."""

from __future__ import annotations

import pytest

from aerotri.commands import console as module
from aerotri.commands.console import Console, TimeLeft


@pytest.fixture
def clock(monkeypatch):
    """A clock that the test sets."""
    now = [0.0]
    monkeypatch.setattr(module.time, "monotonic", lambda: now[0])
    return now


def test_off_a_terminal_a_line_per_stage_and_every_tenth(clock, capsys):
    console = Console()
    console.progress("reading")
    for second in range(201):
        clock[0] = 10.0 + second
        console.work("matching", second / 200.0)
    console.progress("drawing")
    out, err = capsys.readouterr()
    lines = err.splitlines()
    assert out == ""
    assert lines[0] == "aerotri: matching: 0 %"
    assert [line.split(":")[2].split(",")[0].strip() for line in lines[1:11]] == [f"{k}0 %" for k in range(1, 11)]
    assert lines[5] == "aerotri: matching: 50 %, 100 s left" or lines[5].endswith("50 %, 2 min left")
    assert lines[11:] == ["aerotri: drawing"]


def test_short_commands_and_json_say_nothing(clock, capsys):
    Console().progress("reading")
    Console().work("matching", 0.5)
    console = Console(quiet=True)
    for second in range(100):
        clock[0] = float(second)
        console.work("matching", second / 100.0)
        console.progress(f"iteration {second}")
    assert capsys.readouterr() == ("", "")


def test_a_first_piece_of_another_size_does_not_count():
    """Compiling takes 60 s of the first hundredth; 100 s remain, not 6000."""
    left = TimeLeft(0.0)
    assert left.after(0.01, 60.0) is None
    assert left.after(0.10, 69.0) is not None
    assert left.after(0.5, 109.0) == pytest.approx(50.0)
    assert left.after(0.9, 149.0) == pytest.approx(10.0)


def test_a_tiny_first_piece_promises_nothing():
    left = TimeLeft(0.0)
    assert left.after(1e-3, 1.3) is None
    assert left.after(0.02, 100.0) is None


def test_whoever_stops_reading_does_not_stop_the_work(clock, monkeypatch):
    class Closed:
        def write(self, text):
            raise BrokenPipeError

        def flush(self):
            raise BrokenPipeError

        def isatty(self):
            return True

    monkeypatch.setattr(module.sys, "stderr", Closed())
    Console().progress("reading")
