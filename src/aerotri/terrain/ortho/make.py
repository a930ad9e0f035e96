"""From an adjusted block, its photographs and a surface to a true orthophoto: the stages of `aerotri ortho`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerotri.conventions import InputError
from aerotri.execution.work import Executor
from aerotri.memory import refuse_beyond_memory
from aerotri.rasters.bridging import BridgedReader
from aerotri.rasters.grids import Grid, RasterReader, RasterWriter, cache_limited, horizontal_crs
from aerotri.rasters.mosaics import write_mosaic
from aerotri.rasters.surface_files import make_cloud_optimised
from aerotri.results.adjustment import Adjustment
from aerotri.terrain.dtm import rounded
from aerotri.terrain.ortho.accuracy import HeightSigma, PlanAccuracy, plan_accuracy
from aerotri.terrain.ortho.balance import Balance, balance_of, balanced, no_balance
from aerotri.terrain.ortho.candidates import (
    Candidates,
    candidates_of,
    coarse_step,
    coloured,
    covered,
    results_in_threads,
)
from aerotri.terrain.ortho.ground import TILE, GroundSurface, ground_surface, tiles_of
from aerotri.terrain.ortho.pixels import PixelStore
from aerotri.terrain.ortho.seams import Choice, choose
from aerotri.terrain.ortho.settings import OrthoSettings
from aerotri.terrain.ortho.sharpness import blur_of, sharper_first
from aerotri.terrain.ortho.tile_files import OrthoTiles
from aerotri.terrain.ortho.tile_work import OrthoWork, Place, do_tiles, kept_tile
from aerotri.terrain.ortho.tiles import Sources, Tile, make_tile
from aerotri.terrain.photographs import Photographs, photographs_of
from aerotri.terrain.pickets import footprint

IMAGE, NUMBERS, SIGMAS = "ortho.tif", "photographs.tif", "sigma.tif"
"""Names of the rasters."""
COMPRESSED = {"compress": "deflate", "predictor": 3}
CACHE_BYTES = 64 << 20
"""Of blocks of rasters that GDAL keeps [C]: the surface around a few tiles, and tiles that are being written. With the
photographs, what tiles take and the coarse cells the command stays below 2 GB, however many photographs there are."""
BYTES_OF_COARSE_CELL = 900
"""All that a coarse cell has, at the stage that takes most; 3 bands."""
KEPT_BESIDE_SEAMS = 320 << 20
"""Bytes of photographs that stay in memory while seams are laid [C], which takes most of what coarse cells need."""
PHOTOGRAPH_BAND, BRIDGED_BAND = "number of the photograph", "1: the height was not measured but bridged"
Report = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class OrthoOutcome:
    """An orthophoto, its cells being in a file.

    Parameters
    ----------
    grid : its cells. photographs : all that were given. gsd : m, their median.
    bands, dtype : of the colours.
    candidates, choice, balance, accuracy : of the coarse cells. blur : (n,) by how much less detail photographs show.
    cells : (n,) cells of every photograph. heights : cells with a height. hidden : those among them that the
        photograph chosen for their place does not see. bridged : cells of the image over bridged holes of the surface.
    resumed : tiles that an earlier run had made.
    """

    grid: Grid
    photographs: Photographs
    gsd: float
    bands: int
    dtype: str
    candidates: Candidates
    blur: np.ndarray
    choice: Choice
    balance: Balance
    accuracy: PlanAccuracy
    cells: np.ndarray
    heights: int
    hidden: int
    bridged: int
    resumed: int


def make_orthophoto(
    calibration: Adjustment,
    chosen: tuple[np.ndarray, tuple[Path, ...]],
    surface: RasterReader,
    sigma: HeightSigma,
    settings: OrthoSettings,
    folder: Path,
    report: Report,
    tiles: Path | None = None,
    executor: Executor | None = None,
) -> OrthoOutcome:
    """Make an orthophoto and write its rasters.

    Parameters
    ----------
    chosen : photographs of the block, and their files. surface : heights in metres and in the CRS of the
        block. sigma : of them. folder : to write to. tiles : where tiles are kept, those that are there are
        taken up; None: not. executor : other processes that make the tiles, kept in `tiles`; None: threads.

    Raises
    ------
    InputError
    TasksFailedError
        When an executor could not make tiles.
    """
    photographs = photographs_of(calibration, *chosen, settings.ideal)
    cameras = calibration.local.block.cameras
    sizes = [cameras[c].size_px for c in calibration.local.block.images.camera[chosen[0]]]
    pixels = PixelStore(chosen[1], sizes)
    with cache_limited(CACHE_BYTES):
        ground = ground_surface(BridgedReader(surface, settings.fill) if settings.fill > 0.0 else surface)
        if not np.isfinite(ground.low).any():
            raise InputError("has no heights", "give another surface", surface.path)
        gsd = float(np.median(photographs.gsd))
        grid = _grid(photographs, ground, settings, rounded(gsd))
        candidates, grid = _candidates(photographs, ground, grid, settings, report)
        candidates = coloured(candidates, photographs, pixels, lambda share: report("colours", share))
        pixels.forget(KEPT_BESIDE_SEAMS)
        report("seams", 0.0)
        exposure = balance_of(len(photographs), candidates)
        balance = exposure if settings.balance else no_balance(len(photographs), candidates)
        blur = blur_of(photographs, candidates, exposure.gain[:, pixels.detail_band])
        candidates = sharper_first(candidates, photographs, gsd, blur)
        choice = choose(candidates, balanced(candidates, balance), settings.seams)
        report("accuracy", 0.0)
        accuracy = plan_accuracy(calibration, photographs, candidates, choice, sigma)
        sources = Sources(
            photographs, pixels, ground, candidates, choice, balance, settings.edge, settings.resampling
        )  # fmt: skip
        crs = horizontal_crs(calibration.result.block.crs)
        kept = None if tiles is None else OrthoTiles(tiles)
        cells, counts = _written(sources, grid, folder, crs, kept, report, executor)
    with RasterWriter(folder / SIGMAS, candidates.grid, crs=crs, options=COMPRESSED) as writer:
        writer.describe("σ of X and Y, m")
        writer.write(0, 0, accuracy.total.astype(np.float32))
    make_cloud_optimised(folder / SIGMAS)
    return OrthoOutcome(
        grid, photographs, gsd, pixels.bands, pixels.dtype.name, candidates, blur, choice, balance, accuracy, cells,
        *counts,
    )  # fmt: skip


def _grid(photographs: Photographs, surface: GroundSurface, settings: OrthoSettings, cell: float) -> Grid:
    """Cells at whole multiples of their size where surface, photographs and area overlap.

    Raises
    ------
    InputError
        When they do not.
    """
    cell = cell if settings.cell is None else settings.cell
    seen, bounds = footprint(photographs), surface.grid.bounds
    low, high = np.maximum(seen.low, bounds[:2]), np.minimum(seen.high, bounds[2:])
    if not (low < high).all():
        raise InputError(
            f"covers X {bounds[0]:.0f} … {bounds[2]:.0f}, Y {bounds[1]:.0f} … {bounds[3]:.0f}; the photographs show X "
            f"{seen.low[0]:.0f} … {seen.high[0]:.0f}, Y {seen.low[1]:.0f} … {seen.high[1]:.0f}",
            "give a surface of the same ground in the coordinate system of the block", surface.reader.path,
        )  # fmt: skip
    if settings.area is not None:
        low, high = np.maximum(low, settings.area[:2]), np.minimum(high, settings.area[2:])
        if not (low < high).all():
            raise InputError("the area has no surface or no photographs", "give an area that both cover")
    first, last = np.floor(low / cell + 1e-6), np.ceil(high / cell - 1e-6)
    columns, rows = (int(v) for v in np.maximum(last - first, 1.0))
    return Grid(rows, columns, float(first[0] * cell), float(last[1] * cell), cell, cell)


def _candidates(
    photographs: Photographs, surface: GroundSurface, grid: Grid, settings: OrthoSettings, report: Report
) -> tuple[Candidates, Grid]:
    """The candidates of the coarse cells that are seen, and the cells of these.

    Raises
    ------
    InputError
    """
    coarse = grid.coarser(coarse_step(grid))
    refuse_beyond_memory(
        float(BYTES_OF_COARSE_CELL) * coarse.rows * coarse.columns, f"{grid.rows} × {grid.columns} cells",
        "give a larger --cell, or an --area",
    )  # fmt: skip
    gsd = float(np.median(photographs.gsd))
    found = candidates_of(
        photographs, surface, grid, gsd, settings.edge, lambda share: report("visibility", share)
    )  # fmt: skip
    if not (found.found[0] >= 0).any():
        raise InputError(
            f"no photograph shows the surface, whose heights are {float(np.min(surface.low)):.1f} … "
            f"{float(np.max(surface.high)):.1f} m; the ground of the block is at {photographs.ground:.1f} m",
            "give a surface in the height system of the block", surface.reader.path,
        )  # fmt: skip
    found, (row, column) = covered(found)
    step, g = found.step, found.grid
    return found, grid.window(row * step, column * step, g.rows * step, g.columns * step)


def _written(
    sources: Sources,
    grid: Grid,
    folder: Path,
    crs: str | None,
    kept: OrthoTiles | None,
    report: Report,
    executor: Executor | None,
) -> tuple[np.ndarray, tuple[int, int, int, int]]:
    """Write all tiles; cells of every photograph; cells with heights, hidden ones, those over bridged holes, and tiles
    that an earlier run had made."""
    cells, heights, hidden, bridges, resumed = np.zeros(len(sources.photographs), np.int64), 0, 0, 0, 0
    bands = (*(f"band {b + 1}" for b in range(sources.pixels.bands)), "mask")

    def one(place: Place) -> tuple[bool, Tile | None]:
        if kept is None:
            return False, make_tile(sources, *place)
        return kept_tile(OrthoWork(sources, kept), place)

    places, begin, before = list(tiles_of(grid, TILE)), 0.0, 0
    if executor is not None and kept is not None:
        begin = 0.8
        before = do_tiles(OrthoWork(sources, kept), places, executor, lambda done: report("cells", begin * done))
    layers = (PHOTOGRAPH_BAND, *([BRIDGED_BAND] if isinstance(sources.surface.reader, BridgedReader) else []))
    with (
        write_mosaic(folder / IMAGE, grid, bands, sources.pixels.dtype.name, crs, True, CACHE_BYTES) as image,
        write_mosaic(folder / NUMBERS, grid, layers, "int32", crs, False, CACHE_BYTES) as numbers,
    ):
        for was_there, tile in results_in_threads(
            one, places, lambda done: report("cells", begin + (0.95 - begin) * done)
        ):
            resumed += was_there
            if tile is None:
                continue
            image.write(tile.row, tile.column, tile.colours)
            numbers.write(tile.row, tile.column, _numbers_of(tile))
            cells += np.bincount(tile.number[tile.number >= 0], minlength=len(cells))
            heights, hidden = heights + tile.heights, hidden + tile.hidden
            bridges += 0 if tile.bridged is None else int((tile.bridged & (tile.number >= 0)).sum())
        report("overviews", 0.95)
    return cells, (heights, hidden, bridges, before if begin else resumed)


def _numbers_of(tile: Tile) -> np.ndarray:
    """(bands, r, c) int32, the photograph of every cell, and whether its height was bridged."""
    if tile.bridged is None:
        return tile.number[None]
    return np.stack([tile.number, tile.bridged.astype(np.int32)])
