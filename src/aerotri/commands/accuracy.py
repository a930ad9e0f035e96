"""`aerotri accuracy`: accuracy by check points, as a standard asks for it."""

from __future__ import annotations

from pathlib import Path

from aerotri.commands.adjust import folder_name
from aerotri.commands.console import Console, written
from aerotri.formats.results.json_text import json_text
from aerotri.public.folders import refuse_foreign_folder


def run_accuracy(
    result: Path,
    class_horizontal: float | None,
    class_vertical: float | None,
    vegetated: Path | None,
    project_area: float | None,
    out: Path | None,
    as_json: bool,
) -> int:
    """Exit code of the command: 1 for a rejected result, else 0; arguments as on the command line, cm and km².

    Raises
    ------
    InputError
        Where the folder holds no result that has converged, or the list of points names another one.
    """
    console = Console(quiet=as_json)
    from aerotri.public.accuracy import ACCURACY_NAMES, accuracy
    from aerotri.report.tables.accuracy import accuracy_lines

    target = out or Path(f"{folder_name(result).removesuffix('_result')}_accuracy")
    refuse_foreign_folder(target, ACCURACY_NAMES[0])
    found = accuracy(
        result,
        class_horizontal=None if class_horizontal is None else class_horizontal / 100.0,
        class_vertical=None if class_vertical is None else class_vertical / 100.0,
        vegetated=vegetated or (),
        project_area=None if project_area is None else 1e6 * project_area,
    )
    found.save(target)
    if as_json:
        print(json_text(found.content))
    else:
        console.lines([*accuracy_lines(found.record), written(target, "accuracy.html")])
    return 1 if found.record.verdict == "rejected" else 0
