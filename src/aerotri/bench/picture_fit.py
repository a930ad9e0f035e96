"""An ideal picture of a target fitted to a photograph: the eight unknowns of its perspective, contrast and brightness.

The middle of the target follows from all its edges at once, and is its middle under perspective too.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import map_coordinates

ITERATIONS, STOP = 30, 1e-4
BLUR_PX = 0.7
"""Of an edge in a photograph [C]: the pixel and the lens."""
SOFTER = (3.0, 1.0)
"""Times the blur: soft edges are found from farther away."""
FEWEST_PX = 60


@dataclass(frozen=True)
class Fitted:
    """A picture fitted.

    Parameters
    ----------
    place : (2,) column and row of the middle, px. sigma_px : of it. likeness : correlation of picture and photograph.
    corners : (4, 2) px of what was compared. transform : (3, 3) from the picture to the photograph.
    """

    place: np.ndarray
    sigma_px: float
    likeness: float
    corners: np.ndarray
    transform: np.ndarray


def fit_picture(piece: np.ndarray, picture: np.ndarray, transform: np.ndarray, margin: float) -> Fitted | None:
    """The picture where it lies in a piece of a photograph; None where it does not.

    Parameters
    ----------
    piece : (rows, columns) grey values. picture : (s, s) ideal grey values.
    transform : (3, 3) nearly, from the picture to the piece, both with (0, 0) at the upper left corner.
    margin : px of the picture at its edges that is not compared.
    """
    found: Fitted | None = None
    for softer in SOFTER:
        found = _fitted(piece, picture, transform, margin, softer)
        if found is None:
            return None
        # what lies beside the target is left out where it is now known to lie
        transform = found.transform
    return found


def _fitted(
    piece: np.ndarray, picture: np.ndarray, transform: np.ndarray, margin: float, softer: float
) -> Fitted | None:
    """One adjustment, of the pixels that the picture covers at its beginning."""
    side = len(picture)
    end = side - margin
    inner = np.array([[margin, margin], [end, margin], [end, end], [margin, end]])
    rows, columns = _inside(piece, _mapped(transform, inner))
    if len(rows) < FEWEST_PX or not np.isfinite(piece[rows, columns]).all():
        return None
    grey, xy = piece[rows, columns], np.column_stack([columns + 0.5, rows + 0.5])
    middle = _mapped(transform, np.full((1, 2), side / 2))[0]
    reach, scale = np.abs(xy - middle).max(), side / 2
    # unknowns near 1: both frames are centred and of size 1
    there = np.array([[reach, 0, middle[0]], [0, reach, middle[1]], [0, 0, 1]])
    here = np.array([[scale, 0, scale], [0, scale, scale], [0, 0, 1]])
    h = np.linalg.inv(here) @ np.linalg.inv(transform) @ there
    h /= h[2, 2]
    blur = softer * BLUR_PX * scale / reach * float(np.sqrt(abs(np.linalg.det(h[:2, :2]))))
    soft = cv2.GaussianBlur(picture.astype(np.float32), (0, 0), max(blur, 0.5)).astype(float)
    found = _adjusted(soft, grey, (xy - middle) / reach, h)
    if found is None or abs(np.linalg.det(found[0])) < 1e-9:
        return None
    h, cofactor, sigma0, likeness = found
    back = there @ np.linalg.inv(h) @ np.linalg.inv(here)
    place = _mapped(back, np.full((1, 2), side / 2))[0]
    if not np.isfinite(place).all() or np.abs(place - middle).max() > 0.5 * reach:
        return None
    at = (place - middle) / reach
    by_h = -np.linalg.solve(_by_place(h, at), _by_unknowns(h, at[None])[0]) * reach
    sigma = sigma0 * float(np.sqrt(np.trace(by_h @ cofactor[:8, :8] @ by_h.T) / 2.0))
    return Fitted(place, sigma, likeness, _mapped(back, inner), back / back[2, 2])


def _adjusted(
    soft: np.ndarray, grey: np.ndarray, xy: np.ndarray, start: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float, float] | None:
    """Perspective (3, 3) from photograph to picture, cofactors, σ0 in grey values, correlation."""
    by_row, by_column = (np.asarray(part) for part in np.gradient(soft))
    h, half = start.copy(), len(soft) / 2
    normal, value, left = np.eye(10), grey, grey
    for _ in range(ITERATIONS):
        uv = _mapped(h, xy)
        at = [half * (uv[:, 1] + 1.0) - 0.5, half * (uv[:, 0] + 1.0) - 0.5]
        value, du, dv = (map_coordinates(one, at, order=1, mode="nearest") for one in (soft, by_column, by_row))
        design = np.column_stack([value, np.ones(len(value))])
        level, *_ = np.linalg.lstsq(design, grey, rcond=None)
        slopes = level[0] * half * np.column_stack([du, dv])
        by_h = np.einsum("nk,nkj->nj", slopes, _by_unknowns(h, xy))
        full = np.column_stack([by_h, design])
        normal = full.T @ full
        if not np.isfinite(normal).all() or np.linalg.cond(normal) > 1e14:
            return None
        left = grey - design @ level
        step = np.linalg.solve(normal, full.T @ left)
        h = h + np.append(step[:8], 0.0).reshape(3, 3)
        if np.abs(step[:8]).max() < STOP:
            break
    sigma0 = float(np.sqrt(left @ left / max(len(left) - 10, 1)))
    with np.errstate(invalid="ignore", divide="ignore"):
        likeness = float(np.corrcoef(value, grey)[0, 1])
    return (h, np.linalg.inv(normal), sigma0, likeness) if np.isfinite(likeness) else None


def _by_unknowns(h: np.ndarray, xy: np.ndarray) -> np.ndarray:
    """(n, 2, 8) partials of the mapped places by the first eight elements of h."""
    one = np.column_stack([xy, np.ones(len(xy))])
    below = one @ h[2]
    uv, out = (one @ h[:2].T) / below[:, None], np.zeros((len(xy), 2, 8))
    out[:, 0, 0:3] = out[:, 1, 3:6] = one / below[:, None]
    out[:, :, 6:8] = -uv[:, :, None] * xy[:, None, :] / below[:, None, None]
    return out


def _by_place(h: np.ndarray, xy: np.ndarray) -> np.ndarray:
    """(2, 2) partials of a mapped place by the place."""
    one = np.append(xy, 1.0)
    below = one @ h[2]
    uv = h[:2] @ one / below
    return (h[:2, :2] - uv[:, None] * h[2, None, :2]) / below


def _mapped(h: np.ndarray, xy: np.ndarray) -> np.ndarray:
    """(n, 2) places under a perspective."""
    with np.errstate(divide="ignore", invalid="ignore"):
        out = np.column_stack([xy, np.ones(len(xy))]) @ h.T
        return out[:, :2] / out[:, 2:]


def _inside(piece: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the pixels within four corners; none where these leave the piece."""
    nothing = np.zeros(0, dtype=np.int64)
    low, high = corners.min(axis=0), corners.max(axis=0)
    if not np.isfinite(corners).all() or (low < 0).any() or (high > piece.shape[::-1]).any():
        return nothing, nothing
    mask = np.zeros(piece.shape, dtype=np.uint8)
    cv2.fillConvexPoly(mask, np.round(corners - 0.5).astype(np.int32), 1)
    rows, columns = np.nonzero(mask)
    return rows, columns
