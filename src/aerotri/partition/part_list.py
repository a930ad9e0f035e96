"""The parts of a block: their folders, and the list of their names that tells whether one is missing."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from aerotri.conventions import InputError
from aerotri.formats.files.atomic import atomic_file
from aerotri.partition.whole import PARTS

LIST = "parts.json"
AGAIN = "put it back, or make the parts again (divide, convert --parts or simulate --parts)"
MOST_NAMED = 5
"""Of parts, in a message."""


def write_part_list(folder: Path) -> None:
    """Write the names of the parts that are there to parts.json: the last file of a block in parts."""
    names = [part.name for part in part_folders(folder)]
    with atomic_file(folder / LIST) as place:
        place.write_text(json.dumps({"parts": names}, indent=1) + "\n", encoding="utf-8")


def part_folders(folder: Path) -> list[Path]:
    """Folders of the parts of a block, in order; none where it is no block in parts.

    Raises
    ------
    InputError
        For a part that is not there though parts.json names it, that parts.json does not name, or that has no
        block.toml. Folders of parts made by hand need no parts.json.
    """
    there = folder / PARTS
    if not there.is_dir():
        return []
    found = sorted(path for path in there.iterdir() if path.is_dir() and not path.name.startswith("."))
    for part in found:
        if not (part / "block.toml").is_file():
            remedy = "put the file back, or remove the folder if it is no part"
            raise InputError(f"part {part.name} has no block.toml", remedy, folder)
    names, listed = {part.name for part in found}, _listed(folder / LIST)
    if listed is not None:
        missing, more = sorted(set(listed) - names), sorted(names - set(listed))
        if missing:
            raise InputError(f"{len(missing)} of {len(listed)} parts missing: {_named(missing)}", AGAIN, folder)
        if more:
            remedy = f"remove them, or {LIST} if you made the parts yourself"
            raise InputError(f"parts that {LIST} does not list: {_named(more)}", remedy, folder)
    return found


def _listed(path: Path) -> Sequence[str] | None:
    """The names of parts.json; None where there is none."""
    if not path.is_file():
        return None
    try:
        names = json.loads(path.read_text(encoding="utf-8"))["parts"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError("cannot be read as a list of parts", "make the parts again", path) from error
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise InputError("cannot be read as a list of parts", "make the parts again", path)
    return names


def _named(names: Sequence[str]) -> str:
    others = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return ", ".join(names[:MOST_NAMED]) + others
