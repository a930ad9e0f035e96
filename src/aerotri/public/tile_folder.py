"""The folder that keeps the tiles of a run, so that one that was ended goes on."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

from aerotri.conventions import InputError
from aerotri.formats.files.ownership import told_by
from aerotri.formats.files.places import not_written
from aerotri.formats.files.work_place import held
from aerotri.source_digest import digest_of_sources
from aerotri.version import __version__

SOURCES = ("terrain/**/*.py", "rasters/**/*.py")
"""Modules that make tiles: those of another version are not mixed with tiles of this one."""
STATED = "tiles.json"
SUFFIXES = (".npz", ".part", ".shared")


def tiles_beside(target: Path) -> Path:
    """Where the tiles of a result are kept until it is written."""
    return target.with_name(f"{target.name}.tiles")


def held_tiles(folder: Path | None) -> AbstractContextManager[None]:
    """Keep other runs from the tiles while they are made; nothing is kept where there is no folder.

    Raises
    ------
    InputError
        When another run writes there.
    """
    return nullcontext() if folder is None else held(folder)


def remove_tiles(folder: Path) -> None:
    """When the result is written."""
    shutil.rmtree(folder, ignore_errors=True)


def fingerprints(paths: Iterable[Path]) -> list[list[Any]]:
    """What tells files from others: tiles of other ones are not taken up.

    Raises
    ------
    InputError
        When a file is not there.
    """
    return [told_by(path) for path in paths]


def open_tiles(folder: Path, stated: Mapping[str, Any]) -> None:
    """Make the folder of the tiles; tiles of anything else than what is stated are removed.

    Parameters
    ----------
    stated : all that the tiles depend on, as JSON has it.

    Raises
    ------
    InputError
        When it holds other files, or cannot be written to.
    """
    version = {"aerotri": __version__, "sources": digest_of_sources(SOURCES)}
    text = json.dumps({**stated, **version}, sort_keys=True)
    mark = hashlib.sha256(text.encode()).hexdigest()
    there = folder / STATED
    try:
        folder.mkdir(parents=True, exist_ok=True)
        blocked = next((path for path in folder.iterdir() if path.is_dir()), None)
        if blocked is not None:
            raise InputError("is a folder, where files of tiles belong", "remove it, or give another folder", blocked)
        held = [path for path in folder.iterdir() if path.name != STATED]
        if any(path.suffix not in SUFFIXES for path in held):
            raise InputError("holds other files than tiles", "give another folder for the tiles", folder)
        if there.is_file() and there.read_bytes() == mark.encode():
            return
        for path in held:
            path.unlink()
        # a link would be written through
        there.unlink(missing_ok=True)
        there.write_text(mark, encoding="utf-8")
    except OSError as error:
        raise not_written(folder, error) from error
