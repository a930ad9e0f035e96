"""`aerotri adjust`: read, adjust, write everything whole or not at all."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from aerotri.commands.console import Console
from aerotri.conventions import InputError

if TYPE_CHECKING:
    from aerotri.observations import Block
    from aerotri.pipeline import Adjustment
    from aerotri.statistics.adjusted_block import AdjustedBlock

RESULT_NAMES = (
    "adjustment.json", "images.csv", "points.csv", "residuals.parquet", "parameters.csv", "control.csv", "check.csv",
    "block", "solution.npz", "plots", "report.html",
)  # fmt: skip


def run_adjust(
    path: Path,
    out: Path | None,
    parameters: str | None,
    robust: str | None,
    geoid: Path | None,
    plots: bool,
    as_json: bool,
) -> int:
    """Exit code of the command: 0 when converged, 1 when not; arguments as on the command line."""
    console = Console(quiet=as_json)
    begun = time.perf_counter()
    from aerotri.formats.block_folder import read_block

    block = with_settings(read_block(path), parameters, robust)
    read_s = time.perf_counter() - begun
    target = out or Path(f"{_folder_name(path)}_result")
    refuse_foreign_folder(target)

    from aerotri.compiled import compilation_notice
    from aerotri.pipeline import AdjustmentFailedError, adjust_keeping_system

    console.progress(compilation_notice())
    try:
        adjustment = adjust_keeping_system(block, report=console.iteration, geoid=geoid)
    except AdjustmentFailedError as failure:
        from aerotri.formats.result import outcome_json

        console.failure(str(failure))
        if as_json:
            print(json.dumps(outcome_json(block, failure.outcome), indent=2, ensure_ascii=False))
        return 1
    outcome = adjustment.result.outcome
    timings = {"read": read_s, **outcome.timings_s}
    result = replace(adjustment.result, outcome=replace(outcome, timings_s=timings))
    result = write_all(replace(adjustment, result=result), target, plots, console)
    _tell(result, target, console, as_json)
    return 0 if result.outcome.status == "converged" else 1


def with_settings(block: Block, parameters: str | None, robust: str | None) -> Block:
    """The block with the command line's settings in place of block.toml's."""
    settings = block.settings.adjustment
    if parameters is not None:
        from aerotri.functional_model.additional_parameters import parse_parameters

        settings = replace(settings, additional_parameters=parse_parameters(parameters))
    if robust is not None:
        settings = replace(settings, robust=robust)
    return replace(block, settings=replace(block.settings, adjustment=settings))


def refuse_foreign_folder(target: Path) -> None:
    """A result replaces an older result or an empty folder, nothing else.

    Raises
    ------
    InputError
    """
    if target.is_dir() and any(target.iterdir()) and not (target / "adjustment.json").exists():
        raise InputError(f"'{target}' holds other files", "choose another --out, or an empty folder")


def write_all(adjustment: Adjustment, target: Path, plots: bool, console: Console) -> AdjustedBlock:
    """Write tables, solution, block, plots and report to a temporary folder, and rename it."""
    from aerotri.formats.atomic import atomic_folder
    from aerotri.formats.block_folder import write_block
    from aerotri.formats.result import write_result
    from aerotri.formats.solution import write_solution

    result = adjustment.result
    begun = time.perf_counter()
    with atomic_folder(target, own=RESULT_NAMES) as folder:
        write_block(result.block, folder / "block")
        write_solution(
            folder / "solution.npz", adjustment.system, adjustment.solution, adjustment.local, adjustment.frame
        )
        timings = {**result.outcome.timings_s, "write": time.perf_counter() - begun}
        if plots:
            console.progress("drawing")
            begun = time.perf_counter()
            _draw(result, folder)
            timings["plots"] = time.perf_counter() - begun
        result = replace(result, outcome=replace(result.outcome, timings_s=timings))
        write_result(result, folder)
    return result


def _draw(result: AdjustedBlock, folder: Path) -> None:
    from aerotri.report.html import write_report
    from aerotri.report.plots import all_plots, save_plots

    figures = all_plots(result)
    write_report(result, save_plots(figures, folder / "plots"), folder / "report.html")


def _folder_name(path: Path) -> str:
    folder = path.resolve()
    return (folder.parent if folder.is_file() else folder).name


def _tell(result: AdjustedBlock, target: Path, console: Console, as_json: bool) -> None:
    if as_json:
        from aerotri.formats.result import adjustment_json

        print(json.dumps(adjustment_json(result), indent=2, ensure_ascii=False))
        return
    from aerotri.report.tables import summary_lines

    console.lines(summary_lines(result))
    report = target / "report.html"
    console.lines([f"Written to {target}" + (f", report: {report}" if report.exists() else "")])
