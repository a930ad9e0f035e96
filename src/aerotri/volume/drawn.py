"""A boundary that was drawn on the surface: when points of the surface move in plan, it moves with them.

[D] Points move by δ(x), linear over every triangle. With h = z − base the boundary's own motion adds
∮ h n·δ ds = ∫ (∇h·δ + h div δ) to what a fixed one sees, ∫ (δZ − ∇z·δ), so that over a base that stays in space
dV = ∫ (δZ − ∇base·δ + h div δ). A base that follows from nodes of the surface, base = Σ φ_k z_k, moves with
them, in plan by Σ φ_k δ_k: then dV = ∫ (δZ − Σ φ_k δZ_k − s·(δ − Σ φ_k δ_k) + h div δ), s the mean slope of the base,
and a shift, a turn or a small tilt of the whole block has no part in V.
"""

from __future__ import annotations

import numpy as np

from aerotri.rasters.grids import Grid
from aerotri.volume.bases import Base, PlaneBase, SplineBase, nodes_of
from aerotri.volume.triangles import Pieces

STEP = 0.1
"""m over which the slope of a base is taken."""
DRAWN_MARGIN = 2
"""Cells around a window that the motion of its own depends on."""


def drawn_in_plan(xyz: np.ndarray, triangles: np.ndarray, pieces: Pieces, base: Base) -> np.ndarray:
    """(k, 2) m², ∂V/∂(X, Y) of the pickets (k, 3) of a TIN whose boundary moves with them, the nodes of its base apart.

    Nodes have s·∫φ_k, see `slope_of_nodes`. pieces : the parts of its triangles that count.
    """
    corners = triangles[pieces.triangle]
    at = np.einsum("nk,nkc->nc", pieces.weights, xyz[corners])
    h = _known(at[:, 2] - base.heights(at[:, 0], at[:, 1]))
    div = (pieces.area * h)[:, None, None] * _gradients(xyz[corners][:, :, :2])
    slope = _slopes(base, at)
    out = np.zeros((len(xyz), 2))
    for k in range(3):
        share = (pieces.area * pieces.weights[:, k])[:, None]
        np.add.at(out, corners[:, k], div[:, k] - share * slope)
    return out


def drawn_cells(around: Grid, z: np.ndarray, weight: np.ndarray, base: Base) -> tuple[np.ndarray, np.ndarray]:
    """∂V/∂X and ∂V/∂Y of cells, m², by differences of neighbours; beside a hole by those on one side of it.

    A cell moves by δ, and h·div δ takes the differences of δ that `slopes_of_cells` takes of heights: so a shift of
    all cells cancels whatever holes there are.

    Parameters
    ----------
    around : the cells and `DRAWN_MARGIN` around them. z : m, NaN where not known. weight : m² that count.
    """
    below = base.on_grid(around)
    held, known, m = _known(z - below) * weight, np.isfinite(z), DRAWN_MARGIN
    by_x = _by_motion(held, known, around.cell_x)[m:-m, m:-m]
    by_y = -_by_motion(held.T, known.T, around.cell_y).T[m:-m, m:-m]
    inner = weight[m:-m, m:-m]
    if nodes_of(base) is None:
        slope_x, slope_y = (v[m - 1 : 1 - m, m - 1 : 1 - m] for v in slopes_of_cells(below, around))
    else:
        slope_x, slope_y = slope_of_nodes(base)
    return by_x - inner * slope_x, by_y - inner * slope_y


def slopes_of_cells(z: np.ndarray, grid: Grid) -> tuple[np.ndarray, np.ndarray]:
    """Slopes along X and Y of the inner cells of (rows, columns) m; of cells beside a hole by their other neighbour."""
    known, filled = np.isfinite(z), _known(z)
    along, across = _differences(filled, known) / grid.cell_x, _differences(filled.T, known.T).T / grid.cell_y
    return along[1:-1, 1:-1], -across[1:-1, 1:-1]


def _differences(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Differences along the rows of (rows, columns), for one step."""
    before, own, after = (c * v for c, v in zip(_stencil(known), _shifted(values), strict=True))
    return before + own + after


def _by_motion(held: np.ndarray, known: np.ndarray, step: float) -> np.ndarray:
    """∂/∂δ of Σ held·∂δ, differences along the rows: every cell gives its weight to those its difference is of."""
    before, own, after = (c * held / step for c in _stencil(known))
    out = own
    out[:, :-1] += before[:, 1:]
    out[:, 1:] += after[:, :-1]
    return out


def _stencil(known: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Factors of the cell before, of the cell itself and of that after it in the difference of every cell of a row."""
    before, _, after = _shifted(known)
    both, none = before & after, ~(before | after)
    one = known & ~both & ~none
    factor = np.where(known & both, 0.5, one.astype(float))
    return -factor * before, one * (before.astype(float) - after.astype(float)), factor * after


def _shifted(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of the cell before, the cell, the cell after in every row; 0 beyond the edge."""
    before, after = np.zeros_like(values), np.zeros_like(values)
    before[:, 1:], after[:, :-1] = values[:, :-1], values[:, 1:]
    return before, values, after


def slope_of_nodes(base: Base | None) -> np.ndarray:
    """(2,) mean slope of a base that follows from its nodes; 0 of another one."""
    if isinstance(base, PlaneBase):
        return np.array([base.slope_x, base.slope_y])
    if not isinstance(base, SplineBase):
        return np.zeros(2)
    design = np.column_stack([np.ones(len(base.xy)), base.xy - base.xy.mean(axis=0)])
    return np.linalg.lstsq(design, base.z, rcond=None)[0][1:]


def _slopes(base: Base, at: np.ndarray) -> np.ndarray:
    """(n, 2) slopes of a base that stays in space; the mean one of a base that moves with the surface."""
    if nodes_of(base) is not None:
        return np.broadcast_to(slope_of_nodes(base), (len(at), 2))
    x, y = at[:, 0], at[:, 1]
    along = base.heights(x + STEP, y) - base.heights(x - STEP, y)
    across = base.heights(x, y + STEP) - base.heights(x, y - STEP)
    return _known(np.column_stack([along, across]) / (2.0 * STEP))


def _gradients(corners: np.ndarray) -> np.ndarray:
    """(n, 3, 2) gradients of the barycentric coordinates of triangles (n, 3, 2), 1/m."""
    along = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    det = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    normal = np.stack([-along[..., 1], along[..., 0]], axis=-1)
    return normal / det[:, None, None]


def _known(values: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(values), values, 0.0)
