"""What commands share: results reopened, folders that may be written to."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING

from aerotri.commands.console import Console
from aerotri.conventions import InputError

if TYPE_CHECKING:
    from aerotri.observations import Block
    from aerotri.pipeline import Adjustment


def reopened(result: Path, console: Console) -> Adjustment:
    """The adjustment of a result folder, linearised and factorised once.

    Raises
    ------
    InputError
        When the folder is no result, or the adjustment has not converged.
    """
    from aerotri.compiled import compilation_notice
    from aerotri.coordinates.georeference import is_projected
    from aerotri.opening import open_result

    console.progress(compilation_notice())
    found = open_result(result)
    status, block = found.solution.status, found.result.block
    if status != "converged":
        raise InputError(f"the adjustment ended '{status}'", "give the result of a converged one", result)
    if block.crs != "local" and not is_projected(block.crs):
        raise InputError(
            f"the result is in {block.crs}, which counts in degrees",
            "adjust the block again: `aerotri adjust` brings it to metres", result,
        )  # fmt: skip
    outcome = found.result.outcome
    if outcome.verdict != "accepted":
        console.failure(f"{result}: the adjustment is {outcome.verdict}: {outcome.reasons[0]}")
    return found


def refuse_foreign_entries(folder: Path, own: Collection[str], overwrite: bool = False) -> None:
    """Files that this program has not written, or that were changed since, are replaced when the user says so.

    Parameters
    ----------
    own : names in the folder that are going to be written.

    Raises
    ------
    InputError
    """
    from aerotri.formats.ownership import foreign_files

    found = [] if overwrite or not folder.is_dir() else foreign_files(folder, own)
    if found:
        others = f" and {len(found) - 1} more" if len(found) > 1 else ""
        raise InputError(
            f"'{folder}' holds {found[0]}{others}, not written by aerotri or changed since",
            "choose another place, or add --overwrite",
        )


def refuse_existing_file(file: Path, overwrite: bool = False) -> None:
    """A file that is there already is replaced when the user says so.

    Raises
    ------
    InputError
    """
    if file.is_file() and not overwrite:
        raise InputError("exists already", "choose another name, or add --overwrite", file)


def block_in_metres(block: Block, console: Console, geoid: Path | None = None) -> Block:
    """The block, out of a CRS in degrees into the UTM zone; said so where that is done.

    Raises
    ------
    InputError
    """
    from aerotri.coordinates.metric import in_metres

    found, note = in_metres(block, geoid)
    if note:
        console.note(note)
    return found


def refuse_foreign_folder(folder: Path, *own: str) -> None:
    """Results go into an empty folder, or where the same command has written one of its files `own` before.

    Raises
    ------
    InputError
    """
    if folder.is_dir() and any(folder.iterdir()) and not any((folder / name).exists() for name in own):
        raise InputError(f"'{folder}' holds other files", "choose another --out, or an empty folder")
