"""How photographs really move while they are read: along the track of their strip, and turning a little."""

from __future__ import annotations

import numpy as np

from aerotri.simulation.flight import FlownImages
from aerotri.simulation.projection import Motion
from aerotri.simulation.random_streams import stream
from aerotri.simulation.spec import SimulationSpec


def true_motion(spec: SimulationSpec, planned: FlownImages, lead: np.ndarray, seed: int) -> Motion | None:
    """Velocities and rates of rotation of all photographs; None without rolling shutters.

    The aircraft passes through the projection centres of a strip on a smooth path, a cubic spline over time. A strip of
    one photograph has the planned speed to the east.

    Parameters
    ----------
    planned : as flown, before the cameras of rigs are put on. lead : (n,) row of `planned` of every photograph.
    """
    from scipy.interpolate import CubicSpline

    shutters = [camera.rolling_shutter for camera in spec.camera.values()]
    if all(shutter is None for shutter in shutters):
        return None
    velocity = np.zeros((len(planned), 3))
    for strip in np.unique(planned.strip):
        own = np.flatnonzero(planned.strip == strip)
        if len(own) > 1:
            path = CubicSpline(planned.time[own], planned.centre[own])
            velocity[own] = path(planned.time[own], 1)
        else:
            velocity[own] = [spec.flight.speed_m_s, 0.0, 0.0]
    rate = np.radians([0.0 if shutter is None else shutter.rotation_rate_sigma_deg_s for shutter in shutters])
    camera = planned.camera
    spin = rate[camera][:, None] * stream(seed, "readout").normal(size=(len(planned), 3))
    return Motion(velocity[lead], spin[lead])


def true_readouts(spec: SimulationSpec) -> dict[str, float]:
    """ms, by camera with a rolling shutter."""
    return {
        name: camera.rolling_shutter.readout_ms
        for name, camera in spec.camera.items()
        if camera.rolling_shutter is not None
    }
