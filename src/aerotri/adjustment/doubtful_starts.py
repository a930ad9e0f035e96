"""Orientations that are given and cannot be right: the photographs whose rays miss those of all others.

Every ray is held against the point where the rays meet. Where a photograph misses by many degrees, the pairs of
photographs tell which of them is wrong: two good ones see their common points where both look. The largest set of
photographs that agree counts as right; what lies outside is oriented anew from the points of the others.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from aerotri.adjustment.directions import Directions, directions_of
from aerotri.adjustment.rig_start import rig_start_values
from aerotri.adjustment.start_values import (
    LOOSE_CENTRE,
    TRACK_ITERATIONS,
    intersect_into,
    local_origin,
    loose_centres,
    rays_meet,
    refine,
    with_held_cameras,
)
from aerotri.functional_model.rotation import angles_from_rotation, logarithm, rotation_from_angles
from aerotri.observations import Block, ImagePoints

MISSES = 0.15
"""Median miss of a photograph's rays, rad, from which its orientation is looked at [C]: 9°. Centres 5 m off at 50 m
above ground, or angles that err by 3°, stay below it."""
LEAST, OUTSTANDING = 0.05, 6.0
"""Median miss, rad, from which a photograph is looked at where the others miss by a sixth of it or less [C]."""
LOST = 2.0 * MISSES
"""Median miss from which a photograph is named where no orientation that fits is found."""
TURNED = np.radians(15.0)
"""Turn from which an orientation that was given is replaced [C]: an adjustment finds its way from less by itself."""
FEWEST_COMMON = 3
"""Points in common from which a pair of photographs tells anything [C]: of three, two outvote a gross error."""
MOST_COMMON = 30
"""Points of a pair that are looked at, at most [C]: their median needs no more."""
PARTNERS = 12
"""Photographs that each is paired with, those with most points in common [C]."""
BETTER = 3.0
"""Factor by which the rays have to miss less with the new orientation [C]: right ones are a hundred times better."""
NEAR = 0.3
"""Distance between the new projection centre and the given one, over that of the points, up to which they agree [C].
A mirrored photograph is resected from the other side of the ground, at twice the distance of the points."""


@dataclass(frozen=True, eq=False)
class Orientations:
    """Projection centres (n, 3) m in the local frame, and rotations (n, 3, 3) camera → object; NaN where unknown."""

    centre: np.ndarray
    rotation: np.ndarray

    @property
    def known(self) -> np.ndarray:
        """(n,) bool."""
        return np.asarray(np.isfinite(self.centre).all(axis=1) & np.isfinite(self.rotation).all(axis=(1, 2)))

    def only(self, rows: np.ndarray) -> Orientations:
        """Those of some photographs (n,) bool, the others unknown."""
        return Orientations(
            np.where(rows[:, None], self.centre, np.nan), np.where(rows[:, None, None], self.rotation, np.nan)
        )

    def with_those_of(self, other: Orientations, rows: np.ndarray) -> Orientations:
        """With the orientations of another set for some photographs (n,) bool."""
        return Orientations(
            np.where(rows[:, None], other.centre, self.centre),
            np.where(rows[:, None, None], other.rotation, self.rotation),
        )

    def turned_to(self, other: Orientations) -> np.ndarray:
        """(n,) rad between the rotations of both; NaN where one is unknown."""
        both, turned = self.known & other.known, np.full(len(self.centre), np.nan)
        apart = np.swapaxes(self.rotation[both], 1, 2) @ other.rotation[both]
        turned[both] = np.linalg.norm(logarithm(apart), axis=1)
        return turned


@dataclass(frozen=True, eq=False)
class Replacement:
    """Orientations of which some are new.

    Parameters
    ----------
    new : (n,) bool, those that fit much better than the given ones and are turned by much; the others are as given.
    lost : (n,) bool, photographs that are far off, and for which nothing was found that fits.
    """

    orientations: Orientations
    new: np.ndarray
    lost: np.ndarray


def given_orientations(local: Block) -> Orientations:
    """The orientations that a block in the local frame states."""
    images = local.images
    known = np.asarray(np.isfinite(images.centre).all(axis=1) & np.isfinite(images.angles).all(axis=1))
    rotation = np.full((len(images), 3, 3), np.nan)
    rotation[known] = rotation_from_angles(images.angles[known], local.rotation)
    return Orientations(np.where(known[:, None], images.centre, np.nan), rotation)


def doubtful(local: Block, given: Orientations) -> np.ndarray:
    """(n,) bool, photographs whose given orientation the image points contradict; all where none agree."""
    directions = directions_of(local)
    missed = miss_by_photograph(local, directions, given)
    limit = _limit(missed)
    suspect = given.known & (missed > limit)
    if not suspect.any():
        return suspect
    good = _largest_agreement(local, directions, given, suspect)
    good = _without_misses(local, directions, given, good, limit)
    return np.asarray(given.known & ~good & np.isfinite(missed))


def _limit(missed: np.ndarray) -> float:
    """Median miss, rad, from which a photograph is looked at; `missed` (n,) of all."""
    known = missed[np.isfinite(missed)]
    usual = float(np.median(known)) if len(known) else np.inf
    return float(np.clip(OUTSTANDING * usual, LEAST, MISSES))


def oriented_anew(local: Block, given: Orientations, wrong: np.ndarray) -> Replacement:
    """What takes the place of the orientations of wrong photographs (n,) bool, from the points of the others."""
    near = _around(local, wrong)
    right = _refined(near, given.only(~wrong))
    images = near.images
    angles = np.full_like(images.angles, np.nan)
    angles[right.known] = angles_from_rotation(right.rotation[right.known], local.rotation)
    start = rig_start_values(replace(near, images=replace(images, centre=right.centre, angles=angles)))
    found = right.with_those_of(Orientations(start.centre + start.origin, start.rotation), wrong)
    return accepted(near, given, found, wrong)


def _around(local: Block, wrong: np.ndarray) -> Block:
    """The block with the image points of wrong photographs (n,) bool and of those that share points with them."""
    rays = local.image_points
    shared = np.zeros(len(local.points), bool)
    shared[rays.point[wrong[rays.image]]] = True
    common = np.bincount(rays.image[shared[rays.point]], minlength=len(wrong))
    rows = np.flatnonzero((common >= FEWEST_COMMON)[rays.image])
    some = ImagePoints(rays.image[rows], rays.point[rows], rays.xy[rows], rays.sigma[rows])
    return replace(local, image_points=some)


def _refined(local: Block, right: Orientations) -> Orientations:
    """Orientations after a short adjustment with their centres as loose observations: start values err by degrees."""
    origin, directions = local_origin(local), directions_of(local)
    rotation, centre = right.rotation.copy(), right.centre - origin
    points = np.full((len(local.points), 3), np.nan)
    intersect_into(points, local, directions, rotation, centre)
    way = np.linalg.norm(points[local.image_points.point] - centre[local.image_points.image], axis=1)
    if not np.isfinite(way).any():
        return right
    centres = loose_centres(local, right.centre, LOOSE_CENTRE * float(np.nanmedian(way)))
    refine(with_held_cameras(local), origin, rotation, centre, points, TRACK_ITERATIONS, centres)
    return Orientations(centre + origin, rotation)


def accepted(local: Block, given: Orientations, found: Orientations, wrong: np.ndarray) -> Replacement:
    """The orientations of wrong photographs (n,) bool that were found in whatever way, as far as they hold."""
    directions = directions_of(local)
    before, after = (miss_by_photograph(local, directions, way) for way in (given, found))
    distance = np.linalg.norm(found.centre - given.centre, axis=1)
    fits = wrong & (after < MISSES) & (BETTER * after < before) & (distance < NEAR * _reach(local, directions, found))
    new = fits & (given.turned_to(found) > TURNED)
    return Replacement(given.with_those_of(found, new), new, wrong & ~fits & (before > LOST))


def miss_by_photograph(local: Block, directions: Directions, at: Orientations) -> np.ndarray:
    """(n,) rad, median distance of the rays of every photograph from where the rays of their points meet.

    π counts where rays do not meet in front of the cameras; NaN for photographs without a point that others see.
    """
    rays, known = local.image_points, at.known
    use = known[rays.image]
    use &= np.bincount(rays.point[use], minlength=len(local.points))[rays.point] > 1
    image, point = rays.image[use], rays.point[use]
    centre = at.centre - local_origin(local)
    _, miss = rays_meet(
        len(local.points), point, at.rotation[image], centre[image], directions.tangent[use], directions.tolerance[use]
    )
    return medians(image, miss, len(known))


def misses_of_control(local: Block, at: Orientations) -> np.ndarray:
    """(k,) rad, distance of rays to control points from the direction of the coordinates that are given."""
    control, rays = local.control, local.image_points
    whole = ~control.is_check & np.isfinite(control.xyz).all(axis=1)
    xyz = np.full((len(local.points), 3), np.nan)
    xyz[control.point[whole]] = control.xyz[whole]
    rows = np.flatnonzero(np.isfinite(xyz[rays.point, 0]) & at.known[rays.image])
    image = rays.image[rows]
    ray = _unit_rays(directions_of(local).tangent[rows], at.rotation[image])
    reach = xyz[rays.point[rows]] - at.centre[image]
    cosine = np.einsum("ki,ki->k", ray, reach) / np.linalg.norm(reach, axis=1)
    return np.arccos(np.clip(cosine, -1.0, 1.0))


def medians(group: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """(count,) median of the values (m,) of every group (m,); NaN for groups without any."""
    order = np.lexsort((values, group))
    size = np.bincount(group, minlength=count)
    first = np.concatenate([[0], np.cumsum(size)[:-1]])
    found, there = np.full(count, np.nan), size > 0
    found[there] = values[order[first[there] + (size[there] - 1) // 2]]
    return found


def _reach(local: Block, directions: Directions, at: Orientations) -> np.ndarray:
    """(n,) m, median distance of the points of every photograph."""
    origin, rays = local_origin(local), local.image_points
    points = np.full((len(local.points), 3), np.nan)
    intersect_into(points, local, directions, at.rotation, at.centre - origin)
    way = np.linalg.norm(points[rays.point] + origin - at.centre[rays.image], axis=1)
    there = np.isfinite(way)
    return medians(rays.image[there], way[there], len(at.centre))


def _largest_agreement(local: Block, directions: Directions, at: Orientations, suspect: np.ndarray) -> np.ndarray:
    """(n,) bool, the largest set of photographs that hang together by pairs that agree.

    Those that are above suspicion agree; pairs are looked at where one of the two is suspect.
    """
    pairs = _pairs(local, at.known, suspect)
    agree = pairs[_pair_misses(local, directions, at, pairs) < MISSES] if len(pairs) else pairs
    n, clear = len(suspect), np.flatnonzero(at.known & ~suspect)
    row, column = np.concatenate([agree[:, 0], clear[1:]]), np.concatenate([agree[:, 1], clear[:-1]])
    graph = coo_array((np.ones(len(row)), (row, column)), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    size = np.bincount(label[at.known], minlength=int(label.max()) + 1)
    return at.known & (label == np.argmax(size))


def _pairs(local: Block, known: np.ndarray, suspect: np.ndarray) -> np.ndarray:
    """(k, 2) pairs with a suspect, of every photograph those with most points in common."""
    rays = local.image_points
    use = known[rays.image]
    shape = (len(local.images), len(local.points))
    seen = coo_array((np.ones(int(use.sum())), (rays.image[use], rays.point[use])), shape=shape).tocsr()
    seen.data[:] = 1.0
    rows = np.flatnonzero(suspect)
    common = (seen[rows] @ seen.T).tocsr()
    found = []
    for k, image in enumerate(rows.tolist()):
        other = common.indices[common.indptr[k] : common.indptr[k + 1]]
        count = common.data[common.indptr[k] : common.indptr[k + 1]]
        enough = (count >= FEWEST_COMMON) & (other != image)
        best = other[enough][np.argsort(-count[enough], kind="stable")[:PARTNERS]]
        found.append(np.column_stack([np.full(len(best), image), best]))
    return np.unique(np.sort(np.concatenate(found), axis=1), axis=0) if found else np.zeros((0, 2), np.int64)


def _pair_misses(local: Block, directions: Directions, at: Orientations, pairs: np.ndarray) -> np.ndarray:
    """(k,) rad, median over the common points by how much the two rays miss one another."""
    rays = local.image_points
    order = np.lexsort((rays.point, rays.image))
    first = np.searchsorted(rays.image[order], np.arange(len(local.images) + 1))
    own = [order[first[k] : first[k + 1]] for k in range(len(local.images))]
    left, right, pair = [], [], []
    for k, (i, j) in enumerate(pairs.tolist()):
        _, a, b = np.intersect1d(rays.point[own[i]], rays.point[own[j]], return_indices=True)
        chosen = np.linspace(0, len(a) - 1, min(len(a), MOST_COMMON)).astype(np.int64)
        left.append(own[i][a[chosen]])
        right.append(own[j][b[chosen]])
        pair.append(np.full(len(chosen), k))
    rows = np.concatenate(left), np.concatenate(right)
    return medians(np.concatenate(pair), _two_rays(local, directions, at, *rows), len(pairs))


def _two_rays(local: Block, directions: Directions, at: Orientations, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(k,) rad by which two rays miss the point nearest to both, or one infinitely far away if that is nearer.

    Parameters
    ----------
    a, b : (k,) rows of the image points.
    """
    image = local.image_points.image
    u, v = (_unit_rays(directions.tangent[rows], at.rotation[image[rows]]) for rows in (a, b))
    base = at.centre[image[b]] - at.centre[image[a]]
    cosine = np.einsum("ki,ki->k", u, v)
    far = 0.5 * np.arccos(np.clip(cosine, -1.0, 1.0))
    sine2 = np.maximum(1.0 - cosine**2, 1e-30)
    along_u, along_v = np.einsum("ki,ki->k", u, base), np.einsum("ki,ki->k", v, base)
    s, t = (along_u - cosine * along_v) / sine2, (cosine * along_u - along_v) / sine2
    gap = 0.5 * np.linalg.norm(base + t[:, None] * v - s[:, None] * u, axis=1)
    nearest = np.minimum(s, t)
    meets = np.where(nearest > 0.0, np.arctan2(gap, np.maximum(nearest, 1e-300)), np.pi)
    return np.minimum(far, meets)


