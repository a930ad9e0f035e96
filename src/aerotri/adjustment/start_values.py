"""Start values: orientations that are given, spatial resection from known points, robust forward intersection.

Beginning with the photographs whose orientation is given or can be resected from control points, points are intersected
and further photographs resected from them, until nothing is added.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerotri.adjustment import _intersection_kernels
from aerotri.adjustment.directions import Directions, directions_of
from aerotri.adjustment.ray_status import RayStatus, ray_status
from aerotri.adjustment.solve import SolveOptions, minimise
from aerotri.adjustment.system import build_system
from aerotri.adjustment.track import AXIS_ANGLE, headings, order_of_exposure, strips_of_track, vertical_rotations
from aerotri.adjustment.unknowns import StartValues
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations import Block, Control, GnssIns, GnssSettings, Prior

MIN_RESECTION_POINTS = 4
"""Points a photograph is resected from: three give up to four solutions, the fourth chooses [L: AP3P]."""
RESECTION_TOLERANCES = (8.0, 40.0)
"""Reprojection errors a ray may have in a resection, in a-priori σ or pixels; the second as last resort."""
MIN_INTERSECTION = 1e-6
"""Smallest eigenvalue of the intersection's normal matrix per ray: sin² of half the angle, about 0.1°."""
MIN_TRACK = 6
"""Projection centres from which a direction of flight is taken."""
LOOSE_CENTRE = 0.01
"""σ of a projection centre while start values are sought, as a share of the flying height."""
TRACK_ITERATIONS = 20
"""Iterations of the adjustment that refines vertical photographs."""
HELD_TRACK_ITERATIONS = 30
"""The same with the cameras held, where they ran away."""
TRACK_TOLERANCE = 20.0
"""Median miss of the rays, in tolerances, beyond which the track was no track."""
OPENCV_FROM_CAMERA = np.diag([1.0, -1.0, -1.0])
"""From axes with z up, against the viewing direction, to those of OpenCV with y down and z in viewing direction."""


def local_origin(block: Block) -> np.ndarray:
    """(3,) m, whole metres near the middle of what is known in the object frame."""
    for xyz in (block.control.xyz, None if block.gnss_ins is None else block.gnss_ins.xyz, block.images.centre):
        if xyz is not None and np.isfinite(xyz).any():
            known = [column[np.isfinite(column)] for column in xyz.T]
            return np.array([np.round(column.mean()) if len(column) else 0.0 for column in known])
    return np.zeros(3)


def start_values(block: Block, given_points: np.ndarray | None = None) -> StartValues:
    """Start values of photographs and points; NaN where none could be found.

    Parameters
    ----------
    given_points : (N, 3) m, start values of points where known from elsewhere.
    """
    origin = local_origin(block)
    directions = directions_of(block)
    centre = block.images.centre - origin
    oriented = np.isfinite(centre).all(axis=1) & np.isfinite(block.images.angles).all(axis=1)
    rotation = np.full((len(block.images), 3, 3), np.nan)
    rotation[oriented] = rotation_from_angles(block.images.angles[oriented], block.rotation)
    known = _full_control(block, origin)
    points = known.copy()
    observed = _observed_centres(block, centre, origin)
    centre[~oriented] = np.nan
    if not oriented.any() and np.isfinite(observed[:, 0]).sum() >= MIN_TRACK:
        points = _orient_along_track(block, origin, directions, observed, rotation, centre, known)
    for tolerance in RESECTION_TOLERANCES:
        while True:
            intersect_into(points, block, directions, rotation, centre)
            if not resect_into(rotation, centre, points, block, directions, tolerance):
                break
            points = known.copy()
            intersect_into(points, block, directions, rotation, centre)
            refine(block, origin, rotation, centre, points)
    if given_points is not None:
        there = np.isfinite(given_points).all(axis=1)
        points[there] = given_points[there] - origin
    return StartValues(origin, rotation, centre, points)


def given_start(block: Block, origin: np.ndarray) -> StartValues:
    """Start values of a block whose photographs all are oriented; points by forward intersection.

    Parameters
    ----------
    origin : (3,) m, the local origin.
    """
    rotation, centre = rotation_from_angles(block.images.angles, block.rotation), block.images.centre - origin
    points = _full_control(block, origin)
    intersect_into(points, block, directions_of(block), rotation, centre)
    return StartValues(origin, rotation, centre, points)


