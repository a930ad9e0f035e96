"""`aerotri crosscheck`: the same block through other programs' solvers, differences against σ."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from aerotri.commands.console import Console
from aerotri.conventions import real_path
from aerotri.formats.results.json_text import json_text
from aerotri.public.folders import refuse_foreign_folder

if TYPE_CHECKING:
    from aerotri.public.comparing import Crosscheck


def run_crosscheck(source: Path, out: Path | None, as_json: bool) -> int:
    """Exit code of the command: 0 when the block agrees with its parameters, 1 otherwise; arguments as typed."""
    console = Console(quiet=as_json)
    from aerotri.compiled import compilation_notice
    from aerotri.pipeline import AdjustmentFailedError
    from aerotri.public.comparing import CROSSCHECK_NAMES, crosscheck

    target = out or Path(f"{_name(source)}_crosscheck")
    refuse_foreign_folder(target, CROSSCHECK_NAMES[0])
    console.progress(compilation_notice())
    try:
        found = crosscheck(source, progress=console.stage)
    except AdjustmentFailedError as failure:
        console.failure(str(failure))
        return 1
    console.progress("drawing")
    found.save(target)
    _tell(found, target, console, as_json)
    return 0 if found.verdict == "agrees" else 1


def _name(source: Path) -> str:
    folder = real_path(source)
    return (folder.parent if folder.is_file() and folder.suffix == ".toml" else folder).name


def _tell(found: Crosscheck, target: Path, console: Console, as_json: bool) -> None:
    if as_json:
        print(json_text(found.content))
        return
    from aerotri.report.plots.crosscheck import crosscheck_table
    from aerotri.report.quality import printable

    table = crosscheck_table(found.record)
    rows = [tuple(column.name for column in table.columns), *table.texts]
    widths = [max(len(row[k]) for row in rows) for k in range(len(table.columns))]
    lines = ["  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows]
    notes = [f"{check.peer}: {printable(note, 300)}" for check in found.record.checks for note in check.notes]
    console.lines([printable(found.sentence, 1000), *lines, *notes, f"Written to {target}"])
