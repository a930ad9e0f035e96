"""Covariances of object points of a block at its true values, without adjusting it."""

from __future__ import annotations

import numpy as np

from aerotri.adjustment.defects import checked_factor
from aerotri.adjustment.point_sides import solve_sides
from aerotri.adjustment.ray_status import RayStatus
from aerotri.adjustment.robust import LEAST_SQUARES
from aerotri.adjustment.system import build_system
from aerotri.adjustment.unknowns import StartValues
from aerotri.conventions import InputError
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations import Block

COLUMNS_AT_A_TIME = 192
"""Columns of Q had together [C]: some 100 MB with 20 000 points."""


def joint_covariance(block: Block, xyz: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """(3k, 3k) m², the covariance of points as an adjustment of the block gives it, σ̂0 being 1.

    Parameters
    ----------
    xyz : (N, 3) m, true coordinates of all points. rows : (k,) of the block's points.

    Raises
    ------
    InputError
        When control and positions do not hold the block.
    """
    origin = np.round(xyz.mean(axis=0))
    start = StartValues(
        origin, rotation_from_angles(block.images.angles, block.rotation), block.images.centre - origin, xyz - origin
    )
    system, state = build_system(block, start, np.full(len(block.image_points), RayStatus.USED))
    equations = system.assemble(state, 0.0, LEAST_SQUARES)
    factor, defects = checked_factor(system, state, equations, LEAST_SQUARES)
    if factor is None or defects:
        raise InputError(
            f"the block cannot be adjusted: {'; '.join(defects)[:300]}",
            "give more --control, --positions-sigma, or fewer parameters in --self-calibration",
        )
    own = np.full(len(block.points), -1)
    own[system.unknowns.points] = np.arange(len(system.unknowns.points))
    chosen = own[rows]
    found = np.empty((3 * len(rows), 3 * len(rows)))
    for first in range(0, 3 * len(rows), COLUMNS_AT_A_TIME):
        column = np.arange(first, min(first + COLUMNS_AT_A_TIME, 3 * len(rows)))
        sides = np.zeros((len(system.unknowns.points), 3, len(column)))
        sides[chosen[column // 3], column % 3, np.arange(len(column))] = 1.0
        _, _, points = solve_sides(system, state, factor, sides, LEAST_SQUARES, rows=np.unique(chosen))
        found[:, column] = points[chosen].reshape(3 * len(rows), len(column))
    return 0.5 * (found + found.T)


def intersection_covariance(block: Block, xyz: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """(k, 3, 3) m², what the image coordinates of points alone give, orientations being free of error.

    From the inverse of ΣBᵀPB, B the partial derivatives of x = −c·u₁/u₃, y = −c·u₂/u₃, u = Rᵀ(X − X₀).
    """
    rays = block.image_points
    number = np.full(len(block.points), -1)
    number[rows] = np.arange(len(rows))
    mine = np.flatnonzero(number[rays.point] >= 0)
    image, point = rays.image[mine], rays.point[mine]
    rotation = rotation_from_angles(block.images.angles, block.rotation)[image]
    focal = np.array([camera.interior["focal_length_mm"].value for camera in block.cameras])
    c = focal[block.images.camera[image]]
    u = np.einsum("mji,mj->mi", rotation, xyz[point] - block.images.centre[image])
    x, y = u[:, 0] / u[:, 2], u[:, 1] / u[:, 2]
    turned = np.swapaxes(rotation, 1, 2)
    by_x = (-c / u[:, 2])[:, None] * (turned[:, 0] - x[:, None] * turned[:, 2])
    by_y = (-c / u[:, 2])[:, None] * (turned[:, 1] - y[:, None] * turned[:, 2])
    rows_b = np.stack([by_x, by_y], axis=1) / rays.sigma[mine][:, :, None]
    normal = np.zeros((len(rows), 3, 3))
    np.add.at(normal, number[point], np.swapaxes(rows_b, 1, 2) @ rows_b)
    return np.linalg.inv(normal)
