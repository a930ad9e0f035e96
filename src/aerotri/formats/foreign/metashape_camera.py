"""Metashape's camera calibration in XML, one camera a file: f, cx, cy, b1, b2 in pixels, k1 to k4, p1, p2.

[L] Metashape user manual, appendix on camera models: x' = x(1 + K1r² + … + K4r⁸) + P1(r² + 2x²) + 2P2xy, y' alike,
u = w/2 + cx + x'f + x'B1 + y'B2, v = h/2 + cy + y'f, with y down; of a fisheye (x, y) is the equidistant position. What
is 0 may be left out. It is the forward lens of `additional_parameters.lens` with p1 = −P2, p2 = P1, b1 = B1/f and b2 =
−B2/f.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.formats.assembly.losses import losses
from aerotri.formats.assembly.oriented import OrientedBlock
from aerotri.formats.files.atomic import atomic_file
from aerotri.formats.foreign.lens_fit import expressible_camera
from aerotri.formats.text.tables import LARGEST_FORMAT_PX, SMALLEST_POSITIVE
from aerotri.formats.text.text_lines import first_lines
from aerotri.formats.text.xml_text import child_text, numbers, read_xml
from aerotri.observations import Camera, Prior

ROOT = "calibration"
PROJECTIONS = {"frame": "perspective", "fisheye": "fisheye"}
RADIAL = ("k1", "k2", "k3", "k4")
NOT_EXPRESSED = ("p3", "p4", "skew")
"""Terms of old versions."""
OUR_LENS = (*RADIAL, "p1", "p2", "b1", "b2")


def is_metashape_camera(path: Path) -> bool:
    """Whether an XML file holds one calibration."""
    return path.suffix.lower() == ".xml" and any(f"<{ROOT}>" in line for line in first_lines(path, 5))


def read_metashape_camera(path: FilePath, pixel_um: float) -> Camera:
    """The camera of such a file, everything held; it is called as the file.

    Parameters
    ----------
    pixel_um : size of a pixel, which the file does not tell.

    Raises
    ------
    InputError
        When something is missing or impossible, or the projection is neither frame nor fisheye.
    """
    path = Path(path)
    root = read_xml(path)
    if root.tag != ROOT:
        raise InputError(f"is <{root.tag}>, no <{ROOT}>", "save the camera calibration of Metashape as XML", path)
    kind = child_text(root, "projection", path, "frame")
    if kind not in PROJECTIONS:
        raise InputError(f"projection '{kind[:40]}' cannot be expressed", f"known are {', '.join(PROJECTIONS)}", path)
    for name in NOT_EXPRESSED:
        if _number(root, name, path):
            raise InputError(f"<{name}> cannot be expressed", f"calibrate without {name}", path)
    size = (_number(root, "width", path, None), _number(root, "height", path, None))
    if not all(side == int(side) and 1 <= side <= LARGEST_FORMAT_PX for side in size):
        raise InputError("width and height are no format", "give columns and rows", path)
    f = _number(root, "f", path, None)
    if f < SMALLEST_POSITIVE:
        raise InputError("the focal length is not greater than 0", "calibrate the camera first", path)
    pixel_mm = pixel_um * 1e-3
    held = {
        "focal_length_mm": f * pixel_mm,
        "x0_mm": _number(root, "cx", path) * pixel_mm,
        "y0_mm": -_number(root, "cy", path) * pixel_mm,
    }
    values = {name: _number(root, name, path) for name in RADIAL}
    values |= {"p1": -_number(root, "p2", path), "p2": _number(root, "p1", path)}
    values |= {"b1": _number(root, "b1", path) / f, "b2": -_number(root, "b2", path) / f}
    return Camera(
        name=path.stem,
        model="frame",
        size_px=(int(size[0]), int(size[1])),
        pixel_um=pixel_um,
        interior={element: Prior(value, fixed=True) for element, value in held.items()},
        lens={name: Prior(value, fixed=True) for name, value in values.items() if value},
        projection=PROJECTIONS[kind],
    )


def _number(root: ElementTree.Element, tag: str, path: Path, default: str | None = "0") -> float:
    return numbers(child_text(root, tag, path, default), 1, tag, path)[0]


def write_metashape_camera(oriented: OrientedBlock, path: FilePath) -> tuple[str, ...]:
    """Write the calibration of a block's camera.

    What Metashape has no words for (additional parameters, denominators, thin prism) is fitted over the format.

    Returns
    -------
    What could not be carried over, in words.

    Raises
    ------
    InputError
        When the block has several cameras.
    """
    cameras = oriented.block.cameras
    if len(cameras) != 1:
        raise InputError(
            f"block '{oriented.block.name}' has {len(cameras)} cameras, the file holds one",
            "write a block of one camera",
        )
    (one,) = cameras
    camera, said = expressible(one, *oriented.format_errors)
    with atomic_file(path) as place:
        place.write_text(_text(camera), encoding="utf-8", newline="\n")
    return (*losses(oriented.block, "cameras", "principal points", "lens"), *said)


def expressible(camera: Camera, errors: np.ndarray | None = None) -> tuple[Camera, tuple[str, ...]]:
    """The camera with Metashape's lens, and in words what was fitted.

    Parameters
    ----------
    errors : of further additional parameters, see `lens_fit.nearest_of_all`.
    """
    return expressible_camera(camera, OUR_LENS, errors, "Metashape")


def calibration_of(camera: Camera) -> dict[str, float]:
    """Metashape's parameters of a camera whose lens it has words for, in pixels."""
    f = camera.focal_length_mm / camera.pixel_mm
    x0, y0 = camera.principal_point_mm
    own = {name: prior.value for name, prior in camera.lens.items()}
    content = {"f": f, "cx": x0 / camera.pixel_mm, "cy": -y0 / camera.pixel_mm}
    content |= {"b1": own.get("b1", 0.0) * f, "b2": -own.get("b2", 0.0) * f}
    content |= {name: own.get(name, 0.0) for name in RADIAL}
    content |= {"p1": own.get("p2", 0.0), "p2": -own.get("p1", 0.0)}
    return {name: float(value) for name, value in content.items()}


def _text(camera: Camera) -> str:
    kind = next(name for name, projection in PROJECTIONS.items() if projection == camera.projection)
    content = {"projection": kind, "width": camera.size_px[0], "height": camera.size_px[1], **calibration_of(camera)}
    lines = [f"  <{tag}>{value}</{tag}>" for tag, value in content.items()]
    return "\n".join(['<?xml version="1.0" encoding="UTF-8"?>', f"<{ROOT}>", *lines, f"</{ROOT}>"]) + "\n"
