"""The formats by name: which one a path holds, reading and writing any of them."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from aerotri.conventions import InputError
from aerotri.formats.bal import is_bal, read_bal, write_bal
from aerotri.formats.block_folder import read_block, write_block
from aerotri.formats.colmap import is_colmap, read_colmap, write_colmap
from aerotri.formats.dbat import read_dbat
from aerotri.formats.dbat_script import is_dbat
from aerotri.formats.oriented import OrientedBlock, oriented_block
from aerotri.observations import Block


def _is_block(path: Path) -> bool:
    return path.suffix == ".toml" if path.is_file() else (path / "block.toml").is_file()


RECOGNISERS: Mapping[str, Callable[[Path], bool]] = {
    "block": _is_block,
    "colmap": is_colmap,
    "dbat": is_dbat,
    "bal": is_bal,
}
READERS: Mapping[str, Callable[[Path], tuple[Block, np.ndarray | None]]] = {
    "block": lambda path: (read_block(path), None),
    "colmap": read_colmap,
    "dbat": lambda path: (read_dbat(path), None),
    "bal": read_bal,
}
WRITERS: Mapping[str, Callable[[OrientedBlock, Path], tuple[str, ...]]] = {"bal": write_bal, "colmap": write_colmap}
"""Formats of orientations and points; a block folder is written from a `Block`."""


def detect_format(path: str | os.PathLike) -> str:
    """The name of the format a file or folder holds.

    Raises
    ------
    InputError
        When there is nothing, or it is none of those known.
    """
    path = Path(path)
    if not path.exists():
        raise InputError("there is no such file or folder", "check the path", path)
    for name, recognises in RECOGNISERS.items():
        if recognises(path):
            return name
    raise InputError("is of no known format", f"known are {', '.join(RECOGNISERS)}; or name the format", path)


def read_any(path: str | os.PathLike, format: str | None = None) -> tuple[Block, np.ndarray | None]:
    """A block of any format that is read.

    Parameters
    ----------
    path : file or folder.
    format : a key of `READERS`; found out from the path when None.

    Returns
    -------
    block : the block.
    points : (N, 3) start values of the object points where the format has them, else None.

    Raises
    ------
    InputError
    """
    name = detect_format(path) if format is None else format
    if name not in READERS:
        raise InputError(f"'{name}' is not a format that is read", f"known are {', '.join(READERS)}")
    return READERS[name](Path(path))


def write_any(
    block: Block, path: str | os.PathLike, format: str = "block", points: np.ndarray | None = None
) -> tuple[str, ...]:
    """Write a block in a format, at its start values where the format holds orientations.

    Parameters
    ----------
    path : file or folder to be.
    format : 'block' or a key of `WRITERS`.
    points : (N, 3) m, the object points for formats that hold them.

    Returns
    -------
    What could not be carried over, in words.

    Raises
    ------
    InputError
    """
    if format == "block":
        write_block(block, path)
        return () if points is None else ("could not be carried over: start values of object points",)
    if format not in WRITERS:
        raise _unknown(format)
    if points is None:
        raise InputError(f"a {format} model needs object points", "adjust the block and export the result", path)
    return write_oriented(oriented_block(block, points), path, format)


def write_oriented(oriented: OrientedBlock, path: str | os.PathLike, format: str) -> tuple[str, ...]:
    """Write orientation, points and rays in a format that holds them; see `oriented_from_adjusted` for results.

    Returns
    -------
    What could not be carried over, in words.

    Raises
    ------
    InputError
    """
    if format not in WRITERS:
        raise _unknown(format)
    return WRITERS[format](oriented, Path(path))


def _unknown(format: str) -> InputError:
    return InputError(f"'{format}' is not a format that is written", f"known are block, {', '.join(WRITERS)}")
