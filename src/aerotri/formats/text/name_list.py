"""A list of points in a text file: one name a line."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from aerotri.formats.text.text_lines import TextFile

HEADING = "point"
"""A first line that may stand above the names, as above a column of a table."""


def read_point_names(path: Path, known: Collection[str], what: str) -> tuple[str, ...]:
    """The names of the file, in its order. Lines that begin with # are comments.

    Parameters
    ----------
    known : names that may stand there. what : what they are, for a message.

    Raises
    ------
    InputError
        When the file cannot be read, names something twice, or a name is not among those known.
    """
    file = TextFile(path)
    start = 1 if file.lines and file.lines[0].casefold() == HEADING and HEADING not in known else 0
    names = [line.strip('"').strip() for line in file.lines[start:]]
    rows = range(start, len(file))
    file.check_names(names, rows, "point")
    file.refuse_repeated(names, rows, "point")
    if not names:
        raise file.error(0, "names no point", f"write the name of one {what} a line")
    for name, row in zip(names, rows, strict=True):
        if name not in known:
            raise file.error(row, f"'{name[:60]}' is no {what} of the result", f"write the name of one {what} a line")
    return tuple(names)
