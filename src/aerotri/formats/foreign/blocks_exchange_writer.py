"""A BlocksExchange XML of a block or a result, for ContextCapture, iTwin Capture and programs that read it.

See `blocks_exchange_xml` for units, axes and signs. Rotations are matrices, positions pixels from the centre of the
upper left one.
"""

from __future__ import annotations

from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from aerotri.conventions import FilePath, InputError, counted, px_from_mm
from aerotri.formats.assembly.losses import losses
from aerotri.formats.assembly.oriented import OrientedBlock
from aerotri.formats.files.atomic import atomic_file
from aerotri.formats.foreign.blocks_exchange_xml import HALF_PIXEL
from aerotri.formats.foreign.colmap_rigs import COLMAP_FROM_CAMERA
from aerotri.formats.foreign.lens_fit import expressible_camera
from aerotri.observations import Block, Camera

VERSION = "3.2"
LENS = ("k1", "k2", "p1", "p2", "k3", "b1")
"""What Distortion and AspectRatio hold."""
HELD = (
    "cameras", "principal points", "lens", "image points", "orientations", "control", "check points", "control sigmas",
    "gnss", "crs",
)  # fmt: skip


def write_blocks_exchange(oriented: OrientedBlock, path: FilePath) -> tuple[str, ...]:
    """Write cameras, orientations, observed positions, control and check points, tie points and all image points.

    What the lens has no words for is fitted over the format. Object points are written where they are known.

    Parameters
    ----------
    path : .xml file to be.

    Returns
    -------
    What could not be carried over, in words.

    Raises
    ------
    InputError
        When nothing is oriented, a camera is a fisheye, or the coordinate system has no description.
    """
    block = oriented.block
    rows = oriented.rows_with_orientation("a block of photographs")
    root = Element("BlocksExchange", version=VERSION)
    definition = _definition(block)
    if definition:
        system = SubElement(SubElement(root, "SpatialReferenceSystems"), "SRS")
        for tag, text in (("Id", "0"), ("Name", definition.partition("[")[0]), ("Definition", definition)):
            SubElement(system, tag).text = text
    top = SubElement(root, "Block")
    SubElement(top, "Name").text = block.name
    if definition:
        SubElement(top, "SRSId").text = "0"
    said = _add_photogroups(top, oriented, rows)
    said += _add_points(top, oriented)
    ElementTree.indent(root)
    with atomic_file(path) as place:
        ElementTree.ElementTree(root).write(place, encoding="UTF-8", xml_declaration=True)
    return (*losses(block, *HELD), *oriented.unoriented(), *said)


def _definition(block: Block) -> str:
    """The coordinate system: codes where it has them, as ContextCapture writes them, else WKT; '' of local ones."""
    if block.crs == "local":
        return ""
    if "[" not in block.crs:
        return block.crs
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    try:
        return CRS(block.crs).to_wkt("WKT1_GDAL")
    except CRSError as error:
        message = "the coordinate system has no description that ContextCapture knows"
        raise InputError(message, "bring the block into a system with an EPSG code") from error


def _number(parent: Element, tag: str, value: float) -> None:
    SubElement(parent, tag).text = repr(float(value))


def _numbers(parent: Element, tag: str, values: dict[str, float]) -> Element:
    node = SubElement(parent, tag)
    for key, value in values.items():
        _number(node, key, value)
    return node


def _xyz(xyz: np.ndarray) -> dict[str, float]:
    return {key: value for key, value in zip("xyz", xyz.tolist(), strict=True) if np.isfinite(value)}


def _add_photogroups(top: Element, oriented: OrientedBlock, rows: np.ndarray) -> tuple[str, ...]:
    """A photogroup for every camera; what was fitted or left out, in words."""
    block, said = oriented.block, []
    section, there = SubElement(top, "Photogroups"), set(rows.tolist())
    observed = {} if block.gnss_ins is None else {row: k for k, row in enumerate(block.gnss_ins.image.tolist())}
    for number, camera in enumerate(block.cameras):
        errors = oriented.format_errors[number] if oriented.format_errors else None
        group = SubElement(section, "Photogroup")
        said += _add_camera(group, camera, errors)
        for row in np.flatnonzero(block.images.camera == number).tolist():
            photo = SubElement(group, "Photo")
            SubElement(photo, "Id").text = str(row)
            SubElement(photo, "ImagePath").text = str(block.images.names[row])
            SubElement(photo, "Component").text = "1" if row in there else "0"
            if row in there or row in observed:
                _add_pose(photo, oriented, row, row in there, observed.get(row))
    angles = 0 if block.gnss_ins is None else int(np.isfinite(block.gnss_ins.angles).all(axis=1).sum())
    if observed and any(block.settings.gnss.lever_arm_m):
        said.append("observed positions are those of the antenna: the lever arm could not be carried over")
    if angles:
        said.append(f"could not be carried over: {counted(angles, 'observed attitude')}")
    return tuple(said)


