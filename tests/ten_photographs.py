"""A block of ten photographs with GNSS/INS, control and check points, and its measurements wrong in many ways."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerotri.observations import Block, Prior
from aerotri.simulation import parse_spec, simulate

SPEC = {
    "name": "ten",
    "camera": {"ucd": {"preset": "ultracam_d"}},
    "flight": {
        "gsd_m": 0.1, "strips": 2, "images_per_strip": 5, "end_lap": 0.6, "side_lap": 0.4,
        "attitude_sigma_deg": [1.0, 1.0, 2.0], "position_sigma_m": [5.0, 5.0, 3.0],
    },
    "terrain": {"kind": "undulating", "height_m": 100.0, "relief_rms_m": 30.0, "wavelength_m": 900.0},
    "tie_points": {"per_image": 60, "probability": 0.9, "sigma_um": 2.0},
    "control": {"distance_bases": 2.0, "sigma_m": [0.03, 0.03, 0.05], "check_points": 8},
    "start_values": {"kind": "perturbed", "position_sigma_m": 1.0, "angle_sigma_deg": 0.05},
}  # fmt: skip
GNSS_INS = {"gnss": {"sigma_m": [0.05, 0.05, 0.08]}, "ins": {"sigma_deg": [0.005, 0.005, 0.01]}}


def ten_photographs(seed: int = 1, navigated: bool = True) -> Block:
    """The faultless block; control alone holds it where it is not navigated."""
    return simulate(parse_spec(SPEC | (GNSS_INS if navigated else {})), seed)[0]


def with_image_points(block: Block, image: int | None, change) -> Block:
    """The block with the measurements of one photograph, or of all, changed: `change` takes and gives (m, 2) mm."""
    points = block.image_points
    own = np.full(len(points), True) if image is None else points.image == image
    xy = points.xy.copy()
    xy[own] = change(xy[own])
    return replace(block, image_points=replace(points, xy=xy))


def without_start_values(block: Block) -> Block:
    """The block with no orientation given."""
    unknown = np.full((len(block.images), 3), np.nan)
    return replace(block, images=replace(block.images, centre=unknown, angles=unknown))


def with_focal_length(block: Block, factor: float, **known) -> Block:
    """The block with another principal distance stated; `known` as of `Prior`, held where nothing is said."""
    camera = block.cameras[0]
    stated = Prior(camera.focal_length_mm * factor, **(known or {"fixed": True}))
    return replace(block, cameras=(replace(camera, interior={**camera.interior, "focal_length_mm": stated}),))


def with_control(block: Block, change) -> Block:
    """The block with its control changed: `change` takes and gives (k, 3) m, the check points stay."""
    xyz = block.control.xyz.copy()
    own = ~block.control.is_check
    xyz[own] = change(xyz[own])
    return replace(block, control=replace(block.control, xyz=xyz))


def with_positions(block: Block, change) -> Block:
    """The block with its GNSS positions changed: `change` takes and gives (n, 3) m."""
    return replace(block, gnss_ins=replace(block.gnss_ins, xyz=change(block.gnss_ins.xyz)))


def with_attitudes(block: Block, change) -> Block:
    """The block with the angles of INS and the start values changed: `change` takes and gives (n, 3) rad."""
    images = replace(block.images, angles=change(block.images.angles))
    if block.gnss_ins is None:
        return replace(block, images=images)
    return replace(block, images=images, gnss_ins=replace(block.gnss_ins, angles=change(block.gnss_ins.angles)))


def with_kappa_turned(block: Block) -> Block:
    """The block with κ of the start values off by 180°, what INS observed as it was."""
    return replace(block, images=replace(block.images, angles=block.images.angles + [0.0, 0.0, np.pi]))


def with_names_rotated(block: Block, image: int) -> Block:
    """The block with the point names of one photograph shifted by one."""
    rays = block.image_points
    point, own = rays.point.copy(), np.flatnonzero(rays.image == image)
    point[own] = np.roll(point[own], 1)
    return replace(block, image_points=replace(rays, point=point))


def with_strips_apart(block: Block) -> Block:
    """The block with other point names in its first strip, control too, so that no point ties it to the second."""
    rays, count = block.image_points, len(block.points)
    apart = np.asarray(block.images.strip)[rays.image] == block.images.strip[0]
    names = np.concatenate([block.points, [f"{name}a" for name in block.points]])
    point = np.where(apart, rays.point + count, rays.point)
    return replace(block, points=names, image_points=replace(rays, point=point))
