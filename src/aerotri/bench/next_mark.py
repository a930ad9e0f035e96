"""Which mark next: the measurement that lowers the σ of the points most, computed before anybody measures it.

With Q of the unknowns a new ray l = A·(orientation) + B·(point) changes it by Q·aᵀ·(a·Q·aᵀ + σ²)⁻¹·a·Q. A control point
that is not measured yet brings its given coordinates with it: its Q is that of its σ. Shared parameters are held: what
a single ray tells of them is little.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from aerotri.bench.prediction import Prediction
from aerotri.deformation.model_grid import places_of
from aerotri.deformation.orientation import calibrated_orientation
from aerotri.functional_model.collinearity import INTERIOR_COLUMNS, linearise
from aerotri.functional_model.rotation import small_rotation_per_angle
from aerotri.results.adjustment import Adjustment
from aerotri.statistics.joint_covariance import IMAGE, POINT, Chosen, joint_cofactors

MOST_BYTES = 300_000_000
"""Of the solutions for all columns; chosen [C]: what a laptop spares."""
MOST_SAMPLE, MOST_WEAK, PHOTOGRAPHS_OF_POINT = 30, 8, 4
"""Points that stand for all, weakest points that one more ray may help, and photographs tried of each [C]."""
EDGE = 0.02
"""Share of the format at its edge that is not looked at: targets are cut there."""


@dataclass(frozen=True)
class NextMark:
    """A measurement that could be made.

    Parameters
    ----------
    image, point : rows of the block. place : expected column and row, px. is_control : whether it is a control point.
    before, after : m, root mean square σ of a coordinate of all points without and with it.
    """

    image: int
    point: int
    place: tuple[float, float]
    is_control: bool
    before: float
    after: float


def next_marks(adjustment: Adjustment, prediction: Prediction) -> list[NextMark]:
    """Measurements that are not made yet, the one that lowers σ most first; control and weakest points are tried.

    Parameters
    ----------
    prediction : of the same adjustment.
    """
    tried = list(_candidates(adjustment, prediction))
    if not tried:
        return []
    return sorted(_judged(adjustment, tried), key=lambda one: one.after)


def _candidates(adjustment: Adjustment, prediction: Prediction) -> Iterator[tuple[int, int, np.ndarray, bool]]:
    """Photograph, point, place (2,) px and whether it is control, of what is expected and not measured."""
    block, points = adjustment.result.block, adjustment.result.points
    rays = block.image_points
    measured = set(zip(rays.image.tolist(), rays.point.tolist(), strict=True))
    used = ~block.control.is_check & np.isfinite(block.control.xyz).all(axis=1)
    control = {int(p): xyz for p, xyz in zip(block.control.point[used], block.control.xyz[used], strict=True)}
    variance = np.trace(points.covariance, axis1=1, axis2=2)
    variance[block.control.point] = np.nan
    weakest = np.argsort(-np.nan_to_num(variance, nan=-1.0))[:MOST_WEAK]
    chosen = {int(p): points.xyz[p] for p in weakest.tolist() if np.isfinite(variance[p])}
    for point, xyz in (control | chosen).items():
        here = points.xyz[point] if np.isfinite(points.xyz[point]).all() else xyz
        shown = [k for k in prediction.images_of(here).tolist() if (k, point) not in measured]
        for image, place in _central(prediction, shown, here):
            yield image, point, place, point in control


def _central(prediction: Prediction, images: list[int], xyz: np.ndarray) -> list[tuple[int, np.ndarray]]:
    """The photographs that show a point nearest to their middle, with the place; not at their very edge."""
    found: list[tuple[float, int, np.ndarray]] = []
    for image in images:
        size = np.array(prediction.block.cameras[prediction.block.images.camera[image]].size_px, dtype=float)
        place = prediction.pixels(image, xyz[None])[0]
        off = np.abs(place / size - 0.5).max()
        if off <= 0.5 - EDGE:
            found.append((float(off), image, place))
    return [(image, place) for _, image, place in sorted(found, key=lambda one: one[:2])[:PHOTOGRAPHS_OF_POINT]]


def _judged(adjustment: Adjustment, tried: list[tuple[int, int, np.ndarray, bool]]) -> Iterator[NextMark]:
    """Every candidate with what it would do."""
    u = adjustment.system.unknowns
    row_of_image = {int(image): k for k, image in enumerate(u.images)}
    row_of_point = {int(point): k for k, point in enumerate(u.points)}
    most = int(np.clip(MOST_BYTES / (24.0 * len(u.points)), 90, 420))
    sample = u.points[np.unique(np.linspace(0, len(u.points) - 1, min(MOST_SAMPLE, most // 6)).astype(int))].tolist()
    places, points, images = 3 * len(sample), list(sample), list[int]()
    kept: list[tuple[int, int, np.ndarray, bool]] = []
    for one in tried:
        if one[0] not in row_of_image:
            continue
        new = 6 * (one[0] not in images) + 3 * (one[1] in row_of_point and one[1] not in points)
        if places + new > most:
            continue
        places += new
        images += [] if one[0] in images else [one[0]]
        points += [] if one[1] in points or one[1] not in row_of_point else [one[1]]
        kept.append(one)
    chosen = [Chosen(POINT, row_of_point[p], p, "", (0, 1, 2)) for p in points]
    chosen += [Chosen(IMAGE, row_of_image[k], k, "", tuple(range(6))) for k in images]
    factor = adjustment.system.factorise(adjustment.solution.equations)
    q, _ = joint_cofactors(adjustment.system, adjustment.solution.state, factor, adjustment.solution.estimator, chosen)
    first_point = {p: 3 * k for k, p in enumerate(points)}
    first_image = {k: 3 * len(points) + 6 * n for n, k in enumerate(images)}
    sigma0, whole = adjustment.result.outcome.sigma0, _mean_variance(adjustment)
    count = len(u.points)
    for image, point, place, is_control in kept:
        gain = _gain(adjustment, q, image, point, first_image[image], first_point.get(point, -1), 3 * len(sample))
        own = 0.0 if point in sample else gain[1]
        less = sigma0**2 * (gain[0] * count / len(sample) + own) / (3.0 * count)
        after = float(np.sqrt(max(whole - less, 0.0)))
        at = (float(place[0]), float(place[1]))
        yield NextMark(image, point, at, is_control, float(np.sqrt(whole)), after)


def _mean_variance(adjustment: Adjustment) -> float:
    """m², of a coordinate of the points that were adjusted."""
    variance = np.trace(adjustment.local.points.covariance, axis1=1, axis2=2)
    return float(np.nanmean(variance)) / 3.0


def _gain(
    adjustment: Adjustment, q: np.ndarray, image: int, point: int, at_image: int, at_point: int, sample: int
) -> tuple[float, float]:
    """By how much a ray lowers the sum of the cofactors of the sample, and of its own point."""
    a, b = _partials(adjustment, image, point)
    block = adjustment.local.block
    noise = np.diag(np.full(2, np.median(block.image_points.sigma)) ** 2)
    of_image = q[:, at_image : at_image + 6] @ a.T
    if at_point >= 0:
        to_all = of_image + q[:, at_point : at_point + 3] @ b.T
        own = a @ to_all[at_image : at_image + 6] + b @ to_all[at_point : at_point + 3]
    else:
        control = int(np.flatnonzero(block.control.point == point)[0])
        to_all = of_image
        own = a @ to_all[at_image : at_image + 6] + b @ np.diag(block.control.sigma[control] ** 2) @ b.T
    change = np.einsum("ij,jk,ik->i", to_all, np.linalg.inv(own + noise), to_all)
    return float(change[:sample].sum()), float(change[at_point : at_point + 3].sum()) if at_point >= 0 else 0.0


def _partials(adjustment: Adjustment, image: int, point: int) -> tuple[np.ndarray, np.ndarray]:
    """(2, 6) by X0, Y0, Z0, ω, φ, κ and (2, 3) by X, Y, Z of a ray, mm, in the frame of the adjustment."""
    local, orientation = adjustment.local, calibrated_orientation(adjustment).take([image])
    xyz = local.points.xyz[point]
    if not np.isfinite(xyz).all():
        given = adjustment.result.block.control
        xyz = places_of(adjustment).to_local(given.xyz[given.point == point])[0]
    interior = np.zeros((1, len(INTERIOR_COLUMNS)))
    interior[:, :3] = orientation.interior
    zero = np.zeros(1, dtype=np.int64)
    rays = linearise(orientation.rotation, orientation.centre, xyz[None], interior, zero, zero, zero, np.zeros((1, 2)))
    per_angle = small_rotation_per_angle(local.images.angles[[image]], local.block.rotation)[0]
    by_angles = rays.by_orientation[0][:, 3:] @ per_angle
    return np.column_stack([rays.by_orientation[0][:, :3], by_angles]), rays.by_point[0]
