"""Archives of arrays (.npz) read with nothing taken on trust: which arrays there are, their types and sizes.

numpy reads whatever an archive announces. Here the directory of the archive and the header of every array are looked
at first: a member is read only if its header, its type and the sizes stated agree, so that neither a pickle nor a small
file that unpacks to gigabytes gets any further.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.conventions import InputError
from aerotri.kept_arrays import WHAT_DAMAGE_RAISES

MAGIC = b"\x93NUMPY"
LARGEST_HEADER = 10_000
"""Characters of the header of an array at most, numpy's own limit: its parser is slow with longer ones."""
LARGEST_BYTES = 1 << 33
"""Of one array, where nothing else bounds it."""
REMEDY = "adjust the block again"

Shape = tuple[int | None, ...]


class Archive:
    """The arrays of an archive, each read when it is asked for.

    Raises
    ------
    InputError
        When the file is missing, or no archive.
    """

    def __init__(self, path: Path, remedy: str = REMEDY):
        self.path, self.remedy = path, remedy
        try:
            with zipfile.ZipFile(path) as archive:
                entries = archive.infolist()
        except FileNotFoundError:
            raise InputError("is missing", "give the folder that `aerotri adjust` wrote", path) from None
        except WHAT_DAMAGE_RAISES as error:
            raise self.error(f"cannot be read: {_short(error)}") from error
        self.members = {entry.filename.removesuffix(".npy"): entry for entry in entries}
        if len(self.members) < len(entries):
            raise self.error("holds an array twice")

    def error(self, message: str) -> InputError:
        """An `InputError` with the file and what to do."""
        return InputError(message, self.remedy, self.path)

    def array(self, name: str, kind: str, shape: Shape) -> np.ndarray:
        """An array.

        Parameters
        ----------
        kind : letters of numpy's kinds it may have, 'f', 'iu', 'U'.
        shape : sizes it must have, None where any will do.

        Raises
        ------
        InputError
            When there is none, or another one.
        """
        entry = self.members.get(name)
        if entry is None:
            raise self.error(f"holds no array '{name}'")
        try:
            with zipfile.ZipFile(self.path) as archive, archive.open(entry) as file:
                found, dtype, begin = _head(file)
                self._check(name, dtype, found, kind, shape)
                size = dtype.itemsize * int(np.prod(found, dtype=object))
                if begin + size != entry.file_size or size > LARGEST_BYTES:
                    raise self.error(f"array '{name}' is not as large as it announces")
            with zipfile.ZipFile(self.path) as archive, archive.open(entry) as file:
                array = np.lib.format.read_array(file, allow_pickle=False)
        except WHAT_DAMAGE_RAISES as error:
            raise self.error(f"array '{name}' cannot be read: {_short(error)}") from error
        # one type for each kind: what is compiled for it is not compiled again for another
        plain = {"f": np.float64, "i": np.int64, "u": np.int64}.get(array.dtype.kind)
        return np.ascontiguousarray(array, plain).reshape(array.shape)

    def scalar(self, name: str, kind: str) -> Any:
        """A single number or text as Python has it; see `array`."""
        return self.array(name, kind, ()).item()

    def _check(self, name: str, dtype: np.dtype, found: Shape, kind: str, shape: Shape) -> None:
        if dtype.kind not in kind or dtype.itemsize > (8 if dtype.kind != "U" else LARGEST_BYTES):
            raise self.error(f"array '{name}' is of type {dtype}")
        if len(found) != len(shape) or any(w not in (None, s) for w, s in zip(shape, found, strict=True)):
            raise self.error(f"array '{name}' has the size {_size(found)}, not {_size(shape)}")


def _head(file: Any) -> tuple[tuple[int, ...], np.dtype, int]:
    """Shape, type and place of the first value of an array."""
    begins = file.read(len(MAGIC) + 2)
    if begins[:-2] != MAGIC or begins[-2:] not in (b"\x01\x00", b"\x02\x00"):
        raise ValueError("it is no array of numpy")
    width = 2 if begins[-2] == 1 else 4
    raw = file.read(width)
    length = int.from_bytes(raw, "little")
    if length > LARGEST_HEADER:
        raise ValueError("its header is too long")
    text = file.read(length)
    read = np.lib.format.read_array_header_1_0 if width == 2 else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(io.BytesIO(raw + text))
    if dtype.hasobject or dtype.names is not None or any(size < 0 for size in shape):
        raise ValueError("it holds objects")
    return shape, dtype, len(begins) + width + length


def _size(shape: Shape) -> str:
    return " × ".join("n" if size is None else str(size) for size in shape) or "of one value"


def _short(error: BaseException) -> str:
    return (str(error).splitlines() or [""])[0][:120] or type(error).__name__


def read_kept(path: Path, wanted: Mapping[str, tuple[str, Shape]]) -> dict[str, np.ndarray] | None:
    """Arrays that this program kept for itself, None where the file is missing, damaged, or holds others."""
    try:
        archive = Archive(path)
        return {name: archive.array(name, kind, shape) for name, (kind, shape) in wanted.items()}
    except InputError:
        return None
