"""`aerotri compare-parameters`: sets of additional parameters side by side."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from aerotri.commands.console import Console
from aerotri.commands.results import refuse_foreign_folder
from aerotri.conventions import InputError

if TYPE_CHECKING:
    from aerotri.statistics.parameter_comparison import ParameterComparison

COMPARISON_NAMES = ("compare_parameters.json", "compare_parameters.csv", "compare_parameters.png",
                    "compare_parameters.svg")  # fmt: skip


def run_compare_parameters(
    path: Path,
    sets: Sequence[str],
    folds: int,
    robust: str | None,
    geoid: Path | None,
    out: Path | None,
    as_json: bool,
) -> int:
    """Exit code of the command: 0 when a set could be adjusted, 1 when none; arguments as on the command line.

    Raises
    ------
    InputError
    """
    console = Console(quiet=as_json)
    from aerotri.commands.adjust import folder_name, with_settings
    from aerotri.formats.block_folder import read_block
    from aerotri.functional_model.additional_parameters import AUTO, parse_parameters

    choices = [parse_parameters(spec) for spec in sets]
    if AUTO in choices:
        raise InputError("auto is no set to compare with others", "without --set all sets that auto compares are shown")
    block = with_settings(read_block(path), None, robust)
    target = out or Path(f"{folder_name(path)}_compare")
    refuse_foreign_folder(target, COMPARISON_NAMES[0])

    from aerotri.compiled import compilation_notice
    from aerotri.pipeline import AdjustmentFailedError, compare_parameters
    from aerotri.statistics.parameter_choice import candidate_sets, choose

    console.progress(compilation_notice())
    try:
        comparison = compare_parameters(block, choices or candidate_sets(block), folds, geoid, console.step)
    except AdjustmentFailedError as failure:
        console.failure(str(failure))
        return 1
    there = any(o.converged for o in comparison.outcomes)
    chosen = choose(comparison) if there else None
    write_comparison(comparison, target, console)
    _tell(comparison, "" if chosen is None else chosen.reason, target, console, as_json)
    return 0 if there else 1


def write_comparison(comparison: ParameterComparison, target: Path, console: Console) -> None:
    """Write the comparison as JSON, CSV and a picture; the folder appears when it is whole."""
    from aerotri.formats.atomic import atomic_folder
    from aerotri.report.plots import save_plots
    from aerotri.report.plots_comparison import plot_comparison

    console.progress("drawing")
    with atomic_folder(target, own=COMPARISON_NAMES) as folder:
        save_plots({"compare_parameters": plot_comparison(comparison)}, folder)
        write_comparison_tables(comparison, folder)


def write_comparison_tables(comparison: ParameterComparison, folder: Path) -> None:
    """Write compare_parameters.json and compare_parameters.csv into a folder."""
    from aerotri.formats.result import write_csv
    from aerotri.report.parameter_tables import comparison_columns, comparison_json

    text = json.dumps(comparison_json(comparison), indent=2, ensure_ascii=False, allow_nan=False)
    (folder / "compare_parameters.json").write_text(text + "\n", encoding="utf-8")
    write_csv(folder / "compare_parameters.csv", comparison_columns(comparison))


def _tell(comparison: ParameterComparison, reason: str, target: Path, console: Console, as_json: bool) -> None:
    from aerotri.report.parameter_tables import NOTE, comparison_json, comparison_table
    from aerotri.report.terminal import table_lines

    if as_json:
        content = comparison_json(comparison) | {"choice": reason}
        print(json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False))
        return
    lines = table_lines(comparison_table(comparison))
    console.lines([*lines, NOTE, *([reason] if reason else []), f"Written to {target}"])
