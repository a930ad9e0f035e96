"""Folders and files that results go into."""

from __future__ import annotations

import os
from collections.abc import Collection, Sequence
from pathlib import Path

from aerotri.conventions import FilePath, InputError


def refuse_foreign_entries(folder: Path, own: Collection[str], overwrite: bool = False) -> None:
    """Files that this program has not written, or that were changed since, are replaced when the user says so.

    Parameters
    ----------
    folder : that can be written to. own : names in it that are going to be written.

    Raises
    ------
    InputError
    """
    from aerotri.formats.files.ownership import foreign_files

    refuse_no_folder(folder)
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
    from aerotri.formats.files.places import refuse_impossible_place

    refuse_impossible_place(file)
    if file.is_dir():
        raise InputError("is a folder, a file is to be written here", "give another name", file)
    if file.is_file() and not overwrite:
        raise InputError("exists already", "choose another name, or add --overwrite", file)


def refuse_foreign_folder(folder: Path, *own: str) -> None:
    """Results go into an empty folder, or where the same command has written one of its files `own` before.

    Raises
    ------
    InputError
    """
    refuse_no_folder(folder)
    if folder.is_dir() and any(folder.iterdir()) and not any((folder / name).exists() for name in own):
        raise InputError(f"'{folder}' holds other files", "choose another --out, or an empty folder")


def refuse_no_folder(folder: Path) -> None:
    """A place where no folder can be written; to be called before any work is done.

    Raises
    ------
    InputError
    """
    from aerotri.formats.files.places import refuse_impossible_place

    refuse_impossible_place(folder)
    if folder.exists() and not folder.is_dir():
        raise InputError("is a file, a folder is to be written here", "give another name", folder)


def refuse_missing_photographs(given: Sequence[Path]) -> None:
    """Photographs, or folders of them, that are not there.

    Raises
    ------
    InputError
    """
    for path in given:
        if not path.exists():
            raise InputError("is not there", "give the photographs, or their folder", path)


def paths_of(given: FilePath | Sequence[FilePath]) -> list[Path]:
    """One path or several, as a list."""
    return [Path(given)] if isinstance(given, str | os.PathLike) else [Path(path) for path in given]
