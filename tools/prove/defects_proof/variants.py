"""The same block written down in other ways: other order of rows, other units, another place."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from aerotri import Block
from aerotri import observations as obs


def permuted(block: Block) -> Block:
    """Photographs, points, rays and control in another order."""
    rng = np.random.default_rng(len(block.image_points))
    image, point = rng.permutation(len(block.images)), rng.permutation(len(block.points))
    new_image, new_point = np.argsort(image), np.argsort(point)
    i, rays, control = block.images, block.image_points, block.control
    ray, row = rng.permutation(len(rays)), rng.permutation(len(control))
    changes = {}
    if block.gnss_ins is not None:
        changes["gnss_ins"] = replace(block.gnss_ins, image=new_image[block.gnss_ins.image])
    if block.constraints is not None:
        of_conditions = tuple(new_point[points] for points in block.constraints.points)
        changes["constraints"] = replace(block.constraints, points=of_conditions)
    return replace(
        block,
        images=obs.Images(i.names[image], i.camera[image], i.strip[image], i.centre[image], i.angles[image]),
        points=block.points[point],
        image_points=obs.ImagePoints(
            new_image[rays.image[ray]], new_point[rays.point[ray]], rays.xy[ray], rays.sigma[ray]
        ),
        control=obs.Control(new_point[control.point[row]], control.xyz[row], control.sigma[row], control.is_check[row]),
        **changes,
    )


def moved(block: Block, scale: float = 1.0, shift: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Block:
    """All object coordinates multiplied and shifted, their σ with them."""
    by = np.array(shift)
    changes = {}
    if block.gnss_ins is not None:
        seen = block.gnss_ins
        changes["gnss_ins"] = replace(seen, xyz=scale * seen.xyz + by, sigma=scale * seen.sigma)
    if block.constraints is not None:
        given = block.constraints
        changes["constraints"] = replace(given, value=scale * given.value, sigma=scale * given.sigma)
    control = replace(block.control, xyz=scale * block.control.xyz + by, sigma=scale * block.control.sigma)
    return replace(
        block, images=replace(block.images, centre=scale * block.images.centre + by), control=control, **changes
    )


def with_sigma(block: Block, control: tuple[float, float, float], rays: float = 1.0) -> Block:
    """σ multiplied: those of control, GNSS and conditions axis by axis, and those of the rays of every other one."""
    by = np.array(control)
    changes = {}
    if block.gnss_ins is not None:
        changes["gnss_ins"] = replace(block.gnss_ins, sigma=block.gnss_ins.sigma * by)
    if block.constraints is not None:
        changes["constraints"] = replace(block.constraints, sigma=block.constraints.sigma * by[2])
    sigma = block.image_points.sigma.copy()
    sigma[::2] *= rays
    seen = replace(block.control, sigma=block.control.sigma * by)
    return replace(block, control=seen, image_points=replace(block.image_points, sigma=sigma), **changes)


VARIANTS: dict[str, Callable[[Block], Block]] = {
    "as it is": lambda block: block,
    "rows permuted": permuted,
    "coordinates × 0.001": lambda block: moved(block, 1e-3),
    "coordinates × 1000": lambda block: moved(block, 1e3),
    "shifted by 5000 km": lambda block: moved(block, shift=(5e6, 5e6, 0.0)),
    "σ of control × 0.001": lambda block: with_sigma(block, (1e-3, 1e-3, 1e-3)),
    "σ of control × 1000": lambda block: with_sigma(block, (1e3, 1e3, 1e3)),
    "σ of control × 10000": lambda block: with_sigma(block, (1e4, 1e4, 1e4)),
    "σ of X × 0.001, of Z × 1000": lambda block: with_sigma(block, (1e-3, 1.0, 1e3)),
    "σ of every other ray × 1000": lambda block: with_sigma(block, (1.0, 1.0, 1.0), 1e3),
}
