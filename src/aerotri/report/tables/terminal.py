"""Tables as lines of text for a terminal."""

from __future__ import annotations

from aerotri.report.tables.adjustment import Table

WIDEST_CELL = 48
"""Characters of a cell in a terminal; chosen [C]: two such columns fit a line of 100 characters."""


def table_lines(table: Table, indent: str = "  ") -> list[str]:
    """The title and the rows in columns, numbers to the right; nothing for a table without rows."""
    if not len(table):
        return []
    head = [f"{c.name} [{c.unit}]" if c.unit else c.name for c in table.columns]
    rows = [[_short(cell) for cell in row] for row in (head, *table.texts)]
    widths = [max(len(row[k]) for row in rows) for k in range(len(head))]
    right = [bool(column.form) for column in table.columns]
    lines = [
        indent + "  ".join(c.rjust(w) if r else c.ljust(w) for c, w, r in zip(row, widths, right, strict=True)).rstrip()
        for row in rows
    ]
    return [table.title, *lines]


def _short(cell: str) -> str:
    return cell if len(cell) <= WIDEST_CELL else cell[: WIDEST_CELL - 1] + "…"
