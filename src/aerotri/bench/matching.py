"""A place matched with another photograph by least squares: shift, affine distortion, brightness and contrast [L]."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import map_coordinates

HALF_PX = 12
"""Half the side of the window of the other photograph."""
LEAST_CORRELATION = 0.7
"""Below it a match is none [C]."""
ITERATIONS, STOP_PX = 25, 1e-3
WORST_SIGMA_PX = 0.35
MOST_BENDING = 0.5
"""Change of the affine part at which a match has gone astray [C]."""


@dataclass(frozen=True)
class Match:
    """A place matched.

    Parameters
    ----------
    place : (2,) column and row in the piece, px. correlation : of the windows. sigma_px : of the place.
    """

    place: np.ndarray
    correlation: float
    sigma_px: float


def match(piece: np.ndarray, near: np.ndarray, template: np.ndarray, affine: np.ndarray, reach: int) -> Match | None:
    """The place in a piece of a photograph that shows the middle of a window of another one.

    Parameters
    ----------
    piece : (rows, columns) grey values, NaN beyond the photograph. near : (2,) column and row in it, px.
    template : (2h + 1, 2h + 1) grey values, the middle of the window being the place.
    affine : (2, 2) offsets in the piece per offset in the template. reach : px of the template, how far to look.
    """
    if not np.isfinite(template).all() or template.std() <= 0.0:
        return None
    start = _searched(piece, near, template, affine, reach)
    return None if start is None else _refined(piece, start, template, affine)


def _searched(
    piece: np.ndarray, near: np.ndarray, template: np.ndarray, affine: np.ndarray, reach: int
) -> np.ndarray | None:
    """Where correlation is largest, in whole pixels of the template."""
    half = template.shape[0] // 2 + reach
    around = _sampled(piece, near, affine, half)
    if around is None:
        return None
    score = cv2.matchTemplate(around.astype(np.float32), template.astype(np.float32), cv2.TM_CCOEFF_NORMED)
    row, column = np.unravel_index(int(np.argmax(score)), score.shape)
    if score[row, column] < LEAST_CORRELATION - 0.15:
        return None
    return near + affine @ np.array([column - reach, row - reach], dtype=float)


def _refined(piece: np.ndarray, start: np.ndarray, template: np.ndarray, affine: np.ndarray) -> Match | None:
    """Six geometric and two radiometric unknowns."""
    half = template.shape[0] // 2
    place, bend = start.copy(), affine.copy()
    offsets = np.arange(-half, half + 1.0)
    v, u = (one.ravel() for one in np.meshgrid(offsets, offsets, indexing="ij"))
    sigma = correlation = np.nan
    for _ in range(ITERATIONS):
        window = _sampled(piece, place, bend, half)
        if window is None:
            return None
        gy, gx = np.gradient(window)
        a, b = gx.ravel(), gy.ravel()
        grey = window.ravel()
        design = np.column_stack([a, b, a * u, a * v, b * u, b * v, grey, np.ones(len(grey))])
        difference = template.ravel() - grey
        normal = design.T @ design
        if not np.isfinite(normal).all() or np.linalg.cond(normal) > 1e14:
            return None
        unknowns = np.linalg.solve(normal, design.T @ difference)
        left = difference - design @ unknowns
        sigma0 = np.sqrt(left @ left / (len(left) - 8))
        sigma = sigma0 * np.sqrt(np.trace(np.linalg.inv(normal)[:2, :2]) / 2.0)
        correlation = float(np.corrcoef(grey, template.ravel())[0, 1])
        step = bend @ unknowns[:2]
        place, bend = place + step, bend @ (np.eye(2) + unknowns[2:6].reshape(2, 2))
        if np.abs(step).max() < STOP_PX:
            break
    bent = np.abs(np.linalg.solve(affine, bend) - np.eye(2)).max()
    astray = np.abs(place - start).max() > half or bent > MOST_BENDING
    if astray or not correlation >= LEAST_CORRELATION or not sigma <= WORST_SIGMA_PX:
        return None
    return Match(place, correlation, float(sigma))


def sampled_window(piece: np.ndarray, place: np.ndarray) -> np.ndarray | None:
    """(2h + 1, 2h + 1) grey values about a place between the pixels, h = `HALF_PX`; None beyond the edge."""
    return _sampled(piece, place, np.eye(2), HALF_PX)


def _sampled(piece: np.ndarray, place: np.ndarray, affine: np.ndarray, half: int) -> np.ndarray | None:
    """(2·half + 1)² grey values at affine offsets from a place; None beyond the edge."""
    offsets = np.arange(-half, half + 1.0)
    v, u = np.meshgrid(offsets, offsets, indexing="ij")
    columns = place[0] - 0.5 + affine[0, 0] * u + affine[0, 1] * v
    rows = place[1] - 0.5 + affine[1, 0] * u + affine[1, 1] * v
    if min(rows.min(), columns.min()) < 0 or rows.max() > piece.shape[0] - 1 or columns.max() > piece.shape[1] - 1:
        return None
    found = map_coordinates(piece, [rows, columns], order=1, mode="nearest")
    return found if np.isfinite(found).all() else None
