"""The image errors of one photograph of a rolling shutter: d of its camera, and its way while it was read.

[D] An ideal photograph is what a camera sees that exposes all rows in the middle of the readout. A ray of it meets the
ground, which is taken for a plane, at P. The measured photograph shows P at m = π_τ(P) + d(m), π_τ the projection at
τ = rate·m·T after the middle of the readout T (see `functional_model._scan_kernels`). What the relief over the plane
changes is left: it is the share of the relief in the flying height of a displacement of some pixels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.functional_model.rotation import exponential
from aerotri.image_errors.error_function import Bounds, ErrorFunction
from aerotri.observations import Camera

STEPS = 3
"""Steps to the row in which a ray is measured [C]: each leaves about a hundredth of what is left."""
FARTHEST = 1e3
"""Flying heights beyond which a ray is taken to meet nothing [C]: the way of the camera no longer shows there."""


@dataclass(frozen=True, eq=False)
class MovingErrors:
    """The image errors of one photograph over plane ground.

    Parameters
    ----------
    function : d of its group.
    rate : (2,) s per ms and mm: a ray at (x, y) is exposed rate·(x, y)·readout_ms after the middle of the readout.
    velocity : (3,) m/s, spin : (3,) rad/s, in the camera frame.
    plane : (3,) 1/m, the points with plane·u = 1 in the camera frame are the ground.
    """

    function: ErrorFunction
    rate: np.ndarray
    readout_ms: float
    velocity: np.ndarray
    spin: np.ndarray
    plane: np.ndarray

    @property
    def camera(self) -> Camera:
        return self.function.camera

    @property
    def group(self) -> str:
        return self.function.group

    @property
    def is_zero(self) -> bool:
        """Whether nothing moves."""
        still = not (self.velocity.any() or self.spin.any()) or self.readout_ms == 0.0
        return self.function.is_zero and still

    def measured(self, ideal: np.ndarray, within: Bounds | None = None) -> np.ndarray:
        """Measured positions of ideal ones (n, 2) mm; arguments as of `ErrorFunction.measured`."""
        return self.measured_of(self._on_ground(np.asarray(ideal, dtype=float)), within)

    def measured_of(self, u: np.ndarray, within: Bounds | None = None) -> np.ndarray:
        """(n, 2) mm, where places (n, 3) m in the camera frame in the middle of the readout are measured."""
        found = self.function.measured(self._projected(u), within)
        for _ in range(STEPS):
            tau = (found @ self.rate)[:, None] * self.readout_ms
            turned = exponential(self.spin * tau)
            found = self.function.measured(
                self._projected(np.einsum("nji,nj->ni", turned, u - self.velocity * tau)), within
            )
        return found

    def ideal_of(self, u: np.ndarray) -> np.ndarray:
        """(n, 2) mm, where an ideal photograph shows places (n, 3) m in the camera frame."""
        return self._projected(u)

    def _projected(self, u: np.ndarray) -> np.ndarray:
        c, x0, y0 = self.function.interior
        return np.array([x0, y0]) - c * u[:, :2] / u[:, 2:]

    def _on_ground(self, ideal: np.ndarray) -> np.ndarray:
        """(n, 3) m, places on the ground that ideal positions show."""
        c, x0, y0 = self.function.interior
        ray = np.column_stack([ideal - (x0, y0), np.full(len(ideal), -c)])
        nearness = np.maximum(ray @ self.plane, c * float(np.linalg.norm(self.plane)) / FARTHEST)
        return ray / nearness[:, None]
