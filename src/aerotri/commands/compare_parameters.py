"""`aerotri compare-parameters`: sets of additional parameters side by side."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from aerotri.commands.adjust import folder_name
from aerotri.commands.console import Console
from aerotri.execution.choice import THREADS, chosen
from aerotri.formats.results.json_text import json_text
from aerotri.public.folders import refuse_foreign_folder

if TYPE_CHECKING:
    from aerotri.public.comparing import ComparedParameters


def run_compare_parameters(
    path: Path,
    sets: Sequence[str],
    folds: int,
    robust: str | None,
    geoid: Path | None,
    out: Path | None,
    as_json: bool,
    executor: str = THREADS,
) -> int:
    """Exit code of the command: 0 when a set could be adjusted, 1 when none; arguments as on the command line.

    Raises
    ------
    InputError
    TasksFailedError
        Where sets could not be computed elsewhere.
    """
    console = Console(quiet=as_json)
    from aerotri.compiled import compilation_notice
    from aerotri.formats.files.atomic import room_beside
    from aerotri.pipeline import AdjustmentFailedError
    from aerotri.public.comparing import COMPARISON_NAMES, compare_parameters

    target = out or Path(f"{folder_name(path)}_compare")
    refuse_foreign_folder(target, COMPARISON_NAMES[0])
    console.progress(compilation_notice())
    in_threads = chosen(executor).kind == "threads"
    try:
        with nullcontext() if in_threads else room_beside(target) as room:
            found = compare_parameters(path, sets, folds=folds, robust=robust, geoid=geoid, executor=executor,
                                       scratch=room, progress=console.stage)  # fmt: skip
    except AdjustmentFailedError as failure:
        console.failure(str(failure))
        return 1
    console.progress("drawing")
    found.save(target)
    _tell(found, target, console, as_json)
    return 0 if found.choice else 1


def _tell(found: ComparedParameters, target: Path, console: Console, as_json: bool) -> None:
    from aerotri.formats.results.parameter_sets import comparison_json
    from aerotri.report.tables.parameters import NOTE, comparison_table
    from aerotri.report.tables.terminal import table_lines

    if as_json:
        content = found.head.as_dict() | comparison_json(found.record) | {"choice": found.reason}
        print(json_text(content))
        return
    lines = table_lines(comparison_table(found.record))
    console.lines([*lines, NOTE, *([found.reason] if found.reason else []), f"Written to {target}"])
