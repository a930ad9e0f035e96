"""The noise of the cells of a dense surface, from what `aerotri dsm` wrote, or as it stands in memory."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import numpy as np

from aerotri.conventions import InputError, stated_number
from aerotri.public.dense import COUNT, MATCHING, SURFACE, DenseSurface
from aerotri.rasters.grids import Grid, RasterReader
from aerotri.rasters.held import HeldRaster
from aerotri.volume.cell_noise import NO_NOISE, CellNoise
from aerotri.volume.lasting import NO_LASTING, Lasting

NOISE_LENGTH, LASTING_SIGMA, LASTING_LENGTH = "NOISE_LENGTH_M", "SHARED_SIGMA_M", "SHARED_LENGTH_M"
"""Names in the metadata of dsm.tif."""
BESIDE = "give dsm.tif in the folder that `aerotri dsm` wrote"


def noise_of_dense(dense: DenseSurface) -> CellNoise:
    """Of a dense surface in memory."""
    o, length = dense.record, dense.summary["noise_length_m"]
    sigma, count = (np.full((o.grid.rows, o.grid.columns), np.nan, np.float32) for _ in range(2))
    for window, tile in o.files.read_all(list(o.windows)):
        place = np.s_[
            window.row : window.row + tile.sigma.shape[0], window.column : window.column + tile.sigma.shape[1]
        ]
        sigma[place], count[place] = tile.sigma, tile.count
    noise, photographs = HeldRaster(sigma, o.grid, None, MATCHING), HeldRaster(count, o.grid, None, COUNT)
    return CellNoise(noise, 0.0 if length is None else length, photographs, lasting_of_dense(dense))


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
    if path.name != SURFACE:
        return CellNoise(None, length, None, Lasting(*lasting))
    matching, count = (_beside(path, name, grid, stack) for name in (MATCHING, COUNT))
    return CellNoise(matching, length, count, Lasting(*lasting))


def _beside(path: Path, name: str, grid: Grid, stack: ExitStack) -> RasterReader | None:
    """A raster in the folder of a dense surface, None where there is none."""
    beside = path.with_name(name)
    if not beside.is_file():
        return None
    reader = stack.enter_context(RasterReader(beside))
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
