"""What a surface is compared with: a level, a plane, another surface, or a base interpolated from the boundary."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import shapely
from scipy.interpolate import RectBivariateSpline

from aerotri.conventions import InputError, in_digits, stated_number
from aerotri.rasters.grids import Grid
from aerotri.volume.boundary import Boundary

MOST_NODES = 400
"""Places along the boundary a spline goes through."""
LATTICE = 129
"""Nodes a side of the lattice on which a spline is kept for evaluation at any number of cells."""
WORDS = ("plane", "boundary", "lowest")
"""Bases that follow from the surface along the boundary."""
SPLINES, LEVELS = "spline through its outline", "lowest level along its outline"
"""Bases of piles that have one of their own, in words."""
PANELS = 24
"""Quadrature points across the boundary's extent for the integral of a spline."""


class Surface(Protocol):
    """Heights on a grid, NaN where not known; `RasterReader` is one."""

    @property
    def grid(self) -> Grid: ...
    def read(self, row: int, column: int, rows: int, columns: int) -> np.ndarray: ...
    def sample(self, x: np.ndarray, y: np.ndarray) -> np.ndarray: ...


class Base(Protocol):
    """name : in words. heights : (n,) m at places (n,). on_grid : (rows, columns) at the centres of cells."""

    @property
    def name(self) -> str: ...
    def heights(self, x: np.ndarray, y: np.ndarray) -> np.ndarray: ...
    def on_grid(self, grid: Grid) -> np.ndarray: ...


@dataclass(frozen=True, eq=False)
class Nodes:
    """Heights of the surface that a base follows from: xy (k, 2) m; ∫ of the base over the boundary = integral·z, m².

    Both a height and a place of the surface: where the boundary was drawn on the surface, they move with it.
    """

    xy: np.ndarray
    integral: np.ndarray


def nodes_of(base: Base | None) -> Nodes | None:
    """What a base follows from; None where it is stated, or a surface of its own."""
    if isinstance(base, SplineBase):
        return Nodes(base.xy, base.integral)
    return base.nodes if isinstance(base, PlaneBase) else None


