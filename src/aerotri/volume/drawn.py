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
from aerotri.volume.bases import Base, PlaneBase, SplineBase, Surface, nodes_of
from aerotri.volume.boundary import Boundary
from aerotri.volume.triangles import cut_to

STEP = 0.1
"""m over which the slope of a base is taken."""


def drawn_in_plan(xyz: np.ndarray, triangles: np.ndarray, boundary: Boundary, base: Base) -> np.ndarray:
    """(k, 2) m², ∂V/∂(X, Y) of the pickets (k, 3) of a TIN whose boundary moves with them, the nodes of its base apart.

    Nodes have s·∫φ_k, see `slope_of_nodes`.
    """
    pieces = cut_to(boundary.polygon, xyz[triangles][:, :, :2])
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


def drawn_cells(
    surface: Surface, boundary: Boundary, base: Base, window: tuple[int, int, int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """∂V/∂X and ∂V/∂Y of cells of a window (row, column, rows, columns), m², by differences of neighbours."""
    row, column, rows, columns = window
    around = surface.grid.window(row - 1, column - 1, rows + 2, columns + 2)
    z = surface.read(row - 1, column - 1, rows + 2, columns + 2).astype(float)
    below = base.on_grid(around)
    weight = boundary.coverage(around) * np.isfinite(z) * around.cell_x * around.cell_y
    held = _known(z - below) * weight
    by_x = (held[1:-1, :-2] - held[1:-1, 2:]) / (2.0 * around.cell_x)
    by_y = (held[2:, 1:-1] - held[:-2, 1:-1]) / (2.0 * around.cell_y)
    slope_x, slope_y = _grid_slopes(below, around) if nodes_of(base) is None else slope_of_nodes(base)
    inner = weight[1:-1, 1:-1]
    return by_x - inner * slope_x, by_y - inner * slope_y


def slope_of_nodes(base: Base | None) -> np.ndarray:
    """(2,) mean slope of a base that follows from its nodes; 0 of another one."""
    if isinstance(base, PlaneBase):
        return np.array([base.slope_x, base.slope_y])
    if not isinstance(base, SplineBase):
        return np.zeros(2)
    design = np.column_stack([np.ones(len(base.xy)), base.xy - base.xy.mean(axis=0)])
    return np.linalg.lstsq(design, base.z, rcond=None)[0][1:]


def _grid_slopes(z: np.ndarray, grid: Grid) -> tuple[np.ndarray, np.ndarray]:
    """Slopes along X and Y of the inner cells."""
    along = (z[1:-1, 2:] - z[1:-1, :-2]) / (2.0 * grid.cell_x)
    return _known(along), _known((z[:-2, 1:-1] - z[2:, 1:-1]) / (2.0 * grid.cell_y))


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
