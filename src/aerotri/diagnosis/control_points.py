"""What looks wrong in the list of control and check points itself: sentences, each with what to look at."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from aerotri.adjustment.prepare import with_edits
from aerotri.conventions import counted
from aerotri.diagnosis.control_marks import contradictions_in_words, listed, marks_of
from aerotri.observations import Block

SAME_PIXEL = 2.0
"""Distance of two marks, px, within which they mark the same detail [C]: a mark is set to a pixel or two by hand."""
SAME_PLAN_M = 1e-3
"""Difference of X and Y up to which they are typed from the same place [C]: lists have millimetres."""
FEWEST_OF_ZERO = 2
"""Points whose heights are all 0 from which that is asked about: one may be the origin of a local system."""
MOST_SHOWN = 5
"""Pairs of points that are named [C]: more is a system, not a slip."""


def doubts_with_orientation(block: Block, centre: np.ndarray, rotation: np.ndarray) -> tuple[str, ...]:
    """As `doubts_of_control`, with those about marks that do not meet.

    Parameters
    ----------
    block : as it is given, not in a local frame: heights of 0 are 0 there. centre : (n, 3) m; rotation : (n, 3, 3)
        camera → object, in a frame with three like axes; NaN for photographs without.
    """
    found = marks_of(block, centre, rotation).contradictions
    return (*contradictions_in_words(block, found), *doubts_of_control(block))


def doubts_of_control(block: Block) -> tuple[str, ...]:
    """Sentences about control points, from coordinates and marks alone."""
    block, off = with_edits(block)
    return (*_at_one_pixel(block, off), *_typed_twice(block), *_zero_heights(block))


def _at_one_pixel(block: Block, off: np.ndarray) -> list[str]:
    """Two points marked at one place of a photograph, though they lie apart."""
    rays, control = block.image_points, block.control
    row = np.full(len(block.points), -1)
    row[control.point] = np.arange(len(control))
    marks = np.flatnonzero(~off & (row[rays.point] >= 0))
    pixel = np.array([camera.pixel_mm for camera in block.cameras])[block.images.camera[rays.image[marks]]]
    place = rays.xy[marks] / pixel[:, None]
    said: dict[tuple[int, int], str] = {}
    for a, b in _near(place, rays.image[marks]):
        one, other = (int(row[rays.point[marks[k]]]) for k in (a, b))
        away = float(np.linalg.norm(np.nan_to_num(control.xyz[one] - control.xyz[other])))
        if one == other or away <= SAME_PLAN_M:
            continue
        apart = float(np.linalg.norm(place[a] - place[b]))
        names, image = listed(block.points[control.point[[one, other]]]), block.images.names[rays.image[marks[a]]]
        said[one, other] = (
            f"control points {names} are marked at one place of {image} ({apart:.2g} px "
            f"apart), but lie {away:.3g} m apart: one of the two marks belongs to another point"
        )
    return list(said.values())[:MOST_SHOWN]


def _near(place: np.ndarray, image: np.ndarray) -> list[tuple[int, int]]:
    """Pairs of places (k, 2) px within `SAME_PIXEL` in one photograph, by photograph; `image` (k,) of each."""
    from scipy.spatial import KDTree

    if len(place) < 2:
        return []
    # photographs as layers, farther apart than places may be: one search for all of them
    found = KDTree(np.column_stack([place, 2.0 * SAME_PIXEL * image])).query_pairs(SAME_PIXEL)
    return sorted(found, key=lambda pair: (image[pair[0]], pair))


def _typed_twice(block: Block) -> list[str]:
    """Points with one X and Y and different heights."""
    control = block.control
    known = np.flatnonzero(np.isfinite(control.xyz).all(axis=1))
    order = known[np.lexsort(control.xyz[known].T)]
    pairs = [
        (a, b) for a, b in pairwise(sorted(order.tolist(), key=lambda k: tuple(control.xyz[k])))
        if np.abs(control.xyz[a, :2] - control.xyz[b, :2]).max() <= SAME_PLAN_M
        and abs(control.xyz[a, 2] - control.xyz[b, 2]) > SAME_PLAN_M
    ]  # fmt: skip
    return [
        f"control points {listed(block.points[control.point[[a, b]]])} have the same X and Y and heights "
        f"{abs(control.xyz[a, 2] - control.xyz[b, 2]):.3g} m apart: is one point there twice?"
        for a, b in pairs[:MOST_SHOWN]
    ]


def _zero_heights(block: Block) -> list[str]:
    heights = block.control.xyz[:, 2]
    heights = heights[np.isfinite(heights)]
    if len(heights) < FEWEST_OF_ZERO or (heights != 0.0).any():
        return []
    return [
        f"the heights of all {counted(len(heights), 'control point')} are 0: were they surveyed? If not, leave Z "
        "empty, or give its σ as large as the ground is rough"
    ]
