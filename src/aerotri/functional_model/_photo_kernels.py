"""Photographs as kernels take them: projection with its partials, and image errors from tables over tiles.

photos : (M, 4, 23) or (1, n, 23); the last index is U (3, 4) row by row with u = U·(x, y, z, 1), then c, x0, y0 in mm;
then of a rolling shutter velocity (3) m/s, rates of rotation (3) rad/s and s per mm along x and y (2): a ray at (x, y)
is exposed τ = s·(x, y) after the middle of the readout, and u is (I − [ω]×·τ)·(u − v·τ); zeros without
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerotri.compiled import kernel


class ErrorTable(NamedTuple):
    """Image errors of S groups of photographs, bilinear between nodes over each tile.

    half : (S, 2) mm, half the format. edges : (S, 2, 2) mm, x and y of the seams, rising, ∞ where there is none.
    meta : (S, 3, 3, 7) of every tile (column, row from below): offset into values, nodes along x and y, x and y of the
        first node, nodes per mm along x and y. values : (·,) mm, dx and dy at the nodes.
    """

    half: np.ndarray
    edges: np.ndarray
    meta: np.ndarray
    values: np.ndarray


@kernel
def tile_of(s, x, y, edges):
    """Column and row from below of the tile that holds a position in a photograph with image errors s."""
    i = int(x >= edges[s, 0, 0]) + int(x >= edges[s, 0, 1])
    j = int(y >= edges[s, 1, 0]) + int(y >= edges[s, 1, 1])
    return i, j


@kernel
def error_in_tile(s, i, j, x, y, table):
    """(dx, dy) mm of a tile at a measured position; beyond the tile it goes on straight."""
    meta, values = table.meta, table.values
    nx, ny = int(meta[s, i, j, 1]), int(meta[s, i, j, 2])
    fx, fy = (x - meta[s, i, j, 3]) * meta[s, i, j, 5], (y - meta[s, i, j, 4]) * meta[s, i, j, 6]
    kx, ky = min(max(int(fx), 0), nx - 2), min(max(int(fy), 0), ny - 2)
    fx, fy = fx - kx, fy - ky
    low = int(meta[s, i, j, 0]) + 2 * (ky * nx + kx)
    high = low + 2 * nx
    low_x = values[low] + fx * (values[low + 2] - values[low])
    low_y = values[low + 1] + fx * (values[low + 3] - values[low + 1])
    high_x = values[high] + fx * (values[high + 2] - values[high])
    high_y = values[high + 1] + fx * (values[high + 3] - values[high + 1])
    return low_x + fy * (high_x - low_x), low_y + fy * (high_y - low_y)


@kernel
def image_error(s, x, y, table):
    """(dx, dy) mm at a measured position in a photograph with image errors s."""
    i, j = tile_of(s, x, y, table.edges)
    return error_in_tile(s, i, j, x, y, table)


@kernel
def scans(photos, m, k):
    """Whether photograph k of model m has a rolling shutter."""
    return photos[m, k, 21] != 0.0 or photos[m, k, 22] != 0.0


@kernel
def delay(photos, m, k, x, y):
    """s after the middle of the readout, at which a ray measured at (x, y) mm is exposed."""
    return photos[m, k, 21] * x + photos[m, k, 22] * y


@kernel
def when_exposed(photos, m, k, tau, u1, u2, u3):
    """u of a point, tau s after the middle of the readout."""
    p1, p2, p3 = u1 - photos[m, k, 15] * tau, u2 - photos[m, k, 16] * tau, u3 - photos[m, k, 17] * tau
    t1, t2, t3 = photos[m, k, 18] * tau, photos[m, k, 19] * tau, photos[m, k, 20] * tau
    return p1 - t2 * p3 + t3 * p2, p2 - t3 * p1 + t1 * p3, p3 - t1 * p2 + t2 * p1


@kernel
def in_scan(photos, m, k, u1, u2, u3):
    """u of a point when its row is exposed; the row is that of the ideal position, found in two steps [C]: they leave
    less than a thousandth of a pixel of some ten."""
    v1, v2, v3 = u1, u2, u3
    for _ in range(2):
        scale = -photos[m, k, 12] / v3
        tau = delay(photos, m, k, photos[m, k, 13] + scale * v1, photos[m, k, 14] + scale * v2)
        v1, v2, v3 = when_exposed(photos, m, k, tau, u1, u2, u3)
    return v1, v2, v3


@kernel
def project(photos, m, k, x, y, z):
    """(x, y) mm in photograph k of model m, and u3, which is negative in front of the camera."""
    u1 = photos[m, k, 0] * x + photos[m, k, 1] * y + photos[m, k, 2] * z + photos[m, k, 3]
    u2 = photos[m, k, 4] * x + photos[m, k, 5] * y + photos[m, k, 6] * z + photos[m, k, 7]
    u3 = photos[m, k, 8] * x + photos[m, k, 9] * y + photos[m, k, 10] * z + photos[m, k, 11]
    if scans(photos, m, k):
        u1, u2, u3 = in_scan(photos, m, k, u1, u2, u3)
    scale = -photos[m, k, 12] / u3
    return photos[m, k, 13] + scale * u1, photos[m, k, 14] + scale * u2, u3


@kernel
def project_at(photos, m, k, tau, x, y, z):
    """(x, y) mm of a point in photograph k of model m, tau s after the middle of the readout."""
    u1 = photos[m, k, 0] * x + photos[m, k, 1] * y + photos[m, k, 2] * z + photos[m, k, 3]
    u2 = photos[m, k, 4] * x + photos[m, k, 5] * y + photos[m, k, 6] * z + photos[m, k, 7]
    u3 = photos[m, k, 8] * x + photos[m, k, 9] * y + photos[m, k, 10] * z + photos[m, k, 11]
    if tau != 0.0:
        u1, u2, u3 = when_exposed(photos, m, k, tau, u1, u2, u3)
    scale = -photos[m, k, 12] / u3
    return photos[m, k, 13] + scale * u1, photos[m, k, 14] + scale * u2


@kernel
def partials(photos, m, k, x, y, z):
    """Partials of x, then of y, in photograph k of model m by the point."""
    u1 = photos[m, k, 0] * x + photos[m, k, 1] * y + photos[m, k, 2] * z + photos[m, k, 3]
    u2 = photos[m, k, 4] * x + photos[m, k, 5] * y + photos[m, k, 6] * z + photos[m, k, 7]
    u3 = photos[m, k, 8] * x + photos[m, k, 9] * y + photos[m, k, 10] * z + photos[m, k, 11]
    if scans(photos, m, k):
        u1, u2, u3 = in_scan(photos, m, k, u1, u2, u3)
    inverse = -1.0 / u3
    a, b, f = u1 * inverse, u2 * inverse, photos[m, k, 12] * inverse
    v0, v1, v2 = photos[m, k, 8], photos[m, k, 9], photos[m, k, 10]
    return (
        f * (photos[m, k, 0] + a * v0), f * (photos[m, k, 1] + a * v1), f * (photos[m, k, 2] + a * v2),
        f * (photos[m, k, 4] + b * v0), f * (photos[m, k, 5] + b * v1), f * (photos[m, k, 6] + b * v2),
    )  # fmt: skip
