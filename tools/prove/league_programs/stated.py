"""σ of photographs, object points and interior orientation, as one program states them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

ELEMENTS = ("X0", "Y0", "Z0", "omega", "phi", "kappa")
"""Of a photograph; m and degrees."""
AXES = ("X", "Y", "Z")
INTERIOR = ("c", "x0", "y0")
"""mm."""


def bare(name: str) -> str:
    """The name of a photograph without the ending of its file."""
    return re.sub(r"\.(jpe?g|tiff?)$", "", name, flags=re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class Held:
    """Points that took no part, k of them.

    Parameters
    ----------
    difference : (k, 3) m, adjusted − given. sigma : (k, 3) m of the adjusted coordinates, as stated.
    given : (k, 3) m, σ of the given coordinates.
    """

    difference: np.ndarray
    sigma: np.ndarray
    given: np.ndarray


@dataclass(frozen=True, eq=False)
class Stated:
    """What a program states.

    Parameters
    ----------
    program : heading of its column.
    photographs : (6,) m and degrees, by name. points : (3,) m, by name. interior : (3,) mm, by camera.
    control : (3,) m, by name, of a program that states σ of given points alone.
    nameless : (k, 6) X, Y, Z and their σ of points without names, m; None where points have names.
    held : points that took no part; None where there are none.
    errors : (k,) errors over stated σ by quantity, of blocks whose truth is known.
    """

    program: str
    photographs: Mapping[str, np.ndarray] = field(default_factory=dict)
    points: Mapping[str, np.ndarray] = field(default_factory=dict)
    interior: Mapping[str, np.ndarray] = field(default_factory=dict)
    control: Mapping[str, np.ndarray] = field(default_factory=dict)
    nameless: np.ndarray | None = None
    held: Held | None = None
    errors: Mapping[str, np.ndarray] = field(default_factory=dict)
