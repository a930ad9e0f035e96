"""Simulated blocks of any number of photographs, and the start that all peers are given alike."""

from __future__ import annotations

import pickle
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import aerotri
from aerotri import Block, geometry

POSITION_M, ANGLE_DEG = 1.0, float(np.degrees(1e-3))
STRIPS_PER_ROOT = 0.46
"""Strips over the root of the number of photographs: about as long as wide at 80 / 40 % end and side lap."""
CROSS_STRIP_IMAGES = 4.6
"""Photographs of a cross strip for every strip it crosses."""


@dataclass(frozen=True, eq=False)
class Start:
    """Where every program begins: centre (n, 3) m, rotation (n, 3, 3), points (N, 3) m."""

    centre: np.ndarray
    rotation: np.ndarray
    points: np.ndarray


def layout(photographs: int) -> tuple[int, int, list[int]]:
    """Strips, photographs of each, and photographs of the cross strips; together exactly as many as asked for."""
    strips = max(3, round(STRIPS_PER_ROOT * photographs**0.5))
    crossing = 1 if photographs < 1000 else 2 if photographs < 5000 else 3
    wanted = crossing * round(CROSS_STRIP_IMAGES * strips)
    per_strip = (photographs - wanted) // strips
    rest = photographs - strips * per_strip
    return strips, per_strip, [rest // crossing + (k < rest % crossing) for k in range(crossing)]


def plan_of(photographs: int) -> dict:
    """After the DSK-Saar block: UltraCamD, 9 cm, 80/40 %, 130 points a photograph, 6.5 rays a point, sparse control."""
    strips, per_strip, crossing = layout(photographs)
    positions = (np.arange(len(crossing)) + 0.5) / len(crossing)
    return {
        "name": f"saar_{photographs}",
        "camera": {"ucd8": {"preset": "ultracam_d"}},
        "flight": {
            "gsd_m": 0.09, "strips": strips, "images_per_strip": per_strip, "end_lap": 0.8, "side_lap": 0.4,
            "cross_strips": [
                {"position": float(p), "images": count} for p, count in zip(positions, crossing, strict=True)
            ],
            "attitude_sigma_deg": [1.0, 1.0, 2.0], "position_sigma_m": [5.0, 5.0, 3.0],
        },
        "terrain": {"kind": "undulating", "height_m": 250.0, "relief_rms_m": 40.0, "wavelength_m": 2000.0},
        "tie_points": {"per_image": 128.0, "rays_per_point": 6.5, "sigma_um": 2.0},
        "control": {"distance_bases": 4.0, "sigma_m": [0.03, 0.03, 0.03]},
        "start_values": {"kind": "perturbed", "position_sigma_m": POSITION_M, "angle_sigma_deg": ANGLE_DEG},
    }  # fmt: skip


def make_block(photographs: int, folder: Path, seed: int = 1) -> Path:
    """Simulate a block; writes block.pickle (block and start) and colmap/ (the same start), which it returns."""
    target = folder / f"saar_{photographs}_{seed}"
    target.mkdir(parents=True, exist_ok=True)
    block = aerotri.simulate(plan_of(photographs), seed).block
    start = common_start(block)
    with (target / "block.pickle").open("wb") as file:
        pickle.dump((block, start), file)
    aerotri.convert(block, target / "colmap", "colmap", points=start.points, overwrite=True)
    return target


def common_start(block: Block) -> Start:
    """The block's perturbed orientations, and the points intersected from them."""
    rotation = geometry.rotation_from_angles(block.images.angles, block.rotation)
    rays = block.image_points
    tangent = (rays.xy - np.array(block.cameras[0].principal_point_mm)) / block.cameras[0].focal_length_mm
    count = np.bincount(rays.point, minlength=len(block.points))
    points = _nearest_to_rays(block.images.centre, rotation, (rays.image, rays.point, tangent), count)
    if not np.isfinite(points[count >= 2]).all():
        raise ValueError("a point of the simulated block does not intersect")
    return Start(block.images.centre, rotation, points)


def _nearest_to_rays(centre: np.ndarray, rotation: np.ndarray, rays: tuple, count: np.ndarray) -> np.ndarray:
    """(N, 3) m, points nearest to their rays; NaN where there are fewer than two."""
    image, point, tangent = rays
    ray = np.einsum("mij,mj->mi", rotation[image], np.column_stack([tangent, -np.ones(len(tangent))]))
    ray /= np.linalg.norm(ray, axis=1)[:, None]
    across = np.eye(3) - ray[:, :, None] * ray[:, None, :]
    normal, right = np.zeros((len(count), 3, 3)), np.zeros((len(count), 3))
    np.add.at(normal, point, across)
    np.add.at(right, point, np.einsum("mij,mj->mi", across, centre[image]))
    points = np.full((len(count), 3), np.nan)
    points[count >= 2] = np.linalg.solve(normal[count >= 2], right[count >= 2][:, :, None])[:, :, 0]
    return points


def load_block(folder: Path) -> tuple[Block, Start]:
    """What `make_block` wrote."""
    with (folder / "block.pickle").open("rb") as file:
        return pickle.load(file)
