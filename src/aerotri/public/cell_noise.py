"""The noise of the cells of a dense surface, from what `aerotri dsm` wrote, or as it stands in memory."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerotri.conventions import InputError, stated_number
from aerotri.public.dense import COUNT, GROUND, MATCHING, SOURCE, SURFACE, DenseSurface
from aerotri.rasters.grids import Grid, RasterReader, bilinear
from aerotri.rasters.held import HeldRaster
from aerotri.terrain.dense.bare_ground import BRIDGED, MEASURED, filled
from aerotri.terrain.dense.tile_files import TileWindow
from aerotri.volume.bridges import Bridges
from aerotri.volume.cell_noise import NO_NOISE, CellNoise
from aerotri.volume.lasting import NO_LASTING, Lasting
from aerotri.volume.settings import LAYER, Layer

NOISE_LENGTH, LASTING_SIGMA, LASTING_LENGTH = "NOISE_LENGTH_M", "SHARED_SIGMA_M", "SHARED_LENGTH_M"
"""Names in the metadata of dsm.tif."""
BESIDE = "give dsm.tif in the folder that `aerotri dsm` wrote"


def noise_of_dense(dense: DenseSurface, layer: Layer = LAYER) -> CellNoise:
    """Of a dense surface in memory, with objects (dsm) or without (dtm)."""
    o, length = dense.record, dense.summary["noise_length_m"]
    sigma, count, bridge = (np.full((o.grid.rows, o.grid.columns), np.nan, np.float32) for _ in range(3))
    ground = None if layer == LAYER or dense.ground is None else dense.ground
    for window, tile in o.files.read_all(list(o.windows)):
        place = _place_of(window)
        sigma[place], count[place] = tile.sigma, tile.count
    for window, tile in () if ground is None else ground.tiles():
        place, bridged = _place_of(window), tile.source == BRIDGED
        sigma[place] = np.where(tile.source == MEASURED, tile.sigma, np.where(bridged, 0.0, np.nan))
        bridge[place] = np.where(bridged, tile.sigma, np.nan)
    noise, photographs = HeldRaster(sigma, o.grid, None, MATCHING), HeldRaster(count, o.grid, None, COUNT)
    held = HeldRaster(bridge, o.grid, None, SOURCE)

    def is_bridged(row: int, column: int, rows: int, columns: int) -> np.ndarray:
        return np.isfinite(held.read(row, column, rows, columns))

    bridges = None if ground is None else Bridges(held, is_bridged)
    return CellNoise(noise, 0.0 if length is None else length, photographs, lasting_of_dense(dense), bridges)


def _place_of(window: TileWindow) -> tuple[slice, slice]:
    return np.s_[window.row : window.row + window.rows, window.column : window.column + window.columns]


def lasting_of_dense(dense: DenseSurface) -> Lasting:
    """Errors that do not average out, of a dense surface in memory."""
    shared = dense.summary["matching_shared"]
    return Lasting(shared["sigma_Z_m"], shared["length_m"])


def lasting_of_file(path: Path | None) -> Lasting:
    """Errors that do not average out, as a GeoTIFF states them; none of any other file.

    Raises
    ------
    InputError
        When what it states is no length.
    """
    if path is None or not path.is_file() or path.suffix.lower() not in (".tif", ".tiff"):
        return NO_LASTING
    with RasterReader(path) as reader:
        return Lasting(*(_length(reader.tag(name), path) for name in (LASTING_SIGMA, LASTING_LENGTH)))


def noise_of_file(path: Path | None, stack: ExitStack) -> CellNoise:
    """Of a file: none where it is not a dense surface.

    Parameters
    ----------
    stack : keeps the rasters beside it open.

    Raises
    ------
    InputError
        When its noise length is no length, or a raster beside it belongs to another surface.
    """
    if path is None or not path.is_file():
        return NO_NOISE
    with RasterReader(path) as reader:
        length, *lasting = (_length(reader.tag(name), path) for name in (NOISE_LENGTH, LASTING_SIGMA, LASTING_LENGTH))
        grid = reader.grid
    source = _beside(path, SOURCE, grid, stack) if path.name == GROUND else None
    if path.name != SURFACE and source is None:
        return CellNoise(None, length, None, Lasting(*lasting))
    matching, count = (_beside(path, name, grid, stack) for name in (MATCHING, COUNT))
    if source is None:
        return CellNoise(matching, length, count, Lasting(*lasting))
    total = stack.enter_context(RasterReader(path, band=2))
    whole = None if matching is None else _beside(path, SURFACE, grid, stack, band=2)
    found = None if matching is None else MeasuredGround(source, matching)
    bridge = BridgedGround(source, total, whole, matching)
    return CellNoise(found, length, count, Lasting(*lasting), Bridges(bridge, bridge.is_bridged))


@dataclass(frozen=True, eq=False)
class MeasuredGround:
    """σ of the ground from matching alone: of measured cells, 0 of bridged ones.

    Parameters
    ----------
    source : where heights come from. matching : σ of the surface with objects, on the same cells.
    """

    source: RasterReader
    matching: RasterReader

    @property
    def grid(self) -> Grid:
        """Of the cells."""
        return self.source.grid

    def read(self, row: int, column: int, rows: int, columns: int) -> np.ndarray:
        """(rows, columns) m, NaN where there is no ground."""
        source, sigma = (one.read(row, column, rows, columns) for one in (self.source, self.matching))
        return np.where(source == MEASURED, sigma, np.where(source == BRIDGED, 0.0, np.nan))

    def sample(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """(n,) m, bilinear."""
        return bilinear(self.read, self.grid, x, y)


@dataclass(frozen=True, eq=False)
class BridgedGround:
    """σ of bridged ground without what the adjustment adds.

    The file has both in one. What the adjustment adds changes slowly, and is the same with objects and without: there
    the surface has it apart, in the cell itself or in the next one that it has.

    Parameters
    ----------
    source : where heights come from. total : σ of the ground, on the same cells.
    whole, matching : σ of the surface with objects, and of its matching alone; None: nothing is taken off.
    """

    source: RasterReader
    total: RasterReader
    whole: RasterReader | None
    matching: RasterReader | None

    @property
    def grid(self) -> Grid:
        """Of the cells."""
        return self.source.grid

    def read(self, row: int, column: int, rows: int, columns: int) -> np.ndarray:
        """(rows, columns) m, NaN where nothing is bridged."""
        source, total = (one.read(row, column, rows, columns) for one in (self.source, self.total))
        bridged = source == BRIDGED
        variance = np.where(bridged, total.astype(float) ** 2, np.nan)
        if self.whole is not None and self.matching is not None and bridged.any():
            both, alone = (one.read(row, column, rows, columns).astype(float) for one in (self.whole, self.matching))
            variance -= filled(both**2 - alone**2)
        return np.sqrt(np.maximum(variance, 0.0))

    def is_bridged(self, row: int, column: int, rows: int, columns: int) -> np.ndarray:
        """(rows, columns) bool."""
        return self.source.read(row, column, rows, columns) == BRIDGED

    def sample(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """(n,) m, bilinear."""
        return bilinear(self.read, self.grid, x, y)


def _beside(path: Path, name: str, grid: Grid, stack: ExitStack, band: int = 1) -> RasterReader | None:
    """A raster in the folder of a dense surface, None where there is none."""
    beside = path.with_name(name)
    if not beside.is_file():
        return None
    reader = stack.enter_context(RasterReader(beside, band))
    if reader.grid != grid:
        raise InputError(f"has other cells than {path.name} beside it", BESIDE, beside)
    return reader


def _length(text: str, path: Path) -> float:
    if not text:
        return 0.0
    try:
        value = stated_number(text)
    except ValueError:
        value = -1.0
    if not 0.0 <= value < np.inf:
        raise InputError(f"states a noise length of '{text}'", BESIDE, path)
    return value
