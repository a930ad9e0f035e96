"""Which mark next: the measurement that lowers the σ of the points most, computed before anybody measures it.

With Q of the unknowns a new ray l = A·(orientation) + B·(point) + C·(interior and additional parameters) changes it by
Q·aᵀ·(a·Q·aᵀ + σ²)⁻¹·a·Q, a = (A, B, C). A control point that is not measured yet brings its given coordinates with it:
its Q is that of its σ.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from aerotri.bench.prediction import Prediction
from aerotri.deformation.error_parameters import shared_columns
from aerotri.deformation.model_grid import places_of
from aerotri.deformation.orientation import calibrated_orientation
from aerotri.functional_model.collinearity import INTERIOR_COLUMNS, linearise
from aerotri.functional_model.rotation import small_rotation_per_angle
from aerotri.observations.block import INTERIOR_ELEMENTS
from aerotri.results.adjustment import Adjustment
from aerotri.statistics.joint_covariance import IMAGE, POINT, SHARED, Chosen, joint_cofactors

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
    return sorted(_judged(adjustment, prediction, tried), key=lambda one: one.after)


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


def _judged(
    adjustment: Adjustment, prediction: Prediction, tried: list[tuple[int, int, np.ndarray, bool]]
) -> Iterator[NextMark]:
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
    shared = [*_interior_columns(adjustment), *shared_columns(adjustment).tolist()]
    chosen = [Chosen(POINT, row_of_point[p], p, "", (0, 1, 2)) for p in points]
    chosen += [Chosen(IMAGE, row_of_image[k], k, "", tuple(range(6))) for k in images]
    chosen += [Chosen(SHARED, k, k, "", (0,)) for k in shared]
    factor = adjustment.system.factorise(adjustment.solution.equations)
    q, _ = joint_cofactors(adjustment.system, adjustment.solution.state, factor, adjustment.solution.estimator, chosen)
    at = _Places(
        {p: 3 * k for k, p in enumerate(points)}, {k: 3 * len(points) + 6 * n for n, k in enumerate(images)},
        3 * len(points) + 6 * len(images),
    )  # fmt: skip
    sigma0, whole, count = adjustment.result.outcome.sigma0, _mean_variance(adjustment), len(u.points)
    for image, point, place, is_control in kept:
        of_all, of_own = _gain(adjustment, prediction, q, at, image, point, place)
        gain = of_all[: 3 * len(sample)].sum() * count / len(sample) + (0.0 if point in sample else of_own)
        after = float(np.sqrt(max(whole - sigma0**2 * gain / (3.0 * count), 0.0)))
        yield NextMark(image, point, (float(place[0]), float(place[1])), is_control, float(np.sqrt(whole)), after)


@dataclass(frozen=True)
class _Places:
    """Where points and photographs begin in Q, and the shared parameters behind them."""

    points: dict[int, int]
    images: dict[int, int]
    shared: int


def _interior_columns(adjustment: Adjustment) -> list[int]:
    """The unknown interior elements among the shared unknowns."""
    names = adjustment.system.unknowns.shared.names
    return [k for k, name in enumerate(names) if name in INTERIOR_ELEMENTS]


def _mean_variance(adjustment: Adjustment) -> float:
    """m², of a coordinate of the points that were adjusted."""
    variance = np.trace(adjustment.local.points.covariance, axis1=1, axis2=2)
    return float(np.nanmean(variance)) / 3.0


def _gain(
    adjustment: Adjustment, prediction: Prediction, q: np.ndarray, at: _Places, image: int, point: int,
    place: np.ndarray,
) -> tuple[np.ndarray, float]:  # fmt: skip
    """By how much a ray lowers the cofactor of every unknown of Q, and the sum of those of its own point."""
    block = adjustment.local.block
    by_image, by_point, by_shared = _partials(adjustment, prediction, image, point, place)
    a = np.zeros((2, len(q)))
    a[:, at.images[image] : at.images[image] + 6] = by_image
    a[:, at.shared :] = by_shared
    noise = np.diag(np.full(2, np.median(block.image_points.sigma)) ** 2)
    own = at.points.get(point)
    if own is None:
        control = int(np.flatnonzero(block.control.point == point)[0])
        noise = noise + by_point @ np.diag(block.control.sigma[control] ** 2) @ by_point.T
    else:
        a[:, own : own + 3] = by_point
    to_all = q @ a.T
    change = np.einsum("ij,jk,ik->i", to_all, np.linalg.inv(a @ to_all + noise), to_all)
    return change, 0.0 if own is None else float(change[own : own + 3].sum())


def _partials(
    adjustment: Adjustment, prediction: Prediction, image: int, point: int, place: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Partials of a ray, mm, in the frame of the adjustment.

    Returns
    -------
    (2, 6) by X0, Y0, Z0, ω, φ, κ, (2, 3) by X, Y, Z, (2, s) by interior elements and additional parameters.
    """
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
    shared, camera = adjustment.system.unknowns.shared, local.block.cameras[local.block.images.camera[image]]
    by_interior = np.zeros((2, len(_interior_columns(adjustment))))
    for n, k in enumerate(_interior_columns(adjustment)):
        if shared.groups[k] == camera.name:
            by_interior[:, n] = rays.by_interior[0][:, INTERIOR_ELEMENTS.index(shared.names[k])]
    by_shared = np.column_stack([by_interior, prediction.by_additional(image, place)])
    return np.column_stack([rays.by_orientation[0][:, :3], by_angles]), rays.by_point[0], by_shared
