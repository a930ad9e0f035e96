"""The correction of one window of a DEM: from a restitution and its models to what the kernels take, and back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.deformation import _exact_kernels, _resample_kernels, _window_kernels
from aerotri.deformation._exact_kernels import Models
from aerotri.deformation._patch_kernels import Dem, Moves
from aerotri.deformation.error_tables import ErrorTables, error_tables
from aerotri.deformation.model_geometry import geometry_of
from aerotri.deformation.model_grid import Places, mean_ground, pair_of, places_of
from aerotri.deformation.orientation import photo_rows, row_of_image
from aerotri.deformation.restitution import Restitution
from aerotri.rasters.grids import Grid
from aerotri.results.adjustment import Adjustment

FIT_TOLERANCE_M = 2e-4
"""How far the fit over a patch may be off the exact deformation [C]: 0.2 mm, far below the σ of any DEM; a smaller one
makes patches smaller and the correction slower."""
TABLE_TOLERANCE_M = 1e-4
"""Part of the deformation that tables of the image errors may be off [C]: half of the fit's, so that it does not fail
by them."""
FIXED_POINT_TOLERANCE_M = 1e-4
"""Change of the shift in plan that ends the fixed point [C]: on a slope of 45° 0.1 mm in the height, as much as the
tables."""
LARGEST_PATCH = 64
"""Cells along a patch that is tried at first [C]: larger ones seldom pass the check, smaller ones fit more often than
needed."""
PART = 256
"""Cells along the part of a window that is corrected at a time [C]: its arrays fit into the processor's cache."""


@dataclass(frozen=True, eq=False)
class CorrectedWindow:
    """A window after the correction.

    Parameters
    ----------
    z, dz : (h, w) m, corrected heights and deformation; NaN where there are none.
    sums : (N_SUMS,) see `_resample_kernels`.
    exact : cells computed one by one.
    """

    z: np.ndarray
    dz: np.ndarray
    sums: np.ndarray
    exact: int


