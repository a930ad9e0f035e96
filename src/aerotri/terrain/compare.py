"""A surface against a control surface: both interpolated to the same places in the same way, then their differences.

The method of Tran (2007): two surfaces become two rasters by one algorithm, Δ = test − control cell by cell,
RMSE = √(mean Δ²). Rasters are sampled at the centres of the cells, points through their triangles, both linearly; or
both by cubic splines. Two rasters with the same cells are compared cell by cell, and nothing is interpolated: the mean
of neighbours would have less noise than the cells. RMSE counts every cell; median, NMAD = 1.4826·median|Δ − median| and
LE90, the 90 % quantile of |Δ|, are those of a distribution with gross errors [L: Höhle & Höhle 2009].
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.interpolate import RBFInterpolator
from scipy.ndimage import map_coordinates

from aerotri.conventions import SIGMA_PER_MAD, InputError, counted
from aerotri.memory import refuse_beyond_memory
from aerotri.rasters.grids import Grid, RasterReader
from aerotri.rasters.held import HeldRaster
from aerotri.terrain.settings import ALIGNMENT, INTERPOLATION
from aerotri.terrain.surface import grid_over
from aerotri.terrain.tin import Tin, triangulate

LARGEST_SIDE = 8.0
"""Sides of triangles, in typical distances of the points, that still are surface; chosen [C]: less tears holes into
uneven points, more bridges lakes and woods."""
SPLINE_NEIGHBOURS = 24
"""Points around a place that its thin-plate spline goes through; chosen [C]: fewer show where the neighbours change,
more take longer and add little."""
ROUNDS, SETTLED_M = 15, 1e-4
"""Most rounds of an alignment, and the change, m, at which it ends; chosen [C]: 0.1 mm is below every height compared,
and the rounds stop one that swings."""
CUT = 3.0
"""Differences beyond so many SIGMA_PER_MAD do not take part in an alignment: the usual 3σ of gross errors."""
MOST_ALIGNED = 200_000
"""Places that an alignment uses at most, evenly thinned; chosen [C]: three or six unknowns gain nothing from more."""
FEWEST = 20
"""Points of a surface and places in common at least; chosen [C]: medians of fewer are chance."""
PART_CELLS = 16_000_000
"""Cells of the finer surface that are held at a time; chosen [C]: 128 MB as 64 bit numbers."""
AXES = np.eye(2)
"""Unit steps along X and Y, for slopes by differences."""
MOST_CELLS = 10_000
"""A side of the grid of differences has at most so many, however fine the surfaces are."""
SAME_PLACE = 2e-3
"""Of a cell, by which cells of two rasters may lie apart and still be the same; chosen [C]: coordinates in the head of
a file are rounded to millimetres."""
BYTES_OF_CELL = 64
"""Of the grid of differences: places, heights of both, and what the statistics sort."""


class Heights(Protocol):
    """A surface that can be asked for its heights (n,) m at places (n, 2); NaN where it has none."""

    def at(self, xy: np.ndarray, method: str) -> np.ndarray: ...


@dataclass(frozen=True, eq=False)
class RasterHeights:
    """Heights (rows, columns) m on a grid."""

    grid: Grid
    z: np.ndarray

    def at(self, xy: np.ndarray, method: str) -> np.ndarray:
        """Bilinear, or by cubic spline with holes filled in first; NaN where one of the four cells around is."""
        place = np.array([self.grid.row(xy[:, 1]), self.grid.column(xy[:, 0])])
        linear = map_coordinates(self.z, place, order=1, mode="constant", cval=np.nan)
        if method == "linear":
            return linear
        known = np.isfinite(self.z)
        filled = np.where(known, self.z, np.nanmean(self.z))
        return np.where(np.isfinite(linear), map_coordinates(filled, place, order=3, mode="nearest"), np.nan)


@dataclass(frozen=True, eq=False)
class FileHeights:
    """Heights of a raster that is too large to be held: read where they are asked for."""

    reader: RasterReader | HeldRaster

    def at(self, xy: np.ndarray, method: str) -> np.ndarray:
        """Bilinear as `RasterHeights`, of the part of the file around the places."""
        if method != "linear":
            raise InputError("is too large for splines", "compare with --method linear", self.reader.path)
        grid = self.reader.grid
        row, column = grid.row(xy[:, 1]), grid.column(xy[:, 0])
        out = np.full(len(xy), np.nan)
        inside = (row >= 0.0) & (row <= grid.rows - 1) & (column >= 0.0) & (column <= grid.columns - 1)
        if not inside.any():
            return out
        (top, bottom), (left, right) = (
            (int(at[inside].min()), min(int(at[inside].max()) + 2, count))
            for at, count in ((row, grid.rows), (column, grid.columns))
        )
        z = self.reader.read(top, left, bottom - top, right - left).astype(float)
        if np.isfinite(z).any():
            place = np.array([row[inside] - top, column[inside] - left])
            out[inside] = map_coordinates(z, place, order=1, mode="constant", cval=np.nan)
        return out


@dataclass(frozen=True, eq=False)
class CellHeights:
    """Heights of the cells of a raster as they are, to be asked for at the centres of cells alone."""

    grid: Grid
    raster: RasterHeights | FileHeights

    def at(self, xy: np.ndarray, method: str) -> np.ndarray:
        """Of the cells at these places, NaN beyond the edges; nothing is interpolated, whatever the method."""
        grid = self.grid
        row, column = (np.rint(at).astype(np.int64) for at in (grid.row(xy[:, 1]), grid.column(xy[:, 0])))
        out = np.full(len(xy), np.nan)
        inside = (row >= 0) & (row < grid.rows) & (column >= 0) & (column < grid.columns)
        if inside.any():
            row, column = row[inside], column[inside]
            top, left = int(row.min()), int(column.min())
            size = int(row.max()) - top + 1, int(column.max()) - left + 1
            out[inside] = self._window(top, left, *size)[row - top, column - left]
        return out

    def _window(self, top: int, left: int, rows: int, columns: int) -> np.ndarray:
        if isinstance(self.raster, FileHeights):
            return self.raster.reader.read(top, left, rows, columns).astype(float)
        return self.raster.z[top : top + rows, left : left + columns]


@dataclass(frozen=True, eq=False)
class PointHeights:
    """Heights of points: linear in their triangles, or by thin-plate splines of the points around."""

    xyz: np.ndarray
    tin: Tin

    @classmethod
    def of(cls, xyz: np.ndarray) -> PointHeights:
        """Of points (n, 3) m; triangles with sides of more than eight typical distances are holes."""
        xyz = np.unique(xyz[np.isfinite(xyz).all(axis=1)], axis=0)
        xyz = xyz[np.unique(xyz[:, :2], axis=0, return_index=True)[1]]
        if len(xyz) < FEWEST:
            raise InputError(
                f"{counted(len(xyz), 'point')} do not make a surface", "give at least three that do not lie on a line"
            )
        area = float(np.prod(np.ptp(xyz[:, :2], axis=0)))
        return cls(xyz, triangulate(xyz, None, LARGEST_SIDE * np.sqrt(area / len(xyz))))

    def at(self, xy: np.ndarray, method: str) -> np.ndarray:
        linear = self.tin.interpolate(xy)[0]
        if method == "linear":
            return linear
        known = np.isfinite(linear)
        spline = RBFInterpolator(self.xyz[:, :2] - self.tin.origin, self.xyz[:, 2], neighbors=SPLINE_NEIGHBOURS)
        out = np.full(len(xy), np.nan)
        if known.any():
            out[known] = spline(xy[known] - self.tin.origin)
        return out


@dataclass(frozen=True)
class Statistics:
    """Of differences, m: RMSE, mean, median, standard deviation, SIGMA_PER_MAD, LE90, largest without sign."""

    count: int
    rmse: float
    bias: float
    median: float
    std: float
    nmad: float
    le90: float
    max: float


@dataclass(frozen=True, eq=False)
class Alignment:
    """By what the test surface was moved before the comparison.

    Parameters
    ----------
    kind : 'shift' or 'rigid'. shift : (3,) m added to X, Y, Z. rotation : (3,) rad about axes through `middle` (3,).
    """

    kind: str
    shift: np.ndarray
    rotation: np.ndarray
    middle: np.ndarray


@dataclass(frozen=True, eq=False)
class Comparison:
    """Differences test − control on a grid.

    Parameters
    ----------
    difference : (rows, columns) m, NaN where either has no surface.
    coverage : share of the cells with a control surface that the test surface covers.
    alignment : None where nothing was moved.
    """

    grid: Grid
    difference: np.ndarray
    statistics: Statistics
    coverage: float
    alignment: Alignment | None

    @property
    def alignment_text(self) -> str:
        """What was moved, in words; '' for nothing."""
        a = self.alignment
        if a is None:
            return ""
        text = "test surface moved by " + ", ".join(f"{v:+.3f}" for v in a.shift) + " m in X, Y, Z"
        if a.kind == "rigid":
            text += ", turned by " + ", ".join(f"{1e3 * v:+.3f}" for v in a.rotation) + " mrad"
        return text


def common_grid(one: np.ndarray, other: np.ndarray, cell: float) -> Grid:
    """Cells whose centres are multiples of the cell, where both areas (2, 2) m reach.

    Raises
    ------
    InputError
        When the areas do not meet, or the grid does not fit into memory.
    """
    low, high = np.maximum(one[0], other[0]), np.minimum(one[1], other[1])
    if (low >= high).any():
        raise InputError("the surfaces have no place in common", "check their coordinate systems")
    return grid_over(np.array([low, high]), max(cell, float((high - low).max()) / MOST_CELLS), BYTES_OF_CELL)


def _cells_of(surface: Heights) -> Grid | None:
    """The cells of a raster, None of points."""
    if isinstance(surface, RasterHeights):
        return surface.grid
    return surface.reader.grid if isinstance(surface, FileHeights) else None


def at_centres(own: Grid, grid: Grid) -> bool:
    """Whether the centres of `grid` are centres of cells of `own`, or would be if it went on."""
    for at, count in (
        (own.column(grid.x([0, grid.columns - 1])), grid.columns),
        (own.row(grid.y([0, grid.rows - 1])), grid.rows),
    ):
        whole = np.rint(at)
        if np.abs(at - whole).max() > SAME_PLACE or (count > 1 and (whole[1] - whole[0]) % (count - 1) != 0.0):
            return False
    return True


def same_cells(
    test: Heights, control: Heights, areas: tuple[np.ndarray, np.ndarray], cell: float | None
) -> Grid | None:
    """The cells that two rasters have in common, where their cells are the same; None otherwise.

    Parameters
    ----------
    areas : (2, 2) m of both. cell : m that is asked for; that of the rasters where None.

    Returns
    -------
    Cells of the control raster where both areas reach; of a side with more than `MOST_CELLS` every second, third, …

    Raises
    ------
    InputError
        When the grid does not fit into memory.
    """
    own, other = _cells_of(control), _cells_of(test)
    if own is None or other is None:
        return None
    asked = cell is None or bool(np.allclose([own.cell_x, own.cell_y], cell, rtol=1e-6))
    low, high = np.maximum(areas[0][0], areas[1][0]), np.minimum(areas[0][1], areas[1][1])
    left, top = (int(np.ceil(at - SAME_PLACE)) for at in (own.column(low[0]), own.row(high[1])))
    right, bottom = (int(np.floor(at + SAME_PLACE)) for at in (own.column(high[0]), own.row(low[1])))
    rows, columns = bottom - top + 1, right - left + 1
    if rows < 1 or columns < 1 or not asked:
        return None
    window = own.window(top, left, rows, columns)
    alike = np.allclose([other.cell_x, other.cell_y], [own.cell_x, own.cell_y], rtol=SAME_PLACE)
    if not (alike and at_centres(other, window)):
        return None
    step = -(-max(rows, columns) // MOST_CELLS)
    rows, columns = -(-rows // step), -(-columns // step)
    refuse_beyond_memory(
        float(BYTES_OF_CELL) * rows * columns, f"{rows} × {columns} cells of {own.cell_x:g} m", "give a larger --cell"
    )
    across, down = step * own.cell_x, step * own.cell_y
    return Grid(rows, columns, float(window.x(0)) - across / 2.0, float(window.y(0)) + down / 2.0, across, down)


def statistics_of(difference: np.ndarray) -> Statistics:
    """Of all that is known.

    Raises
    ------
    InputError
        When nothing is.
    """
    d = difference[np.isfinite(difference)]
    if not len(d):
        raise InputError("the surfaces have no place in common", "check their coordinate systems")
    median = float(np.median(d))
    return Statistics(
        len(d), float(np.sqrt(np.mean(d**2))), float(d.mean()), median, float(d.std()),
        float(SIGMA_PER_MAD * np.median(np.abs(d - median))),
        float(np.quantile(np.abs(d), 0.9)), float(np.abs(d).max()),
    )  # fmt: skip


def compare(
    test: Heights, control: Heights, grid: Grid, method: str = INTERPOLATION, alignment: str = ALIGNMENT,
    report: Callable[[int, int], None] | None = None,
) -> Comparison:  # fmt: skip
    """Differences of two surfaces on a grid.

    Parameters
    ----------
    method : of `settings.INTERPOLATIONS`, the interpolation of both.
    alignment : of `settings.ALIGNMENTS`; 'shift' in X, Y, Z [L: Nuth & Kääb 2011], 'rigid' with three rotations besides
        [L: Gruen & Akca 2005, least squares surface matching].
    report : called with the parts that are done and all there are, where a surface is read part by part.

    Raises
    ------
    InputError
    """
    files = [surface for surface in (test, control) if isinstance(surface, FileHeights)]
    if alignment == "none":
        test, control = _as_cells(test, control, grid)
    if files and alignment != "none":
        raise InputError("is too large to be aligned", "cut out the part in common", files[0].reader.path)
    if files:
        return _by_parts(test, control, grid, method, min(f.reader.grid.cell_x for f in files), report)
    x, y = grid.x(np.arange(grid.columns)), grid.y(np.arange(grid.rows))
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    z = control.at(places, method)
    moved = None if alignment == "none" else align(test, control, places, z, method, alignment, grid.cell_x)
    heights = test.at(places, method) if moved is None else moved_heights(test, places, z, moved, method)
    difference = heights - z
    known = np.isfinite(z)
    covered = float(np.isfinite(difference[known]).mean()) if known.any() else 0.0
    return Comparison(grid, difference.reshape(grid.rows, grid.columns), statistics_of(difference), covered, moved)


def _as_cells(test: Heights, control: Heights, grid: Grid) -> tuple[Heights, Heights]:
    """Both rasters without interpolation where the cells of the grid are theirs; as they are otherwise."""
    both: list[Heights] = []
    for one in (test, control):
        own = _cells_of(one)
        if own is None or not isinstance(one, RasterHeights | FileHeights) or not at_centres(own, grid):
            return test, control
        both.append(CellHeights(own, one))
    return both[0], both[1]


def _by_parts(
    test: Heights, control: Heights, grid: Grid, method: str, finest: float, report: Callable[[int, int], None] | None
) -> Comparison:
    """As `compare`, square by square of the grid, each about as large in the finest file as fits well into memory."""
    side = int(np.clip(PART_CELLS**0.5 * finest / grid.cell_x, 1, 1024))
    corners = [(row, column) for row in range(0, grid.rows, side) for column in range(0, grid.columns, side)]
    difference, known, covered = np.full((grid.rows, grid.columns), np.nan), 0, 0
    for k, (row, column) in enumerate(corners):
        part = slice(row, min(row + side, grid.rows)), slice(column, min(column + side, grid.columns))
        x, y = grid.x(np.arange(part[1].start, part[1].stop)), grid.y(np.arange(part[0].start, part[0].stop))
        places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        z = control.at(places, method)
        if np.isfinite(z).any():
            d = test.at(places, method) - z
            difference[part] = d.reshape(len(y), len(x))
            known, covered = known + int(np.isfinite(z).sum()), covered + int(np.isfinite(d).sum())
        if report is not None:
            report(k + 1, len(corners))
    return Comparison(grid, difference, statistics_of(difference), covered / known if known else 0.0, None)


def align(test: Heights, control: Heights, places: np.ndarray, z: np.ndarray, method: str, kind: str,
          step: float) -> Alignment:  # fmt: skip
    """The motion of the test surface that brings it onto the control surface, by least squares of the differences.

    [D] Test points P become P + t + ω × (P − M). At a place of the control surface with slopes (zx, zy) the difference
    test − control grows by tz − zx·tx − zy·ty and by what the rotation adds to t there; the motion makes it vanish.
    Differences beyond 3 SIGMA_PER_MAD do not count. What flat ground leaves open is not moved.
    """
    known = np.flatnonzero(np.isfinite(z))
    known = known[:: max(len(known) // MOST_ALIGNED, 1)]
    at, z = places[known], z[known]
    by_x = (control.at(at + step * AXES[0], method) - control.at(at - step * AXES[0], method)) / (2.0 * step)
    by_y = (control.at(at + step * AXES[1], method) - control.at(at - step * AXES[1], method)) / (2.0 * step)
    if len(z) < FEWEST:
        raise InputError("the surfaces have too little in common to be aligned", "check their coordinate systems")
    middle = np.array([*at.mean(axis=0), z.mean()])
    r = np.column_stack([at, z]) - middle
    design = np.column_stack([-by_x, -by_y, np.ones(len(z))])
    if kind == "rigid":
        # ω × r for unit rotations about X, Y, Z
        about = [np.cross(axis, r) for axis in np.eye(3)]
        design = np.column_stack([design, *(np.einsum("ni,ni->n", design, a) for a in about)])
    moved = Alignment(kind, np.zeros(3), np.zeros(3), middle)
    for _ in range(ROUNDS):
        d = moved_heights(test, at, z, moved, method) - z
        good = np.isfinite(d) & np.isfinite(design).all(axis=1)
        if good.sum() < FEWEST:
            raise InputError("the surfaces have too little in common to be aligned", "check their coordinate systems")
        off = np.abs(d - np.median(d[good]))
        good &= off <= max(CUT * SIGMA_PER_MAD * float(np.median(off[good])), 1e-6)
        scale = np.sqrt(np.mean(design[good] ** 2, axis=0)) + 1e-12
        found = -np.linalg.lstsq(design[good] / scale, d[good], rcond=1e-6)[0] / scale
        turn = found[3:] if kind == "rigid" else np.zeros(3)
        moved = Alignment(kind, moved.shift + found[:3], moved.rotation + turn, middle)
        reach = float(np.abs(r).max())
        if np.abs(found[:3]).max() < SETTLED_M and np.abs(turn).max() * reach < SETTLED_M:
            break
    return moved


def moved_heights(test: Heights, places: np.ndarray, z: np.ndarray, moved: Alignment, method: str) -> np.ndarray:
    """Heights (n,) of the moved test surface at places (n, 2), near the heights z (n,)."""
    r = np.column_stack([places, np.where(np.isfinite(z), z, moved.middle[2])]) - moved.middle
    motion = moved.shift + np.cross(np.broadcast_to(moved.rotation, r.shape), r)
    return test.at(places - motion[:, :2], method) + motion[:, 2]
