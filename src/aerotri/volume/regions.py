"""The part of a boundary that a volume is of: its area, and the integral over it of a base that follows from heights.

Where the surface has holes, the volume is of what is known, and so is the base below it; a cut is of what lies above
the base.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri.rasters.grids import Grid
from aerotri.volume.bases import PANELS, Base, Nodes, PlaneBase, SplineBase, Surface, integral_of_spline
from aerotri.volume.boundary import Boundary
from aerotri.volume.bridges import sigma_of_bridges
from aerotri.volume.cell_noise import CellNoise
from aerotri.volume.counted import PLACES, Counted, near_the_line
from aerotri.volume.rectified import NO_LINE, Line, expected_above, line_of_shared
from aerotri.volume.sums import windows
from aerotri.volume.triangles import Pieces

BLOCK, BLOCK_LENGTHS = 16, 6.0
"""Cells a side, and noise lengths, of the squares within which relief is told from noise; chosen [C]: several cells
that have a noise of their own, and not much more ground than that."""


@dataclass(frozen=True, eq=False)
class Region:
    """What counts of a boundary.

    Parameters
    ----------
    places : (q, 2) m. weight : (q,) m², what they stand for. sign : as of `Counted`.
    line : what moving the line between cut and fill does; nothing where both count.
    """

    places: np.ndarray
    weight: np.ndarray
    sign: int = 0
    line: Line = NO_LINE

    @property
    def area(self) -> float:
        """m²."""
        return float(self.weight.sum())


def base_over(base: Base | None, region: Region | None) -> Base | None:
    """A base whose integral is that over a region."""
    if region is None or base is None:
        return base
    if isinstance(base, SplineBase):
        return replace(base, integral=integral_of_spline(base, region.places, region.weight))
    if not isinstance(base, PlaneBase) or base.nodes is None:
        return base
    xy = base.nodes.xy
    if len(xy) == 1:
        return replace(base, nodes=Nodes(xy, np.array([region.area])))
    middle = xy.mean(axis=0)
    design = np.column_stack([np.ones(len(xy)), xy - middle])
    moments = np.array([region.area, *(region.weight @ (region.places - middle))])
    return replace(base, nodes=Nodes(xy, moments @ np.linalg.pinv(design)))


def region_of_pieces(
    boundary: Boundary, xyz: np.ndarray, triangles: np.ndarray, pieces: Pieces, of: tuple[Counted, Pieces]
) -> Region:
    """Of parts of triangles that count; of : what counts, and of which parts, all those inside the boundary."""
    counted, all_pieces = of
    lattice = _Lattice(boundary)
    lattice.add(np.einsum("nk,nkc->nc", pieces.weights, xyz[triangles[pieces.triangle]][:, :, :2]), pieces.area)
    line = NO_LINE
    if counted.sign and counted.spread > 0.0:
        corners = xyz[triangles[all_pieces.triangle]]
        near = near_the_line(counted, corners, counted.spread)
        d = counted.at(np.broadcast_to(PLACES, (int(near.sum()), *PLACES.shape)), corners[near])
        line = line_of_shared(d.ravel(), np.repeat(all_pieces.area[near] / len(PLACES), len(PLACES)), counted.spread)
    return lattice.region(counted.sign, line)


def region_of_cells(surface: Surface, boundary: Boundary, counted: Counted, noise: CellNoise, within: float) -> Region:
    """Of the cells of a surface, read once more; within : m, σ of the ground at a place between their centres."""
    lattice, line = _Lattice(boundary), NO_LINE
    cell = surface.grid.cell_x * surface.grid.cell_y
    block = max(BLOCK, int(np.ceil(BLOCK_LENGTHS * noise.length_m / np.sqrt(cell))))
    for row, column, rows, columns in windows(surface.grid, boundary):
        grid = surface.grid.window(row, column, rows, columns)
        d = counted.heights_of_cells(surface.read(row, column, rows, columns).astype(float), grid)
        area = boundary.coverage(grid) * cell * np.isfinite(d)
        sigma = None if noise.sigma is None else noise.sigma.read(row, column, rows, columns).astype(float)
        sigma = None if sigma is None else np.sqrt(sigma**2 + counted.noise)
        bridge = sigma_of_bridges(noise.bridges, (row, column, rows, columns))
        weight = area * counted.share(d, np.hypot(counted.spread_of_cells(sigma), bridge))
        lattice.add(*_placed(grid, weight))
        if counted.sign:
            line += line_of_shared(d.ravel(), area.ravel(), np.hypot(counted.spread, bridge).ravel())
            line += Line(between=line_of_shared(d.ravel(), area.ravel(), within).moved)
            line += NO_LINE if sigma is None else Line(noise=_added_by_noise(d, area, sigma, block))
    return lattice.region(counted.sign, line)


def _added_by_noise(d: np.ndarray, area: np.ndarray, sigma: np.ndarray, block: int) -> float:
    """m³ that noise adds to the cut, and as much to the fill.

    [D] In a square heights over the base scatter by v = v₀ + s², v₀ that of the ground: Σ a·(E⁺(v) − E⁺(v₀)), E⁺ the
    expectation of what is above of a normal height.
    """
    known = (area > 0.0) & np.isfinite(sigma)
    total, mean, square, own = (
        _together(np.where(known, v, 0.0), block) for v in (area, area * d, area * d**2, area * sigma**2)
    )
    used = total > 0.0
    a, mean, square, own = total[used], *(v[used] / total[used] for v in (mean, square, own))
    spread = np.maximum(square - mean**2, 0.0)
    ground = np.maximum(spread - own, 0.0)
    more = expected_above(mean, np.sqrt(np.maximum(spread, own))) - expected_above(mean, np.sqrt(ground))
    return float(a @ np.maximum(more, 0.0))


def _together(values: np.ndarray, factor: int) -> np.ndarray:
    """Sums over factor × factor cells of (rows, columns)."""
    rows, columns = (np.arange(0, n, factor) for n in values.shape)
    return np.add.reduceat(np.add.reduceat(values, rows, axis=0), columns, axis=1)


def _placed(grid: Grid, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places (n, 2) of cells with a weight, and their weights."""
    row, column = np.nonzero(weight > 0.0)
    return np.column_stack([grid.x(column), grid.y(row)]), weight[row, column]


class _Lattice:
    """Weights summed in the cells of a lattice over a boundary, at their mean places."""

    def __init__(self, boundary: Boundary):
        left, bottom, right, top = boundary.polygon.bounds
        self._cell = max(right - left, top - bottom) / PANELS
        self._corner = np.array([left, bottom])
        self._sums = np.zeros((PANELS * PANELS, 3))

    def add(self, places: np.ndarray, weight: np.ndarray) -> None:
        at = np.clip(((places - self._corner) / self._cell).astype(np.int64), 0, PANELS - 1)
        number = at[:, 0] * PANELS + at[:, 1]
        for k, values in enumerate((weight, weight * places[:, 0], weight * places[:, 1])):
            self._sums[:, k] += np.bincount(number, values, len(self._sums))

    def region(self, sign: int, line: Line) -> Region:
        used = self._sums[:, 0] > 0.0
        weight = self._sums[used, 0]
        return Region(self._sums[used, 1:] / weight[:, None], weight, sign, line)
