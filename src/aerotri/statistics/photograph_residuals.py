"""Residuals photograph by photograph against those of the whole block."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import gamma

from aerotri.adjustment.ray_status import RayStatus
from aerotri.results.adjusted_block import AdjustedBlock

ALPHA = 0.05
"""Probability that any photograph is named by chance; shared by all photographs [L: Bonferroni]."""


@dataclass(frozen=True, eq=False)
class PhotographResiduals:
    """Residuals of the n photographs of a block; NaN of one without used rays.

    Parameters
    ----------
    rays : (n,) used. rms_px : (n, 2) of vx and vy. rms_all_px : (2,) of all rays.
    ratio : (n,) σ of the image points of the photograph over that of all: √(Σ p·v²/Σ r), by the same of the block.
    limit : (n,) of the ratio that chance exceeds in one photograph of the block in 5 % of the blocks.
    """

    rays: np.ndarray
    rms_px: np.ndarray
    rms_all_px: np.ndarray
    ratio: np.ndarray
    limit: np.ndarray

    @property
    def beyond(self) -> np.ndarray:
        """(n,) bool, photographs whose residuals are larger than chance makes them."""
        return np.nan_to_num(self.ratio) > np.nan_to_num(self.limit, nan=np.inf)

    @property
    def worst_first(self) -> np.ndarray:
        """Rows of the photographs with rays, the largest ratio first."""
        known = np.flatnonzero(np.isfinite(self.ratio))
        return known[np.argsort(-self.ratio[known], kind="stable")]

    def take(self, rows: np.ndarray) -> PhotographResiduals:
        """Those of some photographs; what concerns all stays."""
        return PhotographResiduals(
            self.rays[rows], self.rms_px[rows], self.rms_all_px, self.ratio[rows], self.limit[rows]
        )


@dataclass(frozen=True, eq=False)
class ResidualSums:
    """What the residuals of photographs add up to; parts of a block add theirs.

    Parameters
    ----------
    rays : (n,) used. freedom : (n,) their redundancy. squares_px : (n, 2) Σ v², pixels. squares : (n,) Σ p·v².
    fourth, weight : Σ r·(p·v²/r)² and Σ r of the image coordinates that have a test.
    """

    rays: np.ndarray
    freedom: np.ndarray
    squares_px: np.ndarray
    squares: np.ndarray
    fourth: float
    weight: float


def photograph_residuals(adjusted: AdjustedBlock) -> PhotographResiduals:
    """Root mean squares by photograph, and which of them are more than chance.

    [D] With z the normalised residuals, Σ r·z² of a photograph over its redundancy ν has the variance V·2/ν, V ≥ 1 how
    much larger than that of the normal distribution the variance of z² is in the whole block: heavy tails that all
    photographs have do not single one out. Its distribution is taken as a gamma distribution of that variance.
    """
    return residuals_of(residual_sums(adjusted))


def residual_sums(adjusted: AdjustedBlock) -> ResidualSums:
    """The sums of the residuals of every photograph."""
    block, found, n = adjusted.block, adjusted.rays, len(adjusted.block.images)
    used = (found.status == RayStatus.USED) & np.isfinite(found.v).all(axis=1) & np.isfinite(found.r).all(axis=1)
    image, v, r = block.image_points.image[used], found.v[used], np.clip(found.r[used], 0.0, 1.0)
    pixel = np.array([camera.pixel_mm for camera in block.cameras])[block.images.camera[image]]
    v_px, weight = v / pixel[:, None], found.weight[used][:, None]
    squares = weight * (v / block.image_points.sigma[used]) ** 2
    with np.errstate(invalid="ignore", divide="ignore"):
        single = squares / r
    known = np.isfinite(single) & (r > 0.05)
    return ResidualSums(
        np.bincount(image, minlength=n),
        np.bincount(image, r.sum(axis=1), n),
        np.stack([np.bincount(image, v_px[:, k] ** 2, n) for k in (0, 1)], axis=-1),
        np.bincount(image, squares.sum(axis=1), n),
        float(np.sum((r * known) * np.where(known, single, 0.0) ** 2)),
        float(np.sum(r * known)),
    )


def residuals_of(sums: ResidualSums) -> PhotographResiduals:
    """As `photograph_residuals`, of sums."""
    rays, freedom = sums.rays, sums.freedom
    with np.errstate(invalid="ignore", divide="ignore"):
        rms = np.sqrt(sums.squares_px / rays[:, None])
        whole = sums.squares.sum() / freedom.sum() if rays.any() else np.nan
        ratio = np.where(freedom > 0.0, np.sqrt(sums.squares / freedom / whole), np.nan)
        shape = freedom / (2.0 * _heaviness(sums, float(whole)))
        limit = np.sqrt(gamma.ppf(1.0 - ALPHA / max(int((rays > 0).sum()), 1), shape, scale=1.0 / shape))
    everything = np.sqrt(sums.squares_px.sum(axis=0) / rays.sum()) if rays.any() else np.full(2, np.nan)
    return PhotographResiduals(rays, rms, everything, ratio, limit)


def _heaviness(sums: ResidualSums, whole: float) -> float:
    """Variance of the squared normalised residuals over that of the normal distribution, at least 1."""
    if not whole > 0.0:
        return 1.0
    return max((sums.fourth / whole**2 / max(sums.weight, 1e-12) - 1.0) / 2.0, 1.0)
