"""The centre of a target near a place: where the picture is the same when it is turned by half a turn.

That is so of crosses, checkerboards, discs and rings, whatever their size and the direction they lie in; a quarter of a
turn tells which it is. The centre is found between the pixels: the picture and itself turned by half a turn are matched
by least squares, and lie apart by twice the distance to the centre.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates

CHECKERBOARD, CROSS = "checkerboard", "cross or disc"
HALVES_PX = (5, 8, 12, 18)
"""Half the sides of windows that are tried [C]: from small targets to large ones."""
LEAST_LIKENESS = 0.92
"""Correlation with itself turned by half a turn from which a place is a centre [C]: ground reaches 0.8."""
LEAST_QUARTER = 0.6
"""Of a quarter of a turn: below −this a checkerboard, above it a cross or a disc; in between no target [C]."""
LEAST_CONTRAST = 0.12
"""Standard deviation of a window over the range of the whole piece [C]."""
REFINEMENTS, STOP_PX = 12, 1e-4
FARTHEST_PX = 2.0
"""By which the refinement may leave the best pixel [C]."""


@dataclass(frozen=True)
class Target:
    """A target found.

    Parameters
    ----------
    place : column and row in the piece, px. kind : of the target. likeness : 0 … 1. sigma_px : of the place.
    """

    place: tuple[float, float]
    kind: str
    likeness: float
    sigma_px: float


def find_target(piece: np.ndarray, near: tuple[float, float], reach: float) -> Target | None:
    """The target whose centre lies near a place; None where there is none.

    Parameters
    ----------
    piece : (rows, columns) grey values, NaN beyond the photograph. near : column and row, px; (0, 0) the upper left
        corner of the upper left pixel. reach : px, how far the centre may be away.
    """
    # the largest window says most of what stands there; it fails where the ground around is no part of the target
    for half in reversed(HALVES_PX):
        place = _best_pixel(piece, near, reach, half)
        one = None if place is None else _refined(piece, place, half)
        if one is not None and np.hypot(one.place[0] - near[0], one.place[1] - near[1]) <= reach + 1.0:
            return one
    return None


def _best_pixel(piece: np.ndarray, near: tuple[float, float], reach: float, half: int) -> tuple[float, float] | None:
    """The middle of the pixel about which the window is most like itself turned."""
    best, least = None, LEAST_LIKENESS - 0.15
    spread = np.nanstd(piece) if np.isfinite(piece).any() else 0.0
    for row in range(int(near[1] - reach), int(near[1] + reach) + 1):
        for column in range(int(near[0] - reach), int(near[0] + reach) + 1):
            if min(row, column) < half or row + half >= piece.shape[0] or column + half >= piece.shape[1]:
                continue
            window = piece[row - half : row + half + 1, column - half : column + half + 1]
            if not np.isfinite(window).all() or window.std() < 0.3 * spread:
                continue
            like = _correlation(window, window[::-1, ::-1])
            if like > least:
                best, least = (column + 0.5, row + 0.5), like
    return best


def _refined(piece: np.ndarray, place: tuple[float, float], half: int) -> Target | None:
    """The centre between the pixels, and what stands there."""
    centre, sigma = np.array(place), np.inf
    for _ in range(REFINEMENTS):
        window = _window(piece, centre, half)
        step = None if window is None else _half_shift(window)
        if step is None:
            return None
        shift, sigma = step
        centre = centre + shift
        if np.abs(centre - place).max() > FARTHEST_PX:
            return None
        if np.abs(shift).max() < STOP_PX:
            break
    window = _window(piece, centre, half)
    if window is None or window.std() < LEAST_CONTRAST * np.ptp(piece[np.isfinite(piece)]):
        return None
    like, quarter = _correlation(window, window[::-1, ::-1]), _correlation(window, np.rot90(window))
    if like < LEAST_LIKENESS or abs(quarter) < LEAST_QUARTER:
        return None
    kind = CHECKERBOARD if quarter < 0.0 else CROSS
    return Target((float(centre[0]), float(centre[1])), kind, like, float(sigma))


def _window(piece: np.ndarray, centre: np.ndarray, half: int) -> np.ndarray | None:
    """(2·half + 1)² grey values about a place between the pixels; None beyond the edge."""
    offsets = np.arange(-half, half + 1.0)
    rows, columns = np.meshgrid(centre[1] - 0.5 + offsets, centre[0] - 0.5 + offsets, indexing="ij")
    if min(rows.min(), columns.min()) < 0 or rows.max() > piece.shape[0] - 1 or columns.max() > piece.shape[1] - 1:
        return None
    found = map_coordinates(piece, [rows, columns], order=3, mode="nearest")
    return found if np.isfinite(found).all() else None


def _half_shift(window: np.ndarray) -> tuple[np.ndarray, float] | None:
    """(2,) column and row by which the centre lies off the middle, half the shift to the window turned; and its σ."""
    turned = window[::-1, ::-1]
    by_row, by_column = (np.asarray(part) for part in np.gradient(0.5 * (window + turned)))
    inner = (slice(1, -1), slice(1, -1))
    a = np.column_stack([by_column[inner].ravel(), by_row[inner].ravel()])
    difference = (window - turned)[inner].ravel()
    normal = a.T @ a
    if np.linalg.cond(normal) > 50.0:
        return None
    # window(x) = picture(x − s), turned(x) = picture(−x − s) = picture(x + s): apart by 2·s
    shift = -np.linalg.solve(normal, a.T @ difference) / 2.0
    left = difference + 2.0 * a @ shift
    sigma0 = np.sqrt(left @ left / max(len(left) - 2, 1))
    return shift, float(sigma0 * np.sqrt(np.trace(np.linalg.inv(normal)) / 2.0) / 2.0)


def _correlation(first: np.ndarray, second: np.ndarray) -> float:
    a, b = first - first.mean(), second - second.mean()
    scale = np.sqrt((a * a).sum() * (b * b).sum())
    return float((a * b).sum() / scale) if scale > 0.0 else 0.0
