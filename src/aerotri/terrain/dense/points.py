"""The cells of a dense surface as points: colour, normal and the covariance of each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from aerotri.rasters.grids import Grid
from aerotri.terrain.dense.colours import Colours

if TYPE_CHECKING:
    from aerotri.terrain.dense.bare_ground import BareGround
    from aerotri.terrain.dense.measure import DenseOutcome


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Cells of a surface.

    Parameters
    ----------
    xyz : (n, 3) m. covariance : (n, 6) m², XX, YY, ZZ, XY, XZ, YZ. matching : (n,) m, σ of Z of matching alone.
    photographs : (n,) how many measured it. normal : (n, 3) of length 1, upwards.
    colour : (n, 3) uint16 red, green, blue. ground : (n,) bool, whether each is ground.
    """

    xyz: np.ndarray
    covariance: np.ndarray
    matching: np.ndarray
    photographs: np.ndarray
    normal: np.ndarray
    colour: np.ndarray
    ground: np.ndarray


def surface_points(outcome: DenseOutcome, ground: BareGround | None = None) -> Iterator[SurfacePoints]:
    """The points of every tile; which are ground is known where it was filtered.

    A cell stands where it stands: what matching does to it along the ray is an error of its height there. In X and Y
    it has the σ of the adjustment alone [D].

    Raises
    ------
    InputError
        When a photograph cannot be read.
    """
    o = outcome
    colours = Colours(o.photographs, o.paths, o.grid.cell_x)
    for window, tile in o.files.read_all(list(o.windows)):
        grid = o.grid.window(window.row, window.column, window.rows, window.columns)
        row, column = np.nonzero(np.isfinite(tile.z))
        if not len(row):
            continue
        xyz = np.column_stack([grid.x(column), grid.y(row), tile.z[row, column]])
        matching = tile.sigma[row, column].astype(float)
        covariance = o.shared.covariances(grid)[row, column]
        covariance[:, 2] += matching**2
        yield SurfacePoints(
            xyz, covariance, matching, tile.count[row, column], normals(tile.z, grid)[row, column],
            colours.of(xyz, tile.shown_by[row, column]),
            np.zeros(len(row), bool) if ground is None else ground.measured(window)[row, column],
        )  # fmt: skip


def normals(z: np.ndarray, grid: Grid) -> np.ndarray:
    """(rows, columns, 3) of length 1, upwards, of heights (rows, columns) m; NaN where z is.

    The slope along an axis is the mean of those to the neighbours on either side, or to the one that is known; 0 where
    none is.
    """
    by_x, by_y = _slope(z, 1) / grid.cell_x, -_slope(z, 0) / grid.cell_y
    normal = np.stack([-by_x, -by_y, np.ones(z.shape)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    normal[~np.isfinite(z)] = np.nan
    return normal


def _slope(z: np.ndarray, axis: int) -> np.ndarray:
    """Change of height from cell to cell along an axis."""
    step = np.diff(z, axis=axis)
    none = np.full_like(np.take(z, [0], axis=axis), np.nan)
    before, after = np.concatenate([none, step], axis=axis), np.concatenate([step, none], axis=axis)
    has = np.isfinite(before).astype(int) + np.isfinite(after)
    return (np.nan_to_num(before) + np.nan_to_num(after)) / np.maximum(has, 1)
