"""Arrays that this program keeps as files for itself: what is damaged counts as not there."""

from __future__ import annotations

import io
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Collection
from pathlib import Path

import numpy as np

WHAT_DAMAGE_RAISES = (
    OSError, ValueError, KeyError, TypeError, EOFError, NotImplementedError, OverflowError, RecursionError, SyntaxError,
    MemoryError, RuntimeError, struct.error, zlib.error, tokenize.TokenError, zipfile.BadZipFile,
)  # fmt: skip
"""zipfile, zlib and numpy.lib.format, from the directory of an archive to the last byte of an array."""


def kept_arrays(path: Path, only: Collection[str] | None = None) -> dict[str, np.ndarray] | None:
    """The arrays of an archive (.npz) as they were written, all or some; None where it is missing or damaged."""
    try:
        with zipfile.ZipFile(path) as archive:
            # read to its end a member is compared with its checksum, whatever size the header of the array announces
            names = archive.namelist() if only is None else [f"{name}.npy" for name in only]
            whole = {name.removesuffix(".npy"): archive.read(name) for name in names}
        return {n: np.lib.format.read_array(io.BytesIO(b), allow_pickle=False) for n, b in whole.items()}
    except WHAT_DAMAGE_RAISES:
        return None
