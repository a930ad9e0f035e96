"""Cameras for Metashape: sensors, orientations and markers in the XML file that it imports.

Coordinates of the chunk are local axes at the block; the chunk's transformation leads from there to earth-centred
coordinates, or, for a local block, changes nothing. Photographs are matched by their labels.
"""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from aerotri.conventions import FilePath, InputError, px_from_mm
from aerotri.coordinates.blocks import frame_of_block
from aerotri.formats.assembly.losses import losses
from aerotri.formats.assembly.oriented import OrientedBlock
from aerotri.formats.files.atomic import atomic_file
from aerotri.formats.foreign.colmap_rigs import COLMAP_FROM_CAMERA
from aerotri.formats.foreign.metashape_camera import PROJECTIONS, calibration_of, expressible
from aerotri.observations.rigs import station_places

VERSION = "2.0.0"
"""Of the document."""
LOCAL = (
    'LOCAL_CS["Local Coordinates (m)",LOCAL_DATUM["Local Datum",0],UNIT["metre",1,AUTHORITY["EPSG","9001"]],'
    'AXIS["X",EAST],AXIS["Y",NORTH],AXIS["Z",UP]]'
)


@dataclass(frozen=True, eq=False)
class _Chunk:
    """Orientations in the chunk's own axes and the way to its system.

    Parameters
    ----------
    centre : (n, 3) m; rotation : (n, 3, 3) camera → chunk.
    transform : (3, 4) to earth-centred or local coordinates. reference : WKT of its system.
    """

    centre: np.ndarray
    rotation: np.ndarray
    transform: np.ndarray
    reference: str


def write_metashape_cameras(oriented: OrientedBlock, path: FilePath) -> tuple[str, ...]:
    """Write sensors, orientations and markers.

    What Metashape's lenses have no words for is fitted over the format. Control points are markers with their image
    points, check points markers whose reference is switched off.

    Parameters
    ----------
    path : .xml file to be.

    Returns
    -------
    What could not be carried over, in words.

    Raises
    ------
    InputError
        When nothing is oriented, or the block's coordinate system has no WKT of Metashape.
    """
    rows, chunk = oriented.rows_with_orientation("a file of cameras"), _chunk(oriented)
    root = Element("document", version=VERSION)
    top = SubElement(root, "chunk", label=oriented.block.name, enabled="true")
    said = _add_sensors(top, oriented)
    _add_cameras(top, oriented, chunk, rows)
    _add_markers(top, oriented)
    SubElement(top, "reference").text = chunk.reference
    transform = SubElement(top, "transform")
    SubElement(transform, "rotation", locked="true").text = _words(chunk.transform[:, :3])
    SubElement(transform, "translation", locked="true").text = _words(chunk.transform[:, 3])
    SubElement(transform, "scale", locked="true").text = "1"
    ElementTree.indent(root)
    with atomic_file(path) as place:
        ElementTree.ElementTree(root).write(place, encoding="UTF-8", xml_declaration=True)
    held = ("cameras", "principal points", "lens", "orientations", "control", "check points", "control sigmas", "crs")
    ties = len(oriented.block.points) > len(oriented.block.control)
    lost = [text for text in losses(oriented.block, *held) if ties or "image point" not in text]
    return (*lost, *oriented.unoriented(), *said)


def _words(values: np.ndarray) -> str:
    return " ".join(repr(value) for value in values.ravel().tolist())


def _chunk(oriented: OrientedBlock) -> _Chunk:
    block = oriented.block
    if block.crs == "local":
        middle = np.nanmean(oriented.centre, axis=0)
        transform = np.column_stack([np.eye(3), middle])
        return _Chunk(oriented.centre - middle, oriented.rotation, transform, LOCAL)
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    # of its heights only the ellipsoid counts for the transformation, which a geoid would not change
    frame = frame_of_block(block)
    there, rotation = oriented.oriented, oriented.rotation.copy()
    rotation[there] = frame.axes_at(oriented.centre[there]) @ oriented.rotation[there]
    try:
        reference = CRS(block.crs).to_wkt("WKT1_GDAL")
    except CRSError as error:
        remedy = "bring the block into such a system"
        raise InputError(f"{block.crs} has no description that Metashape knows", remedy) from error
    transform = np.column_stack([frame.local_from_geocentric.T, frame.origin_geocentric])
    return _Chunk(frame.to_local(oriented.centre), rotation, transform, reference)


