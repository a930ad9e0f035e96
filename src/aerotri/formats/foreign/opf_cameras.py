"""Sensors and photographs of an OPF project.

[L] OPF specification 1.0 and Pix4D's knowledge base on internal parameters. Pixels begin at the corner of the upper
left one. Of a perspective sensor R1 to R3 are OpenCV's k1 to k3, T1 and T2 its p1 and p2. Of a fisheye, with the angle
θ to the axis, ρ = p0 + p1t + p2t² + … of t = 2θ/π and the affine factor C, the image point lies C·ρ from the principal
point; C·p1·2/π is the principal distance, and the nearest odd polynomial of θ is taken. Orientations are
R = Rx(ω)·Ry(φ)·Rz(κ) from the image, x right, y up, z backwards, to the processing system.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from aerotri.formats.foreign.lens_fit import fitted_lens
from aerotri.formats.foreign.opensfm_json import Node
from aerotri.formats.foreign.opf_files import REMEDY, Resources, entries, whole
from aerotri.formats.foreign.pix4d_params import LENS
from aerotri.formats.foreign.reconstruction import PixelCamera, check_names, names_of_paths
from aerotri.formats.text.notes import assumed, left_behind
from aerotri.formats.text.tables import SMALLEST_POSITIVE
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations import Camera

FISHEYE_LENS = ("k1", "k2", "k3", "k4")
ANGLES, DIRECTIONS = 200, 16
"""Places at which the polynomial of a fisheye is compared with the nearest one, along a radius and around [C]."""


@dataclass(frozen=True, eq=False)
class Photographs:
    """The calibrated photographs of a project.

    Parameters
    ----------
    names : of them. row : by their id. cameras : in our terms; camera : (n,) of each.
    centre : (n, 3); rotation : (n, 3, 3), our camera frame → processing system.
    messages : what the user should know.
    """

    names: list[str]
    row: dict[int, int]
    cameras: tuple[Camera, ...]
    camera: np.ndarray
    centre: np.ndarray
    rotation: np.ndarray
    messages: list[str]


def photographs_of(resources: Resources, pixel_um: float | None) -> Photographs:
    """The calibrated photographs.

    Parameters
    ----------
    pixel_um : size of a pixel; None: as the sensors tell.

    Raises
    ------
    InputError
        When something is missing, or a sensor cannot be expressed.
    """
    calibrated = resources.node("calibrated-cameras")
    inputs = resources.node("input-cameras")
    shots = entries(calibrated.get("cameras"))
    if not shots:
        raise calibrated.error("holds no calibrated photographs", "calibrate the project first")
    number, cameras, messages = _cameras(calibrated, inputs, shots, pixel_um)
    ids = [whole(shot.get("id")) for shot in shots]
    row = {key: k for k, key in enumerate(ids)}
    if len(row) < len(ids):
        raise calibrated.error(f"photograph {Counter(ids).most_common(1)[0][0]} is there twice", REMEDY)
    angles = np.radians([shot.get("orientation_deg").numbers(3) for shot in shots])
    return Photographs(
        _names(resources, ids),
        row,
        cameras,
        np.array([number[whole(shot.get("sensor_id"))] for shot in shots], np.int64),
        np.array([shot.get("position").numbers(3) for shot in shots]),
        rotation_from_angles(angles),
        [*messages, *_about(shots, inputs)],
    )


def _names(resources: Resources, ids: list[int]) -> list[str]:
    listed = resources.node("camera-list")
    paths = {whole(node.get("id")): node.get("uri").text() for node in entries(listed.get("cameras"))}
    missing = [key for key in ids if key not in paths]
    if missing:
        raise listed.error(f"holds no photograph {missing[0]}", REMEDY)
    names = names_of_paths([paths[key].removeprefix("file:///") for key in ids])
    check_names(names, "photograph", listed.path, REMEDY)
    return names


def _cameras(
    calibrated: Node, inputs: Node, shots: list[Node], pixel_um: float | None
) -> tuple[dict[int, int], tuple[Camera, ...], list[str]]:
    """Row of every sensor in use by its id, the cameras, and what to say of them."""
    known = {whole(node.get("id")): node for node in entries(inputs.get("sensors"))}
    internals = {whole(node.get("id")): node for node in entries(calibrated.get("sensors"))}
    used = list(dict.fromkeys(whole(shot.get("sensor_id")) for shot in shots))
    for key in used:
        if key not in known or key not in internals:
            raise calibrated.error(f"sensor {key} is not described", REMEDY)
    labels = [known[key].get("name").text() for key in used]
    several = {label for label, count in Counter(labels).items() if count > 1}
    names = [f"{label} {key}" if label in several else label for label, key in zip(labels, used, strict=True)]
    check_names(names, "sensor", inputs.path, REMEDY)
    cameras, messages = [], []
    for key, name in zip(used, names, strict=True):
        camera, said = _camera(known[key], internals[key].get("internals"), name, pixel_um)
        cameras.append(camera)
        messages += said
    return {key: k for k, key in enumerate(used)}, tuple(cameras), messages


def _camera(sensor: Node, internals: Node, name: str, pixel_um: float | None) -> tuple[Camera, list[str]]:
    sides = sensor.get("image_size_px").numbers(2)
    if any(side % 1.0 for side in sides):
        raise sensor.error("width and height are no format", REMEDY)
    width, height = map(int, sides)
    size_um = sensor.get("pixel_size_um").number() if pixel_um is None else pixel_um
    if size_um < SMALLEST_POSITIVE:
        raise sensor.error("the size of a pixel is not greater than 0", REMEDY)
    x, y = internals.get("principal_point_px").numbers(2)
    kind = internals.get("type").text()
    said: list[str] = []
    if kind == "perspective":
        focal = internals.get("focal_length_px").number()
        values = (*internals.get("radial_distortion").numbers(3), *internals.get("tangential_distortion").numbers(2))
        lens: dict[str, float] = dict(zip(LENS, values, strict=True))
    elif kind == "fisheye":
        corner = max(np.hypot(px - x, py - y) for px in (0, width) for py in (0, height))
        focal, lens, text = _fisheye(internals, float(corner))
        said = [assumed(f"camera '{name[:60]}': the nearest lens of Pix4D's polynomial is taken, {text}")]
    else:
        raise internals.error(f"a {kind[:40]} camera cannot be expressed", "export perspective or fisheye photographs")
    found = PixelCamera((width, height), (focal, focal), (x, y), lens, kind == "fisheye", centre_known=True)
    found.refuse_impossible(internals.error("has values that no camera has", REMEDY))
    return found.camera(name, size_um), said


def _fisheye(internals: Node, corner_px: float) -> tuple[float, dict[str, float], str]:
    """Principal distance, the nearest lens, and what it leaves, in words.

    Parameters
    ----------
    corner_px : distance of the farthest corner from the principal point.
    """
    c, d, e, f = internals.get("affine").numbers(4)
    if d or e or c != f:
        raise internals.error("its affine matrix is not symmetric", "calibrate the fisheye with a symmetric matrix")
    terms = [node.number() for node in entries(internals.get("polynomial"))]
    if len(terms) < 2 or terms[0] or terms[1] * c < SMALLEST_POSITIVE:
        raise internals.error("its polynomial does not begin with 0 and a factor", "calibrate it with p0 = 0")
    theta = np.linspace(0.0, np.pi / 2.0, ANGLES + 1)[1:]
    t = 2.0 * theta / np.pi
    rho = c * np.polynomial.polynomial.polyval(t, terms)
    rising = np.concatenate([[True], np.diff(rho) > 0.0]).cumprod().astype(bool)
    there = rising & (rho > 0.0) & (rho <= corner_px)
    focal = c * terms[1] * 2.0 / np.pi
    if there.sum() < len(FISHEYE_LENS):
        raise internals.error("its polynomial maps nothing to the format", REMEDY)
    around = np.linspace(0.0, 2.0 * np.pi, DIRECTIONS, endpoint=False)
    axes = np.column_stack([np.cos(around), np.sin(around)])
    ideal, bent = (np.vstack([r[there, None] * axis for axis in axes]) for r in (theta, rho / focal))
    best = fitted_lens(ideal, bent, FISHEYE_LENS, True, focal)
    return focal, best.values(FISHEYE_LENS), best.text


def _about(shots: list[Node], inputs: Node) -> list[str]:
    said = []
    captures = entries(inputs.get("captures"))
    several = sum(len(entries(capture.get("cameras"))) > 1 for capture in captures)
    if several:
        said.append(left_behind(f"not used: rigs, {several} exposures of several cameras; photographs are single"))
    if any(shot.has("rolling_shutter") for shot in shots):
        said.append(left_behind("not used: rolling shutter; state [camera.NAME.rolling_shutter]"))
    return said
