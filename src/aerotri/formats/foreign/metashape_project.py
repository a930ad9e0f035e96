"""Metashape's projects (.psx, .psz) and exported cameras (XML) as a block.

Photographs, sensors, markers with their image points, reference accuracies, positions and tie points are read. Pixels
begin at the corner of the upper left one. Of markers only those image points count that a person has placed or
confirmed (pinned). Markers whose reference is switched off are check points.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from aerotri.conventions import FilePath, InputError, counted, mm_from_px
from aerotri.coordinates.georeference import georeference, is_projected, utm_on_datum
from aerotri.coordinates.local_frame import topocentric_frame
from aerotri.crs_text import plan_of
from aerotri.formats.assembly import placing
from aerotri.formats.assembly.parts import Reading, no_sigma, texts
from aerotri.formats.foreign.colmap_rigs import COLMAP_FROM_CAMERA
from aerotri.formats.foreign.metashape_chunk import (
    Sensor,
    accuracies_of,
    crs_of,
    is_on,
    names_of,
    numbers,
    other_components,
    place_of,
    rotation_of,
    sensors_of,
    transform_of,
)
from aerotri.formats.foreign.metashape_files import REMEDY, Project, open_project, read_ply
from aerotri.formats.foreign.metashape_markers import Rays, markers_of
from aerotri.formats.foreign.reconstruction import unknown_lens, with_same_lens
from aerotri.formats.text.notes import left_behind, taken
from aerotri.formats.text.tables import LARGEST_FORMAT_PX, LARGEST_NUMBER
from aerotri.functional_model.rotation import angles_from_rotation, rotation_from_angles
from aerotri.observations import (
    AdjustmentSettings,
    Block,
    Camera,
    Control,
    GnssIns,
    ImagePoints,
    Images,
    Mounting,
    Rig,
    Settings,
)
from aerotri.observations.rigs import STATION

LARGEST_ID = 1 << 40
"""Of tie points [C]."""
HIGHEST_M = 1e5
"""Above the ellipsoid, or below it [C]."""


@dataclass(frozen=True, eq=False)
class _Photographs:
    """The photographs of a chunk.

    Parameters
    ----------
    elements : of the cameras that are switched on. names : by id. row : by id.
    sensors : by id. sensor : (n,) place of each photograph's among these.
    """

    elements: list[Element]
    names: dict[str, str]
    row: dict[str, int]
    sensors: dict[str, Sensor]
    sensor: np.ndarray


def read_metashape_project(path: FilePath, pixel_um: float | None = None) -> Reading:
    """The active chunk of a project, or exported cameras.

    Focal lengths, and of principal point and lens what Metashape estimated, are free unless it held them.

    Parameters
    ----------
    path : .psx, .psz or .xml.
    pixel_um : size of a pixel; None: as the project says.

    Returns
    -------
    Reading
        In the coordinate system of the chunk; one in degrees is brought to UTM.

    Raises
    ------
    InputError
        When something is missing, damaged or cannot be expressed, naming the file.
    """
    project = open_project(Path(path))
    path, chunk = project.path, project.chunk
    photographs = _photographs(chunk, pixel_um, path)
    accuracy, crs = accuracies_of(chunk, path), crs_of(chunk, path)
    markers = markers_of(project, photographs.row, accuracy)
    labels, marks = markers.labels, markers.rays
    names, start, ties, about_ties = _tie_points(project, photographs, accuracy["tiepoints"], len(labels))
    prefix = "tie point " if any(label[:1] == "t" and label[1:].isdigit() for label in labels) else "t"
    rays = Rays(
        np.concatenate([marks.image, ties.image]),
        np.concatenate([marks.point, ties.point]),
        np.vstack([marks.px, ties.px]),
        np.concatenate([marks.sigma, ties.sigma]),
    )
    cameras = tuple(sensor.camera for sensor in photographs.sensors.values())
    rigs, station = _rigs(photographs)
    centre, rotation, elsewhere, of_parts = _poses(photographs, chunk, path)
    # tie points of other components have places in axes of their own
    strange = ties.point[elsewhere[ties.image]] - len(labels)
    start[strange] = np.nan
    block = Block(
        name=path.stem,
        cameras=with_same_lens(cameras),
        images=Images(
            texts(list(photographs.names.values())),
            photographs.sensor,
            np.full(len(centre), ""),
            centre,
            angles_from_rotation(rotation),
            columns={STATION: station} if rigs else {},
        ),
        points=texts([*labels, *(f"{prefix}{name}" for name in names)]),
        image_points=_image_points(rays, cameras, photographs.sensor),
        rigs=rigs,
        settings=Settings(
            AdjustmentSettings(additional_parameters=unknown_lens(cameras), datum="minimal"),
            image_sigma_um=accuracy["tiepoints"] * cameras[0].pixel_um,
        ),
    )
    moved = _moved(Reading(block, np.vstack([no_sigma(len(labels)), start])), chunk, crs, path)
    control = Control(np.arange(len(labels)), markers.xyz, markers.sigma, markers.is_check)
    reading = _with_reference(moved, control, _positions(photographs, accuracy["cameras"], path), crs)
    rolling = any(node.find("rolling_shutter") is not None for node in photographs.elements)
    about = "rolling shutter corrections are not carried over: state [camera.NAME.rolling_shutter]"
    said = (left_behind(about),) * rolling
    return replace(
        reading, messages=(*project.messages, *reading.messages, *of_parts, *markers.messages, *about_ties, *said)
    )


def _photographs(chunk: Element, pixel_um: float | None, path: Path) -> _Photographs:
    elements = [node for node in chunk.findall("cameras//camera") if is_on(node, "enabled")]
    names = names_of(elements, "photograph", path)
    if not names:
        raise InputError("its chunk holds no photographs", REMEDY, path)
    sensors = sensors_of(chunk, {node.get("sensor_id", "") for node in elements}, pixel_um, path)
    place = {key: i for i, key in enumerate(sensors)}
    sensor = np.array([place[node.get("sensor_id", "")] for node in elements], dtype=np.int64)
    return _Photographs(elements, names, {key: row for row, key in enumerate(names)}, sensors, sensor)


def _image_points(rays: Rays, cameras: tuple[Camera, ...], of_image: np.ndarray) -> ImagePoints:
    xy, sigma, of_ray = np.empty_like(rays.px), np.empty_like(rays.px), of_image[rays.image]
    for number_, camera in enumerate(cameras):
        own = of_ray == number_
        xy[own] = mm_from_px(rays.px[own], camera.size_px, camera.pixel_mm)
        sigma[own] = rays.sigma[own, None] * camera.pixel_mm
    return ImagePoints(rays.image, rays.point, xy, sigma)


def _rigs(photographs: _Photographs) -> tuple[tuple[Rig, ...], np.ndarray]:
    """Sensors that one leads, and the exposure of every photograph."""
    sensors, place = photographs.sensors, list(photographs.sensors)
    led = {key: sensor.master for key, sensor in sensors.items() if sensor.master in sensors}
    out = []
    for number_, lead in enumerate(dict.fromkeys(led.values()), 1):
        others = {sensors[key].camera.name: Mounting(known=False) for key, master in led.items() if master == lead}
        out.append(Rig(f"rig{number_}", sensors[lead].camera.name, others))
    station = []
    for node, sensor in zip(photographs.elements, photographs.sensor.tolist(), strict=True):
        key = place[sensor]
        master = node.get("master_id", "") if key in led else node.get("id", "")
        belongs = key in led.values() or (
            master in photographs.row and place[photographs.sensor[photographs.row[master]]] == led.get(key)
        )
        station.append(master if belongs else "")
    return tuple(out), np.array(station, dtype=object)


def _poses(
    photographs: _Photographs, chunk: Element, path: Path
) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[str]]:
    """(n, 3) projection centres and (n, 3, 3) rotations camera → chunk, NaN where there are none; what to say.

    Those of components with a transformation of their own are brought into the axes of the active one; between, (n,)
    bool, which photographs are of other components than that.
    """
    count = len(photographs.elements)
    centre, rotation, elsewhere = no_sigma(count), np.full((count, 3, 3), np.nan), np.zeros(count, bool)
    others, left = other_components(chunk, path), Counter[str]()
    for row, node in enumerate(photographs.elements):
        found = node.find("transform")
        if found is not None:
            label = node.get("label", "")
            matrix = numbers(found, 16, f"the transform of photograph '{label}'", path).reshape(4, 4)
            turn = rotation_of(matrix[:3, :3].ravel(), f"the transform of photograph '{label}'", path)
            elsewhere[row] = node.get("component_id", "") in others
            part, between = others.get(node.get("component_id", ""), ("", (np.eye(3), np.zeros(3), 1.0)))
            if between is None:
                left[part] += 1
                continue
            r, t, s = between
            centre[row], rotation[row] = t + s * r @ matrix[:3, 3], r @ turn @ COLMAP_FROM_CAMERA
    said: list[str] = [
        left_behind(
            f"{counted(n, 'photograph')} of component '{part[:60]}' without orientation: its axes are tied to no others"
        )
        for part, n in left.items()
    ]
    return centre, rotation, elsewhere, said


def _tie_points(
    project: Project, photographs: _Photographs, sigma_px: float, first: int
) -> tuple[list[str], np.ndarray, Rays, list[str]]:
    """Names and (N, 3) places in the chunk of the tie points, their image points, and what to say.

    Parameters
    ----------
    first : row of the first one among all points.
    """
    nothing = Rays(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros(0))
    cloud, path = project.cloud, project.path
    if cloud is None:
        return [], no_sigma(0), nothing, ["holds no tie points: only the image points of markers are read"]
    listed = cloud.find("points")
    if listed is None or not listed.get("path"):
        raise InputError("its tie points have no places", "align the photographs", path)
    table = read_ply(project.member(listed.get("path", "")), ("id", "x", "y", "z"), listed.get("path", ""), path)
    ids, first_of = np.unique(table["id"].astype(np.int64), return_index=True)
    xyz = np.column_stack([table[key].astype(float) for key in ("x", "y", "z")])[first_of]
    if len(ids) and not (ids[0] >= 0 and ids[-1] < LARGEST_ID and (np.abs(xyz) <= LARGEST_NUMBER).all()):
        raise InputError("a tie point lies at no possible place", REMEDY, path)
    parts, left = [], 0
    for node in cloud.findall("projections"):
        row = photographs.row.get(node.get("camera_id", ""))
        if row is not None:
            name = node.get("path", "")
            found = read_ply(project.member(name), ("x", "y", "id"), name, path)
            track = found["id"].astype(np.int64)
            place = np.searchsorted(ids, track)
            known = np.flatnonzero(np.append(ids, -1)[place] == track)
            # a track may hold two image points of one photograph; a block's point may not
            _, once = np.unique(track[known], return_index=True)
            known = known[np.sort(once)]
            left += len(track) - len(known)
            px = np.column_stack([found["x"], found["y"]]).astype(float)[known]
            parts.append((np.full(len(known), row), place[known], px))
    if not parts:
        return [], no_sigma(0), nothing, ["holds no image points of tie points"]
    image, point, px = (np.concatenate(several) for several in zip(*parts, strict=True))
    if not (np.abs(px) <= LARGEST_FORMAT_PX).all():
        raise InputError("an image point lies outside of any photograph", REMEDY, path)
    used, point = np.unique(point, return_inverse=True)
    rays = Rays(image.astype(np.int64), point.ravel() + first, px, np.full(len(image), sigma_px))
    about = f"left out: {counted(left, 'image point')} of tie points without place, or twice in a photograph"
    return ids[used].astype(str).tolist(), xyz[used], rays, [left_behind(about)] if left else []


def _moved(reading: Reading, chunk: Element, crs: str, path: Path) -> Reading:
    """From the chunk's own coordinates to those of its system."""
    transform, block = transform_of(chunk, path), reading.block
    if transform is None:
        return reading if crs == "local" else replace(reading, messages=("the chunk is not georeferenced",))
    rotation, translation, scale = transform
    origin = None
    if crs != "local":
        there = np.isfinite(block.images.centre).all(axis=1)
        middle = block.images.centre[there].mean(axis=0) if there.any() else np.zeros(3)
        plain = georeference(plan_of(crs), np.zeros((0, 3)))
        lon, lat, height = plain.from_geocentric((translation + scale * rotation @ middle)[None])[0].tolist()
        if not np.isfinite([lon, lat, height]).all() or abs(height) > HIGHEST_M:
            raise InputError("its chunk does not lie on the earth", "georeference it, or make its system local", path)
        origin = (lon, lat, height)
        frame = topocentric_frame(plan_of(crs), np.array(origin))
        turn = frame.local_from_geocentric
        rotation, translation = turn @ rotation, turn @ (translation - frame.origin_geocentric)
    turned = rotation @ rotation_from_angles(block.images.angles, block.rotation)
    images = replace(
        block.images,
        centre=translation + scale * block.images.centre @ rotation.T,
        angles=angles_from_rotation(turned, block.rotation),
    )
    points = None if reading.points is None else translation + scale * reading.points @ rotation.T
    return Reading(replace(block, images=images), points, (), origin)


