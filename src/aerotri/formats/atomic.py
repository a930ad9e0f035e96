"""Results appear whole or not at all: written to a temporary name beside their place, renamed at the end.

A program that is killed leaves what was there before untouched, and at most a hidden temporary entry beside it.
"""

from __future__ import annotations

import ctypes
import os
import secrets
import shutil
import sys
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from aerotri.conventions import InputError

AT_FDCWD = -100
RENAME_EXCHANGE = 2


@contextmanager
def atomic_file(target: str | os.PathLike) -> Iterator[Path]:
    """A path to write to; the file takes the name `target` when the block ends without an error.

    Parameters
    ----------
    target : the file to be; folders above it are made.

    Yields
    ------
    A path in the same folder that does not exist yet.

    Raises
    ------
    InputError
        When the place cannot be written to.
    """
    target = _place(target)
    if target.is_dir():
        raise InputError("is a folder, a file is to be written here", "give another name", target)
    temporary = _temporary(target)
    with _told_as_input_error(target):
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            yield temporary
            os.replace(temporary, target)
        finally:
            temporary.unlink(missing_ok=True)


@contextmanager
def atomic_folder(target: str | os.PathLike, own: Collection[str] | None = None) -> Iterator[Path]:
    """An empty folder to fill; it takes the name `target` when the block ends without an error.

    An older folder of that name is exchanged for the new one in one step. What it holds besides (a user's notes beside
    our tables) is carried over, never deleted.

    Parameters
    ----------
    target : the folder to be; folders above it are made.
    own : the names this writer gives. An older entry of such a name is dropped even when the new folder has none, so
        that nothing old stands beside what is new. None: everything that the new folder lacks is carried over.

    Yields
    ------
    The new folder under its temporary name.

    Raises
    ------
    InputError
        When the place cannot be written to, or holds a file.
    """
    target = _place(target)
    if target.exists() and not target.is_dir():
        raise InputError("is a file, a folder is to be written here", "give another name", target)
    temporary = _temporary(target)
    with _told_as_input_error(target):
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            temporary.mkdir()
            yield temporary
            if target.is_dir():
                _carry_over(target, temporary, own or ())
                _exchange(temporary, target)
            else:
                os.rename(temporary, target)
        finally:
            # after an exchange this is the older folder
            shutil.rmtree(temporary, ignore_errors=True)


def _place(target: str | os.PathLike) -> Path:
    """The target with links followed, so that a link stays a link."""
    return Path(target).resolve()


def _temporary(target: Path) -> Path:
    return target.with_name(f".{target.name}.{secrets.token_hex(4)}.tmp")


@contextmanager
def _told_as_input_error(target: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(
            f"cannot be written: {error.strerror or error}",
            "check permissions and free space, or choose another place",
            target,
        ) from error


def _carry_over(old: Path, new: Path, own: Collection[str]) -> None:
    """Bring entries of others into the new folder, as links where the file system has them; `old` stays whole."""
    for entry in old.iterdir():
        place = new / entry.name
        if entry.name in own or place.exists():
            continue
        if entry.is_dir() and not entry.is_symlink():
            shutil.copytree(entry, place, symlinks=True, copy_function=_link_or_copy)
        else:
            _link_or_copy(entry, place)


def _link_or_copy(source: str | Path, place: str | Path) -> None:
    try:
        os.link(source, place, follow_symlinks=False)
    except OSError:
        shutil.copy2(source, place, follow_symlinks=False)


def _exchange(temporary: Path, target: Path) -> None:
    """Swap the two folders, in one step where the system can."""
    if _exchange_in_one_step(temporary, target):
        return
    aside = _temporary(target)
    os.rename(target, aside)
    try:
        os.rename(temporary, target)
    except OSError:
        os.rename(aside, target)
        raise
    os.rename(aside, temporary)


def _exchange_in_one_step(temporary: Path, target: Path) -> bool:
    """Linux' renameat2 with RENAME_EXCHANGE; False where it is missing or the file system refuses."""
    if not sys.platform.startswith("linux"):
        return False
    try:
        rename: Callable[..., int] = ctypes.CDLL(None, use_errno=True).renameat2
    except (OSError, AttributeError):
        return False
    return rename(AT_FDCWD, os.fsencode(temporary), AT_FDCWD, os.fsencode(target), RENAME_EXCHANGE) == 0
