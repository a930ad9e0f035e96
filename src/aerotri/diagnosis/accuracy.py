"""Accuracy by check points with their survey error: RMSE, layout, errors that stand out.

[L: ASPRS Positional Accuracy Standards for Digital Geospatial Data, edition 2, version 2 (2024)]: section 7.1 (RMSE is
the measure), 7.3 to 7.5 (RMSE_H, RMSE_V as NVA and VVA, RMSE_3D), 7.11 with table 7.4 (the survey error of the check
points is included), 7.2 (an error over three times the target is a blunder).
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from scipy.spatial import ConvexHull, KDTree, QhullError

from aerotri.conventions import SIGMA_PER_MAD
from aerotri.diagnosis.accuracy_rules import axis_targets, requirements, warnings
from aerotri.diagnosis.accuracy_sentences import statements
from aerotri.diagnosis.check_points import sigma_given
from aerotri.results.accuracy import (
    AccuracyRecord,
    Asked,
    CheckedPoints,
    CoordinateErrors,
    Layout,
    SuspectError,
)
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.head import Head

BLUNDER = 3.0
"""Times the target RMSE of a coordinate, from which an error is a blunder [L: ASPRS edition 2, 7.2]."""
MODIFIED_Z, FEWEST = 3.5, 8
"""An error so many robust σ from the median stands out [L: Iglewicz, Hoaglin 1993]; with fewer points nothing is said
of outliers and skew; chosen [C]."""
NEAR = 0.1
"""Share of the diagonal that check points should be apart [L: NSSDA, FGDC-STD-007.3-1998, appendix 3-C]."""
FAR = 10.0
"""Points whose plan σ is so many times the median do not bound the project area; chosen [C]."""


def accuracy_of(adjusted: AdjustedBlock, vegetated: Collection[str], asked: Asked) -> AccuracyRecord:
    """The record of a result.

    Parameters
    ----------
    vegetated : names of check points that stand in vegetation.
    """
    control = adjusted.block.control
    record = AccuracyRecord(
        block=str(adjusted.block.name), crs=str(adjusted.block.crs), verdict=adjusted.outcome.verdict,
        points=checked_points(adjusted, vegetated), asked=asked, errors=(),
        control_sigma=control.sigma[~control.is_check], layout=None,
        head=Head(adjusted.block.project, str(adjusted.block.crs)),
    )  # fmt: skip
    return assessed(record, _ground(adjusted))


def assessed(record: AccuracyRecord, ground: np.ndarray) -> AccuracyRecord:
    """The record with everything that follows from its points.

    Parameters
    ----------
    ground : (n, 2) m, points that bound the project area.
    """
    found = replace(record, errors=coordinate_errors(record.points), layout=layout_of(record.points, ground))
    found = replace(found, suspects=suspect_errors(found.points, found.asked))
    found = replace(found, requirements=requirements(found))
    return replace(found, statements=statements(found), warnings=warnings(found))


def checked_points(adjusted: AdjustedBlock, vegetated: Collection[str]) -> CheckedPoints:
    """The check points of a result that have a difference in any coordinate."""
    check = adjusted.check
    kept = np.isfinite(check.difference).any(axis=1)
    point = check.point[kept]
    names = adjusted.block.points[point].astype(str)
    return CheckedPoints(
        names, adjusted.points.xyz[point, :2], check.difference[kept], sigma_given(adjusted, check)[kept],
        np.isin(names, list(vegetated)),
    )  # fmt: skip


def coordinate_errors(points: CheckedPoints) -> tuple[CoordinateErrors, ...]:
    """X and Y of all check points known in plan, Z outside vegetation, Z within it."""
    plan = np.isfinite(points.difference[:, :2]).all(axis=1)
    rows = (("X", 0, plan, False), ("Y", 1, plan, False), ("Z", 2, ~points.vegetated, False),
            ("Z", 2, points.vegetated, True))  # fmt: skip
    return tuple(
        _errors(axis, wooded, points.difference[own, k], points.sigma[own, k]) for axis, k, own, wooded in rows
    )


def _errors(axis: str, vegetated: bool, d: np.ndarray, sigma: np.ndarray) -> CoordinateErrors:
    known = np.isfinite(d)
    d, sigma = d[known], np.nan_to_num(sigma[known])
    n, unstated = len(d), int((sigma <= 0.0).sum())
    if n == 0:
        return CoordinateErrors(axis, vegetated, 0, 0, *(6 * [float("nan")]))
    skew, skew_sigma = skewness(d)
    fit, survey = (float(np.sqrt(np.mean(values**2))) for values in (d, sigma))
    return CoordinateErrors(
        axis, vegetated, n, unstated, float(d.mean()), fit, survey, float(np.abs(d).max()), skew, skew_sigma
    )


def skewness(values: np.ndarray) -> tuple[float, float]:
    """Skewness G1 of a sample and its σ for a normal one [L: Joanes, Gill 1998]; NaN below `FEWEST` values."""
    n, centred = len(values), values - np.mean(values)
    spread = float(np.mean(centred**2))
    if n < FEWEST or not spread > 0.0:
        return float("nan"), float("nan")
    g1 = float(np.mean(centred**3)) / spread**1.5
    sigma = np.sqrt(6.0 * n * (n - 1) / ((n - 2.0) * (n + 1) * (n + 3)))
    return g1 * float(np.sqrt(n * (n - 1.0))) / (n - 2.0), float(sigma)


def layout_of(points: CheckedPoints, ground: np.ndarray) -> Layout | None:
    """How the check points lie in the smallest rectangle around the ground points."""
    try:
        hull = ConvexHull(ground) if len(ground) >= 3 else None
    except QhullError:
        hull = None
    if hull is None:
        return None
    corners = smallest_rectangle(ground[hull.vertices])
    place = points.place[np.isfinite(points.place).all(axis=1)]
    names = points.names[np.isfinite(points.place).all(axis=1)]
    along, across = corners[1] - corners[0], corners[3] - corners[0]
    u, v = ((place - corners[0]) @ side > 0.5 * side @ side for side in (along, across))
    # the corners go round: first, along, opposite, across
    quadrants = np.bincount(np.where(v, np.where(u, 2, 3), np.where(u, 1, 0)), minlength=4)
    nearest = KDTree(place).query(place, k=2)[0][:, 1] if len(place) > 1 else np.full(len(place), np.inf)
    diagonal = float(np.hypot(*(corners[2] - corners[0])))
    spacing = float(nearest.min()) if len(place) > 1 else float("nan")
    crowded = tuple(str(name) for name in names[nearest < NEAR * diagonal])
    return Layout(float(hull.volume), corners, quadrants, spacing, crowded)


def smallest_rectangle(hull: np.ndarray) -> np.ndarray:
    """(4, 2) corners of the rectangle of the least area around a convex polygon; one of its sides is the polygon's."""
    best, least = np.zeros((4, 2)), np.inf
    for side in np.roll(hull, -1, axis=0) - hull:
        length = np.hypot(*side)
        if length <= 0.0:
            continue
        axes = np.array([side, [-side[1], side[0]]]) / length
        low, high = (hull @ axes.T).min(axis=0), (hull @ axes.T).max(axis=0)
        area = float(np.prod(high - low))
        if area < least:
            box = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
            best, least = box @ axes, area
    return best


