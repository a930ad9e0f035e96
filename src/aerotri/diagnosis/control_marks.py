"""Whether the marks of a control point meet in space: each ray against the others, before its coordinates count.

A mark at another detail, a name given to another point, or a photograph that is oriented wrongly shows here, whatever
the coordinates of the point are.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from aerotri.adjustment.directions import directions_of
from aerotri.adjustment.prepare import with_edits
from aerotri.adjustment.start_values import MIN_INTERSECTION, intersect
from aerotri.observations import Block, ImagePoints

LEAST_MISS_PX = 5.0
"""Miss of a mark from which it is doubted [C]: a mark is set to a pixel or two, also by hand."""
USUAL_MISSES = 10.0
"""The same in usual misses of other points, of the photograph or of all [C]: start values and lenses that are not
adjusted yet move all rays, and a photograph that is oriented wrongly its own; that is not the fault of a mark."""
SAMPLE = 20000
"""Points of which the usual misses are taken [C]: enough for every photograph that has marks."""
MOST_DOUBTED = 50
"""Points that are looked at one by one [C]: where more are wrong, it is not their marks."""


@dataclass(frozen=True, eq=False)
class Contradiction:
    """Marks of one control or check point whose rays do not meet.

    Parameters
    ----------
    point : row of the block's points. images : (r,) photographs that mark it.
    wrong : the photograph whose mark alone contradicts the others, −1 where that cannot be told.
    apart : least and largest distance of two of its rays, of the wrong one from the others where that is known, m.
    behind : photographs that have it at their back.
    """

    point: int
    images: np.ndarray
    wrong: int
    apart: tuple[float, float]
    behind: np.ndarray

    def sentence(self, block: Block) -> str:
        """What is wrong, and where to look."""
        names = block.images.names
        low, high = (f"{gap:.2g}" for gap in self.apart)
        gap = f"{low} m" if low == high else f"{low} to {high} m"
        behind = f", and it would lie behind {listed(names[self.behind])}" if len(self.behind) else ""
        if self.wrong >= 0:
            others = listed(names[self.images[self.images != self.wrong]])
            return (
                f"control point {block.points[self.point]}: its mark in {names[self.wrong]} does not meet those in "
                f"{others}: the rays pass one another at {gap}{behind}; look at that mark"
            )
        return (
            f"control point {block.points[self.point]}: its marks in {listed(names[self.images])} do not meet: their "
            f"rays pass one another at {gap}{behind}; look at these marks"
        )


@dataclass(frozen=True, eq=False)
class Marks:
    """Where the marks of control and check points meet.

    Parameters
    ----------
    xyz : (k, 3) m of every row of control, NaN where fewer than two rays meet under a real angle, or contradict.
    sigma : (k,) m, along the weakest direction, by the σ of the marks and the usual miss of other points.
    contradictions : of points whose marks do not meet.
    """

    xyz: np.ndarray
    sigma: np.ndarray
    contradictions: tuple[Contradiction, ...]


@dataclass(frozen=True, eq=False)
class _Rays:
    """Rays (r,) of marks: photographs, centres (r, 3), unit directions (r, 3), views (r, 3), the miss allowed and σ."""

    image: np.ndarray
    centre: np.ndarray
    direction: np.ndarray
    view: np.ndarray
    allowed: np.ndarray
    sigma: np.ndarray

    def take(self, rows: np.ndarray) -> _Rays:
        columns = (self.image, self.centre, self.direction, self.view, self.allowed, self.sigma)
        return _Rays(*(column[rows] for column in columns))


def contradictions_in_words(block: Block, found: Sequence[Contradiction]) -> tuple[str, ...]:
    """A sentence for every contradiction; one for those of a photograph that contradicts at several points."""
    alone = alone_in_their_photograph(found)
    several = {one.wrong for one in found if one.wrong >= 0} - {one.wrong for one in alone}
    said = [one.sentence(block) for one in found if one.wrong not in several]
    for image in sorted(several):
        names = listed(block.points[[one.point for one in found if one.wrong == image]])
        said.append(
            f"control points {names}: their marks in {block.images.names[image]} do not meet those in other "
            "photographs: look at its orientation, and whether the marks are of another photograph"
        )
    return tuple(said)


def alone_in_their_photograph(found: Sequence[Contradiction]) -> list[Contradiction]:
    """Those of a single mark: a photograph that contradicts at several points may be oriented wrongly itself."""
    return [one for one in found if one.wrong >= 0 and sum(other.wrong == one.wrong for other in found) == 1]


def marks_of(block: Block, centre: np.ndarray, rotation: np.ndarray) -> Marks:
    """Intersect the marks of control and check points and hold the rays of each against one another.

    Parameters
    ----------
    block : its cameras hold the values that belong to the orientation.
    centre : (n, 3) m; rotation : (n, 3, 3) camera → object; NaN for photographs without orientation.
    """
    block, off = with_edits(block)
    count = len(block.control)
    row = np.full(len(block.points), -1)
    row[block.control.point] = np.arange(count)
    seen = ~off & np.isfinite(centre[block.image_points.image, 0])
    rows = np.flatnonzero(seen & (row[block.image_points.point] >= 0))
    rays = _rays(block, centre, rotation, rows, _usual_misses(block, centre, rotation, np.flatnonzero(seen)))
    of = row[block.image_points.point[rows]]
    xyz = intersect(count, of, rays.centre, rays.direction, rays.allowed)
    bad = _misses(rays, xyz[of]) > rays.allowed
    doubted = np.unique(of[bad | np.isnan(xyz[of, 0])])
    found = []
    for k in doubted[np.bincount(of, minlength=count)[doubted] > 1][:MOST_DOUBTED].tolist():
        contradiction, place = _contradiction(int(block.control.point[k]), rays.take(np.flatnonzero(of == k)))
        xyz[k] = place
        found += [] if contradiction is None else [contradiction]
    return Marks(xyz, _sigma(rays, of, xyz), tuple(found))


def rays_that_tell(block: Block) -> np.ndarray:
    """Rows of the image points that `marks_of` needs: those of control and check points, and a sample of others."""
    points = block.image_points.point
    chosen = _sample(block, np.arange(len(points)))
    return np.flatnonzero(np.isin(points, block.control.point) | np.isin(points, chosen))


def _sample(block: Block, rows: np.ndarray) -> np.ndarray:
    """(p,) some of the points that are no control, of photographs with marks, in their order."""
    image, point = block.image_points.image[rows], block.image_points.point[rows]
    marked = np.unique(image[np.isin(point, block.control.point)])
    others = np.setdiff1d(point[np.isin(image, marked)], block.control.point)
    return others[np.unique(np.linspace(0, len(others) - 1, SAMPLE).astype(np.int64))] if len(others) else others


def _rays(block: Block, centre: np.ndarray, rotation: np.ndarray, rows: np.ndarray, usual: np.ndarray) -> _Rays:
    """Of image points (r,); `usual` (n,) are the misses of other points in every photograph, rad."""
    points = block.image_points
    some = ImagePoints(points.image[rows], points.point[rows], points.xy[rows], points.sigma[rows])
    tangent, image = directions_of(replace(block, image_points=some)).tangent, some.image
    ray = np.einsum("rij,rj->ri", rotation[image], np.column_stack([tangent, -np.ones(len(rows))]))
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    pixel = np.array([camera.pixel_mm / camera.focal_length_mm for camera in block.cameras])
    allowed = np.maximum(LEAST_MISS_PX * pixel[block.images.camera[image]], USUAL_MISSES * usual[image])
    focal = np.array([camera.focal_length_mm for camera in block.cameras])[block.images.camera[image]]
    sigma = np.hypot(some.sigma.max(axis=1) / focal, usual[image])
    return _Rays(image, centre[image], ray, -rotation[image][:, :, 2], allowed, sigma)


def _usual_misses(block: Block, centre: np.ndarray, rotation: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """(n,) rad, median miss of the points that are no control, of all or of the photograph if that is larger.

    Rays that have no point, as it would lie behind one of its cameras, miss by all that there is.
    """
    nothing = np.zeros(len(block.images))
    points = _sample(block, seen)
    rows = seen[np.isin(block.image_points.point[seen], points)]
    rays = _rays(block, centre, rotation, rows, nothing)
    of = np.searchsorted(points, block.image_points.point[rows])
    miss = _misses(rays, intersect(len(points), of, rays.centre, rays.direction, rays.allowed)[of])
    known = np.bincount(of, minlength=len(points))[of] > 1
    miss = np.nan_to_num(miss, nan=np.pi)
    if not known.any():
        return nothing
    usual = np.full(len(block.images), float(np.median(miss[known])))
    order = np.flatnonzero(known)[np.argsort(rays.image[known], kind="stable")]
    image, first = np.unique(rays.image[order], return_index=True)
    medians = [float(np.median(own)) for own in np.split(miss[order], first[1:])]
    usual[image] = np.maximum(usual[image], medians)
    return usual


def _misses(rays: _Rays, xyz: np.ndarray) -> np.ndarray:
    """(r,) rad between each ray and its point (r, 3); NaN where there is none."""
    reach = xyz - rays.centre
    across = np.linalg.norm(np.cross(reach, rays.direction), axis=1)
    return np.arctan2(across, np.einsum("ri,ri->r", reach, rays.direction))


def _nearest(rays: _Rays) -> np.ndarray:
    """(3,) the point nearest to the rays by equal weights, NaN where they are parallel."""
    across = np.eye(3) - rays.direction[:, :, None] * rays.direction[:, None, :]
    normal, origin = across.sum(axis=0), rays.centre[0]
    if np.linalg.eigvalsh(normal)[0] < MIN_INTERSECTION * len(rays.image):
        return np.full(3, np.nan)
    return origin + np.linalg.solve(normal, np.einsum("rij,rj->i", across, rays.centre - origin))


def _contradiction(point: int, rays: _Rays) -> tuple[Contradiction | None, np.ndarray]:
    """What is wrong with the marks of a point, and where those meet that agree; None where all do."""
    nowhere = np.full(3, np.nan)
    whole = _nearest(rays)
    if np.isnan(whole[0]):
        return None, nowhere
    if _meet(rays, whole):
        return None, whole
    every = np.arange(len(rays.image))
    without = {k: _nearest(rays.take(np.delete(every, k))) for k in every.tolist()} if len(every) > 2 else {}
    right = [k for k, place in without.items() if _meet(rays.take(np.delete(every, k)), place)]
    alone = right[0] if len(right) == 1 else -1
    place = without[alone] if alone >= 0 else whole
    behind = rays.image[np.einsum("ri,ri->r", place - rays.centre, rays.view) <= 0.0]
    gaps = [_gap(rays, *pair) for pair in combinations(every.tolist(), 2) if alone < 0 or alone in pair]
    wrong = int(rays.image[alone]) if alone >= 0 else -1
    found = Contradiction(point, rays.image, wrong, (min(gaps), max(gaps)), behind)
    return found, place if alone >= 0 else nowhere


def _meet(rays: _Rays, place: np.ndarray) -> bool:
    """Whether all rays pass their point as near as marks can be set, in front of their cameras."""
    return not np.isnan(place[0]) and bool((_misses(rays, np.tile(place, (len(rays.image), 1))) <= rays.allowed).all())


def _gap(rays: _Rays, i: int, j: int) -> float:
    """m, the distance of two rays."""
    across = np.cross(rays.direction[i], rays.direction[j])
    between, size = rays.centre[j] - rays.centre[i], float(np.linalg.norm(across))
    if size < np.sqrt(MIN_INTERSECTION):
        return float(np.linalg.norm(np.cross(between, rays.direction[i])))
    return abs(float(between @ across)) / size


def _sigma(rays: _Rays, of: np.ndarray, xyz: np.ndarray) -> np.ndarray:
    """(k,) m of points (k, 3) along their weakest direction; NaN without a point."""
    distance = np.linalg.norm(xyz[of] - rays.centre, axis=1)
    across = np.eye(3) - rays.direction[:, :, None] * rays.direction[:, None, :]
    sigma, normal = np.full(len(xyz), np.nan), np.zeros((len(xyz), 3, 3))
    known = np.isfinite(distance)
    weight = 1.0 / np.square(np.maximum(rays.sigma[known] * distance[known], 1e-300))
    np.add.at(normal, of[known], across[known] * weight[:, None, None])
    there = np.isfinite(xyz[:, 0])
    sigma[there] = 1.0 / np.sqrt(np.maximum(np.linalg.eigvalsh(normal[there])[:, 0], 1e-300))
    return sigma


def listed(names: Iterable[object]) -> str:
    """'a', 'a and b', 'a, b and c', 'a, b, c and 4 more'."""
    every = [str(name) for name in names]
    shown = every if len(every) <= 4 else [*every[:3], f"{len(every) - 3} more"]
    return shown[0] if len(shown) == 1 else f"{', '.join(shown[:-1])} and {shown[-1]}"
