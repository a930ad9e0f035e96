"""σ of a volume, every part named: adjustment, matching, interpolation, base, boundary; the systematic part apart."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import shapely

from aerotri.conventions import InputError
from aerotri.deformation.orientation import Calibration
from aerotri.rasters import Grid
from aerotri.volume.bases import Base, PlaneBase, SplineBase, Surface, quadrature_of, sampled
from aerotri.volume.boundary import Boundary, boundary_of
from aerotri.volume.functionals import Functional, cell_volume, tin_volume
from aerotri.volume.pickets import PER_POINT, Pickets, pickets_where_seen
from aerotri.volume.response import Response, Systematic, control_response, respond, systematic
from aerotri.volume.roughness import (
    Between,
    Roughness,
    curvature_of_cells,
    ground_between,
    roughness_of_cells,
    roughness_of_pickets,
)
from aerotri.volume.sums import cells_within
from aerotri.volume.triangles import areas, cut_to

ALONG_EDGE = 33
"""Places along every edge of the boundary."""
RING_SHARE = 0.3
"""Width of the ring of ground outside the boundary that a base is judged by, over the root of the boundary's area."""
RING_STEPS = 9
"""Steps across the ring: the wider contrasts reach over eight of them."""
MOST_RING_CELLS = 4_000_000
SMOOTHEST_BELOW = 0.9
"""Exponent of the ground under a spline at most: what a ring shows as smooth need not be so far inwards."""
LATTICE_PATCH = 16
PATCH_CELLS = 512
"""Cells a side of the part of a raster whose roughness is taken."""
PARTS = ("adjustment", "matching", "interpolation", "base", "boundary")


@dataclass(frozen=True)
class SigmaOptions:
    """What is known beside the adjustment.

    Parameters
    ----------
    matching_sigma_um : of an image coordinate of a picket; None: σ̂0 of the adjustment's image coordinates.
    matching_window_m : side of the matching window on the ground, within which neighbouring cells share their noise.
    per_point : photographs a cell is measured in. base_sigma : m, common to the whole base.
    boundary_sigma : m, of either coordinate of every corner. corrected : the photographs were corrected.
    """

    matching_sigma_um: float | None = None
    matching_window_m: float = 0.0
    per_point: int = PER_POINT
    base_sigma: float = 0.0
    boundary_sigma: float = 0.0
    corrected: bool = True


@dataclass(frozen=True, eq=False)
class Part:
    """One surface's share in the uncertainty of a volume.

    Parameters
    ----------
    calibration, response : of its adjustment. between : the ground between its heights, None where not known.
    unseen : m², area no photographs were found for.
    """

    calibration: Calibration
    response: Response
    between: Between | None
    pickets: int
    rays: int
    unseen: float


@dataclass(frozen=True)
class VolumeSigma:
    """σ of a volume, m³.

    Parameters
    ----------
    parts : by the names of `PARTS`, each alone; interpolation holds the curvature too.
    curvature : ground that straight lines between the heights are expected to leave out, m³ and its σ; not in the
        volume, None where not known.
    systematic : what uncorrected image errors add or would add.
    corrected : whether the photographs were corrected, so that the systematic part is none.
    pickets, rays : behind the adjustment's part. notes : how it was found, sentences.
    """

    parts: dict[str, float]
    curvature: tuple[float, float] | None
    systematic: tuple[Systematic, ...]
    corrected: bool
    pickets: int
    rays: int
    notes: tuple[str, ...] = field(default=())

    @property
    def total(self) -> float:
        """m³, the root of the sum of squares; systematic parts are not in it."""
        return float(np.sqrt(sum(part**2 for part in self.parts.values())))


def part_of_cells(
    calibration: Calibration, surface: Surface, boundary: Boundary, base: Base | None, options: SigmaOptions
) -> Part:
    """The share of a surface whose cells are taken for its pickets, measured in the photographs nearest to them."""
    functional = cell_volume(surface, boundary, base)
    cell = surface.grid.cell_x * surface.grid.cell_y
    share = functional.noise_share * max(1.0, options.matching_window_m**2 / cell)
    pickets, seen = pickets_where_seen(
        calibration, functional.xyz, matching_sigma_mm(calibration, options), options.per_point, share
    )
    if not seen.any():
        raise InputError("no photograph of the adjustment sees the surface", "check the CRS of surface and block")
    response = respond(calibration, pickets, functional.gradient[seen], options.corrected)
    unseen = float(np.abs(functional.gradient[~seen, 2]).sum())
    between = _between_cells(surface, boundary)
    return Part(calibration, response, between, len(pickets), len(pickets.image), unseen)


