"""Whether something can be written to a place, and what to say where it cannot."""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from aerotri.conventions import FilePath, InputError
from aerotri.execution.work import NO_SPACE
from aerotri.rasters.room import is_full

LONGEST_ADDITION = ".00000000.aerotri.tmp"
"""What hidden names beside a target have more than its own, at most."""
REMEDY = "choose another place"
FREE = f"free some space, or {REMEDY}"


def refuse_impossible_place(target: FilePath) -> Path:
    """As `place_of`, before any work is done.

    An empty folder is made there for a moment: permissions alone do not tell whether that is possible.

    Raises
    ------
    InputError
        When nothing can be written there, with the reason.
    """
    place = place_of(target)
    folder = existing_folder(place)
    try:
        try:
            _try_folder(folder)
        except PermissionError:
            if not place.is_dir():
                raise
            _try_folder(place)  # files may go into a folder that cannot be exchanged for another
    except OSError as error:
        if error.errno in NO_SPACE:
            raise full_disk(target, error) from error
        reason = f"nothing can be made in '{folder}' ({error.strerror})"
        raise InputError(f"cannot be written: {reason}", REMEDY, target) from error
    return place


def _try_folder(folder: Path) -> None:
    """Make an empty folder in another, and remove it.

    Raises
    ------
    OSError
    """
    os.rmdir(tempfile.mkdtemp(prefix=".", suffix=".aerotri.tmp", dir=folder))


def place_of(target: FilePath) -> Path:
    """The target with links followed, so that a link stays a link.

    Parameters
    ----------
    target : file or folder to be; it and folders above it may be missing.

    Raises
    ------
    InputError
        When no file or folder can have this name.
    """
    given = Path(target)
    try:
        folder, missing = _nearest_folder(given)
        for name in missing:
            _length_of(folder / (name + LONGEST_ADDITION))
        return given.resolve()
    except (OSError, ValueError, RuntimeError) as error:
        raise not_written(given, error) from error


def not_written(target: FilePath | None, error: Exception) -> InputError:
    """The error to raise where a place could not be written to.

    Parameters
    ----------
    target : file or folder; None where it is not known. error : what the system said.
    """
    code = getattr(error, "errno", None)
    if code in NO_SPACE:
        return full_disk(target, error)
    reason = " ".join(str(getattr(error, "strerror", None) or error).split())
    given = None if target is None else Path(target)
    if code == errno.ENOENT and (given is None or not given.is_absolute()) and is_current_folder_gone():
        return InputError("the current folder is not there any more", "change to another folder: cd FOLDER")
    if code == errno.ELOOP:
        reason = "its symbolic links form a loop"
    elif given is not None and code == errno.ENAMETOOLONG:
        reason = f"the name has {max(map(len, given.parts))} letters, which is too long"
    elif given is not None and code in (errno.ENOTDIR, errno.EEXIST):
        above = [place for place in given.parents if os.path.lexists(place) and not place.is_dir()]
        is_lost = os.path.islink(given) and not given.exists()
        reason = "it is a link to what is not there" if is_lost else f"'{above[0]}' is no folder" if above else reason
    return InputError(f"cannot be written: {reason}", REMEDY, target)


def full_disk(target: FilePath | None, error: Exception | None = None, remedy: str = FREE) -> InputError:
    """The error to raise where a disk is full, with the folder and what is free in it.

    Parameters
    ----------
    target : what was to be written; None where it is not known. error : its file tells the place, where it is on
        another disk than the target. remedy : what the user can do.
    """
    named = getattr(error, "filename", None)
    file = _on_another_disk(named if isinstance(named, str | os.PathLike) else None, target)
    code = getattr(error, "errno", None)
    if code == errno.EDQUOT:
        return InputError("the share of the disk that you may use (quota) is full", remedy, file)
    if code == errno.EFBIG:
        return InputError("the file is larger than this disk, or the limit of the system, allows", remedy, file)
    reason = "the disk is full"
    with contextlib.suppress(OSError):  # the current folder may be gone
        for folder in _full_folders() if file is None else (existing_folder(file),):
            reason += f"; {_free_in_words(folder)} free in '{folder}'"
    return InputError(reason, remedy, file)


def is_current_folder_gone() -> bool:
    """Whether the folder that the program was started in was removed, so that relative paths lead nowhere."""
    try:
        os.getcwd()
    except OSError:
        return True
    return False


def existing_folder(place: FilePath) -> Path:
    """The folder nearest to a place, above it, that is there."""
    return next(folder for folder in Path(place).absolute().parents if folder.is_dir())


def _nearest_folder(target: Path) -> tuple[Path, list[str]]:
    """The folder above a target that is there, and the names below it that are not, and of the target.

    Raises
    ------
    OSError, RuntimeError
    """
    with contextlib.suppress(FileNotFoundError):
        os.stat(target)
    place = target.resolve()
    if not place.name:
        raise OSError(errno.EBUSY, "it is the root of the file system")
    names = [place.name]
    for folder in place.parents:
        try:
            os.stat(folder)
        except FileNotFoundError:
            names.append(folder.name)
            continue
        if not folder.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(folder))
        return folder, names
    raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(place))


def _length_of(place: Path) -> None:
    """Ask the file system whether a name, that need not be there, is too long.

    Raises
    ------
    OSError
    """
    try:
        os.lstat(place)
    except FileNotFoundError:
        return


def _on_another_disk(file: FilePath | None, target: FilePath | None) -> FilePath | None:
    """The file where it is on another disk than the target; else the target."""
    if target is None or file is None:
        return target or file
    try:
        same = _device(existing_folder(file)) == _device(existing_folder(target))
    except OSError:
        return target
    return target if same else file


def _device(folder: Path) -> int:
    return os.stat(folder).st_dev


def _full_folders() -> Iterator[Path]:
    """Folders that are written to without being named, where little is free."""
    for name in dict.fromkeys((os.curdir, os.environ.get("TMPDIR", "/tmp"))):
        if is_full(Path(name)):
            yield Path(os.path.abspath(name))


def _free_in_words(folder: Path) -> str:
    try:
        free = shutil.disk_usage(folder).free
    except OSError:
        return "unknown space"
    return f"{free / 2**30:.1f} GiB" if free >= 2**30 else f"{free / 2**20:.1f} MiB"
