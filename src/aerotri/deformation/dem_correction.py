"""A DEM freed of the deformation of the models it was made of, window by window.

What is held at a time does not depend on the size of the DEM: some windows, and GDAL's blocks. Reading and writing
stay in one thread, kernels run in others; windows are finished in their order, so that the outcome repeats.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerotri.adjustment.parallel import thread_count
from aerotri.deformation.dem_tasks import (
    BYTES_OF_WINDOW,
    DemTasks,
    Window,
    correct_one,
    corrected_window,
    nodes_within,
    read_window,
)
from aerotri.deformation.dem_window import CorrectedWindow, DemModels, added_sums, no_sums
from aerotri.deformation.model_map import ModelMap
from aerotri.deformation.seam_steps import SeamSteps, added_steps
from aerotri.deformation.stereo_model import covariance_of, pair_model
from aerotri.execution.work import Executor, Work
from aerotri.rasters.grids import Grid, RasterReader, RasterWriter
from aerotri.rasters.held import HeldRaster

WINDOW = 1024
"""Cells along a window [C]: a few MB for each array. Larger windows take memory times the threads, smaller ones
compute more cells twice, in the overlap."""
LARGEST_WINDOW_M = 2000.0
"""Of a DEM in a CRS, within which the CRS counts as an affine image of the local frame."""
SIGMA_CELLS = 256
"""Cells of the σ raster along its longer side, at most: σ is smooth within a model."""
FEWEST_HALO, MOST_HALO = 3, 512
"""Cells by which windows overlap [C]: the least holds a cell's neighbours; half a window is the most, beyond which
shifts are no deformation."""
SAMPLE_POINTS = 200
"""Places over the DEM, 14 × 14, at which the shifts of every model are looked up [C]: a cell shifted further makes its
window start again with a wider overlap."""


@dataclass(frozen=True, eq=False)
class DemOutcome:
    """What became of a DEM.

    Parameters
    ----------
    sums : (N_SUMS,) over all cells, see `_resample_kernels`. exact : cells computed one by one.
    steps : at the seams between models. halo : cells that windows overlapped by, at most.
    sigma : (rows, columns) m, σ of dZ on `sigma_grid`; NaN where there is none.
    seconds : by stage.
    """

    sums: np.ndarray
    exact: int
    steps: SeamSteps
    halo: int
    sigma: np.ndarray
    sigma_grid: Grid
    seconds: dict[str, float]


@dataclass(frozen=True, eq=False)
class _Task:
    """A window being corrected: first row, first column, rows, columns; its halo; what comes of it."""

    window: Window
    halo: int
    future: Future[tuple[CorrectedWindow, SeamSteps]]


def correct_dem(
    models: DemModels,
    numbers: ModelMap,
    reader: RasterReader | HeldRaster,
    writer: RasterWriter,
    dz_writer: RasterWriter,
    report: Callable[[float], None] | None = None,
    executor: Executor | None = None,
    folder: Path | None = None,
) -> DemOutcome:
    """Correct a DEM.

    Parameters
    ----------
    numbers : model of every cell, numbered as in `models`.
    writer, dz_writer : of the corrected DEM and of dZ, on the grid of the reader.
    report : called with the share that is done.
    executor : other processes that do the windows; None: threads. folder : for files of windows, where there is one.

    Raises
    ------
    InputError, TasksFailedError
    """
    correction = _Correction(models, numbers, reader, writer, dz_writer)
    if executor is None or folder is None:
        return correction.run(report)
    return correction.run_apart(executor, folder, report)


class _Correction:
    """One run over a DEM: what is on its way and what has been summed up."""

    def __init__(
        self, models: DemModels, numbers: ModelMap, reader: RasterReader | HeldRaster, writer: RasterWriter,
        dz_writer: RasterWriter,
    ):  # fmt: skip
        self._models, self._numbers, self._reader = models, numbers, reader
        self._writer, self._dz_writer = writer, dz_writer
        self._halo = self._widest = halo_for(models, reader.grid)
        self._sums, self._steps, self._exact = no_sums(), SeamSteps.none(), 0
        self._seconds = {"read": 0.0, "write": 0.0, "total": 0.0}
        grid = reader.grid
        cells = max(1, -(-max(grid.rows, grid.columns) // SIGMA_CELLS))
        self._sigma_grid = grid.coarser(cells)
        shape = self._sigma_grid.rows, self._sigma_grid.columns
        row, column = (
            np.minimum(np.arange(n) * cells + cells // 2, most - 1)
            for n, most in zip(shape, (grid.rows, grid.columns), strict=True)
        )
        self._sigma_at = row, column
        self._heights, self._models_at = np.full(shape, np.nan), np.full(shape, -1, np.int64)

    def run(self, report: Callable[[float], None] | None) -> DemOutcome:
        begun, grid, threads = time.perf_counter(), self._reader.grid, thread_count()
        waiting: deque[_Task] = deque()
        done = 0
        with ThreadPoolExecutor(threads) as pool:
            for row, column, rows, columns in windows_of(grid, self._models.places.frame is not None):
                waiting.append(self._begin(pool, (row, column, rows, columns), self._halo))
                while len(waiting) > threads:
                    done += self._finish(pool, waiting.popleft())
                    if report is not None:
                        report(done / (grid.rows * grid.columns))
            while waiting:
                done += self._finish(pool, waiting.popleft())
        return self._outcome(begun)

    def run_apart(self, executor: Executor, folder: Path, report: Callable[[float], None] | None) -> DemOutcome:
        """The same by other processes, their windows put together in order."""
        begun, grid = time.perf_counter(), self._reader.grid
        windows = list(windows_of(grid, self._models.places.frame is not None))
        shared = DemTasks(
            self._models, self._numbers, self._reader, self._halo, MOST_HALO, self._sigma_at, folder.absolute()
        )
        names = [f"window at row {row}, column {column}" for row, column, _, _ in windows]
        work = Work(correct_one, shared, windows, names, "windows", shared.folder, BYTES_OF_WINDOW)
        for window, done in zip(windows, executor.run(work, report), strict=True):
            self._widest = max(self._widest, done.halo)
            self._sums, self._steps = added_sums(self._sums, done.sums), added_steps(self._steps, done.steps)
            self._exact += done.exact
            self._seconds["read"] += done.seconds
            coarse = np.ix_(*nodes_within(self._sigma_at, window))
            self._heights[coarse], self._models_at[coarse] = done.heights, done.models
            with np.load(shared.path(window), allow_pickle=False) as held:
                self._write(window, held["z"], held["dz"])
            shared.path(window).unlink()
        return self._outcome(begun)

    def _outcome(self, begun: float) -> DemOutcome:
        sigma = self._sigma()
        self._seconds["total"] = time.perf_counter() - begun
        return DemOutcome(
            self._sums, self._exact, self._steps, self._widest, sigma, self._sigma_grid, dict(self._seconds)
        )  # fmt: skip

    def _write(self, window: Window, z: np.ndarray, dz: np.ndarray) -> None:
        begun = time.perf_counter()
        self._writer.write(window[0], window[1], z)
        self._dz_writer.write(window[0], window[1], dz)
        self._seconds["write"] += time.perf_counter() - begun

    def _begin(self, pool: ThreadPoolExecutor, window: Window, halo: int) -> _Task:
        """Read a window with its halo and have it corrected."""
        begun = time.perf_counter()
        rows, columns = window[2:]
        z, number = read_window(self._reader, self._numbers, window, halo)
        self._seconds["read"] += time.perf_counter() - begun
        inner = np.s_[halo : halo + rows, halo : halo + columns]
        self._note(window, z[inner], number[inner])
        given = self._models, self._reader.grid, window, halo, z, number
        return _Task(window, halo, pool.submit(corrected_window, *given))

    def _finish(self, pool: ThreadPoolExecutor, task: _Task) -> int:
        """Write a window; once more with a wider halo where cells are shifted beyond it. Returns its cells.

        The halo of the others stays as it is: how many are on their way depends on the threads, the outcome must not.
        """
        found, steps = task.future.result()
        while found.sums[3] and task.halo < MOST_HALO:
            task = self._begin(pool, task.window, min(2 * task.halo, MOST_HALO))
            found, steps = task.future.result()
        self._widest = max(self._widest, task.halo)
        self._sums, self._steps = added_sums(self._sums, found.sums), added_steps(self._steps, steps)
        self._exact += found.exact
        self._write(task.window, found.z, found.dz)
        return task.window[2] * task.window[3]

    def _note(self, window: Window, z: np.ndarray, number: np.ndarray) -> None:
        """Keep height and model where σ will be computed: in the middle of every cell of the coarse grid."""
        row, column = nodes_within(self._sigma_at, window)
        here = np.ix_(self._sigma_at[0][row] - window[0], self._sigma_at[1][column] - window[1])
        coarse = np.ix_(row, column)
        self._heights[coarse], self._models_at[coarse] = z[here], number[here]

    def _sigma(self) -> np.ndarray:
        """(rows, columns) m, σ of dZ on the coarse grid."""
        models, grid = self._models, self._reader.grid
        x, y = np.meshgrid(grid.x(self._sigma_at[1]), grid.y(self._sigma_at[0]))
        sigma = np.full(self._heights.shape, np.nan)
        known = np.isfinite(self._heights)
        for k in np.unique(self._models_at[known & (self._models_at >= 0)]).tolist():
            own = known & (self._models_at == k)
            local = models.places.to_local(np.column_stack([x[own], y[own], self._heights[own]]))
            left, right = models.rows[k].tolist()
            model = pair_model(models.restitution, models.names[k], (left, right))
            variance = models.places.variances(local, covariance_of(model, local))
            sigma[own] = np.sqrt(np.maximum(variance[:, 2], 0.0))
        return sigma


def windows_of(grid: Grid, in_crs: bool) -> Iterator[Window]:
    """First row, first column, rows and columns of the windows of a DEM."""
    size = WINDOW
    if in_crs:
        size = int(np.clip(LARGEST_WINDOW_M / max(grid.cell_x, grid.cell_y), 64, WINDOW))
    for row in range(0, grid.rows, size):
        for column in range(0, grid.columns, size):
            yield row, column, min(size, grid.rows - row), min(size, grid.columns - column)


def halo_for(models: DemModels, grid: Grid) -> int:
    """Cells by which windows overlap: a good deal more than the shifts seen at some places of every model."""
    x = np.linspace(grid.left, grid.left + grid.columns * grid.cell_x, int(np.sqrt(SAMPLE_POINTS)))
    y = np.linspace(grid.top, grid.top - grid.rows * grid.cell_y, int(np.sqrt(SAMPLE_POINTS)))
    grid_x, grid_y = np.meshgrid(x, y)
    largest = 0.0
    for k in range(len(models.names)):
        centre = models.places.from_local(models.restitution.true.centre[models.rows[k]]).mean(axis=0)
        around = np.column_stack([grid_x.ravel(), grid_y.ravel(), np.full(grid_x.size, models.ground)])
        # a large DEM may have no sample within a small model, whose middle always is
        xyz = np.vstack([around, [[centre[0], centre[1], models.ground]]])
        shift = models.deformation_at(np.full(len(xyz), k, np.int32), xyz)[:, :2]
        cells = np.abs(shift) / np.array([grid.cell_x, grid.cell_y])
        largest = max(largest, float(np.nanmax(cells, initial=0.0)))
    return int(np.clip(np.ceil(1.5 * largest) + 2, FEWEST_HALO, MOST_HALO))
