"""Coded targets of a whole photograph, and the control point that a number names."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aerotri.bench.coded_targets import CodedTarget, find_coded
from aerotri.bench.pictures import Pictures

TILE_PX, COMMON_PX = 1024, 160
"""Side of the pieces that are looked through, and how much they have in common: targets are smaller."""


def targets_of_photograph(pictures: Pictures, image: int) -> list[CodedTarget]:
    """The coded targets of a photograph, each once.

    Raises
    ------
    InputError
        When there is no file of it, or it cannot be read.
    """
    columns, rows = pictures.size(image)
    found: list[CodedTarget] = []
    for top in range(0, max(rows - COMMON_PX, 1), TILE_PX - COMMON_PX):
        for left in range(0, max(columns - COMMON_PX, 1), TILE_PX - COMMON_PX):
            shift = np.array([left, top], dtype=float)
            for one in find_coded(pictures.grey(image, left, top, TILE_PX)):
                moved = replace(one, place=one.place + shift, corners=one.corners + shift)
                found += [] if any(other.covers(moved.place) for other in found) else [moved]
    return found


def point_of_number(names: Sequence[str], number: int | None) -> str:
    """The only name whose digits are the number, such as GCP_017 for 17; '' where none is, or several are."""
    fitting = {name for name in names if number is not None and _digits(name) == number}
    return next(iter(fitting)) if len(fitting) == 1 else ""


def _digits(name: str) -> int | None:
    """The number in a name; None where it has none, or more than one."""
    found = re.findall(r"[0-9]+", name)
    return int(found[0]) if len(found) == 1 and len(found[0]) < 9 else None
