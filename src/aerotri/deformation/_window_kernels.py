"""The deformation of every cell of a DEM, wrong − true: scalar kernels without checks or objects.

Patches of cells that lie in few models and in one tile of either photograph of each get it from a fit; where the worst
cells of a patch are off by more than a tolerance it is quartered, in the end down to exact cells.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerotri.compiled import kernel
from aerotri.deformation._exact_kernels import deformation
from aerotri.deformation._patch_kernels import OFF, ONE_TILE, Fit, Lines, Patch, fill_patch, fit_patch, tile_case

SMALLEST_PATCH, MODELS_IN_PATCH = 4, 3
"""Cells along a patch that is not halved, models of a patch [C]. A fit takes 17 exact deformations, about as many
as the 4 × 4 cells of the smallest patch."""


class Square(NamedTuple):
    """A patch of cells: its first row, the row after its last, the same of columns."""

    row: int
    last_row: int
    column: int
    last_column: int


@kernel
def patch_extremes(dem, square, lines, heights):
    """Lowest and highest height of a patch into heights (2,), ∞ and −∞ without data; whether it lies in one model.

    Column by column in rows of their own, which the processor does many at a time.
    """
    z, number, lows, highs = dem.z, dem.number, lines.lows, lines.highs
    row, last_row, column, last_column = square.row, square.last_row, square.column, square.last_column
    n = last_column - column
    for j in range(n):
        lows[j], highs[j] = np.inf, -np.inf
    m, differ = number[row, column], 0
    for i in range(row, last_row):
        cells, models = z[i, column:last_column], number[i, column:last_column]
        for j in range(n):
            # a comparison with NaN is false
            lows[j] = cells[j] if cells[j] < lows[j] else lows[j]
            highs[j] = cells[j] if cells[j] > highs[j] else highs[j]
        for j in range(n):
            differ |= models[j] ^ m
    heights[0], heights[1] = np.inf, -np.inf
    for j in range(n):
        heights[0], heights[1] = min(heights[0], lows[j]), max(heights[1], highs[j])
    return differ == 0


@kernel
def find_models(number, square, present):
    """The models of a patch into present; how many, or one more than there is room for."""
    n = 0
    for i in range(square.row, square.last_row):
        for j in range(square.column, square.last_column):
            m, known = number[i, j], number[i, j] < 0
            for k in range(n):
                known |= present[k] == m
            if not known:
                if n == len(present):
                    return n + 1
                present[n] = m
                n += 1
    return n


@kernel
def blank_patch(box, moves):
    """No deformation in a patch: NaN."""
    for i in range(int(box[0]), int(box[1]) + 1):
        for j in range(int(box[2]), int(box[3]) + 1):
            moves.du[i, j] = moves.dv[i, j] = moves.dz[i, j] = np.nan


@kernel
def deform_patch(dem, models, tolerance, patch, whole, room, moves):
    """The deformation of a patch by a fit for each of its models; False where one of them does not fit.

    whole : all cells of the patch are in its one model. room : a `Fit` and `Lines`.
    """
    fit, lines = room
    wide = min(patch.box[1] - patch.box[0], patch.box[3] - patch.box[2]) >= 2
    for m in patch.present:
        case = tile_case(models, m, dem.place, patch)
        if case == OFF:
            if whole:
                blank_patch(patch.box, moves)
            continue
        if case != ONE_TILE or not wide:
            return False
        if not fit_patch(dem, models, m, patch, tolerance, fit):
            return False
        fill_patch(dem, m, whole, patch.box, fit, lines, moves)
    return True


@kernel
def deform_cells(dem, models, square, moves):
    """The exact deformation at every cell of a patch; returns how many have one."""
    number, place, exact = dem.number, dem.place, 0
    for i in range(square.row, square.last_row):
        for j in range(square.column, square.last_column):
            m = number[i, j]
            height = dem.z[i, j]
            if m < 0 or height != height:
                moves.du[i, j] = moves.dv[i, j] = moves.dz[i, j] = np.nan
                continue
            d = deformation(models, m, place[0] + place[1] * j, place[2] + place[3] * i, height)
            moves.du[i, j], moves.dv[i, j] = d[0] / place[1], d[1] / place[3]
            moves.dz[i, j] = d[2]
            exact += 1
    return exact


@kernel
def deform_window(dem, models, tolerance, largest, moves):
    """The deformation of all cells of a window; returns how many of them were computed one by one.

    Parameters
    ----------
    tolerance : m, of the fit. largest : cells along the side of a patch to begin with, a power of two.
    moves : out.
    """
    z, number = dem.z, dem.number
    rows, columns = z.shape
    fit = Fit(np.empty((4, 3, 3)), np.empty((2, 3)), np.empty((4, 3, 3)))
    box, heights, present = np.empty(4), np.empty(2), np.empty(MODELS_IN_PATCH, np.int64)
    lines = Lines(
        np.empty(largest, z.dtype), np.empty(largest, z.dtype), np.empty(largest, moves.du.dtype),
        np.empty(largest, moves.du.dtype), np.empty(largest, moves.dz.dtype),
    )  # fmt: skip
    stack = np.empty((256, 3), np.int64)
    exact = 0
    for first_row in range(0, rows, largest):
        for first_column in range(0, columns, largest):
            stack[0, 0], stack[0, 1], stack[0, 2] = first_row, first_column, largest
            top = 1
            while top > 0:
                top -= 1
                row, column, size = stack[top, 0], stack[top, 1], stack[top, 2]
                last_row, last_column = min(row + size, rows), min(column + size, columns)
                box[0], box[1], box[2], box[3] = row, last_row - 1, column, last_column - 1
                square = Square(row, last_row, column, last_column)
                uniform = patch_extremes(dem, square, lines, heights)
                present[0], n = number[row, column], 1
                if heights[0] > heights[1] or (uniform and present[0] < 0):
                    n = 0
                elif not uniform:
                    n = find_models(number, square, present)
                if n == 0 or not uniform:
                    blank_patch(box, moves)
                if n == 0:
                    continue
                if n <= len(present):
                    patch = Patch(box, heights, present[:n])
                    if deform_patch(dem, models, tolerance, patch, uniform, (fit, lines), moves):
                        continue
                if size > SMALLEST_PATCH:
                    size //= 2
                    for i in range(row, last_row, size):
                        for j in range(column, last_column, size):
                            stack[top, 0], stack[top, 1], stack[top, 2] = i, j, size
                            top += 1
                    continue
                exact += deform_cells(dem, models, square, moves)
    return exact
