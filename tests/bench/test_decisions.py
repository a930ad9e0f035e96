"""edits.csv as the bench writes it: a row at a time, never lost, read back the same."""

from __future__ import annotations

import errno
from dataclasses import replace

import pytest

from aerotri.bench.decisions import COLUMNS, NAME, Decision, Decisions
from aerotri.conventions import InputError
from aerotri.formats.block.journal import MARK, REMOVE, UNDO

HOSTILE = ('=HYPERLINK("http://evil")', "<b>bold</b>", 'a,"quoted"', "-5b", "'@x", "# no comment", "Größe 3")


def test_rows_are_read_back_as_they_were(tmp_path):
    first = Decisions(tmp_path)
    for name in HOSTILE:
        first.add(Decision(MARK, name, name, (10.12345, 20.5), (1.0, 2.0), f"why {name}"))
    first.add(Decision("off", "", "p1", reason="two\nlines"))
    again = Decisions(tmp_path)
    assert again.rows == tuple(one if one.place is None else replace(one, place=(10.123, 20.5)) for one in first.rows)
    assert [one.image for one in again.rows][:-1] == list(HOSTILE)
    assert again.rows[-1].reason == "two lines"


def test_undo_goes_back_to_the_beginning_and_keeps_every_row(tmp_path):
    decisions = Decisions(tmp_path)
    for k in range(5):
        decisions.add(Decision(MARK, "a", f"p{k}", (float(k), 0.0)))
    assert [decisions.undo().point for _ in range(5)] == ["p4", "p3", "p2", "p1", "p0"]
    with pytest.raises(InputError, match="nothing is left"):
        decisions.undo()
    assert not decisions.standing()
    assert len(Decisions(tmp_path).rows) == 10
    assert [one.action for one in Decisions(tmp_path).rows][5:] == [UNDO] * 5


def test_every_row_is_on_the_disk_when_add_returns(tmp_path, monkeypatch):
    synced = []
    monkeypatch.setattr("os.fsync", lambda number: synced.append((tmp_path / NAME).read_text()))
    decisions = Decisions(tmp_path)
    decisions.add(Decision(REMOVE, "a", "p1"))
    assert "a,p1,remove" in synced[-1]


@pytest.mark.parametrize("cut", [1, 5, 20, 40])
def test_row_torn_by_a_kill_is_taken_off_and_the_others_stay(tmp_path, cut):
    decisions = Decisions(tmp_path)
    decisions.add(Decision(MARK, "a", "p1", (1.5, 2.5), None, "first"))
    decisions.add(Decision(MARK, "a", "p2", (3.5, 4.5), (1.0, 1.0), 'the "second"'))
    raw = (tmp_path / NAME).read_bytes()
    (tmp_path / NAME).write_bytes(raw[:-cut])
    again = Decisions(tmp_path)
    assert again.rows[0].point == "p1"
    assert len(again.rows) == (2 if cut == 1 else 1)
    again.add(Decision(MARK, "a", "p3", (5.0, 6.0)))
    assert [one.point for one in Decisions(tmp_path).rows][-1] == "p3"


def test_two_pages_on_one_block_see_each_other(tmp_path):
    first, second = Decisions(tmp_path), Decisions(tmp_path)
    first.add(Decision(MARK, "a", "p1", (1.0, 1.0)))
    second.add(Decision(MARK, "a", "p2", (1.0, 1.0)))
    assert first.undo().point == "p2"
    assert second.undo().point == "p1"
    assert [one.action for one in Decisions(tmp_path).rows] == [MARK, MARK, UNDO, UNDO]


def test_table_of_a_person_becomes_a_journal_and_keeps_what_it_says(tmp_path):
    (tmp_path / NAME).write_text("# my notes\nimage,point,action,reason\na,p2,off,blurred\n,p1,check,\n")
    decisions = Decisions(tmp_path)
    decisions.add(Decision("off", "b", "p1", reason="twice"))
    text = (tmp_path / NAME).read_text()
    assert text.startswith("# my notes\n" + ",".join(COLUMNS))
    assert [(one.image, one.point, one.action, one.reason) for one in Decisions(tmp_path).rows] == [
        ("a", "p2", "off", "blurred"), ("", "p1", "check", ""), ("b", "p1", "off", "twice"),
    ]  # fmt: skip


def test_row_that_a_full_disk_did_not_take_is_told_and_leaves_nothing(tmp_path, monkeypatch):
    decisions = Decisions(tmp_path)
    decisions.add(Decision(MARK, "a", "p1", (1.0, 1.0)))
    before = (tmp_path / NAME).read_bytes()

    def full(number: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(InputError, match=r"the disk is full; .* [MG]iB free in '"):
        decisions.add(Decision(MARK, "a", "p2", (1.0, 1.0)))
    assert len(decisions.rows) == 1
    assert (tmp_path / NAME).read_bytes() == before


def test_what_no_table_can_hold_is_not_written(tmp_path):
    """A control character, or half of a character out of JSON: nothing could open the block any more."""
    decisions = Decisions(tmp_path)
    decisions.add(Decision("off", "", "p1", reason="nul \x00, escape \x1b[31m, half \ud83d, tab \t, end"))
    for name in ("a\x00", "b\x1b[2J", "c\ud83d", "d" * 1001):
        with pytest.raises(InputError, match="cannot be a name"):
            decisions.add(Decision("off", "", name, reason="why"))
        with pytest.raises(InputError, match="cannot be a name"):
            decisions.add(Decision("off", name, "p1", reason="why"))
    assert [one.reason for one in Decisions(tmp_path).rows] == ["nul , escape [31m, half , tab , end"]
