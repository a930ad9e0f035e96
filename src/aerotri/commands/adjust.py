"""`aerotri adjust`: read, adjust, write everything whole or not at all."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerotri.commands.console import Console
from aerotri.conventions import real_path
from aerotri.formats.results.json_text import json_text
from aerotri.public.folders import refuse_foreign_folder, refuse_missing_photographs

if TYPE_CHECKING:
    from aerotri.results.adjusted_block import AdjustedBlock
    from aerotri.results.failure import AdjustmentFailedError
    from aerotri.strategies.free_stages import FreeCheck


def run_adjust(
    path: Path,
    out: Path | None,
    parameters: str | None,
    robust: Any,
    geoid: Path | None,
    plots: bool,
    as_json: bool,
    check_free: bool = False,
    control_prefix: str = "",
    check: tuple[str, ...] = (),
    model_part: Any = None,
    start: Any = None,
    photographs: tuple[Path, ...] = (),
) -> int:
    """Exit code of the command: 0 when converged and not rejected, 1 otherwise; arguments as on the command line."""
    console = Console(quiet=as_json)
    target = out or Path(f"{folder_name(path)}_result")
    refuse_foreign_folder(target, "adjustment.json")
    refuse_missing_photographs(photographs)
    begun = time.perf_counter()
    from aerotri.execution.first_run import compile_ahead

    compile_ahead()
    from aerotri.formats.assembly.assemble_control import block_with_check_points
    from aerotri.formats.block.unread import unread_in_words
    from aerotri.public.adjusting import read_in_metres, with_read_time
    from aerotri.public.checking import free_check, refuse_free_datum

    block, note = read_in_metres(path, control_prefix, geoid)
    block = block_with_check_points(block, check, control_prefix)
    for text in (*((note,) if note else ()), *unread_in_words(path)):
        console.note(text)
    if check_free:
        refuse_free_datum(block)
    read_s = time.perf_counter() - begun
    from aerotri.compiled import compilation_notice
    from aerotri.public.progress import StageReport
    from aerotri.public.results import adjust
    from aerotri.public.saving import write_adjustment
    from aerotri.results.failure import AdjustmentFailedError

    console.progress(compilation_notice())
    try:
        found = adjust(block, parameters=parameters, robust=robust, model_part=model_part, start=start,
                       geoid=geoid, progress=console.stage)  # fmt: skip
    except AdjustmentFailedError as failure:
        from aerotri.formats.results.adjustment import outcome_json

        console.failure(failure_text(failure))
        if check_free:
            _tell_free(free_check(block, geoid=geoid, progress=console.stage), as_json, console)
        if as_json:
            print(json_text(outcome_json(block, failure.outcome)))
        return 1
    checked = free_check(found, progress=console.stage) if check_free else None
    timed = with_read_time(found, read_s).record
    result = write_adjustment(timed, target, plots, StageReport(console.stage), checked, photographs)
    _tell(result, target, console, as_json, checked)
    return 1 if result.outcome.status != "converged" or result.outcome.verdict == "rejected" else 0


def failure_text(failure: AdjustmentFailedError) -> str:
    """Why there is no result, with all reasons."""
    from aerotri.report.quality import printable
    from aerotri.report.tables.adjustment import what_to_do

    outcome = failure.outcome
    causes = [f"because {printable(reason, 500)}" for reason in outcome.reasons if reason != outcome.message]
    return "\n  ".join([str(failure), *causes, *what_to_do(outcome)])


def _tell_free(checked: FreeCheck, as_json: bool, console: Console) -> None:
    from aerotri.report.tables.work import free_check_lines

    if not as_json:
        console.lines(free_check_lines(checked))


def folder_name(path: Path) -> str:
    """Name of a block's folder, given itself or its block.toml."""
    folder = real_path(path)
    return (folder.parent if folder.is_file() else folder).name


def _tell(result: AdjustedBlock, target: Path, console: Console, as_json: bool, checked: FreeCheck | None) -> None:
    if as_json:
        from aerotri.formats.results.adjustment import adjustment_json

        print(json_text(adjustment_json(result)))
        return
    console.lines(outcome_lines(result, target, checked))


def outcome_lines(result: AdjustedBlock, target: Path, checked: FreeCheck | None = None) -> list[str]:
    """What the user reads of a result and of its free check."""
    from aerotri.report.tables.adjustment import summary_lines
    from aerotri.report.tables.work import free_check_lines

    report = target / "report.html"
    free = [] if checked is None else free_check_lines(checked)
    return [*summary_lines(result), *free, f"Written to {target}" + (f", report: {report}" if report.exists() else "")]
