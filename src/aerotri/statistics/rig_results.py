"""The mountings of a rigid rig as they were adjusted: position and angles of every camera with their covariance."""

from __future__ import annotations

import numpy as np

from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.rigging import Mountings
from aerotri.adjustment.solve import Solution
from aerotri.functional_model.rotation import angles_from_rotation, small_rotation_per_angle
from aerotri.results.rigs import MountedCamera
from aerotri.statistics.covariance import Cofactors


def mounted_cameras(system: NormalSystem, solution: Solution, q: Cofactors, sigma0: float) -> tuple[MountedCamera, ...]:
    """Every camera of a rigid rig beside the reference camera, in the frame of that."""
    u = system.unknowns
    mountings = u.mountings
    if mountings is None:
        return ()
    every = np.concatenate([
        part.mounting for part in (u.rigging, u.ties) if part is not None
    ])  # fmt: skip
    position, rotation = mountings.at(solution.state.shared)
    angles = angles_from_rotation(rotation, mountings.order)
    rig = {camera: rig for rig in u.block.rigs for camera in rig.cameras}
    return tuple(
        MountedCamera(
            rig=rig[camera].name,
            reference=rig[camera].reference,
            camera=camera,
            position=position[k],
            angles=angles[k],
            covariance=sigma0**2 * _cofactor(mountings, k, angles[k], solution.state.shared, q.shared),
            stations=int((every == k).sum()),
        )
        for k, camera in enumerate(mountings.cameras)
    )


def _cofactor(
    mountings: Mountings, k: int, angles: np.ndarray, shared: np.ndarray, cofactors: np.ndarray
) -> np.ndarray:
    """(6, 6) of position and angles, 0 for what is held."""
    columns = mountings.columns[k]
    there = np.flatnonzero(columns >= 0)
    own = np.zeros((6, 6))
    own[np.ix_(there, there)] = cofactors[np.ix_(columns[there], columns[there])]
    partial = np.eye(6)
    # of a steep mounting the unknowns are other angles than those of the rotation
    per_angle = small_rotation_per_angle(angles, mountings.order)
    if not np.array_equal(mountings.left[k], np.eye(3)):
        partial[3:, 3:] = np.linalg.pinv(per_angle) @ mountings.axes(shared)[k]
    return partial @ own @ partial.T
