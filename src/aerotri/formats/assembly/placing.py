"""Coordinates and attitudes of files brought into the CRS of a block."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.coordinates import local_frame
from aerotri.coordinates.blocks import frame_of_block, transform_block
from aerotri.coordinates.crs_names import heights_in_words as system_of_heights
from aerotri.coordinates.ellipsoid import metres_of_units
from aerotri.coordinates.georeference import (
    CRS_PATTERN,
    CRS_REMEDY,
    Georeference,
    georeference,
    is_projected,
    utm_on_datum,
)
from aerotri.coordinates.local_frame import LocalFrame, topocentric_frame
from aerotri.coordinates.stated_systems import geographic_of
from aerotri.crs_text import heights_of, plan_of, system_in_words
from aerotri.formats.assembly.oriented import OrientedBlock
from aerotri.formats.assembly.parts import OrientationList, PointList, PositionList, Reading
from aerotri.formats.foreign.ign import without_linear_alteration
from aerotri.formats.text.notes import assumed, taken
from aerotri.functional_model.rotation import angles_from_rotation, rotation_from_angles

NORTH_STEP_DEG = 1e-5
"""Half the length of the piece of meridian that gives the direction of north in a grid: 1 m."""
BODY = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""Between x forward, y right, z down and x right, y forward, z up; its own inverse."""
FAR_M, FAR_SIZES = 1e4, 3.0
"""Distance of points from the photographs, in m and in sizes of the larger area, beyond which both are not in one
system; chosen [C]: below the differences of X and Y in most systems, beyond the way from a block to its control."""
HIGHEST_GROUND_M, HIGHEST_FLIGHT_M = 9e3, 3e4
"""Heights beyond these are none of ground and of an aircraft [C]."""
WGS84 = "EPSG:4326"
SAME_FRAME_M = 3.0
"""Distance between WGS 84 and another datum up to which GNSS works in either, by its base [C]: plates have moved ETRS89
and NAD83 by less, datums of older surveys are off by tens of metres and more."""
OTHER_SYSTEM = "are both in the same coordinate system? correct the one that the list names, or state it: --crs"
OTHER_AXES = "state the order of the axes: --axes yx (or xy)"
NEARER = 0.1
"""Share of that distance which exchanging X and Y has to leave; chosen [C]: chance does not bring points ten times
nearer."""


def known_crs(crs: str) -> str:
    """A CRS as block.toml has it, '' or 'local' as they are.

    Raises
    ------
    InputError
        When PROJ does not know it, or a block cannot be in it; of a height system only the form is looked at.
    """
    if crs in ("", "local"):
        return crs
    georeference(plan_of(crs), np.zeros((0, 3)))
    if not CRS_PATTERN.fullmatch(crs):
        raise InputError(f"crs '{crs}' is not understood", CRS_REMEDY)
    return crs.upper()


def system_of_lists(lists: Sequence[PointList | PositionList | OrientationList]) -> str:
    """The system that a block gets from lists: the first that counts in metres, else UTM; '' where none names one."""
    told = [(part.crs, part.centre if isinstance(part, OrientationList) else part.xyz) for part in lists if part.crs]
    metric = [(crs, xyz) for crs, xyz in told if is_projected(plan_of(crs))]
    return next((system_of_block(crs, xyz) for crs, xyz in metric or told), "")


def system_of_block(crs: str, xyz: np.ndarray) -> str:
    """The system that a block gets from coordinates: their own, or the UTM zone on their datum.

    UTM is taken where their system has no code, or counts in degrees.

    Parameters
    ----------
    crs : of the coordinates. xyz : (n, 3) in it, NaN where unknown.
    """
    known = xyz[np.isfinite(xyz[:, :2]).all(axis=1)]
    if not len(known) or (CRS_PATTERN.fullmatch(crs) and is_projected(plan_of(crs))):
        return crs
    lon, lat, _ = georeference(crs, known).to_geographic(np.nan_to_num(known)).mean(axis=0)
    return utm_on_datum(crs, float(lon), float(lat))


def to_crs(xyz: np.ndarray, source: str, target: str, geoid: FilePath | None) -> np.ndarray:
    """Coordinates of one CRS in another on the same datum.

    Parameters
    ----------
    xyz : (n, 3) in `source`, NaN where unknown; a row with an unknown coordinate stays partly unknown.
    geoid : grid for the heights of `target`, where PROJ does not have it.

    Raises
    ------
    InputError
        When the datums differ, since the shift between them would have to be chosen.
    """
    if source == target or not len(xyz):
        return xyz
    plan = np.isfinite(xyz[:, :2]).all(axis=1)
    if not plan.all():
        message = f"a point in {system_in_words(source)} has no plan position and cannot be brought to {target}"
        raise InputError(message, f"give it in {target}")
    known = np.isfinite(xyz[:, 2])
    here, plain = georeference(source, xyz), georeference(plan_of(target), xyz)
    geographic = here.to_geographic(np.where(np.isnan(xyz), 0.0, xyz))
    there = georeference(target, plain.from_geographic(geographic), geoid)
    if _datum(here) != _datum(there):
        remedy = f"transform the coordinates to {target} beforehand"
        raise InputError(f"{system_in_words(source)} and {target} are on different datums", remedy)
    found = there.from_geographic(geographic)
    return np.column_stack([found[:, :2], np.where(known, found[:, 2], np.nan)])


