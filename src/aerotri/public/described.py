"""What the files of a result are for, in the words of the reference."""

from __future__ import annotations

from pathlib import Path

WITH = "with "
"""Begins the condition of files that are written on demand alone."""


def files_in(place: str, folder: Path) -> list[tuple[str, str]]:
    """Names of the files that a command writes into its folder, and what each is for.

    Parameters
    ----------
    place : as the reference calls the folder, 'folder of dsm'. folder : where it is; files written on demand are named
        where they are there.
    """
    from aerotri.reference.files import described_files

    return [
        (one.name, one.text)
        for one in described_files()
        if one.place == place and (not one.when.startswith(WITH) or (folder / one.name).exists())
    ]
