"""Simulated blocks spoilt as users spoil them; each kind with the verdict and the words that have to come of it."""

from __future__ import annotations

import contextlib
import csv
import io
import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from aerotri.commands.adjust import run_adjust
from aerotri.conventions import InputError
from aerotri.coordinates.local_frame import local_frame
from aerotri.formats.block.folder import write_block
from aerotri.functional_model.rotation import angles_from_rotation, rotation_from_angles
from aerotri.observations import Block
from aerotri.observations.settings import GnssSettings, InsSettings
from aerotri.simulation import parse_spec, simulate

Spoil = Callable[[Block], Block]

CRS = "EPSG:25832"
PLACE = np.array([404000.0, 5655000.0, 0.0])
"""Where the block with a CRS lies."""
FEET = 1.0 / 0.3048
CHECKED = 2.0
"""RMS of the check points over their σ up to which they agree with them."""

FRAME = {"model": "frame", "size_px": [6000, 4500], "pixel_um": 8.0, "focal_length_mm": 60.0, "flight_axis": "+y",
         "interior": {"focal_length_mm": {"value": 60.0, "fixed": True}}}  # fmt: skip
SPEC = {
    "name": "wrong",
    "camera": {"cam": FRAME},
    "flight": {
        "gsd_m": 0.1, "strips": 2, "images_per_strip": 5, "end_lap": 0.65, "side_lap": 0.4, "heading_deg": 60.0,
        "attitude_sigma_deg": [2.0, 2.0, 3.0], "position_sigma_m": [8.0, 8.0, 4.0],
    },
    "terrain": {"kind": "undulating", "height_m": 150.0, "relief_rms_m": 20.0, "wavelength_m": 600.0},
    "tie_points": {"per_image": 50, "probability": 0.9, "sigma_um": 2.0},
    "control": {"distance_bases": 2.5, "sigma_m": [0.02, 0.02, 0.03], "check_points": 8},
    "start_values": {"kind": "perturbed", "position_sigma_m": 3.0, "angle_sigma_deg": 0.3},
}  # fmt: skip
NAVIGATION = {
    "gnss": {"sigma_m": [0.05, 0.05, 0.08]},
    "ins": {"sigma_deg": [0.005, 0.005, 0.01]},
}
DRONE = {
    "camera": {"cam": {**FRAME, "size_px": [5472, 3648], "pixel_um": 2.4, "focal_length_mm": 8.8,
                       "interior": {"focal_length_mm": {"value": 8.8, "fixed": True}}}},
    "flight": {
        "height_m": 100.0, "strips": 4, "images_per_strip": 5, "end_lap": 0.75, "side_lap": 0.6,
        "attitude_sigma_deg": [1.5, 1.5, 3.0], "position_sigma_m": [1.0, 1.0, 0.5],
    },
    "terrain": {"kind": "undulating", "height_m": 150.0, "relief_rms_m": 4.0, "wavelength_m": 120.0},
    "tie_points": {"per_image": 60, "probability": 0.8, "sigma_um": 1.2},
    "control": {"positions": [[0.5, 0.5]], "sigma_m": [0.02, 0.02, 0.03], "check_points": 6},
    "gnss": {"sigma_m": [0.03, 0.03, 0.05]},
    "start_values": {"kind": "none"},
}  # fmt: skip


def clean(geometry: str, seed: int = 3) -> Block:
    """A faultless block: 'navigation', 'control' (none but control), 'track' (a drone's), 'crs' (navigation in UTM)."""
    changes = {"navigation": NAVIGATION, "crs": NAVIGATION, "control": {}, "track": DRONE}[geometry]
    block, _ = simulate(parse_spec(SPEC | changes), seed)
    settings = replace(block.settings, gnss=GnssSettings(shift="off"), ins=InsSettings(boresight="off"))
    block = replace(block, settings=settings)
    if geometry == "track":
        control = block.control
        block = replace(block, control=replace(control, is_check=np.ones(len(control), bool)))
    return _in_crs(block) if geometry == "crs" else block


