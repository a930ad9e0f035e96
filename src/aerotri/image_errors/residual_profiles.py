"""Mean residuals along the columns and the rows of the image: what systematic errors are left.

[L: Westfall and Young 1993] Whether the means are more than noise is asked once for all of them: without systematic
errors the residuals of a photograph could as well have the other sign. So the signs of whole photographs are turned at
random, and the largest |mean|/σ of all curves is compared with the largest ones found then. Errors that neighbours in
a photograph share, and the number of means looked at, are thereby taken into account.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.adjustment.ray_status import RayStatus
from aerotri.conventions import px_from_mm
from aerotri.observations import Camera
from aerotri.results.adjusted_block import AdjustedBlock

LONGER_SIDE_BINS = 24
"""Bins along the longer side of the format [C]: narrower ones are too noisy to see a curve."""
FEWEST_PHOTOGRAPHS = 8
"""Photographs in a bin from which on it is drawn and tested [C]: σ of fewer says nothing, and there are 2⁸ signs."""
TURNS, TURNS_AT_A_TIME = 499, 50
"""Random choices of signs [C]: p down to 0.2 %; and how many are held in memory at once."""
PROBABILITY = 0.95
SEED = 1


@dataclass(frozen=True, eq=False)
class ResidualProfile:
    """Means of measured − adjusted along one side of the format of a camera, b bins.

    Parameters
    ----------
    camera : of the photographs. axis : 0 along the columns, 1 along the rows.
    edges : (b + 1,) px. count : (b,) rays. photographs : (b,) with rays in the bin.
    mean, sigma : (b, 2) px, in x to the right and y up; σ from the scatter between photographs. NaN where fewer than
        `FEWEST_PHOTOGRAPHS` have rays.
    """

    camera: Camera
    axis: int
    edges: np.ndarray
    count: np.ndarray
    photographs: np.ndarray
    mean: np.ndarray
    sigma: np.ndarray

    @property
    def t(self) -> np.ndarray:
        """(b, 2) |mean|/σ."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.abs(self.mean) / self.sigma


@dataclass(frozen=True, eq=False)
class ResidualProfiles:
    """The curves of all cameras, two a camera, and one test of all of them.

    Parameters
    ----------
    profiles : columns and rows of every camera that has enough photographs.
    largest : of |mean|/σ. limit : what chance exceeds in 5 % of the cases. p : how often chance exceeds `largest`. NaN
        where nothing can be tested.
    """

    profiles: tuple[ResidualProfile, ...]
    largest: float
    limit: float
    p: float

    @property
    def systematic(self) -> bool:
        """Whether the means are more than noise, at 95 %."""
        return bool(self.p < 1.0 - PROBABILITY)


def residual_profiles(adjusted: AdjustedBlock) -> ResidualProfiles:
    """Average the residuals of the used rays by columns and rows, with their robust weights, and test the means."""
    block, rays = adjusted.block, adjusted.rays
    used = (rays.status == RayStatus.USED) & np.isfinite(rays.v).all(axis=1) & (rays.weight > 0.0)
    camera_of_ray = block.images.camera[block.image_points.image]
    profiles, sums = [], []
    for number, camera in enumerate(block.cameras):
        rows = np.flatnonzero(used & (camera_of_ray == number))
        for axis in (0, 1):
            profile, own = _profile(adjusted, camera, axis, rows)
            if np.isfinite(profile.mean).any():
                profiles.append(profile)
                sums.append(own)
    if not sums:
        return ResidualProfiles((), np.nan, np.nan, np.nan)
    return ResidualProfiles(tuple(profiles), *_tested(np.concatenate(sums, axis=1)))


def _profile(
    adjusted: AdjustedBlock, camera: Camera, axis: int, rows: np.ndarray
) -> tuple[ResidualProfile, np.ndarray]:
    """The means of some rays; and (n, k) the sums by photograph of the bins that are tested, in units of their root
    sum of squares."""
    rays, n = adjusted.block.image_points, len(adjusted.block.images)
    bins = max(round(LONGER_SIDE_BINS * camera.size_px[axis] / max(camera.size_px)), 2)
    edges = np.linspace(0.0, camera.size_px[axis], bins + 1)
    place = px_from_mm(rays.xy[rows], camera.size_px, camera.pixel_mm)[:, axis]
    inside = (place >= 0.0) & (place <= camera.size_px[axis])
    rows = rows[inside]
    index = np.minimum((place[inside] / edges[-1] * bins).astype(np.int64), bins - 1)
    key, weight = rays.image[rows] * bins + index, adjusted.rays.weight[rows]
    left = -adjusted.rays.v[rows] / camera.pixel_mm
    total = np.bincount(key, weight, n * bins).reshape(n, bins)
    by_photograph = np.stack(
        [np.bincount(key, weight * left[:, k], n * bins).reshape(n, bins) for k in (0, 1)], axis=-1
    )
    photographs = np.count_nonzero(total, axis=0)
    root = np.sqrt(np.sum(by_photograph**2, axis=0))
    shown = (photographs >= FEWEST_PHOTOGRAPHS)[:, None] & (root > 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.where(shown, by_photograph.sum(axis=0) / total.sum(axis=0)[:, None], np.nan)
        sigma = np.where(shown, root / total.sum(axis=0)[:, None], np.nan)
        scaled = (by_photograph / root)[:, shown]
    count = np.bincount(index, minlength=bins)
    return ResidualProfile(camera, axis, edges, count, photographs, mean, sigma), scaled


def _tested(scaled: np.ndarray) -> tuple[float, float, float]:
    """Largest |mean|/σ, what chance exceeds in 5 % of the cases, and how often it exceeds the largest.

    Parameters
    ----------
    scaled : (n, k) sums by photograph; each column has the norm 1, so that its sum is mean/σ.
    """
    largest = float(np.abs(scaled.sum(axis=0)).max())
    scaled = scaled[np.any(scaled != 0.0, axis=1)]
    random, by_chance = np.random.default_rng(SEED), []
    for first in range(0, TURNS, TURNS_AT_A_TIME):
        signs = random.integers(0, 2, (min(TURNS_AT_A_TIME, TURNS - first), len(scaled))) * 2.0 - 1.0
        by_chance.append(np.abs(signs @ scaled).max(axis=1))
    chance = np.concatenate(by_chance)
    # the photographs as they are count as one of the choices, so that p is never 0
    p = (1.0 + np.sum(chance >= largest * (1.0 - 1e-12))) / (1.0 + TURNS)
    return largest, float(np.quantile(chance, PROBABILITY)), float(p)
