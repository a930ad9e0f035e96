"""What the heights of the control points as a whole differ by from the photographs, as it is found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

CHANCE = 2.5e-4
"""Probability by chance below which a test counts: a quarter of 0.1 % for each of the four."""
BOWL, NAMES, SPLIT = "bowl", "names", "split"
"""Patterns: heights that bend from the middle outwards, points of one beginning of the name, any two groups."""


@dataclass(frozen=True, eq=False)
class HeightPattern:
    """An error of given heights of one shape that the photographs contradict.

    Parameters
    ----------
    kind : BOWL, NAMES or SPLIT. points : (k,) the points of the block that it is about: those higher, all for a bowl.
    size, sigma : m, given − what the others and the photographs tell; of a bowl from the middle to the outermost point.
    p : probability of as much by chance, with all patterns of the kind that were tried.
    warp : m, RMS of what it leaves of the heights of all points beside a plane.
    reach : m, from the middle to the outermost point. label : the beginning of the names, '' otherwise.
    """

    kind: str
    points: np.ndarray
    size: float
    sigma: float
    p: float
    warp: float
    reach: float
    label: str = ""


@dataclass(frozen=True, eq=False)
class ControlHeights:
    """The test of all heights of control together.

    Parameters
    ----------
    count : of the heights. freedom : combinations that the photographs determine as well.
    ratio : of their misfit to what σ let expect, RMS. p : by chance.
    sigma : m, median of the stated. patterns : those that were tried, the least likely by chance first.
    """

    count: int
    freedom: int
    ratio: float
    p: float
    sigma: float
    patterns: tuple[HeightPattern, ...]
