"""`aerotri adjust`: read, adjust, write everything whole or not at all."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from aerotri.commands.console import Console
from aerotri.commands.results import block_in_metres, refuse_foreign_folder
from aerotri.conventions import InputError

if TYPE_CHECKING:
    from aerotri.image_errors import Change
    from aerotri.observations import Block
    from aerotri.pipeline import Adjustment
    from aerotri.statistics.adjusted_block import AdjustedBlock, Outcome
    from aerotri.statistics.free_verdict import FreeCheck
    from aerotri.statistics.parameter_effects import ParameterEffects

RESULT_NAMES = (
    "adjustment.json", "images.csv", "points.csv", "residuals.parquet", "parameters.csv", "control.csv", "check.csv",
    "block", "solution.npz", "plots", "report.html", "observations.csv", "check_free.json", "variance_components.json",
    "parameter_changes.json", "parameter_changes.csv", "compare_parameters.json", "compare_parameters.csv",
)  # fmt: skip


def run_adjust(
    path: Path,
    out: Path | None,
    parameters: str | None,
    robust: str | None,
    geoid: Path | None,
    plots: bool,
    as_json: bool,
    check_free: bool = False,
    control_prefix: str = "",
) -> int:
    """Exit code of the command: 0 when converged and not rejected, 1 otherwise; arguments as on the command line."""
    console = Console(quiet=as_json)
    begun = time.perf_counter()
    from aerotri.formats.block_folder import read_block
    from aerotri.observations.names import with_control_prefix

    block = with_control_prefix(with_settings(read_block(path), parameters, robust), control_prefix)
    block = block_in_metres(block, console, geoid)
    if check_free:
        refuse_free_datum(block)
    read_s = time.perf_counter() - begun
    target = out or Path(f"{folder_name(path)}_result")
    refuse_foreign_folder(target, "adjustment.json")

    from aerotri.compiled import compilation_notice
    from aerotri.pipeline import AdjustmentFailedError, adjust_and_explain

    console.progress(compilation_notice())
    try:
        adjustment = adjust_and_explain(block, console.iteration, geoid, console.progress)
    except AdjustmentFailedError as failure:
        from aerotri.formats.result import outcome_json

        console.failure("\n  ".join([str(failure), *_causes(failure.outcome)]))
        if check_free:
            _tell_free(_checked_unadjusted(block, geoid, console), as_json, console)
        if as_json:
            print(json.dumps(outcome_json(block, failure.outcome), indent=2, ensure_ascii=False))
        return 1
    outcome = adjustment.result.outcome
    timings = {"read": read_s, **outcome.timings_s}
    result = replace(adjustment.result, outcome=replace(outcome, timings_s=timings))
    checked = _checked(adjustment, console) if check_free else None
    result = write_all(replace(adjustment, result=result), target, plots, console, checked)
    _tell(result, target, console, as_json, checked)
    return 1 if result.outcome.status != "converged" or result.outcome.verdict == "rejected" else 0


def _causes(outcome: Outcome) -> list[str]:
    """The reasons of a failure beside its message, which is printed already."""
    from aerotri.report.quality import printable

    return [f"because {printable(reason, 500)}" for reason in outcome.reasons if reason != outcome.message]


def with_settings(block: Block, parameters: str | None, robust: str | None) -> Block:
    """The block with the command line's settings in place of block.toml's."""
    settings = block.settings.adjustment
    if parameters is not None:
        from aerotri.functional_model.additional_parameters import parse_parameters

        settings = replace(settings, additional_parameters=parse_parameters(parameters))
    if robust is not None:
        settings = replace(settings, robust=robust)
    return replace(block, settings=replace(block.settings, adjustment=settings))


def refuse_free_datum(block: Block) -> None:
    """A free adjustment tells errors of control only from a block that control holds.

    Raises
    ------
    InputError
    """
    datum = block.settings.adjustment.datum
    if datum != "control":
        raise InputError(
            f'with datum = "{datum}" the block is free of its control already',
            'leave --check-free out, or set datum = "control"',
            file="block.toml",
        )


def _checked(adjustment: Adjustment, console: Console) -> FreeCheck:
    """The free check in the local frame of the adjustment, so that all its stages share one frame."""
    from aerotri.pipeline import adjust
    from aerotri.statistics.free_check import check_free

    console.progress("adjusting free")
    return check_free(adjustment.local.block, adjust, adjustment.local)


def _checked_unadjusted(block: Block, geoid: Path | None, console: Console) -> FreeCheck:
    """The free check of a block that has no result with its control."""
    from aerotri.coordinates.blocks import frame_of_block, transform_block
    from aerotri.pipeline import adjust
    from aerotri.statistics.free_check import check_free

    console.progress("adjusting free")
    local = block if block.crs == "local" else transform_block(block, frame_of_block(block, geoid))
    return check_free(local, adjust)


def _tell_free(checked: FreeCheck, as_json: bool, console: Console) -> None:
    from aerotri.report.work_tables import free_check_lines

    if not as_json:
        console.lines(free_check_lines(checked))


def write_all(
    adjustment: Adjustment, target: Path, plots: bool, console: Console, checked: FreeCheck | None = None
) -> AdjustedBlock:
    """Write tables, solution, block, plots and report to a temporary folder, and rename it."""
    from aerotri.formats.atomic import atomic_folder
    from aerotri.formats.block_folder import write_block
    from aerotri.formats.result import write_result
    from aerotri.formats.solution import write_solution
    from aerotri.image_errors import group_changes

    result = adjustment.result
    begun = time.perf_counter()
    changes = group_changes(result)
    with atomic_folder(target, own=RESULT_NAMES) as folder:
        write_block(result.block, folder / "block")
        write_solution(
            folder / "solution.npz", adjustment.system, adjustment.solution, adjustment.local, adjustment.frame
        )
        timings = {**result.outcome.timings_s, "write": time.perf_counter() - begun}
        if plots:
            console.progress("drawing")
            begun = time.perf_counter()
            _draw(adjustment, folder, checked, changes)
            timings["plots"] = time.perf_counter() - begun
        result = replace(result, outcome=replace(result.outcome, timings_s=timings))
        if checked is not None:
            from aerotri.report.free_check_json import free_check_json

            text = json.dumps(free_check_json(checked), indent=2, ensure_ascii=False, allow_nan=False)
            (folder / "check_free.json").write_text(text + "\n", encoding="utf-8")
        _write_parameter_tables(adjustment, changes, folder)
        write_result(result, folder)
    return result


def _write_parameter_tables(adjustment: Adjustment, changes: tuple[Change, ...], folder: Path) -> None:
    """The differences between groups, and the sets that were compared, where there are any."""
    from aerotri.commands.compare_parameters import write_comparison_tables
    from aerotri.formats.result import write_csv
    from aerotri.report.parameter_tables import changes_columns, changes_json

    if changes:
        text = json.dumps(changes_json(changes), indent=2, ensure_ascii=False, allow_nan=False)
        (folder / "parameter_changes.json").write_text(text + "\n", encoding="utf-8")
        write_csv(folder / "parameter_changes.csv", changes_columns(changes))
    if adjustment.compared is not None:
        write_comparison_tables(adjustment.compared, folder)


def _draw(adjustment: Adjustment, folder: Path, checked: FreeCheck | None, changes: tuple[Change, ...]) -> None:
    from aerotri.diagnosis import findings
    from aerotri.report.html import Findings, write_report
    from aerotri.report.plots import all_plots, save_plots
    from aerotri.report.plots_comparison import plot_comparison
    from aerotri.statistics.work_list import work_list

    figures = all_plots(adjustment.result, changes)
    if adjustment.compared is not None:
        figures["compare_parameters"] = plot_comparison(adjustment.compared)
    plots = save_plots(figures, folder / "plots")
    beside = Findings(
        work_list(adjustment.local), checked, effects=_effects(adjustment), changes=changes,
        compared=adjustment.compared, lights=findings(adjustment.local),
    )  # fmt: skip
    write_report(adjustment.result, plots, folder / "report.html", beside)


def _effects(adjustment: Adjustment) -> ParameterEffects | None:
    """What leaving additional parameters out would change at the check points."""
    from aerotri.statistics.parameter_effects import parameter_effects

    system, solution = adjustment.system, adjustment.solution
    factor = system.factorise(solution.equations)
    return parameter_effects(adjustment.local, system, solution, factor)


def folder_name(path: Path) -> str:
    """Name of a block's folder, given itself or its block.toml."""
    folder = path.resolve()
    return (folder.parent if folder.is_file() else folder).name


def _tell(
    result: AdjustedBlock, target: Path, console: Console, as_json: bool, checked: FreeCheck | None = None
) -> None:
    if as_json:
        from aerotri.formats.result import adjustment_json

        print(json.dumps(adjustment_json(result), indent=2, ensure_ascii=False))
        return
    from aerotri.report.tables import summary_lines

    console.lines(summary_lines(result))
    if checked is not None:
        _tell_free(checked, as_json, console)
    report = target / "report.html"
    console.lines([f"Written to {target}" + (f", report: {report}" if report.exists() else "")])