@dataclass(frozen=True)
class PlaneBase:
    """Z = z0 + slope_x·(X − x0) + slope_y·(Y − y0); a level where both slopes are 0.

    nodes : heights of the surface that it follows from; None where it is stated.
    """

    name: str
    z0: float
    slope_x: float = 0.0
    slope_y: float = 0.0
    x0: float = 0.0
    y0: float = 0.0
    nodes: Nodes | None = None

    def heights(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self.z0 + self.slope_x * (np.asarray(x) - self.x0) + self.slope_y * (np.asarray(y) - self.y0)

    def on_grid(self, grid: Grid) -> np.ndarray:
        x, y = grid.x(np.arange(grid.columns)), grid.y(np.arange(grid.rows))
        return self.heights(x[None, :], y[:, None]) + np.zeros((grid.rows, grid.columns))


@dataclass(frozen=True, eq=False)
class SurfaceBase:
    """Another surface; bilinear where its cells are not those of the first."""

    name: str
    surface: Surface

    def heights(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self.surface.sample(np.asarray(x, dtype=float), np.asarray(y, dtype=float))

    def on_grid(self, grid: Grid) -> np.ndarray:
        own = self.surface.grid
        row, column = own.row(grid.y(0)), own.column(grid.x(0))
        same = np.isclose([own.cell_x, own.cell_y], [grid.cell_x, grid.cell_y], rtol=1e-9, atol=0.0).all()
        if same and abs(row - np.rint(row)) < 1e-6 and abs(column - np.rint(column)) < 1e-6:
            return self.surface.read(int(np.rint(row)), int(np.rint(column)), grid.rows, grid.columns).astype(float)
        x, y = np.meshgrid(grid.x(np.arange(grid.columns)), grid.y(np.arange(grid.rows)))
        return self.heights(x.ravel(), y.ravel()).reshape(grid.rows, grid.columns)


@dataclass(frozen=True, eq=False)
class SplineBase:
    """A spline through heights of the surface along the boundary.

    Parameters
    ----------
    xy : (k, 2) m, z : (k,) m, the places and heights it goes through.
    integral : (k,) m², ∫ of the spline over the boundary = integral·z.
    """

    name: str
    xy: np.ndarray
    z: np.ndarray
    integral: np.ndarray
    lattice: RectBivariateSpline

    def heights(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self.lattice.ev(np.asarray(x), np.asarray(y))

    def on_grid(self, grid: Grid) -> np.ndarray:
        x, y = grid.x(np.arange(grid.columns)), grid.y(np.arange(grid.rows))[::-1]
        return np.ascontiguousarray(self.lattice(x, y).T[::-1])


@dataclass(frozen=True, eq=False)
class PilesBase:
    """A base of its own for each of several polygons.

    Parameters
    ----------
    boundaries, bases : of the piles, in one order.
    """

    boundaries: tuple[Boundary, ...]
    bases: tuple[Base, ...]

    @property
    def name(self) -> str:
        """In words."""
        splines = all(isinstance(base, SplineBase) for base in self.bases)
        names = dict.fromkeys(base.name for base in self.bases)
        if len(names) == 1 and not splines:
            return next(iter(names))
        return f"a base for each of {len(self.bases)} piles: {SPLINES if splines else LEVELS}"

    def heights(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """(n,) m, of the pile that is nearest."""
        x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
        tree = shapely.STRtree([one.polygon for one in self.boundaries])
        nearest = np.asarray(tree.nearest(shapely.points(x, y)))
        out = np.full(x.shape, np.nan)
        for k, base in enumerate(self.bases):
            own = nearest == k
            out[own] = base.heights(x[own], y[own])
        return out

    def on_grid(self, grid: Grid) -> np.ndarray:
        """(rows, columns) m; NaN beyond two cells around the piles."""
        out = np.full((grid.rows, grid.columns), np.nan)
        inside: list[tuple[tuple[slice, slice], np.ndarray, np.ndarray]] = []
        for boundary, base in zip(self.boundaries, self.bases, strict=True):
            row, column, rows, columns = _cells_around(grid, boundary.polygon.bounds)
            if rows > 0 and columns > 0:
                part = grid.window(row, column, rows, columns)
                place = np.s_[row : row + rows, column : column + columns]
                values = base.on_grid(part)
                out[place] = np.where(np.isnan(out[place]), values, out[place])
                inside.append((place, boundary.coverage(part) > 0.0, values))
        for place, own, values in inside:
            out[place][own] = values[own]
        return out


def _cells_around(grid: Grid, bounds: tuple[float, float, float, float]) -> tuple[int, int, int, int]:
    """First row and column, rows and columns, of the cells of a rectangle and two around it."""
    left, bottom, right, top = bounds
    row, column = max(int(np.floor(grid.row(top))) - 2, 0), max(int(np.floor(grid.column(left))) - 2, 0)
    last_row = min(int(np.ceil(grid.row(bottom))) + 2, grid.rows - 1)
    last_column = min(int(np.ceil(grid.column(right))) + 2, grid.columns - 1)
    return row, column, last_row - row + 1, last_column - column + 1


def level(height: float) -> PlaneBase:
    """A level."""
    return PlaneBase(f"level {in_digits(height, 6)} m", height)


def plane_through(points: np.ndarray, name: str = "plane") -> PlaneBase:
    """The plane through three points, or nearest in height to more: (n, 3) m.

    Raises
    ------
    InputError
        When they lie on a line.
    """
    middle = points.mean(axis=0)
    design = np.column_stack([np.ones(len(points)), points[:, :2] - middle[:2]])
    size = np.abs(design[:, 1:]).max(initial=0.0)
    if len(points) < 3 or np.linalg.svd(design[:, 1:], compute_uv=False)[-1] < 1e-9 * max(size, 1e-300):
        raise InputError("the points of the plane lie on a line", "give three points that span it")
    z0, slope_x, slope_y = np.linalg.lstsq(design, points[:, 2], rcond=None)[0]
    return PlaneBase(name, float(z0), float(slope_x), float(slope_y), float(middle[0]), float(middle[1]))


def fitted_plane(points: np.ndarray, boundary: Boundary) -> PlaneBase:
    """The plane nearest in height to the surface along a boundary: (n, 3) m."""
    plane = plane_through(points, "plane fitted to the boundary")
    middle = points[:, :2].mean(axis=0)
    design = np.column_stack([np.ones(len(points)), points[:, :2] - middle])
    centre = np.array(boundary.polygon.centroid.coords[0]) - middle
    integral = boundary.area * np.array([1.0, *centre]) @ np.linalg.pinv(design)
    return replace(plane, nodes=Nodes(points[:, :2], integral))


def boundary_heights(surface: Surface, boundary: Boundary, most: int = MOST_NODES) -> np.ndarray:
    """(k, 3) m, the surface along the boundary, evenly spaced, at most `most` places; where it is not known, none.

    Rings of holes are left out: what is cut out, as a hut on a slope, may stand on the pile.

    Raises
    ------
    InputError
        When hardly any is known.
    """
    spacing = max(boundary.outline.length / most, min(surface.grid.cell_x, surface.grid.cell_y))
    xy = np.concatenate([_along(ring, spacing) for ring in boundary.outer_rings])
    z = sampled(surface, xy[:, 0], xy[:, 1])
    known = np.isfinite(z)
    if known.sum() < 3:
        raise InputError(
            f"the surface is not known along the boundary '{boundary.name}'",
            "check the CRS of both, or choose another boundary or base",
        )
    return np.column_stack([xy[known], z[known]])


def spline_through(surface: Surface, boundary: Boundary) -> SplineBase:
    """The spline through the boundary: φ = −ρ with a plane [L: Duchon 1977; kriging with a linear variogram].

    A thin plate, φ = ρ²·ln ρ, would take slopes at the boundary from differences of neighbours and carry them inwards:
    its integral has 5 to 25 times the noise of this one [D: a boundary of 57 600 m², 60 and 400 nodes].
    """
    nodes = boundary_heights(surface, boundary)
    middle, size, at, system = _spline_system(nodes[:, :2])
    right = np.concatenate([nodes[:, 2] - nodes[:, 2].mean(), np.zeros(3)])
    coefficients = np.linalg.lstsq(system, right, rcond=1e-14)[0]

    left, bottom, right_edge, top = boundary.polygon.bounds
    x, y = np.linspace(left, right_edge, LATTICE), np.linspace(bottom, top, LATTICE)
    places = (np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2) - middle) / size
    values = nodes[:, 2].mean() + _spline_terms(places, at) @ coefficients
    base = SplineBase(
        f"spline through {len(at)} places of the boundary", nodes[:, :2], nodes[:, 2], np.zeros(len(at)),
        RectBivariateSpline(x, y, values.reshape(LATTICE, LATTICE)),
    )  # fmt: skip
    return replace(base, integral=integral_of_spline(base, *quadrature_of(boundary)))


def integral_of_spline(base: SplineBase, places: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(k,) m², ∫ of the spline over places (q, 2) with weights (q,) m², by the heights it goes through."""
    middle, size, at, system = _spline_system(base.xy)
    terms = weight @ _spline_terms((places - middle) / size, at)
    # the spline takes the mean of z out first: it gives a constant back as it is, so the weights are the same
    return np.linalg.lstsq(system.T, terms, rcond=1e-14)[0][: len(at)]


def by_places_of_kernels(base: SplineBase, places: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(k, 2) m², ∫ of the spline over places (q, 2) with weights (q,) m² by the places it goes through, of one height.

    [D] With coefficients c, and e(p) = ∫φ(p) less what the weights of the integral make of φ there, which is 0 at all
    places: c·∇e. That heights change and the spline is sloped where a place moves is not in it.
    """
    middle, size, at, system = _spline_system(base.xy)
    few = len(at)
    right = np.concatenate([base.z - base.z.mean(), np.zeros(3)])
    coefficients = np.linalg.lstsq(system, right, rcond=1e-14)[0][:few]
    within = (places - middle) / size
    weights = np.linalg.lstsq(system.T, weight @ _spline_terms(within, at), rcond=1e-14)[0]
    slopes = _pull(at, within, weight) - _pull(at, at, weights[:few]) - weights[few + 1 :]
    return coefficients[:, None] * slopes / size


def _pull(at: np.ndarray, others: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(k, 2), Σ weight·∇(−ρ) at places (k, 2), ρ to others (n, 2); nothing of one that is there itself."""
    gap = at[:, None] - others[None]
    length = np.linalg.norm(gap, axis=2)
    return -np.einsum("knc,kn->kc", gap, weight / np.where(length > 0.0, length, np.inf))


def _spline_system(xy: np.ndarray) -> tuple[np.ndarray, float, np.ndarray, np.ndarray]:
    """Middle and size of places (k, 2), these in their units, and the system (k + 3, k + 3) of the spline."""
    middle = xy.mean(axis=0)
    size = float(np.abs(xy - middle).max())
    at = (xy - middle) / size
    system = np.zeros((len(at) + 3, len(at) + 3))
    system[: len(at)] = _spline_terms(at, at)
    system[len(at) :, : len(at)] = system[: len(at), len(at) :].T
    return middle, size, at, system


def quadrature_of(boundary: Boundary, panels: int = PANELS) -> tuple[np.ndarray, np.ndarray]:
    """Places (q, 2) and weights (q,) m² for integrals over the boundary: cells of a lattice and what they hold."""
    left, bottom, right, top = boundary.polygon.bounds
    cell = max(right - left, top - bottom) / panels
    rows, columns = max(1, int(np.ceil((top - bottom) / cell))), max(1, int(np.ceil((right - left) / cell)))
    grid = Grid(rows, columns, left, top, cell, cell)
    weight = boundary.coverage(grid) * cell * cell
    row, column = np.nonzero(weight > 0.0)
    return np.column_stack([grid.x(column), grid.y(row)]), weight[row, column]


def sampled(surface: Surface, x: np.ndarray, y: np.ndarray, piece: int = 256) -> np.ndarray:
    """(n,) heights at places that may lie far apart, neighbours in the list near one another: read piece by piece."""
    parts = [surface.sample(x[k : k + piece], y[k : k + piece]) for k in range(0, len(x), piece)]
    return np.concatenate(parts) if parts else np.zeros(0)


def is_raster(text: str) -> bool:
    """Whether a text names the file of another surface, and is none that `parse_base` takes."""
    kind, _, rest = text.partition(":")
    return not (not _is_word(text) or text in WORDS or kind == "level" or (kind == "plane" and rest))


def parse_base(text: str, surface: Surface, boundary: Boundary) -> Base:
    """The base that a text tells: a height, 'level:H', 'plane:X,Y,Z;X,Y,Z;X,Y,Z', 'plane', 'boundary' or 'lowest'.

    'lowest' is the lowest height along the boundary [C]; 'plane' is fitted to the boundary.

    Raises
    ------
    InputError
        When the text is none of these.
    """
    kind, _, rest = text.partition(":")
    try:
        if kind == "level" or not _is_word(text):
            return level(stated_number(rest if kind == "level" else text))
        if kind == "plane" and rest:
            points = np.array([[stated_number(v) for v in point.split(",")] for point in rest.split(";")])
            if points.ndim != 2 or points.shape[1] != 3:
                raise ValueError
            return plane_through(points, "plane through given points")
    except ValueError:
        raise InputError(f"--base '{text}' is not understood", "give level:HEIGHT or plane:X,Y,Z;X,Y,Z;X,Y,Z") from None
    if text == "plane":
        return fitted_plane(boundary_heights(surface, boundary), boundary)
    if text == "boundary":
        return spline_through(surface, boundary)
    if text == "lowest":
        places = boundary_heights(surface, boundary)
        lowest = places[[int(np.argmin(places[:, 2]))]]
        return replace(level(float(lowest[0, 2])), nodes=Nodes(lowest[:, :2], np.array([boundary.area])))
    raise InputError(f"'{text}' is no base", f"give a height, {', '.join(WORDS)} or plane:X,Y,Z;X,Y,Z;X,Y,Z")


def _is_word(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return True
    return False


def _along(ring: np.ndarray, spacing: float) -> np.ndarray:
    """(n, 2) places along a closed ring, about `spacing` apart."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(ring, axis=0), axis=1))])
    count = max(3, int(np.ceil(length[-1] / spacing)))
    at = np.arange(count) * length[-1] / count
    return np.column_stack([np.interp(at, length, ring[:, axis]) for axis in range(2)])


def _spline_terms(at: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """(n, k + 3): −ρ to every node, then 1, x, y."""
    squared = np.maximum(np.sum(at**2, axis=1)[:, None] - 2.0 * at @ nodes.T + np.sum(nodes**2, axis=1)[None, :], 0.0)
    return np.column_stack([-np.sqrt(squared), np.ones(len(at)), at])
