"""Two results side by side, as tables of texts: what `aerotri diff` prints."""

from __future__ import annotations

from typing import Any

from aerotri.formats.results.run_comparison import SIGMA_NOTE
from aerotri.report.tables.comparison import comparison_tables
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.statistics.comparison import compare


def difference_content(first: AdjustedBlock, second: AdjustedBlock, top: int) -> dict[str, Any]:
    """Titles, heads and rows of all tables that are not empty.

    Parameters
    ----------
    first, second : results of one block. top : how many things of a kind are named.
    """
    found = compare(first, second)
    tables = [
        {
            "title": one.title,
            "columns": [column.name for column in one.columns],
            "rows": [list(row) for row in one.texts],
        }
        for one in comparison_tables(found, top)
    ]
    verdicts = [f"{run.outcome.verdict}, σ0 {run.outcome.sigma0:.4g}" for run in (first, second)]
    return {"verdicts": verdicts, "notes": [SIGMA_NOTE, *found.notes], "tables": tables}