def suspect_errors(points: CheckedPoints, asked: Asked) -> tuple[SuspectError, ...]:
    """Blunders by the target, and outliers among the errors themselves; nothing is left out for it."""
    found: list[SuspectError] = []
    for k, (axis, target) in enumerate(zip("XYZ", axis_targets(asked), strict=True)):
        own = np.isfinite(points.difference[:, k]) & ~(points.vegetated & (k == 2))
        d, names = points.difference[own, k], points.names[own]
        limit = np.inf if target is None else BLUNDER * target
        scale = SIGMA_PER_MAD * float(np.median(np.abs(d - np.median(d)))) if len(d) >= FEWEST else 0.0
        for name, value in zip(names, d, strict=True):
            if abs(value) > limit:
                found.append(SuspectError(str(name), axis, float(value), "over three times the target RMSE: a blunder"))
            elif scale > 0.0 and abs(value - np.median(d)) > MODIFIED_Z * scale:
                found.append(SuspectError(str(name), axis, float(value), "stands out from the other check points"))
    return tuple(found)


def _ground(adjusted: AdjustedBlock) -> np.ndarray:
    """(n, 2) m, object points that are known well enough to bound the project area."""
    xy, sigma = adjusted.points.xyz[:, :2], adjusted.points.total_sigma[:, :2].max(axis=1)
    known = np.isfinite(xy).all(axis=1) & np.isfinite(sigma)
    if not known.any():
        return np.zeros((0, 2))
    return xy[known & (sigma <= FAR * np.median(sigma[known]))]
