"""The block built from its image points alone: no control, no GNSS, no start values can spoil it.

A pair of photographs is oriented to one another, the others are resected one after the other from the points found so
far, robustly (`adjustment.start_values`). A photograph whose measurements do not fit the others stays out. Only a
block of so few points that no pair can be oriented begins with its start values, if the image points then fit them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from aerotri.adjustment.directions import directions_of
from aerotri.adjustment.start_values import (
    OPENCV_FROM_CAMERA,
    RESECTION_TOLERANCES,
    intersect_into,
    refine,
    start_values,
)
from aerotri.functional_model.rotation import angles_from_rotation, rotation_from_angles
from aerotri.observations import Block, Control, ImagePoints, Images

FEWEST_COMMON = 8
"""Points in common from which two photographs are oriented to one another."""
PAIRS_TRIED = 8
"""First pairs that are tried; one wrong photograph spoils only its own."""
PAIR_ITERATIONS = 15
"""Steps by which an oriented pair is refined [C]: enough for the few from a five-point solution; the bound ends pairs
that run away."""
GOOD_PAIR = 4.0
"""Median miss of the rays of a pair, in tolerances, from which no better pair is sought."""
VERY_GOOD_PAIR = 1.0
"""Median miss, in tolerances, with which no other solution or pair is tried [C]: rays fit as well as they may."""
UNFIT = 6.0
"""Times the median over the photographs from which one's miss says that it does not belong."""


@dataclass(frozen=True, eq=False)
class FreeModel:
    """Photographs and points in a frame and scale of their own; NaN where they could not be joined.

    Parameters
    ----------
    centre : (n, 3). rotation : (n, 3, 3) camera → model. points : (N, 3).
    miss : (n,) median angular distance of a photograph's rays from their points, in tolerances of a ray.
    """

    centre: np.ndarray
    rotation: np.ndarray
    points: np.ndarray
    miss: np.ndarray

    @property
    def joined(self) -> np.ndarray:
        """(n,) bool."""
        return np.isfinite(self.centre[:, 0])

    @property
    def looking(self) -> np.ndarray:
        """(3,) median direction of view."""
        return -np.median(self.rotation[self.joined][:, :, 2], axis=0)

    def without(self, images: np.ndarray) -> FreeModel:
        """The model with some photographs taken out; the points stay."""
        centre, rotation, miss = self.centre.copy(), self.rotation.copy(), self.miss.copy()
        centre[images], rotation[images], miss[images] = np.nan, np.nan, np.nan
        return replace(self, centre=centre, rotation=rotation, miss=miss)

    def mirrored(self) -> FreeModel:
        """What the same photographs give with all x negated: the mirror image in x, cameras included."""
        mirror = np.diag([-1.0, 1.0, 1.0])
        return replace(
            self, centre=self.centre @ mirror, rotation=mirror @ self.rotation @ mirror, points=self.points @ mirror
        )

    def stretched(self, factor: float) -> FreeModel:
        """The model as vertical photographs give it with `factor` times the principal distance.

        Heights along the mean direction of view are multiplied by the factor, directions across it stay.
        """
        along = self.looking / np.linalg.norm(self.looking)
        stretch = np.eye(3) + (factor - 1.0) * np.outer(along, along)
        return replace(self, centre=self.centre @ stretch, points=self.points @ stretch)


def connected_parts(block: Block) -> list[np.ndarray]:
    """The photographs (indices) that hang together by common points, the largest part first.

    Photographs without image points belong to no part.
    """
    rays, n = block.image_points, len(block.images)
    there = np.isfinite(rays.xy).all(axis=1)
    image, point = rays.image[there], rays.point[there]
    graph = coo_array((np.ones(len(image)), (image, n + point)), shape=(n + len(block.points),) * 2)
    _, label = connected_components(graph, directed=False)
    seen = np.unique(image)
    parts = [seen[label[seen] == own] for own in np.unique(label[seen])]
    return sorted(parts, key=len, reverse=True)


