"""The text of a CSV table: comments, header, the line of a row, and what is wrong with a file that will not parse.

pyarrow parses the rows; it knows neither comments nor the lines of the file, which is what stands here. Nothing in
this module is slow unless the file is in error.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerotri.conventions import InputError, regular_file
from aerotri.formats.text.encodings import UTF8_REMEDY
from aerotri.spreadsheet import with_formula

QUOTE = b'"'
BLANKS = " \t\n\r\v\f"
"""What is taken off both ends of a name."""


@dataclass(frozen=True)
class CsvText:
    """A CSV file with its comments blanked, lines kept.

    Parameters
    ----------
    path : the file.
    header : names of the columns.
    body : the bytes below the header.
    first_line : line of the file that the body begins on, from 1.
    """

    path: Path
    header: tuple[str, ...]
    body: bytes
    first_line: int

    def lines(self) -> Iterator[tuple[int, bytes]]:
        """(line number, text) of every row, blank lines and comments left out."""
        for number, line in enumerate(self.body.splitlines(), self.first_line):
            if line:
                yield number, line

    def line_of_row(self, row: int) -> int | None:
        """Line of the file that a row (from 0) stands on."""
        for i, (number, _) in enumerate(self.lines()):
            if i == row:
                return number
        return None

    def has_rows(self) -> bool:
        """Whether anything stands below the header."""
        return bool(self.body[:4096].strip(b"\r\n")) or next(self.lines(), None) is not None


def read_bytes(path: Path) -> bytes:
    """The bytes of a file without its byte order mark.

    Raises
    ------
    InputError
        When it cannot be read.
    """
    regular_file(path)
    try:
        return without_mark(path.read_bytes())
    except OSError as error:
        raise unreadable(path, error) from error


def unreadable(path: Path, error: OSError) -> InputError:
    """The error of a file that the system does not give."""
    return InputError(f"cannot be read: {error.strerror or error}", "check the file and its permissions", path)


def without_mark(raw: bytes) -> bytes:
    """The bytes of a file without its byte order mark."""
    return raw.removeprefix(b"\xef\xbb\xbf")


def read_csv_text(path: Path, header: tuple[str, ...] | None = None) -> CsvText:
    """The text of a table.

    Parameters
    ----------
    path : the file.
    header : names of the columns where the file itself has no header row.

    Raises
    ------
    InputError
        When the file cannot be read, is empty, or its header is not UTF-8.
    """
    return csv_text_of(read_bytes(path), path, header)


def csv_text_of(raw: bytes, path: Path, header: tuple[str, ...] | None = None, first_line: int = 1) -> CsvText:
    """Bytes of a table as its text.

    Parameters
    ----------
    raw : whole lines of the file, without a byte order mark.
    header : names of the columns where the bytes have no header row. first_line : of the file that they begin on.

    Raises
    ------
    InputError
        When there is nothing, or the header is not UTF-8.
    """
    if b"\n" not in raw and b"\r" in raw:
        raw = raw.replace(b"\r", b"\n")
    raw = without_comments(raw)
    if header is not None:
        return CsvText(path, header, raw, first_line)
    start, line = 0, first_line
    while start < len(raw):
        end = raw.find(b"\n", start)
        end = len(raw) if end < 0 else end
        text = raw[start:end].rstrip(b"\r")
        if text.strip():
            return CsvText(path, _header_cells(text, path, line), raw[end + 1 :], line + 1)
        start, line = end + 1, line + 1
    raise InputError("is empty", "the first row names the columns", path)


def is_blank(path: Path) -> bool:
    """Whether a CSV file holds nothing but comments and empty lines."""
    return path.suffix == ".csv" and not without_comments(read_bytes(path)).strip()


def without_comments(raw: bytes) -> bytes:
    """The text with every line whose first character other than blanks is # made empty."""
    if b"#" not in raw:
        return raw
    positions = np.flatnonzero(np.frombuffer(raw, np.uint8) == ord("#"))
    before = np.frombuffer(b"\n" + raw, np.uint8)[positions]
    candidates = positions[np.isin(before, np.frombuffer(b"\n\r \t", np.uint8))]
    pieces, done = [], 0
    for position in candidates.tolist():
        start = max(raw.rfind(b"\n", 0, position), raw.rfind(b"\r", 0, position)) + 1
        if position < done or raw[start:position].strip(b" \t"):
            continue
        end = raw.find(b"\n", position)
        end = len(raw) if end < 0 else end
        pieces.append(raw[done:start])
        done = end
    return b"".join([*pieces, raw[done:]])


def cells(line: bytes) -> list[str]:
    """The cells of one line.

    Raises
    ------
    UnicodeDecodeError, csv.Error
    """
    return next(csv.reader([line.decode("utf-8")], strict=True), [])


def _header_cells(text: bytes, path: Path, line: int) -> tuple[str, ...]:
    try:
        return tuple(with_formula(cell.strip(BLANKS)) for cell in cells(text))
    except UnicodeDecodeError as error:
        raise InputError("is not UTF-8", UTF8_REMEDY, path, line) from error
    except csv.Error as error:
        raise InputError(
            f"the header cannot be read: {error}",
            "write the names of the columns in one line, separated by commas",
            path,
            line,
        ) from error


def error_of_unparsable(text: CsvText, reason: str) -> InputError:
    """Why a table does not parse, with the line: not UTF-8, a row with too few or too many cells, an open quote.

    Parameters
    ----------
    text : the table.
    reason : the parser's own words, used when nothing of the above is found.
    """
    try:
        text.body.decode("utf-8")
    except UnicodeDecodeError as error:
        line = text.first_line + len((text.body[: error.start] + b"x").splitlines()) - 1
        return InputError("is not UTF-8", UTF8_REMEDY, text.path, line)
    ragged = _ragged_row(text)
    if ragged is not None:
        return ragged
    short = reason.splitlines()[0] if reason else "no reason given"
    return InputError(
        f"cannot be read as a table: {short}", "write a row a line, its cells separated by commas", text.path
    )


def _ragged_row(text: CsvText) -> InputError | None:
    wanted = len(text.header)
    for number, line in text.lines():
        if QUOTE not in line:
            count = line.count(b",") + 1
        else:
            try:
                count = len(cells(line))
            except (csv.Error, UnicodeDecodeError):
                return InputError(
                    "a quoted cell does not end on its line",
                    'close the quote; write a quote within a cell as ""',
                    text.path,
                    number,
                )
        if count != wanted:
            columns = ", ".join(text.header)
            return InputError(
                f"the row has {count} cells, the header has {wanted}",
                f"give every row the columns {columns}; quote cells that contain a comma",
                text.path,
                number,
            )
    return None


def check_line_count(text: CsvText, rows: int) -> None:
    """Refuse a table whose quoted cells run over several lines, which the parser takes silently.

    Raises
    ------
    InputError
    """
    if QUOTE in text.body and sum(1 for _ in text.lines()) != rows:
        raise error_of_unparsable(text, "a quoted cell runs over several lines")
