"""`aerotri halves`: two halves of a block adjusted apart and compared."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path

from aerotri.commands.adjust import folder_name
from aerotri.commands.console import Console
from aerotri.execution.choice import THREADS, chosen
from aerotri.formats.results.json_text import json_text
from aerotri.public.folders import refuse_foreign_folder


def run_halves(result: Path, divisions: Sequence[str], out: Path | None, as_json: bool, executor: str = THREADS) -> int:
    """Exit code of the command, 0; arguments as on the command line.

    Raises
    ------
    InputError
        Where the folder holds no result that has converged, or a division or an executor does not exist.
    TasksFailedError
        Where divisions could not be computed elsewhere.
    """
    console = Console(quiet=as_json)
    from aerotri.compiled import compilation_notice
    from aerotri.formats.files.atomic import room_beside
    from aerotri.public.halves import HALVES_NAMES, halves
    from aerotri.report.tables.halves import halves_lines

    target = out or Path(f"{folder_name(result).removesuffix('_result')}_halves")
    refuse_foreign_folder(target, HALVES_NAMES[0])
    console.progress(compilation_notice())
    in_threads = chosen(executor).kind == "threads"
    with nullcontext() if in_threads else room_beside(target) as room:
        found = halves(result, divisions=divisions or None, executor=executor, scratch=room, progress=console.stage)
    console.progress("drawing")
    found.save(target)
    if as_json:
        print(json_text(found.content))
    else:
        console.lines([*halves_lines(found.record), f"Written to {target}"])
    return 0
