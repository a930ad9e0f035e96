"""DEMs as a matcher makes them of photographs with image errors, by the forward deformation."""

from __future__ import annotations

import numpy as np

from aerotri.deformation.photo_errors import seams_mm
from aerotri.deformation.stereo_model import deform_points, project
from aerotri.rasters.grids import Grid, RasterWriter

SLOPE = np.array([0.15, -0.3])


def middle_of(model):
    return model.true.centre.mean(axis=0)[:2]


def square_grid(middle, n, cell):
    return Grid(n, n, float(middle[0]) - n * cell / 2.0, float(middle[1]) + n * cell / 2.0, cell, cell)


def cells(grid):
    x, y = np.meshgrid(grid.x(np.arange(grid.columns)), grid.y(np.arange(grid.rows)))
    return np.column_stack([x.ravel(), y.ravel()])


class Terrain:
    """A tilted plane, or with `waves` m of hills on it."""

    def __init__(self, middle, height, waves=0.0):
        self.middle, self.height, self.waves = np.asarray(middle), height, waves

    def __call__(self, xy):
        z = self.height + (xy - self.middle) @ SLOPE
        return z + self.waves * np.sin(xy[:, 0] / 40.0) * np.cos(xy[:, 1] / 55.0)


def wrong_heights(model, terrain, xy_wrong):
    """Heights a matcher finds at plan positions, the true points, and whether it can be made of this.

    The point of the terrain is sought that the wrong model shows at a position. What the image errors carry over a seam
    the composed image does not show, and a y-parallax over a seam is not in the DEM: such cells prove nothing.
    """
    xy = xy_wrong.copy()
    for _ in range(6):
        d = deform_points(model, np.column_stack([xy, terrain(xy)])).d
        xy = np.where(np.isfinite(d[:, :2]), xy_wrong - np.nan_to_num(d[:, :2]), xy)
    true = np.column_stack([xy, terrain(xy)])
    d = deform_points(model, true).d
    z = true[:, 2] + d[:, 2]
    good = np.isfinite(z) & (np.abs(xy + d[:, :2] - xy_wrong).max(axis=1) < 1e-7)
    wrong = np.column_stack([xy_wrong, z])
    for k, errors in enumerate(model.errors):
        ideal, shown = project(model.true, k, true), project(model.used, k, wrong)
        for axis, seams in enumerate(seams_mm(errors.camera)):
            good &= np.searchsorted(seams, ideal[:, axis]) == np.searchsorted(seams, shown[:, axis])
    return z, true, good


def beside(mask, reach=1):
    """The mask with the cells next to it."""
    out = mask.copy()
    for rows in range(-reach, reach + 1):
        for columns in range(-reach, reach + 1):
            out |= np.roll(mask, (rows, columns), axis=(0, 1))
    return out


def write_dem(path, grid, z, dtype=np.float32, **options):
    with RasterWriter(path, grid, dtype, **options) as writer:
        writer.write(0, 0, z.astype(dtype))