def _add_sensors(top: Element, oriented: OrientedBlock) -> tuple[str, ...]:
    """The sensors, numbered as the block's cameras; what was fitted, in words."""
    block, said = oriented.block, []
    leads = {camera: rig.reference for rig in block.rigs for camera in rig.cameras}
    number = {camera.name: str(k) for k, camera in enumerate(block.cameras)}
    section = SubElement(top, "sensors", next_id=str(len(block.cameras)))
    for k, camera in enumerate(block.cameras):
        whole, words = expressible(camera, oriented.format_errors[k] if oriented.format_errors else None)
        said += words
        kind = next(name for name, projection in PROJECTIONS.items() if projection == camera.projection)
        sensor = SubElement(section, "sensor", id=str(k), label=camera.name, type=kind)
        if camera.name in leads:
            sensor.set("master_id", number[leads[camera.name]])
        width, height = (str(side) for side in camera.size_px)
        SubElement(sensor, "resolution", width=width, height=height)
        for name, value in (("pixel_width", camera.pixel_mm), ("pixel_height", camera.pixel_mm),
                            ("focal_length", camera.focal_length_mm), ("layer_index", 0)):  # fmt: skip
            SubElement(sensor, "property", name=name, value=repr(value))
        calibration = SubElement(sensor, "calibration", {"type": kind, "class": "adjusted"})
        SubElement(calibration, "resolution", width=width, height=height)
        for key, value in calibration_of(whole).items():
            SubElement(calibration, key).text = repr(value)
    return tuple(said)


def _add_cameras(top: Element, oriented: OrientedBlock, chunk: _Chunk, rows: np.ndarray) -> None:
    images, places = oriented.block.images, station_places(oriented.block)
    section = SubElement(top, "cameras", next_id=str(len(images)), next_group_id="0")
    there = set(rows.tolist())
    for row, name in enumerate(images.names.tolist()):
        camera = SubElement(section, "camera", id=str(row), sensor_id=str(images.camera[row]), label=name)
        if places.lead[row] != row:
            camera.set("master_id", str(places.lead[row]))
        if row in there:
            pose = np.eye(4)
            pose[:3, :3], pose[:3, 3] = chunk.rotation[row] @ COLMAP_FROM_CAMERA, chunk.centre[row]
            SubElement(camera, "transform").text = _words(pose)
        SubElement(camera, "orientation").text = "1"


def _add_markers(top: Element, oriented: OrientedBlock) -> None:
    """Control and check points, and their image points."""
    block, rays = oriented.block, oriented.block.image_points
    if not len(block.control):
        return
    section = SubElement(top, "markers", next_id=str(len(block.control)), next_group_id="0")
    frame = SubElement(SubElement(top, "frames", next_id="1"), "frame", id="0")
    marked = SubElement(frame, "markers")
    row_of = np.full(len(block.points), -1)
    row_of[block.control.point] = np.arange(len(block.control))
    own = np.flatnonzero(row_of[rays.point] >= 0)
    own = own[np.argsort(row_of[rays.point[own]], kind="stable")]
    bounds = np.searchsorted(row_of[rays.point[own]], np.arange(len(block.control) + 1))
    for k, point in enumerate(block.control.point.tolist()):
        marker = SubElement(section, "marker", id=str(k), label=str(block.points[point]))
        enabled = "false" if block.control.is_check[k] else "true"
        reference = {key: repr(value) for key, value in zip("xyz", block.control.xyz[k].tolist(), strict=True)}
        sigma = {f"s{key}": repr(value) for key, value in zip("xyz", block.control.sigma[k].tolist(), strict=True)}
        known = {key: text for key, text in (reference | sigma).items() if text != "nan"}
        SubElement(marker, "reference", known | {"enabled": enabled})
        places = SubElement(marked, "marker", marker_id=str(k))
        for ray in own[bounds[k] : bounds[k + 1]].tolist():
            camera = block.cameras[block.images.camera[rays.image[ray]]]
            x, y = px_from_mm(rays.xy[ray], camera.size_px, camera.pixel_mm).tolist()
            place = {"camera_id": str(rays.image[ray]), "pinned": "true", "x": repr(x), "y": repr(y)}
            SubElement(places, "location", place)
