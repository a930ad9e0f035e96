"""Results appear whole or not at all: written to a hidden place beside their own, renamed at the end.

A program that is killed leaves what was there before untouched, and at most a hidden folder beside it, which the next
run that writes there removes. Files of the user are told from ours by a list of what was written (`ownership`).
"""

from __future__ import annotations

import ctypes
import errno
import os
import sys
from collections.abc import Callable, Collection, Generator
from contextlib import contextmanager
from pathlib import Path

from aerotri.conventions import FilePath, InputError
from aerotri.formats.files.ownership import carry_over, record_carried, record_files
from aerotri.formats.files.places import full_disk, not_written, place_of
from aerotri.formats.files.work_place import OLDER, work_place, written
from aerotri.rasters.room import is_full

AT_FDCWD = -100
"""Of linux/fcntl.h: paths count from the working directory."""
RENAME_EXCHANGE = 2
"""Of linux/fs.h: renameat2 exchanges two names in one step."""


@contextmanager
def atomic_file(target: FilePath) -> Generator[Path]:
    """A path to write to; the file takes the name `target` when the block ends without an error.

    Parameters
    ----------
    target : the file to be; folders above it are made.

    Yields
    ------
    A path on the same disk that does not exist yet, with the name of the target.

    Raises
    ------
    InputError
        When the place cannot be written to.
    """
    target = place_of(target)
    if target.is_dir():
        raise InputError("is a folder, a file is to be written here", "give another name", target)
    with _told_as_input_error(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        with work_place(target) as place, _told_as_input_error(target):
            yield place / target.name
            _refuse_full(target)
            os.replace(place / target.name, target)
            written.append(target)


@contextmanager
def atomic_folder(target: FilePath, own: Collection[str] | None = None, gone: Collection[str] = ()) -> Generator[Path]:
    """An empty folder to fill; it takes the name `target` when the block ends without an error.

    An older folder of that name is exchanged for the new one in one step. What it holds besides (a user's notes beside
    our tables, or in our folders) is carried over, never deleted.

    Parameters
    ----------
    target : the folder to be; folders above it are made.
    own : the names this writer gives. An older entry of such a name is dropped even when the new folder has none, so
        that nothing old stands beside what is new. None: everything that the new folder lacks is carried over.
    gone : relative paths of further files that are dropped.

    Yields
    ------
    The new folder under its temporary name.

    Raises
    ------
    InputError
        When the place cannot be written to, or holds a file.
    """
    target = place_of(target)
    if target.exists() and not target.is_dir():
        raise InputError("is a file, a folder is to be written here", "give another name", target)
    with _told_as_input_error(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        with work_place(target) as place, _told_as_input_error(target):
            new = place / target.name
            new.mkdir()
            yield new
            record_files(new)
            _refuse_full(target)
            if target.is_dir():
                seen: set[Path] = set()
                record_carried(new, carry_over(target, new, own or (), gone, seen))
                _exchange(new, target)
                # what came while it was being carried over
                carry_over(new, target, own or (), gone, seen)
            else:
                os.rename(new, target)
            written.append(target)


@contextmanager
def room_beside(target: FilePath) -> Generator[Path]:
    """A hidden folder beside a target, for what is too large to be held until it is written there; then removed.

    Parameters
    ----------
    target : file or folder to be; folders above it are made. `atomic_file` and `atomic_folder` may write it meanwhile.

    Raises
    ------
    InputError
        When the place cannot be written to.
    """
    target = place_of(target)
    with _told_as_input_error(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        with work_place(target) as place, _told_as_input_error(target):
            yield place


@contextmanager
def _told_as_input_error(target: Path) -> Generator[None]:
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        # GDAL has errors of its own for a disk that is full
        if is_full(target.parent):
            raise full_disk(target, error) from error
        if not isinstance(error, OSError):
            raise
        raise not_written(target, error) from error


def _refuse_full(target: Path) -> None:
    """GDAL closes a file that found no room without a word: nothing written with so little left is trusted.

    Raises
    ------
    OSError
    """
    if is_full(target.parent):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(target))


def _exchange(new: Path, target: Path) -> None:
    """Swap the two folders, in one step where the system can."""
    if _exchange_in_one_step(new, target):
        return
    aside = new.with_name(OLDER)
    os.rename(target, aside)
    try:
        os.rename(new, target)
    except OSError:
        os.rename(aside, target)
        raise
    os.rename(aside, new)


def _exchange_in_one_step(temporary: Path, target: Path) -> bool:
    """Linux' renameat2 with RENAME_EXCHANGE; False where it is missing or the file system refuses."""
    if not sys.platform.startswith("linux"):
        return False
    try:
        rename: Callable[..., int] = ctypes.CDLL(None, use_errno=True).renameat2
    except (OSError, AttributeError):
        return False
    return rename(AT_FDCWD, os.fsencode(temporary), AT_FDCWD, os.fsencode(target), RENAME_EXCHANGE) == 0
