"""The operator's marks and decisions: a row of edits.csv each, on the disk before the page hears of it."""

from __future__ import annotations

import contextlib
import csv
import io
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from aerotri.conventions import InputError
from aerotri.formats.block.journal import ACTIONS, EDIT_COLUMNS, GIVEN, MARK, ON, REMOVE, UNDO, standing_rows
from aerotri.formats.files.atomic import atomic_file
from aerotri.formats.files.places import not_written
from aerotri.formats.text.tables import CONTROL_CHARACTERS, LONGEST_NAME, SURROGATES, read_table
from aerotri.spreadsheet import plain_row

NAME = "edits.csv"
COLUMNS = ("time", "image", "point", "action", "column", "row", "old_column", "old_row", "reason",
           "X", "Y", "Z", "sX", "sY", "sZ")  # fmt: skip
LONGEST_REASON = 500
METRE_DIGITS = 5
DIGITS = 3
"""Of a position in pixels: a thousandth is far below what anybody measures."""


@dataclass(frozen=True)
class Decision:
    """A row of the journal.

    Parameters
    ----------
    action : of `formats.block.journal.ACTIONS`. image, point : names, '' where none is meant.
    place, before : column and row, px, of a mark and before it was set; None where there is none.
    time : UTC, ISO 8601. reason : in words.
    given : m, X, Y, Z and their σ of a new control or check point; None otherwise.
    """

    action: str
    image: str = ""
    point: str = ""
    place: tuple[float, float] | None = None
    before: tuple[float, float] | None = None
    reason: str = ""
    time: str = ""
    given: tuple[float, ...] | None = None

    def cells(self) -> list[str]:
        """In the order of `COLUMNS`."""
        places = [f"{value:.{DIGITS}f}" for place in (self.place, self.before) for value in place or ()]
        at = places[:2] if self.place else ["", ""]
        old = places[-2:] if self.before else ["", ""]
        given = [f"{value:.{METRE_DIGITS}f}" for value in self.given or ()] or [""] * 6
        return [self.time, self.image, self.point, self.action, *at, *old, self.reason, *given]


class Decisions:
    """edits.csv of a block; rows are added and never changed.

    Parameters
    ----------
    folder : of the block.

    Raises
    ------
    InputError
        When the file there is damaged, or is a Parquet table.
    """

    def __init__(self, folder: Path):
        self.folder, self._path = folder, folder / NAME
        if self._path.with_suffix(".parquet").exists():
            raise InputError("cannot be added to", f"write it as {NAME}", self._path.with_suffix(".parquet"))
        self._rows = _read(self._path)
        self._size = _size(self._path)

    @property
    def rows(self) -> tuple[Decision, ...]:
        """All rows, the oldest first."""
        return tuple(self._rows)

    def standing(self) -> list[Decision]:
        """Rows that were not taken back, the oldest first."""
        return [self._rows[row] for row in standing_rows([one.action for one in self._rows]) or []]

    def marks(self) -> Mapping[tuple[str, str], Decision]:
        """The last mark, or removal of one, of every photograph and point."""
        return {(one.image, one.point): one for one in self.standing() if one.action in (MARK, REMOVE)}

    def places(self) -> Mapping[tuple[str, str], Decision]:
        """Where every measurement that was ever touched is now, as a mark; as a removal where it is not measured.

        Where all about it was taken back, it is where it was before the first mark.
        """
        touched: dict[tuple[str, str], Decision] = {}
        for one in self._rows:
            if one.action in (MARK, REMOVE) and (one.image, one.point) not in touched:
                action = REMOVE if one.before is None else MARK
                touched[one.image, one.point] = Decision(action, one.image, one.point, one.before)
        return touched | dict(self.marks())

    def switches(self) -> Mapping[tuple[str, str], Decision]:
        """The last decision about every ray and point, photograph '' where the point is meant; those that are on."""
        last = {(one.image, one.point): one for one in self.standing() if one.action not in (MARK, REMOVE, *GIVEN)}
        return {key: one for key, one in last.items() if one.action != ON}

    def given(self) -> Mapping[str, Decision]:
        """The new control and check points by their names."""
        return {one.point: one for one in self.standing() if one.action in GIVEN}

    def add(self, decision: Decision) -> Decision:
        """Write a row; it is on the disk when this returns.

        Raises
        ------
        InputError
            When it cannot be written, or there is nothing to take back.
        """
        if _size(self._path) != self._size:
            # somebody else has added to it: another page, or a person with an editor
            self._rows = _read(self._path)
        if decision.action not in ACTIONS:
            raise InputError(f"'{decision.action[:30]}' is no action", f"known are {', '.join(ACTIONS)}")
        if decision.action == UNDO and not self.standing():
            raise InputError("nothing is left to be taken back", "nothing was decided, or all of it was taken back")
        for name in (decision.image, decision.point):
            _refuse_unwritable(name)
        reason = _on_one_line(decision.reason)[:LONGEST_REASON]
        now = datetime.now(UTC).isoformat(timespec="milliseconds")
        row = replace(decision, reason=reason, time=now)
        try:
            _append(self._path, row)
        except OSError as error:
            raise not_written(self._path, error) from None
        self._rows.append(row)
        self._size = _size(self._path)
        return row

    def undo(self) -> Decision:
        """Take back the last row that stands; gives that row."""
        self.add(Decision(UNDO))
        taken = standing_rows([one.action for one in self._rows[:-1]]) or []
        return self._rows[taken[-1]]


