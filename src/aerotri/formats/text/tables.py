"""Tables at the edge: CSV or Parquet into text columns (distinct names and an index) and number columns, all checked.

CSV is parsed by pyarrow with every name column as text, so that 007 and NA stay what they are. A table remembers which
line each row stands on; nothing here loops over rows unless there is an error to locate.
"""

# pyright: reportUnknownParameterType=false
# (pyarrow has no types: what is annotated as its Table or Array is unknown to pyright)

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from aerotri.conventions import InputError
from aerotri.formats.text import csv_text
from aerotri.formats.text.arrow_compute import arrow_compute
from aerotri.formats.text.csv_text import BLANKS, CsvText
from aerotri.spreadsheet import MARKED

if TYPE_CHECKING:
    import pyarrow as pa

IGNORED_PREFIX = "x_"
LONGEST_NAME = 1000
"""Characters of a name at most; chosen [C]: no photograph or point needs more; a file without line ends would."""
NUMBER = r"^[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?$"
"""Every digit belongs to one part alone: with two ways to read it the time grows with the square of the length."""
LARGEST_NUMBER = 1e15
"""No coordinate, angle or σ is larger in any unit; numbers beyond lose their decimals, and squares of them overflow."""
LARGEST_FORMAT_PX = 1e7
"""Longest side of a photograph, pixels; chosen [C]: beyond any camera, so that only damaged files are refused."""
SMALLEST_POSITIVE = 1e-12
"""A σ or a focal length, which has to be greater than 0, is at least this in any unit, or its weight overflows."""
CONTROL_CHARACTERS = r"[\x00-\x1f\x7f]"
SURROGATES = r"[\ud800-\udfff]"
"""Halves of characters, as JSON may hold them: no file can be written with one."""


@dataclass(frozen=True)
class Columns:
    """The columns a table may have.

    Parameters
    ----------
    text, numbers : columns that must be there.
    optional_text, optional_numbers : columns that may be there.
    free_text : whether any other column is taken as text (grouping columns).
    """

    text: tuple[str, ...] = ()
    numbers: tuple[str, ...] = ()
    optional_text: tuple[str, ...] = ()
    optional_numbers: tuple[str, ...] = ()
    free_text: bool = False

    @property
    def required(self) -> tuple[str, ...]:
        return self.text + self.numbers

    @property
    def all_numbers(self) -> tuple[str, ...]:
        return self.numbers + self.optional_numbers

    @property
    def known(self) -> tuple[str, ...]:
        return self.text + self.optional_text + self.numbers + self.optional_numbers


@dataclass(frozen=True, eq=False)
class TextColumn:
    """A column of names.

    Parameters
    ----------
    names : (u,) the distinct names in order of first appearance, a pyarrow string array.
    index : (n,) which of them each row has.
    """

    names: pa.StringArray
    index: np.ndarray

    def rows(self) -> np.ndarray:
        """(n,) str, the name in every row."""
        return as_str_array(self.names)[self.index] if len(self.index) else np.zeros(0, "<U1")


@dataclass(frozen=True, eq=False)
class Table:
    """A table as read.

    Parameters
    ----------
    path : the file; length : number of rows n.
    text : the text columns by name.
    numbers : the number columns by name, (n,) each, NaN where the cell is empty.
    source : the CSV text, None for Parquet.
    first_row : rows of the file before these, where the table is a piece of it.
    """

    path: Path
    length: int
    text: Mapping[str, TextColumn]
    numbers: Mapping[str, np.ndarray]
    source: CsvText | None = field(default=None, repr=False)
    first_row: int = 0

    def error(self, row: int, message: str, remedy: str) -> InputError:
        """An `InputError` at a row, by the line of the file for CSV, by the number of the row for Parquet."""
        if self.source is None:
            return InputError(f"row {self.first_row + row + 1}: {message}", remedy, self.path)
        return InputError(message, remedy, self.path, self.source.line_of_row(row))

    def cell(self, column: str, row: int) -> str:
        """The text in a cell of a text column."""
        entry = self.text[column]
        return entry.names[int(entry.index[row])].as_py()

    def require(self, *columns: str) -> None:
        """Refuse empty cells.

        Raises
        ------
        InputError
            At the first empty cell.
        """
        for column in columns:
            if column in self.text:
                entry = self.text[column]
                empty = entry.names.index("").as_py() if len(entry.names) else -1
                rows = np.flatnonzero(entry.index == empty) if empty >= 0 else np.zeros(0, np.int64)
            else:
                rows = np.flatnonzero(np.isnan(self.numbers[column]))
            if len(rows):
                raise self.error(int(rows[0]), f"{column} is empty", f"give every row a value of {column}")

    def stack(self, *columns: str) -> np.ndarray:
        """(n, k) of number columns; NaN where a column is missing."""
        nothing = np.full(self.length, np.nan)
        return np.stack([self.numbers.get(column, nothing) for column in columns], axis=1)