def with_focal_factor(block: Block, factor: float) -> Block:
    """The block with the principal distances of all cameras multiplied."""
    cameras = []
    for camera in block.cameras:
        prior = camera.interior["focal_length_mm"]
        longer = replace(prior, value=prior.value * factor)
        cameras.append(replace(camera, interior={**camera.interior, "focal_length_mm": longer}))
    return replace(block, cameras=tuple(cameras))


def bare_block(block: Block) -> Block:
    """Cameras and image points only."""
    nothing = np.full((len(block.images), 3), np.nan)
    adjustment = replace(
        block.settings.adjustment, additional_parameters=(), datum="minimal", datum_points=(), datum_fixed=(),
        robust="off",
    )  # fmt: skip
    return replace(
        block,
        crs="local",
        images=replace(block.images, centre=nothing, angles=nothing.copy()),
        control=Control.empty(),
        gnss_ins=None,
        constraints=None,
        edits=None,
        settings=replace(block.settings, adjustment=adjustment),
    )


def free_model(block: Block) -> FreeModel | None:
    """The model of a block's image points; None where neither two photographs nor start values make a beginning.

    Photographs whose rays miss, or that see the ground from the other side, are taken out and the model grown again.
    """
    bare = bare_block(block)
    pair = _first_pair(bare)
    if pair is None:
        return _from_start_values(block, bare)
    (i, j), rotation, centre = pair
    model = _grown(bare, np.array([i, j]), rotation, centre)
    for _ in range(3):
        wrong = _unfit(model)
        if not len(wrong) or model.joined.sum() - len(wrong) < 2:
            break
        rows = np.flatnonzero(~np.isin(bare.image_points.image, wrong))
        rays = bare.image_points
        bare = replace(
            bare, image_points=ImagePoints(rays.image[rows], rays.point[rows], rays.xy[rows], rays.sigma[rows])
        )
        kept = np.setdiff1d(np.flatnonzero(model.joined), wrong)
        model = _grown(bare, kept, model.rotation[kept], model.centre[kept], again=True)
    return model


def _from_start_values(block: Block, bare: Block) -> FreeModel | None:
    """The model that start values of all photographs lead to; None where some are missing or the rays do not fit."""
    own = block.images
    if len(own) < 2 or not (np.isfinite(own.centre).all() and np.isfinite(own.angles).all()):
        return None
    rotation = rotation_from_angles(own.angles, block.rotation)
    model = _grown(bare, np.arange(len(own)), rotation, own.centre, again=True)
    return model if model.joined.all() and np.max(model.miss) < GOOD_PAIR and not len(_unfit(model)) else None


def _unfit(model: FreeModel) -> np.ndarray:
    """Photographs that do not belong into the model as they are."""
    joined = model.joined
    beyond = model.miss > max(UNFIT * float(np.median(model.miss[joined])), 1.0)
    with np.errstate(invalid="ignore"):
        from_below = model.rotation[:, :, 2] @ model.looking > 0.0
    return np.flatnonzero(joined & (beyond | from_below))


def _grown(bare: Block, images: np.ndarray, rotation: np.ndarray, centre: np.ndarray, again: bool = False) -> FreeModel:
    """The model that grows from photographs oriented already; `rotation` (k, 3, 3) and `centre` (k, 3) of `images`."""
    n = len(bare.images)
    centres, angles = np.full((n, 3), np.nan), np.full((n, 3), np.nan)
    scale = 1000.0 / max(float(np.linalg.norm(np.ptp(centre, axis=0))), 1e-12)
    centres[images], angles[images] = scale * centre, angles_from_rotation(rotation, bare.rotation)
    found = start_values(replace(bare, images=replace(bare.images, centre=centres, angles=angles)))
    turned, place, points = found.rotation, found.centre, found.points
    if again:
        points = np.full_like(points, np.nan)
        intersect_into(points, bare, directions_of(bare), turned, place)
        refine(bare, np.zeros(3), turned, place, points)
    return FreeModel(place, turned, points, _misses(bare, turned, place))


