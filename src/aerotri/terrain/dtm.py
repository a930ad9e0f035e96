"""From an adjusted block and its photographs to pickets and surfaces: the chain of stages of `aerotri dtm`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from aerotri.adjustment.track import along_strip
from aerotri.conventions import InputError, counted
from aerotri.deformation.block_models import strip_pairs
from aerotri.deformation.model_geometry import geometry_of
from aerotri.deformation.stereo_model import pair_model
from aerotri.execution.work import Workplace
from aerotri.rasters.grids import Grid, rasterise
from aerotri.results.adjustment import Adjustment
from aerotri.terrain.adjustment_part import adjustment_variances
from aerotri.terrain.error_pickets import with_error_pickets
from aerotri.terrain.interval import interval_of_gsd, interval_of_surface, k_of_slope
from aerotri.terrain.matching import measure
from aerotri.terrain.photographs import Photographs, photographs_of
from aerotri.terrain.pickets import Area, MatchOptions, Models, Pickets, footprint
from aerotri.terrain.surface import Surface, grid_over, ground_cells, interpolation_error, surface_of

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

BEST_END_LAP = 0.6
"""End lap of the pairs that are looked for: the usual one of aerial photographs [C]; less shows the ground too
differently, more has a weak base."""
GROUND = {"mountains": "mountains", "plain": "flat ground"}
"""What the kinds of ground are called where they are said."""
CELLS_PER_INTERVAL = 2
"""Cells of the raster between two pickets where no cell is stated; chosen [C]: one would cut off corners of the
triangles, more only repeat their planes."""
Report = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class TerrainPlan:
    """What is to be measured.

    Parameters
    ----------
    rows : photographs of the block; paths : their files.
    interval, cell : m, None: computed. pairs : whether the best pair measures a picket, not all photographs.
    step : photographs from one of a pair to the other along the strip; None: what comes nearest to 60 % end lap.
    threshold, agreeing : correlations of `MatchOptions`.
    area : None: as far as the photographs reach. breaklines : (k, 3) m each.
    ground_within : polygon within which all is ground, None: nowhere.
    ideal : whether the photographs have been freed of image errors.
    """

    rows: np.ndarray
    paths: tuple[Path, ...]
    interval: float | None = None
    cell: float | None = None
    pairs: bool = False
    step: int | None = None
    area: Area | None = None
    window_px: int = 17
    threshold: float = 0.90
    agreeing: float = 0.50
    edge: float = 0.10
    most_photographs: int = 5
    breaklines: tuple[np.ndarray, ...] = ()
    ground_within: BaseGeometry | None = None
    ideal: bool = False


@dataclass(frozen=True, eq=False)
class TerrainOutcome:
    """What was measured.

    Parameters
    ----------
    pickets : all nodes. adjustment : (n, 3) m², what the adjustment adds to their variances. ground : (n,) bool.
    dsm, dtm : the surface with objects, and without. models, number : where pairs measured, the pairs and which of
    them the cells of the surface belong to.
    interval, cell : m. interval_source : where the interval comes from. interpolation : m, RMS between pickets.
    photographs : what was matched.
    """

    pickets: Pickets
    adjustment: np.ndarray
    ground: np.ndarray
    dsm: Surface
    dtm: Surface
    models: Models | None
    number: np.ndarray
    interval: float
    interval_source: str
    cell: float
    interpolation: float
    photographs: Photographs


def chosen_rows(calibration: Adjustment, subset: str) -> np.ndarray:
    """Oriented photographs of the block: all, or every second one of each strip, from its first or its second on.

    They count along the flight, so that even and odd ones of a flight with 80 % end lap make blocks with 60 %.
    """
    images = calibration.local.block.images
    oriented = np.asarray(np.isfinite(calibration.local.images.centre).all(axis=1))
    if subset == "all":
        return np.flatnonzero(oriented)
    rows = []
    for strip in dict.fromkeys(images.strip.tolist()):
        members = np.flatnonzero(images.strip == strip)
        centre = calibration.local.images.centre[members]
        if strip and len(members) > 1 and np.isfinite(centre).all():
            members = members[along_strip(centre)]
        rows.append(members[0 if subset == "odd" else 1 :: 2])
    found = np.sort(np.concatenate(rows))
    return found[oriented[found]]


def make_terrain_model(
    calibration: Adjustment, plan: TerrainPlan, report: Report | None = None, at: Workplace | None = None
) -> TerrainOutcome:
    """Measure pickets, find those in error, make surfaces.

    Parameters
    ----------
    at : where tiles are measured; None: in threads.

    Raises
    ------
    InputError, TasksFailedError
    """

    def tell(stage: str, share: float) -> None:
        if report is not None:
            report(stage, share)

    photographs = photographs_of(calibration, plan.rows, plan.paths, plan.ideal)
    gsd = float(np.median(photographs.gsd))
    known = calibration.result.points.xyz
    interval, source = plan.interval, "given"
    if interval is None:
        interval, source = _own_interval(photographs, known, gsd, plan)
    options = MatchOptions(
        interval=interval, window_px=plan.window_px, threshold=plan.threshold, agreeing=plan.agreeing, edge=plan.edge,
        most_photographs=plan.most_photographs,
    )  # fmt: skip
    models = models_of(calibration, photographs, plan.step) if plan.pairs else None
    pickets = measure(photographs, known, options, plan.area, models, lambda share: tell("matching", share), at)
    _refuse_few(pickets.accepted)
    pickets = with_error_pickets(pickets, gsd / base_ratio(photographs, pickets))
    tell("statistics", 0.97)
    adjustment = adjustment_variances(calibration, photographs.restitution, plan.rows, pickets)
    _refuse_few(pickets.accepted & np.isfinite(adjustment[:, 2]))
    outcome = _surfaces(pickets, adjustment, interval, plan, 0.5 * plan.window_px * gsd)
    tell("surfaces", 1.0)
    number = _model_numbers(outcome[0], pickets) if models is not None else np.zeros((0, 0), np.int32)
    dsm, dtm, ground, interpolation = outcome
    return TerrainOutcome(
        pickets, adjustment, ground, dsm, dtm, models, number, interval, source, dsm.grid.cell_x, interpolation,
        photographs,
    )  # fmt: skip


def _refuse_few(accepted: np.ndarray) -> None:
    """Three points make a surface.

    Raises
    ------
    InputError
    """
    if accepted.sum() < 3:
        raise InputError(
            f"only {counted(int(accepted.sum()), 'ground point')} (pickets) could be measured and accepted",
            "lower --threshold; check that the photographs overlap, are sharp and belong to this orientation",
        )


def _own_interval(photographs: Photographs, known: np.ndarray, gsd: float, plan: TerrainPlan) -> tuple[float, str]:
    """The interval (two digits) and where it comes from."""
    k, ground = k_of_slope(typical_slope(known))
    if plan.pairs:
        return rounded(interval_of_gsd(gsd, k)), f"{1000 * k:g} · √GSD, as for {GROUND[ground]}"
    area = footprint(photographs) if plan.area is None else plan.area
    interval, source = interval_of_surface(gsd, k, float(np.prod(area.high - area.low)))
    return rounded(interval), f"{source}, as for {GROUND[ground]}"


def rounded(value: float) -> float:
    """Rounded to two significant digits."""
    return float(f"{value:.2g}")


def typical_slope(xyz: np.ndarray) -> float:
    """Median slope between neighbouring points (n, 3) of the ground."""
    from scipy.spatial import KDTree

    xyz = xyz[np.isfinite(xyz).all(axis=1)]
    if len(xyz) < 4:
        return 0.0
    far, near = KDTree(xyz[:, :2]).query(xyz[:, :2], 4)
    near = np.asarray(near)
    rise = np.abs(xyz[near[:, 1:], 2] - xyz[:, None, 2])
    return float(np.median(rise / np.maximum(np.asarray(far)[:, 1:], 1e-9)))


def base_ratio(photographs: Photographs, pickets: Pickets) -> float:
    """Median base over height of the first two photographs of the pickets."""
    measured = np.flatnonzero(pickets.accepted)
    a, b = (photographs.centres[pickets.photographs[measured, k]] for k in range(2))
    height = 0.5 * (a[:, 2] + b[:, 2]) - pickets.xyz[measured, 2]
    return float(np.median(np.hypot(*(a - b)[:, :2].T) / height))


def models_of(calibration: Adjustment, photographs: Photographs, step: int | None = None) -> Models:
    """The pairs that photographs make along their strips, at the step that comes nearest to 60 % end lap.

    Raises
    ------
    InputError
    """
    row = {int(r): k for k, r in enumerate(photographs.rows)}
    missing = ~np.isin(np.arange(len(photographs.restitution.true)), photographs.rows)
    restitution = photographs.restitution
    # photographs that are not matched are none of a strip, so that steps count those that are
    centre = np.where(missing[:, None], np.nan, restitution.true.centre)
    restitution = replace(restitution, true=replace(restitution.true, centre=centre))
    best: tuple[float, list[tuple[int, int]]] = (np.inf, [])
    ground = float(np.nanmedian(calibration.local.points.xyz[:, 2]))
    for one in range(1, 6) if step is None else (step,):
        pairs = strip_pairs(calibration, restitution, one)
        if not pairs:
            continue
        laps = [geometry_of(pair_model(photographs.restitution, ("", ""), pair), ground).end_lap for pair in pairs]
        off = abs(float(np.median(laps)) - BEST_END_LAP)
        if off < best[0]:
            best = off, pairs
    if not best[1]:
        raise InputError("no two photographs that follow one another overlap", "leave out --pairs")
    pairs = np.array([[row[a], row[b]] for a, b in best[1]])
    middles = photographs.centres[pairs].mean(axis=1)[:, :2]
    return Models(pairs, np.ascontiguousarray(middles))


def _surfaces(
    pickets: Pickets, adjustment: np.ndarray, interval: float, plan: TerrainPlan, blur: float
) -> tuple[Surface, Surface, np.ndarray, float]:
    own = np.flatnonzero(pickets.accepted)
    xyz, matching, shared = pickets.xyz[own], pickets.covariance[own, 2, 2], adjustment[own, 2]
    between = interpolation_error(xyz, pickets.node[own], interval, matching)
    cell = interval / CELLS_PER_INTERVAL if plan.cell is None else plan.cell
    grid = grid_over(xyz[:, :2], cell)
    dsm = surface_of(xyz, matching, interval, grid, plan.breaklines, between, shared)
    of_cell = ground_cells(dsm.z, cell, blur, _cells_within(plan.ground_within, grid))
    row = np.clip(np.round(grid.row(xyz[:, 1])), 0, grid.rows - 1).astype(int)
    column = np.clip(np.round(grid.column(xyz[:, 0])), 0, grid.columns - 1).astype(int)
    is_ground = of_cell[row, column]
    ground = np.zeros(len(pickets), bool)
    ground[own] = is_ground
    if is_ground.all() or is_ground.sum() < 3:
        return dsm, dsm, ground, between
    longest = interval * max(1.0, 18.0 / interval)
    dtm = surface_of(
        xyz[is_ground], matching[is_ground], longest, grid, plan.breaklines, between, shared[is_ground]
    )  # fmt: skip
    known = np.isfinite(dsm.z)
    dtm = Surface(grid, np.where(known, dtm.z, np.nan), np.where(known, dtm.sigma, np.nan))
    return dsm, dtm, ground, between


def _cells_within(polygon: BaseGeometry | None, grid: Grid) -> np.ndarray | None:
    """(rows, columns) bool, cells that a polygon touches; None without one."""
    if polygon is None:
        return None
    from shapely.geometry import mapping

    return rasterise([(mapping(polygon), 1)], grid, 0, touched=True) == 1


def _model_numbers(dsm: Surface, pickets: Pickets) -> np.ndarray:
    """(rows, columns) int32, the model of the nearest picket; −1 off the surface."""
    from scipy.spatial import KDTree

    own = np.flatnonzero(pickets.accepted)
    x, y = dsm.grid.x(np.arange(dsm.grid.columns)), dsm.grid.y(np.arange(dsm.grid.rows))
    cells = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    nearest = np.asarray(KDTree(pickets.xyz[own, :2]).query(cells)[1])
    number = pickets.model[own][nearest].reshape(dsm.z.shape).astype(np.int32)
    return np.where(np.isfinite(dsm.z), number, -1).astype(np.int32)