def part_of_pickets(
    calibration: Calibration, pickets: Pickets, triangles: np.ndarray, boundary: Boundary, base: Base | None,
    options: SigmaOptions,
) -> Part:  # fmt: skip
    """The share of a TIN of pickets whose photographs are known."""
    functional = tin_volume(pickets.xyz, triangles, boundary, base)[1]
    response = respond(calibration, pickets, functional.gradient, options.corrected)
    corners = pickets.xyz[triangles][:, :, :2]
    pieces = cut_to(boundary.polygon, corners)
    own = corners[pieces.triangle]
    noise = _height_noise(response, functional)
    share = pieces.area / np.maximum(areas(own), 1e-300)
    used = triangles[pieces.triangle]
    roughness = roughness_of_pickets(pickets.xyz, noise, np.unique(used))
    between = None if roughness is None else ground_between(roughness, pickets.xyz, used, share, noise)
    unseen = max(boundary.area - float(pieces.area.sum()), 0.0)
    return Part(calibration, response, between, len(pickets), len(pickets.image), unseen)


def volume_sigma(
    surface: Surface, base: Base, boundary: Boundary, part: Part, base_part: Part | None, options: SigmaOptions
) -> VolumeSigma:
    """σ of a volume from the share of the surface and, where the base is a surface with an adjustment, of the base.

    Parameters
    ----------
    base_part : responses to the base's own volume, counted positive. Control points that both adjustments share, by
        name and coordinates, correlate them.
    """
    both = [part] if base_part is None else [part, base_part]
    adjustment = sum(one.response.variance for one in both)
    if base_part is not None:
        adjustment -= 2.0 * shared_control_covariance(part, base_part)
    ground = _base_variance(base, boundary, surface, options)
    between = _difference([one.between for one in both])
    parts = {
        "adjustment": np.sqrt(max(adjustment, 0.0)),
        "matching": np.sqrt(sum(one.response.noise for one in both)),
        "interpolation": np.sqrt(0.0 if between is None else between.mean_square),
        "base": np.sqrt(ground),
        "boundary": np.sqrt(boundary_variance(surface, base, boundary, options.boundary_sigma)),
    }
    found = tuple(systematic(part.calibration, part.response, variant) for variant in ("free", "absorbed")
                  if len(part.response.by_parameters))  # fmt: skip
    return VolumeSigma(
        {name: float(value) for name, value in parts.items()},
        None if between is None else (between.curvature, float(np.sqrt(between.variance))), found, options.corrected,
        sum(one.pickets for one in both), sum(one.rays for one in both), _notes(part, base_part, base, ground, options),
    )  # fmt: skip


def shared_control_covariance(first: Part, second: Part) -> float:
    """Covariance of two functionals adjusted in blocks of their own that share control points.

    [D] An error of a given coordinate moves both: Σ h'·h''·σ² over the coordinates shared, h = ∂V/∂(given coordinate).
    """
    sides = []
    for one in (first, second):
        u, block = one.calibration.system.unknowns, one.calibration.result.block
        row = {int(point): k for k, point in enumerate(u.points)}
        response = control_response(one.calibration, one.response)
        sides.append({
            str(block.points[point]): (xyz, sigma, response[row[int(point)]])
            for point, xyz, sigma, check in zip(
                block.control.point, block.control.xyz, block.control.sigma, block.control.is_check, strict=True
            )
            if not check and int(point) in row
        })  # fmt: skip
    total = 0.0
    for name in sides[0].keys() & sides[1].keys():
        (xyz, sigma, h), (other, _, k) = sides[0][name], sides[1][name]
        same = np.isfinite(xyz) & (np.abs(xyz - other) < 1e-6)
        total += float(np.sum((h * k * sigma**2)[same]))
    s0 = [one.calibration.local.outcome.sigma0 for one in (first, second)]
    return s0[0] * s0[1] * total