def read_table(path: Path, columns: Columns, header: tuple[str, ...] | None = None) -> Table:
    """A table from a CSV file or, by its ending, from Parquet.

    Parameters
    ----------
    path : the file.
    columns : what it may hold.
    header : names of the columns where a CSV file has no header row.

    Raises
    ------
    InputError
        With file and line, for whatever is not a table of these columns: not UTF-8, rows with too few or too many
        cells, columns missing, unknown or twice, cells that are no finite numbers, names with line breaks.
    """
    if path.suffix == ".parquet":
        from aerotri.formats.text.parquet import load_parquet, with_kinds

        arrow, source = load_parquet(path), None
        names = tuple(arrow.column_names)
        check_header(names, columns, path, None)
        arrow = with_kinds(arrow, text_names(names, columns), [n for n in columns.all_numbers if n in names], path)
    else:
        source = csv_text.read_csv_text(path, header)
        check_header(source.header, columns, path, source.first_line - 1)
        arrow = parse_rows(source, columns)
    return checked_table(arrow, columns, path, source)


def as_str_array(names: pa.StringArray) -> np.ndarray:
    """(u,) str."""
    return np.array(names.to_pylist(), dtype=str) if len(names) else np.zeros(0, "<U1")


def check_header(header: tuple[str, ...], columns: Columns, path: Path, line: int | None) -> None:
    """Refuse a header with columns missing, unknown or twice, or without a name.

    Raises
    ------
    InputError
    """
    if "" in header:
        raise InputError("a column has no name", "name every column in the first row", path, line)
    odd = [name for name in header if len(name) > LONGEST_NAME or re.search(CONTROL_CHARACTERS, name)]
    if odd:
        raise InputError(f"{_shortened(repr(odd[0]))} is no name for a column", "name it by a short text", path, line)
    twice = [name for i, name in enumerate(header) if name in header[:i]]
    if twice:
        raise InputError(f"column '{twice[0]}' is there twice", "keep one of them", path, line)
    missing = [name for name in columns.required if name not in header]
    if missing:
        near = _hint_of_separator(header)
        raise InputError(
            f"column '{missing[0]}' is missing; the header is: {', '.join(header)}"[:400],
            near or f"the table needs the columns {', '.join(columns.required)}",
            path,
            line,
        )
    unknown = [name for name in header if name not in columns.known and not name.startswith(IGNORED_PREFIX)]
    if unknown and not columns.free_text:
        same = [name for name in columns.known if name.lower() == unknown[0].lower()]
        close = same or difflib.get_close_matches(unknown[0], columns.known, 1)
        meant = f"did you mean '{close[0]}'? " if close else ""
        raise InputError(
            f"unknown column '{unknown[0]}'",
            f"{meant}known are {', '.join(columns.known)}; a column of your own begins with {IGNORED_PREFIX}",
            path,
            line,
        )


def _hint_of_separator(header: tuple[str, ...]) -> str:
    if len(header) == 1 and any(mark in header[0] for mark in ";\t"):
        return "separate the cells by commas, with a point as decimal sign"
    return ""


def text_names(header: tuple[str, ...], columns: Columns) -> list[str]:
    """The columns of a header that are taken as text."""
    named = [name for name in columns.text + columns.optional_text if name in header]
    if not columns.free_text:
        return named
    return named + [name for name in header if name not in columns.known and not name.startswith(IGNORED_PREFIX)]


