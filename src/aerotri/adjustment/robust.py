"""Robust weights of rays: which estimator, and the scale it works with.

Huber [L: Huber, Robust statistics, 1981] keeps full weight up to a limit and lets longer residuals pull with constant
force. The limit counts in robust standard deviations of the normalised residual length; the scale is re-estimated from
the median so that a wrong a-priori σ neither switches the estimator off nor turns good rays down.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.adjustment import _kernels

HUBER_LIMIT = 2.0
"""Normalised residual length of full weight [C]; 87 % of good rays lie below (two coordinates, Rayleigh)."""

RAYLEIGH_MEDIAN = float(np.sqrt(2.0 * np.log(2.0)))


@dataclass(frozen=True)
class Estimator:
    """What the kernels need: code of the weight function and its limit in units of the a-priori σ."""

    code: int = _kernels.NONE
    limit: float = 0.0

    @property
    def is_robust(self) -> bool:
        return self.code != _kernels.NONE


LEAST_SQUARES = Estimator()


def scale_of(residual: np.ndarray, inv_sigma: np.ndarray, redundancy_share: float) -> float:
    """Robust standard deviation of normalised residuals, from the median length.

    Parameters
    ----------
    residual : (m, 2) mm; inv_sigma : (m, 2) 1/mm.
    redundancy_share : redundancy / observations, by which residuals are smaller than errors.
    """
    length = np.hypot(residual[:, 0] * inv_sigma[:, 0], residual[:, 1] * inv_sigma[:, 1])
    if not len(length):
        return 1.0
    return float(np.median(length)) / RAYLEIGH_MEDIAN / np.sqrt(max(redundancy_share, 0.05))


def huber(scale: float) -> Estimator:
    """Huber's estimator for residuals of the given scale."""
    return Estimator(_kernels.HUBER, HUBER_LIMIT * max(scale, 1e-12))