def _misses(block: Block, rotation: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """(n,) median distance of the rays of each photograph from their points, in tolerances; NaN without any."""
    rays, directions = block.image_points, directions_of(block)
    points = np.full((len(block.points), 3), np.nan)
    intersect_into(points, block, directions, rotation, centre)
    reach = points[rays.point] - centre[rays.image]
    own = np.einsum("mji,mj->mi", rotation[rays.image], reach)
    with np.errstate(invalid="ignore", divide="ignore"):
        miss = np.linalg.norm(-own[:, :2] / own[:, 2:] - directions.tangent, axis=1) / directions.tolerance
    miss[own[:, 2] >= 0.0] = np.inf
    found = np.full(len(block.images), np.nan)
    for image in np.flatnonzero(np.isfinite(centre[:, 0])):
        those = miss[(rays.image == image) & ~np.isnan(miss)]
        found[image] = np.median(those) if len(those) else np.inf
    return found


def _first_pair(bare: Block) -> tuple[tuple[int, int], np.ndarray, np.ndarray] | None:
    best = None
    for i, j in _likely_pairs(bare):
        found = _oriented_pair(bare, i, j)
        if found is not None and (best is None or found[0] < best[0]):
            best = (found[0], (i, j), found[1], found[2])
        if best is not None and best[0] < VERY_GOOD_PAIR:
            break
    return None if best is None or best[0] > GOOD_PAIR * RESECTION_TOLERANCES[0] else best[1:]


def _likely_pairs(block: Block) -> Iterator[tuple[int, int]]:
    """Pairs with many points in common; no photograph in more than two of them."""
    rays, n = block.image_points, len(block.images)
    seen = coo_array((np.ones(len(rays)), (rays.image, rays.point)), shape=(n, len(block.points))).tocsr()
    both = (seen @ seen.T).tocoo()
    upper = (both.row < both.col) & (both.data >= FEWEST_COMMON)
    row, col, count = both.row[upper], both.col[upper], both.data[upper]
    used, given = np.zeros(n, np.int64), 0
    for k in np.argsort(-count, kind="stable"):
        i, j = int(row[k]), int(col[k])
        if used[i] < 2 and used[j] < 2:
            used[[i, j]] += 1
            given += 1
            yield i, j
        if given >= PAIRS_TRIED:
            return


def sub_block(block: Block, images: np.ndarray, points: np.ndarray | None = None) -> tuple[Block, np.ndarray]:
    """A block of some photographs, and where their image points stand in the whole; points keep their index.

    Cameras on rigs count as independent ones: some photographs are not whole stations.

    Parameters
    ----------
    images : indices. points : (N,) bool, points that are kept; all where None.
    """
    number = np.full(len(block.images), -1)
    number[images] = np.arange(len(images))
    rays, own = block.image_points, block.images
    kept = number[rays.image] >= 0
    if points is not None:
        kept &= points[rays.point]
    rows = np.flatnonzero(kept)
    columns = {name: np.asarray(values)[images] for name, values in own.columns.items()}
    some = Images(
        own.names[images], own.camera[images], np.asarray(own.strip)[images], own.centre[images], own.angles[images],
        columns,
    )  # fmt: skip
    measured = ImagePoints(number[rays.image[rows]], rays.point[rows], rays.xy[rows], rays.sigma[rows])
    gnss = block.gnss_ins
    if gnss is not None:
        those = np.flatnonzero(number[gnss.image] >= 0)
        gnss = replace(
            gnss, image=number[gnss.image[those]], xyz=gnss.xyz[those], sigma=gnss.sigma[those],
            angles=gnss.angles[those], angles_sigma=gnss.angles_sigma[those], time=gnss.time[those],
        )  # fmt: skip
    fits = {int(number[k]): fit for k, fit in block.interior_fits.items() if number[k] >= 0}
    made = replace(
        block, images=some, image_points=measured, gnss_ins=gnss, fiducials=None, edits=None, interior_fits=fits,
        rigs=(),
    )  # fmt: skip
    return made, rows


def _oriented_pair(bare: Block, i: int, j: int) -> tuple[float, np.ndarray, np.ndarray] | None:
    """Median miss, rotations and centres of two photographs; vertical ones first, then whatever they are."""
    pair, _ = sub_block(bare, np.array([i, j]))
    twice = np.bincount(pair.image_points.point, minlength=len(pair.points)) == 2
    pair, _ = sub_block(pair, np.arange(2), twice)
    tangent = directions_of(pair).tangent
    first, second = (np.flatnonzero(pair.image_points.image == k) for k in range(2))
    first = first[np.argsort(pair.image_points.point[first])]
    second = second[np.argsort(pair.image_points.point[second])]
    if len(first) != len(second) or len(first) < FEWEST_COMMON:
        return None
    best = None
    for begin in (_vertical_pair, _essential_pair):
        begun = begin(tangent[first], tangent[second])
        if begun is None:
            continue
        rotation, centre = begun
        scale = 1000.0 / max(float(np.linalg.norm(centre[1] - centre[0])), 1e-9)
        centre = centre * scale
        points = np.full((len(pair.points), 3), np.nan)
        intersect_into(points, pair, directions_of(pair), rotation, centre)
        refine(pair, np.zeros(3), rotation, centre, points, PAIR_ITERATIONS)
        if not np.isfinite(centre).all():
            continue
        miss = float(np.max(_misses(pair, rotation, centre)))
        if best is None or miss < best[0]:
            best = (miss, rotation, centre)
        if miss < VERY_GOOD_PAIR:
            break
    return best


def _vertical_pair(first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Two vertical photographs over level ground at depth 1: a similarity in the plane, robust.

    Parameters
    ----------
    first, second : (k, 2) tangents, row by row the same point.
    """
    a, b = first @ [1.0, 1.0j], second @ [1.0, 1.0j]
    weight = np.ones(len(a))
    turn, mean_a, mean_b = 1.0 + 0.0j, 0.0j, 0.0j
    for _ in range(10):
        mean_a, mean_b = np.average(a, weights=weight), np.average(b, weights=weight)
        spread = np.sum(weight * np.abs(b - mean_b) ** 2)
        if not spread > 0.0:
            return None
        turn = np.sum(weight * (a - mean_a) * np.conj(b - mean_b)) / spread
        miss = np.abs(a - mean_a - turn * (b - mean_b))
        weight = 1.0 / (1.0 + (miss / max(float(np.median(miss)), 1e-9)) ** 2)
    shift, kappa = mean_a - turn * mean_b, float(np.angle(turn))
    cos, sin = np.cos(kappa), np.sin(kappa)
    rotation = np.stack([np.eye(3), np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])])
    return rotation, np.array([[0.0, 0.0, 0.0], [shift.real, shift.imag, np.abs(turn) - 1.0]])


def _essential_pair(first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Two photographs in any attitude, by their essential matrix (OpenCV)."""
    import cv2

    a, b = (np.ascontiguousarray(tangent * [1000.0, -1000.0]) for tangent in (first, second))
    cv2.setRNGSeed(1)
    camera = np.diag([1000.0, 1000.0, 1.0])
    essential, inlier = cv2.findEssentialMat(a, b, camera, method=cv2.LMEDS, prob=0.999)
    # OpenCV's types leave out that nothing may be found
    if essential is None or essential.shape != (3, 3):  # pyright: ignore[reportUnnecessaryComparison]
        return None
    _, turn, shift, _ = cv2.recoverPose(essential, a, b, camera, mask=inlier)
    flip = OPENCV_FROM_CAMERA
    rotation = np.stack([np.eye(3), flip @ turn.T @ flip])
    return rotation, np.stack([np.zeros(3), flip @ (-turn.T @ shift.ravel())])
