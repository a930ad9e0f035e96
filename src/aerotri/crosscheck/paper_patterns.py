"""Systematic image errors as the papers print them, written anew for the cross-check.

Nothing here comes from `functional_model`: what both say alike is said twice, independently. All patterns are the image
error per unit of a parameter, mm, at the measured position.
"""

from __future__ import annotations

import numpy as np

BLUH_ITEMS = tuple(str(number) for number in range(1, 13))
"""Numbers of the general additional parameters [P]."""
ULTRACAM_ITEMS = tuple(str(number) for number in range(42, 74))
"""Numbers of the special additional parameters of the UltraCamD [P]."""

# tiles of the UltraCamD in its own pixels, 11500 across the flight and 7500 along it, counted from the upper left
SENSOR_ACROSS, SENSOR_ALONG = 11500.0, 7500.0
TILE_COLUMNS, TILE_ROWS = (2004.0, 5750.0, 9496.0), (1336.0, 3750.0, 6164.0)
"""Middles of the tiles, px: tiles of 4008 × 2672 px that begin every 3746 columns and 2414 rows [L]."""
SEAM_COLUMNS, SEAM_ROWS = (3877.0, 7623.0), (2543.0, 4957.0)
"""Middles of the overlaps of the tiles, 262 and 258 px wide, px: a point belongs to one tile only [D]."""


def bluh(x: np.ndarray, y: np.ndarray, r_max: float) -> np.ndarray:
    """Parameters 1–12 of BLUH [P: Spreckels, Schlienkamp, Jacobsen, Table 1].

    Parameters
    ----------
    x, y : (m,) mm from the image centre. r_max : mm, half diagonal of the format.

    Returns
    -------
    (m, 2, 12) mm.
    """
    # the constants are those of a film of 23 cm: everything is scaled to its half diagonal of 162.6 mm and back
    enlargement = 115.0 * 2.0**0.5 / r_max
    u, v = enlargement * x, enlargement * y
    r, b = np.sqrt(u * u + v * v), np.arctan2(v, u)
    along_radius = [np.cos(2.0 * b), np.sin(2.0 * b), np.cos(b), np.sin(b)]
    across_radius = [r * np.cos(b), r * np.sin(b)]
    symmetric = [r**2 - 16384.0, np.sin(r * np.pi / 64.0), np.sin(r * np.pi / 32.0), np.sin(4.0 * b)]
    columns = [(-v, -u), (-u, v)]
    columns += [(-u * factor, -v * factor) for factor in along_radius]
    columns += [(v * factor, -u * factor) for factor in across_radius]
    columns += [(-u * factor, -v * factor) for factor in symmetric]
    return np.stack([np.stack(column, axis=-1) for column in columns], axis=-1) / enlargement


def ultracam_d(x: np.ndarray, y: np.ndarray, format_mm: tuple[float, float], flight_axis: str) -> np.ndarray:
    """Parameters 42–73 of BLUH: scale, shift x, shift y and rotation of the eight outer tiles of an UltraCamD [P].

    Parameters
    ----------
    x, y : (m,) mm from the image centre. format_mm : width and height of the format.
    flight_axis : image axis along the flight, '+x', '-x', '+y' or '-y'.

    Returns
    -------
    (m, 2, 32) mm.
    """
    along = {"+x": (1.0, 0.0), "-x": (-1.0, 0.0), "+y": (0.0, 1.0), "-y": (0.0, -1.0)}[flight_axis]
    across = (along[1], -along[0])
    pixel = max(format_mm) / SENSOR_ACROSS
    column = (x * across[0] + y * across[1]) / pixel + SENSOR_ACROSS / 2.0
    row = SENSOR_ALONG / 2.0 - (x * along[0] + y * along[1]) / pixel
    tile_column = (column >= SEAM_COLUMNS[0]).astype(int) + (column >= SEAM_COLUMNS[1])
    tile_row = (row >= SEAM_ROWS[0]).astype(int) + (row >= SEAM_ROWS[1])
    to_right = (column - np.array(TILE_COLUMNS)[tile_column]) * pixel
    upwards = (np.array(TILE_ROWS)[tile_row] - row) * pixel
    one, zero = np.ones_like(to_right), np.zeros_like(to_right)
    effects = [(to_right, upwards), (one, zero), (zero, one), (-upwards, to_right)]
    patterns = np.zeros((len(x), 2, 32))
    outer_tiles = [(i, j) for i in range(3) for j in range(3) if (i, j) != (1, 1)]
    for number, (i, j) in enumerate(outer_tiles):
        inside = (tile_row == i) & (tile_column == j)
        for kind, (right, up) in enumerate(effects):
            patterns[inside, 0, 8 * kind + number] = (right * across[0] + up * along[0])[inside]
            patterns[inside, 1, 8 * kind + number] = (right * across[1] + up * along[1])[inside]
    return patterns


def brown(
    x_bar: np.ndarray,
    y_bar: np.ndarray,
    k1: np.ndarray,
    k2: np.ndarray,
    k3: np.ndarray,
    p1: np.ndarray,
    p2: np.ndarray,
    b1: np.ndarray,
    b2: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Image error (dx, dy) of Brown's parameters in Fraser's form, d = −Δ [L: Fraser 1997].

    Parameters
    ----------
    x_bar, y_bar : mm from the principal point; all arguments broadcast, and may be complex.
    """
    r2 = x_bar**2 + y_bar**2
    radial = k1 * r2 + k2 * r2**2 + k3 * r2**3
    dx = x_bar * radial + p1 * (r2 + 2.0 * x_bar**2) + 2.0 * p2 * x_bar * y_bar + b1 * x_bar + b2 * y_bar
    dy = y_bar * radial + p2 * (r2 + 2.0 * y_bar**2) + 2.0 * p1 * x_bar * y_bar
    return -dx, -dy


def equidistant(u1: np.ndarray, u2: np.ndarray, u3: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Position in an ideal fisheye for c = 1 of a direction (u1, u2, u3): the angle θ to −u3 away from the axis.

    θ = 2·arctan(r/(R − u3)) with r² = u1² + u2², R² = r² + u3²; all arguments broadcast, and may be complex.
    """
    r = np.sqrt(u1**2 + u2**2 + np.finfo(float).tiny)
    theta = 2.0 * np.arctan(r / (np.sqrt(r**2 + u3**2) - u3))
    return theta * u1 / r, theta * u2 / r


def forward_lens(a: np.ndarray, b: np.ndarray, *lens: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distorted position (a', b') of an ideal one, as OpenCV, COLMAP and Metashape have it [L].

    Parameters
    ----------
    a, b : for c = 1; all arguments broadcast, and may be complex.
    lens : k1, k2, p1, p2, k3, k4, then q1, q2, q3 of the denominator, sx, sy, b1, b2.
    """
    k1, k2, p1, p2, k3, k4, q1, q2, q3, sx, sy, b1, b2 = lens
    r2 = a**2 + b**2
    radial = (1.0 + k1 * r2 + k2 * r2**2 + k3 * r2**3 + k4 * r2**4) / (1.0 + q1 * r2 + q2 * r2**2 + q3 * r2**3)
    a_bent = a * radial + 2.0 * p1 * a * b + p2 * (r2 + 2.0 * a**2) + sx * r2
    b_bent = b * radial + 2.0 * p2 * a * b + p1 * (r2 + 2.0 * b**2) + sy * r2
    return a_bent + b1 * a_bent + b2 * b_bent, b_bent