def _in_crs(block: Block) -> Block:
    """The block as if its local frame were the tangent plane at `PLACE`, in the coordinates of `CRS`."""
    frame = local_frame(CRS, PLACE[None] + [[0.0, 0.0, 0.0]], None, None)

    def angles(angles: np.ndarray, place: np.ndarray) -> np.ndarray:
        rotation = np.swapaxes(frame.axes_at(place), 1, 2) @ rotation_from_angles(angles, block.rotation)
        return angles_from_rotation(rotation, block.rotation)

    control, images, gnss = block.control, block.images, block.gnss_ins
    centre, antenna = frame.from_local(images.centre), frame.from_local(gnss.xyz)
    return replace(
        block,
        crs=CRS,
        control=replace(control, xyz=frame.from_local(control.xyz)),
        images=replace(images, centre=centre, angles=angles(images.angles, centre)),
        gnss_ins=replace(gnss, xyz=antenna, angles=angles(gnss.angles, antenna)),
    )


@dataclass(frozen=True, eq=False)
class Kind:
    """A kind of wrong block.

    Parameters
    ----------
    geometry : see `clean`. spoil : what is done to the block. verdicts : what may come of it. words : what the reasons
        have to say, all of them.
    """

    name: str
    geometry: str
    spoil: Spoil
    words: tuple[str, ...] = ()
    verdicts: tuple[str, ...] = ("rejected",)


def photograph(block: Block, number: int) -> str:
    """The name of a photograph."""
    return str(block.images.names[number])


def image_points(change: Callable[[np.ndarray], np.ndarray], number: int | None = None) -> Spoil:
    """Measurements (k, 2) of one photograph or of all changed."""

    def spoil(block: Block) -> Block:
        rays = block.image_points
        own = np.ones(len(rays), bool) if number is None else rays.image == number
        xy = rays.xy.copy()
        xy[own] = change(xy[own])
        return replace(block, image_points=replace(rays, xy=xy))

    return spoil


def of_strip(block: Block, name: str) -> np.ndarray:
    """Indices of the photographs of a strip."""
    return np.flatnonzero(np.asarray(block.images.strip) == name)


def strip_points(change: Callable[[np.ndarray], np.ndarray], name: str) -> Spoil:
    """Measurements (k, 2) of the photographs of a strip changed."""

    def spoil(block: Block) -> Block:
        rays = block.image_points
        own, xy = np.isin(rays.image, of_strip(block, name)), rays.xy.copy()
        xy[own] = change(xy[own])
        return replace(block, image_points=replace(rays, xy=xy))

    return spoil


def ground(change: Callable[[np.ndarray], np.ndarray], only: str = "") -> Spoil:
    """Coordinates (k, 3) of control and check points changed, or of 'control' only."""

    def spoil(block: Block) -> Block:
        control = block.control
        own = ~control.is_check if only == "control" else np.ones(len(control), bool)
        xyz = control.xyz.copy()
        xyz[own] = change(xyz[own])
        return replace(block, control=replace(control, xyz=xyz))

    return spoil


def control_points(change: Callable[[np.ndarray], np.ndarray]) -> Spoil:
    """Coordinates (k, 3) of the control points alone changed."""
    return ground(change, "control")


def gnss(change: Callable[[np.ndarray], np.ndarray]) -> Spoil:
    """Positions (n, 3) by GNSS changed."""
    return lambda block: replace(block, gnss_ins=replace(block.gnss_ins, xyz=change(block.gnss_ins.xyz)))


def ins(change: Callable[[np.ndarray], np.ndarray]) -> Spoil:
    """Attitudes (n, 3) rad by INS changed."""
    return lambda block: replace(block, gnss_ins=replace(block.gnss_ins, angles=change(block.gnss_ins.angles)))


def start_positions(change: Callable[[np.ndarray], np.ndarray]) -> Spoil:
    """Start values (n, 3) of the projection centres changed."""
    return lambda block: replace(block, images=replace(block.images, centre=change(block.images.centre)))


def start_angles(change: Callable[[np.ndarray], np.ndarray]) -> Spoil:
    """Start values (n, 3) rad of the angles changed."""
    return lambda block: replace(block, images=replace(block.images, angles=change(block.images.angles)))


def both(*spoils: Spoil) -> Spoil:
    """One after the other."""

    def spoil(block: Block) -> Block:
        for one in spoils:
            block = one(block)
        return block

    return spoil


