"""A cache of compiled kernels in which processes that run beside one another compile every kernel once.

Numba's own cache lets each of them compile for itself whatever is not there yet. Here the first one holds a lock while
it compiles, and the others wait and read what it wrote. The lock is one of the operating system: it ends with the
process that holds it, however that ends.
"""

from __future__ import annotations

import os
import pickle
import time
import warnings
from contextlib import suppress
from pathlib import Path
from typing import Any

from numba.core.caching import FunctionCache, IndexDataCacheFile

from aerotri.source_digest import digest_of_sources

PATIENCE_S = 60.0
"""For another process to compile a kernel, before it is compiled here; chosen [C]: ten times what the longest takes."""
LOOK_S = 0.02
"""Between two looks whether the lock is free."""
KERNEL_FILES = ("compiled.py", "compiled_records.py", "_*kernels.py", "kernel_records.py", "picket_status.py")
"""Modules whose code, constants and order of fields are compiled in."""
UNREADABLE = (
    OSError,
    pickle.UnpicklingError,
    EOFError,
    ImportError,
    AttributeError,
    LookupError,
    TypeError,
    ValueError,
)
"""What reading a file raises that may not be read, is damaged, or whose types have other names or modules now."""


class KeptFiles(IndexDataCacheFile):
    """Numba's files of one function. One that cannot be read counts as not there: it is compiled and written anew.

    Numba reads the types of an index before it looks whether the index is of these sources: after an upgrade in which a
    record of kernels got another name or module, that would end the program.
    """

    def _load_index(self) -> dict[Any, str]:
        try:
            return super()._load_index()
        except UNREADABLE:
            return {}

    def _load_data(self, name: str) -> Any:
        try:
            return super()._load_data(name)
        except UNREADABLE as error:
            # numba goes on as with a file that was removed
            raise FileNotFoundError(name) from error

    def save(self, key: Any, data: Any) -> None:
        """Keep what was compiled, with what it was compiled from.

        Numba writes the index first: where the disk was full after that, or the process ended, it points to the file
        of an older kernel.
        """
        super().save(key, (self._source_stamp, key, data))

    def load(self, key: Any) -> Any:
        """What is kept for the types, of these sources; None where it is of others."""
        kept = super().load(key)
        if not isinstance(kept, tuple) or kept[:2] != (self._source_stamp, key):
            return None
        return kept[2]


class SharedCache(FunctionCache):
    """Numba's cache on disk for one function; numba calls it under its own lock, for one thread at a time."""

    _told = False

    def __init__(self, function: Any):
        super().__init__(function)
        self._lock: int | None = None
        # numba looks at the function's own file; kernels of other files stand in its code as well
        stamp = self._impl.locator.get_source_stamp(), digest_of_sources(KERNEL_FILES)
        self._cache_file = KeptFiles(self._cache_path, self._impl.filename_base, stamp)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """What is compiled for the types; None where this process is to compile it, and holds the lock for it."""
        found = super().load_overload(sig, target_context)
        if found is not None or self._lock is not None:
            return found
        self._lock = _locked(self._lock_path())
        # another process may have written it before it let go
        found = super().load_overload(sig, target_context)
        if found is not None:
            self._let_go()
        return found

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep what was compiled, and let others go on. Where it cannot be kept the program goes on with it.

        Warns
        -----
        UserWarning
        """
        try:
            super().save_overload(sig, data)
        except OSError as error:
            # of a file that was to take its name, where a folder has it
            place = f": '{error.filename2}'" if isinstance(error, IsADirectoryError) and error.filename2 else ""
            self._say_not_kept((error.strerror or str(error)) + place)
        finally:
            self._let_go()

    def _say_not_kept(self, why: str) -> None:
        """Once, not for every kernel."""
        if not SharedCache._told:
            SharedCache._told = True
            text = f"compiled code cannot be stored in {self._cache_path} ({why}), so every run starts more slowly"
            remedy = "free some space, or set the variable NUMBA_CACHE_DIR to a folder that may be written"
            warnings.warn(f"{text} — {remedy}", stacklevel=2)

    def _lock_path(self) -> Path:
        return Path(self._cache_path) / f"{self._impl.filename_base}.lock"

    def _let_go(self) -> None:
        lock, self._lock = self._lock, None
        if lock is not None:
            # closing it is what lets others in
            with suppress(OSError):
                os.close(lock)


def _locked(path: Path) -> int | None:
    """The file, locked for this process; None where that cannot be, or another process holds it for too long."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError:
        return None
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        try:
            _lock_now(file)
            return file
        except BlockingIOError:
            time.sleep(LOOK_S)
        except OSError:
            break
    os.close(file)
    return None


def _lock_now(file: int) -> None:
    """Lock the file, or raise BlockingIOError where another process holds it."""
    if os.name == "nt":
        import msvcrt

        try:
            msvcrt.locking(file, msvcrt.LK_NBLCK, 1)  # pyright: ignore[reportAttributeAccessIssue]
        except PermissionError as error:
            raise BlockingIOError from error
    else:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
