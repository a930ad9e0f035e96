"""What errors of the orientation angles do to intersected points and to a volume (paper 000), by two intersections.

Rigorous: least squares on the collinearity equations of all rays. Explicit: equations 1–6 of the paper, with
(Nx, Ny, Nz) = R·(x̄, ȳ, −f). **The explicit form intersects only the plan projections of the rays and is singular on
the base line** [D]: its errors grow without bound towards it. It is offered to compare with, never to measure with.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri.functional_model.collinearity import INTERIOR_COLUMNS, linearise, predict
from aerotri.functional_model.rotation import rotation_from_angles, small_rotation_per_angle

ORDER = "omega-phi-kappa"
SECOND = np.pi / 648000.0
"""rad in a second of arc."""


@dataclass(frozen=True, eq=False)
class Pair:
    """Two photographs.

    Parameters
    ----------
    centre : (2, 3) m. angles : (2, 3) rad, ω, φ, κ. focal_length : mm.
    """

    centre: np.ndarray
    angles: np.ndarray
    focal_length: float

    @property
    def rotation(self) -> np.ndarray:
        """(2, 3, 3) camera → object."""
        return rotation_from_angles(self.angles, ORDER)

    def turned(self, change: np.ndarray) -> Pair:
        """With (2, 3) rad added to the angles."""
        return replace(self, angles=self.angles + change)

    def project(self, points: np.ndarray) -> np.ndarray:
        """(2, n, 2) mm from the principal point."""
        return predict(*self.rays(points), np.zeros((2 * len(points), 2))).reshape(2, -1, 2)

    def rays(self, points: np.ndarray):
        n = len(points)
        interior = np.zeros((2, len(INTERIOR_COLUMNS)))
        interior[:, 0] = self.focal_length
        image, point = np.repeat(np.arange(2), n), np.tile(np.arange(n), 2)
        return self.rotation, np.ascontiguousarray(self.centre), points, interior, image, point, image


@dataclass(frozen=True, eq=False)
class Intersected:
    """Points (n, 3) m, and the condition number of every intersection (n,)."""

    xyz: np.ndarray
    condition: np.ndarray


def rigorous(pair: Pair, xy: np.ndarray, start: np.ndarray) -> Intersected:
    """Intersection by least squares.

    Parameters
    ----------
    xy : (2, n, 2) mm. start : (n, 3) m.
    """
    points = np.array(start, dtype=float)
    for _ in range(8):
        a, prediction = _by_point(pair, points)
        gap = np.concatenate([xy[0], xy[1]], axis=1) - prediction
        normal = np.swapaxes(a, 1, 2) @ a
        points = points + np.linalg.solve(normal, np.einsum("nki,nk->ni", a, gap)[..., None])[..., 0]
    return Intersected(points, np.linalg.cond(_by_point(pair, points)[0]))


def explicit(pair: Pair, xy: np.ndarray) -> Intersected:
    """Intersection by equations 4–6 of the paper: plan from the two ratios Nx/Ny, height from the first photograph."""
    n = np.einsum("pij,pnj->pni", pair.rotation, _directions(pair, xy))
    ratio = n[..., 0] / n[..., 1]
    (x1, y1, z1), (x2, y2, _) = pair.centre
    below = ratio[0] - ratio[1]
    y = (ratio[0] * y1 - ratio[1] * y2 + (x2 - x1)) / below
    x = (ratio[0] * x2 - ratio[1] * x1 + ratio[0] * ratio[1] * (y1 - y2)) / below
    z = (x - x1) * n[0, :, 2] / n[0, :, 0] + z1
    system = np.stack([np.stack([np.ones_like(r), -r], axis=-1) for r in ratio], axis=1)
    return Intersected(np.column_stack([x, y, z]), np.linalg.cond(system))


def rigorous_partials(pair: Pair, points: np.ndarray) -> np.ndarray:
    """(n, 3, 6) partials of X, Y, Z by ω, φ, κ of the first, then of the second photograph, m/rad: −N⁻¹AᵀB."""
    n = len(points)
    rays = linearise(*pair.rays(points), np.zeros((2 * n, 2)))
    a, _ = _by_point(pair, points)
    gain = np.linalg.solve(np.swapaxes(a, 1, 2) @ a, np.swapaxes(a, 1, 2))
    per_angle = small_rotation_per_angle(pair.angles, ORDER)
    by_angle = rays.by_orientation[:, :, 3:].reshape(2, n, 2, 3) @ per_angle[:, None]
    return np.concatenate([-gain[:, :, :2] @ by_angle[0], -gain[:, :, 2:] @ by_angle[1]], axis=2)


def explicit_partials(pair: Pair, xy: np.ndarray) -> np.ndarray:
    """As `rigorous_partials`, of the explicit equations at measured positions (2, n, 2) mm.

    From X = A/B and Y alike by the quotient rule; ∂N/∂angle = e × N, e the axis of the small rotation.
    """
    n = np.einsum("pij,pnj->pni", pair.rotation, _directions(pair, xy))
    per_angle = small_rotation_per_angle(pair.angles, ORDER)
    found = explicit(pair, xy).xyz
    ratio = n[..., 0] / n[..., 1]
    (x1, y1, _), (x2, y2, _) = pair.centre
    below = ratio[0] - ratio[1]
    by_ratio = np.empty((2, 2, len(found)))
    by_ratio[0, 0] = (x2 + ratio[1] * (y1 - y2) - found[:, 0]) / below
    by_ratio[1, 0] = (-x1 + ratio[0] * (y1 - y2) + found[:, 0]) / below
    by_ratio[0, 1] = (y1 - found[:, 1]) / below
    by_ratio[1, 1] = (-y2 + found[:, 1]) / below
    out = np.empty((len(found), 3, 6))
    slope = n[0, :, 2] / n[0, :, 0]
    for photo in range(2):
        for k in range(3):
            change = np.cross(per_angle[photo, :, k], n[photo])
            of_ratio = (change[:, 0] - ratio[photo] * change[:, 1]) / n[photo, :, 1]
            column = 3 * photo + k
            out[:, 0, column] = by_ratio[photo, 0] * of_ratio
            out[:, 1, column] = by_ratio[photo, 1] * of_ratio
            out[:, 2, column] = slope * out[:, 0, column]
            if photo == 0:
                of_slope = (change[:, 2] - slope * change[:, 0]) / n[0, :, 0]
                out[:, 2, column] += (found[:, 0] - x1) * of_slope
    return out


def vertical_pair(height: float, base: float, focal_length: float) -> Pair:
    """Two vertical photographs at a height over the level 0, the base along X, its middle over the origin; m and mm."""
    return Pair(np.array([[-base / 2.0, 0.0, height], [base / 2.0, 0.0, height]]), np.zeros((2, 3)), focal_length)


@dataclass(frozen=True)
class AttitudeTolerance:
    """σ of one angle that a volume tolerates, rad, all others free of error; ∞ where the volume does not depend on it.

    Parameters
    ----------
    angle : 'omega', 'phi' or 'kappa'. independent : each photograph's own error. common : one error of both, as of a
        boresight. all_three : where all three angles share the tolerance alike, each photograph's own.
    """

    angle: str
    independent: float
    common: float
    all_three: float


def attitude_tolerance(pair: Pair, places: np.ndarray, weight: np.ndarray, tolerance: float) -> list[AttitudeTolerance]:
    """Which σ of the angles a tolerance of the volume allows, the points intersected rigorously.

    Parameters
    ----------
    places : (n, 3) m of the site. weight : (n,) m², the area each stands for. tolerance : m³, 1 σ.
    """
    by_angle = np.einsum("n,nk->k", weight, rigorous_partials(pair, places)[:, 2]).reshape(2, 3)
    together = float(np.sqrt(np.sum(by_angle**2)))
    out = []
    for k, name in enumerate(("omega", "phi", "kappa")):
        own, common = float(np.hypot(*by_angle[:, k])), abs(float(by_angle[:, k].sum()))
        out.append(AttitudeTolerance(name, *(_over(tolerance, v, together) for v in (own, common, together))))
    return out


def _over(tolerance: float, by_angle: float, largest: float) -> float:
    return tolerance / by_angle if by_angle > 1e-9 * largest else float("inf")


def _directions(pair: Pair, xy: np.ndarray) -> np.ndarray:
    return np.concatenate([xy, np.full((*xy.shape[:2], 1), -pair.focal_length)], axis=2)


def _by_point(pair: Pair, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n, 4, 3) partials of both photographs' coordinates by the point, and the coordinates (n, 4)."""
    n = len(points)
    rays = linearise(*pair.rays(points), np.zeros((2 * n, 2)))
    a, xy = rays.by_point.reshape(2, n, 2, 3), rays.prediction.reshape(2, n, 2)
    return np.concatenate([a[0], a[1]], axis=1), np.concatenate([xy[0], xy[1]], axis=1)