def of_rows(rows: np.ndarray, change: Callable[[np.ndarray], np.ndarray]) -> Callable[[np.ndarray], np.ndarray]:
    """Some rows changed."""

    def spoil(values: np.ndarray) -> np.ndarray:
        values = values.copy()
        values[rows] = change(values[rows])
        return values

    return spoil


def camera_turned(block: Block) -> Callable[[np.ndarray], np.ndarray]:
    """Angles (k, 3) of a camera frame with y down and z forward."""

    def change(angles: np.ndarray) -> np.ndarray:
        rotation = rotation_from_angles(angles, block.rotation) @ np.diag([1.0, -1.0, -1.0])
        return angles_from_rotation(rotation, block.rotation)

    return change


def focal_length(factor: float) -> Spoil:
    """The principal distance of the camera times a factor."""

    def spoil(block: Block) -> Block:
        camera = block.cameras[0]
        prior = camera.interior["focal_length_mm"]
        wrong = {**camera.interior, "focal_length_mm": replace(prior, value=prior.value * factor)}
        return replace(block, cameras=(replace(camera, interior=wrong),))

    return spoil


def negated(*columns: int) -> Callable[[np.ndarray], np.ndarray]:
    """Columns with the other sign."""

    def change(values: np.ndarray) -> np.ndarray:
        values = values.copy()
        values[:, list(columns)] *= -1.0
        return values

    return change


def exchanged(values: np.ndarray) -> np.ndarray:
    """Columns 0 and 1 exchanged."""
    return values[:, [1, 0, *range(2, values.shape[1])]]


def times(factor: float) -> Callable[[np.ndarray], np.ndarray]:
    """All values times a factor."""
    return lambda values: values * factor


def plus(*vector: float) -> Callable[[np.ndarray], np.ndarray]:
    """A vector added."""
    return lambda values: values + np.array(vector)


def rolled(steps: int) -> Callable[[np.ndarray], np.ndarray]:
    """Rows moved along; the last come to the front."""
    return lambda values: np.roll(values, steps, axis=0)


def row(number: int, change: Callable[[np.ndarray], np.ndarray]) -> Callable[[np.ndarray], np.ndarray]:
    """One row changed."""

    def spoil(values: np.ndarray) -> np.ndarray:
        values = values.copy()
        values[[number]] = change(values[[number]])
        return values

    return spoil


def rows_exchanged(a: int, b: int) -> Callable[[np.ndarray], np.ndarray]:
    """Two rows exchanged."""

    def change(values: np.ndarray) -> np.ndarray:
        values = values.copy()
        values[[a, b]] = values[[b, a]]
        return values

    return change


def row_copied(source: int, target: int) -> Callable[[np.ndarray], np.ndarray]:
    """One row written over another."""

    def change(values: np.ndarray) -> np.ndarray:
        values = values.copy()
        values[target] = values[source]
        return values

    return change


def names_moved(number: int, steps: int) -> Spoil:
    """The names of one photograph's points moved by rows."""

    def spoil(block: Block) -> Block:
        rays = block.image_points
        own, point = np.flatnonzero(rays.image == number), rays.point.copy()
        point[own] = np.roll(point[own], steps)
        return replace(block, image_points=replace(rays, point=point))

    return spoil


def photographs_exchanged(a: int, b: int) -> Spoil:
    """The measurements of two photographs under each other's name."""

    def spoil(block: Block) -> Block:
        rays = block.image_points
        image = np.where(rays.image == a, b, np.where(rays.image == b, a, rays.image))
        return replace(block, image_points=replace(rays, image=image))

    return spoil


def strips_apart(block: Block) -> Block:
    """The tie points of every strip with names of their own; control keeps its names in the first strip only."""
    rays, strip = block.image_points, np.asarray(block.images.strip)
    _, number = np.unique(strip, return_inverse=True)
    new = np.where(number[rays.image] == 0, rays.point, rays.point + len(block.points))
    used, point = np.unique(new, return_inverse=True)
    names = np.concatenate([block.points, np.array([f"S2_{name}" for name in block.points])])
    control = block.control
    kept = np.isin(control.point, used)
    where = np.searchsorted(used, control.point[kept])
    return replace(
        block,
        points=names[used],
        image_points=replace(rays, point=point),
        control=replace(
            control, point=where, xyz=control.xyz[kept], sigma=control.sigma[kept], is_check=control.is_check[kept]
        ),
    )