def _add_camera(group: Element, camera: Camera, errors: np.ndarray | None) -> tuple[str, ...]:
    if camera.is_fisheye:
        message = f"camera '{camera.name}' is a fisheye, whose formula is not published with the format"
        raise InputError(message, "write it as colmap or metashape-xml")
    whole, said = expressible_camera(camera, LENS, errors, "BlocksExchange")
    lens = {name: prior.value for name, prior in whole.lens.items()}
    width, height = camera.size_px
    SubElement(group, "Name").text = camera.name
    size = SubElement(group, "ImageDimensions")
    SubElement(size, "Width").text, SubElement(size, "Height").text = str(width), str(height)
    SubElement(group, "CameraModelType").text = "Perspective"
    along_x = whole.focal_length_mm * (1.0 + lens.get("b1", 0.0))
    _number(group, "FocalLength", along_x)
    _number(group, "SensorSize", max(width, height) * camera.pixel_mm)
    SubElement(group, "CameraOrientation").text = "XRightYDown"
    x, y = (px_from_mm(np.array(whole.principal_point_mm), camera.size_px, camera.pixel_mm) - HALF_PIXEL).tolist()
    _numbers(group, "PrincipalPoint", {"x": x, "y": y})
    names = {"K1": ("k1", 1.0), "K2": ("k2", 1.0), "K3": ("k3", 1.0), "P1": ("p2", 1.0), "P2": ("p1", -1.0)}
    _numbers(group, "Distortion", {tag: sign * lens.get(name, 0.0) for tag, (name, sign) in names.items()})
    _number(group, "AspectRatio", whole.focal_length_mm / along_x)
    _number(group, "Skew", 0.0)
    return said


def _add_pose(photo: Element, oriented: OrientedBlock, row: int, is_oriented: bool, observation: int | None) -> None:
    pose = SubElement(photo, "Pose")
    if is_oriented:
        camera_from_world = COLMAP_FROM_CAMERA @ oriented.rotation[row].T
        matrix = {f"M_{i}{j}": camera_from_world[i, j] for i in range(3) for j in range(3)}
        _numbers(pose, "Rotation", matrix)
        _numbers(pose, "Center", _xyz(oriented.centre[row]))
    observed = oriented.block.gnss_ins
    if observation is None or observed is None or not np.isfinite(observed.xyz[observation]).all():
        return
    metadata = SubElement(pose, "Metadata")
    _numbers(metadata, "Center", _xyz(observed.xyz[observation]))
    plan, height = _accuracies(observed.sigma[observation])
    if np.isfinite([plan, height]).all() and min(plan, height) > 0.0:
        _number(metadata, "HorizontalAccuracy", plan)
        _number(metadata, "VerticalAccuracy", height)


def _accuracies(sigma: np.ndarray) -> tuple[float, float]:
    """σ of one coordinate in plan, the root mean square of X and Y, and of the height."""
    return float(np.sqrt(np.mean(sigma[:2] ** 2))), float(sigma[2])


def _add_points(top: Element, oriented: OrientedBlock) -> tuple[str, ...]:
    """Control and check points, and tie points, with their image points; what is said of them."""
    block, rays = oriented.block, oriented.block.image_points
    order = np.argsort(rays.point, kind="stable")
    bounds = np.searchsorted(rays.point[order], np.arange(len(block.points) + 1))
    measured = [order[bounds[k] : bounds[k + 1]].tolist() for k in range(len(block.points))]
    section, row_of = (
        SubElement(top, "ControlPoints"),
        dict(zip(block.control.point.tolist(), range(len(block.control)), strict=True)),
    )
    for point, row in row_of.items():
        node = SubElement(section, "ControlPoint")
        SubElement(node, "Name").text = str(block.points[point])
        _add_control(node, block, row)
        _add_measurements(node, block, measured[point])
    section = SubElement(top, "TiePoints")
    for point in range(len(block.points)):
        if point not in row_of and measured[point]:
            node = SubElement(section, "TiePoint")
            SubElement(node, "Name").text = str(block.points[point])
            if np.isfinite(oriented.points[point]).all():
                _numbers(node, "Position", _xyz(oriented.points[point]))
            _add_measurements(node, block, measured[point])
    sigma = block.control.sigma
    differ = int((np.abs(sigma[:, 0] - sigma[:, 1]) > 1e-9).sum())
    return (f"σ of X and Y became one horizontal accuracy: {counted(differ, 'point')}",) if differ else ()


def _add_control(node: Element, block: Block, row: int) -> None:
    xyz, sigma = block.control.xyz[row], block.control.sigma[row]
    plan, height = np.isfinite(xyz[:2]).all(), np.isfinite(xyz[2])
    SubElement(node, "Category").text = "Full" if plan and height else "Horizontal" if plan else "Vertical"
    known = np.where([plan, plan, height], xyz, np.nan)
    _numbers(node, "Position", _xyz(known))
    SubElement(node, "CheckPoint").text = "true" if block.control.is_check[row] else "false"
    horizontal, vertical = _accuracies(sigma)
    if plan and horizontal > 0.0:
        _number(node, "HorizontalAccuracy", horizontal)
    if height and vertical > 0.0:
        _number(node, "VerticalAccuracy", vertical)


def _add_measurements(node: Element, block: Block, rays: list[int]) -> None:
    for ray in rays:
        image = int(block.image_points.image[ray])
        camera = block.cameras[block.images.camera[image]]
        x, y = (px_from_mm(block.image_points.xy[ray], camera.size_px, camera.pixel_mm) - HALF_PIXEL).tolist()
        measurement = SubElement(node, "Measurement")
        SubElement(measurement, "PhotoId").text = str(image)
        _number(measurement, "x", x)
        _number(measurement, "y", y)
