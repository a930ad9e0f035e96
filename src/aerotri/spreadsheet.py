"""Names in CSV files that a spreadsheet would run as formulas: marked when written, taken as they were when read."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

PLAIN_NUMBER = r"^[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?$"
FORMULA = r"^'*[=+\-@]"
"""How a text begins that a spreadsheet runs as a formula, with or without our own mark before it."""
MARKED = r"^'('*[=+\-@])"


def without_formula(text: str) -> str:
    """A cell of text as a CSV file may hold it: a name that a spreadsheet would run has an apostrophe before it.

    Such names are legal: ``-5b`` or ``@3`` may stand in anyone's list, and every reader takes them as they are. Written
    to a table that somebody opens with a spreadsheet, ``=HYPERLINK(…)`` would be run there, whatever quotes it has. The
    apostrophe makes it text. `with_formula` takes it off again, and a name that has an apostrophe of its own before
    such a sign gets a second one, so that every name comes back as it was. Plain numbers such as -1.5 stay.
    """
    return "'" + text if re.match(FORMULA, text) and not _is_plain_number(text) else text


def with_formula(text: str) -> str:
    """The inverse of `without_formula`."""
    return re.sub(MARKED, r"\1", text)


def _is_plain_number(text: str) -> bool:
    return len(text) < 40 and re.match(PLAIN_NUMBER, text) is not None


def plain_row(cells: Iterable[Any]) -> list[Any]:
    """The cells of a row as a CSV file may hold them: texts by `without_formula`, everything else as it is."""
    return [without_formula(str(cell)) if isinstance(cell, str) else cell for cell in cells]
