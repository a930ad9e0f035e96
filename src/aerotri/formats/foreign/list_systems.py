"""The coordinate system that comments of a list name, whatever the list holds: used, refused, or named as not used."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from aerotri.conventions import InputError
from aerotri.coordinates.georeference import is_projected
from aerotri.coordinates.stated_systems import REMEDY, StatedSystem, stated_system
from aerotri.crs_text import plan_of
from aerotri.formats.text.notes import left_behind, taken
from aerotri.formats.text.text_lines import TextFile

HEIGHTS_REMEDY = "name the system of the heights too (EPSG:2263+6360), add +vunits=m, or write Z (m) above their column"
OF_SYSTEM = re.compile(
    r"#\s*(?:(?:coordinate|reference|horizontal|koordinaten)\s*(?:reference\s*)?system|(?:horizontal\s*)?crs|srs|projection)"
    r"(?:\s*\([^)]*\))?(?:\s*[:=]\s*(.+)|[\s,]+(.+))|#\s*(EPSG[:,].+)",
    re.IGNORECASE,
)
"""A comment that states a system: behind a colon whatever follows, else what is known as one: prose begins alike."""
ABOUT_SYSTEM = re.compile(r"epsg|\b[cs]rs\b|system|projection|datum|units?\b|feet|height", re.IGNORECASE)
"""Comments that may be about the system of the coordinates: where they are not understood, they are named."""
OF_TOTALS = re.compile(r"#?\s*\"?total\s+error", re.IGNORECASE)


def system_above(path: Path) -> tuple[StatedSystem, tuple[str, ...]]:
    """The coordinate system that comments of a list without names state, and what to say of it.

    Raises
    ------
    InputError
    """
    file = TextFile(path, comments=False, any_letters=True)
    stated, notes = systems_of_comments(file, None)
    system = one_system(file, stated) or StatedSystem("")
    return system, (*in_words(system, path), *notes)


def in_words(system: StatedSystem, path: Path) -> tuple[str, ...]:
    """What to say of how the system of a list was understood; nothing where that is plain."""
    return (taken(f"{path.name}: {system.note}"),) if system.note else ()


def systems_of_comments(file: TextFile, header_line: int | None) -> tuple[list[tuple[int, str]], tuple[str, ...]]:
    """Rows and texts of comments that name a system, and sentences on those that may and are not understood."""
    stated, notes = [], []
    for row, line in enumerate(file.lines):
        if not line.startswith("#") or row == header_line or OF_TOTALS.match(line):
            continue
        found = OF_SYSTEM.match(line)
        if found is not None and (found[2] is None or _is_system(found[2])):
            stated.append((row, found[1] or found[2] or found[3].replace(",", ":")))
        elif ABOUT_SYSTEM.search(line):
            notes.append(left_behind(f"{file.path.name}:{file.numbers[row]}: '{line[:60]}' is not used"))
    return stated, tuple(notes)


def _is_system(text: str) -> bool:
    """Whether a text names a system, be it one that cannot be used."""
    try:
        return stated_system(text) is not None
    except InputError:
        return True


def one_system(file: TextFile, stated: Sequence[tuple[int, str]]) -> StatedSystem | None:
    """The one system that all texts mean; None where there are none.

    Raises
    ------
    InputError
        When one is not known, or two are not the same.
    """
    found: StatedSystem | None = None
    for row, text in stated:
        try:
            system = stated_system(text)
        except InputError as error:
            raise file.error(row, error.message, error.remedy) from error
        if system is None:
            raise file.error(row, f"the coordinate system '{text[:80]}' is not known", REMEDY)
        if found is not None and (found.crs, found.plan_to_metre) != (system.crs, system.plan_to_metre):
            raise file.error(
                row, f"names several coordinate systems: '{text[:60]}' is another one", "leave one of them"
            )
        found = system
    return found


def refuse_unknown_heights(file: TextFile, system: StatedSystem, heights: np.ndarray) -> None:
    """Refuse heights (n,) whose unit nothing states, beside X and Y in feet.

    Raises
    ------
    InputError
    """
    if np.isnan(system.height_to_metre) and np.isfinite(heights).any():
        message = "X and Y count in feet, and nothing says what the heights count in"
        raise file.error(0, message, HEIGHTS_REMEDY)


def axes_of(crs: str) -> str:
    """The usual order in lists without names: east before north, but latitude before longitude."""
    return "xy" if crs in ("", "local") or is_projected(plan_of(crs)) else "yx"


def order_of_axes(exchanged: bool) -> list[int]:
    """Columns of X, Y, Z in coordinates whose first two may have changed places."""
    return [1, 0, 2] if exchanged else [0, 1, 2]


def exchange_in_words(exchanged: bool, path: Path, columns: Sequence[str] = ("X", "Y")) -> tuple[str, ...]:
    """What to say where coordinates change places in a list that has an order of its own."""
    return (taken(f"{path.name}: {' and '.join(columns)} change places, as --axes yx states"),) if exchanged else ()
