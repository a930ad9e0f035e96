"""Cameras on rigid rigs as they were adjusted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class MountedCamera:
    """A camera of a rig in the frame of the reference camera: X_reference = position + R·X_camera.

    Parameters
    ----------
    rig, reference, camera : names.
    position : (3,) m. angles : (3,) rad, ω, φ, κ of R in the block's order.
    covariance : (6, 6) of both, m and rad, σ̂0² included; 0 for what is held.
    stations : photographs of the camera that took part.
    """

    rig: str
    reference: str
    camera: str
    position: np.ndarray
    angles: np.ndarray
    covariance: np.ndarray
    stations: int

    @property
    def sigma(self) -> np.ndarray:
        """(6,) m and rad."""
        return np.sqrt(np.maximum(np.diagonal(self.covariance), 0.0))

    @property
    def correlations(self) -> np.ndarray:
        """(6, 6); NaN for what is held."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.covariance / np.outer(self.sigma, self.sigma)


@dataclass(frozen=True, eq=False)
class RigMovements:
    """How k cameras on weighted rigs move, and the deviations of their n photographs, axes of the reference camera.

    Parameters
    ----------
    rig, camera : (k,) names. sigma : (k, 2) σ of the movements in position, m, and rotation, rad, an axis; σ̂0 included.
    sigma_sigma : (k, 2) σ of these, as far as they follow from the block; NaN where they are 0.
    estimated : (k, 2) bool, whether they were estimated from the block.
    image : (n,) rows of the block. station : (n,) names. of : (n,) rows of `camera`.
    deviation, deviation_sigma : (n, 6) m and rad.
    """

    rig: np.ndarray
    camera: np.ndarray
    sigma: np.ndarray
    sigma_sigma: np.ndarray
    image: np.ndarray
    station: np.ndarray
    of: np.ndarray
    deviation: np.ndarray
    deviation_sigma: np.ndarray
    estimated: np.ndarray | None = None
