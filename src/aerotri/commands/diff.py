"""`aerotri diff`: what changed between two results, against σ."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from aerotri.commands.console import Console
from aerotri.conventions import InputError

if TYPE_CHECKING:
    from aerotri.statistics.adjusted_block import AdjustedBlock


def run_diff(first: Path, second: Path, top: int, as_json: bool) -> int:
    """Exit code of the command, 0; arguments as on the command line.

    Raises
    ------
    InputError
        Where a folder holds no result that can be read; the message names it.
    """
    if top < 0:
        raise InputError(f"--top {top} is less than nothing", "give how many things to name, 0 or more")
    console = Console(quiet=as_json)
    runs = [read_result(folder, console) for folder in (first, second)]
    from aerotri.report.comparison_tables import SIGMA_NOTE, comparison_json, comparison_tables
    from aerotri.report.quality import printable
    from aerotri.report.terminal import table_lines
    from aerotri.statistics.comparison import compare

    comparison = compare(*runs)
    if as_json:
        verdicts = [{"verdict": run.outcome.verdict, "reasons": list(run.outcome.reasons)} for run in runs]
        content = {"first": str(first), "second": str(second), "verdicts": verdicts} | comparison_json(comparison, top)
        print(json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False))
        return 0
    lines = [f"first: {printable(first)}, second: {printable(second)}", *_verdicts(runs), SIGMA_NOTE]
    lines += [f"note: {printable(note, 500)}" for note in comparison.notes]
    for table in comparison_tables(comparison, top):
        lines += ["", *table_lines(table)]
    console.lines(lines)
    return 0


def _verdicts(runs: list[AdjustedBlock]) -> list[str]:
    """What each result is worth, with the gravest reason."""
    from aerotri.report.quality import printable

    lines = []
    for name, run in zip(("first", "second"), runs, strict=True):
        why = f": {printable(run.outcome.reasons[0], 500)}" if run.outcome.reasons else ""
        lines.append(f"{name} is {run.outcome.verdict}{why}")
    return lines


def read_result(folder: Path, console: Console) -> AdjustedBlock:
    """The adjusted block that a result folder holds, linearised and factorised at its solution.

    Raises
    ------
    InputError
    """
    from aerotri.compiled import compilation_notice
    from aerotri.opening import open_result

    remedy = "give the folder that `aerotri adjust` wrote"
    if not folder.is_dir():
        raise InputError(f"'{folder}' is no folder", remedy)
    if not (folder / "adjustment.json").is_file():
        raise InputError(f"'{folder}' holds no adjustment.json", remedy)
    console.progress(compilation_notice() or f"reading {folder}")
    try:
        return open_result(folder).result
    except InputError as error:
        # both folders have files of the same names
        place = "" if error.file is None else f"{Path(error.file).name}: "
        raise InputError(f"result '{folder}': {place}{error.message}", error.remedy) from None
