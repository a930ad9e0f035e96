"""What commands share: results reopened."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from aerotri.commands.console import Console

if TYPE_CHECKING:
    from aerotri.public.adjustment import Adjustment as Opened
    from aerotri.results.adjustment import Adjustment


def reopened(result: Path, console: Console) -> Adjustment:
    """The adjustment of a result folder, linearised and factorised once.

    Raises
    ------
    InputError
        When the folder is no result, or the adjustment has not converged.
    """
    from aerotri.compiled import compilation_notice
    from aerotri.public.results import open_result

    console.progress(compilation_notice())
    found = open_result(result)
    said = doubt(result, found)
    if said:
        console.failure(said)
    return found.record


def doubt(folder: Path, result: Opened) -> str:
    """A sentence when a result is not simply accepted, '' else."""
    return "" if result.verdict == "accepted" else f"{folder}: the adjustment is {result.verdict}: {result.reasons[0]}"
