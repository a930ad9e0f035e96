"""`aerotri adjust` of a block in parts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from aerotri.commands.console import Console
from aerotri.conventions import InputError, real_path
from aerotri.formats.results.json_text import json_text


def run_adjust_parts(
    path: Path,
    out: Path | None,
    robust: Any,
    geoid: Path | None,
    executor: str,
    as_json: bool,
    plots: bool,
    **others: Any,
) -> int:
    """Exit code of the command: 0 when converged and not rejected, 1 otherwise; arguments as on the command line.

    Parameters
    ----------
    others : options by name that a block in parts does not know, with what the user gave.

    Raises
    ------
    InputError
    """
    given = [name for name, value in others.items() if value]
    if given:
        option = given[0].replace("_", "-")
        raise InputError(f"--{option} is not for a block in parts", "leave it out, or adjust the block in one piece")
    from aerotri.compiled import compilation_notice
    from aerotri.partition.whole import whole_json
    from aerotri.public.parts import adjust_parts
    from aerotri.report.tables.parts import parts_lines

    console = Console(quiet=as_json)
    target = out or Path(f"{real_path(path).name}_result")
    console.progress(compilation_notice())
    found = adjust_parts(
        path, target, robust=robust, geoid=geoid, plots=plots, executor=executor, progress=console.stage
    )
    if as_json:
        print(json_text(whole_json(found.record)))
    else:
        console.lines(
            [
                *parts_lines(found.record),
                f"Written to {target}, photographs and points of each part to {target}/parts"
                + (f", report: {target}/report.html" if plots else ""),
            ]
        )
    return 1 if found.status != "converged" or found.verdict == "rejected" else 0
