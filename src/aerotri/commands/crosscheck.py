"""`aerotri crosscheck`: the same block through other programs' solvers, differences against σ."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from aerotri.commands.console import Console
from aerotri.commands.results import refuse_foreign_folder

if TYPE_CHECKING:
    from aerotri.crosscheck import CrosscheckResult
    from aerotri.pipeline import Adjustment
    from aerotri.statistics.adjusted_block import AdjustedBlock

OWN_NAMES = ("crosscheck.json", "crosscheck.csv", "plots", "report.html")


def run_crosscheck(source: Path, out: Path | None, as_json: bool) -> int:
    """Exit code of the command: 0 when everything compared agrees, 1 otherwise; arguments as on the command line."""
    console = Console(quiet=as_json)
    target = out or Path(f"{_name(source)}_crosscheck")
    refuse_foreign_folder(target, OWN_NAMES[0])
    from aerotri.pipeline import AdjustmentFailedError, adjust

    try:
        adjusted = _adjusted(source, console)
    except AdjustmentFailedError as failure:
        console.failure(str(failure))
        return 1
    if adjusted.outcome.status != "converged":
        console.failure(f"{adjusted.outcome.status}: {adjusted.outcome.message}; there is no solution to check")
        return 1
    from aerotri.crosscheck import crosscheck

    result = crosscheck(adjusted, adjust, console.progress)
    console.progress("drawing")
    _write(result, adjusted, target)
    _tell(result, target, console, as_json)
    return 0 if result.verdict == "agrees" else 1


def _name(source: Path) -> str:
    folder = source.resolve()
    return (folder.parent if folder.is_file() and folder.suffix == ".toml" else folder).name


def _adjusted(source: Path, console: Console) -> AdjustedBlock:
    """A result as it was adjusted, or a block of any format adjusted now; in the frame of its adjustment."""
    from aerotri.crosscheck.freed import as_adjusted

    adjustment = _adjustment(source, console)
    return as_adjusted(adjustment.local, adjustment.system.unknowns.block)


def _adjustment(source: Path, console: Console) -> Adjustment:
    from aerotri.compiled import compilation_notice
    from aerotri.pipeline import adjust_keeping_system

    console.progress(compilation_notice())
    if (source / "solution.npz").is_file():
        from aerotri.opening import open_result

        return open_result(source)
    from aerotri.formats.convert import read_any

    block, points = read_any(source)
    return adjust_keeping_system(block, console.iteration, points)


def _write(result: CrosscheckResult, adjusted: AdjustedBlock, target: Path) -> None:
    from aerotri.crosscheck.outcome_json import crosscheck_json
    from aerotri.formats.atomic import atomic_folder
    from aerotri.report.html import Findings, write_report
    from aerotri.report.plots import all_plots, save_plots
    from aerotri.report.plots_crosscheck import plot_crosscheck

    with atomic_folder(target, own=OWN_NAMES) as folder:
        drawn = save_plots({"crosscheck": plot_crosscheck(result)}, folder / "plots")
        write_report(adjusted, {**all_plots(adjusted), **drawn}, folder / "report.html", Findings(crosscheck=result))
        _write_table(result, folder / "crosscheck.csv")
        text = json.dumps(crosscheck_json(result), indent=2, ensure_ascii=False, allow_nan=False)
        (folder / "crosscheck.json").write_text(text + "\n", encoding="utf-8")


def _write_table(result: CrosscheckResult, path: Path) -> None:
    import csv

    from aerotri.spreadsheet import plain_row

    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["peer", "kind", "count", "max", "rms", "worst"])
        for check in result.checks:
            rows = ([check.peer, d.kind, d.count, d.max, d.rms, d.worst] for d in check.differences)
            writer.writerows(plain_row(row) for row in rows)


def _tell(result: CrosscheckResult, target: Path, console: Console, as_json: bool) -> None:
    if as_json:
        from aerotri.crosscheck.outcome_json import crosscheck_json

        print(json.dumps(crosscheck_json(result), indent=2, ensure_ascii=False))
        return
    from aerotri.report.plots_crosscheck import crosscheck_table
    from aerotri.report.quality import printable

    table = crosscheck_table(result)
    rows = [tuple(column.name for column in table.columns), *table.texts]
    widths = [max(len(row[k]) for row in rows) for k in range(len(table.columns))]
    lines = [
        "  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows
    ]
    notes = [f"{check.peer}: {printable(note, 300)}" for check in result.checks for note in check.notes]
    console.lines([printable(result.sentence, 1000), *lines, *notes, f"Written to {target}"])
