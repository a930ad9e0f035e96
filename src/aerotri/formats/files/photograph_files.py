"""The files of photographs: found in folders and their subfolders, and known by their names."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from aerotri.conventions import InputError
from aerotri.formats.assembly.names_match import match_photographs

RECORDS = (
    "block.toml",
    "adjustment.json",
    "tiepoints.json",
    "dtm.json",
    "volume.json",
    "imgeo.json",
    "ortho.json",
    "run.json",
)
"""Files of a folder that this program has written: pictures in it are no photographs of a flight."""


def files_of(folder: Path, endings: Sequence[str]) -> tuple[Path, ...]:
    """The files of a folder and of its subfolders, sorted; hidden ones and what this program wrote are left out.

    Parameters
    ----------
    endings : of the files wanted, in small letters.
    """
    found = []
    for place, folders, names in os.walk(folder):
        if Path(place) != folder and any(name in names for name in RECORDS):
            folders.clear()
            continue
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        wanted = (name for name in names if not name.startswith("."))
        found += [Path(place, name) for name in wanted if Path(name).suffix.lower() in endings]
    return tuple(sorted(found))


def photographs_in(given: Sequence[Path], endings: Sequence[str]) -> list[Path]:
    """The files given, and those in the folders given."""
    return [file for path in given for file in (files_of(path, endings) if path.is_dir() else (path,))]


def match_files(files: Sequence[Path], known: np.ndarray) -> np.ndarray:
    """(n,) which photograph every file is, −1 for none.

    A photograph in a subfolder is called 'day 1/IMG_0001.JPG' in its block: as many folders of a file's path count as
    the name has.

    Parameters
    ----------
    known : (k,) str names of the block.

    Raises
    ------
    InputError
        When two files are the same photograph.
    """
    exact = {name: row for row, name in enumerate(known.tolist())}
    index = np.full(len(files), -1)
    for number, file in enumerate(files):
        parts = file.absolute().parts
        names = ("/".join(parts[k:]) for k in range(1, len(parts)))
        index[number] = next((exact[name] for name in names if name in exact), -1)
    rest = np.flatnonzero(index < 0).tolist()
    # to the matching two of one name mean none
    loose = list(dict.fromkeys(files[k].name for k in rest))
    rows = match_photographs(np.array(loose, dtype=str), known)[0].tolist() if loose else []
    by_name = dict(zip(loose, rows, strict=True))
    for k in rest:
        index[k] = by_name[files[k].name]
    _refuse_twice(files, index, known)
    return index


def _refuse_twice(files: Sequence[Path], index: np.ndarray, known: np.ndarray) -> None:
    first: dict[int, Path] = {}
    for file, row in zip(files, index.tolist(), strict=True):
        if row >= 0 and first.setdefault(row, file) != file:
            message = f"and {first[row]} are both called as photograph '{known[row]}'"
            raise InputError(message, "give the folder of those that were measured", file)
