"""A surface brought to another one on ground that did not change: robustly, with the covariance of what is moved.

[D] Where nothing changed, z₂(x) = z₁(x − t) + a + b·x, so that z₂ − z₁ = a − ∇z·t + b·x: linear in shift, height and
tilt. What is left on stable ground tells the noise, and how far neighbouring cells share it, so that the covariance of
the unknowns is that of as many independent cells as there are.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np
from scipy.ndimage import uniform_filter

from aerotri.conventions import InputError
from aerotri.rasters.grids import Grid
from aerotri.volume.change.noise import cells_of_one_noise, robust_sigma

Align = Literal["none", "height", "shift", "tilt"]
ALIGNS: tuple[Align, ...] = get_args(Align)
NAMES = {"none": (), "height": ("dZ",), "shift": ("dZ", "dX", "dY"), "tilt": ("dZ", "dX", "dY", "tilt_X", "tilt_Y")}
CUT = 3.0
"""Differences beyond so many robust σ do not take part."""
ROUNDS = 20
SMOOTH = 5
"""Cells a side of the squares whose means give slopes."""
LEAST_SPREAD = 0.05
"""Of a cell, by which the mean place of a square has to move from one cell to the next for a slope to be known."""
FEWEST = 100
"""Stable cells at least."""


@dataclass(frozen=True, eq=False)
class Alignment:
    """What the second surface was moved by.

    Parameters
    ----------
    names : of the unknowns, m and m/m. values : (u,). covariance : (u, u).
    middle : (2,) m, about which the surface is tilted. cells, used : stable ones, and those that took part.
    factor : noise on stable ground over the stated σ, NaN where none is stated.
    sharing : cells of one noise, 0 where too few tell.
    gain : (rows, columns, u) of x̂ = Σ gain·difference, 0 of cells that did not take part; None without an alignment.
    """

    names: tuple[str, ...] = ()
    values: np.ndarray = field(default_factory=lambda: np.zeros(0))
    covariance: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    middle: np.ndarray = field(default_factory=lambda: np.zeros(2))
    cells: int = 0
    used: int = 0
    factor: float = 1.0
    sharing: float = 1.0
    gain: np.ndarray | None = None

    def design(self, grid: Grid, z: np.ndarray) -> np.ndarray:
        """(rows, columns, u) partials of z₂ − z₁ by the unknowns; z of the second surface."""
        return design_of(self.names, grid, z, self.middle)


NO_ALIGNMENT = Alignment()


def design_of(names: tuple[str, ...], grid: Grid, z: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """(rows, columns, u) partials by the unknowns of these names."""
    x, y = np.meshgrid(grid.x(np.arange(grid.columns)) - middle[0], grid.y(np.arange(grid.rows)) - middle[1])
    slope_x, slope_y = slopes_of(grid, z)
    of = {"dZ": np.ones_like(z), "dX": -slope_x, "dY": -slope_y, "tilt_X": x, "tilt_Y": y}
    return np.stack([of[name] for name in names], axis=-1) if names else np.zeros((*z.shape, 0))


def slopes_of(grid: Grid, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(rows, columns) m/m along X and Y, of means of squares of cells; NaN where z is, or too few are around.

    [D] Beside holes and at the edge the mean of a square is not that of its middle. Its change from cell to cell is
    therefore set against those of the mean place of its cells: of a plane the slopes are right everywhere.
    """
    known = np.isfinite(z)
    if not known.any():
        return np.full(z.shape, np.nan), np.full(z.shape, np.nan)
    x, y = np.meshgrid(grid.cell_x * np.arange(z.shape[1]), -grid.cell_y * np.arange(z.shape[0]))
    means = (_means(values, known) for values in (z - float(np.median(z[known])), x, y))
    (z_down, z_along), (x_down, x_along), (y_down, y_along) = (np.gradient(mean) for mean in means)
    area = x_along * y_down - x_down * y_along
    told = known & (np.abs(area) > LEAST_SPREAD * grid.cell_x * grid.cell_y)
    share = 1.0 / np.where(told, area, np.nan)
    return share * (z_along * y_down - z_down * y_along), share * (z_down * x_along - z_along * x_down)


def _means(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Of squares of cells, of those that are known: noise in slopes would make every shift too small; NaN of none."""
    share = uniform_filter(known.astype(float), SMOOTH, mode="constant")
    total = uniform_filter(np.where(known, values, 0.0), SMOOTH, mode="constant")
    return np.where(share > 0.5 / SMOOTH**2, total / np.maximum(share, 0.5 / SMOOTH**2), np.nan)


def align(
    grid: Grid, z: np.ndarray, difference: np.ndarray, sigma: np.ndarray, stable: np.ndarray, how: Align
) -> Alignment:
    """Find what moves the second surface onto the first.

    Parameters
    ----------
    z : (rows, columns) m, the mean of both surfaces. difference : second − first, m.
    sigma : m, noise of the difference. stable : cells that did not change.

    Raises
    ------
    InputError
        When too few cells are known on stable ground, or it is one plane, which determines no shift.
    """
    names = NAMES[how]
    rows, columns = np.nonzero(stable)
    middle = np.array([grid.x(columns).mean(), grid.y(rows).mean()]) if len(rows) else np.zeros(2)
    design = design_of(names, grid, z, middle)
    known = stable & np.isfinite(difference) & np.isfinite(sigma) & np.isfinite(design).all(axis=-1)
    if known.sum() < FEWEST:
        raise InputError(
            f"{known.sum()} cells are known on stable ground", f"give an area with {FEWEST} cells at least"
        )
    a, d, s = design[known], difference[known], sigma[known]
    x, used = _robust(a / s[:, None], d / s)
    left = np.full(difference.shape, np.nan)
    left[known] = np.where(used, (d - a @ x) / s, np.nan)
    # the tails that were cut off belong to normal noise too
    factor = robust_sigma((d - a @ x) / s)
    sharing = cells_of_one_noise(left)
    scaled = a[used] / s[used, None]
    inverse = np.linalg.inv(scaled.T @ scaled) if names else np.zeros((0, 0))
    gain = np.zeros((*difference.shape, len(names)))
    taking_part = np.zeros(difference.shape, bool)
    taking_part[known] = used
    gain[taking_part] = (scaled / s[used, None]) @ inverse
    covariance = factor**2 * max(sharing, 1.0) * inverse
    return Alignment(names, x, covariance, middle, int(stable.sum()), int(used.sum()), factor, sharing, gain)


def _robust(a: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least squares without what lies beyond the cut, and which take part."""
    used = np.ones(len(d), bool)
    x = np.zeros(a.shape[1])
    for _ in range(ROUNDS):
        if a.shape[1]:
            size = np.linalg.norm(a[used], axis=0)
            # of level ground the slopes are 0, and with them the columns of a shift
            values = np.linalg.svd(a[used] / np.where(size > 0.0, size, 1.0), compute_uv=False)
            if not values[-1] > 1e-6:
                raise InputError(
                    "the stable ground is level or one plane and does not determine a shift in plan",
                    "give --align height",
                )
            x = np.linalg.lstsq(a[used], d[used], rcond=None)[0]
        left = d - a @ x
        centre = np.median(left[used]) if not a.shape[1] else 0.0
        now = np.abs(left - centre) <= CUT * max(robust_sigma(left[used]), 1e-12)
        if (now == used).all():
            break
        used = now
    return x, used
