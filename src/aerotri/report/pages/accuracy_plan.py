"""A plan of the check points for a page: the quarters of the project area, points in shapes that need no colour."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.report.quality import printable
from aerotri.results.accuracy import CheckedPoints, Layout

SIZE, MARGIN = 1000.0, 0.06
"""Width of the drawing in its own units, and the margin as a share of it."""


@dataclass(frozen=True)
class PlanSpot:
    """A check point on the drawing: where, its name, and 'check' or 'vegetated'."""

    x: float
    y: float
    name: str
    kind: str


@dataclass(frozen=True)
class CheckPlan:
    """Drawing units, y down, north up.

    Parameters
    ----------
    height : of the drawing, whose width is `SIZE`. outline, cross : paths of the area and of its quarters.
    numbers : (x, y, number) of the quarters. spots : the check points. bar : length of the scale bar; bar_text : of it.
    """

    height: float
    outline: str
    cross: str
    numbers: tuple[tuple[float, float, int], ...]
    spots: tuple[PlanSpot, ...]
    bar: float
    bar_text: str

    @property
    def width(self) -> float:
        return SIZE


def check_plan(points: CheckedPoints, layout: Layout) -> CheckPlan:
    """The drawing of check points in their project area."""
    known = np.isfinite(points.place).all(axis=1)
    all_of = np.vstack([layout.corners, points.place[known]])
    low, high = all_of.min(axis=0), all_of.max(axis=0)
    margin = MARGIN * float(np.max(high - low))
    low, high = low - margin, high + margin
    scale = SIZE / float(high[0] - low[0])

    def drawn(xy: np.ndarray) -> np.ndarray:
        return np.column_stack([xy[:, 0] - low[0], high[1] - xy[:, 1]]) * scale

    corners = drawn(layout.corners)
    middle, halves = corners.mean(axis=0), (corners + np.roll(corners, -1, axis=0)) / 2.0
    labels = 0.86 * corners + 0.14 * middle
    spots = [
        PlanSpot(round(float(x), 1), round(float(y), 1), printable(name), "vegetated" if wooded else "check")
        for (x, y), name, wooded in zip(drawn(points.place[known]), points.names[known], points.vegetated[known],
                                        strict=True)
    ]  # fmt: skip
    length = _round_length(0.25 * SIZE / scale)
    text = f"{length / 1000.0:g} km" if length >= 1000.0 else f"{length:g} m"
    return CheckPlan(
        float(high[1] - low[1]) * scale, _path(corners) + "Z", _path(halves[[0, 2]]) + _path(halves[[1, 3]]),
        tuple((float(x), float(y), k) for k, (x, y) in enumerate(labels, 1)), tuple(spots), length * scale, text,
    )  # fmt: skip


def _path(places: np.ndarray) -> str:
    return "M" + " ".join(f"{x:.1f},{y:.1f}" for x, y in places)


def _round_length(most: float) -> float:
    """1, 2 or 5 times a power of ten, at most as given."""
    power = 10.0 ** np.floor(np.log10(most))
    return float(max(step for step in (1.0, 2.0, 5.0) if step * power <= most) * power)
