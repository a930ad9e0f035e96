"""The folder of a result: tables, adjustment.json, the solution, the block as used, plots and report."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from aerotri.conventions import InputError
from aerotri.formats.block.folder import write_block
from aerotri.formats.files.atomic import atomic_folder
from aerotri.formats.results.adjustment import write_csv, write_result
from aerotri.formats.results.json_text import write_json
from aerotri.formats.results.solution import write_solution
from aerotri.image_errors import group_changes
from aerotri.public.folders import refuse_foreign_folder, refuse_missing_photographs
from aerotri.public.progress import ProgressLike, StageReport, stage_report
from aerotri.results.adjusted_block import head_of
from aerotri.results.head import Head

if TYPE_CHECKING:
    import numpy as np

    from aerotri.diagnosis import Finding
    from aerotri.diagnosis.work_list import WorkList
    from aerotri.image_errors import Change
    from aerotri.results.adjusted_block import AdjustedBlock
    from aerotri.results.adjustment import Adjustment
    from aerotri.results.parameter_comparison import ParameterComparison
    from aerotri.statistics.parameter_effects import ParameterEffects
    from aerotri.strategies.free_stages import FreeCheck

RECORD = "adjustment.json"
RESULT_NAMES = (
    RECORD, "images.csv", "points.csv", "residuals.parquet", "parameters.csv", "control.csv", "check.csv",
    "block", "solution.npz", "plots", "report.html", "observations.csv", "check_free.json", "variance_components.json",
    "parameter_changes.json", "parameter_changes.csv", "compare_parameters.json", "compare_parameters.csv",
    "work_list.csv", "parameter_effects.csv", "rigs.csv", "rig_stations.csv", "rig_movements.csv",
)  # fmt: skip

MOST_EXACT = 5000
"""Photographs whose footprints are computed over the relief for the map of the overlap; chosen [C]: some seconds."""


@dataclass(frozen=True, eq=False)
class Evaluation:
    """What follows from an adjustment and stands on its report.

    Parameters
    ----------
    work : what to look at next. effects : what leaving parameters out would change at check points, None without them.
    lights : each number beside what it should be. changes : of the image errors between groups.
    """

    work: WorkList
    effects: ParameterEffects | None
    lights: list[Finding]
    changes: tuple[Change, ...]


def evaluate(adjustment: Adjustment) -> Evaluation:
    """Compute what the report shows beside the tables."""
    from aerotri.diagnosis import findings
    from aerotri.diagnosis.work_list import work_list
    from aerotri.statistics.parameter_effects import parameter_effects

    system, solution = adjustment.system, adjustment.solution
    effects = parameter_effects(adjustment.local, system, solution, system.factorise(solution.equations))
    changes = group_changes(adjustment.result)
    return Evaluation(work_list(adjustment.local), effects, findings(adjustment.local), changes)


def save_adjustment(
    record: Adjustment, out: Path, plots: bool, progress: ProgressLike, photographs: Sequence[Path] = ()
) -> Path:
    """As `Adjustment.save`.

    Raises
    ------
    InputError
        When the folder holds other files, or cannot be written to.
    """
    with stage_report(progress) as report:
        write_adjustment(record, out, plots, report, photographs=photographs)
    return out


def write_adjustment(
    adjustment: Adjustment,
    target: Path,
    plots: bool,
    report: StageReport,
    checked: FreeCheck | None = None,
    photographs: Sequence[Path] = (),
) -> AdjustedBlock:
    """Write everything to a temporary folder, and rename it; gives the result with the time this took.

    Parameters
    ----------
    plots : draw the plots and the report. checked : of `--check-free`.
    photographs : files or folders; the marks of control and check points are cut out of them for the report.

    Raises
    ------
    InputError
    """
    refuse_foreign_folder(target, RECORD)
    refuse_missing_photographs(photographs)
    result, begun = adjustment.result, time.perf_counter()
    with atomic_folder(target, own=RESULT_NAMES) as folder:
        write_block(result.block, folder / "block")
        write_solution(
            folder / "solution.npz", adjustment.system, adjustment.solution, adjustment.local, adjustment.frame,
            adjustment.other,
        )  # fmt: skip
        timings = {**result.outcome.timings_s, "write": time.perf_counter() - begun}
        found = evaluate(adjustment)
        if plots:
            report.stage("drawing", None)
            begun = time.perf_counter()
            _draw(adjustment, found, folder, checked, photographs)
            timings["plots"] = time.perf_counter() - begun
        result = replace(result, outcome=replace(result.outcome, timings_s=timings))
        if checked is not None:
            from aerotri.formats.results.free_check import free_check_json

            write_json(folder / "check_free.json", free_check_json(checked))
        _write_evaluation(found, adjustment.compared, folder, head_of(result))
        write_result(result, folder)
    return result


def write_comparison_tables(comparison: ParameterComparison, folder: Path, head: Head) -> None:
    """Write compare_parameters.json, with its head, and compare_parameters.csv into a folder."""
    from aerotri.formats.results.parameter_sets import comparison_columns, comparison_json

    write_json(folder / "compare_parameters.json", head.as_dict() | comparison_json(comparison))
    write_csv(folder / "compare_parameters.csv", comparison_columns(comparison))


def _write_evaluation(found: Evaluation, compared: ParameterComparison | None, folder: Path, head: Head) -> None:
    """The work list, and where there are any: effects of the parameters, differences between groups, sets compared."""
    from aerotri.formats.results.evaluation import effects_columns, work_columns
    from aerotri.formats.results.parameter_sets import changes_columns, changes_json

    write_csv(folder / "work_list.csv", work_columns(found.work))
    if found.effects is not None:
        write_csv(folder / "parameter_effects.csv", effects_columns(found.effects))
    if found.changes:
        write_json(folder / "parameter_changes.json", changes_json(found.changes))
        write_csv(folder / "parameter_changes.csv", changes_columns(found.changes))
    if compared is not None:
        write_comparison_tables(compared, folder, head)


def _draw(
    adjustment: Adjustment, found: Evaluation, folder: Path, checked: FreeCheck | None, photographs: Sequence[Path]
) -> None:
    from aerotri.report.mark_pictures import mark_pictures
    from aerotri.report.pages.adjustment import Findings, write_report
    from aerotri.report.plots.comparison import plot_comparison
    from aerotri.report.plots.overview import all_plots, save_plots

    figures = all_plots(adjustment.result, found.changes, _footprints(adjustment))
    if adjustment.compared is not None:
        figures["compare_parameters"] = plot_comparison(adjustment.compared)
    beside = Findings(
        found.work, checked, effects=found.effects, changes=found.changes, compared=adjustment.compared,
        lights=found.lights, marks=mark_pictures(adjustment.result, photographs) if photographs else None,
    )  # fmt: skip
    write_report(adjustment.result, save_plots(figures, folder / "plots"), folder / "report.html", beside)


def _footprints(adjustment: Adjustment) -> np.ndarray | None:
    """Footprints over the relief; None where there are so many that those on the mean height have to do."""
    from aerotri.deformation.footprints import footprints

    if len(adjustment.result.block.images) > MOST_EXACT:
        return None
    try:
        return footprints(adjustment).polygons
    except InputError:
        return None
