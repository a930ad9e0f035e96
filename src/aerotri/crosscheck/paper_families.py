"""The families of additional parameters that the cross-check's own model has formulas for.

A family that is missing here, and a parameter that its `knows` does not know, is named in the verdict as not checked.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from aerotri.crosscheck import paper_patterns, paper_polynomials
from aerotri.crosscheck.paper_dmc import ITEMS as DMC_ITEMS
from aerotri.crosscheck.paper_dmc import Composed, dmc
from aerotri.observations import Camera

DEFAULT_AXIS = "+y"
"""Image axis along the flight where the camera does not state it."""


@dataclass(frozen=True)
class PaperFamily:
    """A family whose image error is linear in its parameters.

    Parameters
    ----------
    patterns : of a camera at (m,) x and y in mm, for some items: (m, 2, q) mm per unit.
    knows : whether there is a formula for an item. camera_model : that it belongs to, None for any.
    """

    patterns: Callable[[Camera, np.ndarray, np.ndarray, tuple[str, ...]], np.ndarray]
    knows: Callable[[str], bool]
    camera_model: str | None = None

    def fits(self, camera: Camera) -> bool:
        return self.camera_model in (None, camera.model)


def _bluh(camera: Camera, x: np.ndarray, y: np.ndarray, items: tuple[str, ...]) -> np.ndarray:
    every = paper_patterns.bluh(x, y, camera.r_max_mm)
    return every[:, :, [paper_patterns.BLUH_ITEMS.index(item) for item in items]]


def _ultracam_d(camera: Camera, x: np.ndarray, y: np.ndarray, items: tuple[str, ...]) -> np.ndarray:
    half = camera.half_format_mm
    every = paper_patterns.ultracam_d(x, y, (2.0 * half[0], 2.0 * half[1]), camera.flight_axis or DEFAULT_AXIS)
    return every[:, :, [paper_patterns.ULTRACAM_ITEMS.index(item) for item in items]]


def _dmc(camera: Camera, x: np.ndarray, y: np.ndarray, items: tuple[str, ...]) -> np.ndarray:
    axis, half = camera.flight_axis or DEFAULT_AXIS, camera.half_format_mm
    across, along = half if axis[1] == "y" else half[::-1]
    return dmc(x, y, axis, items, Composed(camera.focal_length_mm, across, along))


def _over_format(name: str, camera: Camera, x: np.ndarray, y: np.ndarray, items: tuple[str, ...]) -> np.ndarray:
    patterns = np.zeros((len(x), 2, len(items)))
    for column, item in enumerate(items):
        patterns[:, 0, column], patterns[:, 1, column] = paper_polynomials.FORMULAS[name](
            item, x, y, camera.half_format_mm
        )
    return patterns


LINEAR: dict[str, PaperFamily] = {
    "bluh": PaperFamily(_bluh, paper_patterns.BLUH_ITEMS.__contains__),
    "ultracam_d": PaperFamily(_ultracam_d, paper_patterns.ULTRACAM_ITEMS.__contains__, "ultracam_d"),
    "dmc": PaperFamily(_dmc, DMC_ITEMS.__contains__, "dmc"),
    **{
        name: PaperFamily(partial(_over_format, name), partial(paper_polynomials.knows, name))
        for name in paper_polynomials.FORMULAS
    },
}
"""By name."""
IN_THE_RAY = ("brown", "lens")
"""Families that count from the principal point or act on the ideal direction: `paper_rays` has their formulas."""


def unknown_parameters(chosen: tuple[tuple[str, tuple[str, ...]], ...]) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """What of a choice of parameters, (family, items) pairs, has no formula here."""
    unknown = []
    for family, items in chosen:
        if family in IN_THE_RAY:
            continue
        own = LINEAR.get(family)
        missing = tuple(item for item in items if own is None or not own.knows(item))
        if missing:
            unknown.append((family, missing))
    return tuple(unknown)
