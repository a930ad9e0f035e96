"""Readout times of rolling shutters with their σ, and how the photographs moved."""

from __future__ import annotations

from collections import Counter

import numpy as np

from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.track_velocity import TIMED, time_rounding, times_of
from aerotri.results.rolling_shutter import Motions, Readout, RollingShutters
from aerotri.statistics.covariance import Cofactors


def rolling_shutters(system: NormalSystem, solution: Solution, q: Cofactors, sigma0: float) -> RollingShutters | None:
    """Of every camera with a rolling shutter; None without any."""
    u, state = system.unknowns, solution.state
    if u.scanning is None:
        return None
    scanning = u.scanning
    velocity, spin = scanning.motion(state.shared)
    speed = np.linalg.norm(velocity, axis=1)
    readout, camera = scanning.readout(state.shared), u.block.images.camera[u.images]
    time = times_of(u.block)[u.images]
    found = []
    for k in np.unique(camera[scanning.rolling]).tolist():
        rows = np.flatnonzero(camera == k)
        column = int(scanning.columns[rows[0], 0])
        sigma = float(sigma0 * np.sqrt(q.shared[column, column])) if column >= 0 else 0.0
        shutter = u.block.cameras[k].rolling_shutter
        weighted = column >= 0 and np.isfinite(u.shared.sigma[column])
        found.append(
            Readout(
                camera=u.block.cameras[k].name,
                readout_ms=float(readout[rows[0]]),
                sigma_ms=sigma,
                status="fixed" if column < 0 else "weighted" if weighted else "estimated",
                row_direction="down" if shutter is None else shutter.row_direction,
                photographs=len(rows),
                speed_m_s=float(np.median(speed[rows])),
                moved_m=float(1e-3 * readout[rows[0]] * np.median(speed[rows])),
                velocities=dict(Counter(scanning.source[rows].tolist())),
                total_sigma_ms=sigma,
                time_rounding_s=time_rounding(time[rows]) if TIMED in scanning.source[rows] else 0.0,
            )
        )
    rows = np.flatnonzero(scanning.rolling)
    in_object = np.einsum("nij,nj->ni", state.rotation[rows], velocity[rows])
    return RollingShutters(tuple(found), Motions(u.images[rows], in_object, spin[rows], scanning.source[rows]))
