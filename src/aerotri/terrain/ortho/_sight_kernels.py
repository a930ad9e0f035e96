"""Where cells of the ground lie in photographs, and whether the surface hides them: scalar kernels without objects.

All coordinates are Δ of a `Site`, m. A cell is hidden where the ray from it to the projection centre goes below the
surface; the surface is bilinear between the centres of its cells.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerotri.compiled import kernel, leaf_kernel
from aerotri.functional_model._photo_kernels import project, tile_of
from aerotri.terrain._view_kernels import photo_place

BLOCK = 16
"""Cells of a block of `Obstacles.highest` along each side; chosen [C]: rays leave the surface after some ten cells."""
CLEAR_CELLS = 0.2
"""Height in cells of the surface by which a ray may go below it [C]: what a raster cannot tell, seen within the cell
next to the one meant."""
FIRST_STEP = 0.5
"""Of a ray, in cells of the surface [C]."""
NEARLY_ALIKE = 0.003
"""Difference of the heights of four centres over the height of the camera above, up to which places between them are
bilinear; [D] at p pixels from the nadir a share d leaves d²·p/4: 0.01 pixel at 4500."""


class Obstacles(NamedTuple):
    """A window of the surface.

    z : (r, c) m, NaN where not known. origin : (2,) m, x and y of the first cell's centre. cell : (2,) m, along x and
    (downwards) along y. highest : (·, ·) m, highest cell of every block of `BLOCK` and of its eight neighbours.
    top : m, of all. clear : m, by which a ray may go below.
    """

    z: np.ndarray
    origin: np.ndarray
    cell: np.ndarray
    highest: np.ndarray
    top: float
    clear: float


class Cells(NamedTuple):
    """Cells of the ground: z (r, c) m, NaN for none; origin (2,) m of the first centre; cell m."""

    z: np.ndarray
    origin: np.ndarray
    cell: float


class Centres(NamedTuple):
    """Two rows of centres of the surface, as one photograph shows them.

    state : (2, c) int64, 1 seen, 0 not, −1 not looked at yet. place : (2, c, 2) px, column and row. held : (2,) int64,
    which rows of the surface they are.
    """

    state: np.ndarray
    place: np.ndarray
    held: np.ndarray


def centres_for(obstacles):
    """Room for the centres of a surface."""
    columns = obstacles.z.shape[1]
    return Centres(np.empty((2, columns), np.int64), np.empty((2, columns, 2)), np.empty(2, np.int64))


@kernel
def highest_of_blocks(z, out):
    """The highest cell of every block of a surface (r, c) and its eight neighbours; −∞ where nothing is known."""
    rows, columns = z.shape
    single = np.full(out.shape, -np.inf)
    for i in range(rows):
        for j in range(columns):
            if z[i, j] > single[i // BLOCK, j // BLOCK]:
                single[i // BLOCK, j // BLOCK] = z[i, j]
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            top = -np.inf
            for k in range(max(i - 1, 0), min(i + 2, out.shape[0])):
                for m in range(max(j - 1, 0), min(j + 2, out.shape[1])):
                    top = max(top, single[k, m])
            out[i, j] = top


@leaf_kernel
def surface_heights(obstacles, cells):
    """Heights of the cells, bilinear between the four centres around; NaN where one of these is not known."""
    z, out = obstacles.z, cells.z
    rows, columns = z.shape
    for i in range(out.shape[0]):
        v = (obstacles.origin[1] - (cells.origin[1] - i * cells.cell)) / obstacles.cell[1]
        for j in range(out.shape[1]):
            u = (cells.origin[0] + j * cells.cell - obstacles.origin[0]) / obstacles.cell[0]
            out[i, j] = np.nan
            if u > -1e-6 and v > -1e-6 and u < columns - 1 + 1e-6 and v < rows - 1 + 1e-6:
                c, r = min(max(int(u), 0), columns - 2), min(max(int(v), 0), rows - 2)
                s, t = u - c, v - r
                top = z[r, c] + s * (z[r, c + 1] - z[r, c])
                low = z[r + 1, c] + s * (z[r + 1, c + 1] - z[r + 1, c])
                out[i, j] = top + t * (low - top)


@leaf_kernel
def is_hidden(obstacles, x, y, z, cx, cy, cz):
    """Whether the surface stands between a place and a projection centre."""
    surface = obstacles.z
    rows, columns = surface.shape
    u = (x - obstacles.origin[0]) / obstacles.cell[0]
    v = (obstacles.origin[1] - y) / obstacles.cell[1]
    du = (cx - x) / obstacles.cell[0]
    dv = (y - cy) / obstacles.cell[1]
    length = max(abs(du), abs(dv))
    if not length > FIRST_STEP:
        return False
    du, dv, rise = du / length, dv / length, (cz - z) / length
    t = FIRST_STEP
    while t < length:
        height = z + t * rise + obstacles.clear
        a, b = u + t * du, v + t * dv
        if height > obstacles.top or not (a >= 0.0 and b >= 0.0 and a < columns - 1 and b < rows - 1):
            return False
        c, r = int(a), int(b)
        if obstacles.highest[r // BLOCK, c // BLOCK] < height:
            t += BLOCK
            continue
        f, g = a - c, b - r
        top = surface[r, c] + f * (surface[r, c + 1] - surface[r, c])
        low = surface[r + 1, c] + f * (surface[r + 1, c + 1] - surface[r + 1, c])
        if top + g * (low - top) > height:
            return True
        t += 1.0
    return False


@leaf_kernel
def place_of(view, k, x, y, z):
    """(column, row) px of a place in photograph k, image errors and all; NaN where it is not in its usable part."""
    half, edge, source = view.errors.half, view.edge, view.source[k]
    ideal_x, ideal_y, u3 = project(view.photos, 0, k, x, y, z)
    if not u3 < 0.0 or abs(ideal_x) > 2.0 * half[source, 0] or abs(ideal_y) > 2.0 * half[source, 1]:
        return np.nan, np.nan
    i, j = tile_of(source, ideal_x, ideal_y, view.errors.edges)
    column, row = photo_place(view, k, i, j, x, y, z)
    across = abs(column / view.sensor[k, 0] - 1.0)
    along = abs(row / view.sensor[k, 1] - 1.0)
    if across <= 1.0 - 2.0 * edge and along <= 1.0 - 2.0 * edge:
        return column, row
    return np.nan, np.nan


@leaf_kernel
def _seen_from(view, k, obstacles, m, n, cx, cy, cz, place):
    """1 where photograph k sees the centre (m, n) of the surface, 0 where not; (2,) its place out."""
    x = obstacles.origin[0] + n * obstacles.cell[0]
    y = obstacles.origin[1] - m * obstacles.cell[1]
    z = obstacles.z[m, n]
    place[0], place[1] = place_of(view, k, x, y, z)
    return 0 if np.isnan(place[0]) or is_hidden(obstacles, x, y, z, cx, cy, cz) else 1


@leaf_kernel
def look(view, k, cells, obstacles, wanted, centres, column, row):
    """Places in photograph k of the cells wanted, out; NaN of those that it does not see, and of all others.

    Between four centres of the surface that are seen, and nearly alike in height, the place is bilinear as the height
    is; cells between others are looked at one by one.

    wanted : (r, c) bool. centres : room, of `Centres`. column, row : (r, c) float32 px out.
    """
    cx, cy, cz = view.centres[k]
    rows, columns = obstacles.z.shape
    state, place, held = centres
    held[:] = -1
    for i in range(cells.z.shape[0]):
        y = cells.origin[1] - i * cells.cell
        v = (obstacles.origin[1] - y) / obstacles.cell[1]
        r = min(max(int(v), 0), rows - 2)
        t = v - r
        for one in (r, r + 1):
            if held[one & 1] != one:
                held[one & 1] = one
                state[one & 1, :] = -1
        for j in range(cells.z.shape[1]):
            column[i, j], row[i, j] = np.nan, np.nan
            z = cells.z[i, j]
            if not wanted[i, j] or np.isnan(z):
                continue
            x = cells.origin[0] + j * cells.cell
            u = (x - obstacles.origin[0]) / obstacles.cell[0]
            c = min(max(int(u), 0), columns - 2)
            seen, low, high = 0, np.inf, -np.inf
            for corner in range(4):
                m, n = r + (corner >> 1), c + (corner & 1)
                if state[m & 1, n] < 0:
                    state[m & 1, n] = _seen_from(view, k, obstacles, m, n, cx, cy, cz, place[m & 1, n])
                seen += state[m & 1, n]
                low, high = min(low, obstacles.z[m, n]), max(high, obstacles.z[m, n])
            if seen == 0:
                continue
            if seen == 4 and high - low < NEARLY_ALIKE * (cz - high):
                s = u - c
                top, bottom = place[r & 1], place[(r + 1) & 1]
                for axis in range(2):
                    above = top[c, axis] + s * (top[c + 1, axis] - top[c, axis])
                    below = bottom[c, axis] + s * (bottom[c + 1, axis] - bottom[c, axis])
                    if axis == 0:
                        column[i, j] = above + t * (below - above)
                    else:
                        row[i, j] = above + t * (below - above)
                continue
            a, b = place_of(view, k, x, y, z)
            if not np.isnan(a) and not is_hidden(obstacles, x, y, z, cx, cy, cz):
                column[i, j], row[i, j] = a, b


@leaf_kernel
def offer(view, k, number, cells, obstacles, gsd, found, cost, column, row):
    """Enter photograph k, the number-th of the block, where it is among the best that see a cell.

    The cost is tan²ν + (g/gsd)², ν the angle of the ray off the vertical, g m a pixel at the cell along the axis of the
    camera: what an error of the height does, and what the size of a pixel does.

    Parameters
    ----------
    gsd : m, that a pixel is held against.
    found : (q, r, c) int32 numbers of photographs, the best first, −1 for none; cost, column, row : theirs; in and out.
    """
    cx, cy, cz = view.centres[k]
    per_mm, c = view.sensor[k, 2], view.photos[0, k, 12]
    for i in range(cells.z.shape[0]):
        y = cells.origin[1] - i * cells.cell
        for j in range(cells.z.shape[1]):
            z = cells.z[i, j]
            if np.isnan(z):
                continue
            x = cells.origin[0] + j * cells.cell
            a, b = place_of(view, k, x, y, z)
            if np.isnan(a):
                continue
            u3 = project(view.photos, 0, k, x, y, z)[2]
            pixel = -u3 / (c * per_mm * gsd)
            own = ((x - cx) ** 2 + (y - cy) ** 2) / (cz - z) ** 2 + pixel * pixel
            at = len(found) - 1
            if found[at, i, j] >= 0 and cost[at, i, j] <= own:
                continue
            if is_hidden(obstacles, x, y, z, cx, cy, cz):
                continue
            while at > 0 and (found[at - 1, i, j] < 0 or cost[at - 1, i, j] > own):
                found[at, i, j], cost[at, i, j] = found[at - 1, i, j], cost[at - 1, i, j]
                column[at, i, j], row[at, i, j] = column[at - 1, i, j], row[at - 1, i, j]
                at -= 1
            found[at, i, j], cost[at, i, j], column[at, i, j], row[at, i, j] = number, own, a, b
