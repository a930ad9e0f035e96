"""Cameras of OpenSfM in our terms, and ours in its.

Lengths are parts of the longer side of the format, y points down. Lens parameters are those of
`additional_parameters.lens`, p1 with the other sign; two focal lengths are c and the affinity b1, as for COLMAP.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from aerotri.formats.foreign.colmap_cameras import SIGN, value, with_nearest
from aerotri.formats.foreign.lens_fit import fitted_camera
from aerotri.formats.foreign.opensfm_json import Node
from aerotri.formats.text.tables import LARGEST_FORMAT_PX, SMALLEST_POSITIVE
from aerotri.observations import Camera, Prior
from aerotri.observations.block import LENS_NAMES

LENS_OF_TYPE: dict[str, tuple[str, ...]] = {
    "perspective": ("k1", "k2"),
    "simple_radial": ("k1",),
    "radial": ("k1", "k2"),
    "brown": ("k1", "k2", "p1", "p2", "k3"),
    "fisheye": ("k1", "k2"),
    "fisheye_opencv": ("k1", "k2", "k3", "k4"),
    "fisheye62": ("k1", "k2", "k3", "k4"),
}
"""Projections that can be expressed, and their lens parameters."""
NOT_EXPRESSED = {"fisheye62": ("k5", "k6", "p1", "p2")}
"""Lens parameters of other formulas."""
TWO_FOCAL_LENGTHS = ("radial", "simple_radial", "brown", "fisheye_opencv", "fisheye62")


def read_cameras(section: Node, pixel_um: float) -> tuple[Camera, ...]:
    """The cameras of a reconstruction: focal lengths and lens free, principal points held.

    Raises
    ------
    InputError
        For a projection that cannot be expressed, or values that no camera has.
    """
    found = [_camera(name, node, pixel_um) for name, node in section.items().items()]
    if not found:
        raise section.error("is empty")
    used = [name for name in LENS_NAMES if any(name in camera.lens for camera in found)]
    # a parameter that other cameras estimate is held at zero where this one does not have it
    held = Prior(0.0, fixed=True)
    return tuple(replace(camera, lens={name: camera.lens.get(name, held) for name in used}) for camera in found)


def _camera(name: str, node: Node, pixel_um: float) -> Camera:
    kind = node.get("projection_type").text()
    if kind not in LENS_OF_TYPE:
        raise node.error(f"projection {kind[:40]} cannot be expressed", f"known are {', '.join(LENS_OF_TYPE)}")
    width, height = node.get("width").number(), node.get("height").number()
    if min(width, height) < 1.0 or max(width, height) > LARGEST_FORMAT_PX or width % 1.0 or height % 1.0:
        raise node.error("width and height are no format")
    size, longer = (int(width), int(height)), max(width, height)
    for key in NOT_EXPRESSED.get(kind, ()):
        if node.has(key) and node.get(key).number():
            raise node.error(f"projection {kind} with {key} cannot be expressed", "estimate it as fisheye_opencv")
    two = node.has("focal_x") or kind in TWO_FOCAL_LENGTHS
    fx, fy = (node.get(key).number() * longer for key in (("focal_x", "focal_y") if two else ("focal", "focal")))
    if min(fx, fy) < SMALLEST_POSITIVE:
        raise node.error("a focal length is not greater than 0")
    cx, cy = (node.get(key).number() * longer if node.has(key) else 0.0 for key in ("c_x", "c_y"))
    scale = pixel_um * 1e-3
    lens = {key: SIGN.get(key, 1.0) * (node.get(key).number() if node.has(key) else 0.0) for key in LENS_OF_TYPE[kind]}
    return Camera(
        name=name.strip() or "camera",
        model="frame",
        size_px=size,
        pixel_um=pixel_um,
        interior={
            "focal_length_mm": Prior(fy * scale),
            "x0_mm": Prior(cx * scale, fixed=True),
            "y0_mm": Prior(-cy * scale, fixed=True),
        },
        brown={} if fx == fy else {"b1": Prior(fy / fx - 1.0)},
        lens={key: Prior(value) for key, value in lens.items()},
        projection="fisheye" if kind.startswith("fisheye") else "perspective",
    )


def expressible(camera: Camera, with_affinity: bool) -> tuple[Camera, tuple[str, ...]]:
    """The camera with a lens that OpenSfM has words for, and in words what was fitted."""
    if not with_affinity:
        camera = replace(camera, brown={})
    names = LENS_OF_TYPE["fisheye_opencv" if camera.is_fisheye else "brown"]
    if all(name in (*names, "b1", "b2") for name, prior in camera.lens.items() if prior.value):
        return camera, ()
    return with_nearest(camera, names, "OpenSfM")


def whole_camera(camera: Camera, errors: np.ndarray | None) -> tuple[Camera, tuple[str, ...]]:
    """The camera for image points as measured: where OpenSfM has no words for it, all that it does is fitted.

    Parameters
    ----------
    errors : of additional parameters beside the lens, see `lens_fit.nearest_of_all`.
    """
    names = LENS_OF_TYPE["fisheye_opencv" if camera.is_fisheye else "brown"]
    held = all(name in (*names, "b1") for name, prior in camera.lens.items() if prior.value)
    if errors is None and held and not any(prior.value for name, prior in camera.brown.items() if name != "b1"):
        return camera, ()
    return fitted_camera(camera, (*names, "b1"), errors, "OpenSfM")


def camera_json(camera: Camera, kind: str = "") -> dict[str, Any]:
    """A camera as OpenSfM has it.

    Parameters
    ----------
    kind : a projection with one focal length only where it is this one; '': where it suffices.
    """
    longer = max(camera.size_px)
    fy = camera.focal_length_mm / camera.pixel_mm
    fx = fy * (1.0 + value(camera, "b1")) / (1.0 + (camera.brown["b1"].value if "b1" in camera.brown else 0.0))
    small, large = ("fisheye", "fisheye_opencv") if camera.is_fisheye else ("perspective", "brown")
    lens = {key: SIGN.get(key, 1.0) * value(camera, key) for key in LENS_OF_TYPE[large]}
    size: dict[str, Any] = {"width": camera.size_px[0], "height": camera.size_px[1]}
    x0, y0 = camera.principal_point_mm
    more = x0 or y0 or any(number for key, number in lens.items() if key not in LENS_OF_TYPE[small])
    if fx == fy and not more and kind in ("", small):
        return {
            "projection_type": small, **size, "focal": fx / longer, "k1": lens["k1"], "k2": lens["k2"],
        }  # fmt: skip
    centre = {"c_x": x0 / camera.pixel_mm / longer, "c_y": -y0 / camera.pixel_mm / longer}
    return {"projection_type": large, **size, "focal_x": fx / longer, "focal_y": fy / longer, **centre, **lens}