@dataclass(frozen=True, eq=False)
class DemModels:
    """The M models a DEM was made of.

    Parameters
    ----------
    names : (left, right) of each. rows : (M, 2) photographs of the block.
    of : all photographs. tables : the image errors. source : (M, 2) which table each photograph has.
    places : between the CRS of the DEM and the frame of the orientations.
    ground : m, mean height in the CRS, where the frame's axes are taken.
    table_accuracy_m : m, what the tables of the image errors cost in height.
    """

    names: tuple[tuple[str, str], ...]
    rows: np.ndarray
    restitution: Restitution
    tables: ErrorTables
    source: np.ndarray
    places: Places
    ground: float
    table_accuracy_m: float

    def photos(self, x: float, y: float, chosen: np.ndarray | None = None) -> np.ndarray:
        """(M, 4, 23) photographs of models for coordinates X − x, Y − y, Z of the DEM.

        Around a place the CRS is an affine image of the frame, exact enough for the deformation over some kilometres:
        it changes by millimetres where the place is wrong by metres.
        """
        rows = self.rows if chosen is None else self.rows[chosen]
        local, axes = self.places.axes_at(np.array([x, y, self.ground]))
        local = local - self.ground * axes[:, 2]
        sides = [
            (restitution, rows[:, k])
            for restitution in (self.restitution.used, self.restitution.true)
            for k in range(2)
        ]
        return np.ascontiguousarray(
            np.stack([photo_rows(restitution.take(r), local, axes) for restitution, r in sides], axis=1)
        )

    def deformation_at(self, number: np.ndarray, xyz: np.ndarray) -> np.ndarray:
        """(n, 3) m, the deformation at points (n, 3) of the DEM in models (n,); NaN where they are not seen."""
        out = np.full(xyz.shape, np.nan)
        known = np.flatnonzero((number >= 0) & np.isfinite(xyz).all(axis=1))
        if not len(known):
            return out
        x, y = xyz[known, :2].mean(axis=0)
        chosen, local = np.unique(number[known], return_inverse=True)
        found = np.empty((len(known), 3))
        models = Models(self.photos(x, y, chosen), self.source[chosen], self.tables.for_kernels)
        _exact_kernels.deform_points(models, local, xyz[known] - (x, y, 0.0), found)
        out[known] = found
        return out

    def correct(
        self, z: np.ndarray, number: np.ndarray, grid: Grid, row: int, column: int, halo: int
    ) -> CorrectedWindow:
        """Correct a window.

        Parameters
        ----------
        z : (h, w) m with `halo` cells around the window; NaN where the DEM has no data.
        number : (h, w) int32, model of every cell, −1 for none.
        row, column : of the first cell of `z` in the DEM.
        """
        window = (z.shape[0] - 2 * halo, z.shape[1] - 2 * halo)
        sums = no_sums()
        present = np.zeros(len(self.names) + 1, bool)
        present[number] = True  # -1, no model, is the last one
        chosen = np.flatnonzero(present[:-1])
        if not len(chosen):
            known = np.isfinite(z[halo : halo + window[0], halo : halo + window[1]]).sum()
            sums[1], sums[2] = window[0] * window[1] - known, known
            return CorrectedWindow(np.full(window, np.nan, z.dtype), np.full(window, np.nan, np.float32), sums, 0)
        x, y = float(grid.x(column + z.shape[1] // 2)), float(grid.y(row + z.shape[0] // 2))
        number = _renumbered(number, chosen, present)
        models = Models(self.photos(x, y, chosen), self.source[chosen], self.tables.for_kernels)
        out, out_dz, exact = np.empty(window, z.dtype), np.empty(window, np.float32), 0
        for i in range(0, window[0], PART):
            for j in range(0, window[1], PART):
                rows, columns = min(PART, window[0] - i), min(PART, window[1] - j)
                around = np.s_[i : i + rows + 2 * halo, j : j + columns + 2 * halo]
                place = np.array(
                    [grid.x(column + j) - x, grid.cell_x, grid.y(row + i) - y, -grid.cell_y], dtype=float
                )  # fmt: skip
                dem = Dem(np.ascontiguousarray(z[around]), np.ascontiguousarray(number[around]), place)
                part = _corrected_part(dem, models, halo)
                inner = np.s_[i : i + rows, j : j + columns]
                out[inner], out_dz[inner] = part.z, part.dz
                sums, exact = added_sums(sums, part.sums), exact + part.exact
        return CorrectedWindow(out, out_dz, sums, exact)


def _corrected_part(dem: Dem, models: Models, halo: int) -> CorrectedWindow:
    """Correct a part of a window that stays in the processor's cache; `dem.number` counts within `models`."""
    z = dem.z
    moves = Moves(*(np.empty(z.shape, np.float32) for _ in range(3)))
    exact = _window_kernels.deform_window(dem, models, FIT_TOLERANCE_M, LARGEST_PATCH, moves)
    shape = z.shape[0] - 2 * halo, z.shape[1] - 2 * halo
    corrected = _resample_kernels.Corrected(np.empty(shape, z.dtype), np.empty(shape, np.float32), no_sums())
    tolerance = FIXED_POINT_TOLERANCE_M / np.abs(dem.place[[1, 3]])
    _resample_kernels.resample(z, moves, halo, tolerance, corrected)
    return CorrectedWindow(corrected.z, corrected.dz, corrected.sums, exact)


def dem_models(calibration: Adjustment, restitution: Restitution, names: tuple[tuple[str, str], ...]) -> DemModels:
    """The models of a DEM, by the names of their photographs (left, right).

    Raises
    ------
    InputError
        For a photograph that the block does not have, or that is not oriented.
    """
    places, block = places_of(calibration), calibration.local.block
    ground = float(np.nanmedian(calibration.local.points.xyz[:, 2]))
    rows, per_metre = [], []
    for left, right in names:
        model = pair_of(restitution, calibration, left, right)
        geometry = geometry_of(model, ground)
        per_metre.append(geometry.base_mm / geometry.height_m)
        rows.append([row_of_image(block, name) for name in (left, right)])
    # both photographs may be off
    tables = error_tables(restitution.errors, 0.5 * TABLE_TOLERANCE_M * min(per_metre))
    return DemModels(
        names, np.array(rows), restitution, tables, restitution.group[np.array(rows)], places, mean_ground(calibration),
        2.0 * tables.accuracy / min(per_metre),
    )  # fmt: skip


def no_sums() -> np.ndarray:
    """(N_SUMS,) of no cells at all."""
    sums = np.zeros(_resample_kernels.N_SUMS)
    sums[[6, 10, 12]], sums[[7, 11, 13]] = np.inf, -np.inf
    return sums


def added_sums(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Sums over two sets of cells."""
    both = one + other
    both[[6, 10, 12]] = np.minimum(one, other)[[6, 10, 12]]
    both[[7, 11, 13]] = np.maximum(one, other)[[7, 11, 13]]
    return both


def _renumbered(number: np.ndarray, chosen: np.ndarray, present: np.ndarray) -> np.ndarray:
    """Numbers counted within the chosen ones, which are `present`."""
    if len(chosen) == len(present) - 1:
        return number
    of_chosen = np.full(len(present), -1, np.int32)
    of_chosen[chosen] = np.arange(len(chosen))
    return of_chosen[number]
