"""Start values of blocks with rigs: stations from the reference camera, the other cameras by their mountings.

Stated angles of a mounting may be 10° off. Photographs of the other cameras that see enough points of the reference
camera are resected; the robust mean of what they say of the mounting takes the place of the stated angles. Where
neither is there the tie points of a camera tell how it is turned (`mounting_search`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerotri.adjustment.directions import Directions, directions_of
from aerotri.adjustment.mounting_search import Stations, ground_of, search_mounting
from aerotri.adjustment.rigging import relative_rotations, robust_mean
from aerotri.adjustment.start_values import (
    RESECTION_TOLERANCES,
    intersect_into,
    resect_into,
    start_values,
)
from aerotri.adjustment.unknowns import StartValues
from aerotri.functional_model.rotation import angles_from_rotation, logarithm, rotation_from_angles
from aerotri.observations import Block
from aerotri.observations.rigs import StationPlaces, station_places

RESECTED = 60
"""Photographs of a camera that are resected, those with most points."""
ALIKE = np.radians(3.0)
"""Rotations that belong together; as many as FEWEST of them tell a mounting."""
FEWEST = 3


def rig_start_values(block: Block, given_points: np.ndarray | None = None) -> StartValues:
    """As `start_values`, with the photographs of rigs placed at their stations.

    Orientations that are given stay. Rigs that are off tell the start all the same. Of a station the reference camera
    is oriented first, or a camera that is given.
    """
    places = station_places(block, off_too=True)
    if not places:
        return start_values(block, given_points)
    own = _given(block)
    if not own[places.lead].all():
        block = _with_stations(block, places, given_points)
    return start_values(_with_followers(block, places), given_points)


def _given(block: Block) -> np.ndarray:
    """(n,) bool, photographs with an orientation."""
    both = np.hstack([block.images.centre, block.images.angles])
    return np.asarray(np.isfinite(both).all(axis=1))


def _with_stations(block: Block, places: StationPlaces, given_points: np.ndarray | None) -> Block:
    """The block with its reference photographs oriented: by others of their station, or by themselves."""
    given, rotation = _given(block), rotation_from_angles(np.nan_to_num(block.images.angles), block.rotation)
    centre, angles = block.images.centre.copy(), block.images.angles.copy()
    for k, (rig, camera) in enumerate(places.mountings):
        mounting = rig.cameras[camera]
        rows = np.flatnonzero((places.mounting == k) & given & ~given[places.lead])
        if mounting.known and len(rows):
            position, turn = _stated(block, places, k)
            at = rotation[rows] @ turn.T
            centre[places.lead[rows]] = centre[rows] - at @ position
            angles[places.lead[rows]] = angles_from_rotation(at, block.rotation)
    block = replace(block, images=replace(block.images, centre=centre, angles=angles))
    if _given(block)[places.lead].any():
        return block
    alone = start_values(without_followers(block, places), given_points)
    centre, rotation = alone.centre + alone.origin, alone.rotation
    angles = angles_from_rotation(rotation, block.rotation)
    return replace(block, images=replace(block.images, centre=centre, angles=angles))


def without_followers(block: Block, places: StationPlaces) -> Block:
    """The block without image points, positions and start values of the photographs that follow others."""
    rays, gnss, leads = block.image_points, block.gnss_ins, places.mounting < 0
    kept = leads[rays.image]
    rays = replace(rays, image=rays.image[kept], point=rays.point[kept], xy=rays.xy[kept], sigma=rays.sigma[kept])
    centre = np.where(leads[:, None], block.images.centre, np.nan)
    if gnss is not None:
        rows = np.flatnonzero(leads[gnss.image])
        parts = {name: getattr(gnss, name)[rows] for name in gnss.__dataclass_fields__}
        gnss = type(gnss)(**parts)
    return replace(block, image_points=rays, gnss_ins=gnss, images=replace(block.images, centre=centre))


def _with_followers(block: Block, places: StationPlaces) -> Block:
    """The block with the photographs that have no orientation placed by their station and mounting."""
    given, rotation = _given(block), rotation_from_angles(np.nan_to_num(block.images.angles), block.rotation)
    rows = np.flatnonzero((places.mounting >= 0) & ~given & given[places.lead])
    if not len(rows):
        return block
    centre, angles = block.images.centre.copy(), block.images.angles.copy()
    for k in range(len(places.mountings)):
        own = rows[places.mounting[rows] == k]
        found = _turn(block, places, k, given, rotation) if len(own) else None
        if found is None:
            continue
        position, turn = found
        at = places.lead[own]
        centre[own] = centre[at] + rotation[at] @ position
        angles[own] = angles_from_rotation(rotation[at] @ turn, block.rotation)
    return replace(block, images=replace(block.images, centre=centre, angles=angles))


def _stated(block: Block, places: StationPlaces, k: int) -> tuple[np.ndarray, np.ndarray]:
    rig, camera = places.mountings[k]
    values = np.array([prior.value for prior in rig.cameras[camera].elements])
    return values[:3], rotation_from_angles(values[3:], block.rotation)


def _turn(
    block: Block, places: StationPlaces, k: int, given: np.ndarray, rotation: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """Position and rotation of a mounting: of photographs that are oriented, or resected, or as stated."""
    rig, camera = places.mountings[k]
    position, turn = _stated(block, places, k)
    mounting = rig.cameras[camera]
    if all(prior.fixed for prior in mounting.rotation):
        return position, turn
    own = np.where(given[:, None, None], rotation, np.nan)
    relative = relative_rotations(places.lead, np.where(places.mounting == k, 0, -1), own, 1)[0]
    if not len(relative):
        relative = _resected(block, places, k, given, rotation)
    mean = _agreed(relative)
    if mean is None and not mounting.known:
        mean = _searched(block, places, k, given, rotation)
    if mean is None:
        return (position, turn) if mounting.known else None
    return position, mean


def _agreed(relative: np.ndarray) -> np.ndarray | None:
    """(3, 3) the mean of rotations of which most agree; None where they do not."""
    if not len(relative):
        return None
    mean = robust_mean(relative)
    alike = np.linalg.norm(logarithm(relative @ mean.T), axis=1) < ALIKE
    enough = alike.sum() >= min(FEWEST, len(relative)) and alike.mean() > 0.5
    return robust_mean(relative[alike]) if enough else None


def _searched(
    block: Block, places: StationPlaces, k: int, given: np.ndarray, rotation: np.ndarray
) -> np.ndarray | None:
    """(3, 3) the rotation of a mounting that its tie points tell where nothing else does."""
    centre, turned, points, directions = _intersected(block, given, rotation)
    ground = ground_of(points, centre)
    if ground is None:
        return None
    follows = (places.mounting == k) & given[places.lead]
    return search_mounting(block, directions, Stations(np.where(follows, places.lead, -1), centre, turned), ground)


def _intersected(
    block: Block, given: np.ndarray, rotation: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, Directions]:
    """Of the oriented photographs, about their middle: centres (n, 3), rotations (n, 3, 3), points (N, 3), rays."""
    directions = directions_of(block)
    origin = np.nanmean(block.images.centre[given], axis=0)
    centre = np.where(given[:, None], block.images.centre - origin, np.nan)
    turned = np.where(given[:, None, None], rotation, np.nan)
    points = np.full((len(block.points), 3), np.nan)
    intersect_into(points, block, directions, turned, centre)
    return centre, turned, points, directions


def _resected(block: Block, places: StationPlaces, k: int, given: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """(·, 3, 3) what resection of some photographs from the points of the oriented ones says of a mounting."""
    centre, turned, points, _ = _intersected(block, given, rotation)
    seen = np.isfinite(points[block.image_points.point, 0])
    count = np.bincount(block.image_points.image[seen], minlength=len(given))
    rows = np.flatnonzero((places.mounting == k) & ~given & given[places.lead])
    rows = rows[np.argsort(-count[rows], kind="stable")][:RESECTED]
    # only those are left without an orientation
    rays = block.image_points
    kept = np.isin(rays.image, rows)
    some = replace(rays, image=rays.image[kept], point=rays.point[kept], xy=rays.xy[kept], sigma=rays.sigma[kept])
    few = replace(block, image_points=some)
    for tolerance in RESECTION_TOLERANCES:
        resect_into(turned, centre, points, few, directions_of(few), tolerance)
    found = np.where(np.isin(np.arange(len(given)), rows), 0, -1)
    return relative_rotations(places.lead, found, turned, 1)[0]
