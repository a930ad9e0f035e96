"""Poses and coordinates in the many systems of other programs, brought to the one of a block.

Poses may be in a projected system, in degrees, earth-centred, in the axes east, north and up at a place, or local. In a
projected system and in degrees their rotations count in the axes at the projection centre [C]: grid east, grid north
and up, or east, north and up.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.coordinates.georeference import georeference, is_projected, utm_on_datum
from aerotri.coordinates.local_frame import topocentric_frame
from aerotri.coordinates.stated_systems import StatedSystem, stated_system
from aerotri.crs_text import heights_of, plan_of, system_in_words, with_heights
from aerotri.formats.assembly import placing
from aerotri.formats.assembly.parts import Reading
from aerotri.functional_model.rotation import angles_from_rotation, rotation_from_angles

AXES_AT = re.compile(r"ENU:\s*([-+0-9.eE]+)\s*,\s*([-+0-9.eE]+)(?:\s*,\s*([-+0-9.eE]+))?\s*")
"""Latitude, longitude and height of the origin of east, north and up."""
EARTH_CENTRED = {"EPSG:4978": "EPSG:4326", "EPSG:4936": "EPSG:4258"}
"""Earth-centred systems, and longitude and latitude on the same datum."""
HIGHEST_M = 1e5
"""Above the ellipsoid, or below it [C]."""
REMEDY = "export it in a system with an EPSG code"


@dataclass(frozen=True)
class WorldSystem:
    """A system of poses and coordinates.

    Parameters
    ----------
    kind : 'local', 'plane' (X, Y in metres), 'degrees', 'earth' (earth-centred) or 'axes' (at `origin`).
    crs : of plane and degrees, and for earth and axes longitude and latitude on their datum.
    to_metre : factors of X, Y and the height.
    origin : longitude, latitude, ellipsoidal height of 'axes'.
    note : what was understood, '' where that is plain.
    """

    kind: str = "local"
    crs: str = ""
    to_metre: tuple[float, float, float] = (1.0, 1.0, 1.0)
    origin: tuple[float, float, float] | None = None
    note: str = ""

    @property
    def in_words(self) -> str:
        if self.kind == "local":
            return "local coordinates"
        if self.origin is not None:
            return f"axes east, north, up at longitude {self.origin[0]:.9g}, latitude {self.origin[1]:.9g}"
        return "earth-centred coordinates" if self.kind == "earth" else system_in_words(self.crs)


def world_system(definition: str, path: Path, heights_as_plan: bool = False) -> WorldSystem:
    """The system of a text: EPSG codes, PROJ, WKT, or ``ENU:latitude,longitude``; local where it is empty.

    Parameters
    ----------
    heights_as_plan : whether the heights of a system of two dimensions count in the unit of X and Y.

    Raises
    ------
    InputError
        When it is not known, or cannot be used.
    """
    text = definition.strip()
    if not text:
        return WorldSystem()
    axes = AXES_AT.fullmatch(text)
    if axes is not None:
        return _axes_at(axes, text, path)
    compact = text.upper().replace(" ", "")
    if compact in EARTH_CENTRED:
        return WorldSystem("earth", EARTH_CENTRED[compact])
    try:
        found = stated_system(text)
    except InputError as error:
        raise InputError(error.message, error.remedy, path) from error
    if found is None:
        raise InputError(f"the coordinate system '{text[:80]}' is not known", REMEDY, path)
    if heights_as_plan and np.isnan(found.height_to_metre):
        note = f"{found.note}; heights count in the unit of X and Y"
        found = replace(found, height_to_metre=found.plan_to_metre, note=note)
    return _of_stated(found, text, path)


def _axes_at(found: re.Match[str], text: str, path: Path) -> WorldSystem:
    try:
        lat, lon, height = (float(word) if word else 0.0 for word in found.groups())
    except ValueError:
        lat = lon = height = np.nan
    if not (abs(lat) <= 90.0 and abs(lon) <= 360.0 and abs(height) <= HIGHEST_M):
        raise InputError(f"the origin of '{text[:60]}' is no place on the earth", REMEDY, path)
    return WorldSystem("axes", "EPSG:4326", origin=(lon, lat, height))


def _of_stated(found: StatedSystem, text: str, path: Path) -> WorldSystem:
    if np.isnan(found.height_to_metre):
        message = f"X and Y of '{text[:80]}' count in feet, and nothing says what the heights count in"
        raise InputError(message, "export it with a system of the heights as well (EPSG:n+m)", path)
    factors = (found.plan_to_metre, found.plan_to_metre, found.height_to_metre)
    if not found.crs:
        return WorldSystem(to_metre=factors, note=found.note)
    kind = "plane" if is_projected(plan_of(found.crs)) else "degrees"
    return WorldSystem(kind, found.crs, factors, note=found.note)


def target_of(poses: WorldSystem, centre: np.ndarray, others: list[WorldSystem]) -> str:
    """The coordinate system of a block: that of its poses in metres, else one of control or positions, else UTM.

    Parameters
    ----------
    centre : (n, 3) in the system of the poses, NaN where unknown. others : of control points and positions.

    Returns
    -------
    'local' where nothing says where the block lies.
    """
    metric = [other.crs for other in others if other.kind == "plane"]
    if poses.kind == "plane" or (poses.kind != "local" and metric):
        return poses.crs if poses.kind == "plane" else metric[0]
    place = _middle_in_degrees(poses, centre)
    if place is None or poses.kind == "local":
        return metric[0] if metric else "local"
    return with_heights(utm_on_datum(plan_of(poses.crs), *place), heights_of(poses.crs))


def _middle_in_degrees(system: WorldSystem, xyz: np.ndarray) -> tuple[float, float] | None:
    known = xyz[np.isfinite(xyz).all(axis=1)]
    if system.origin is not None:
        return system.origin[0], system.origin[1]
    if not len(known) or system.kind not in ("degrees", "earth"):
        return None
    if system.kind == "degrees":
        return float(known[:, 0].mean()), float(known[:, 1].mean())
    lon, lat, _ = georeference(system.crs, np.zeros((0, 3))).from_geocentric(known.mean(axis=0)[None])[0].tolist()
    return lon, lat


def placed(reading: Reading, system: WorldSystem, target: str, path: Path, geoid: FilePath | None = None) -> Reading:
    """A block read in the system of its poses, brought to the target; standard deviations stay as they are.

    Raises
    ------
    InputError
        When it does not lie on the earth, or a geoid grid is missing.
    """
    factors = np.array(system.to_metre)
    block = reading.block
    if system.kind in ("local", "plane"):
        if system.kind == "local" and target != "local":
            raise ValueError("local poses lead to no system")
        images = replace(block.images, centre=block.images.centre * factors)
        points = None if reading.points is None else reading.points * factors
        return replace(reading, block=replace(block, crs=target, images=images), points=points)
    try:
        return placing.in_crs(_at_origin(reading, system, geoid), target, geoid)
    except InputError as error:
        raise InputError(error.message, error.remedy, path) from error


def _at_origin(reading: Reading, system: WorldSystem, geoid: FilePath | None) -> Reading:
    """The same in the axes east, north and up at a place."""
    if system.origin is not None:
        return replace(reading, origin=system.origin)
    centre = reading.block.images.centre
    known = np.isfinite(centre).all(axis=1)
    places = centre[known] if known.any() else np.zeros((0, 3))
    if system.kind == "earth":
        return _from_earth_centred(reading, system, places)
    lon, lat = (float(value) for value in places[:, :2].mean(axis=0)) if len(places) else (0.0, 0.0)
    origin = (lon, lat, 0.0)
    frame = topocentric_frame(system.crs, np.array(origin), geoid)
    turn = np.full((len(centre), 3, 3), np.nan)
    turn[known] = frame.axes_at(centre[known])
    points = None if reading.points is None else frame.to_local(reading.points)
    return _turned(reading, frame.to_local(centre), turn, points, origin)


def _from_earth_centred(reading: Reading, system: WorldSystem, places: np.ndarray) -> Reading:
    plain = georeference(system.crs, np.zeros((0, 3)))
    middle = places.mean(axis=0) if len(places) else np.zeros(3)
    lon, lat, height = plain.from_geocentric(middle[None])[0].tolist()
    if not np.isfinite([lon, lat, height]).all() or abs(height) > HIGHEST_M:
        raise InputError("the photographs do not lie on the earth", REMEDY)
    origin = (lon, lat, height)
    frame = topocentric_frame(system.crs, np.array(origin))

    def moved(xyz: np.ndarray) -> np.ndarray:
        return (xyz - frame.origin_geocentric) @ frame.local_from_geocentric.T

    points = None if reading.points is None else moved(reading.points)
    turn = np.broadcast_to(frame.local_from_geocentric, (len(reading.block.images), 3, 3))
    return _turned(reading, moved(reading.block.images.centre), turn, points, origin)


def _turned(
    reading: Reading, centre: np.ndarray, turn: np.ndarray, points: np.ndarray | None, origin: tuple[float, ...]
) -> Reading:
    block = reading.block
    rotation = turn @ rotation_from_angles(block.images.angles, block.rotation)
    images = replace(block.images, centre=centre, angles=angles_from_rotation(rotation, block.rotation))
    lon, lat, height = origin
    return replace(reading, block=replace(block, images=images), points=points, origin=(lon, lat, height))


def coordinates_in(
    xyz: np.ndarray, system: WorldSystem, target: str, path: Path, geoid: FilePath | None = None
) -> np.ndarray:
    """Control points or positions of a system in that of the block.

    Parameters
    ----------
    xyz : (n, 3), NaN where unknown. target : of the block.

    Raises
    ------
    InputError
        When one of both is local, the datums differ, or a geoid grid is missing.
    """
    if (system.kind == "local") != (target == "local"):
        message = f"control points or positions are in {system.in_words}, the photographs in {target}"
        raise InputError(message, "export both in one coordinate system", path)
    scaled = xyz * np.array(system.to_metre)
    if system.kind == "local" or not len(xyz):
        return scaled
    try:
        if system.kind in ("axes", "earth"):
            return _in_target(scaled, system, target, geoid)
        if heights_of(system.crs) == heights_of(target):
            # heights of one system stay: no grid is needed
            return placing.to_crs(scaled, plan_of(system.crs), plan_of(target), None)
        return placing.to_crs(scaled, system.crs, target, geoid)
    except InputError as error:
        raise InputError(error.message, error.remedy, path) from error


def _in_target(xyz: np.ndarray, system: WorldSystem, target: str, geoid: FilePath | None) -> np.ndarray:
    if system.origin is not None:
        return topocentric_frame(target, np.array(system.origin), geoid).from_local(xyz)
    plain = georeference(system.crs, np.zeros((0, 3)))
    known = np.isfinite(xyz).all(axis=1)
    found = np.full_like(xyz, np.nan)
    if known.any():
        found[known] = placing.to_crs(plain.from_geocentric(xyz[known]), system.crs, target, geoid)
    return found