def _observed_centres(block: Block, centre: np.ndarray, origin: np.ndarray) -> np.ndarray:
    """(n, 3) m, projection centres given or observed by GNSS, local; NaN where neither."""
    observed = centre.copy()
    if block.gnss_ins is not None:
        rows = block.gnss_ins.image
        missing = ~np.isfinite(observed[rows]).all(axis=1)
        observed[rows[missing]] = block.gnss_ins.xyz[missing] - origin
    observed[~np.isfinite(observed).all(axis=1)] = np.nan
    return observed


def _orient_along_track(
    block: Block,
    origin: np.ndarray,
    directions: Directions,
    observed: np.ndarray,
    rotation: np.ndarray,
    centre: np.ndarray,
    known: np.ndarray,
) -> np.ndarray:
    """Vertical photographs along the track, refined with the centres as observations; the points they intersect."""
    there = np.flatnonzero(np.isfinite(observed[:, 0]))
    time = _times(block)[there]
    names, strips = np.asarray(block.images.names)[there], np.asarray(block.images.strip)[there]
    order = order_of_exposure(observed[there], strips, names, time)
    there = there[order]
    strip = strips_of_track(observed[there], strips[order])
    heading = headings(observed[there], strip)
    stated = [block.cameras[c].flight_axis for c in block.images.camera[there]]
    best = None
    for axis in AXIS_ANGLE if any(a is None for a in stated) else ("+y",):
        axes = np.array([a or axis for a in stated])
        trial = np.full_like(rotation, np.nan)
        trial[there] = vertical_rotations(heading, axes)
        if not np.isfinite(time).all():
            _turn_strips(trial, block, directions, observed, there, strip)
        points = np.full_like(known, np.nan)
        miss = intersect_into(points, block, directions, trial, observed)
        if best is None or miss < best[0]:
            best = (miss, trial, points)
    if best is None:
        return known.copy()
    height = float(np.nanmedian(observed[:, 2]) - np.nanmedian(best[2][:, 2]))
    centres = loose_centres(block, observed + origin, LOOSE_CENTRE * max(abs(height), 1.0))
    # far from the solution a free camera may run away: where it has, it is held
    for tried, iterations in ((block, TRACK_ITERATIONS), (with_held_cameras(block), HELD_TRACK_ITERATIONS)):
        rotation[:], points = best[1], best[2].copy()
        centre[there] = observed[there]
        refine(tried, origin, rotation, centre, points, iterations, centres)
        miss = intersect_into(known.copy(), block, directions, rotation, centre)
        if miss < TRACK_TOLERANCE * np.median(directions.tolerance):
            return points
    rotation[:], centre[:] = np.nan, np.nan
    return known.copy()


def with_held_cameras(block: Block) -> Block:
    """The block with the interior orientation of its cameras held at what was stated."""
    held = [{k: Prior(p.value, fixed=True) for k, p in camera.interior.items()} for camera in block.cameras]
    return replace(block, cameras=tuple(replace(c, interior=h) for c, h in zip(block.cameras, held, strict=True)))


def _times(block: Block) -> np.ndarray:
    """(n,) s, times of exposure; NaN where not given."""
    time = np.full(len(block.images), np.nan)
    if block.gnss_ins is not None:
        time[block.gnss_ins.image] = block.gnss_ins.time
    return time


def _turn_strips(
    trial: np.ndarray, block: Block, directions: Directions, observed: np.ndarray, there: np.ndarray, strip: np.ndarray
) -> None:
    """Strips flown the other way round than taken: those whose own rays meet better with the photographs turned.

    Parameters
    ----------
    trial : (n, 3, 3) rotations, changed in place. there, strip : (k,) photographs and the strip of each.
    """
    of_image = np.full(len(block.images), -1)
    of_image[there] = strip
    turned = trial.copy()
    turned[there] = trial[there] @ np.diag([-1.0, -1.0, 1.0])
    missed = [_miss_by_strip(block, directions, rotation, observed, of_image) for rotation in (trial, turned)]
    wrong = there[missed[1][strip] < missed[0][strip]]
    trial[wrong] = turned[wrong]


