"""A block put together from parts: image points, orientations, positions, and what the user states.

Every function takes a `Reading` and gives one with more in it; messages say what was matched, assumed or left out.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.track import exposure_times
from aerotri.conventions import FilePath, InputError, counted, mm_from_px
from aerotri.crs_text import plan_of, refuse_other_system
from aerotri.formats.assembly import placing
from aerotri.formats.assembly.by_stamps import named_by_stamps
from aerotri.formats.assembly.names_match import match_photographs
from aerotri.formats.assembly.parts import OrientationList, PositionList, RayList, Reading, no_sigma
from aerotri.formats.assembly.reprojection import settle
from aerotri.formats.text.notes import assumed, left_behind, taken
from aerotri.formats.text.sigmas import refuse_stated
from aerotri.functional_model.rotation import angles_from_rotation
from aerotri.observations import Block, Camera, GnssIns, ImagePoints, Images
from aerotri.observations.names import in_words

OUTSIDE = 0.05
"""Part of the format by which an image point may lie outside of it."""


@dataclass(frozen=True)
class Statements:
    """What the user states because the files do not.

    Parameters
    ----------
    crs : of the block, '' where the files tell.
    geoid : grid for heights of that CRS, where PROJ does not have it.
    control_sigma_m, positions_sigma_m : (X, Y, Z), for points and photographs without their own.
    orientation_sigma_m, orientation_sigma_deg : (X, Y, Z) and (ω, φ, κ), where orientations are to be observations
        beside start values; None: they are not.
    control_prefix : stands before the names of control points in the files of image points, or in their own list.
    control_heights : 'crs', or 'ellipsoidal' where the list has those and the block others.
    linear_alteration_m : mean height of the ground where heights of orientations are corrected for the scale of the
        projection; None where they are not.
    patb_rotation : meaning of the matrices of an .ori file, see `patb.ROTATIONS`.
    axes : 'xy' or 'yx', the order of coordinates in lists that do not name them; None: as the system has them.
    columns : of such a list, see `list_header.stated_columns`: of the control points, of positions where there are
        none.
    """

    crs: str = ""
    geoid: FilePath | None = None
    control_sigma_m: tuple[float, float, float] | None = None
    positions_sigma_m: tuple[float, float, float] | None = None
    orientation_sigma_m: tuple[float, float, float] | None = None
    orientation_sigma_deg: tuple[float, float, float] | None = None
    control_prefix: str = ""
    control_heights: str = "crs"
    linear_alteration_m: float | None = None
    patb_rotation: str | None = None
    axes: str | None = None
    columns: str = ""

    def __post_init__(self) -> None:
        for name in ("control_sigma_m", "positions_sigma_m", "orientation_sigma_m"):
            option = f"--{name.replace('_', '-')}"
            refuse_stated(getattr(self, name), option, may_be_zero=name == "control_sigma_m")


def with_crs(reading: Reading, crs: str, geoid: FilePath | None = None) -> Reading:
    """The block in the CRS that was stated or that a file names; a block that has one already keeps it.

    A local block with a known origin is brought there.

    Raises
    ------
    InputError
        When there is no such system, or the block is in another one.
    """
    block, crs = reading.block, placing.known_crs(crs)
    if not crs or crs == block.crs:
        return reading
    if block.crs != "local":
        raise InputError(f"the block is in {block.crs}, not in {crs}", "leave out --crs")
    if reading.origin is not None:
        return placing.in_crs(reading, crs, geoid)
    return replace(reading, block=replace(block, crs=crs))


def with_rays(reading: Reading, rays: RayList, sigma_px: float = 1.0) -> Reading:
    """Image points added; those of photographs that are not in the block are left out.

    Parameters
    ----------
    sigma_px : their standard deviation, pixels.

    Raises
    ------
    InputError
        When a point lies outside of the format, or is measured in a photograph already.
    """
    block, messages = reading.block, [*reading.messages, *rays.messages]
    index, loosely = match_photographs(rays.images, block.images.names)
    keep = np.flatnonzero(index[rays.image] >= 0)
    messages += _about_names(rays.path.name, rays.images, index, loosely, block.images.names)
    image = index[rays.image[keep]]
    place = {name: i for i, name in enumerate(block.points.tolist())}
    used, point_of_ray = np.unique(rays.point[keep], return_inverse=True)
    for name in rays.points[used].tolist():
        place.setdefault(name, len(place))
    points = np.array(list(place), dtype=str) if place else np.zeros(0, "<U1")
    point = np.array([place[name] for name in rays.points[used].tolist()], dtype=np.int64)[point_of_ray.ravel()]
    xy = rays_to_mm(rays.xy[keep], rays.unit, block.images.camera[image], block.cameras)
    refuse_outside(block, rays.path, image, points[point], xy)
    pixel = np.array([camera.pixel_mm for camera in block.cameras])[block.images.camera[image]]
    sigma = np.repeat(sigma_px * pixel[:, None], 2, axis=1)
    old = block.image_points
    both = ImagePoints(
        *(np.concatenate(pair) for pair in ((old.image, image), (old.point, point), (old.xy, xy), (old.sigma, sigma)))
    )
    key = both.image * np.int64(len(points) or 1) + both.point
    _, first = np.unique(key, return_index=True)
    if len(first) < len(key):
        again = int(np.setdiff1d(np.arange(len(key)), first)[0])
        where = f"point '{points[both.point[again]]}' in photograph '{block.images.names[both.image[again]]}'"
        raise InputError(
            f"{where} is measured in another file already",
            "give one of the two files, or remove the row from one",
            rays.path,
        )
    known = None if reading.points is None else padded(reading.points, len(points))
    return Reading(replace(block, points=points, image_points=both), known, tuple(messages))


def _about_names(file: str, names: np.ndarray, index: np.ndarray, loosely: int, known: np.ndarray) -> list[str]:
    said = []
    if loosely:
        loose = counted(loosely, "photograph is", "photographs are")
        said.append(assumed(f"{file}: {loose} named with another folder or file ending"))
    missing = np.flatnonzero(index < 0)
    if len(missing):
        others = in_words(names[missing].astype(str).tolist(), _not_met(known, index))
        many = counted(len(missing), "photograph is", "photographs are")
        said.append(left_behind(f"{file}: {many} not in the block and left out: {others}"))
    return said


def _not_met(known: np.ndarray, index: np.ndarray) -> list[str]:
    """Names of photographs that nothing was found for."""
    return known[np.setdiff1d(np.arange(len(known)), index)].astype(str).tolist()


def rays_to_mm(xy: np.ndarray, unit: str, camera: np.ndarray, cameras: tuple[Camera, ...]) -> np.ndarray:
    """(m, 2) mm of image points in a unit of `RayList`, of cameras (m,)."""
    if unit == "mm":
        return xy
    if unit == "part":
        longer = np.array([max(one.size_px) * one.pixel_mm for one in cameras])[camera]
        return xy * np.column_stack([longer, -longer])
    found = np.empty_like(xy)
    for number, one in enumerate(cameras):
        own = camera == number
        found[own] = mm_from_px(xy[own], one.size_px, one.pixel_mm)
    return found


def refuse_outside(block: Block, path: os.PathLike[str], image: np.ndarray, names: np.ndarray, xy: np.ndarray) -> None:
    """Refuse image points outside of the format.

    Parameters
    ----------
    path : their file. image : (m,) photographs of the block. names : (m,) of the points. xy : (m, 2) mm.

    Raises
    ------
    InputError
    """
    half = np.array([camera.half_format_mm for camera in block.cameras])[block.images.camera[image]]
    outside = np.flatnonzero((np.abs(xy) > (1.0 + 2.0 * OUTSIDE) * half).any(axis=1))
    if len(outside):
        row = int(outside[0])
        camera = block.cameras[block.images.camera[image[row]]]
        where = f"point '{names[row]}' in photograph '{block.images.names[image[row]]}'"
        raise InputError(
            f"{where} lies outside the format of camera '{camera.name}': x = {xy[row, 0]:.6g} mm, "
            f"y = {xy[row, 1]:.6g} mm, the format reaches to ±{half[row, 0]:.6g}, ±{half[row, 1]:.6g} mm",
            "check the size of the camera and of its pixels",
            path,
        )


def padded(points: np.ndarray, count: int) -> np.ndarray:
    """(count, 3) object points, NaN for those added behind."""
    return np.vstack([points, no_sigma(count - len(points))])


def with_orientations(reading: Reading, given: OrientationList, stated: Statements) -> Reading:
    """Orientations as start values.

    Raises
    ------
    InputError
        When no photograph is named, the rotations can be read in several ways that reprojection cannot tell apart, or
        orientations are to be observations beside others.
    """
    block = reading.block
    index, loosely = match_photographs(given.images, block.images.names)
    _refuse_strangers(given.images, index, block, given.path)
    said = _about_names(given.path.name, given.images, index, loosely, block.images.names)
    messages = [*reading.messages, *given.messages, *said]
    rows = np.flatnonzero(index >= 0)
    own = index[rows]
    if given.crs:
        # angles count from the axes of their plan: only heights can be brought to another system
        refuse_local(block, given.crs, given.path)
        refuse_other_system(plan_of(given.crs), plan_of(block.crs), "the block", given.path)
        xyz, said = placing.near_in_crs(given.centre, given.crs, block.crs, stated.geoid, no_sigma(0), given.path)
        given, messages = replace(given, centre=xyz), [*messages, *said]
    centre, rotation = block.images.centre.copy(), np.full((len(block.images), 3, 3), np.nan)
    centre[own] = given.centre[rows]
    if stated.linear_alteration_m is not None:
        if block.crs == "local":
            raise InputError("--linear-alteration needs the scale of a projection", "state it: --crs EPSG:2154+5720")
        centre[own] = placing.true_heights(centre[own], block.crs, stated.linear_alteration_m)
    chosen = given.rotation
    if given.choices:
        chosen, said = _settled(block, centre, given, own, rows)
        messages.append(said)
    rotation[own] = chosen[rows]
    angles = block.images.angles.copy()
    angles[own] = angles_from_rotation(rotation[own], block.rotation)
    block = replace(block, images=replace(block.images, centre=centre, angles=angles))
    if stated.orientation_sigma_m is not None or stated.orientation_sigma_deg is not None:
        if block.gnss_ins is not None:
            raise InputError("the block has observed positions already", "leave --orientation-sigma-… out", given.path)
        block = _observed(block, own, stated)
    return replace(reading, block=block, messages=tuple(messages))


def _observed(block: Block, rows: np.ndarray, stated: Statements) -> Block:
    """The block with the orientations of photographs as observations, free of shifts and of a boresight."""
    unknown = no_sigma(len(rows))
    xyz, sigma, angles, angles_sigma = unknown, unknown, unknown, unknown
    if stated.orientation_sigma_m is not None:
        xyz, sigma = block.images.centre[rows], np.tile(stated.orientation_sigma_m, (len(rows), 1))
    if stated.orientation_sigma_deg is not None:
        angles = block.images.angles[rows]
        angles_sigma = np.tile(np.radians(stated.orientation_sigma_deg), (len(rows), 1))
    settings = replace(
        block.settings,
        gnss=replace(block.settings.gnss, shift="off"),
        ins=replace(block.settings.ins, boresight="off"),
    )
    observed = GnssIns(rows, xyz, sigma, angles, angles_sigma, unknown[:, 0])
    return replace(block, gnss_ins=observed, settings=settings)


def _refuse_strangers(names: np.ndarray, index: np.ndarray, block: Block, file: os.PathLike[str]) -> None:
    if not len(names):
        raise InputError("holds no photographs", "give a row for every photograph", file)
    if not (index >= 0).any():
        others = in_words(names.astype(str).tolist(), block.images.names.astype(str).tolist())
        example = f"{others} is not among '{block.images.names[0]}' …"
        raise InputError(f"names no photograph of the block: {example}", "use the same names", file)


def _settled(
    block: Block, centre: np.ndarray, given: OrientationList, own: np.ndarray, rows: np.ndarray
) -> tuple[np.ndarray, str]:
    """Rotations (of the list), and how their reading was settled."""
    readings = dict(given.choices)
    placed = {}
    for name, rotations in readings.items():
        placed[name] = np.full((len(block.images), 3, 3), np.nan)
        placed[name][own] = rotations[rows]
    try:
        name, said = settle(block, centre, placed, "state it: --patb-rotation camera-to-object or object-to-camera")
        return readings[name], taken(f"{given.path.name}: {said}")
    except InputError as error:
        if not given.first_unless:
            raise InputError(error.message, error.remedy, given.path) from error
        name = given.choices[0][0]
        return readings[name], assumed(f"{given.path.name}: angles are taken as {name}; image points do not tell")


def with_positions(reading: Reading, given: PositionList, stated: Statements) -> Reading:
    """Observed positions; attitudes from yaw, pitch and roll become start values where there are none.

    Raises
    ------
    InputError
        When no photograph is named, positions are there already or have no standard deviation, or their axes are
        exchanged.
    """
    block = reading.block
    if block.gnss_ins is not None:
        raise InputError(
            "the block has observed positions already, from another file", "give one of the two files", given.path
        )
    given = named_by_stamps(given, block.images.names, exposure_times(block))
    index, loosely = match_photographs(given.images, block.images.names)
    rows = np.flatnonzero(index >= 0)
    _refuse_strangers(given.images, index, block, given.path)
    said = _about_names(given.path.name, given.images, index, loosely, block.images.names)
    messages = [*reading.messages, *given.messages, *said]
    image = index[rows]
    xyz = given.xyz[rows]
    if given.of_base:
        refuse_local(block, given.crs, given.path)
        xyz, said = placing.from_gnss(xyz, given, block.crs, stated.geoid)
        messages += said
    elif given.crs:
        refuse_local(block, given.crs, given.path)
        near = np.vstack([block.control.xyz, block.images.centre])
        xyz, said = placing.near_in_crs(xyz, given.crs, block.crs, stated.geoid, near, given.path)
        messages += said
    elif given.heights and "+" in block.crs:
        xyz = placing.from_ellipsoidal_heights(xyz, block.crs, stated.geoid)
        messages.append(taken(f"{given.path.name}: ellipsoidal heights were brought to those of {block.crs}"))
    placing.refuse_heights(given.images[rows], xyz[:, 2], block.crs, placing.HIGHEST_FLIGHT_M, given.path)
    placing.refuse_far_off(block.control.xyz, xyz, given.path)
    placing.refuse_far_off(xyz, block.images.centre, given.path, may_be_free=True)
    sigma = given_or_stated(given.sigma[rows], stated.positions_sigma_m, given.path, "--positions-sigma-m")
    unknown = no_sigma(len(rows))
    time = unknown[:, 0] if given.time is None else given.time[rows]
    observed = GnssIns(image, xyz, sigma, unknown, unknown, time)
    images, said = _with_attitudes(block, image, xyz, given.yaw_pitch_roll[rows])
    return replace(reading, block=replace(block, gnss_ins=observed, images=images), messages=(*messages, *said))


def refuse_local(block: Block, crs: str, file: os.PathLike[str]) -> None:
    """Refuse coordinates of a CRS for a block that has none.

    Raises
    ------
    InputError
    """
    if block.crs == "local":
        raise InputError(f"is in {crs}, the block has no coordinate system", f"state it: --crs {crs}", file)


def given_or_stated(
    sigma: np.ndarray, stated: tuple[float, float, float] | None, file: os.PathLike[str], option: str
) -> np.ndarray:
    """(n, 3) σ of a file, else the one stated by an option.

    Raises
    ------
    InputError
        When there is neither.
    """
    if not np.isnan(sigma).any():
        return sigma
    if stated is None:
        raise InputError("gives no standard deviations", f"state them, in metres: {option} X,Y,Z", file)
    return np.where(np.isnan(sigma), np.array(stated), sigma)


def _with_attitudes(
    block: Block, image: np.ndarray, xyz: np.ndarray, angles: np.ndarray
) -> tuple[Images, tuple[str, ...]]:
    """The images with start values from yaw, pitch and roll, and what to say of it."""
    there = np.isfinite(angles).all(axis=1) & np.isnan(block.images.angles[image]).any(axis=1)
    if not there.any():
        return block.images, ()
    if block.crs == "local":
        said = "yaw, pitch, roll count from true north and were left out: a local system does not know it; state --crs"
        return block.images, (left_behind(said),)
    own = image[there]
    rotation, convergence = placing.rotation_from_yaw_pitch_roll(angles[there], xyz[there], block.crs)
    centre, start = block.images.centre.copy(), block.images.angles.copy()
    start[own] = angles_from_rotation(rotation, block.rotation)
    centre[own] = np.where(np.isnan(centre[own]), xyz[there], centre[own])
    turned = float(np.degrees(np.median(convergence)))
    said = f"yaw, pitch, roll of {len(own)} photographs are start values, turned by {turned:+.3f}° to grid north"
    return replace(block.images, centre=centre, angles=start), (taken(said),)
