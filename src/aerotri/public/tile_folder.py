"""The folder that keeps the tiles of a run, so that one that was ended goes on."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Generator, Iterable, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Lock
from typing import Any
from weakref import WeakValueDictionary

from aerotri.conventions import InputError
from aerotri.formats.files.locked import LOCK, FolderLock
from aerotri.formats.files.ownership import told_by
from aerotri.version import __version__

STATED = "tiles.json"
SUFFIXES = (".npz", ".part", ".shared")
OWN = (STATED, LOCK)
BESIDE = ".tiles"
_held: WeakValueDictionary[Path, TileFolder] = WeakValueDictionary()
"""Folders that this process has locked."""
_one_at_a_time = Lock()


class TileFolder:
    """A folder of tiles that other processes are kept out of, as long as the object lives.

    Parameters
    ----------
    is_busy : whether a run of this process writes to it. A later run of this process takes it over.
    """

    def __init__(self, folder: Path):
        self.folder, self.lock, self.is_busy = folder, FolderLock(folder), False


def tiles_beside(target: Path) -> Path:
    """Where the tiles of a result are kept until it is written."""
    return target.with_name(f"{target.name}{BESIDE}")


def remove_tiles(folder: Path) -> None:
    """When the result is written; not where another run uses them by now."""
    with suppress(OSError, InputError):
        if folder.is_dir():
            with _in_use(folder) as held:
                held.lock.remove_folder()
                _held.pop(folder.resolve(), None)


def fingerprints(paths: Iterable[Path]) -> list[list[Any]]:
    """What tells files from others: tiles of other ones are not taken up.

    Raises
    ------
    InputError
        When a file is not there.
    """
    return [told_by(path) for path in paths]


@contextmanager
def open_tiles(folder: Path, stated: Mapping[str, Any]) -> Generator[TileFolder]:
    """The folder of the tiles, made and locked for a run; tiles of anything else than what is stated are removed.

    Parameters
    ----------
    stated : all that the tiles depend on, as JSON has it.

    Raises
    ------
    InputError
        When another run uses it, it holds other files, or cannot be written to.
    """
    _refuse_other_files(folder)
    with _in_use(folder) as held:
        _remove_others(folder, stated)
        yield held


@contextmanager
def _in_use(folder: Path) -> Generator[TileFolder]:
    """The folder, locked for this process, and for this run of it.

    Raises
    ------
    InputError
    """
    with _one_at_a_time:
        try:
            place = folder.resolve()
            held = _held.get(place) or TileFolder(folder)
        except BlockingIOError:
            raise _used_elsewhere(folder) from None
        except OSError as error:
            raise _not_writable(folder, error) from error
        if held.is_busy:
            raise _used_elsewhere(folder)
        _held[place], held.is_busy = held, True
    try:
        yield held
    except BaseException:
        # what went wrong may keep the object alive, as a notebook does
        held.lock.let_go()
        _held.pop(place, None)
        raise
    finally:
        held.is_busy = False


def _used_elsewhere(folder: Path) -> InputError:
    if folder.suffix == BESIDE:
        out = folder.with_suffix("")
        return InputError(f"another run is writing to {out}", "wait until it ends, or choose another --out")
    return InputError("another run uses these tiles", "wait until it ends, or give another folder", folder)


def _not_writable(folder: Path, error: OSError) -> InputError:
    return InputError(f"cannot be written to: {error}", "give another place for the tiles", folder)


def _refuse_other_files(folder: Path) -> None:
    try:
        held = list(folder.iterdir()) if folder.exists() else []
    except OSError as error:
        raise _not_writable(folder, error) from error
    if any(path.name not in OWN and path.suffix not in SUFFIXES for path in held):
        raise InputError("holds other files than tiles", "give another folder for the tiles", folder)


def _remove_others(folder: Path, stated: Mapping[str, Any]) -> None:
    """Remove the tiles of other runs, and write down whose the next ones are."""
    text = json.dumps({**stated, "aerotri": __version__}, sort_keys=True)
    mark = hashlib.sha256(text.encode()).hexdigest()
    there = folder / STATED
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if there.is_file() and there.read_bytes() == mark.encode():
            return
        for path in folder.iterdir():
            if path.name not in OWN:
                path.unlink()
        there.write_text(mark, encoding="utf-8")
    except OSError as error:
        raise _not_writable(folder, error) from error
