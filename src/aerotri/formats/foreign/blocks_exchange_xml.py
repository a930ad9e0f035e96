"""The parts of a BlocksExchange file: coordinate systems, photogroups, photographs, control and tie points.

[L] Bentley, "CC Orientations" and the annotated example of BlocksExchange 2.1. Pixels count from the CENTRE of the
upper left one, x to the right, y down. Millimetres (xmm, ymm) of a principal point count from the centre of the sensor,
those of a measurement from the principal point, both along the axes that CameraOrientation names. M and omega, phi,
kappa lead from the world to a camera with these axes, M = (Rx(ω)·Ry(φ)·Rz(κ))ᵀ, which the example's numbers confirm.
Distortion is Brown's as in Wikipedia: u' = u(1 + K1r² + K2r⁴ + K3r⁶) + P1(r² + 2u²) + 2P2uv, v' alike with P1 and P2
exchanged; OpenCV and this program call P1 p2, and P2 p1. AspectRatio is that of the focal lengths, along y to along x.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from aerotri.conventions import InputError
from aerotri.formats.foreign.reconstruction import PixelCamera, rotation_matrix
from aerotri.formats.foreign.world_systems import WorldSystem, world_system
from aerotri.formats.text.sigmas import impossible_sigmas, why_impossible
from aerotri.formats.text.tables import LARGEST_NUMBER, SMALLEST_POSITIVE
from aerotri.formats.text.text_lines import is_number
from aerotri.formats.text.xml_text import text_of
from aerotri.functional_model.rotation import rotation_from_angles

REMEDY = "export the block again as BlocksExchange XML"
HALF_PIXEL = 0.5
"""From the centre of the upper left pixel to its corner."""
DIRECTIONS = {"Right": (1.0, 0.0), "Left": (-1.0, 0.0), "Down": (0.0, 1.0), "Up": (0.0, -1.0)}
"""Directions of an image in x right, y down."""
USED = {
    "Block": {"Name", "Description", "Type", "SRSId", "Photogroups", "ControlPoints", "TiePoints"},
    "Photogroup": {
        "SRSId", "Name", "Description", "ImageDimensions", "CameraModelType", "CameraModelBand", "SensorSize",
        "PixelSize", "FocalLength", "FocalLengthPixels", "CameraOrientation", "PrincipalPoint", "Distortion",
        "AspectRatio", "Skew", "Photo", "ManualOpticalParams", "ManualPose",
    },
    "Photo": {"Id", "ImagePath", "Component", "Pose", "ExifData", "NearDepth", "MedianDepth", "FarDepth"},
    "Pose": {"Rotation", "Center", "Metadata", "HorizontalAccuracy", "VerticalAccuracy"},
    "Metadata": {"Rotation", "Center", "SRSId", "HorizontalAccuracy", "VerticalAccuracy"},
    "TiePoint": {"Name", "Id", "Position", "Color", "Measurement", "SRSId"},
    "ControlPoint": {
        "Name", "Description", "SRSId", "Category", "Position", "CheckPoint", "HorizontalAccuracy", "VerticalAccuracy",
        "Measurement", "Id",
    },
}  # fmt: skip
"""What is used, or is of no use for an adjustment, in the parts of a file; the rest is named."""


@dataclass(frozen=True)
class XmlPlace:
    """An element of a file, with the words that name it in an error.

    Parameters
    ----------
    element : of the file. where : in words. path : the file. remedy : what to do where something is wrong with it.
    """

    element: Element
    where: str
    path: Path
    remedy: str = REMEDY

    def error(self, message: str, remedy: str = "") -> InputError:
        return InputError(f"{self.where[:100]}: {message}", remedy or self.remedy, self.path)

    def text(self, tag: str) -> str:
        """Of a child, '' where there is none."""
        return text_of(self.element.find(tag))

    def has(self, tag: str) -> bool:
        return bool(self.text(tag))

    def child(self, tag: str) -> XmlPlace | None:
        found = self.element.find(tag)
        return None if found is None else XmlPlace(found, f"{self.where}, {tag}", self.path, self.remedy)

    def children(self, tag: str) -> Iterator[XmlPlace]:
        for found in self.element.findall(tag):
            yield XmlPlace(found, f"{self.where}, {tag}", self.path, self.remedy)

    def number(self, tag: str, default: float | None = None) -> float:
        """A finite number.

        Raises
        ------
        InputError
            When it is none, or missing without a default.
        """
        text = self.text(tag)
        if not text and default is not None:
            return default
        if not text:
            raise self.error(f"has no <{tag}>")
        if not is_number(text) or not abs(float(text)) <= LARGEST_NUMBER:
            raise self.error(f"<{tag}> = '{text[:40]}' is not a number")
        return float(text)

    def numbers(self, *tags: str) -> np.ndarray:
        return np.array([self.number(tag) for tag in tags])

    def is_true(self, tag: str, default: str = "false") -> bool:
        return (self.text(tag) or default).lower() in ("true", "1")

    def name(self, words: str) -> XmlPlace:
        """The same place under other words."""
        return XmlPlace(self.element, words, self.path, self.remedy)


@dataclass(frozen=True, eq=False)
class Photogroup:
    """Photographs of one camera.

    Parameters
    ----------
    place : the element. name : of the camera. camera : in pixels. pixel_um : None where the file does not tell.
    axes : (2, 2) x and y of CameraOrientation, as rows, in x right, y down.
    """

    place: XmlPlace
    name: str
    camera: PixelCamera
    pixel_um: float | None
    axes: np.ndarray

    @property
    def down_from_camera(self) -> np.ndarray:
        """(3, 3) from the axes of CameraOrientation to x right, y down, z forwards."""
        x, y = np.append(self.axes[0], 0.0), np.append(self.axes[1], 0.0)
        return np.column_stack([x, y, np.cross(x, y)])

    def pixel_mm(self, place: XmlPlace) -> float:
        """Size of a pixel.

        Raises
        ------
        InputError
            When the file has millimetres and does not tell it.
        """
        if self.pixel_um is None:
            raise place.error("has millimetres, but the photogroup neither SensorSize nor PixelSize")
        return self.pixel_um * 1e-3

    def measured_px(self, place: XmlPlace) -> tuple[float, float]:
        """Column and row, from the corner, of a measurement."""
        if place.has("x") or not place.has("xmm"):
            x, y = place.number("x"), place.number("y")
            return x + HALF_PIXEL, y + HALF_PIXEL
        x, y = place.numbers("xmm", "ymm") @ self.axes / self.pixel_mm(place)
        return self.camera.centre_px[0] + x, self.camera.centre_px[1] + y


@dataclass(frozen=True, eq=False)
class Pose:
    """Of a photograph.

    Parameters
    ----------
    rotation : (3, 3) x right, y down, z forwards → world; NaN where unknown. centre : (3,), NaN where unknown.
    observed : (3,) position before the adjustment. sigma : (3,), NaN where not given. system : of that position.
    left : what of it is not used, in words each.
    """

    rotation: np.ndarray
    centre: np.ndarray
    observed: np.ndarray
    sigma: np.ndarray
    system: WorldSystem | None
    left: tuple[str, ...] = ()


class Systems:
    """The coordinate systems of a file by their ids.

    Raises
    ------
    InputError
        When one that is used is not there, not known or cannot be used.
    """

    def __init__(self, root: Element, path: Path):
        self.path = path
        self.definitions = {
            text_of(node.find("Id")): text_of(node.find("Definition")) for node in root.iter("SRS") if len(node)
        }
        self.known: dict[str, WorldSystem] = {}

    def of(self, place: XmlPlace, default: WorldSystem) -> WorldSystem:
        """The system that an element names, else that of what it is in."""
        number = place.text("SRSId")
        if not number:
            return default
        if number not in self.definitions:
            raise place.error(f"there is no SRS with the id {number[:20]}")
        if number not in self.known:
            self.known[number] = world_system(self.definitions[number], self.path)
        return self.known[number]


def photogroup(place: XmlPlace, name: str) -> Photogroup:
    """A photogroup and its camera.

    Raises
    ------
    InputError
        When something is missing, or a camera cannot be expressed.
    """
    place = place.name(f"photogroup '{name[:60]}'")
    kind = place.text("CameraModelType") or "Perspective"
    if kind != "Perspective":
        message = f"the camera is of type {kind[:40]}, whose formula is not published with the format"
        raise place.error(message, "export the block as COLMAP or Metashape XML, or write undistorted photographs")
    dimensions = place.child("ImageDimensions")
    if dimensions is None or not place.is_true("ManualOpticalParams", "true"):
        raise place.error("has no camera of its own", "export the block after its aerotriangulation")
    width, height = dimensions.numbers("Width", "Height").tolist()
    if width % 1.0 or height % 1.0 or min(width, height) < 1.0:
        raise place.error("width and height are no format")
    axes = _axes(place)
    pixel_um = _pixel_um(place, max(width, height))
    focal = _focal_px(place, pixel_um)
    if place.number("Skew", 0.0):
        raise place.error("has a skew, whose formula is not published with the format", "adjust the block without skew")
    ratio = place.number("AspectRatio", 1.0)
    camera = PixelCamera(
        (int(min(width, LARGEST_NUMBER)), int(min(height, LARGEST_NUMBER))),
        (focal, focal * ratio),
        _principal_point(place, (width, height), axes, pixel_um),
        _lens(place),
        centre_known=place.child("PrincipalPoint") is not None,
    )
    camera.refuse_impossible(place.error("has values that no camera has"))
    return Photogroup(place, name, camera, pixel_um, axes)


def _axes(place: XmlPlace) -> np.ndarray:
    text = place.text("CameraOrientation") or "XRightYDown"
    for x, first in DIRECTIONS.items():
        for y, second in DIRECTIONS.items():
            if text == f"X{x}Y{y}" and abs(np.dot(first, second)) < 1.0:
                return np.array([first, second])
    raise place.error(f"CameraOrientation '{text[:40]}' is not known", "write XRightYDown or another one of the eight")


def _pixel_um(place: XmlPlace, longer_px: float) -> float | None:
    if place.has("PixelSize"):
        size = place.number("PixelSize")
    elif place.has("SensorSize"):
        size = place.number("SensorSize") / longer_px
    else:
        return None
    if not SMALLEST_POSITIVE <= size <= LARGEST_NUMBER:
        raise place.error("the size of a pixel is not greater than 0")
    return size * 1e3


def _focal_px(place: XmlPlace, pixel_um: float | None) -> float:
    if place.has("FocalLengthPixels"):
        return place.number("FocalLengthPixels")
    focal_mm = place.number("FocalLength")
    if pixel_um is None:
        raise place.error("has a focal length in millimetres, but neither SensorSize nor PixelSize")
    return focal_mm / (pixel_um * 1e-3)


def _principal_point(
    place: XmlPlace, size: tuple[float, float], axes: np.ndarray, pixel_um: float | None
) -> tuple[float, float]:
    """Column and row from the corner."""
    point = place.child("PrincipalPoint")
    if point is None:
        return size[0] / 2.0, size[1] / 2.0
    if point.has("x") or not point.has("xmm"):
        return point.number("x") + HALF_PIXEL, point.number("y") + HALF_PIXEL
    if pixel_um is None:
        raise point.error("has millimetres, but the photogroup neither SensorSize nor PixelSize")
    x, y = point.numbers("xmm", "ymm") @ axes / (pixel_um * 1e-3)
    return size[0] / 2.0 + x, size[1] / 2.0 + y


def _lens(place: XmlPlace) -> dict[str, float]:
    distortion = place.child("Distortion")
    if distortion is None:
        return {}
    names = {"K1": "k1", "K2": "k2", "K3": "k3", "P1": "p2", "P2": "p1"}
    more = [node.tag for node in distortion.element if node.tag not in names and distortion.number(node.tag, 0.0)]
    if more:
        raise distortion.error(f"<{str(more[0])[:20]}> is not known", "adjust the block with K1, K2, K3, P1, P2")
    return {ours: distortion.number(theirs, 0.0) for theirs, ours in names.items()}


def pose_of(photo: XmlPlace, group: Photogroup, systems: Systems, system: WorldSystem) -> Pose:
    """Orientation and observed position of a photograph.

    Parameters
    ----------
    system : of the photogroup.

    Raises
    ------
    InputError
    """
    unknown, turn = np.full(3, np.nan), np.full((3, 3), np.nan)
    pose = photo.child("Pose")
    if pose is None or not group.place.is_true("ManualPose", "true"):
        return Pose(turn, unknown, unknown, unknown, None)
    centre = _xyz(pose.child("Center"))
    rotation, left = _rotation(pose.child("Rotation"), group)
    if rotation is not None:
        turn = rotation
    metadata = pose.child("Metadata")
    observed, observed_in, sigma = unknown, None, unknown
    words = [left] if left else []
    if metadata is not None:
        if metadata.child("Rotation") is not None:
            words.append("the rotation before the adjustment")
        observed = _xyz(metadata.child("Center"))
        observed_in, sigma = systems.of(metadata, system), _sigma(metadata)
    elif rotation is None:
        # [L] a pose without a rotation that can be used may be limited to what GNSS gave
        observed, observed_in, sigma = centre, system, _sigma(pose)
    return Pose(turn, centre, observed, sigma, observed_in, tuple(words))


def _xyz(place: XmlPlace | None) -> np.ndarray:
    return np.full(3, np.nan) if place is None else place.numbers("x", "y", "z")


def _sigma(place: XmlPlace) -> np.ndarray:
    """(3,) NaN where not given."""
    for owner in (place, place.child("Center")):
        if owner is not None and owner.has("HorizontalAccuracy"):
            plan, height = owner.number("HorizontalAccuracy"), owner.number("VerticalAccuracy", np.nan)
            for value in (plan, height):
                if impossible_sigmas(np.array(value)):
                    raise owner.error(f"an accuracy {why_impossible(value)}")
            return np.array([plan, plan, plan if np.isnan(height) else height])
    return np.full(3, np.nan)


def _rotation(place: XmlPlace | None, group: Photogroup) -> tuple[np.ndarray | None, str]:
    """x right, y down, z forwards → world; and what is not used of it."""
    if place is None:
        return None, ""
    if place.has("M_00"):
        elements = place.numbers(*(f"M_{i}{j}" for i in range(3) for j in range(3)))
        camera_from_world = rotation_matrix(elements, place.error("is no rotation"))
    elif place.has("Omega"):
        angles = np.radians(place.numbers("Omega", "Phi", "Kappa"))
        camera_from_world = rotation_from_angles(angles[None])[0].T
    elif place.has("Pitch"):
        return None, "yaw, pitch and roll, whose formula is not published with the format"
    else:
        return None, ""
    return (group.down_from_camera @ camera_from_world).T, ""