def _positions(photographs: _Photographs, default: float, path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows, coordinates and σ of photographs with a complete reference that is switched on."""
    rows, xyz, sigma = [], [], []
    for row, node in enumerate(photographs.elements):
        reference = node.find("reference")
        if reference is not None and is_on(reference, "enabled"):
            place, own = place_of(reference, default, path)
            if np.isfinite(place).all():
                rows.append(row)
                xyz.append(place)
                sigma.append(own)
    return np.array(rows, np.int64), np.array(xyz, float).reshape(-1, 3), np.array(sigma, float).reshape(-1, 3)


def _with_reference(
    reading: Reading, control: Control, positions: tuple[np.ndarray, np.ndarray, np.ndarray], crs: str
) -> Reading:
    """Markers and positions added, everything in the coordinate system of the block."""
    rows, xyz, sigma = positions
    messages = list(reading.messages)
    known = control.xyz[np.isfinite(control.xyz).any(axis=1)]
    referenced = len(rows) > 0 or len(known) > 0
    if crs != "local":
        target = crs
        if not is_projected(plan_of(crs)):
            places = np.vstack([xyz, known])
            at = reading.origin or (tuple(np.nanmean(places, axis=0)[:2]) if len(places) else None)
            if at is None:
                return replace(reading, messages=(*messages, "nothing says where the chunk lies"))
            target = utm_on_datum(plan_of(crs), float(at[0]), float(at[1]))
            messages.append(taken(f"coordinates in degrees ({crs}) were brought to {target}, heights are ellipsoidal"))
        if reading.origin is not None:
            reading = placing.in_crs(reading, target)
        else:
            unknown = no_sigma(len(reading.block.images))
            images = replace(reading.block.images, centre=unknown, angles=unknown)
            reading = Reading(replace(reading.block, crs=target, images=images))
        xyz = placing.to_crs(xyz, crs, target, None)
        control = replace(control, xyz=placing.to_crs(control.xyz, crs, target, None) if len(known) else control.xyz)
    keep = np.isfinite(control.xyz).any(axis=1)
    control = Control(control.point[keep], control.xyz[keep], control.sigma[keep], control.is_check[keep])
    unknown = no_sigma(len(rows))
    observed = GnssIns(rows, xyz, sigma, unknown, unknown, unknown[:, 0]) if len(rows) else None
    settings = reading.block.settings
    if referenced:
        settings = replace(settings, adjustment=replace(settings.adjustment, datum="control"))
    block = replace(reading.block, control=control, gnss_ins=observed, settings=settings)
    return replace(reading, block=block, messages=tuple(messages))