def parse_rows(source: CsvText, columns: Columns) -> pa.Table:
    """The rows by pyarrow; when that fails, once more as text, to find the culprit or to read what only looks odd."""
    import pyarrow as pa

    text = text_names(source.header, columns)
    numbers = [name for name in columns.all_numbers if name in source.header]
    kinds = {name: pa.string() for name in text} | {name: pa.float64() for name in numbers}
    if not source.has_rows():
        return pa.table({name: pa.array([], kind) for name, kind in kinds.items()})
    try:
        table = _parse_as(source, kinds)
    except pa.ArrowInvalid:
        try:
            table = _parse_as(source, dict.fromkeys(kinds, pa.string()))
        except pa.ArrowInvalid as error:
            raise csv_text.error_of_unparsable(source, str(error)) from error
        for name in numbers:
            at = table.column_names.index(name)
            table = table.set_column(at, name, _numbers_from_text(table.column(name), name, source))
    csv_text.check_line_count(source, table.num_rows)
    return table


def _parse_as(source: CsvText, kinds: dict[str, pa.DataType]) -> pa.Table:
    import pyarrow as pa
    from pyarrow import csv as arrow_csv

    return arrow_csv.read_csv(
        pa.BufferReader(pa.py_buffer(source.body)),
        read_options=arrow_csv.ReadOptions(column_names=list(source.header)),
        convert_options=arrow_csv.ConvertOptions(
            column_types=kinds, include_columns=list(kinds), strings_can_be_null=False, null_values=[""]
        ),
    )


def _numbers_from_text(column: pa.ChunkedArray, name: str, source: CsvText) -> pa.ChunkedArray:
    import pyarrow as pa

    compute = arrow_compute()
    text = compute.ascii_trim_whitespace(column)
    empty = compute.equal(text, "")
    good = compute.or_(empty, compute.match_substring_regex(text, NUMBER))
    row = compute.index(good, False).as_py()
    if row >= 0:
        raise InputError(
            f"{name} = {_shortened(repr(column[row].as_py()))} is not a number",
            "write numbers with a point as decimal sign; leave a cell empty where nothing is known",
            source.path,
            source.line_of_row(row),
        )
    digits = compute.if_else(empty, pa.scalar(None, pa.string()), compute.ascii_ltrim(text, characters="+"))
    return digits.cast(pa.float64())


def checked_table(arrow: pa.Table, columns: Columns, path: Path, source: CsvText | None, first_row: int = 0) -> Table:
    """Rows of text and float64 columns as a table.

    Raises
    ------
    InputError
        For names that are none, and numbers that are not finite.
    """
    bare = Table(path, arrow.num_rows, {}, {}, source, first_row)
    text = {n: _text_column(arrow.column(n), n, bare) for n in text_names(tuple(arrow.column_names), columns)}
    numbers = {n: _number_column(arrow.column(n), n, bare) for n in columns.all_numbers if n in arrow.column_names}
    return Table(path, arrow.num_rows, text, numbers, source, first_row)


def _text_column(column: pa.ChunkedArray, name: str, table: Table) -> TextColumn:
    compute = arrow_compute()
    encoded = column.dictionary_encode().combine_chunks()
    names, index = encoded.dictionary, encoded.indices.to_numpy().astype(np.int64)
    trimmed = compute.ascii_trim(names, characters=BLANKS)
    if table.source is not None:
        trimmed = compute.replace_substring_regex(trimmed, MARKED, r"\1")
    if not trimmed.equals(names):
        merged = trimmed.dictionary_encode()
        names, index = merged.dictionary, merged.indices.to_numpy().astype(np.int64)[index]
    odd = compute.or_(
        compute.match_substring_regex(names, CONTROL_CHARACTERS),
        compute.greater(compute.utf8_length(names), LONGEST_NAME),
    )
    bad = compute.index(odd, True).as_py()
    if bad >= 0:
        row = int(np.flatnonzero(index == bad)[0])
        shown = _shortened(repr(names[bad].as_py()))
        raise table.error(
            row,
            f"{name} = {shown} holds a control character or is longer than {LONGEST_NAME} characters",
            "names are short texts on one line",
        )
    return TextColumn(names, index)


def _number_column(column: pa.ChunkedArray, name: str, table: Table) -> np.ndarray:
    values = column.to_numpy()
    bad = ~(np.abs(values) <= LARGEST_NUMBER)
    if bad.any() and column.null_count < np.count_nonzero(bad):
        row = int(np.flatnonzero(bad & column.is_valid().to_numpy())[0])
        what = "is not possible" if np.isfinite(values[row]) else "is not a finite number"
        raise table.error(row, f"{name} = {values[row]} {what}", "leave the cell empty where nothing is known")
    return values


def _shortened(text: str) -> str:
    return text if len(text) <= 60 else text[:57] + "..."
