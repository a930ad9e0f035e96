"""Rays linearised one list at a time, rolling shutters among them; the kernels of the normal equations do the same."""

from __future__ import annotations

import numpy as np

from aerotri.adjustment.unknowns import State, Unknowns
from aerotri.functional_model._scan_kernels import place_in_scan, scan_partials
from aerotri.functional_model.collinearity import RayPartials, linearise

MOST_COLUMNS = 7
"""Shared parameters of a ray by its rolling shutter: readout time, velocity, rates of rotation."""


def linearise_unknown_rays(
    unknowns: Unknowns, state: State, rays: np.ndarray
) -> tuple[RayPartials, np.ndarray, np.ndarray]:
    """Partials of rays of an adjustment.

    Parameters
    ----------
    rays : (k,) rows of `unknowns.rays`.

    Returns
    -------
    The partials by orientation, point and interior; and by shared parameters of rolling shutters: their index (k, 7),
    −1 for none, and the partials (k, 2, 7).
    """
    u = unknowns.rays
    image, lens, at = u.image[rays], u.lens_row[rays], u.at[rays]
    point = np.searchsorted(u.start, rays, side="right") - 1
    scans, own = unknowns.scans(state), np.arange(len(rays))
    rotation, centre = state.rotation[image].copy(), state.centre[image].copy()
    index, value = np.full((len(rays), MOST_COLUMNS), -1, dtype=np.int64), np.zeros((len(rays), 2, MOST_COLUMNS))
    rate = np.sum(scans.rate[image] * at, axis=1) if len(scans.rate) else np.zeros(len(rays))
    tau = rate * scans.readout[image] if len(scans.rate) else rate
    for k in np.flatnonzero(tau).tolist():
        i = image[k]
        place_in_scan(tau[k], state.rotation[i], state.centre[i], scans.velocity[i], scans.spin[i], centre[k],
                      rotation[k])  # fmt: skip
    partials = linearise(rotation, centre, state.points, unknowns.interior(state), own, point, lens, at)
    for k in np.flatnonzero(rate).tolist():
        i = image[k]
        scan_partials(rate[k], tau[k], state.rotation[i], scans.velocity[i], scans.spin[i], partials.by_orientation[k],
                      scans.columns[i], value[k], index[k], 0)  # fmt: skip
    return partials, index, value
