"""Redundancy numbers and normalised residuals of every observation [L: Baarda 1968]."""

from __future__ import annotations

import numpy as np
from scipy.stats import norm

from aerotri.observations import Block
from aerotri.statistics.adjusted_block import Blunder, RayResults

MIN_REDUNDANCY = 1e-6
"""Redundancy number below which an observation is not controlled by others, and has no test."""


def normalised_residuals(v: np.ndarray, sigma: np.ndarray, r: np.ndarray) -> np.ndarray:
    """w = −v/(σ·√r), σ a priori; NaN where r is practically zero.

    Parameters
    ----------
    v, sigma : residual and its a-priori σ in one unit. r : redundancy number. Any common shape.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(r > MIN_REDUNDANCY, -v / (sigma * np.sqrt(np.maximum(r, 0.0))), np.nan)

LISTED_BLUNDERS = 100


def critical_value(alpha: float) -> float:
    """Two-sided limit of a standard normal test of level `alpha`: 3.29 for 0.1 %."""
    return float(norm.ppf(1.0 - alpha / 2.0))


def suspected_blunders(block: Block, rays: RayResults) -> tuple[Blunder, ...]:
    """Rays with a normalised residual beyond the limit of `alpha`, largest first.

    The estimated error of a coordinate is −v/r; of the two coordinates the one with the larger |w| speaks.
    """
    w = np.nan_to_num(rays.w)
    axis = np.argmax(np.abs(w), axis=1)
    size = np.take_along_axis(w, axis[:, None], axis=1)[:, 0]
    suspects = np.flatnonzero(np.abs(size) > critical_value(block.settings.adjustment.alpha))
    suspects = suspects[np.argsort(-np.abs(size[suspects]), kind="stable")][:LISTED_BLUNDERS]
    return tuple(
        Blunder(
            image=str(block.images.names[block.image_points.image[k]]),
            point=str(block.points[block.image_points.point[k]]),
            w=float(size[k]),
            estimated_mm=float(-rays.v[k, axis[k]] / rays.r[k, axis[k]]),
            action="down-weighted" if rays.weight[k] < 1.0 else "kept",
        )
        for k in suspects
    )
