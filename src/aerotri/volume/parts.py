"""A surface's share in the uncertainty of a volume: its pickets or cells, and the ground between them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from aerotri.conventions import InputError
from aerotri.rasters.grids import Grid
from aerotri.results.adjustment import Adjustment
from aerotri.statistics.image_sigma import image_sigma_of_cameras
from aerotri.volume.bases import Base, Surface
from aerotri.volume.between_sides import between_on_side, sigma_at_places, sigma_of_straight_lines
from aerotri.volume.boundary import Boundary
from aerotri.volume.cell_noise import NO_NOISE, CellNoise, cells_sharing, photographs_at, shares_of_noise
from aerotri.volume.counted import Counted, counted_pieces
from aerotri.volume.either_side import WITHIN, lost_on_either_side
from aerotri.volume.functionals import Functional, cell_volume, tin_volume, triangulated
from aerotri.volume.lasting import NO_LASTING, Lasting, lasting_variance
from aerotri.volume.pickets import (
    MeasuredPickets,
    Pickets,
    pickets_of_names,
    pickets_where_seen,
    with_height_sigmas,
)
from aerotri.volume.rectified import Line
from aerotri.volume.regions import Region, base_over, region_of_cells, region_of_pieces
from aerotri.volume.response import Response, respond
from aerotri.volume.roughness import (
    Between,
    Ground,
    Roughness,
    curvature_of_cells,
    ground_of,
    roughness_of_cells,
    roughness_of_pickets,
)
from aerotri.volume.settings import SigmaOptions
from aerotri.volume.sums import cells_within
from aerotri.volume.triangles import Pieces, areas, cut_to

LATTICE_PATCH = 16
"""Nodes a side of the patch that stands for all cells of a raster; chosen [C]: two rows at its edge do not count, and
the 11 × 11 cells left average the correlation of neighbours."""
ROUNDING = 1e-9
"""Share of an area that may be lost in summing its pieces [C]: a square millimetre of a thousand square metres."""
PATCH_CELLS = 512
"""Cells a side of the part of a raster whose roughness is taken."""


@dataclass(frozen=True, eq=False)
class Measured:
    """Pickets and the gradient (k, 3) of a volume by their coordinates."""

    pickets: Pickets
    gradient: np.ndarray


@dataclass(frozen=True, eq=False)
class Part:
    """One surface's share in the uncertainty of a volume.

    Parameters
    ----------
    calibration, response : of its adjustment. between : the ground between its heights, None where not known.
    unseen : m², area no photographs were found for.
    measured : what the surface was measured from; None where nobody asks for it.
    lasting : errors of its heights that do not average out.
    region : what of the boundary counts; None where all does.
    own_noise : m², variance of a height at a place that is its own alone.
    bridged : (n,) m³, of every patch that is bridged below objects what its error makes; None where nothing is bridged.
    ground_sigma : gives by how much straight lines between heights are off the ground at a place, m; None: not known.
    side : gives the share of what of it counts: of a cut or a fill alone.
    """

    calibration: Adjustment
    response: Response
    between: Between | None
    pickets: int
    rays: int
    unseen: float
    measured: Measured | None = None
    lasting: Lasting = NO_LASTING
    region: Region | None = None
    side: Callable[[Counted], Part] | None = None
    own_noise: float = 0.0
    ground_sigma: Callable[[], float] | None = None
    bridged: np.ndarray | None = None

    def noise_at(self, apart: float) -> float:
        """m², variance of the straight lines at a place; apart : as of `Counted`."""
        ground = 0.0 if self.ground_sigma is None else self.ground_sigma()
        return self.own_noise + apart * ground**2

    @property
    def lasting_variance(self) -> float:
        """m⁶, of the volume by errors that do not average out."""
        m = self.measured
        return 0.0 if m is None else lasting_variance(m.pickets.xyz[:, :2], m.gradient[:, 2], self.lasting)

    @property
    def bridged_variance(self) -> float:
        """m⁶, of the volume by errors of patches that are bridged."""
        return 0.0 if self.bridged is None else float(np.sum(self.bridged**2))


def part_of_cells(
    calibration: Adjustment, surface: Surface, boundary: Boundary, base: Base | None, options: SigmaOptions,
    noise: CellNoise = NO_NOISE, counted: Counted | None = None,
) -> Part:  # fmt: skip
    """The share of a surface whose cells are taken for its pickets, measured in the photographs nearest to them.

    In as many as measured them where the surface says so; else in two.

    Parameters
    ----------
    noise : what the surface says of its cells; a σ or a window that the options state counts instead.
    counted : which cells count; None: all, which have heights.
    """
    own = noise.sigma if options.matching_sigma_um is None else None
    length = noise.length_m if options.matching_window_m is None else options.matching_window_m
    used = replace(noise, sigma=own, length_m=length)
    ground = _ground_of_cells(surface, boundary)
    within = 0.0 if ground is None else ground.sigma
    region = None if counted is None else region_of_cells(surface, boundary, counted, used, within)
    functional = cell_volume(
        surface, boundary, base_over(base, region), own, options.boundary_from == "product", counted,
        noise.bridges,
    )  # fmt: skip
    of_cells = noise.photographs
    per_point = options.per_point if of_cells is None else photographs_at(of_cells, functional.xyz)
    pickets, seen = pickets_where_seen(
        calibration, functional.xyz, matching_sigma_mm(calibration, options), per_point, functional.noise_share
    )
    if not seen.any():
        raise InputError(
            "no two photographs of the adjustment see the surface from different places",
            "check the CRS of surface and block",
        )
    sharing = cells_sharing(length, surface.grid.cell_x * surface.grid.cell_y)
    pickets = replace(pickets, noise_share=sharing * shares_of_noise(calibration, pickets, functional.take(seen)))
    response = respond(calibration, pickets, functional.gradient[seen], options.corrected)
    unseen = float(np.abs(functional.gradient[~seen, 2]).sum())
    between = _between_cells(ground, boundary.area, region)
    measured = Measured(pickets, functional.gradient[seen])
    lasting = noise.lasting if options.matching_sigma_um is None else NO_LASTING
    side = partial(part_of_cells, calibration, surface, boundary, base, options, noise)
    own_noise = response.noise / (sharing * _squares(measured.gradient))
    return Part(
        calibration,
        response,
        between,
        len(pickets),
        len(pickets.image),
        unseen,
        measured,
        lasting,
        region,
        side,
        own_noise,
        lambda: within,
        functional.bridged,
    )


def part_of_pickets(
    calibration: Adjustment, pickets: Pickets, triangles: np.ndarray, boundary: Boundary, base: Base | None,
    options: SigmaOptions, counted: Counted | None = None,
) -> Part:  # fmt: skip
    """The share of a TIN of pickets whose photographs are known; counted : what of it counts, None: all."""
    all_pieces = cut_to(boundary.polygon, pickets.xyz[triangles][:, :, :2])
    tin = _Tin(calibration, pickets, triangles, boundary, base, options, all_pieces)
    region, functional, response = _counted_in(tin, counted)
    noise = response.noise / _squares(functional.gradient)
    pieces = counted_pieces(pickets.xyz, triangles, all_pieces, counted)
    share = pieces.area / np.maximum(areas(pickets.xyz[triangles[pieces.triangle]][:, :, :2]), 1e-300)
    used = triangles[pieces.triangle]
    roughness = roughness_of_pickets(pickets.xyz, noise, np.unique(used))
    ground = None if roughness is None else ground_of(roughness, pickets.xyz, used, share, noise)
    between = None if roughness is None else Between()
    if ground is not None:
        between = ground.between(ground.more, ground.variance)
    unseen = boundary.area - float(all_pieces.area.sum())
    unseen = unseen if unseen > ROUNDING * boundary.area else 0.0
    measured, side = Measured(pickets, functional.gradient), partial(_side_of_pickets, tin, ground)
    rays = len(pickets.image)
    return Part(
        calibration, response, between, len(pickets), rays, unseen, measured, region=region, side=side,
        own_noise=WITHIN * noise, ground_sigma=None if ground is None else partial(sigma_of_straight_lines, ground),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Tin:
    """A TIN of pickets within a boundary; pieces : the parts of its triangles inside."""

    calibration: Adjustment
    pickets: Pickets
    triangles: np.ndarray
    boundary: Boundary
    base: Base | None
    options: SigmaOptions
    pieces: Pieces


def _counted_in(tin: _Tin, counted: Counted | None) -> tuple[Region | None, Functional, Response]:
    """What counts of a TIN, the gradient of its volume, and its response."""
    xyz, region = tin.pickets.xyz, None
    pieces = counted_pieces(xyz, tin.triangles, tin.pieces, counted)
    if counted is not None:
        region = region_of_pieces(tin.boundary, xyz, tin.triangles, pieces, (counted, tin.pieces))
    drawn = tin.options.boundary_from == "product"
    base = base_over(tin.base, region)
    functional = tin_volume(xyz, tin.triangles, tin.boundary, base, drawn, pieces)[1]
    return region, functional, respond(tin.calibration, tin.pickets, functional.gradient, tin.options.corrected)


def _side_of_pickets(tin: _Tin, ground: Ground | None, counted: Counted) -> Part:
    """The share of a cut or a fill."""
    region, functional, response = _counted_in(tin, counted)
    between = None
    if ground is not None and region is not None and counted.sign:
        between, noise = _between_on_side(tin, ground, counted)
        region = replace(region, line=region.line + Line(noise=noise))
    pickets, measured = tin.pickets, Measured(tin.pickets, functional.gradient)
    rays = len(pickets.image)
    return Part(tin.calibration, response, between, len(pickets), rays, 0.0, measured, region=region)


def _between_on_side(tin: _Tin, ground: Ground, counted: Counted) -> tuple[Between, float]:
    """What straight triangles leave out of a cut or a fill, and m³ that noise adds to it."""
    area = np.bincount(tin.pieces.triangle, tin.pieces.area, len(tin.triangles))
    lost = lost_on_either_side(tin.pickets.xyz, tin.triangles, area, counted, ground.noise)
    net = ground.between(ground.more, ground.variance).curvature
    return between_on_side(ground, counted, counted.apart * lost.at_least(net)), lost.noise


def part_of_measured(
    calibration: Adjustment, measured: MeasuredPickets, boundary: Boundary, base: Base | None, options: SigmaOptions,
    counted: Counted | None = None,
) -> Part:  # fmt: skip
    """The share of a TIN of pickets as measured; their stated σ counts unless the options state one.

    Raises
    ------
    InputError
        When a photograph is not in the block.
    """
    pickets = pickets_of_names(
        calibration.result.block, measured.xyz, measured.photographs, matching_sigma_mm(calibration, options)
    )
    if options.matching_sigma_um is None and measured.sigma_z is not None:
        pickets = with_height_sigmas(calibration, pickets, measured.sigma_z)
    return part_of_pickets(calibration, pickets, triangulated(pickets.xyz), boundary, base, options, counted)


def matching_sigma_mm(calibration: Adjustment, options: SigmaOptions) -> float | np.ndarray:
    """mm, of an image coordinate of a picket: as stated, or (c,) of every camera as its image points have it."""
    stated = options.matching_sigma_um
    return image_sigma_of_cameras(calibration) if stated is None else 1e-3 * stated


def _squares(gradient: np.ndarray) -> float:
    """m⁴, of the weights of heights: the noise of a volume over them is the mean variance of a height."""
    return max(float(np.sum(gradient[:, 2] ** 2)), 1e-300)


@dataclass(frozen=True)
class _CellGround:
    """Ground between the centres of cells: m of curvature, m⁶ per m² of variance, m of σ at a place."""

    curvature: float
    variance: float
    sigma: float


def _ground_of_cells(surface: Surface, boundary: Boundary) -> _CellGround | None:
    """For triangles between the centres of cells, from the middle of the boundary."""
    grid = surface.grid
    row, column, rows, columns = cells_within(grid, boundary)
    take_rows, take_columns = min(rows, PATCH_CELLS), min(columns, PATCH_CELLS)
    row, column = row + (rows - take_rows) // 2, column + (columns - take_columns) // 2
    z = surface.read(row, column, take_rows, take_columns).astype(float)
    z[boundary.coverage(grid.window(row, column, take_rows, take_columns)) < 0.5] = np.nan
    roughness = roughness_of_cells(z, grid)
    if roughness is None:
        return None
    patch, area = _lattice_patch(roughness, grid)
    variance = patch.between(patch.more, patch.variance).variance
    return _CellGround(curvature_of_cells(z, grid), variance / area, sigma_at_places(patch))


def _between_cells(ground: _CellGround | None, area: float, region: Region | None) -> Between | None:
    """Over what counts of an area, m²."""
    if ground is None:
        return None
    counts, sign = (area, 1) if region is None else (region.area, region.sign or 1)
    beyond = 0.0 if region is None else region.line.between
    return Between(sign * ground.curvature * counts + beyond, ground.variance * counts)


def _lattice_patch(roughness: Roughness, grid: Grid) -> tuple[Ground, float]:
    """A patch of cells amid others, and its area."""
    n = LATTICE_PATCH
    x, y = np.meshgrid(np.arange(n) * grid.cell_x, np.arange(n) * grid.cell_y)
    first = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    triangles = np.concatenate([np.column_stack([first, first + 1, first + n + 1]),
                                np.column_stack([first, first + n, first + n + 1])])  # fmt: skip
    row, column = np.divmod(first, n)
    inner = np.tile((np.minimum(row, column) >= 2) & (np.maximum(row, column) < n - 3), 2)
    xyz = np.column_stack([x.ravel(), y.ravel(), np.zeros(n * n)])
    ground = ground_of(roughness, xyz, triangles, inner.astype(float), 0.0)
    assert ground is not None, "a patch has pickets and triangles"
    return ground, 0.5 * float(inner.sum()) * grid.cell_x * grid.cell_y
