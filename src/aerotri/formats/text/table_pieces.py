"""A table read piece by piece: as `tables.read_table` gives it, some rows at a time, never the whole file at once."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from aerotri.conventions import regular_file
from aerotri.formats.text.csv_text import csv_text_of, unreadable, without_mark
from aerotri.formats.text.tables import Columns, Table, check_header, checked_table, parse_rows, text_names

PIECE_BYTES = 4 << 20
"""Text of a piece [C]: some 80 000 image points."""
PIECE_ROWS = 80_000
"""Rows of a piece of a Parquet file, likewise."""


def table_pieces(path: Path, columns: Columns) -> Iterator[Table]:
    """The rows of a CSV or Parquet file in pieces, in order; each knows its lines or rows in the file.

    Raises
    ------
    InputError
        As `read_table`; what only shows later in the file is raised when its piece is read.
    """
    return (_parquet_pieces if path.suffix == ".parquet" else _csv_pieces)(path, columns)


def _csv_pieces(path: Path, columns: Columns) -> Iterator[Table]:
    header: tuple[str, ...] | None = None
    line, first_row = 1, 0
    for raw in _whole_lines(path):
        source = csv_text_of(raw, path, header, line)
        if header is None:
            header = source.header
            check_header(header, columns, path, source.first_line - 1)
        table = checked_table(parse_rows(source, columns), columns, path, source, first_row)
        yield table
        line, first_row = line + len(raw.splitlines()), first_row + table.length


def _whole_lines(path: Path) -> Iterator[bytes]:
    """The bytes of a file in pieces that end with a line; one piece, maybe without any, at least."""
    regular_file(path)
    try:
        with path.open("rb") as file:
            raw = without_mark(file.read(PIECE_BYTES)) + file.readline()
            yield raw
            while raw := file.read(PIECE_BYTES):
                yield raw + file.readline()
    except OSError as error:
        raise unreadable(path, error) from error


def _parquet_pieces(path: Path, columns: Columns) -> Iterator[Table]:
    from aerotri.formats.text.parquet import batches, with_kinds

    first_row = 0
    for arrow in batches(path, PIECE_ROWS):
        names = tuple(arrow.column_names)
        check_header(names, columns, path, None)
        arrow = with_kinds(arrow, text_names(names, columns), [n for n in columns.all_numbers if n in names], path)
        yield checked_table(arrow, columns, path, None, first_row)
        first_row += arrow.num_rows
