"""Linear functionals of heights: how a volume, a mean height or a profile depends on pickets, all three coordinates.

[D] Over a TIN V = Σ_t ∫_{t∩B} Σ_k λ_k·z_k, so ∂V/∂Z_k = Σ_t ∫ λ_k. Moving a corner along the plane of its triangle does
not change that plane, so a move in plan is a change of height by −slope: ∂V/∂X_k = −Σ_t slope_x(t)·∫ λ_k, Y alike. For
a surface of cells the same holds with the slope of the surface at the cell.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from aerotri.rasters.grids import Grid
from aerotri.terrain.tin import corners_in_plan
from aerotri.volume.bases import Base, Nodes, Surface, nodes_of
from aerotri.volume.boundary import Boundary
from aerotri.volume.bridges import Bridges, sigma_of_bridges
from aerotri.volume.counted import Counted
from aerotri.volume.drawn import DRAWN_MARGIN, drawn_cells, drawn_in_plan, slope_of_nodes, slopes_of_cells
from aerotri.volume.sums import cells_within, windows
from aerotri.volume.triangles import Pieces, barycentric, cut_to

NEXT_TO = 1e-9
"""Weight of cells outside a boundary that moves, which count by their motion alone."""
MOST_CELLS = 1_000_000
"""Cells that are carried one by one; neighbours are put together where there are more."""


@dataclass(frozen=True, eq=False)
class Functional:
    """V = constant + Σ gradient·ΔP over places of a surface.

    Parameters
    ----------
    xyz : (k, 3) m. gradient : (k, 3) ∂V/∂(X, Y, Z).
    noise_share : (k,) Σw²/(Σw)² of the heights that a place stands for, 1 where it is one.
    noise : (k,) Σw²·σ² of their own noise, where its σ is known; None where not.
    bridged : (n,) m³, of every bridged patch what its error makes; None where nothing is bridged.
    """

    xyz: np.ndarray
    gradient: np.ndarray
    noise_share: np.ndarray
    noise: np.ndarray | None = None
    bridged: np.ndarray | None = None

    def take(self, rows: np.ndarray) -> Functional:
        """At some of the places."""
        noise = None if self.noise is None else self.noise[rows]
        return Functional(self.xyz[rows], self.gradient[rows], self.noise_share[rows], noise, self.bridged)


def triangulated(xyz: np.ndarray) -> np.ndarray:
    """(t, 3) corners of the Delaunay triangles over pickets (k, 3)."""
    return corners_in_plan(xyz)


def triangle_slopes(xyz: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(t, 2) slopes of the planes of triangles along X and Y."""
    a, b = xyz[triangles[:, 1]] - xyz[triangles[:, 0]], xyz[triangles[:, 2]] - xyz[triangles[:, 0]]
    det = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        slopes = np.column_stack(
            [(a[:, 2] * b[:, 1] - b[:, 2] * a[:, 1]) / det, (b[:, 2] * a[:, 0] - a[:, 2] * b[:, 0]) / det]
        )
    return np.where(np.isfinite(slopes), slopes, 0.0)


def tin_volume(
    xyz: np.ndarray, triangles: np.ndarray, boundary: Boundary, base: Base | None = None, drawn: bool = False,
    pieces: Pieces | None = None,
) -> tuple[float, Functional]:  # fmt: skip
    """Volume under a TIN over the height 0 (less that of the base's own nodes), and its gradient.

    Parameters
    ----------
    xyz : (k, 3) m. triangles : (t, 3).
    base : matters where it hangs on the surface itself, as a spline through the boundary, and where `drawn`.
    drawn : the boundary was drawn on the surface and moves with it; needs the base.
    pieces : the parts of triangles that count; None: all inside the boundary.
    """
    pieces = cut_to(boundary.polygon, xyz[triangles][:, :, :2]) if pieces is None else pieces
    value, gradient = _of_weights(xyz, triangles[pieces.triangle], pieces.area[:, None] * pieces.weights)
    nodes, moved = nodes_of(base), np.zeros_like(gradient)
    if nodes is not None:
        of_base, base_weight = barycentric_weights(xyz, triangles, nodes.xy, -nodes.integral)
        more, moved = _of_weights(xyz, triangles[of_base], base_weight)
        value, gradient = value + more, gradient + moved
    if drawn and base is not None:
        gradient[:, :2] = drawn_in_plan(xyz, triangles, pieces, base)
        if nodes is not None:
            gradient[:, :2] -= moved[:, 2:] * slope_of_nodes(base)
    return value, Functional(xyz, gradient, np.ones(len(xyz)))


