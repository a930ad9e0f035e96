"""How a camera sits on its rig where nothing is stated: from its tie points, with the stations already oriented.

The stations know where the reference camera was and how it was turned. Of a camera beside it three unknowns are left,
its rotation R_k on the frame (its position there is small beside the distances flown). Every two of its rays that meet
have to lie in one plane with the line between their stations, and have to meet in front of the camera, at the height of
the ground that the reference camera sees [derived]. A grid of all rotations is tried, the best ones are improved by
robust least squares, and the ties to photographs of other cameras decide between those that fit equally well, such as a
camera that looks to the left or to the right of straight strips.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.adjustment.directions import Directions
from aerotri.conventions import SIGMA_PER_MAD
from aerotri.functional_model.rotation import exponential, logarithm
from aerotri.observations import Block

GRID = 6000
"""Rotations that are tried: some 10° from one to the next."""
COARSE, FINE = 150, 1500
"""Pairs of rays that the grid is tried with, and that the best rotations are improved with."""
BEST = 40
"""Rotations of the grid that are improved."""
APART = np.radians(2.0)
"""Rotations nearer to one another than this are one."""
PARALLAX = np.radians(2.0)
"""Angle between two rays below which they say too little."""
WIDTHS = np.radians([15.0, 5.0, 2.0])
"""Misfit at which a pair has half its weight, in the three rounds of improvement."""
ROUNDS = 8
STEP = 1e-5
"""rad, of the differences that partials are."""
FITS = np.radians(2.0)
"""Misfit with which a pair fits a rotation."""
GROUND_SHARE = 0.1
"""Spread of the heights of the ground, as a share of the height of flight, that is allowed for at least."""
RIVAL = 0.8
"""Share of the pairs that fit the best rotation; another that as many fit is a rival."""
CLEAR = 2.0
"""How many times more ties to other cameras than a rival's have to fit the rotation that is taken."""
WEAK = 20.0
"""How much wider the heights of the ground are taken at the end."""
FEWEST = 12
"""Pairs that have to fit a rotation."""


@dataclass(frozen=True, eq=False)
class Stations:
    """The oriented photographs that a camera follows.

    Parameters
    ----------
    lead : (n,) of every photograph the one it follows; −1 of photographs that are not of the camera.
    centre : (n, 3) m; rotation : (n, 3, 3); of oriented photographs, NaN otherwise.
    """

    lead: np.ndarray
    centre: np.ndarray
    rotation: np.ndarray


@dataclass(frozen=True, eq=False)
class Pairs:
    """Two rays each that meet, k of them; the first is of the camera that is looked for.

    Parameters
    ----------
    turn : (k, 2, 3, 3) rotations of the stations of the two rays. ray : (k, 2, 3) unit vectors, in the camera.
    base : (k, 3) m, from the first station to the second. height : (k,) m, of the first station above the ground.
    own : whether the second ray is of the camera too; otherwise it is turned already.
    """

    turn: np.ndarray
    ray: np.ndarray
    base: np.ndarray
    height: np.ndarray
    own: bool

    def __len__(self) -> int:
        return len(self.base)

    def some(self, count: int) -> Pairs:
        """An even choice of so many of them."""
        rows = np.unique(np.linspace(0, len(self) - 1, min(count, len(self))).astype(np.int64))
        return Pairs(self.turn[rows], self.ray[rows], self.base[rows], self.height[rows], self.own)


