"""Where a piece of ground lies in photographs, and which photographs show it: scalar kernels without objects.

A window is a square of posts on a plane piece of ground. Its corners are projected into a photograph with the image
errors of the tile that shows its middle, its posts lie bilinearly between them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerotri.compiled import kernel
from aerotri.functional_model._photo_kernels import (
    ErrorTable,
    delay,
    error_in_tile,
    project,
    project_at,
    scans,
    tile_of,
)

SMALLEST_ANGLE = 0.02
"""Base over height below which two photographs give no height."""
FIXED_POINT_MM, FIXED_POINT_STEPS = 1e-5, 40
"""Change, mm, at which measured = ideal + d is solved, and most steps; chosen [C]: 0.01 µm is a thousandth of a pixel,
and image errors that change little across the format converge in a few steps."""


class View(NamedTuple):
    """n photographs about a piece of ground, their pixels cut out.

    photos : (1, n, 23) as in `_photo_kernels`. source : (n,) image errors. errors : of all groups of photographs.
    sensor : (n, 3) half columns, half rows, pixels per mm. centres : (n, 3) m.
    crops : (n, 5) offset into pixels, first row, first column, rows, columns, of the level. pixels : (·,) uint16.
    scale : pixels of the level per pixel of the photograph. edge : share of the format at its edge not used.
    """

    photos: np.ndarray
    source: np.ndarray
    errors: ErrorTable
    sensor: np.ndarray
    centres: np.ndarray
    crops: np.ndarray
    pixels: np.ndarray
    scale: float
    edge: float


@kernel
def photo_place(view, k, i, j, x, y, z):
    """(column, row) px in photograph k, with the image errors of its tile (i, j); NaN behind the camera."""
    sensor = view.sensor
    ideal_x, ideal_y, u3 = project(view.photos, 0, k, x, y, z)
    if not u3 < 0.0:
        return np.nan, np.nan
    mx, my = ideal_x, ideal_y
    for _ in range(FIXED_POINT_STEPS):
        dx, dy = error_in_tile(view.source[k], i, j, mx, my, view.errors)
        change = abs(ideal_x + dx - mx) + abs(ideal_y + dy - my)
        mx, my = ideal_x + dx, ideal_y + dy
        if scans(view.photos, 0, k):
            ideal_x, ideal_y = project_at(view.photos, 0, k, delay(view.photos, 0, k, mx, my), x, y, z)
        if not change > FIXED_POINT_MM:
            break
    return sensor[k, 0] + mx * sensor[k, 2], sensor[k, 1] - my * sensor[k, 2]


@kernel
def is_seen(view, k, x, y, z):
    """Whether a place lies in the usable part of photograph k."""
    half, edge, source = view.errors.half, view.edge, view.source[k]
    ideal_x, ideal_y, u3 = project(view.photos, 0, k, x, y, z)
    if not u3 < 0.0:
        return False
    i, j = tile_of(source, ideal_x, ideal_y, view.errors.edges)
    column, row = photo_place(view, k, i, j, x, y, z)
    across = abs(column / view.sensor[k, 0] - 1.0)
    along = abs(row / view.sensor[k, 1] - 1.0)
    beyond = abs(ideal_x) > 3.0 * half[source, 0] or abs(ideal_y) > 3.0 * half[source, 1]
    return not beyond and across <= 1.0 - 2.0 * edge and along <= 1.0 - 2.0 * edge


@kernel
def corners_of(view, k, spot, away, side_u, side_v, corner):
    """Corners spot + away ± side_u ± side_v in the crop of photograph k, as of `window_corners`.

    away : x, y. side_u, side_v : x, y, z; m each.
    """
    sensor, crop, scale = view.sensor, view.crops[k], view.scale
    ux, uy, uz = side_u
    vx, vy, vz = side_v
    ideal_x, ideal_y, u3 = project(view.photos, 0, k, spot[0], spot[1], spot[2])
    if not u3 < 0.0:
        return False
    i, j = tile_of(view.source[k], ideal_x, ideal_y, view.errors.edges)
    for c in range(4):
        u, v = (1.0 if c & 1 else -1.0), (1.0 if c & 2 else -1.0)
        x, y = spot[0] + away[0] + u * ux + v * vx, spot[1] + away[1] + u * uy + v * vy
        column, row = photo_place(view, k, i, j, x, y, spot[2] + u * uz + v * vz)
        if not (0.0 <= column <= 2.0 * sensor[k, 0] and 0.0 <= row <= 2.0 * sensor[k, 1]):
            return False
        corner[c, 0], corner[c, 1] = column * scale - 0.5 - crop[2], row * scale - 0.5 - crop[1]
        if not (1.0 <= corner[c, 0] < crop[4] - 2.0 and 1.0 <= corner[c, 1] < crop[3] - 2.0):
            return False
    return True


@kernel
def window_corners(view, k, spot, reach, shift, corner):
    """Corners of a window in the crop of photograph k, (4, 2) column and row counted from its first pixel centre.

    Parameters
    ----------
    spot : (5,) x, y, z of the middle and the slopes of the ground. reach : m from the middle to a side.
    shift : (6,) m, plan displacement of the middle, and by which it changes along u and v over the reach.

    Returns
    -------
    Whether all of it lies in the crop.
    """
    side_u = reach + shift[2], shift[3], reach * spot[3]
    side_v = shift[4], reach + shift[5], reach * spot[4]
    return corners_of(view, k, spot, (shift[0], shift[1]), side_u, side_v, corner)


@kernel
def turned_corners(view, k, spot, e, along, across, corner):
    """As `window_corners` of a rectangle with sides along e and across it, ± those m from the middle."""
    ux, uy, vx, vy = along * e[0], along * e[1], -across * e[1], across * e[0]
    side_u = ux, uy, ux * spot[3] + uy * spot[4]
    side_v = vx, vy, vx * spot[3] + vy * spot[4]
    return corners_of(view, k, spot, (0.0, 0.0), side_u, side_v, corner)


@kernel
def parallax_per_metre(view, chosen, spot):
    """m of plan that the widest pair with the first photograph sees a metre of height as."""
    centres, widest = view.centres, 0.0
    a = chosen[0]
    ax = (spot[0] - centres[a, 0]) / (centres[a, 2] - spot[2])
    ay = (spot[1] - centres[a, 1]) / (centres[a, 2] - spot[2])
    for k in range(1, len(chosen)):
        b = chosen[k]
        if b >= 0:
            bx = (spot[0] - centres[b, 0]) / (centres[b, 2] - spot[2])
            by = (spot[1] - centres[b, 1]) / (centres[b, 2] - spot[2])
            widest = max(widest, np.hypot(bx - ax, by - ay))
    return widest


@kernel
def choose_photographs(view, nodes, candidates, most, chosen):
    """The photographs that show every node, those most upright over it first; −1 where there are fewer.

    nodes : (n, 3). candidates : (k,) photographs. chosen : (n, ≤ most) out.
    """
    centres = view.centres
    distance = np.empty(chosen.shape[1])
    for p in range(len(nodes)):
        count = 0
        for c in candidates:
            if not is_seen(view, c, nodes[p, 0], nodes[p, 1], nodes[p, 2]):
                continue
            away = np.hypot(nodes[p, 0] - centres[c, 0], nodes[p, 1] - centres[c, 1])
            at = count
            while at > 0 and distance[at - 1] > away:
                at -= 1
            if at >= most:
                continue
            last = min(count, most - 1)
            for q in range(last, at, -1):
                chosen[p, q], distance[q] = chosen[p, q - 1], distance[q - 1]
            chosen[p, at], distance[at] = c, away
            count = min(count + 1, most)
        for q in range(count, chosen.shape[1]):
            chosen[p, q] = -1


@kernel
def choose_models(view, nodes, pairs, middles, chosen, number):
    """The model nearest to every node of those whose photographs both show it; the nearer photograph comes first.

    pairs : (k, 2) photographs. middles : (k, 2) m, middles of their bases. chosen : (n, 2) out. number : (n,) out.
    """
    centres = view.centres
    for p in range(len(nodes)):
        number[p], nearest = -1, np.inf
        for k in range(len(pairs)):
            away = np.hypot(nodes[p, 0] - middles[k, 0], nodes[p, 1] - middles[k, 1])
            if (
                away < nearest
                and is_seen(view, pairs[k, 0], nodes[p, 0], nodes[p, 1], nodes[p, 2])
                and is_seen(view, pairs[k, 1], nodes[p, 0], nodes[p, 1], nodes[p, 2])
            ):
                number[p], nearest = k, away
        chosen[p, 0] = chosen[p, 1] = -1
        if number[p] >= 0:
            a, b = pairs[number[p], 0], pairs[number[p], 1]
            to_a = np.hypot(nodes[p, 0] - centres[a, 0], nodes[p, 1] - centres[a, 1])
            to_b = np.hypot(nodes[p, 0] - centres[b, 0], nodes[p, 1] - centres[b, 1])
            chosen[p, 0], chosen[p, 1] = (a, b) if to_a <= to_b else (b, a)
