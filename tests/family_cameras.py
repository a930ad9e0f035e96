"""Cameras and image points for the tests of parameter families."""

from __future__ import annotations

import numpy as np

from aerotri.functional_model.additional_parameters import ultracam_d
from aerotri.functional_model.additional_parameters.native_frame import native_from_image
from aerotri.functional_model.additional_parameters.registry import LINEAR_FAMILIES
from aerotri.observations import Camera, Prior

INTERIOR = {name: Prior(value, fixed=True) for name, value in (("focal_length_mm", 101.4), ("x0_mm", 0), ("y0_mm", 0))}
DMC_INTERIOR = INTERIOR | {"focal_length_mm": Prior(120.0, fixed=True)}


def camera_for(family: str, flight_axis: str = "+y", size: tuple[int, int] = (11500, 7500), pixel_um=9.0) -> Camera:
    model, interior = LINEAR_FAMILIES[family].camera_model or "frame", INTERIOR
    if model == "dmc":
        size, pixel_um, interior = (13824, 7680), 12.0, DMC_INTERIOR
    if flight_axis[1] == "x":
        size = (size[1], size[0])
    return Camera("cam", model, size, pixel_um, interior, flight_axis=flight_axis)


def inner_points(camera: Camera, n=400, seed=1):
    """Image points clear of tile seams, of the axes and of the nodes of default grids, where patterns are smooth."""
    rng = np.random.default_rng(seed)
    half = np.array(camera.half_format_mm)
    xy = rng.uniform(-0.98, 0.98, (n, 2)) * half
    native = xy @ native_from_image(camera).T
    pixel = ultracam_d.native_pixel_mm(camera)
    seams_x = (ultracam_d.SEAM_COLUMNS - ultracam_d.SENSOR_SIZE_PX[0] / 2) * pixel
    seams_y = (ultracam_d.SENSOR_SIZE_PX[1] / 2 - ultracam_d.SEAM_ROWS) * pixel
    clear = (np.abs(native[:, :1] - seams_x).min(axis=1) > 0.01) & (np.abs(native[:, 1:] - seams_y).min(axis=1) > 0.01)
    clear &= (np.abs(xy) > 0.01).all(axis=1)
    for family in ("grid", "collocation"):
        spacing = 2.0 * half / (np.array(LINEAR_FAMILIES[family].sizes.default) - 1.0)
        place = (xy + half) / spacing
        clear &= (np.abs(place - np.round(place)) * spacing > 0.01).all(axis=1)
    return xy[clear].T


def sets_of(family: str) -> list[tuple[str, ...]]:
    """Names of all parameters of a family, in sets whose items do not exclude one another."""
    items = LINEAR_FAMILIES[family].items
    choices = [items] if family != "dmc" else [LINEAR_FAMILIES[family].all_items, ("79", "80")]
    return [tuple(f"{family}.{item}" for item in choice) for choice in choices]
