"""`aerotri diff`: what changed between two results, against σ."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from aerotri.commands.console import Console
from aerotri.formats.results.json_text import json_text

if TYPE_CHECKING:
    from aerotri.results.adjusted_block import AdjustedBlock


def run_diff(first: Path, second: Path, top: int, as_json: bool) -> int:
    """Exit code of the command, 0; arguments as on the command line.

    Raises
    ------
    InputError
        Where a folder holds no result that can be read; the message names it.
    """
    from aerotri.formats.results.run_comparison import SIGMA_NOTE
    from aerotri.public.changes import changes, refuse_negative
    from aerotri.report.quality import printable
    from aerotri.report.tables.comparison import comparison_tables
    from aerotri.report.tables.terminal import table_lines

    refuse_negative(top)
    console = Console(quiet=as_json)
    found = changes(first, second, console.stage)
    runs = (found.first, found.second)
    if as_json:
        verdicts = [{"verdict": run.outcome.verdict, "reasons": list(run.outcome.reasons)} for run in runs]
        content = {"first": str(first), "second": str(second), "verdicts": verdicts} | found.summary(top)
        print(json_text(content))
        return 0
    lines = [f"first: {printable(first)}, second: {printable(second)}"]
    lines += [f"{name} is {_verdict(run)}" for name, run in zip(("first", "second"), runs, strict=True)]
    lines += [SIGMA_NOTE, *(f"note: {printable(note, 500)}" for note in found.record.notes)]
    for table in comparison_tables(found.record, top):
        lines += ["", *table_lines(table)]
    console.lines(lines)
    return 0


def _verdict(run: AdjustedBlock) -> str:
    """What a result is worth, with the gravest reason."""
    from aerotri.report.quality import printable

    return run.outcome.verdict + (f": {printable(run.outcome.reasons[0], 500)}" if run.outcome.reasons else "")
