"""Whether neighbouring rays of a photograph err independently, as the adjustment assumes.

[D] With independent errors the residuals of two rays of one photograph have the cofactor −a·Q·bᵀ, a and b their rows of
the design matrix: the unknowns that both determine make neighbours unlike, never alike. So a positive correlation of
neighbours is a sign of common errors, and taking 0 for what to expect errs on the careful side. Its σ is from the
scatter of the photographs, which err independently of one another if rays do.
"""

from __future__ import annotations

import itertools

import numpy as np
from scipy.spatial import KDTree

from aerotri.adjustment.ray_status import RayStatus
from aerotri.conventions import SIGMA_PER_MAD
from aerotri.observations import Block
from aerotri.quantiles import student_exceedance
from aerotri.results.adjusted_block import RayResults
from aerotri.results.ray_correlation import RayCorrelation

LIMITS = (0.0, 0.005, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32)
"""Limits of the classes of distance, in half diagonals of the format [C]: 25, 50, 100 px … of
a photograph of 45 Mpx."""
NEAR = 0.04
"""Distance, in half diagonals, up to which the test looks [C]: systematic errors of lenses that a set of parameters
does not contain reach further, and are the matter of other tests."""
FEWEST_PAIRS = 100
"""Pairs from which a correlation is stated [C]: its σ is then about 0.1."""
FEWEST_PHOTOGRAPHS = 5
"""Photographs with pairs from which their scatter says something [C]."""
MOST_PHOTOGRAPHS = 600
"""Photographs that are looked at [C]: more take time and tell no more."""
CLIP = 3.0
"""Residuals count with this many σ at most: one gross error makes no correlation."""
LEAST_REDUNDANCY = 0.1
"""Redundancy number from which a residual takes part [C]: of smaller ones the residual shows hardly any error."""


def ray_correlation(block: Block, rays: RayResults) -> RayCorrelation:
    """Correlation of the residuals of two rays of one photograph, by their distance in the image.

    Distances are classed in half diagonals of each photograph's format and stated in pixels of the first camera.

    Parameters
    ----------
    rays : residuals and redundancy numbers, rows as in `block.image_points`.
    """
    z = _normalised(rays)
    sums, counts = [], []
    for image, rows in _photographs(block, z):
        found = _products(block.image_points.xy[rows] / block.cameras[block.images.camera[image]].r_max_mm, z[rows])
        if found is not None:
            sums.append(found[0])
            counts.append(found[1])
    if len(counts) < FEWEST_PHOTOGRAPHS:
        return RayCorrelation(reason=f"fewer than {FEWEST_PHOTOGRAPHS} photographs have rays near one another")
    s, n = np.array(sums), np.array(counts)
    diagonal_px = block.cameras[0].r_max_mm / block.cameras[0].pixel_mm
    limits = diagonal_px * np.array(LIMITS)
    mean, sigma = _mean_of_photographs(s, n)
    few = n.sum(axis=0) < FEWEST_PAIRS
    mean[few], sigma[few] = np.nan, np.nan
    inside = np.array(LIMITS[1:]) <= NEAR + 1e-12
    near, of_near = _mean_of_photographs(s[:, inside].sum(axis=1, keepdims=True), n[:, inside].sum(axis=1)[:, None])
    pairs = n.sum(axis=0).max(axis=1).astype(np.int64)
    if int(pairs[inside].sum()) < FEWEST_PAIRS:
        reason = f"fewer than {FEWEST_PAIRS} pairs of rays lie near one another"
        return RayCorrelation(limits, pairs, mean, sigma, reason=reason)
    if not (of_near[0] > 0.0).all():
        return RayCorrelation(limits, pairs, mean, sigma, reason="the residuals near one another do not scatter")
    return RayCorrelation(
        limits, pairs, mean, sigma, _probability(near[0] / of_near[0], len(n) - 1), float(NEAR * diagonal_px)
    )


def _normalised(rays: RayResults) -> np.ndarray:
    """(m, 2) residuals of mean square 1 in x and in y, clipped; NaN where a ray does not take part."""
    usable = (rays.status == RayStatus.USED)[:, None] & (rays.r >= LEAST_REDUNDANCY)
    z = np.where(usable, rays.w, np.nan)
    for axis in range(2):
        known = np.isfinite(z[:, axis])
        if known.any():
            own = z[known, axis] - np.median(z[known, axis])
            scale = SIGMA_PER_MAD * np.median(np.abs(own))
            own = np.clip(own / scale, -CLIP, CLIP) if scale > 0.0 else np.zeros_like(own)
            z[known, axis] = own / max(float(np.sqrt(np.mean(own**2))), 1e-300)
    return z


def _photographs(block: Block, z: np.ndarray) -> list[tuple[int, np.ndarray]]:
    """Photographs and their rays that take part; a share of them, evenly over the block, where they are many."""
    image = block.image_points.image
    there = np.flatnonzero(np.isfinite(z).any(axis=1))
    there = there[np.argsort(image[there], kind="stable")]
    numbers = np.unique(image[there])
    step = -(-len(numbers) // MOST_PHOTOGRAPHS)
    ends = np.searchsorted(image[there], [numbers, numbers + 1])
    return [
        (int(number), there[a:b])
        for number, a, b in itertools.islice(zip(numbers, *ends, strict=True), 0, None, max(step, 1))
        if b - a > 1
    ]


def _products(xy: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Sums of the products of residuals (k, 2) and pairs (k, 2) of one photograph; None where there is no pair.

    Parameters
    ----------
    xy : (m, 2) half diagonals.
    """
    pairs = KDTree(xy).query_pairs(LIMITS[-1], output_type="ndarray")
    if not len(pairs):
        return None
    far = np.linalg.norm(xy[pairs[:, 0]] - xy[pairs[:, 1]], axis=1)
    number = np.clip(np.searchsorted(LIMITS, far, side="right") - 1, 0, len(LIMITS) - 2)
    product = z[pairs[:, 0]] * z[pairs[:, 1]]
    sums, counts = np.zeros((2, len(LIMITS) - 1)), np.zeros((2, len(LIMITS) - 1))
    for axis in range(2):
        known = np.isfinite(product[:, axis])
        sums[axis] = np.bincount(number[known], product[known, axis], len(LIMITS) - 1)
        counts[axis] = np.bincount(number[known], minlength=len(LIMITS) - 1)
    return sums.T, counts.T


def _mean_of_photographs(sums: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Correlation (k, 2) and its σ from sums and pairs (photographs, k, 2)."""
    total = counts.sum(axis=0)
    mean = sums.sum(axis=0) / np.maximum(total, 1.0)
    away = sums - mean * counts
    return mean, np.sqrt(np.sum(away**2, axis=0)) / np.maximum(total, 1.0)


def _probability(t: np.ndarray, freedom: int) -> float:
    """Of the larger of two values of Student's t, x and y, by chance."""
    single = min(student_exceedance(float(value), freedom) for value in t if np.isfinite(value))
    return min(2.0 * single, 1.0)
