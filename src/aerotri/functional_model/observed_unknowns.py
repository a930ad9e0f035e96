"""Unknowns that were themselves observed: projection centres by GNSS, through the lever arm.

[L] X_gnss + v = X0 + R·lever_arm + shift + drift·(t − t_s); lever arm from the projection centre to the antenna in the
camera frame, t_s the mean time of the strip.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.functional_model.rotation import cross_matrix


@dataclass(frozen=True, eq=False)
class CentreObservations:
    """Observed antenna positions, g of them.

    Parameters
    ----------
    image : (g,) row of the photograph.
    xyz : (g, 3) m, local. inv_sigma : (g, 3) 1/m, 0 where a coordinate is not observed.
    shift, drift : (g, 3) shared parameter of each coordinate, −1 where there is none.
    time : (g,) s from the mean of the strip.
    lever_arm : (3,) m.
    """

    image: np.ndarray
    xyz: np.ndarray
    inv_sigma: np.ndarray
    shift: np.ndarray
    drift: np.ndarray
    time: np.ndarray
    lever_arm: np.ndarray

    def __len__(self) -> int:
        return len(self.image)

    @property
    def count(self) -> int:
        """Number of observed coordinates."""
        return int((self.inv_sigma > 0.0).sum())


def predict_antennas(observed: CentreObservations, centre: np.ndarray, rotation: np.ndarray, shared: np.ndarray):
    """(g, 3) m, the antenna positions that the orientation implies."""
    predicted = centre[observed.image] + rotation[observed.image] @ observed.lever_arm
    for columns, factor in ((observed.shift, 1.0), (observed.drift, observed.time[:, None])):
        there = columns >= 0
        predicted = (
            predicted + np.where(there, shared[np.where(there, columns, 0)] if len(shared) else 0.0, 0.0) * factor
        )
    return predicted


def antenna_partials(observed: CentreObservations, rotation: np.ndarray) -> np.ndarray:
    """(g, 3, 6) partials of the antenna by (X0, Y0, Z0) and by the small rotation δ: [I, −[R·lever_arm]×]."""
    partials = np.zeros((len(observed), 3, 6))
    partials[:, :, :3] = np.eye(3)
    partials[:, :, 3:] = -cross_matrix(rotation[observed.image] @ observed.lever_arm)
    return partials