def tin_heights(xyz: np.ndarray, triangles: np.ndarray, at: np.ndarray, weight: np.ndarray) -> tuple[float, Functional]:
    """Σ weight·z at places (n, 2) on a TIN: a mean height, a profile, the area of a section; and its gradient."""
    own, weights = barycentric_weights(xyz, triangles, at, weight)
    value, gradient = _of_weights(xyz, triangles[own], weights)
    return value, Functional(xyz, gradient, np.ones(len(xyz)))


def barycentric_weights(
    xyz: np.ndarray, triangles: np.ndarray, at: np.ndarray, weight: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (n,) that hold places, and weight times their barycentric coordinates (n, 3); places outside are left
    out."""
    corners = xyz[triangles][:, :, :2]
    tree = shapely.STRtree(np.asarray(shapely.polygons(np.concatenate([corners, corners[:, :1]], axis=1))))
    place, found = tree.query(shapely.points(at), predicate="intersects")
    place, first = np.unique(place, return_index=True)
    found = found[first]
    return found, weight[place][:, None] * barycentric(corners[found], at[place])


def _of_weights(xyz: np.ndarray, corners: np.ndarray, weight: np.ndarray) -> tuple[float, np.ndarray]:
    """Value and gradient of Σ weight·z over corners (n, 3) of triangles."""
    slopes = triangle_slopes(xyz, corners)
    gradient = np.zeros((len(xyz), 3))
    for k in range(3):
        np.add.at(gradient[:, 2], corners[:, k], weight[:, k])
        for axis in range(2):
            np.add.at(gradient[:, axis], corners[:, k], -slopes[:, axis] * weight[:, k])
    return float(np.sum(weight * xyz[corners, 2])), gradient


def cell_volume(
    surface: Surface,
    boundary: Boundary,
    base: Base | None = None,
    sigma: Surface | None = None,
    drawn: bool = False,
    counted: Counted | None = None,
    bridges: Bridges | None = None,
) -> Functional:
    """The gradient of a volume by the cells of a surface, every cell a picket; many cells are put together.

    Cells put together keep the sum of their weights at their mean place, and the noise of the single ones.

    Parameters
    ----------
    sigma : m, σ of the noise of every cell, on the same cells; None where not known.
    drawn : as of `tin_volume`. counted : which cells count; None: all that have a height.
    bridges : cells bridged below objects.
    """
    rows, columns = cells_within(surface.grid, boundary)[2:]
    factor = max(1, int(np.ceil(np.sqrt(rows * columns / MOST_CELLS))))
    size = max(factor, 1024 // factor * factor)
    extra = _node_cells(surface.grid, nodes_of(base))
    cells = _Cells(surface, boundary, extra, factor, sigma, base if drawn else None, counted, bridges)
    parts = [_window_cells(cells, window) for window in windows(surface.grid, boundary, size)]
    xyz, gradient, share, noise = (np.concatenate([part[k] for part in parts]) for k in range(4))
    bridged = None if bridges is None else np.sum([part[4] for part in parts], axis=0)
    return Functional(xyz, gradient, share, None if sigma is None else noise, bridged)


@dataclass(frozen=True, eq=False)
class _Cells:
    """What the cells of a volume are taken from; `factor` × `factor` of them count together."""

    surface: Surface
    boundary: Boundary
    extra: dict[tuple[int, int], float]
    factor: int
    sigma: Surface | None
    moving: Base | None
    counted: Counted | None
    bridges: Bridges | None

    def heights(self, window: tuple[int, int, int, int], margin: int) -> tuple[Grid, np.ndarray, np.ndarray]:
        """A window and some cells around it, heights with NaN where not known, and m² of every cell that count."""
        row, column, rows, columns = window
        place = (row - margin, column - margin, rows + 2 * margin, columns + 2 * margin)
        grid = self.surface.grid.window(*place)
        z = self.surface.read(*place).astype(float)
        weight = self.boundary.coverage(grid) * grid.cell_x * grid.cell_y
        if self.counted is not None:
            noise = None if self.sigma is None else self.sigma.read(*place).astype(float)
            d = self.counted.heights_of_cells(z, grid)
            spread = np.hypot(self.counted.spread_of_cells(noise), sigma_of_bridges(self.bridges, place))
            weight *= self.counted.share(d, spread)
        weight[~np.isfinite(z)] = 0.0
        return grid, z, weight


def _window_cells(
    cells: _Cells, window: tuple[int, int, int, int]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Places, gradient, noise share and noise of the cells of a window; errors of every bridged patch."""
    row, column, rows, columns = window
    margin = 0 if cells.moving is None else DRAWN_MARGIN
    around, z_around, weight_around = cells.heights(window, margin)
    z = cells.surface.read(row - 1, column - 1, rows + 2, columns + 2).astype(float)
    grid = cells.surface.grid.window(row, column, rows, columns)
    slope_x, slope_y = slopes_of_cells(z, grid)
    z = z[1:-1, 1:-1]
    weight = weight_around[margin : margin + rows, margin : margin + columns]
    of_nodes = np.zeros_like(weight)
    for (i, j), value in cells.extra.items():
        if row <= i < row + rows and column <= j < column + columns:
            of_nodes[i - row, j - column] += value
    weight = weight + of_nodes
    weight[~np.isfinite(z)] = 0.0
    x, y = np.meshgrid(grid.x(np.arange(columns)), grid.y(np.arange(rows)))
    in_plan = (-slope_x * weight, -slope_y * weight)
    size = np.abs(weight)
    if cells.moving is not None:
        slope = slope_of_nodes(cells.moving)
        by_x, by_y = drawn_cells(around, z_around, weight_around, cells.moving)
        in_plan = (by_x - of_nodes * slope[0], by_y - of_nodes * slope[1])
        size = size + NEXT_TO * np.hypot(*in_plan) * np.isfinite(z)
    z, factor = np.where(np.isfinite(z), z, 0.0), cells.factor
    total, squares = together(size, factor), together(weight**2, factor)
    used = total > 0.0
    places = np.stack([together(size * v, factor)[used] / total[used] for v in (x, y, z)], axis=-1)
    sums = [together(v, factor)[used] for v in (*in_plan, weight)]
    gradient = np.stack(sums, axis=-1)
    height = gradient[:, 2]
    share = np.divide(squares[used], height**2, out=np.ones(len(height)), where=height**2 > 0.0)
    sigma = cells.sigma
    noise = np.zeros(len(share)) if sigma is None else together((weight * _noise(sigma, window)) ** 2, factor)[used]
    bridged = np.zeros(0) if cells.bridges is None else cells.bridges.errors(window, weight)
    return places, gradient, share, noise, bridged


def _noise(sigma: Surface, window: tuple[int, int, int, int]) -> np.ndarray:
    """(rows, columns) m; that of the other cells where one is not known."""
    values = sigma.read(*window).astype(float)
    known = np.isfinite(values)
    return np.where(known, values, np.median(values[known]) if known.any() else 0.0)


def together(values: np.ndarray, factor: int) -> np.ndarray:
    """Sums over factor × factor cells of (rows, columns); those at the lower and right edges may be of fewer."""
    if factor == 1:
        return values
    rows, columns = (-(-n // factor) * factor for n in values.shape)
    padded = np.zeros((rows, columns))
    padded[: values.shape[0], : values.shape[1]] = values
    return padded.reshape(rows // factor, factor, columns // factor, factor).sum(axis=(1, 3))


def _node_cells(grid: Grid, nodes: Nodes | None) -> dict[tuple[int, int], float]:
    """Weights that the nodes of a base give to single cells, negative: their heights are bilinear in them."""
    out: dict[tuple[int, int], float] = {}
    if nodes is None:
        return out
    row, column = grid.row(nodes.xy[:, 1]), grid.column(nodes.xy[:, 0])
    i, j = np.floor(row).astype(int), np.floor(column).astype(int)
    t, s = row - i, column - j
    for di, dj, share in ((0, 0, (1 - t) * (1 - s)), (0, 1, (1 - t) * s), (1, 0, t * (1 - s)), (1, 1, t * s)):
        for a, b, value in zip(i + di, j + dj, -nodes.integral * share, strict=True):
            out[int(a), int(b)] = out.get((int(a), int(b)), 0.0) + float(value)
    return out
