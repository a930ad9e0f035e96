"""A lock of the operating system on a folder: it ends with the process that holds it, however that ends."""

from __future__ import annotations

import os
import shutil
import weakref
from contextlib import suppress
from pathlib import Path

LOCK = "in_use.lock"
TRIES = 20
"""Where others remove the folder just then."""


class FolderLock:
    """The folder, locked for this process as long as the object lives; a place that cannot lock goes on without.

    Parameters
    ----------
    folder : is made where it is missing.

    Raises
    ------
    BlockingIOError
        When it is locked already.
    OSError
        When it cannot be made.
    """

    def __init__(self, folder: Path):
        self.folder = folder
        self._file = _locked(folder)
        self._end = weakref.finalize(self, _close, self._file)

    def let_go(self) -> None:
        """Let others in."""
        self._end()

    def remove_folder(self) -> None:
        """Remove the folder with all that is in it, the lock last, so that nobody gets in before."""
        for path in self.folder.iterdir():
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path, ignore_errors=True)
            elif path.name != LOCK:
                path.unlink(missing_ok=True)
        if os.name == "nt":
            # an open file cannot be removed there, nor one that another process has opened meanwhile
            self.let_go()
        (self.folder / LOCK).unlink(missing_ok=True)
        self.let_go()
        self.folder.rmdir()


def _locked(folder: Path) -> int | None:
    """The file that is locked; None where that cannot be."""
    path = folder / LOCK
    for _ in range(TRIES):
        folder.mkdir(parents=True, exist_ok=True)
        try:
            file = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        except FileNotFoundError:
            # who held it has just removed the folder
            continue
        except OSError:
            return None
        try:
            _lock_now(file)
            if os.name == "nt" or os.path.samestat(os.fstat(file), os.stat(path)):
                return file
        except BlockingIOError:
            _close(file)
            raise
        except FileNotFoundError:
            pass
        except OSError:
            _close(file)
            return None
        # the lock of a file that was removed meanwhile is none
        _close(file)
    return None


def _lock_now(file: int) -> None:
    """Lock the file, or raise BlockingIOError where it is locked already."""
    if os.name == "nt":
        import msvcrt

        try:
            msvcrt.locking(file, msvcrt.LK_NBLCK, 1)  # pyright: ignore[reportAttributeAccessIssue]
        except PermissionError as error:
            raise BlockingIOError from error
    else:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _close(file: int | None) -> None:
    if file is not None:
        with suppress(OSError):
            os.close(file)
