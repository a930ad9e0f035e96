"""A surface's share in the uncertainty of a volume: its pickets or cells, and the ground between them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri.conventions import InputError
from aerotri.rasters.grids import Grid
from aerotri.results.adjustment import Adjustment
from aerotri.volume.bases import Base, Surface
from aerotri.volume.boundary import Boundary
from aerotri.volume.cell_noise import NO_NOISE, CellNoise, cells_sharing, photographs_at, shares_of_noise
from aerotri.volume.functionals import Functional, cell_volume, tin_volume, triangulated
from aerotri.volume.lasting import NO_LASTING, Lasting, lasting_variance
from aerotri.volume.pickets import (
    MeasuredPickets,
    Pickets,
    pickets_of_names,
    pickets_where_seen,
    with_height_sigmas,
)
from aerotri.volume.response import Response, respond
from aerotri.volume.roughness import (
    Between,
    Roughness,
    curvature_of_cells,
    ground_between,
    roughness_of_cells,
    roughness_of_pickets,
)
from aerotri.volume.settings import SigmaOptions
from aerotri.volume.sums import cells_within
from aerotri.volume.triangles import areas, cut_to

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
    """

    calibration: Adjustment
    response: Response
    between: Between | None
    pickets: int
    rays: int
    unseen: float
    measured: Measured | None = None
    lasting: Lasting = NO_LASTING

    @property
    def lasting_variance(self) -> float:
        """m⁶, of the volume by errors that do not average out."""
        m = self.measured
        return 0.0 if m is None else lasting_variance(m.pickets.xyz[:, :2], m.gradient[:, 2], self.lasting)


def part_of_cells(
    calibration: Adjustment, surface: Surface, boundary: Boundary, base: Base | None, options: SigmaOptions,
    noise: CellNoise = NO_NOISE,
) -> Part:  # fmt: skip
    """The share of a surface whose cells are taken for its pickets, measured in the photographs nearest to them.

    In as many as measured them where the surface says so; else in two.

    Parameters
    ----------
    noise : what the surface says of its cells; a σ or a window that the options state counts instead.
    """
    own = noise.sigma if options.matching_sigma_um is None else None
    functional = cell_volume(surface, boundary, base, own, options.boundary_from == "product")
    length = noise.length_m if options.matching_window_m is None else options.matching_window_m
    of_cells = noise.photographs
    per_point = options.per_point if of_cells is None else photographs_at(of_cells, functional.xyz)
    pickets, seen = pickets_where_seen(
        calibration, functional.xyz, matching_sigma_mm(calibration, options), per_point, functional.noise_share
    )
    if not seen.any():
        raise InputError("no photograph of the adjustment sees the surface", "check the CRS of surface and block")
    sharing = cells_sharing(length, surface.grid.cell_x * surface.grid.cell_y)
    pickets = replace(pickets, noise_share=sharing * shares_of_noise(calibration, pickets, functional.take(seen)))
    response = respond(calibration, pickets, functional.gradient[seen], options.corrected)
    unseen = float(np.abs(functional.gradient[~seen, 2]).sum())
    between = _between_cells(surface, boundary)
    measured = Measured(pickets, functional.gradient[seen])
    lasting = noise.lasting if options.matching_sigma_um is None else NO_LASTING
    return Part(calibration, response, between, len(pickets), len(pickets.image), unseen, measured, lasting)


def part_of_pickets(
    calibration: Adjustment, pickets: Pickets, triangles: np.ndarray, boundary: Boundary, base: Base | None,
    options: SigmaOptions,
) -> Part:  # fmt: skip
    """The share of a TIN of pickets whose photographs are known."""
    functional = tin_volume(pickets.xyz, triangles, boundary, base, options.boundary_from == "product")[1]
    response = respond(calibration, pickets, functional.gradient, options.corrected)
    corners = pickets.xyz[triangles][:, :, :2]
    pieces = cut_to(boundary.polygon, corners)
    own = corners[pieces.triangle]
    noise = _height_noise(response, functional)
    share = pieces.area / np.maximum(areas(own), 1e-300)
    used = triangles[pieces.triangle]
    roughness = roughness_of_pickets(pickets.xyz, noise, np.unique(used))
    between = None if roughness is None else ground_between(roughness, pickets.xyz, used, share, noise)
    unseen = boundary.area - float(pieces.area.sum())
    unseen = unseen if unseen > ROUNDING * boundary.area else 0.0
    measured = Measured(pickets, functional.gradient)
    return Part(calibration, response, between, len(pickets), len(pickets.image), unseen, measured)


def part_of_measured(
    calibration: Adjustment, measured: MeasuredPickets, boundary: Boundary, base: Base | None, options: SigmaOptions
) -> Part:
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
    return part_of_pickets(calibration, pickets, triangulated(pickets.xyz), boundary, base, options)


def matching_sigma_mm(calibration: Adjustment, options: SigmaOptions) -> float:
    """mm, of an image coordinate of a picket."""
    um = calibration.local.outcome.sigma0_um if options.matching_sigma_um is None else options.matching_sigma_um
    return 1e-3 * um


def _height_noise(response: Response, functional: Functional) -> float:
    """m², mean variance of a height that is its own alone: the noise of the volume over the weights' squares."""
    return response.noise / max(float(np.sum(functional.gradient[:, 2] ** 2)), 1e-300)


def _between_cells(surface: Surface, boundary: Boundary) -> Between | None:
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
    return Between(curvature_of_cells(z, grid) * boundary.area, patch.variance * boundary.area / area)


def _lattice_patch(roughness: Roughness, grid: Grid) -> tuple[Between, float]:
    """A patch of cells amid others, and its area."""
    n = LATTICE_PATCH
    x, y = np.meshgrid(np.arange(n) * grid.cell_x, np.arange(n) * grid.cell_y)
    first = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    triangles = np.concatenate([np.column_stack([first, first + 1, first + n + 1]),
                                np.column_stack([first, first + n, first + n + 1])])  # fmt: skip
    row, column = np.divmod(first, n)
    inner = np.tile((np.minimum(row, column) >= 2) & (np.maximum(row, column) < n - 3), 2)
    xyz = np.column_stack([x.ravel(), y.ravel(), np.zeros(n * n)])
    between = ground_between(roughness, xyz, triangles, inner.astype(float), 0.0)
    return between, 0.5 * float(inner.sum()) * grid.cell_x * grid.cell_y
