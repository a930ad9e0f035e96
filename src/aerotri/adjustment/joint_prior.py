"""What is known beforehand of several shared parameters together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class JointPrior:
    """The observation of p shared parameters together: 0, with a full weight matrix.

    Parameters
    ----------
    columns : (p,) in the shared list.
    weight : (p, p) 1/unit², the inverse of their covariance.
    rank : of the weight matrix: how many observations they are.
    """

    columns: np.ndarray
    weight: np.ndarray
    rank: int

    def root(self) -> np.ndarray:
        """(p, rank) R with R·Rᵀ the weight matrix."""
        if self.rank == len(self.weight):
            return np.linalg.cholesky(self.weight)
        values, vectors = np.linalg.eigh(self.weight)
        return vectors[:, -self.rank :] * np.sqrt(values[-self.rank :])
