"""From an adjusted block and its photographs to a surface with a σ for every cell: coarse levels, then the finest."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from aerotri.adjustment.parallel import blas_threads
from aerotri.conventions import InputError
from aerotri.execution.threads import Threads
from aerotri.execution.work import Executor, Work
from aerotri.memory import refuse_beyond_memory
from aerotri.rasters.grids import Grid
from aerotri.results.adjustment import Adjustment
from aerotri.terrain.dense.grey_store import GreyStore
from aerotri.terrain.dense.height_range import HeightRange, range_of_prior, range_of_surface
from aerotri.terrain.dense.shared_part import SharedPart, shared_part
from aerotri.terrain.dense.tile import TileOptions, measure_tile
from aerotri.terrain.dense.tile_files import TileFiles, TileWindow, tile_windows
from aerotri.terrain.photographs import Photographs, photographs_of
from aerotri.terrain.pickets import Area, footprint
from aerotri.terrain.prior import first_prior

CELLS_PER_GSD = 2.0
"""Cell over GSD where none is stated; the windows of least squares are seven pixels: smaller cells only repeat them."""
TILE_PX = 1000
"""Side of a tile, pixels of its level; chosen [C]: the paths of matching need a margin, which smaller tiles pay more
often; larger ones take more memory and are less alike in their parallaxes."""
MOST_LEVEL = 3
"""Coarsest level; chosen [C]: an eighth of the resolution costs a sixty-fourth of the time and shows every house."""
FEWEST_PIXELS = 250
"""On the shorter side of a photograph in its coarsest level."""
COARSE_PAIRS = 3
BYTES_OF_CELL = 48
"""Of a coarse level, held as a whole with what bounds its heights."""
BYTES_OF_TILE = 750_000_000
"""Memory of a process that measures a tile of the finest level, measured, without the photographs that it keeps."""
MOST_PLACES = 400
"""Where the share of the adjustment is computed, linear between them: it changes slowly over a block."""
Report = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class DensePlan:
    """What is to be measured.

    Parameters
    ----------
    rows : photographs of the block; paths : their files. resolution : m, cell; None: two GSD.
    area : None: as far as photographs reach. pairs : most of a tile. edge : share of the format not used.
    ideal : the photographs have been freed of image errors. folder : for the tiles.
    """

    rows: np.ndarray
    paths: tuple[Path, ...]
    folder: Path
    resolution: float | None = None
    area: Area | None = None
    pairs: int = 4
    edge: float = 0.02
    ideal: bool = False


@dataclass(frozen=True, eq=False)
class DenseOutcome:
    """A surface in tiles.

    Parameters
    ----------
    grid : all cells. windows, files : its tiles. shared : what the adjustment adds to σ.
    photographs : what was matched; paths : their files. level : of resolution they were matched at.
    cells : that have a height. shared_cells : cells a side of the square that has one noise.
    across_px : median shift across the base of a pair. factors : of the tiles. pairs : matched in all tiles.
    resumed : tiles that an earlier run had made. pixel : m of height that a pixel of parallax is, of the median tile.
    edge : share of the format at its edge that was not used.
    """

    grid: Grid
    windows: tuple[TileWindow, ...]
    files: TileFiles
    shared: SharedPart
    photographs: Photographs
    paths: tuple[Path, ...]
    level: int
    cells: int
    shared_cells: float
    across_px: np.ndarray
    factors: np.ndarray
    pairs: np.ndarray
    resumed: int
    pixel: float
    edge: float


@dataclass(frozen=True, eq=False)
class TileWork:
    """What all tiles of a level share.

    Parameters
    ----------
    photographs : to be matched, with their pixels in `store`. grid : all cells. heights : between which they lie.
    options : of the matching. files : where tiles are written.
    """

    photographs: Photographs
    store: GreyStore
    grid: Grid
    heights: HeightRange
    options: TileOptions
    files: TileFiles


def measure_surface(
    calibration: Adjustment, plan: DensePlan, report: Report | None = None, executor: Executor | None = None
) -> DenseOutcome:
    """Match all tiles, from coarse to fine.

    Parameters
    ----------
    executor : does the tiles; threads where None.

    Raises
    ------
    InputError
        When a photograph cannot be read, or nothing could be matched.
    TasksFailedError
        When tiles could not be computed.
    """

    def tell(stage: str, share: float) -> None:
        if report is not None:
            report(stage, share)

    # its systems are small: threads of the linear algebra library wait for one another in a loop
    with blas_threads(0.0):
        return _measured(calibration, plan, tell, executor or Threads())


def _measured(calibration: Adjustment, plan: DensePlan, tell: Report, executor: Executor) -> DenseOutcome:
    photographs = photographs_of(calibration, plan.rows, plan.paths, plan.ideal)
    block = calibration.local.block
    sizes = [block.cameras[c].size_px for c in block.images.camera[plan.rows].tolist()]
    store = GreyStore(plan.paths, sizes)
    gsd = float(np.median(photographs.gsd))
    shown = footprint(photographs)
    area = shown if plan.area is None else plan.area
    cell = plan.resolution or CELLS_PER_GSD * gsd
    _refuse_apart(area, shown, cell)
    finest = max(int(np.floor(np.log2(cell / (CELLS_PER_GSD * gsd)) + 1e-9)), 0)
    coarsest = max(min(MOST_LEVEL, int(np.log2(max(min(min(s) for s in sizes) / FEWEST_PIXELS, 1.0)))), finest)
    heights = range_of_prior(first_prior(calibration.result.points.xyz, area, gsd, coarsest + 1))
    if coarsest > finest:
        heights = _coarse(
            photographs, store, area, heights, plan, coarsest, gsd, executor, partial(tell, "coarse surface")
        )
    grid = grid_of_area(area, cell)
    side = tile_side(grid, gsd, finest)
    files, windows = TileFiles(plan.folder, finest, side), tile_windows(grid, side)
    options = TileOptions(finest, plan.pairs, plan.edge)
    work = TileWork(photographs, store, grid, heights, options, files)
    resumed = do_windows(work, windows, executor, partial(tell, "surface"))
    return _outcome(calibration, plan, photographs, grid, windows, files, finest, resumed)


def _refuse_apart(area: Area, shown: Area, cell: float) -> None:
    """Refuse an area that the photographs do not show, and cells larger than what they show.

    Raises
    ------
    InputError
    """
    if (area.low >= shown.high).any() or (area.high <= shown.low).any():
        (left, bottom), (right, top) = shown.low, shown.high
        raise InputError(
            f"the area does not meet the photographs: they show X {left:.0f} to {right:.0f}, Y {bottom:.0f} to "
            f"{top:.0f}",
            "give X and Y of its lower left, then of its upper right corner, in the coordinates of the block",
        )
    size = np.minimum(area.high, shown.high) - np.maximum(area.low, shown.low)
    if cell > size.min():
        raise InputError(
            f"a cell of {cell:g} m is larger than the ground to be measured, {size[0]:.0f} × {size[1]:.0f} m",
            "give a smaller --resolution",
        )


def grid_of_area(area: Area, cell: float) -> Grid:
    """The grid whose edges are multiples of the cell, over an area."""
    low, high = np.floor(area.low / cell), np.ceil(area.high / cell)
    columns, rows = (int(n) for n in np.maximum(high - low, 1.0))
    return Grid(rows, columns, float(low[0]) * cell, float(high[1]) * cell, cell, cell)


def tile_side(grid: Grid, gsd: float, level: int) -> int:
    """Cells of a side of a tile."""
    return max(int(TILE_PX * gsd * 2**level / grid.cell_x), 16)


def _coarse(
    photographs: Photographs, store: GreyStore, area: Area, heights: HeightRange, plan: DensePlan, level: int,
    gsd: float, executor: Executor, report: Callable[[float], None],
) -> HeightRange:  # fmt: skip
    grid = grid_of_area(area, CELLS_PER_GSD * gsd * 2**level)
    refuse_beyond_memory(
        BYTES_OF_CELL * grid.rows * grid.columns, f"a coarse surface of {grid.rows} × {grid.columns} cells",
        "give an --area, one part of the block after the other",
    )  # fmt: skip
    side = tile_side(grid, gsd, level)
    files, windows = TileFiles(plan.folder, level, side), tile_windows(grid, side)
    options = TileOptions(level, COARSE_PAIRS, plan.edge)
    do_windows(TileWork(photographs, store, grid, heights, options, files), windows, executor, report)
    z = np.full((grid.rows, grid.columns), np.nan, np.float32)
    for window, tile in files.read_all(windows):
        z[window.row : window.row + window.rows, window.column : window.column + window.columns] = tile.z
    if not np.isfinite(z).any():
        raise InputError(
            "no two photographs could be matched", "check that they overlap, are sharp and belong to this orientation"
        )
    height = float(np.median(photographs.centres[:, 2])) - float(np.nanmedian(z))
    angle = np.radians(10.0)
    per_pixel = gsd * 2**level / angle if height > 0.0 else gsd
    return range_of_surface(grid, z, per_pixel)


def do_windows(
    shared: TileWork, windows: Sequence[TileWindow], executor: Executor, report: Callable[[float], None]
) -> int:
    """Measure the tiles that are not there yet; how many were.

    Raises
    ------
    InputError, TasksFailedError
    """
    level = shared.options.level
    names = [f"tile at row {w.row}, column {w.column} of level {level}" for w in windows]
    files = replace(shared.files, folder=shared.files.folder.absolute())
    work = Work(
        do_window, replace(shared, files=files), windows, names, "tiles", files.folder,
        BYTES_OF_TILE + shared.store.most_bytes, "run the command again: tiles that are done are kept",
    )  # fmt: skip
    try:
        return sum(executor.run(work, report))
    finally:
        files.remove_unfinished()


def do_window(shared: TileWork, window: TileWindow) -> int:
    """Measure a tile that is not there yet; 1 where it was."""
    s = shared
    if s.files.read(window) is not None:
        return 1
    part = s.grid.window(window.row, window.column, window.rows, window.columns)
    s.files.write(window, measure_tile(s.photographs, s.store, part, s.heights, s.options))
    return 0


def _outcome(
    calibration: Adjustment, plan: DensePlan, photographs: Photographs, grid: Grid, windows: list[TileWindow],
    files: TileFiles, level: int, resumed: int,
) -> DenseOutcome:  # fmt: skip
    cells, shared_cells, across, factors, pairs = 0, [], [], [], []
    places, measured, pixels = [], [], []
    for window, tile in files.read_all(windows):
        known = int(np.isfinite(tile.z).sum())
        cells += known
        if known == 0:
            continue
        shared_cells.append(tile.shared_cells)
        across.append(tile.across)
        factors.append(tile.factor)
        pairs.append(tile.pairs)
        pixels.append(tile.pixel)
        for row, column in _some_cells(tile.z, max(int(MOST_PLACES / len(windows)), 4)):
            x, y = grid.x(window.column + column), grid.y(window.row + row)
            places.append(np.array([x, y, tile.z[row, column]]))
            measured.append(tile.measured_by(row, column))
    if not cells:
        raise InputError(
            "no two photographs could be matched", "check that they overlap, are sharp and belong to this orientation"
        )
    told = np.array(shared_cells)[np.isfinite(shared_cells)]
    return DenseOutcome(
        grid, tuple(windows), files, shared_part(calibration, photographs, plan.rows, np.array(places), measured),
        photographs, plan.paths, level, cells, float(np.median(told)) if len(told) else np.nan, np.concatenate(across),
        np.array(factors), np.concatenate(pairs), resumed, float(np.median(pixels)), plan.edge,
    )  # fmt: skip


def _some_cells(z: np.ndarray, most: int) -> Iterator[tuple[int, int]]:
    """Row and column of cells of a tile that have a height, spread over it."""
    rows, columns = np.nonzero(np.isfinite(z))
    for n in np.unique(np.linspace(0, len(rows) - 1, most).astype(int)):
        yield int(rows[n]), int(columns[n])
