"""Windows of a DEM as tasks that other processes do: each reads its cells, and leaves what it found in a file."""

from __future__ import annotations

import os
import time
import uuid
from dataclasses import dataclass
from pathlib import Path
from threading import Lock

import numpy as np

from aerotri.deformation.dem_window import CorrectedWindow, DemModels
from aerotri.deformation.model_map import ModelMap
from aerotri.deformation.seam_steps import SeamSteps, window_steps
from aerotri.rasters.grids import Grid, RasterReader, cache_limited
from aerotri.rasters.held import HeldRaster

Window = tuple[int, int, int, int]
"""First row, first column, rows, columns."""
DZ_STEP_M = 2.0**-14
"""dZ is written in whole multiples of this: 0.06 mm, and its file becomes smaller."""
BYTES_OF_WINDOW = 600_000_000
"""Memory of a process that corrects a window with the usual overlap: 0.48 GB were measured."""
_reading = Lock()
"""Rasters are read by one thread at a time."""


@dataclass(frozen=True, eq=False)
class DemTasks:
    """What all windows share.

    Parameters
    ----------
    models, numbers, reader : as of `dem_correction.correct_dem`. halo : cells by which windows overlap at first.
    most_halo : and at most. sigma_at : rows and columns of the DEM at which σ will be computed.
    folder : for the files.
    """

    models: DemModels
    numbers: ModelMap
    reader: RasterReader | HeldRaster
    halo: int
    most_halo: int
    sigma_at: tuple[np.ndarray, np.ndarray]
    folder: Path

    def path(self, window: Window) -> Path:
        """The file of a window."""
        return self.folder / f"window_{window[0]}_{window[1]}.npz"


@dataclass(frozen=True, eq=False)
class DoneWindow:
    """What came of a window besides its file.

    Parameters
    ----------
    sums, exact, steps, halo : as of `dem_correction.DemOutcome`. seconds : of reading.
    heights, models : (i, j) where σ will be computed, before the correction.
    """

    sums: np.ndarray
    exact: int
    steps: SeamSteps
    halo: int
    seconds: float
    heights: np.ndarray
    models: np.ndarray


def corrected_window(
    models: DemModels, grid: Grid, window: Window, halo: int, z: np.ndarray, number: np.ndarray
) -> tuple[CorrectedWindow, SeamSteps]:
    """Correct a window.

    Parameters
    ----------
    z, number : heights and models of its cells with `halo` cells around them.
    """
    row, column, rows, columns = window
    inner = np.s_[halo : halo + rows, halo : halo + columns]
    found = models.correct(z, number, grid, row - halo, column - halo, halo)
    several = len(models.names) > 1
    steps = window_steps(z[inner], found.z, number[inner]) if several else SeamSteps.none()
    np.multiply(np.round(found.dz / DZ_STEP_M), DZ_STEP_M, out=found.dz)
    return found, steps


def read_window(
    reader: RasterReader | HeldRaster, numbers: ModelMap, window: Window, halo: int
) -> tuple[np.ndarray, np.ndarray]:
    """Heights and models of a window with its halo."""
    row, column, rows, columns = window
    around = (row - halo, column - halo, rows + 2 * halo, columns + 2 * halo)
    return reader.read(*around), numbers.numbers(reader.grid, *around)


def nodes_within(sigma_at: tuple[np.ndarray, np.ndarray], window: Window) -> tuple[np.ndarray, np.ndarray]:
    """Which of the rows and columns where σ will be computed lie in a window."""
    first, size = window[:2], window[2:]
    row, column = (
        np.flatnonzero((at >= low) & (at < low + many)) for at, low, many in zip(sigma_at, first, size, strict=True)
    )
    return row, column


def correct_one(shared: DemTasks, window: Window) -> DoneWindow:
    """Correct a window and write its heights and dZ; once more with a wider halo where cells are shifted beyond it.

    Raises
    ------
    InputError
        When the DEM cannot be read.
    """
    s, halo, seconds = shared, shared.halo, 0.0
    while True:
        begun = time.perf_counter()
        with _reading, cache_limited():
            z, number = read_window(s.reader, s.numbers, window, halo)
        seconds += time.perf_counter() - begun
        found, steps = corrected_window(s.models, s.reader.grid, window, halo, z, number)
        if not (found.sums[3] and halo < s.most_halo):
            break
        halo = min(2 * halo, s.most_halo)
    row, column = nodes_within(s.sigma_at, window)
    here = np.ix_(s.sigma_at[0][row] - window[0] + halo, s.sigma_at[1][column] - window[1] + halo)
    path = s.path(window)
    part = path.with_suffix(f".{uuid.uuid4().hex}.part")
    with part.open("wb") as file:
        np.savez(file, z=found.z, dz=found.dz)
    os.replace(part, path)
    return DoneWindow(found.sums, found.exact, steps, halo, seconds, z[here], number[here])
