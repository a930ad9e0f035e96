"""The names of the columns of a list, and the rows below them: in a row, in a comment, or stated by the user."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from aerotri.conventions import InputError
from aerotri.formats.foreign.list_systems import OF_TOTALS
from aerotri.formats.text.list_columns import ListColumn, is_unit, list_column, looks_like_unit
from aerotri.formats.text.tables import LONGEST_NAME
from aerotri.formats.text.text_lines import TextFile, all_numbers, first_lines

TITLES = 9
"""Rows of titles above the names of the columns at most [C]."""
MOST_COLUMNS = 1000
"""Columns of a list at most; chosen [C]: no program writes as many; a file of another kind on one long line would."""
NAME_ORDER = ("label", "name", "imagename", "image", "photo", "filename", "punkt", "point", "gcp", "marker", "target")
"""Of several columns of names the one whose name begins so is taken; cameras and numbers come last."""
LETTERS = {"P": "name", "N": "Y", "E": "X", "Z": "Z", "X": "X", "Y": "Y", "H": "Z", "D": "", "-": ""}
"""Letters of --columns: point, northing, easting, height, description."""
COORDINATES = ("X", "Y", "Z", "lon", "lat")
SEPARATORS = ",;\t|"
NUMBER_WITH_COMMA = re.compile(r"[+-]?\d+,\d+(?:[eE][+-]?\d+)?")


@dataclass(frozen=True, eq=False)
class Header:
    """The names of the columns: what they hold, what separates the cells, and the line they stand in (None: stated)."""

    columns: tuple[ListColumn, ...]
    separator: str | None
    line: int | None

    @property
    def meanings(self) -> set[str]:
        return {column.meaning for column in self.columns if column.meaning}


def is_named_list(path: Path, columns: str = "") -> bool:
    """Whether the columns have names, or are stated, among them one of names and at least two coordinates."""
    header = header_of(first_lines(path, 40, comments=False), columns)
    return header is not None and "name" in header.meanings


def is_named_orientations(path: Path) -> bool:
    """Whether positions and ω, φ, κ are among the names of the columns."""
    header = header_of(first_lines(path, 40, comments=False))
    return header is not None and {"name", "X", "Y", "Z", "omega", "phi", "kappa"} <= header.meanings


def has_attitudes(path: Path) -> bool:
    """Whether positions, yaw, pitch and roll are among the names of the columns: a list of photographs."""
    header = header_of(first_lines(path, 40, comments=False))
    return header is not None and {"name", "yaw", "pitch", "roll"} <= header.meanings


def is_named(path: Path) -> bool:
    """Whether the columns of a list have names, so that they are not known by their number."""
    return header_of(first_lines(path, 40, comments=False)) is not None


def stated_columns(text: str) -> tuple[ListColumn, ...]:
    """The columns that the user states: letters such as PNEZD, or names separated by commas; - for one left out.

    Raises
    ------
    InputError
        When one of them is not known, or there is no name or no coordinate.
    """
    if not text:
        return ()
    letters = "," not in text and all(letter in LETTERS for letter in text.upper())
    found = tuple(
        ListColumn(word, LETTERS[word.upper()]) if letters else list_column(word.strip() if word.strip() != "-" else "")
        for word in (text if letters else text.split(","))
    )
    odd = [column.name for column in found if not letters and column.name and not column.meaning]
    meanings = {column.meaning for column in found}
    if odd or "name" not in meanings or len(meanings & set(COORDINATES)) < 2:
        what = f"'{odd[0][:40]}' is no column" if odd else "no name, or no two coordinates"
        raise InputError(
            f"--columns '{text[:80]}': {what}", "write letters such as PNEZD, or names: --columns name,X,Y,Z,sX,sY,sZ"
        )
    return found


def header_of(lines: Sequence[str], columns: str = "") -> Header | None:
    """The names of the columns; None where nothing names two coordinates."""
    data = next((i for i, line in enumerate(lines) if not line.startswith("#")), len(lines))
    if columns:
        first = lines[data] if data < len(lines) else ""
        return Header(stated_columns(columns), _separator(first), None)
    # the first row, a comment above it, or a row below a title
    for number in (
        *range(data, min(data + 1, len(lines))),
        *range(data - 1, -1, -1),
        *range(data + 1, len(lines))[:TITLES],
    ):
        for names, separator in _ways_to_split(lines, number, data):
            found = tuple(map(list_column, names[: MOST_COLUMNS + 1]))
            if sum(column.meaning in COORDINATES for column in found) > 1:
                return Header(_with_one_name(found), separator, number)
    return None


def _ways_to_split(lines: Sequence[str], number: int, data: int) -> list[tuple[list[str], str | None]]:
    """Names in a line, and what separates the cells of the rows; a comment names columns if these are as many.

    Parameters
    ----------
    data : the first line that is no comment.
    """
    line = lines[number].lstrip("# ")
    own = _separator(line)
    if number >= data or data == len(lines):
        return [(cells(line, own), own)]
    rows, found = lines[data : data + TITLES], []
    of_rows = _separator(rows[0])
    for of_names, separator in ((own, own), (of_rows, of_rows), (own, of_rows)):
        names = cells(line, of_names)
        # words of a sentence are no names of columns that something else separates
        if (of_names or separator is None) and any(_is_row_of(row, separator, len(names)) for row in rows):
            found.append((names, separator))
    return found


def _is_row_of(line: str, separator: str | None, count: int) -> bool:
    """Whether a line has as many cells, empty ones behind them aside; blanks behind commas separate nothing."""
    words = cells(line, separator)
    parted = separator is not None or not any(word.endswith(tuple(SEPARATORS)) for word in words)
    return parted and len(words) >= count and not any(words[count:])


def _with_one_name(columns: tuple[ListColumn, ...]) -> tuple[ListColumn, ...]:
    """The columns with the best one of names alone."""
    named = [i for i, column in enumerate(columns) if column.meaning == "name"]
    if len(named) < 2:
        return columns

    def rank(i: int) -> int:
        plain = re.sub(r"[^a-z]", "", columns[i].name.lower())
        return next((k for k, word in enumerate(NAME_ORDER) if plain.startswith(word)), len(NAME_ORDER))

    best = min(named, key=rank)
    return tuple(
        replace(column, meaning="") if i in named and i != best else column for i, column in enumerate(columns)
    )


def _separator(line: str) -> str | None:
    most = max(SEPARATORS, key=line.count)
    return most if most in line else None


def cells(line: str, separator: str | None) -> list[str]:
    """The cells of a line, quotes taken off; separated by blanks where there is no separator."""
    if separator is None and '"' not in line:
        return line.split()
    try:
        words = next(csv.reader([line], delimiter=separator or " ", skipinitialspace=True), [])
    except csv.Error:
        # a cell longer than any name or number
        return [line[:LONGEST_NAME]]
    return [word.strip() for word in words if separator is not None or word]


def check_header(file: TextFile, header: Header) -> None:
    row, columns = header.line or 0, header.columns
    if len(columns) > MOST_COLUMNS or any(len(column.name) > LONGEST_NAME for column in columns):
        longest = max(len(column.name) for column in columns)
        message = f"the header has {len(columns)} columns, the longest of {longest} characters"
        raise file.error(row, message, "the first row names the columns by short texts")
    if "name" not in header.meanings:
        names = ", ".join(column.name for column in columns)
        raise file.error(row, f"no column holds names: {names}"[:300], "name one of them 'name'")
    seen: dict[str, str] = {}
    for column in columns:
        if column.meaning in seen:
            message = f"columns '{seen[column.meaning]}' and '{column.name}' are both {column.meaning}"
            raise file.error(row, message, "rename one of them")
        if column.meaning:
            seen[column.meaning] = column.name
        if np.isnan(column.factor) and (is_unit(column.unit) or looks_like_unit(column.unit)):
            message = f"column '{column.name}' cannot be in '{column.unit}'"
            raise file.error(row, message, "write units such as (m), (ft), (US survey ft), (deg), (gon)")
    if not {"X", "Y"} & header.meanings and len({"lon", "lat"} & header.meanings) == 1:
        raise file.error(row, "there is no longitude, or no latitude", "name both, or X and Y")


def rows_below(file: TextFile, header: Header) -> tuple[Header, list[int]]:
    """Rows that hold data: below the header, no comments, no sums; and the header with the units of one passed over.

    Raises
    ------
    InputError
        When a row that begins with # is like the others: a point may be called so.
    """
    rows = []
    for row in range(0 if header.line is None else header.line + 1, len(file)):
        line = file.lines[row]
        if OF_TOTALS.match(line):
            continue
        words = cells(line, header.separator)
        if not line.startswith("#"):
            rows.append(row)
        elif len(words) == len(header.columns) and sum(map(_is_number, words)) > 1:
            raise file.error(row, f"'{words[0][:40]}' begins with #, as comments do", "is it a point? rename it")
    if header.line is not None or not rows:
        return header, rows
    words = cells(file.lines[rows[0]], header.separator)
    if any(map(_is_number, words)):
        return header, rows
    # the user stated the columns of a list that has names of its own
    return replace(header, columns=_agreed(file, rows[0], header.columns, words)), rows[1:]


def _agreed(file: TextFile, row: int, stated: tuple[ListColumn, ...], words: list[str]) -> tuple[ListColumn, ...]:
    """Stated columns with the units that the list has for them.

    Raises
    ------
    InputError
        When the list calls a coordinate otherwise.
    """
    found = []
    for column, own in zip(stated, map(list_column, words), strict=False):
        if column.meaning != own.meaning and {column.meaning, own.meaning} <= set(COORDINATES):
            message = f"column '{own.name[:40]}' is stated as {column.meaning}"
            raise file.error(row, message, "leave --columns out: the list names its columns")
        found.append(replace(column, name=own.name, unit=own.unit, factor=own.factor) if own.unit else column)
    return (*found, *stated[len(found) :])


def _is_number(word: str) -> bool:
    return all_numbers([plain_number(word, decimal_comma=True)])


def plain_number(word: str, decimal_comma: bool) -> str:
    """A number with a minus as it is printed, or a decimal comma, as one that can be read; other words as they are."""
    word = word.replace("\u2212", "-")
    return word.replace(",", ".") if decimal_comma and NUMBER_WITH_COMMA.fullmatch(word) else word
