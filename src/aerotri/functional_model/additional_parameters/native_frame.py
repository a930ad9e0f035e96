"""The frame in which the parts of a composed sensor are described: x across the flight, y along it, mm."""

from __future__ import annotations

import numpy as np

from aerotri.observations import Camera

# rows: image axes of the native axes (across, along) for each flight axis
NATIVE_FROM_IMAGE = {
    "+y": np.array([[1.0, 0.0], [0.0, 1.0]]),
    "-y": np.array([[-1.0, 0.0], [0.0, -1.0]]),
    "+x": np.array([[0.0, -1.0], [1.0, 0.0]]),
    "-x": np.array([[0.0, 1.0], [-1.0, 0.0]]),
}


def native_from_image(camera: Camera) -> np.ndarray:
    """(2, 2) rotation from image axes into the sensor's native axes (x across, y along the flight)."""
    return NATIVE_FROM_IMAGE[camera.flight_axis or "+y"]


def native_half_format_mm(camera: Camera) -> tuple[float, float]:
    """Half extent of the format across and along the flight, mm."""
    across, along = np.abs(native_from_image(camera) @ np.array(camera.half_format_mm))
    return float(across), float(along)
