"""What commands share: results reopened, folders that may be written to."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from aerotri.commands.console import Console
from aerotri.conventions import InputError

if TYPE_CHECKING:
    from aerotri.pipeline import Adjustment


def reopened(result: Path, console: Console) -> Adjustment:
    """The adjustment of a result folder, linearised and factorised once.

    Raises
    ------
    InputError
        When the folder is no result, or the adjustment has not converged.
    """
    from aerotri.compiled import compilation_notice
    from aerotri.formats.block_folder import read_block
    from aerotri.formats.solution import read_solution
    from aerotri.pipeline import reopen

    if not (result / "solution.npz").is_file():
        raise InputError("holds no adjustment", "give the folder that `aerotri adjust` wrote", result)
    console.progress(compilation_notice())
    saved = read_solution(result / "solution.npz")
    if saved.status != "converged":
        raise InputError(f"the adjustment ended '{saved.status}'", "give the result of a converged one", result)
    found = reopen(read_block(result / "block"), saved)
    outcome = found.result.outcome
    if outcome.verdict != "accepted":
        console.failure(f"{result}: the adjustment is {outcome.verdict}: {outcome.reasons[0]}")
    return found


def refuse_foreign_folder(folder: Path, *own: str) -> None:
    """Results go into an empty folder, or where the same command has written one of its files `own` before.

    Raises
    ------
    InputError
    """
    if folder.is_dir() and any(folder.iterdir()) and not any((folder / name).exists() for name in own):
        raise InputError(f"'{folder}' holds other files", "choose another --out, or an empty folder")
