"""What the adjustments of two epochs bring into distances of their point clouds, with what they have in common.

[D] A distance along n is n·(P₂ − P₁). What an adjustment does to it is what it does to a point measured there; one
adjustment counts by the difference of both points, control and camera that two have in common by their covariance, as
in `adjusted`. Such errors change slowly over the ground, normals do not: the (3, 3) covariance of
P₂ − P₁ is found at some places and its elements are linear between them, nᵀCn then tells every distance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import KDTree

from aerotri.conventions import InputError
from aerotri.deformation.restitution import Restitution, restitution_of
from aerotri.rasters.between_places import between_places, spread_places
from aerotri.results.adjustment import Adjustment
from aerotri.statistics.camera_field import known_field
from aerotri.statistics.image_sigma import image_sigma_of_cameras
from aerotri.terrain.adjustment_part import ELEMENTS, change_covariances, covariances_at, solved_partials
from aerotri.volume.change.adjusted import in_common
from aerotri.volume.change.clouds import Cloud, CloudDistances, quadratic
from aerotri.volume.parts import Measured, Part
from aerotri.volume.pickets import Pickets, pickets_where_seen
from aerotri.volume.response import respond
from aerotri.volume.settings import PER_POINT
from aerotri.volume.shared import same_adjustment, shared_covariances

PLACES = 6
"""Places along a side at which covariances are found [C]: deformations of a block change over tenths of a model."""
NAMES = ("the first cloud", "the second cloud")
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class AdjustedDistances:
    """What the adjustments bring to distances.

    Parameters
    ----------
    difference : (k,) m², to a distance. alone : (k, 2) m², to the place of either cloud along the normal.
    words : what both have in common.
    """

    difference: np.ndarray
    alone: np.ndarray
    words: str


def adjusted_distances(
    found: CloudDistances, clouds: tuple[Cloud, Cloud], calibrations: tuple[Adjustment, Adjustment]
) -> AdjustedDistances:
    """The adjustments' parts of the variances of distances.

    Raises
    ------
    InputError
        When no two photographs of an adjustment see its cloud from different places.
    """
    rows = _places(found)
    first, second = found.core[rows], found.core[rows] + found.distance[rows, None] * found.normal[rows]
    epochs = [_measured(*one) for one in zip((first, second), clouds, calibrations, NAMES, strict=True)]
    seen = epochs[0][1] & epochs[1][1]
    if not seen.any():
        raise InputError("no place of the clouds is seen in both adjustments", "check which result belongs to which")
    # the points of a cloud that its adjustment sees are counted without those that it does not
    pickets = [of_epoch.take((np.cumsum(own) - 1)[seen]) for of_epoch, own in epochs]
    one, two = (
        _part(calibration, own.take(np.array([0])), UP) for calibration, own in zip(calibrations, pickets, strict=True)
    )
    elements = [part[:, *ELEMENTS] for part in _covariances(one, two, pickets)]
    covariance = between_places(found.core[rows][seen, :2], np.concatenate(elements, axis=1), found.core[:, :2])
    words = in_common(one, two, NAMES)
    difference, *own = (quadratic(part, found.normal) for part in np.split(covariance, 3, axis=1))
    return AdjustedDistances(np.maximum(difference, 0.0), np.maximum(np.stack(own, axis=1), 0.0), words)


def _covariances(one: Part, two: Part, pickets: Sequence[Pickets]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(n, 3, 3) m² of second less first places, and of either, by adjustments; pickets of the n places of either."""
    calibrations = one.calibration, two.calibration
    sides = [_side(calibration, own) for calibration, own in zip(calibrations, pickets, strict=True)]
    first, second = (covariances_at(*side) for side in sides)
    if same_adjustment(one, two):
        (calibration, restitution, rows, xyz, seen), (*_, other, seen_there) = sides
        joint = change_covariances(calibration, restitution, rows, (xyz, other), (seen, seen_there))
        return joint, first, second
    solved = [solved_partials(*side) for side in sides]
    both = shared_covariances(calibrations, (solved[0], solved[1]))
    return first + second - both - np.swapaxes(both, 1, 2), first, second


def _side(
    calibration: Adjustment, pickets: Pickets
) -> tuple[Adjustment, Restitution, np.ndarray, np.ndarray, np.ndarray]:
    """What `covariances_at` asks for."""
    restitution = replace(restitution_of(calibration), left=known_field(calibration))
    place = np.repeat(np.arange(len(pickets)), np.diff(pickets.start))
    seen = np.full((len(pickets), int(np.diff(pickets.start).max())), -1)
    seen[place, np.arange(len(place)) - pickets.start[place]] = pickets.image
    return calibration, restitution, np.arange(len(calibration.local.block.images)), pickets.xyz, seen


def with_adjustments(found: CloudDistances, clouds: tuple[Cloud, Cloud], adjusted: AdjustedDistances) -> CloudDistances:
    """Distances whose σ knows both adjustments.

    What each cloud has for itself is its noise of matching; where that is not known apart, what its covariances have
    beyond the adjustment; of a cloud without σ what follows from its scatter.
    """
    own = np.zeros(len(found.core))
    for k, cloud in enumerate(clouds):
        left = found.variance[:, k]
        if cloud.matching is not None:
            left = found.noise[:, k]
        elif cloud.covariance is not None:
            left = np.maximum(found.variance[:, k] - adjusted.alone[:, k], 0.0)
        own += left
    return found.with_variances(own + adjusted.difference)


def _places(found: CloudDistances) -> np.ndarray:
    """Rows of places with a distance, spread over all of them in plan."""
    rows = np.flatnonzero(np.isfinite(found.distance))
    return rows[spread_places(found.core[rows, :2], (PLACES, PLACES))]


def _measured(xyz: np.ndarray, cloud: Cloud, calibration: Adjustment, name: str) -> tuple[Pickets, np.ndarray]:
    """Points (p, 3) as measured in photographs of an adjustment, and which of them are seen (p,)."""
    per_point: int | np.ndarray = PER_POINT
    if cloud.photographs is not None:
        per_point = cloud.photographs[KDTree(cloud.xyz).query(xyz)[1]].astype(np.int64)
    pickets, seen = pickets_where_seen(calibration, xyz, image_sigma_of_cameras(calibration), per_point)
    if not seen.any():
        raise InputError(
            f"no two photographs of its adjustment see {name} from different places",
            "check which result belongs to it",
        )
    return pickets, seen


def _part(calibration: Adjustment, picket: Pickets, direction: np.ndarray) -> Part:
    """The share of one point along a direction (3,)."""
    gradient = direction[None]
    response = respond(calibration, picket, gradient)
    return Part(calibration, response, None, 1, len(picket.image), 0.0, Measured(picket, gradient))