def boundary_variance(surface: Surface, base: Base, boundary: Boundary, sigma: float) -> float:
    """m⁶, from corners of the boundary that are each off by σ in either coordinate, independently.

    [D] ∂V/∂corner = ∮ (z − base)·φ·n ds over its two edges, φ falling linearly from 1 to 0, n the outer normal.
    """
    if sigma <= 0.0:
        return 0.0
    t = np.linspace(0.0, 1.0, ALONG_EDGE)
    simpson = np.r_[1.0, np.tile([4.0, 2.0], (ALONG_EDGE - 3) // 2), 4.0, 1.0] / (3.0 * (ALONG_EDGE - 1))
    total = 0.0
    for ring in boundary.rings:
        edges = np.diff(ring, axis=0)
        at = (ring[:-1, None] + t[None, :, None] * edges[:, None]).reshape(-1, 2)
        d = sampled(surface, at[:, 0], at[:, 1]) - base.heights(at[:, 0], at[:, 1])
        d = np.where(np.isfinite(d), d, 0.0).reshape(len(edges), ALONG_EDGE)
        normal = np.column_stack([edges[:, 1], -edges[:, 0]])
        from_start, from_end = d @ (simpson * (1.0 - t)), d @ (simpson * t)
        by_corner = from_start[:, None] * normal + np.roll(from_end[:, None] * normal, 1, axis=0)
        total += float(np.sum(by_corner**2))
    return sigma**2 * total


def matching_sigma_mm(calibration: Calibration, options: SigmaOptions) -> float:
    """mm, of an image coordinate of a picket."""
    um = calibration.local.outcome.sigma0_um if options.matching_sigma_um is None else options.matching_sigma_um
    return 1e-3 * um


def _height_noise(response: Response, functional: Functional) -> float:
    """m², mean variance of a height that is its own alone: the noise of the volume over the weights' squares."""
    return response.noise / max(float(np.sum(functional.gradient[:, 2] ** 2)), 1e-300)


def _difference(between: list[Between | None]) -> Between | None:
    """Of the surface less that of the base."""
    known = [(sign, one) for sign, one in zip((1.0, -1.0), between, strict=False) if one is not None]
    if not known:
        return None
    return Between(sum(sign * one.curvature for sign, one in known), sum(one.variance for _, one in known))


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


def _base_variance(base: Base, boundary: Boundary, surface: Surface, options: SigmaOptions) -> float:
    """m⁶, of the base: what is stated for it, and for a spline how rough the ground around suggests it is below."""
    stated = (options.base_sigma * boundary.area) ** 2
    if not isinstance(base, SplineBase):
        return stated
    width = RING_SHARE * np.sqrt(boundary.area)
    ring = boundary_of(shapely.difference(boundary.polygon.buffer(width), boundary.polygon), "ring")
    row, column, rows, columns = cells_within(surface.grid, ring)
    if rows * columns > MOST_RING_CELLS:
        return stated
    # contrasts as wide as the ring allows: the base is interpolated over far more than a cell
    step = max(1, int(width / (RING_STEPS * min(surface.grid.cell_x, surface.grid.cell_y))))
    z = surface.read(row, column, rows, columns).astype(float)
    z[ring.coverage(surface.grid.window(row, column, rows, columns)) < 0.5] = np.nan
    roughness = roughness_of_cells(z, surface.grid, step, SMOOTHEST_BELOW)
    while roughness is None and step > 1:
        step //= 2
        roughness = roughness_of_cells(z, surface.grid, step, SMOOTHEST_BELOW)
    if roughness is None:
        return stated
    places, weight = quadrature_of(boundary)
    xy = np.concatenate([places, base.xy])
    return stated + max(
        float(roughness.contrast_variance(xy, np.concatenate([weight, -base.integral]))), 0.0
    )


def _notes(
    part: Part, base_part: Part | None, base: Base, ground: float, options: SigmaOptions
) -> tuple[str, ...]:
    notes = []
    if part.unseen > 0.0:
        notes.append(f"{part.unseen:.4g} m² are seen by too few photographs of the block and are in no part of σ")
    if part.between is None:
        notes.append("too few heights to tell how rough the ground is: interpolation is left out")
    if base_part is None and not isinstance(base, PlaneBase | SplineBase) and options.base_sigma <= 0.0:
        notes.append("the base is taken for free of error: give --base-adjustment or --base-sigma")
    if isinstance(base, SplineBase):
        judged = "the base is judged by how rough the ground outside the boundary is, carried inwards"
        notes.append(judged if ground > 0.0 else "too little ground outside the boundary to judge the base by")
    if isinstance(base, PlaneBase) and options.base_sigma <= 0.0:
        notes.append(f"the base ({base.name}) is taken for free of error: --base-sigma states one")
    if options.boundary_sigma <= 0.0:
        notes.append("the boundary is taken for free of error: --boundary-sigma states one")
    return tuple(notes)
