"""The hidden folder beside a target in which its new content grows, held by a lock that ends with its process.

Its name follows from the target's, so a run finds what a killed run has left there and clears it; the lock tells that
from the work of a run that lives. Two runs that write to one place take turns.
"""

from __future__ import annotations

import errno
import os
import secrets
import shutil
import threading
import time
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from aerotri.conventions import FilePath, InputError
from aerotri.formats.files.places import not_written, refuse_impossible_place

LOCK, OLDER, ENDING = "lock", ".older-result", ".aerotri.tmp"
WAIT_S = 60.0
"""Seconds that a process waits for another that writes the same target; chosen [C]: longer than writing a usual result
takes, shorter than a user's patience."""
NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL)

_held: dict[Path, tuple[int, int]] = {}
"""Open lock file and thread of every place that this process holds."""
written: list[Path] = []
"""What this process has brought to its place, for the message when it is interrupted."""


@contextmanager
def work_place(target: Path, wait_s: float = WAIT_S) -> Generator[Path]:
    """An empty folder beside the target for this process alone; it is removed at the end.

    Parameters
    ----------
    target : absolute; the folder above it exists.
    wait_s : how long to wait for another run that writes there.

    Raises
    ------
    InputError
        When another run keeps writing there.
    """
    usual = target.with_name(f".{target.name}{ENDING}")
    if usual in _held and _held[usual][1] == threading.get_ident():
        # a writer within a command that holds the whole folder
        inner = usual / secrets.token_hex(4)
        inner.mkdir()
        try:
            yield inner
        finally:
            shutil.rmtree(inner, ignore_errors=True)
        return
    place, lock = _claimed(usual, target, wait_s)
    _held[place] = lock, threading.get_ident()
    try:
        _clear(place, target)
        yield place
    finally:
        _release(place, target)


@contextmanager
def held(target: FilePath) -> Generator[None]:
    """Keep other runs from writing to a folder that is written piece by piece.

    Raises
    ------
    InputError
        When another run writes there.
    """
    place = refuse_impossible_place(target)
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise not_written(place, error) from error
    with work_place(place, wait_s=0.0):
        yield


def abandon() -> None:
    """Remove all that is unfinished, when the process ends at once."""
    for place in list(_held):
        shutil.rmtree(place, ignore_errors=True)


def _claimed(usual: Path, target: Path, wait_s: float) -> tuple[Path, int]:
    """The folder, and the open file whose lock holds it (−1 where the file system knows no locks)."""
    until = time.monotonic() + wait_s
    while True:
        lock = _opened(usual)
        if lock is None:
            place = usual.with_name(f".{target.name}.{secrets.token_hex(4)}.tmp")
            place.mkdir()
            return place, -1
        if lock >= 0:
            return usual, lock
        if time.monotonic() >= until:
            raise InputError("another run is writing here", "wait until it has ended, or choose another place", target)
        time.sleep(0.05)


def _opened(place: Path) -> int | None:
    """The locked file; −1 while another process holds it, None where this place cannot be used."""
    try:
        place.mkdir(exist_ok=True)
    except FileExistsError:
        return None
    try:
        if place.is_symlink() or (any(place.iterdir()) and not (place / LOCK).is_file()):
            return None  # of somebody else
        lock = os.open(place / LOCK, os.O_RDWR | os.O_CREAT, 0o666)
    except FileNotFoundError:
        return -1  # removed by its owner in this moment
    try:
        _lock(lock)
        if os.fstat(lock).st_ino == os.stat(place / LOCK).st_ino:
            return lock
        os.close(lock)
    except FileNotFoundError:
        os.close(lock)
    except OSError as error:
        os.close(lock)
        if error.errno in NO_LOCKS:
            return None
    return -1


def _lock(file: int) -> None:
    """Lock a file, or raise OSError at once."""
    try:
        import fcntl
    except ImportError:
        import msvcrt

        msvcrt.locking(file, msvcrt.LK_NBLCK, 1)  # pyright: ignore[reportAttributeAccessIssue]
        return
    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _clear(place: Path, target: Path) -> None:
    """Remove what a killed run has left; an older result that it had put aside comes back."""
    for older in (place / OLDER, *place.glob(f"*/{OLDER}")):
        if older.exists() and not os.path.lexists(target):
            os.rename(older, target)
    for entry in place.iterdir():
        if entry.name == LOCK:
            continue
        if entry.is_dir() and not entry.is_symlink():
            shutil.rmtree(entry)
        else:
            entry.unlink()


def _release(place: Path, target: Path) -> None:
    lock, _ = _held.pop(place)
    try:
        _clear(place, target)
        if lock >= 0 and os.name != "posix":
            os.close(lock)
            lock = -1
        (place / LOCK).unlink(missing_ok=True)
        place.rmdir()
    except OSError:
        pass  # the next run clears it
    finally:
        if lock >= 0:
            os.close(lock)