def one_photograph_apart(number: int) -> Spoil:
    """The points of one photograph under names that no other has."""

    def spoil(block: Block) -> Block:
        rays = block.image_points
        own = rays.image == number
        names = np.concatenate([block.points, [f"P{k}" for k in range(int(own.sum()))]])
        point = rays.point.copy()
        point[own] = len(block.points) + np.arange(int(own.sum()))
        return replace(block, points=names, image_points=replace(rays, point=point))

    return spoil


def without_start(block: Block) -> Block:
    """No start values."""
    nothing = np.full_like(block.images.centre, np.nan)
    return replace(block, images=replace(block.images, centre=nothing, angles=nothing.copy()))


def as_degrees(xyz: np.ndarray) -> np.ndarray:
    """Local metres as longitude, latitude in degrees around 7° E, 51° N."""
    lat = 51.0 + np.degrees(xyz[:, 1] / 6371000.0)
    lon = 7.0 + np.degrees(xyz[:, 0] / (6371000.0 * np.cos(np.radians(51.0))))
    return np.column_stack([lon, lat, xyz[:, 2]])


def in_zone(zone: int) -> Callable[[np.ndarray], np.ndarray]:
    """Coordinates of `CRS` in another UTM zone."""

    def change(xyz: np.ndarray) -> np.ndarray:
        from pyproj import Transformer

        x, y = Transformer.from_crs(CRS, f"EPSG:258{zone}", always_xy=True).transform(xyz[:, 0], xyz[:, 1])
        return np.column_stack([x, y, xyz[:, 2]])

    return change


def geographic(xyz: np.ndarray) -> np.ndarray:
    """Coordinates of `CRS` as longitude and latitude in degrees."""
    from pyproj import Transformer

    lon, lat = Transformer.from_crs(CRS, "EPSG:4326", always_xy=True).transform(xyz[:, 0], xyz[:, 1])
    return np.column_stack([lon, lat, xyz[:, 2]])


def in_other_order(block: Block) -> Callable[[np.ndarray], np.ndarray]:
    """The same attitudes as φ, ω, κ."""
    return lambda angles: angles_from_rotation(rotation_from_angles(angles, block.rotation), "phi-omega-kappa")


KAPPA_180 = plus(0.0, 0.0, np.pi)
PHI_120 = plus(0.0, 2.0 * np.pi / 3.0, 0.0)
EITHER = ("rejected", "doubtful")
NO_RESULT = ("rejected", "refused")
"""'refused' where nothing can be begun with: the command ends with 2."""
HARMLESS = ("accepted", "doubtful", "rejected")
"""Start values that are wrong and found to be so do no harm to a block that control holds."""


def kinds() -> list[Kind]:
    """All kinds."""
    return [
        *_of_measurements(), *_of_control(), *_of_navigation(), *_of_start_values(), *_of_the_camera(),
        *_that_fit_alone(),
    ]  # fmt: skip


def _of_measurements() -> list[Kind]:
    found = []
    for geometry in ("navigation", "control", "track", "crs"):
        name = photograph(clean(geometry), 3)
        found += [
            Kind("x of one photograph negated", geometry, image_points(negated(0), 3), (name, "x negated")),
            Kind("x of all photographs negated", geometry, image_points(negated(0)), ("x negated",), NO_RESULT),
        ]
    for geometry in ("navigation", "control", "crs"):
        found += [
            Kind("x of one strip negated", geometry, strip_points(negated(0), "1"), ("strip 1", "x negated")),
            Kind("y of one strip negated", geometry, strip_points(negated(1), "2"), ("strip 2", "y negated")),
        ]
    found.append(
        Kind("x of one strip negated", "track", strip_points(negated(0), "2"), ("strip 2", "x negated"), NO_RESULT)
    )
    for geometry in ("navigation", "control"):
        name = photograph(clean(geometry), 3)
        other = photograph(clean(geometry), 6)
        found += [
            Kind("y of one photograph negated", geometry, image_points(negated(1), 3), (name, "y negated")),
            Kind("x and y of one photograph exchanged", geometry, image_points(exchanged, 3),
                 ("outside the format", "exchanged"), ("refused",)),
            Kind("y of all photographs negated", geometry, image_points(negated(1)), ("y negated",)),
            Kind("x and y of all photographs exchanged", geometry, image_points(exchanged),
                 ("outside the format", "exchanged"), ("refused",)),
            Kind("names of one photograph's points moved by one", geometry, names_moved(3, 1),
                 (name, "names of its points moved by one row"), EITHER),
            Kind("names of one photograph's points moved by two", geometry, names_moved(3, -2),
                 (name, "names of its points moved by 2 rows"), EITHER),
            Kind("two photographs exchanged", geometry, photographs_exchanged(3, 6),
                 (name, other, "exchanged"), EITHER),
            Kind("strips without a common point", geometry, strips_apart, *_apart(geometry)),
            Kind("points of one photograph with names of their own", geometry, one_photograph_apart(3),
                 (name, "without a common point"), EITHER),
        ]  # fmt: skip
    return found


