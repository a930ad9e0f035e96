"""Which files of a folder this program has written, so that files of the user are told from them.

Every folder that is written whole holds a hidden list of its files with their fingerprints. What is not in the list, or
was changed since, belongs to the user: it is carried over into the next result and never deleted.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

from aerotri.conventions import InputError

LEDGER, LEFT_OVER = ".aerotri-files", ".aerotri.tmp"
WHOLE_BYTES = 64 << 20
"""Larger files are told by their size, their first and their last such part: nobody edits them by hand."""
ENDS_BYTES = 64 << 10
"""Of a photograph or raster, both ends: its header, and rows of pixels; chosen [C]: no time is lost on them."""


def fingerprint(path: Path, part_bytes: int = WHOLE_BYTES) -> str:
    """Size and BLAKE2 of the content, of its first and last part where it is larger than two of them."""
    size = path.stat().st_size
    digest = hashlib.blake2b(digest_size=16)
    with path.open("rb") as file:
        digest.update(file.read(part_bytes))
        if size > 2 * part_bytes:
            file.seek(-part_bytes, os.SEEK_END)
        digest.update(file.read(part_bytes))
    return f"{size}:{digest.hexdigest()}"


def told_by(path: Path) -> list[Any]:
    """What tells a file that is read from others: name, time, size, and its first and last `ENDS_BYTES`.

    Raises
    ------
    InputError
        When it is not there, or cannot be read.
    """
    try:
        return [path.name, path.stat().st_mtime_ns, fingerprint(path, ENDS_BYTES)]
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", "give the path of a file that exists", path) from error


def record_files(folder: Path) -> None:
    """List all files that a new folder holds."""
    _write_list(
        folder, {str(rel): fingerprint(folder / rel) for rel in _files(folder) if not (folder / rel).is_symlink()}
    )


def record_carried(folder: Path, carried: Mapping[str, str]) -> None:
    """Add files of earlier runs to the list of a new folder that they were carried over to, as they were listed."""
    if carried:
        _write_list(folder, {**carried, **(recorded_files(folder) or {})})


def _write_list(folder: Path, listed: Mapping[str, str]) -> None:
    (folder / LEDGER).write_text(json.dumps(listed, indent=0, ensure_ascii=False) + "\n", encoding="utf-8")


def recorded_files(folder: Path) -> dict[str, str] | None:
    """Fingerprints of the files this program wrote, by relative path; None where there is no list that can be read."""
    try:
        content = json.loads((folder / LEDGER).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    return {str(k): str(v) for k, v in content.items()} if isinstance(content, dict) else None


def foreign_files(folder: Path, own: Collection[str]) -> list[str]:
    """Files under the names `own` that this program has not written, or that were changed since.

    Further files of the user in a folder of such a name stay there whatever is written, and do not count.

    Parameters
    ----------
    folder : may be missing. own : files or folders in it, which the next run would replace.
    """
    ledger = recorded_files(folder) or {}
    found = []
    for name in own:
        entry = folder / name
        if entry.is_dir() and not entry.is_symlink():
            inside = (Path(name) / rel for rel in _files(entry))
            files = [rel for rel in inside if str(rel) in ledger and rel.name != LEDGER]
        else:
            files = [Path(name)] if os.path.lexists(entry) else []
        found += [str(rel) for rel in files if not is_own(folder, rel, ledger)]
    return found


def is_own(folder: Path, rel: Path, ledger: Mapping[str, str]) -> bool:
    """Whether a file is as this program wrote it."""
    known = ledger.get(str(rel))
    path = folder / rel
    return known is not None and path.is_file() and not path.is_symlink() and fingerprint(path) == known


def carry_over(old: Path, new: Path, own: Collection[str], gone: Collection[str], seen: set[Path]) -> dict[str, str]:
    """Bring what this run does not replace into the new folder, as links where the file system has them.

    `old` stays whole. What other runs of this program wrote there stays known as ours: as it is listed, so that a file
    that was changed since stays the user's.

    Parameters
    ----------
    own : entries of the folder that its writer gives. gone : further files of ours, as relative paths.
    seen : files that a call before has looked at; those of this one are added.

    Returns
    -------
    Fingerprints in the old list of the files that were brought, by relative path.
    """
    ledger, carried = recorded_files(old), {}
    for rel in _files(old, empty_folders=True):
        if rel in seen or str(rel) == LEDGER or str(rel) in gone:
            continue
        seen.add(rel)
        source, place = old / rel, new / rel
        if _dropped(old, rel, own, ledger):
            continue
        if os.path.lexists(place):
            if ledger is None or source.is_dir() or is_own(old, rel, ledger) or _are_same(source, place):
                continue
            # a file of the user under a name that is now ours, or one of ours that the user changed
            place = _free_name(place)
        elif ledger is not None and str(rel) in ledger:
            carried[str(rel)] = ledger[str(rel)]
        _bring(source, place)
    return carried


def keep_written(old: Path, new: Path, names: Collection[str]) -> None:
    """Bring files that this program wrote earlier, and nobody changed, into a new folder before its files are listed.

    Parameters
    ----------
    old : may be missing. names : of files in it that are not written anew.
    """
    ledger = recorded_files(old) or {}
    for name in names:
        if is_own(old, Path(name), ledger):
            _bring(old / name, new / name)


def _dropped(old: Path, rel: Path, own: Collection[str], ledger: dict[str, str] | None) -> bool:
    """Whether an older entry is ours and may go."""
    if rel.parts[0] not in own:
        return False
    if (old / rel).is_dir() and not (old / rel).is_symlink():
        return True
    if ledger is None:
        # written before there were lists: entries of the folder itself by name, files deeper down stay
        return len(rel.parts) == 1
    return is_own(old, rel, ledger)


def _bring(source: Path, place: Path) -> None:
    if source.is_dir() and not source.is_symlink():
        place.mkdir(parents=True, exist_ok=True)
        return
    place.parent.mkdir(parents=True, exist_ok=True)
    try:
        os.link(source, place, follow_symlinks=False)
    except OSError:
        shutil.copy2(source, place, follow_symlinks=False)


def _are_same(one: Path, other: Path) -> bool:
    """Whether two files have the same content; links are no files."""
    plain = all(path.is_file() and not path.is_symlink() for path in (one, other))
    return plain and one.stat().st_size == other.stat().st_size and fingerprint(one) == fingerprint(other)


def _free_name(place: Path) -> Path:
    number = 1
    while os.path.lexists(place.with_name(f"{place.stem}.yours{number}{place.suffix}")):
        number += 1
    return place.with_name(f"{place.stem}.yours{number}{place.suffix}")


def _files(folder: Path, empty_folders: bool = False) -> Iterator[Path]:
    """Relative paths of all files and links; links to folders are not followed."""
    for place, folders, files in os.walk(folder):
        # what a killed run has left of a single file is nobody's
        folders[:] = [name for name in folders if not (name.startswith(".") and name.endswith(LEFT_OVER))]
        links = [name for name in folders if os.path.islink(os.path.join(place, name))]
        for name in (*files, *links):
            yield Path(place, name).relative_to(folder)
        if empty_folders and not files and not folders and Path(place) != folder:
            yield Path(place).relative_to(folder)