def _refuse_unwritable(name: str) -> None:
    """Refuse a name that could not be read back.

    Raises
    ------
    InputError
    """
    if len(name) > LONGEST_NAME or re.search(f"{CONTROL_CHARACTERS}|{SURROGATES}", name):
        raise InputError(f"{_on_one_line(name)[:60]!r} cannot be a name", "names are short texts on one line")


def _on_one_line(text: str) -> str:
    """A text without line breaks, control characters and halves of characters, none of which a table may hold."""
    return " ".join(re.sub(f"{CONTROL_CHARACTERS}|{SURROGATES}", " ", text).split())


def _read(path: Path) -> list[Decision]:
    """The rows of a file; what a killed program has left of a row is taken off."""
    if not path.is_file() or not path.read_bytes().strip():
        return []
    _mend(path)
    table = read_table(path, EDIT_COLUMNS)
    text = {name: column.rows() for name, column in table.text.items()}

    def cell(name: str, row: int) -> str:
        return str(text[name][row]) if name in text else ""

    at, before = table.stack("column", "row"), table.stack("old_column", "old_row")
    given = table.stack("X", "Y", "Z", "sX", "sY", "sZ")
    return [
        Decision(
            cell("action", row), cell("image", row), cell("point", row), _pair(at[row]), _pair(before[row]),
            cell("reason", row), cell("time", row), _six(given[row]),
        )
        for row in range(table.length)
    ]  # fmt: skip


def _pair(values: Any) -> tuple[float, float] | None:
    return None if values[0] != values[0] else (float(values[0]), float(values[1]))


def _six(values: Any) -> tuple[float, ...] | None:
    return None if values[0] != values[0] else tuple(float(value) for value in values)


def _mend(path: Path) -> None:
    """Take off a last row that was not written to its end; end a whole one with a line break."""
    raw = path.read_bytes()
    if raw.endswith(b"\n"):
        return
    whole, _, last = raw.rpartition(b"\n")
    cells = next(csv.reader([last.decode("utf-8", "replace")]), [])
    header = next(csv.reader([raw.split(b"\n", 1)[0].decode("utf-8", "replace")]), [])
    kept = raw + b"\n" if len(cells) == len(header) and last.count(b'"') % 2 == 0 else whole + b"\n"
    with atomic_file(path) as place:
        place.write_bytes(kept)


def _append(path: Path, row: Decision) -> None:
    """One write of one row, brought to the disk; a file of other columns gets those of a journal first."""
    if _header(path) != COLUMNS:
        _rewrite(path)
    before = path.stat().st_size
    try:
        with path.open("ab") as file:
            file.write(_line(row.cells()))
            file.flush()
            os.fsync(file.fileno())
    except OSError:
        # a full disk may have taken a part of the row
        with contextlib.suppress(OSError):
            os.truncate(path, before)
        raise


def _size(path: Path) -> int:
    return path.stat().st_size if path.is_file() else 0


def _header(path: Path) -> tuple[str, ...]:
    if not path.is_file():
        return ()
    with path.open(encoding="utf-8-sig", newline="") as file:
        lines = (line for line in file if line.strip() and not line.lstrip().startswith("#"))
        return tuple(next(csv.reader(lines), []))


def _rewrite(path: Path) -> None:
    """The rows so far in a file with the columns of a journal; comments go to its top."""
    rows = _read(path)
    old = path.read_bytes().splitlines() if path.is_file() else []
    comments = b"".join(line + b"\n" for line in old if line.lstrip().startswith(b"#"))
    with atomic_file(path) as place:
        lines = (_line(cells) for cells in (COLUMNS, *(row.cells() for row in rows)))
        place.write_bytes(comments + b"".join(lines))


def _line(cells: Sequence[str]) -> bytes:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(plain_row(cells))
    return text.getvalue().encode("utf-8")