def _miss_by_strip(
    block: Block, directions: Directions, rotation: np.ndarray, centre: np.ndarray, of_image: np.ndarray
) -> np.ndarray:
    """(strips,) rad, median angular distance of rays from the points that the strip's photographs alone give."""
    rays = block.image_points
    strips = int(of_image.max()) + 1
    use = of_image[rays.image] >= 0
    strip = of_image[rays.image[use]]
    pair, point = np.unique(rays.point[use] * strips + strip, return_inverse=True)
    image, tangent = rays.image[use], directions.tangent[use]
    _, miss = rays_meet(len(pair), point, rotation[image], centre[image], tangent, directions.tolerance[use])
    # a point in one photograph of the strip says nothing
    tells = np.bincount(point, minlength=len(pair))[point] > 1
    own = [miss[tells & (strip == k)] for k in range(strips)]
    return np.array([np.median(of_strip) if len(of_strip) else 0.0 for of_strip in own])


def rays_meet(
    count: int, point: np.ndarray, rotation: np.ndarray, centre: np.ndarray, tangent: np.ndarray, tolerance: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Points (count, 3) where rays meet, and the angular distance (m,) rad of each ray, π where there is no point."""
    ray = np.einsum("mij,mj->mi", rotation, np.column_stack([tangent, -np.ones(len(tangent))]))
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    found = intersect(count, point, centre, ray, tolerance)
    reach = found[point] - centre
    with np.errstate(invalid="ignore"):
        along = np.einsum("mi,mi->m", reach, ray) / np.linalg.norm(reach, axis=1)
    return found, np.where(np.isfinite(along), np.arccos(np.clip(along, -1.0, 1.0)), np.pi)


def loose_centres(block: Block, observed: np.ndarray, sigma_m: float) -> GnssIns:
    """The centres as observations that hold the block without forcing it; `observed` (n, 3) m."""
    rows = np.flatnonzero(np.isfinite(observed[:, 0]))
    nothing = np.full((len(rows), 3), np.nan)
    return GnssIns(rows, observed[rows], np.full((len(rows), 3), sigma_m), nothing, nothing, nothing[:, 0])


def refine(
    block: Block,
    origin: np.ndarray,
    rotation: np.ndarray,
    centre: np.ndarray,
    points: np.ndarray,
    iterations: int = 6,
    centres: GnssIns | None = None,
) -> None:
    """A short robust adjustment of what is oriented so far, in place, so that errors do not grow along a strip.

    Without additional parameters; in the datum of `centres` where they are given, of the control where there is enough
    of it, else of seven coordinates.
    """
    start = StartValues(origin, rotation, centre, points)
    controlled = int(np.isfinite(points[block.control.point[~block.control.is_check], 0]).sum()) >= MIN_RESECTION_POINTS
    datums = ("control", "minimal") if controlled else ("minimal",)
    for datum in datums if centres is None else ("control",):
        settings = replace(block.settings.adjustment, additional_parameters=(), datum=datum, datum_points=())
        bare = replace(
            block,
            # what a rolling shutter does to start values does not matter, and its motion is not known yet
            cameras=tuple(replace(camera, rolling_shutter=None) for camera in block.cameras),
            gnss_ins=centres,
            control=block.control if centres is None else Control.empty(),
            settings=replace(block.settings, adjustment=settings, gnss=GnssSettings(shift="off")),
        )
        status, _ = ray_status(bare, start)
        if (status == RayStatus.USED).sum() < 10:
            return
        system, state = build_system(bare, start, status)
        redundancy = max(2 * int((status == RayStatus.USED).sum()) - system.unknowns.count, 1)
        solution = minimise(system, state, redundancy, SolveOptions(iterations, "huber"))
        if not solution.defects:
            break
    else:
        return
    u = system.unknowns
    rotation[u.images], centre[u.images], points[u.points] = (
        solution.state.rotation, solution.state.centre, solution.state.points,
    )  # fmt: skip


def _full_control(block: Block, origin: np.ndarray) -> np.ndarray:
    points = np.full((len(block.points), 3), np.nan)
    control = block.control
    usable = ~control.is_check & np.isfinite(control.xyz).all(axis=1)
    if block.settings.adjustment.datum in ("control", "inner", "minimal"):
        points[control.point[usable]] = control.xyz[usable] - origin
    return points


def intersect_into(
    points: np.ndarray, block: Block, directions: Directions, rotation: np.ndarray, centre: np.ndarray
) -> float:
    """Intersect every point from the oriented photographs; points that cannot be keep what they have.

    Returns the median angular distance (rad) of rays from their points, π where a point could not be had.
    """
    rays = block.image_points
    use = np.isfinite(centre[rays.image, 0])
    image, point = rays.image[use], rays.point[use]
    found, miss = rays_meet(
        len(points), point, rotation[image], centre[image], directions.tangent[use], directions.tolerance[use]
    )
    there = np.isfinite(found).all(axis=1)
    points[there] = found[there]
    return float(np.median(miss)) if len(miss) else np.pi


def intersect(
    n_points: int, point: np.ndarray, centre: np.ndarray, ray: np.ndarray, tolerance: np.ndarray
) -> np.ndarray:
    """Robust forward intersection: the point nearest to its rays, with re-weighting by their angular distance.

    Parameters
    ----------
    point : (m,) which point each ray belongs to. centre : (m, 3) m. ray : (m, 3) unit vectors.
    tolerance : (m,) rad, distance below which a ray has full weight.

    Returns
    -------
    (n_points, 3) m, NaN where fewer than two rays meet or they meet under too small an angle or behind the camera.
    """
    order = np.argsort(point, kind="stable")
    start = np.concatenate([[0], np.cumsum(np.bincount(point, minlength=n_points))]).astype(np.int64)
    xyz = np.empty((n_points, 3))
    arrays = (np.ascontiguousarray(a[order]) for a in (centre, ray, tolerance))
    _intersection_kernels.intersect_points(start, *arrays, MIN_INTERSECTION, xyz)
    return xyz


def resect_into(
    rotation: np.ndarray, centre: np.ndarray, points: np.ndarray, block: Block, directions: Directions, tolerance: float
) -> bool:
    """Resect photographs that see enough known points, those that see most of them first; whether any was added."""
    rays = block.image_points
    usable = np.isfinite(points[rays.point, 0]) & ~np.isfinite(centre[rays.image, 0])
    rows = np.flatnonzero(usable)
    if not len(rows):
        return False
    rows = rows[np.argsort(rays.image[rows], kind="stable")]
    images, first, counts = np.unique(rays.image[rows], return_index=True, return_counts=True)
    enough = max(MIN_RESECTION_POINTS, int(0.5 * counts.max())) if counts.max() > 12 else MIN_RESECTION_POINTS
    added = False
    for image, begin, count in zip(images, first, counts, strict=True):
        if count < enough:
            continue
        own = rows[begin : begin + count]
        # random sampling draws by place: the same rays in other rows have to give the same
        own = own[np.lexsort(directions.tangent[own].T)]
        pose = resect(
            points[rays.point[own]], directions.tangent[own], tolerance * float(np.median(directions.tolerance[own]))
        )
        if pose is not None:
            rotation[image], centre[image] = pose
            added = True
    return added


def resect(points: np.ndarray, tangent: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Spatial resection of one photograph, robust by random sampling of minimal sets (OpenCV).

    Parameters
    ----------
    points : (k, 3) m. tangent : (k, 2) direction tangents in the camera frame.
    tolerance : largest reprojection error of a ray that counts as good, as a tangent.

    Returns
    -------
    Rotation (3, 3) camera → object and centre (3,), or None where too few rays agree.
    """
    import cv2

    shift = points.mean(axis=0)
    scale = np.abs(points - shift).max() or 1.0
    reduced = np.ascontiguousarray((points - shift) / scale)
    # OpenCV's frame: y down, z forward; tolerances below 1e-4 suffer from its single-precision parts, so scale to 1000
    focal = 1000.0
    image = np.ascontiguousarray(tangent * [focal, -focal])
    matrix = np.diag([focal, focal, 1.0])
    cv2.setRNGSeed(1)
    found, rotation_vector, translation, inliers = cv2.solvePnPRansac(
        reduced, image, matrix, None, iterationsCount=300, reprojectionError=tolerance * focal, confidence=0.9999,
        flags=cv2.SOLVEPNP_AP3P,
    )  # fmt: skip
    # OpenCV's types leave out that nothing may be found
    if not found or inliers is None or len(inliers) < max(MIN_RESECTION_POINTS, 0.4 * len(points)):  # pyright: ignore[reportUnnecessaryComparison]
        return None
    good = np.asarray(inliers, dtype=np.int64).ravel()
    if len(good) >= 6:
        rotation_vector, translation = cv2.solvePnPRefineLM(
            reduced[good], image[good], matrix, None, rotation_vector, translation
        )
    turned, _ = cv2.Rodrigues(rotation_vector)
    rotation = turned.T @ OPENCV_FROM_CAMERA
    centre = -turned.T @ translation.ravel() * scale + shift
    in_front = ((points - centre) @ rotation)[:, 2] < 0.0
    return (rotation, centre) if in_front.mean() > 0.5 and np.isfinite(rotation).all() else None
