"""Has the camera changed? The systematic image errors of two groups against each other, in one test."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import gammaincc, gammaincinv

from aerotri.image_errors.field import ErrorField, difference_with_jacobian, field_difference
from aerotri.statistics.adjusted_block import AdjustedBlock

RANK_LIMIT = 1e-6
"""Singular values of A below this share of the size of the groups' own fields are directions in which they agree."""


@dataclass(frozen=True, eq=False)
class GroupChange:
    """The difference of two groups' systematic image errors.

    Parameters
    ----------
    field : first − second, with σ and significance node by node.
    chi2 : dᵀQ⁺d of all nodes at once; freedom : rank of Q, the parameters that tell the groups apart.
    """

    field: ErrorField
    chi2: float
    freedom: int

    @property
    def probability(self) -> float:
        """Of a χ² as large as this by chance, where nothing has changed."""
        return float(gammaincc(self.freedom / 2.0, self.chi2 / 2.0)) if self.freedom else 1.0

    def limit(self, alpha: float = 0.05) -> float:
        """χ² above which a change is taken for real."""
        return float(2.0 * gammaincinv(self.freedom / 2.0, 1.0 - alpha)) if self.freedom else 0.0


def group_change(adjusted: AdjustedBlock, first: str, second: str, camera: str | None = None) -> GroupChange:
    """Test of "no change" between two groups, which may have kept different parameters.

    d = J·p at the nodes of the grid, Q = J·Q_pp·Jᵀ = A·Aᵀ with A = J·Q_pp^½; χ² = ‖A⁺d‖², its freedom the rank of A.

    Parameters
    ----------
    first, second : names of the groups; camera : needed only where several cameras share a group.
    """
    field = field_difference(adjusted, first, second, camera=camera)
    at = field.x.ravel(), field.y.ravel()
    d, jacobian, covariance = difference_with_jacobian(adjusted, first, second, *at, camera)
    size = np.sqrt(np.maximum(np.diagonal(covariance), 0.0))
    scale = np.where(size > 0.0, size, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    root = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    design = jacobian.reshape(-1, len(scale))
    u, s, _ = np.linalg.svd(design @ root, full_matrices=False)
    kept = s > RANK_LIMIT * np.linalg.norm(np.abs(design) @ size)
    chi2 = float(np.sum((u[:, kept].T @ d.ravel() / s[kept]) ** 2))
    return GroupChange(field, chi2, int(kept.sum()))