def _apart(geometry: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """With GNSS and INS, strips apart are no mistake, and adjusted as such; without, they have no datum."""
    return ((), ("accepted", *EITHER)) if geometry == "navigation" else (("2 parts without a common point",), EITHER)


def _of_control() -> list[Kind]:
    c = clean("control")
    names = c.points[c.control.point[~c.control.is_check]]
    n = clean("navigation")
    others = n.points[n.control.point[~n.control.is_check]]
    found = []
    for geometry, own in (("control", names), ("navigation", others)):
        found += [
            Kind("Z of the control negated", geometry, ground(negated(2)), ("Z negated",)),
            Kind("X and Y of the control exchanged", geometry, ground(exchanged), ("X and Y exchanged",)),
            Kind("control in millimetres", geometry, ground(times(1000.0)), ("millimetres",)),
            Kind("two control points exchanged", geometry, control_points(rows_exchanged(0, 2)),
                 (str(own[0]), str(own[2]), "exchanged")),
            Kind("two control points at one place", geometry, control_points(row_copied(0, 2)),
                 (str(own[0]), str(own[2]), "coordinates of")),
            Kind("one control point 10 m off in Z", geometry, control_points(row(1, plus(0.0, 0.0, 10.0))),
                 (str(own[1]), "Z +")),
            Kind("one control point 2 m off in X", geometry, control_points(row(1, plus(-2.0, 0.0, 0.0))),
                 (str(own[1]), "X -"), EITHER),
        ]  # fmt: skip
    found += [
        Kind("control in feet", "navigation", ground(times(FEET)), ("feet",)),
        Kind("heights of the control in feet", "navigation", ground(lambda xyz: xyz * [1.0, 1.0, FEET]), ("feet",)),
        Kind("control in degrees", "navigation", ground(as_degrees), ("degrees",)),
        Kind("control in degrees", "control", ground(as_degrees), ("degrees",)),
        Kind(
            "control in degrees, no start values",
            "control",
            both(without_start, ground(as_degrees)),
            ("degrees",),
            NO_RESULT,
        ),
        Kind("control in degrees", "crs", ground(geographic), ("degrees",)),
        Kind("control in another UTM zone", "crs", ground(in_zone(33)), ("UTM zone 33",)),
        Kind("X and Y of the control exchanged", "crs", ground(exchanged), ("X and Y exchanged",), EITHER),
        Kind("Z of the control negated", "crs", ground(negated(2)), ("Z negated",)),
        Kind("check points in feet", "track", ground(times(FEET)), ("feet",), EITHER),
        Kind("check points, X and Y exchanged", "track", ground(exchanged), ("X and Y exchanged",), EITHER),
        Kind("one check point 10 m off", "control", _check_off(10.0), ("off by",), EITHER),
    ]
    return found


def in_plan(factor: float) -> Callable[[np.ndarray], np.ndarray]:
    """Coordinates in another scale in plan about their middle."""

    def change(xyz: np.ndarray) -> np.ndarray:
        return xyz + (factor - 1.0) * (xyz - xyz.mean(axis=0)) * [1.0, 1.0, 0.0]

    return change


def turned_in_plan(angle: float) -> Callable[[np.ndarray], np.ndarray]:
    """Coordinates turned by a small angle, rad, about their middle."""

    def change(xyz: np.ndarray) -> np.ndarray:
        off = xyz - xyz.mean(axis=0)
        return xyz + angle * np.column_stack([-off[:, 1], off[:, 0], 0.0 * off[:, 0]])

    return change


def tilted(metres: float) -> Callable[[np.ndarray], np.ndarray]:
    """Heights that rise by so much from the smallest X to the largest."""

    def change(xyz: np.ndarray) -> np.ndarray:
        rise = (xyz[:, 0] - xyz[:, 0].min()) / np.ptp(xyz[:, 0])
        return xyz + metres * rise[:, None] * [0.0, 0.0, 1.0]

    return change


def bent(metres: float) -> Callable[[np.ndarray], np.ndarray]:
    """Heights that rise from the middle to the outermost point, as if the Earth's curvature were left out."""

    def change(xyz: np.ndarray) -> np.ndarray:
        off = np.linalg.norm((xyz - xyz.mean(axis=0))[:, :2], axis=1)
        return xyz + metres * ((off / off.max()) ** 2)[:, None] * [0.0, 0.0, 1.0]

    return change


def every_second(metres: float) -> Callable[[np.ndarray], np.ndarray]:
    """Every second height higher, as with another pole."""
    return lambda xyz: xyz + metres * (np.arange(len(xyz)) % 2 == 0)[:, None] * [0.0, 0.0, 1.0]


def rounded(step: float) -> Callable[[np.ndarray], np.ndarray]:
    """Coordinates with too few digits."""
    return lambda xyz: np.round(xyz / step) * step


def rolling_shutter(way: float) -> Spoil:
    """Image points of a camera that moves by so many metres while its rows are read from the top to the bottom."""

    def spoil(block: Block) -> Block:
        rays, images, gnss = block.image_points, block.images, block.gnss_ins
        strip, centre = np.asarray(images.strip), np.full((len(images), 3), np.nan)
        centre[gnss.image] = gnss.xyz
        flight = np.zeros_like(centre)
        for name in np.unique(strip):
            rows = np.flatnonzero(strip == name)
            flight[rows] = (centre[rows[-1]] - centre[rows[0]]) / np.linalg.norm(centre[rows[-1]] - centre[rows[0]])
        moving = np.einsum("nji,nj->ni", rotation_from_angles(images.angles, block.rotation), flight)[rays.image]
        camera = block.cameras[0]
        above = np.mean(centre[:, 2]) - np.mean(block.control.xyz[:, 2])
        since = -rays.xy[:, 1:] / (2.0 * camera.half_format_mm[1])
        xy = rays.xy - way * since * camera.focal_length_mm / above * moving[:, :2]
        return replace(block, image_points=replace(rays, xy=xy))

    return spoil


def _that_fit_alone() -> list[Kind]:
    """Errors that all of a set share: every set fits by itself, and its residuals are small."""
    found = [
        Kind(
            "heights of the control tilted by 1 m, no INS",
            "navigation",
            both(ins(times(np.nan)), ground(tilted(1.0))),
            ("tilted by",),
            EITHER,
        ),
        Kind("control in distances of a grid, 1000 ppm", "navigation", ground(in_plan(0.999)), ("in scale",), EITHER),
        Kind("control turned by 1 mrad", "navigation", ground(turned_in_plan(1e-3)), ("turned in plan",), EITHER),
        Kind("GNSS in distances of a grid, 1000 ppm", "navigation", gnss(in_plan(0.999)), ("in scale",), EITHER),
        Kind(
            "rolling shutter of 0.3 m", "navigation", rolling_shutter(0.3), ("as by a rolling shutter", "cam"), EITHER
        ),
    ]
    for geometry in ("navigation", "control"):
        found += [
            Kind("control rounded to metres", geometry, control_points(rounded(1.0)), ("are rounded to",), EITHER),
            Kind("heights of the control bent by 2 m", geometry, control_points(bent(2.0)), ("like a bowl",), EITHER),
            Kind("every second control point 0.8 m too high", geometry, control_points(every_second(0.8)),
                 ("fall into two groups",), EITHER),
        ]  # fmt: skip
    return found


def _check_off(metres: float) -> Spoil:
    def spoil(block: Block) -> Block:
        control = block.control
        xyz = control.xyz.copy()
        xyz[np.flatnonzero(control.is_check)[2], 2] += metres
        return replace(block, control=replace(control, xyz=xyz))

    return spoil


def _of_navigation() -> list[Kind]:
    n, t = clean("navigation"), clean("track")
    found = [
        Kind("GNSS 10 m too high", "navigation", gnss(plus(0.0, 0.0, 10.0)), ("10", "too high")),
        Kind("GNSS 10 m too high", "crs", gnss(plus(0.0, 0.0, 10.0)), ("10", "too high")),
        Kind("GNSS 45 m too low (geoid)", "navigation", gnss(plus(0.0, 0.0, -45.0)), ("too low",)),
        Kind("GNSS 45 m too high", "track", gnss(plus(0.0, 0.0, 45.0)), ("too high",), EITHER),
        Kind("GNSS shifted by one photograph", "navigation", gnss(rolled(1)), ("shifted by one photograph",)),
        Kind("GNSS shifted by one photograph", "track", gnss(rolled(-1)), ("shifted by one photograph",)),
        Kind("GNSS shifted by one photograph", "crs", gnss(rolled(1)), ("shifted by one photograph",)),
        Kind("X and Y of GNSS exchanged", "navigation", gnss(exchanged), ("X and Y exchanged",)),
        Kind("X and Y of GNSS exchanged", "track", gnss(exchanged), ("X and Y exchanged",), NO_RESULT),
        Kind("X and Y of GNSS exchanged", "crs", gnss(exchanged), ("X and Y exchanged",)),
        Kind("Z of GNSS negated", "navigation", gnss(negated(2)), ("Z negated",)),
        Kind("GNSS in millimetres", "navigation", gnss(times(1000.0)), ("millimetres",)),
        Kind("GNSS in feet", "navigation", gnss(times(FEET)), ("feet",)),
        Kind("GNSS in degrees", "navigation", gnss(as_degrees), ("degrees",)),
        Kind("GNSS in another UTM zone", "crs", gnss(in_zone(31)), ("UTM zone 31",)),
        Kind("two GNSS positions exchanged", "navigation", gnss(rows_exchanged(2, 7)),
             (photograph(n, 2), photograph(n, 7), "exchanged")),
        Kind("two GNSS positions exchanged", "track", gnss(rows_exchanged(2, 7)),
             (photograph(t, 2), photograph(t, 7), "exchanged")),
        Kind("one GNSS position 5 m off", "navigation", gnss(row(4, plus(5.0, 0.0, 0.0))),
             (photograph(n, 4), "off by"), EITHER),
        Kind("INS: gon given as degrees", "navigation", ins(times(1.0 / 0.9)), ("gon",)),
        Kind("INS: degrees given as gon", "navigation", ins(times(0.9)), ("degrees",)),
        Kind("INS: radians given as degrees", "navigation", ins(times(np.pi / 180.0)), ("radians",)),
        Kind("INS: kappa + 180°", "navigation", ins(KAPPA_180), ("180° added to kappa",)),
        Kind("INS: omega and phi exchanged", "navigation", ins(exchanged), ("omega and phi exchanged",)),
        Kind("INS: y of the camera pointing down", "navigation", ins(camera_turned(n)), ("y of the camera",)),
        Kind("INS: kappa of four photographs + 180°", "navigation", ins(of_rows(np.arange(1, 5), KAPPA_180)),
             ("180° added to kappa",)),
        Kind("INS: phi of one photograph + 120°", "navigation", ins(row(4, PHI_120)), (photograph(n, 4), "left out"),
             EITHER),
        Kind("INS in the order phi-omega-kappa", "navigation", ins(in_other_order(n)), ("phi-omega-kappa",), EITHER),
    ]  # fmt: skip
    return found


def _of_start_values() -> list[Kind]:
    c = clean("control")
    one, turned = row(4, KAPPA_180), ("180° added to kappa",)
    return [
        Kind("kappa of the start values + 180°", "control", start_angles(KAPPA_180), turned, HARMLESS),
        Kind("kappa of the start values + 180°", "navigation", start_angles(KAPPA_180), turned,
             HARMLESS),
        Kind("kappa of one start value + 180°", "control", start_angles(one), (photograph(c, 4), "kappa"), HARMLESS),
        Kind("phi of one start value + 120°", "control", start_angles(row(4, PHI_120)), (photograph(c, 4),), HARMLESS),
        Kind("phi of one start value + 120°", "crs", start_angles(row(4, PHI_120)), (photograph(c, 4),), HARMLESS),
        Kind("kappa of one strip's start values + 180°", "control",
             start_angles(of_rows(of_strip(c, "1"), KAPPA_180)), turned, HARMLESS),
        Kind("start angles: y of the camera pointing down", "control", start_angles(camera_turned(c)),
             ("y of the camera",), HARMLESS),
        Kind("start angles: omega + 180°", "control", start_angles(plus(np.pi, 0.0, 0.0)), ("omega",), HARMLESS),
        Kind("start angles: gon given as degrees", "control", start_angles(times(1.0 / 0.9)), ("gon",), HARMLESS),
        Kind("start angles: radians given as degrees", "control", start_angles(times(np.pi / 180.0)), ("radians",),
             HARMLESS),
        Kind("start positions shifted by one photograph", "control", start_positions(rolled(1)),
             ("shifted by one photograph",), HARMLESS),
        Kind("positions (GNSS and start) shifted by one photograph", "navigation",
             both(start_positions(rolled(1)), gnss(rolled(1))), ("shifted by one photograph",)),
        Kind("X and Y of start values exchanged", "control", start_positions(exchanged), ("X and Y exchanged",),
             HARMLESS),
    ]  # fmt: skip


def _of_the_camera() -> list[Kind]:
    found = []
    for geometry in ("navigation", "control", "crs"):
        found += [
            Kind("focal length a tenth", geometry, focal_length(0.1), ("10", "principal distance")),
            Kind("focal length + 10 %", geometry, focal_length(1.1), ("0.909", "principal distance"), EITHER),
        ]
    found += [
        Kind("focal length 24 for 35 mm", "navigation", focal_length(24.0 / 35.0), ("1.458", "principal distance")),
        Kind("focal length 24 for 35 mm", "track", focal_length(24.0 / 35.0), ("1.45", "principal distance"), EITHER),
        Kind("focal length times ten", "navigation", focal_length(10.0), ("0.1 ", "principal distance")),
        Kind("pixel of half the size", "navigation", image_points(times(0.5)), ("principal distance", "pixel")),
    ]
    return found


@dataclass(frozen=True)
class Answer:
    """What the command said of a block: verdict ('refused' where it ended with 2), exit code, σ0, check points.

    Parameters
    ----------
    check : RMS of the check points over their σ, NaN without any. reasons : as in adjustment.json, or the refusal.
    """

    verdict: str
    exit_code: int
    sigma0: float
    check: float
    reasons: tuple[str, ...]

    @property
    def text(self) -> str:
        return " ".join(self.reasons)

    @property
    def cause(self) -> str:
        return self.reasons[0] if self.reasons else ""


def answer_of(block: Block, folder: Path) -> Answer:
    """The block written, read and adjusted by the command."""
    write_block(block, folder / "block")
    out = io.StringIO()
    try:
        with contextlib.redirect_stdout(out):
            code = run_adjust(folder / "block", folder / "result", None, None, None, False, True)
    except InputError as error:
        return Answer("refused", 2, np.nan, np.nan, (str(error),))
    said = json.loads(out.getvalue())
    sigma0 = said["sigma0"] if said["sigma0"] is not None else np.nan
    check = np.nan
    if (folder / "result" / "check.csv").is_file():
        with open(folder / "result" / "check.csv", encoding="utf-8", newline="") as file:
            w = np.array([float(row[f"w{a}"] or "nan") for row in csv.DictReader(file) for a in "XYZ"])
        check = float(np.sqrt(np.nanmean(w**2))) if np.isfinite(w).any() else np.nan
    return Answer(said["verdict"], code, sigma0, check, tuple(said["reasons"]))


def misses(kind: Kind, answer: Answer) -> list[str]:
    """Where an answer is not what a kind asks for."""
    wrong = []
    if answer.verdict not in kind.verdicts:
        wrong.append(f"verdict {answer.verdict}")
    if answer.exit_code != {"accepted": 0, "doubtful": 0, "rejected": 1, "refused": 2}[answer.verdict]:
        wrong.append(f"exit {answer.exit_code}")
    if answer.verdict == "accepted":
        return wrong + (["check points do not agree"] if not answer.check < CHECKED else [])
    return wrong + [f"“{word}” is not said" for word in kind.words if word not in answer.text]