def _datum(reference: Georeference) -> str:
    target = reference.horizontal.target_crs
    return "" if target is None or target.datum is None else target.datum.name.replace(" ensemble", "")


def from_gnss(
    place: np.ndarray, given: PositionList, crs: str, geoid: FilePath | None
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Positions of GNSS in the CRS of a block, and what to say of their datum and heights.

    Parameters
    ----------
    place : (n, 3) longitude, latitude, degrees, and height of `given`.

    Raises
    ------
    InputError
        When the CRS is on a datum that coordinates of GNSS have to be transformed to.
    """
    name, wanted = given.path.name, crs
    if given.heights == "sea level":
        wanted = plan_of(crs)
        said = about_sea_level(name, crs)
    elif wanted != plan_of(crs):
        said = taken(f"heights of {name} count from the ellipsoid, and were brought to those of {crs}")
    else:
        said = about_ellipsoidal(name, crs)
    source = datum_of_base(place, given.crs, plan_of(crs))
    of_datum = assumed(f"{name}: WGS 84 is taken as the datum of {crs}, as that of its base station")
    messages = (said,) if source == given.crs else (said, of_datum)
    try:
        return to_crs(place, source, wanted, geoid), messages
    except InputError as error:
        raise InputError(error.message, error.remedy, given.path) from error


def about_sea_level(name: str, crs: str) -> str:
    """A note on heights of a file above sea level, which name no system of heights."""
    own = f"those of {crs}" if crs != plan_of(crs) else f"those of the block ({crs}: {system_of_heights(crs)})"
    return assumed(f"heights of {name} count from sea level; they are taken as {own} as they are")


def about_ellipsoidal(name: str, crs: str) -> str:
    """A note on ellipsoidal heights of a file in a block whose CRS names no system of heights."""
    return assumed(
        f"heights of {name} count from the ellipsoid, and {crs} names no system of heights: those of control points "
        f"have to count from the ellipsoid too; where they do not, state their system: --crs {crs}+…"
    )


def datum_of_base(place: np.ndarray, source: str, plan: str) -> str:
    """The longitude and latitude on the datum of a block, where this is one that GNSS works in, else `source`.

    What receivers call WGS 84 is the frame of the coordinates of their base station, such as ETRS89 or NAD83(2011).

    Parameters
    ----------
    place : (n, 3) longitude, latitude and height in `source`. plan : CRS of the block.
    """
    from pyproj import Transformer
    from pyproj.exceptions import ProjError

    target = geographic_of(plan)
    if source != WGS84 or target == source or not len(place):
        return source
    try:
        found = np.array(Transformer.from_crs(source, target, always_xy=True).transform(*place[:1, :2].T))[:, 0]
    except ProjError:
        return source
    apart = np.linalg.norm((found - place[0, :2]) * metres_of_units(place[:1])[0, :2])
    return target if apart < SAME_FRAME_M else source


def from_ellipsoidal_heights(xyz: np.ndarray, crs: str, geoid: FilePath | None) -> np.ndarray:
    """Points in the plan coordinates of a CRS and ellipsoidal heights, with the heights of the CRS.

    Parameters
    ----------
    xyz : (n, 3), NaN where unknown.

    Raises
    ------
    InputError
        When a point has a height but no plan position.
    """
    known = np.isfinite(xyz[:, 2])
    if (known & ~np.isfinite(xyz[:, :2]).all(axis=1)).any():
        raise InputError("a point has an ellipsoidal height but no plan position", f"give its height in {crs}")
    if not known.any():
        return xyz
    found = xyz.copy()
    plain = georeference(plan_of(crs), xyz[known])
    reference = georeference(crs, xyz[known], geoid)
    found[known, 2] = reference.from_geographic(plain.to_geographic(xyz[known]))[:, 2]
    return found


def rotation_from_yaw_pitch_roll(angles: np.ndarray, xyz: np.ndarray, crs: str) -> tuple[np.ndarray, np.ndarray]:
    """Rotations camera → grid of attitudes that count from true north.

    With the axes of an aircraft x forward, y right, z down, R = Rz(yaw)·Ry(pitch)·Rx(roll) brings it to north, east,
    down; the camera looks down and the top of its image forward. Grid north lies off true north by the convergence.

    Parameters
    ----------
    angles : (n, 3) rad, yaw, pitch, roll. xyz : (n, 3) in `crs`.

    Returns
    -------
    rotation : (n, 3, 3), NaN where an angle is.
    convergence : (n,) rad, from grid north to true north, clockwise.
    """
    yaw, pitch, roll = np.asarray(angles, dtype=float).T
    aircraft = _about(2, yaw) @ _about(1, pitch) @ _about(0, roll)
    reference = georeference(plan_of(crs), xyz)
    convergence = np.zeros(len(xyz))
    if reference.is_projected:
        place = reference.to_geographic(np.asarray(xyz, dtype=float))
        step = np.array([0.0, NORTH_STEP_DEG, 0.0])
        north = reference.from_geographic(place + step) - reference.from_geographic(place - step)
        convergence = np.arctan2(north[:, 0], north[:, 1])
    return _about(2, -convergence) @ (BODY @ aircraft @ BODY), convergence


def _about(axis: int, angle: np.ndarray) -> np.ndarray:
    """(n, 3, 3) rotations about an axis."""
    matrix = np.zeros((len(angle), 3, 3))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix[:, axis, axis] = 1.0
    matrix[:, i, i] = matrix[:, j, j] = np.cos(angle)
    matrix[:, i, j], matrix[:, j, i] = -np.sin(angle), np.sin(angle)
    return matrix


def true_heights(centre: np.ndarray, crs: str, ground: float) -> np.ndarray:
    """Projection centres whose heights were corrected for the scale of the projection, with their true heights.

    Parameters
    ----------
    centre : (n, 3) in `crs`. ground : m, mean height of the ground.
    """
    frame = local_frame(plan_of(crs), centre)
    on_ellipsoid = np.column_stack([centre[:, :2], np.zeros(len(centre))])
    plan = frame.crs_per_local(frame.to_local(on_ellipsoid))[:, :2, :2]
    scale = np.sqrt(np.abs(np.linalg.det(plan)))
    return np.column_stack([centre[:, :2], without_linear_alteration(centre[:, 2], ground, scale)])


def in_local_frame(oriented: OrientedBlock, geoid: FilePath | None = None) -> tuple[OrientedBlock, str]:
    """A block with a CRS in its local topocentric frame, in which rays are straight, and where that is.

    Raises
    ------
    InputError
        When a grid for its heights is missing.
    """
    frame = frame_of_block(oriented.block, geoid)
    local = _in_frame(oriented, frame)
    lon, lat, _ = frame.origin.tolist()
    words = f"coordinates are local: east, north of the grid and up around longitude {lon:.9g}, latitude {lat:.9g}"
    return local, f"{words} on the ellipsoid of {oriented.block.crs}"


def _in_frame(oriented: OrientedBlock, frame: LocalFrame) -> OrientedBlock:
    there = oriented.oriented
    rotation = oriented.rotation.copy()
    rotation[there] = frame.axes_at(oriented.centre[there]) @ oriented.rotation[there]
    return replace(
        oriented,
        block=transform_block(oriented.block, frame),
        centre=frame.to_local(oriented.centre),
        rotation=rotation,
        points=frame.to_local(oriented.points),
    )


def in_crs(reading: Reading, crs: str, geoid: FilePath | None = None) -> Reading:
    """What was read in the axes at an origin, in a CRS; standard deviations stay as they are.

    Raises
    ------
    InputError
        When the origin lies outside of the CRS, or a grid for its heights is missing.
    """
    assert reading.origin is not None
    block, frame = reading.block, topocentric_frame(crs, np.array(reading.origin), geoid)
    there = np.isfinite(block.images.centre).all(axis=1) & np.isfinite(block.images.angles).all(axis=1)
    centre, angles = frame.from_local(block.images.centre), block.images.angles.copy()
    turned = np.swapaxes(frame.axes_at(centre[there]), 1, 2) @ rotation_from_angles(angles[there], block.rotation)
    angles[there] = angles_from_rotation(turned, block.rotation)
    observed = block.gnss_ins
    if observed is not None:
        observed = replace(observed, xyz=frame.from_local(observed.xyz))
    images = replace(block.images, centre=centre, angles=angles)
    points = None if reading.points is None else frame.from_local(reading.points)
    return replace(reading, block=replace(block, crs=crs, images=images, gnss_ins=observed), points=points, origin=None)


def in_axes_at(oriented: OrientedBlock, origin: np.ndarray, geoid: FilePath | None = None) -> OrientedBlock:
    """A block with a CRS in the axes east, north and up at a place; the way back of `in_crs`.

    Parameters
    ----------
    origin : (3,) longitude, latitude in degrees, ellipsoidal height in metres.

    Raises
    ------
    InputError
        When the place lies outside of the CRS, or a grid for its heights is missing.
    """
    return _in_frame(oriented, topocentric_frame(oriented.block.crs, origin, geoid))


def refuse_far_off(
    points: np.ndarray, photographs: np.ndarray, file: os.PathLike[str], may_be_free: bool = False
) -> None:  # fmt: skip
    """Refuse coordinates that lie far from the photographs: in another system, or with X and Y exchanged.

    Parameters
    ----------
    points : (k, 3) m of `file`. photographs : (n, 3) m. NaN where unknown.
    may_be_free : whether the photographs may be in axes of their own, as start values are: being far off says nothing
        then, but that exchanging X and Y brings both together does.

    Raises
    ------
    InputError
    """
    one, other = _plan(points), _plan(photographs)
    if not len(one) or not len(other):
        return
    apart, exchanged = _apart(one, other), _apart(one[:, ::-1], other)
    size = max(float(np.ptp(xy, axis=0).max()) for xy in (one, other))
    if apart <= max(FAR_M, FAR_SIZES * size):
        return
    message = f"lies {apart / 1e3:.0f} km from the photographs"
    if exchanged < NEARER * apart:
        raise InputError(f"{message}, {exchanged / 1e3:.3g} km with X and Y exchanged", OTHER_AXES, file)
    if not may_be_free:
        raise InputError(message, OTHER_SYSTEM, file)


def refuse_heights(names: np.ndarray, heights: np.ndarray, crs: str, highest: float, file: os.PathLike[str]) -> None:
    """Refuse heights that nothing on earth has; those of local coordinates may count from anywhere.

    Parameters
    ----------
    names : (n,) of points or photographs. heights : (n,) m, NaN where unknown. highest : m.

    Raises
    ------
    InputError
    """
    wrong = np.flatnonzero(np.abs(np.nan_to_num(heights)) > highest)
    if crs != "local" and len(wrong):
        message = f"the height of '{names[wrong[0]]}' would be {heights[wrong[0]]:.0f} m"
        raise InputError(message, "give heights in metres: are these in millimetres?", file)


def near_in_crs(
    xyz: np.ndarray, source: str, target: str, geoid: FilePath | None, photographs: np.ndarray, file: os.PathLike[str]
) -> tuple[np.ndarray, tuple[str, ...]]:
    """As `to_crs`, of points that lie near the photographs, and what to say of their heights.

    Longitude and latitude may be exchanged.

    Parameters
    ----------
    photographs : (n, 3) m in `target`, NaN where unknown. file : that the points are from.

    Raises
    ------
    InputError
        When they lie elsewhere, and whether they would not with the axes exchanged.
    """
    if not is_projected(plan_of(source)) and _is_near_exchanged(xyz, source, target, geoid, photographs):
        message = "lies near the photographs with longitude and latitude exchanged, not as it stands"
        raise InputError(message, OTHER_AXES, file)
    try:
        return to_crs(xyz, source, target, geoid), change_of_heights(source, target, file)
    except InputError as error:
        raise InputError(error.message, error.remedy, file) from error


def change_of_heights(source: str, target: str, file: os.PathLike[str]) -> tuple[str, ...]:
    """What to say of the heights of a file in the CRS `source`, brought to `target`, where one names none for them."""
    named, wanted = heights_of(source), heights_of(target)
    if bool(named) == bool(wanted):
        return ()
    name = Path(file).name
    if wanted:
        return (assumed(f"{name}: heights count as ellipsoidal, and were brought to those of {target}"),)
    return (taken(f"{name}: heights of {source} were brought to ellipsoidal ones"),)


def _is_near_exchanged(
    lon_lat: np.ndarray, source: str, target: str, geoid: FilePath | None, photographs: np.ndarray
) -> bool:
    """Whether points in degrees lie near the photographs only where longitude and latitude change places."""
    near = []
    for order in ([0, 1, 2], [1, 0, 2]):
        try:
            near.append(_are_near(to_crs(lon_lat[:, order], source, target, geoid), photographs))
        except InputError:
            near.append(False)
    return near[1] and not near[0]


def _are_near(points: np.ndarray, photographs: np.ndarray) -> bool:
    one, other = _plan(points), _plan(photographs)
    return bool(len(one)) and bool(len(other)) and _apart(one, other) <= FAR_M


def _plan(xyz: np.ndarray) -> np.ndarray:
    return xyz[np.isfinite(xyz[:, :2]).all(axis=1), :2]


def _apart(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.linalg.norm(np.median(one, axis=0) - np.median(other, axis=0)))
