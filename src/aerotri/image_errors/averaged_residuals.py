"""Averaged residuals: all photographs of a group laid over one another, the residuals averaged cell by cell.

Noise averages out, what the model does not explain stays. Shown is measured − adjusted (the residuals with their sign
turned), in the plane corrected for the systematic image errors: what a remaining systematic image error looks like.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.adjustment.ray_status import RayStatus
from aerotri.image_errors.field import CHI2_LIMIT, grid_nodes
from aerotri.image_errors.groups import image_group
from aerotri.observations import Camera
from aerotri.results.adjusted_block import AdjustedBlock

LONGER_SIDE_CELLS = 20
"""Cells along the longer side of the format at most [C]: more are too small for the arrows of a plot."""
FEWEST_CELLS = 6
"""Cells along it at least [C]: fewer hide the pattern, even where few rays lie in each."""


@dataclass(frozen=True, eq=False)
class AveragedResiduals:
    """Means over cells of the image format.

    Parameters
    ----------
    camera, group : of the photographs.
    x, y : (ny, nx) mm, centres of the cells; y grows with the row index.
    mean : (ny, nx, 2) mm, measured − adjusted; NaN in an empty cell.
    count : (ny, nx) rays in the cell.
    sigma : (ny, nx, 2) mm, of the mean: σ̂/√n.
    sigma_residual : (2,) mm, σ̂ of one residual in x and y, pooled over the cells about their means.
    n_min : cells with fewer rays are not drawn.
    outside : rays measured outside the format, in no cell.
    """

    camera: Camera
    group: str
    x: np.ndarray
    y: np.ndarray
    mean: np.ndarray
    count: np.ndarray
    sigma: np.ndarray
    sigma_residual: np.ndarray
    n_min: int
    outside: int

    @property
    def shown(self) -> np.ndarray:
        """(ny, nx) bool: cells with at least n_min rays."""
        return self.count >= self.n_min

    @property
    def significant(self) -> np.ndarray:
        """(ny, nx) bool: cells shown whose mean exceeds what noise leaves, at 95 % (χ² with two degrees of freedom)."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return self.shown & (np.sum((self.mean / self.sigma) ** 2, axis=-1) > CHI2_LIMIT)

    @property
    def rms(self) -> float:
        """mm, root mean square length of the vectors shown; NaN when none is."""
        return _root_mean(np.sum(self.mean[self.shown] ** 2, axis=-1))

    @property
    def rms_of_noise(self) -> float:
        """mm, the length that noise alone would leave, from the σ of the means shown."""
        return _root_mean(np.sum(self.sigma[self.shown] ** 2, axis=-1))

    @property
    def max(self) -> float:
        """mm, the longest vector shown; NaN when none is."""
        lengths = np.hypot(*self.mean[self.shown].T)
        return float(lengths.max()) if len(lengths) else float("nan")


def averaged_residuals(
    adjusted: AdjustedBlock, group: str, nx: int | None = None, n_min: int = 5, camera: str | None = None
) -> AveragedResiduals:
    """Average the residuals of a group by cells of the format.

    Rays count with their robust weight, so that a rejected gross error does not bend its cell; with weights of one the
    mean is the plain mean and its σ is σ̂/√n.

    Parameters
    ----------
    nx : cells along x; default 20 on the longer side, fewer where a cell would hold less than 2·n_min rays on average.
    n_min : cells with fewer rays are not drawn.
    camera : name; needed only where several cameras share the group.
    """
    block = adjusted.block
    images = image_group(block, group, camera)
    rays = images.images[block.image_points.image] & (adjusted.rays.status == RayStatus.USED)
    rays &= np.isfinite(adjusted.rays.v).all(axis=1) & (adjusted.rays.weight > 0.0)
    xy, remaining, weight = block.image_points.xy[rays], -adjusted.rays.v[rays], adjusted.rays.weight[rays]
    longer = _cells_for(len(xy), images.camera, n_min)
    x, y = grid_nodes(images.camera, nx, longer)
    cell = _cell_of(xy, images.camera, x.shape)
    inside = cell >= 0
    mean, count, sigma, pooled = _means(cell[inside], remaining[inside], weight[inside], x.size)
    shape = (*x.shape, 2)
    return AveragedResiduals(
        images.camera, group, x, y, mean.reshape(shape), count.reshape(x.shape), sigma.reshape(shape), pooled, n_min,
        int(np.sum(~inside)),
    )  # fmt: skip


def _cells_for(rays: int, camera: Camera, n_min: int) -> int:
    """Cells on the longer side that hold 2·n_min rays on average, within limits."""
    half = camera.half_format_mm
    wanted = np.sqrt(rays / (2.0 * max(n_min, 1)) * max(half) / min(half))
    return int(np.clip(wanted, FEWEST_CELLS, LONGER_SIDE_CELLS))


def _cell_of(xy: np.ndarray, camera: Camera, shape: tuple[int, ...]) -> np.ndarray:
    """(m,) flat index row·nx + column of the cell of every position, −1 outside the format.

    The upper and right edges belong to the last cell.
    """
    half, size = np.array(camera.half_format_mm), np.array(shape[::-1])
    index = np.floor((xy + half) / (2.0 * half) * size).astype(np.int64)
    index = np.where(xy == half, size - 1, index)
    inside = np.all((index >= 0) & (index < size), axis=1)
    return np.where(inside, index[:, 1] * shape[1] + index[:, 0], -1)


def _means(
    cell: np.ndarray, remaining: np.ndarray, weight: np.ndarray, n_cells: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Weighted mean, count and σ of the mean per cell, and the pooled σ of one residual."""
    count = np.bincount(cell, minlength=n_cells)
    total = np.bincount(cell, weight, n_cells)
    squares = np.bincount(cell, weight**2, n_cells)
    sums = np.stack([np.bincount(cell, weight * remaining[:, k], n_cells) for k in (0, 1)], axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = sums / total[:, None]
        freedom = len(cell) - np.count_nonzero(count)
        deviation = remaining - mean[cell]
        pooled = np.sqrt(weight @ deviation**2 / freedom) if freedom > 0 else np.full(2, np.nan)
        sigma = pooled * (np.sqrt(squares) / total)[:, None]
    return mean, count, sigma, pooled


def _root_mean(squares: np.ndarray) -> float:
    return float(np.sqrt(np.mean(squares))) if len(squares) else float("nan")
