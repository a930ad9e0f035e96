"""σ of cells beside steps: they may have the height of the other side, and windows of the matching blur low steps.

Neither shows in the images that were matched: what they leave is small on the wrong side too. It shows in the heights
themselves: in steps, in how straight they are, and in pairs that contradict.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from aerotri.terrain.dense.cell_scale import CellScale, middle_height, square, sum_about

STEP_SHARE = 0.28
"""Of a step about a cell that is σ of the height, where it may be that of the other side: where few pairs agree on it,
and where steps next to the cell run in all directions, as crowns of trees have them. Chosen [C] with the rest of this
module on rendered houses, walls, trees and few photographs (tools/prove/dense_surface.py)."""
BETWEEN_SHARE = 0.2
"""Of a step next to a cell that is the most by which a height between both sides counts; chosen [C]."""
CROOKED, STRAIGHT, STRAIGHT_COUNTS = 0.4, 0.8, 0.1
"""Straightness up to which a step counts whole where several pairs agree, and from which on it counts a tenth: they
seldom all miss a long edge; chosen [C]."""
FLATTEST_PX, STEEPEST_PX = 0.01, 2.0
"""Of parallax from cell to cell: less is rounding; a higher step tells its direction no better."""
LEAST_STEP_PX, LEAST_NEXT_PX, LEAST_HIDDEN_PX = 0.9, 0.7, 0.5
"""Of parallax, from which on heights within a window of the matching differ by a step, how much of it has to be next to
a cell, and where a hole may hide the rest of it; chosen [C]."""
SEVERAL = 3
"""Pairs that agree on a height; chosen [C]: what they see alike is seldom the height of the other side."""
STEP_SIGMAS = 6.0
"""σ of the noise that a step is larger than: the range of some twenty cells reaches five."""
CONTRADICTED_SIGMAS = 4.0
"""σ of a pair from which on its height contradicts the surface."""
LEAST_OF_WINDOW = 0.25
"""Share of the cells about one, as far as a window of the matching reaches, at which a pair has to contradict the
surface for that to count; chosen [C]: matches by chance are patches of up to six cells of 25, a surface that other
photographs see is larger."""
UNKNOWN = np.float32(1e9)


@dataclass(frozen=True, eq=False)
class Seen:
    """What pairs saw in the cells, (rows, columns).

    Parameters
    ----------
    highest, lowest : m, of the height of a cell and those of pairs that contradict it or stand alone; −`UNKNOWN` and
        `UNKNOWN` where there is none.
    agreeing : pairs that agree on the height.
    """

    highest: np.ndarray
    lowest: np.ndarray
    agreeing: np.ndarray


def others_seen(z: np.ndarray, heights: np.ndarray, sigmas: np.ndarray, scale: CellScale) -> Seen:
    """What pairs saw besides the heights that count; what a pair has elsewhere in a few cells was matched by chance."""
    known = np.isfinite(z)
    highest, lowest = np.where(known, z, -UNKNOWN), np.where(known, z, UNKNOWN)
    agreeing = np.zeros(z.shape, np.uint8)
    for height, sigma in zip(heights, sigmas, strict=True):
        agrees = np.abs(height - z) <= scale.pixel + CONTRADICTED_SIGMAS * sigma
        other = np.isfinite(height) & ~agrees
        if other.any():
            size = scale.window, scale.window
            share = cv2.blur(200 * other.view(np.uint8), size, borderType=cv2.BORDER_CONSTANT)
            other &= share > 200 * LEAST_OF_WINDOW
        np.maximum(highest, height, out=highest, where=other)
        np.minimum(lowest, height, out=lowest, where=other)
        agreeing += agrees
    return Seen(highest, lowest, agreeing)


def step_sigma(z: np.ndarray, noise: np.ndarray, seen: Seen, scale: CellScale) -> np.ndarray:
    """(rows, columns) m, σ of a cell by the step that it lies beside; 0 where there is none.

    Two things are wrong beside steps. The height may be that of the other side: a share of the step, where few pairs
    agree on the height or the step is crooked. And a window across the step blurs it for all pairs: the height then
    lies between both sides, and its distance from the nearer one is σ.
    """
    known = np.isfinite(z)
    if not known.any():
        return np.zeros(z.shape)
    above = np.where(known, z - middle_height(z), 0.0).astype(np.float32)
    steps = _steps(z, above, noise, seen, scale)
    few = seen.agreeing < SEVERAL
    counts = np.where(few, 1.0, _crooked(above, known, scale) if steps.next_to.any() else 0.0)
    other_side = STEP_SHARE * np.maximum(counts * steps.next_to, steps.far)
    between = np.minimum(steps.between, BETWEEN_SHARE * steps.next_to)
    return np.where(known, np.hypot(other_side, between), 0.0)


def _crooked(above: np.ndarray, known: np.ndarray, scale: CellScale) -> np.ndarray:
    """(rows, columns) what of a step counts by how straight steps run about the cell, to 1 where they are crooked."""
    crooked = (STRAIGHT - straightness(above, known, scale)) / (STRAIGHT - CROOKED)
    return np.clip(crooked, STRAIGHT_COUNTS, 1.0)


def straightness(above: np.ndarray, known: np.ndarray, scale: CellScale) -> np.ndarray:
    """(rows, columns) 0 where steps run in all directions alike, to 1 where they run in one.

    The coherence of the structure tensor, over two windows of the matching, of the change of heights from cell to cell,
    less the slope of the ground.

    Parameters
    ----------
    above : (rows, columns) float32 m, heights; those not known do not count.
    """
    whole = cv2.erode(known.view(np.uint8), square(3)) > 0
    y, x = (
        cv2.Sobel(above, cv2.CV_32F, *order, ksize=3, scale=1.0 / (8.0 * scale.pixel)) - _median(change) / scale.pixel
        for order, change in zip(((0, 1), (1, 0)), _changes(above, known), strict=True)
    )
    change = np.hypot(x, y)
    weight = np.where(whole, np.minimum(change, STEEPEST_PX) / np.maximum(change, 1e-9), 0.0).astype(np.float32)
    x, y = x * weight, y * weight
    xx, xy, yy = (cv2.blur(product, (scale.around, scale.around)) for product in (x * x, x * y, y * y))
    return np.hypot(xx - yy, 2.0 * xy) / np.maximum(xx + yy, FLATTEST_PX**2)


@dataclass(frozen=True, eq=False)
class _Steps:
    """Steps about cells, (rows, columns) m, 0 where there is none.

    Parameters
    ----------
    next_to : next to the cell.
    far : within a window of the matching where few pairs agree on the height, or behind a hole.
    between : distance of the height from the nearer of the lowest and the highest within a window, everywhere.
    """

    next_to: np.ndarray
    far: np.ndarray
    between: np.ndarray


def _steps(z: np.ndarray, above: np.ndarray, noise: np.ndarray, seen: Seen, scale: CellScale) -> _Steps:
    """Steps about cells.

    A step is almost a pixel of parallax, from the lowest to the highest that any pair saw within a window of the
    matching. The mean of the cells around is taken off first, so that a slope is none. That mean holds a wall some
    cells away: no step is therefore larger than the range of the heights themselves, next to a cell plus the slope.
    A cell lies next to a step where a part of it is between its neighbours. Beside a hole, which may hide the step,
    half a pixel counts; where few pairs agree the range of heights over two windows, less the slope, counts there, and
    for a cell that one pair alone saw holes are looked for as far. Where several agree, no more than that half.

    Parameters
    ----------
    above : (rows, columns) float32 m, heights over their middle, 0 where not known.
    """
    known, middle = np.isfinite(z), middle_height(z)
    mean = sum_about(above, scale.around)
    mean = mean / np.maximum(sum_about(known.astype(np.float32), scale.around), 1.0) + middle
    left, whole = ((_less(seen.highest, level), _less(seen.lowest, level)) for level in (mean, middle))
    few, slope = seen.agreeing < SEVERAL, _slope(above, known)
    high, low = _about(*left, scale.window)
    between = np.maximum(np.minimum(high - (z - mean), (z - mean) - low), 0.0)
    within = np.minimum(high - low, _range(*whole, scale.window))
    side = 2 * ((scale.lag + 1) // 2) + 1
    next_to = np.minimum(_range(*left, side), _range(*whole, side) + (side - 1) * slope)
    over_two = _range(*whole, scale.around) - (scale.around - 1) * slope
    hidden = np.where(few, np.maximum(high - low, over_two), high - low)
    hidden[~_by_a_hole(known, seen, scale)] = 0.0

    for step, smallest in ((next_to, LEAST_NEXT_PX), (within, LEAST_STEP_PX), (hidden, LEAST_HIDDEN_PX)):
        step[(step <= smallest * scale.pixel) | (step <= STEP_SIGMAS * noise)] = 0.0
    next_to[within == 0.0] = 0.0
    far = np.where(few, np.maximum(within, hidden), np.minimum(hidden, LEAST_HIDDEN_PX * scale.pixel))
    return _Steps(next_to, far, between)


def _by_a_hole(known: np.ndarray, seen: Seen, scale: CellScale) -> np.ndarray:
    """(rows, columns) whether a hole is within a window of a cell, two of a cell that one pair alone saw."""
    near, further = (cv2.erode(known.view(np.uint8), square(side)) == 0 for side in (scale.window, scale.around))
    return near | (further & (seen.agreeing < 2))


def _slope(z: np.ndarray, known: np.ndarray) -> np.ndarray:
    """(rows, columns) float32 m, change of height from cell to cell, along rows and columns together.

    The median of a square of 5 × 5 cells, which a wall does not change.
    """
    along_columns, along_rows = (_median(np.abs(change)) for change in _changes(z, known))
    return along_columns + along_rows


def _changes(z: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(rows, columns) m, of heights to the next row, and to the next column; 0 where one of them is not known."""
    found = []
    for axis in (0, 1):
        if z.shape[axis] < 2:
            found.append(np.zeros(z.shape, np.float32))
            continue
        ahead, behind = (known[1:], known[:-1]) if axis == 0 else (known[:, 1:], known[:, :-1])
        change = np.diff(z, axis=axis) * (ahead & behind)
        found.append(np.concatenate([change, np.take(change, [-1], axis)], axis))
    return found[0], found[1]


def _median(values: np.ndarray) -> np.ndarray:
    """(rows, columns) float32, of a square of 5 × 5 cells."""
    return cv2.medianBlur(np.ascontiguousarray(values), 5)


def _less(values: np.ndarray, level: np.ndarray | float) -> np.ndarray:
    """(rows, columns) float32 m above a level; what is not known stays far beyond all heights."""
    return np.where(np.abs(values) < UNKNOWN, values - level, values).astype(np.float32)


def _range(high: np.ndarray, low: np.ndarray, side: int) -> np.ndarray:
    """(rows, columns) from the lowest to the highest of a square."""
    highest, lowest = _about(high, low, side)
    return highest - lowest


def _about(high: np.ndarray, low: np.ndarray, side: int) -> tuple[np.ndarray, np.ndarray]:
    """(rows, columns) the highest and the lowest of a square."""
    return cv2.dilate(high, square(side)), cv2.erode(low, square(side))