def _unit_rays(tangent: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """(k, 3) directions in the object frame."""
    ray = np.einsum("kij,kj->ki", rotation, np.column_stack([tangent, -np.ones(len(tangent))]))
    return ray / np.linalg.norm(ray, axis=1, keepdims=True)


def _without_misses(
    local: Block, directions: Directions, at: Orientations, good: np.ndarray, limit: float
) -> np.ndarray:
    """The set without photographs that miss what the others of it say, the worst of every neighbourhood first.

    What is taken out changes the misses of those that share points with it, and of no others.
    """
    good = good.copy()
    for _ in range(int(good.sum())):
        missed = np.nan_to_num(miss_by_photograph(local, directions, at.only(good)))
        worst = _worst_around(local.image_points, missed, missed > limit)
        if not worst.any():
            break
        good &= ~worst
    return good


def _worst_around(rays: ImagePoints, missed: np.ndarray, among: np.ndarray) -> np.ndarray:
    """(n,) bool, photographs that miss by more than all others with a point in common.

    Parameters
    ----------
    missed : (n,) rad. among : (n,) bool, the photographs looked at; all others miss by less.
    """
    worst, rank = among.copy(), np.zeros(len(among), dtype=np.int64)
    rank[np.argsort(-missed, kind="stable")] = np.arange(len(among), 0, -1)
    rows = np.flatnonzero(among[rays.image])
    image, (_, point) = rays.image[rows], np.unique(rays.point[rows], return_inverse=True)
    highest = np.zeros(len(rows), dtype=np.int64)
    np.maximum.at(highest, point, rank[image])
    worst[image[rank[image] < highest[point]]] = False
    return worst
