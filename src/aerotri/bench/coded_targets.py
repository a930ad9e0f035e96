"""Coded targets in a piece of a photograph: found by their outlines, read, and confirmed by the picture they must show.

A number is told only where the whole ideal picture of its target fits what is seen.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from aerotri.bench.code_tables import (
    MODULE_PX,
    RING_BITS,
    Code,
    number_of,
    ring_codes,
    ring_picture,
    square_codes,
    square_picture,
)
from aerotri.bench.picture_fit import Fitted, fit_picture

LEAST_LIKENESS = 0.95
"""Correlation with the ideal picture from which a number is believed [C]: texture that passes for a code has less."""
CLEARLY_LESS = 0.7
"""Share of the variance that the second best picture leaves, at most left by the best [C]: ArUco and AprilTag have
squares in common, and two rings of few segments look alike."""
SIDES = (4, 5, 6, 7)
BLOCKS_PX = (15, 31, 61)
"""Neighbourhoods of the threshold."""
SMALLEST_PX, WORST_SIGMA_PX = 10.0, 0.3
MOST_OFF, MEAN_OFF = 0.25, 0.12
"""By which an outline may leave an ellipse, of its radius: at most, and on average."""
ROUGHLY = 0.25
"""Besides, where the ellipse is only that of the moments of the outline."""
LEAST_CONTRAST = 25.0
"""Grey values between black and white of a target, of 255 [C]."""
LEAST_CLEAR = -0.3
"""Distance of the segments of a ring from half grey, less their spread, from which it is a candidate [C]: rings of both
families have to be candidates, so that the better picture decides."""
SAMPLES = 24
"""Places along a segment of a ring at which it is read."""


@dataclass(frozen=True)
class CodedTarget:
    """A target with a number.

    Parameters
    ----------
    family, number : what it says. place : (2,) column and row of its middle, px. sigma_px : of it.
    corners : (4, 2) px, what it covers.
    """

    family: str
    number: int
    place: np.ndarray
    sigma_px: float
    corners: np.ndarray

    def covers(self, place: np.ndarray) -> bool:
        """Whether a place (2,) px lies on it."""
        outline = self.corners.astype(np.float32)
        return cv2.pointPolygonTest(outline, (float(place[0]), float(place[1])), False) >= 0


def find_coded(piece: np.ndarray) -> tuple[CodedTarget, ...]:
    """The coded targets of a piece.

    Parameters
    ----------
    piece : (rows, columns) grey values, NaN beyond the photograph.
    """
    known = np.isfinite(piece)
    if not known.any() or np.ptp(piece[known]) <= 0.0:
        return ()
    low, high = np.percentile(piece[known], [0.5, 99.5])
    grey = np.clip((np.where(known, piece, low) - low) * (255.0 / max(high - low, 1e-9)), 0, 255).astype(np.uint8)
    filled = np.where(known, piece, np.nan)
    found: list[CodedTarget] = []
    for contour, is_round in _contours(grey):
        if any(one.covers(contour.mean(axis=0)) for one in found):
            continue
        readings = [*_square_readings(grey, contour), *(_ring_readings(grey, contour) if is_round else ())]
        one = _best(filled, readings) if readings else None
        found += [] if one is None else [one]
    return tuple(found)


Reading = tuple[Code, np.ndarray, np.ndarray, float]
"""A code, its ideal picture, the perspective from it to the piece, and the margin that is not compared."""


def _best(piece: np.ndarray, readings: list[Reading]) -> CodedTarget | None:
    """The reading whose picture fits; None where none does, or two do about as well."""
    fitting: dict[tuple[str, int], Fitted] = {}
    for code, picture, transform, margin in readings:
        one = fit_picture(piece, picture, transform, margin)
        if one is not None and one.likeness >= LEAST_LIKENESS and one.sigma_px <= WORST_SIGMA_PX:
            fitting[code.family, code.number] = one
    ranked = sorted(fitting.items(), key=lambda pair: -pair[1].likeness)
    left = [1.0 - one.likeness**2 for _, one in ranked]
    if not ranked or (len(left) > 1 and left[0] > CLEARLY_LESS * left[1]):
        return None
    (family, number), one = ranked[0]
    return CodedTarget(family, number, one.place, one.sigma_px, one.corners)


def _contours(grey: np.ndarray) -> Iterator[tuple[np.ndarray, bool]]:
    """(n, 2) px, outlines of what is darker or brighter than its surroundings, the largest first, and whether round."""
    every: list[tuple[np.ndarray, bool]] = []
    for block in BLOCKS_PX:
        if block >= min(grey.shape):
            continue
        for kind in (cv2.THRESH_BINARY, cv2.THRESH_BINARY_INV):
            black = cv2.adaptiveThreshold(grey, 255, cv2.ADAPTIVE_THRESH_MEAN_C, kind, block, 5)
            found, _ = cv2.findContours(black, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
            lines = [line for line in found if len(line) >= 2 * SMALLEST_PX]
            every += zip(lines, _are_round(lines).tolist(), strict=True) if lines else []
    every.sort(key=lambda one: len(one[0]), reverse=True)
    for line, is_round in every:
        yield line[:, 0].astype(float) + 0.5, is_round


def _are_round(lines: list[np.ndarray]) -> np.ndarray:
    """(n,) bool, whether outlines may be ellipses: every place about as far from the middle as it is on average.

    Distances are in the ellipse that the second moments of the outline give, so that any ellipse is a circle. Looked at
    for all outlines at once: photographs of grass have a million of them, and an ellipse takes long to fit.
    """
    count = np.array([len(line) for line in lines])
    first = np.concatenate([[0], np.cumsum(count)[:-1]])
    away = np.concatenate(lines)[:, 0].astype(float)
    away -= np.repeat(np.add.reduceat(away, first) / count[:, None], count, axis=0)
    x, y = away.T
    xx, xy, yy = (np.add.reduceat(product, first) / count for product in (x * x, x * y, y * y))
    flat = np.maximum(xx * yy - xy * xy, 1e-9)
    a, b, c = (np.repeat(part, count) for part in (yy / flat, xy / flat, xx / flat))
    # of a circle of radius 1 the moments are one half
    off = np.abs(np.sqrt(np.maximum(a * x * x - 2.0 * b * x * y + c * y * y, 0.0) / 2.0) - 1.0)
    # half the smaller axis: twice the smaller moment is its square
    smaller = np.sqrt(4.0 * flat / (xx + yy + np.sqrt((xx - yy) ** 2 + 4.0 * xy * xy)))
    largest, mean = np.maximum.reduceat(off, first), np.add.reduceat(off, first) / count
    # an ellipse of 4 : 1 is off by .25 because its places are closest together where it is flattest
    return (largest <= np.maximum(MOST_OFF, 3.0 / (2.0 * smaller)) + ROUGHLY) & (mean <= MEAN_OFF + ROUGHLY / 2.0)


def _square_readings(grey: np.ndarray, contour: np.ndarray) -> Iterator[Reading]:
    """What a square says, where the outline is one."""
    if len(contour) < 4.0 * SMALLEST_PX / np.sqrt(2.0) - 2.0:  # as many places has one that stands on its corner
        return
    line = contour.astype(np.float32).reshape(-1, 1, 2)
    corners = cv2.approxPolyDP(line, 0.05 * cv2.arcLength(line, True), True).reshape(-1, 2).astype(float)
    if len(corners) != 4 or not cv2.isContourConvex(corners.astype(np.float32).reshape(-1, 1, 2)):
        return
    sides = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    if sides.min() < SMALLEST_PX or sides.max() > 3.0 * sides.min():
        return
    if np.linalg.det(np.array([corners[1] - corners[0], corners[2] - corners[0]])) < 0.0:
        corners = corners[::-1]
    for side in SIDES:
        for code in _read_square(grey, corners, side):
            # the corner that is the upper left one of the printed target
            turned = np.roll(corners, code.turn, axis=0).astype(np.float32)
            edge = (side + 3) * MODULE_PX
            ideal = np.array([[MODULE_PX, MODULE_PX], [edge, MODULE_PX], [edge, edge], [MODULE_PX, edge]], np.float32)
            transform = cv2.getPerspectiveTransform(ideal, turned)
            yield code, square_picture(code.family, code.number), transform, 0.4 * MODULE_PX


def _read_square(grey: np.ndarray, corners: np.ndarray, side: int) -> tuple[Code, ...]:
    """Codes of the bits within a black frame."""
    modules, fine = side + 2, 8
    edge = np.float32(modules * fine)
    there = np.array([[0, 0], [edge, 0], [edge, edge], [0, edge]], np.float32)
    flat = cv2.warpPerspective(
        grey, cv2.getPerspectiveTransform((corners - 0.5).astype(np.float32), there - np.float32(0.5)),
        (modules * fine, modules * fine),
    )  # fmt: skip
    inner = flat.reshape(modules, fine, modules, fine)[:, 2:-2, :, 2:-2].mean(axis=(1, 3))
    low, high = inner.min(), inner.max()
    if high - low < LEAST_CONTRAST:
        return ()
    bits = inner > 0.5 * (low + high)
    frame = bits.copy()
    frame[1:-1, 1:-1] = False
    # an outline a pixel off takes in a white module of a small target
    return () if frame.any() else square_codes(side).get(number_of(bits[1:-1, 1:-1].ravel()), ())


def _ring_readings(grey: np.ndarray, contour: np.ndarray) -> Iterator[Reading]:
    """What the ring about a disc says, where the outline is an ellipse."""
    if len(contour) < 12 or len(contour) > 400:
        return
    (x, y), (width, height), turn = cv2.fitEllipse(contour.astype(np.float32))
    if min(width, height) < 4.0 or max(width, height) > 4.0 * min(width, height):
        return
    angle = np.radians(turn)
    axes = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) * [width / 2, height / 2]
    # the outline runs through the middles of the outermost pixels
    off = np.linalg.norm(np.linalg.solve(axes, (contour - (x, y)).T), axis=0)
    if np.abs(off - 1.0).max() > max(MOST_OFF, 3.0 / min(width, height)) or np.abs(off - 1.0).mean() > MEAN_OFF:
        return
    axes = axes @ np.linalg.inv(_rotation(angle)) * (1.0 + 0.5 / np.sqrt(width * height / 4))
    middle = np.array([x, y])
    inner = _along(grey, middle, axes, (0.0, 0.4), 24)
    gap, ring = _along(grey, middle, axes, (1.45, 1.6), 120), _along(grey, middle, axes, (2.4, 2.5, 2.6), 24 * 84)
    if inner is None or gap is None or ring is None:
        return
    bright, dark = float(inner.mean()), float(gap.mean())
    if abs(bright - dark) < LEAST_CONTRAST or np.abs(gap - dark).max() > 0.5 * abs(bright - dark):
        return
    level = np.clip((ring - dark) / (bright - dark), 0.0, 1.0)
    for bits in RING_BITS:
        yield from _read_ring(level, bits, middle, axes, np.sign(bright - dark))


def _read_ring(level: np.ndarray, bits: int, middle: np.ndarray, axes: np.ndarray, sign: float) -> Iterator[Reading]:
    """Codes of grey values 0 … 1 about a disc, wherever the first segment begins."""
    count = len(level) // bits
    shifts = np.arange(0, count, max(count // SAMPLES, 1))
    turned = [np.roll(level, -shift).reshape(bits, count)[:, count // 5 : -count // 5] for shift in shifts.tolist()]
    clear = [float(np.abs(one.mean(axis=1) - 0.5).min() - one.std(axis=1).max()) for one in turned]
    best = int(np.argmax(clear))
    if clear[best] <= LEAST_CLEAR:
        return
    code = ring_codes(bits).get(number_of(turned[best].mean(axis=1) > 0.5))
    if code is None:
        return
    # the segment at which the printed code begins
    begin = 2.0 * np.pi * (shifts[best] / len(level) - code.turn / bits)
    linear = axes @ _rotation(begin) / MODULE_PX
    shift = middle - linear @ np.full(2, 4.0 * MODULE_PX)
    transform = np.vstack([np.column_stack([linear, shift]), [0.0, 0.0, 1.0]])
    picture = ring_picture(bits, code.number)
    yield code, picture if sign > 0 else 1.0 - picture, transform, 0.85 * MODULE_PX


def _along(
    grey: np.ndarray, middle: np.ndarray, axes: np.ndarray, radii: tuple[float, ...], count: int
) -> np.ndarray | None:
    """(count,) grey values around an ellipse, clockwise, the mean over its multiples; None beyond the piece."""
    angle = 2.0 * np.pi * (np.arange(count) + 0.5) / count
    circle = np.stack([np.cos(angle), np.sin(angle)])
    xy = np.stack([axes @ (radius * circle) + middle[:, None] for radius in radii])
    rows, columns = xy[:, 1] - 0.5, xy[:, 0] - 0.5
    if min(rows.min(), columns.min()) < 0 or rows.max() > grey.shape[0] - 1 or columns.max() > grey.shape[1] - 1:
        return None
    found = cv2.remap(grey, columns.astype(np.float32), rows.astype(np.float32), cv2.INTER_LINEAR)
    return found.astype(float).mean(axis=0)


def _rotation(angle: float) -> np.ndarray:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
