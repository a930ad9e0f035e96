"""σ̂0 in the image: times the a-priori σ of the image coordinates, one number where they all have one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.observations import Block

SAME = 1e-3
"""Relative difference up to which two σ count as one: files print three digits or more."""


@dataclass(frozen=True)
class ImageSigma:
    """Image coordinates of one a-priori σ.

    Parameters
    ----------
    sigma_um : of each, µm. count : rays. pixel_um : size of the pixels of their cameras, NaN where these differ.
    """

    sigma_um: float
    count: int
    pixel_um: float

    def text(self, sigma0: float) -> str:
        """σ̂0 as σ of such a coordinate: '0.33 µm, 0.10 px'."""
        um = sigma0 * self.sigma_um
        return f"{um:.2f} µm" + (f", {um / self.pixel_um:.2f} px" if np.isfinite(self.pixel_um) else "")


def sigma0_um(sigma0: float, block: Block, used: np.ndarray | None = None) -> float:
    """σ̂0 times the a-priori σ of an image coordinate, µm: where they differ, the median of the rays in use.

    Parameters
    ----------
    used : rows of the block's image points, or (m,) bool; all unless given.
    """
    sigma, common_um = _of_rays(block, used), block.settings.image_sigma_um
    if not len(sigma) or np.allclose(sigma, common_um, rtol=SAME, atol=0.0):
        return sigma0 * common_um
    return sigma0 * float(np.median(sigma))


def image_sigmas(block: Block, used: np.ndarray | None = None) -> list[ImageSigma]:
    """The a-priori σ of the image coordinates, those of most rays first."""
    sigma = _of_rays(block, used)
    rows = slice(None) if used is None else used
    pixel = np.array([camera.pixel_um for camera in block.cameras])[block.images.camera[block.image_points.image[rows]]]
    ordered, groups = np.argsort(sigma, kind="stable"), []
    starts = np.flatnonzero(np.diff(sigma[ordered], prepend=-np.inf) > SAME * sigma[ordered])
    for rows_of_one in np.split(ordered, starts[1:]):
        if len(rows_of_one):
            sizes = np.unique(pixel[rows_of_one])
            size = float(sizes[0]) if len(sizes) == 1 else np.nan
            groups.append(ImageSigma(float(np.median(sigma[rows_of_one])), len(rows_of_one), size))
    return sorted(groups, key=lambda group: -group.count)


def _of_rays(block: Block, used: np.ndarray | None) -> np.ndarray:
    """(k,) µm, of x and y in the mean of their squares."""
    sigma = block.image_points.sigma if used is None else block.image_points.sigma[used]
    return 1e3 * np.sqrt(np.mean(sigma**2, axis=1))