def search_mounting(
    block: Block, directions: Directions, stations: Stations, ground: tuple[float, float]
) -> np.ndarray | None:
    """The rotation (3, 3) of a camera in the frame of its rig, camera → reference; None where it is not determined.

    Parameters
    ----------
    ground : height of the ground and its spread, m.
    """
    own, others = _pairs(block, directions, stations, ground[0])
    if len(own) < FEWEST:
        return None
    found = _candidates(own, ground[1])
    fine = own.some(FINE)
    fit = np.array([np.count_nonzero(_misfit(r, fine, ground[1]) < FITS) for r in found])
    if fit.max() < max(FEWEST, len(fine) // 4):
        return None
    near = [found[k] for k in np.argsort(-fit, kind="stable") if fit[k] >= RIVAL * fit.max()]
    rivals = [_settled(rotation, fine, others, ground[1]) for rotation in near]
    if len(rivals) == 1:
        return rivals[0]
    ties = np.array([np.count_nonzero(_misfit(r, others, ground[1]) < FITS) if len(others) else 0 for r in rivals])
    first, second = np.sort(ties)[::-1][:2]
    return rivals[int(np.argmax(ties))] if first >= FEWEST and first >= CLEAR * second else None


def _settled(rotation: np.ndarray, own: Pairs, others: Pairs, spread_m: float) -> np.ndarray:
    """The rotation improved with the ties to other cameras; the height of the ground counts little now."""
    sets = (own, others) if len(others) else (own,)
    for width in WIDTHS[1:]:
        rotation = _improved(rotation, sets, WEAK * spread_m, width)
    return rotation


def _pairs(block: Block, directions: Directions, stations: Stations, ground_m: float) -> tuple[Pairs, Pairs]:
    """The pairs of two rays of the camera, and those of one of its rays and one of an oriented photograph."""
    rays = block.image_points
    mine = (stations.lead >= 0)[rays.image]
    oriented = np.isfinite(stations.centre[:, 0])[rays.image] & ~mine
    first, second = _neighbours(rays.point, rays.image, mine)
    third, fourth = _neighbours(rays.point, rays.image, mine | oriented)
    third, fourth = np.where(mine[third], third, fourth), np.where(mine[third], fourth, third)
    mixed = mine[third] & oriented[fourth]
    third, fourth = third[mixed], fourth[mixed]
    unit = np.column_stack([directions.tangent, -np.ones(len(rays))])
    unit /= np.linalg.norm(unit, axis=1)[:, None]
    place = np.where(stations.lead >= 0, stations.lead, np.arange(len(stations.lead)))

    def made(a: np.ndarray, b: np.ndarray, own: bool) -> Pairs:
        at, to = place[rays.image[a]], place[rays.image[b]]
        centre = stations.centre
        base = centre[to] - centre[at]
        moved = np.linalg.norm(base, axis=1) > 0.0
        at, to, a, b = at[moved], to[moved], a[moved], b[moved]
        return Pairs(
            np.stack([stations.rotation[at], stations.rotation[to]], axis=1),
            np.stack([unit[a], unit[b]], axis=1),
            base[moved],
            centre[at, 2] - ground_m,
            own,
        )

    return made(first, second, True), made(third, fourth, False)


def _neighbours(point: np.ndarray, image: np.ndarray, among: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows of two rays of one point, each with the next three of those `among` (m,), in the order of photographs."""
    order = np.lexsort((image, point))
    order = order[among[order]]
    first, second = [], []
    for step in (1, 2, 3):
        a, b = order[:-step], order[step:]
        use = (point[a] == point[b]) & (image[a] != image[b])
        first.append(a[use])
        second.append(b[use])
    return np.concatenate(first), np.concatenate(second)


def _candidates(own: Pairs, spread_m: float) -> list[np.ndarray]:
    """Rotations that the pairs of the camera fit locally best, each improved, no two the same."""
    grid, coarse = _grid(), own.some(COARSE)
    score = np.array([_cost(r, coarse, spread_m, WIDTHS[0]) for r in grid])
    found: list[np.ndarray] = []
    fine = own.some(FINE)
    for k in np.argsort(score, kind="stable")[:BEST]:
        better = grid[k]
        for width in WIDTHS:
            better = _improved(better, (fine,), spread_m, width)
        if all(np.linalg.norm(logarithm(better @ one.T)) > APART for one in found):
            found.append(better)
    return found


def _grid() -> np.ndarray:
    """(GRID, 3, 3) rotations spread evenly: a spiral of unit quaternions (Alexa 2022, super-Fibonacci)."""
    s = np.arange(GRID) + 0.5
    r, q = np.sqrt(s / GRID), np.sqrt(1.0 - s / GRID)
    # [L] the two ratios of the spiral
    a, b = 2.0 * np.pi * s / np.sqrt(2.0), 2.0 * np.pi * s / 1.533751168755204288118041
    x, y, z, w = r * np.sin(a), r * np.cos(a), q * np.sin(b), q * np.cos(b)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def _residuals(rotation: np.ndarray, pairs: Pairs, spread_m: float) -> tuple[np.ndarray, np.ndarray]:
    """(k, 2) rad: the base out of the plane of the two rays, and the height of their point as an angle; and whether
    the point is in front of both and the rays are not parallel (k,)."""
    first = np.einsum("kij,kj->ki", pairs.turn[:, 0], pairs.ray[:, 0] @ rotation.T)
    second = pairs.ray[:, 1] @ rotation.T if pairs.own else pairs.ray[:, 1]
    second = np.einsum("kij,kj->ki", pairs.turn[:, 1], second)
    normal = np.cross(first, second)
    sine2 = (normal**2).sum(axis=1)
    base = np.linalg.norm(pairs.base, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        out = np.arcsin(np.clip((normal * pairs.base).sum(axis=1) / (np.sqrt(sine2) * base), -1.0, 1.0))
        along = (np.cross(pairs.base, second) * normal).sum(axis=1) / sine2
        beyond = (np.cross(pairs.base, first) * normal).sum(axis=1) / sine2
        drop = -along * first[:, 2]
    good = (sine2 > np.sin(PARALLAX) ** 2) & (along > 0.0) & (beyond > 0.0)
    # a height of flight that is wrong by its tenth counts as an angle of a tenth
    return np.column_stack([out, WIDTHS[-1] * (drop - pairs.height) / spread_m]), good


def _misfit(rotation: np.ndarray, pairs: Pairs, spread_m: float) -> np.ndarray:
    """(k,) rad; infinite where the rays do not meet."""
    residual, good = _residuals(rotation, pairs, spread_m)
    return np.where(good, np.sqrt(0.5 * (residual**2).sum(axis=1)), np.inf)


def _cost(rotation: np.ndarray, pairs: Pairs, spread_m: float, width: float) -> float:
    """Mean of the robust costs of the pairs, 1 for one that does not fit at all."""
    misfit = _misfit(rotation, pairs, spread_m)
    share = np.where(np.isfinite(misfit), misfit, 1e6 * width) / width
    return float((share**2 / (1.0 + share**2)).mean())


def _improved(rotation: np.ndarray, sets: tuple[Pairs, ...], spread_m: float, width: float) -> np.ndarray:
    """The rotation after some steps of robust least squares; only steps that lower the cost are taken."""

    def cost_of(tried: np.ndarray) -> float:
        return sum(len(pairs) * _cost(tried, pairs, spread_m, width) for pairs in sets)

    cost = cost_of(rotation)
    for _ in range(ROUNDS):
        equations = [_weighted_equations(rotation, pairs, spread_m, width) for pairs in sets]
        a, b = (np.concatenate(parts) for parts in zip(*equations, strict=True))
        if not np.isfinite(a).all() or not np.isfinite(b).all():
            break
        tried = rotation @ exponential(-np.linalg.lstsq(a, b, rcond=None)[0])
        lower = cost_of(tried)
        if lower >= cost:
            break
        rotation, cost = tried, lower
    return rotation


def _weighted_equations(
    rotation: np.ndarray, pairs: Pairs, spread_m: float, width: float
) -> tuple[np.ndarray, np.ndarray]:
    """Partials (2k, 3) by a small rotation and residuals (2k,), by the square roots of the robust weights."""
    residual, good = _residuals(rotation, pairs, spread_m)
    size = np.sqrt((residual**2).sum(axis=1))
    partials = []
    for axis in np.eye(3):
        moved, there = _residuals(rotation @ exponential(STEP * axis), pairs, spread_m)
        good &= there
        partials.append((moved - residual) / STEP)
    root = np.where(good, 1.0 / (1.0 + (size / width) ** 2), 0.0)[:, None]
    a = np.where(good[:, None, None], np.stack(partials, axis=2), 0.0) * root[:, :, None]
    b = np.where(good[:, None], residual, 0.0) * root
    return a.reshape(-1, 3), b.reshape(-1)


def ground_of(points: np.ndarray, centre: np.ndarray) -> tuple[float, float] | None:
    """Height of the ground and its spread, m, from points (N, 3) that photographs at centre (n, 3) see."""
    z = points[np.isfinite(points).all(axis=1), 2]
    if len(z) < FEWEST:
        return None
    middle = float(np.median(z))
    above = float(np.nanmedian(centre[:, 2])) - middle
    if above <= 0.0:
        return None
    return middle, max(SIGMA_PER_MAD * float(np.median(np.abs(z - middle))), GROUND_SHARE * above)
