"""Rays of photographs that move while they are read: where they are exposed, and what the motion does to them.

A ray measured at (x, y) is exposed τ = rate·(x, y)·T after the middle of the readout T, from X0 + R·v·τ with the
rotation R·exp([ω]×·τ), see `functional_model._scan_kernels`.
"""

from __future__ import annotations

import numpy as np

from aerotri.deformation.orientation import Orientation
from aerotri.functional_model.collinearity import RayPartials
from aerotri.functional_model.rotation import cross_matrix, exponential


def exposed(orientation: Orientation, k: int, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotation (n, 3, 3) and projection centre (n, 3) m of photograph k when rays measured at (n, 2) mm are exposed."""
    rotation, centre = orientation.rotation[k], orientation.centre[k]
    s = orientation.scans
    if s is None:
        return np.broadcast_to(rotation, (len(at), 3, 3)), np.broadcast_to(centre, (len(at), 3))
    tau = (at @ s.rate[k] * s.readout[k])[:, None]
    return rotation @ exponential(s.spin[k] * tau), centre + tau * (rotation @ s.velocity[k])


def by_motion(orientation: Orientation, k: int, at: np.ndarray, rays: RayPartials, count: int) -> np.ndarray:
    """(n, 2, count) partials of rays of photograph k by the unknowns of its rolling shutter.

    Parameters
    ----------
    at : (n, 2) mm, measured positions. rays : linearised where they are `exposed`.
    count : of all parameters, among which `Scans.columns` counts.
    """
    out, s = np.zeros((len(at), 2, count)), orientation.scans
    if s is None:
        return out
    rate = (at @ s.rate[k])[:, None]
    theta = rate * s.readout[k] * s.spin[k]
    turned = cross_matrix(theta)
    by_velocity = rays.by_orientation[:, :, :3] @ orientation.rotation[k]
    by_turn = rays.by_orientation[:, :, 3:] @ orientation.rotation[k]
    readout, velocity, spin = s.columns[k].tolist()
    if readout >= 0:
        out[:, :, readout] = rate * (by_velocity @ s.velocity[k] + by_turn @ s.spin[k])
    tau = (rate * s.readout[k])[:, :, None]
    if velocity >= 0:
        out[:, :, velocity : velocity + 3] = tau * by_velocity
    if spin >= 0:
        out[:, :, spin : spin + 3] = tau * by_turn @ (np.eye(3) + turned / 2.0 + turned @ turned / 6.0)
    return out
