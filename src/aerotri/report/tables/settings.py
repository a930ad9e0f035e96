"""All settings of an adjustment as a table."""

from __future__ import annotations

from aerotri.formats.block.used_settings import used_settings
from aerotri.observations import Block
from aerotri.report.quality import printable
from aerotri.report.tables.adjustment import Column, Table, table

LONGEST = 2000
"""Characters of a value at most: lists of points may be long."""


def settings_table(block: Block) -> Table:
    """A row a setting: key, value, unit, and whether it is the default."""
    found = used_settings(block)
    return table(
        "All settings", (Column("setting"), [printable(one.key) for one in found]),
        (Column("value"), [printable(one.text, LONGEST) for one in found]),
        (Column("unit"), [one.unit for one in found]), (Column("origin"), [one.origin for one in found]),
    )  # fmt: skip
