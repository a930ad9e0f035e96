"""Parallaxes of an epipolar pair: semi-global matching, then the shift of windows by least squares.

The matching of OpenCV (Hirschmüller 2008) finds them to a part of a pixel with a bias towards whole ones. The right
image is therefore resampled by the parallaxes found, smoothed where they are continuous, and what is left in a window
between the two is solved for with gain, offset and the shift across the base. That one changes slowly but for noise: it
tells how much larger the noise is than its formal σ.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from aerotri.terrain.dense import spline
from aerotri.terrain.dense._refinement_kernels import HALF, keep_seen, shift_windows
from aerotri.terrain.dense._resampling_kernels import align, move_rows
from aerotri.terrain.dense._smoothing_kernels import smooth
from aerotri.terrain.dense.across_base import median_across, parabola_across, scatter_across
from aerotri.terrain.dense.epipolar import EpipolarImages
from aerotri.terrain.dense.scratch import scratch

BLOCK_PX = 5
"""Side of a block of the semi-global matching; chosen [C]: the middle of the 3 to 11 that OpenCV's manual names."""
SMALL_STEP, LARGE_STEP = 8 * BLOCK_PX**2, 32 * BLOCK_PX**2
"""Penalty of a change of parallax by one pixel, and by more: those that OpenCV's manual recommends."""
CLIPPED_GRADIENT = 63
"""Largest gradient that counts in a match."""
UNIQUE_PERCENT = 5
"""By which the best match must be better than the second: the least OpenCV's manual recommends."""
BOTH_WAYS_PX = 1
"""Largest difference of left-to-right and right-to-left."""
SPECKLE_PX, SPECKLE_STEP = 100, 2
"""Pixels of a patch of its own parallax below which it is taken out, and the step that bounds it; the manual's."""
WINDOW_PX = 2 * HALF + 1
"""Side of the windows of least squares; chosen [C]; other sides were not compared."""
SMOOTHED_STEP_PX, SMOOTHED_PX = 0.7, 2.5
"""σ of the weights by which parallaxes are smoothed, in parallax and in place; chosen [C]."""
ROUNDS = 2
"""Of least squares; a third moves the medians of synthetic pairs by less than .01 px."""
SHARE_OF_SHIFT = 0.85
"""Of the shift of a window that is taken; chosen [C]: differences of pixels two apart see a wave number ω with
sin ω / ω of its slope [D], so that shifts come out a fifth too large for the texture of rendered photographs. A third
round would do as well and take longer; smoother texture asks for less and loses a fiftieth in two rounds."""
LARGEST_SHIFT_PX = 1.5
"""By which least squares may move a parallax of the semi-global matching; chosen [C]: that is within a pixel of it, and
half of one on noise."""
LARGEST_ACROSS_PX, ACROSS_SIGMAS = 1.0, 2.0
"""Shift across the base at which it is no match of this pair, and σ of the shift besides; chosen [C]: twice what the
orientation of a drone flight was seen to leave. A window with edges along the base tells little of it."""
LEAST_CORRELATION = 0.2
"""Correlation of a window below which it counts as not matched; chosen [C]: what is not alike is in σ already, so that
errors over σ of rendered scenes are as with 0.5; of water twice as much is measured."""
CROWD_PX, LEAST_ALIKE = 41, 0.42
"""Side of the square about a pixel, and the mean correlation of the windows in it (0 where nothing matched) for the
pixel to count; chosen [C]: semi-global matching finds matches in noise by themselves whose windows are alike by .6,
but over a square of fine noise the mean stays below .42 in all but a thousandth."""
ALONE_POWER, LEAST_SHARE = 2.0, 0.1
"""Power of the share of its window that matches by which σ of a pixel is divided, and the least share; chosen [C]: so
errors at the rim of glass, of water and of photographs are within σ (tools/prove/dense_surface.py)."""
LEAST_SIGMA_PX = 0.01
"""σ of a parallax is never stated smaller; chosen [C]: interpolation between pixels leaves that even without noise."""
LARGEST_SIGMA_PX = 1.0
"""σ of a parallax at which nothing is known."""
INVALID = -1e4
BAND_ROWS = 64
"""Rows worked together where one array after the other is filled; chosen [C]: 300 kB of an array."""


@dataclass(frozen=True, eq=False)
class Parallaxes:
    """Of the pixels of a left epipolar image, beyond those known before; NaN where nothing is known.

    Parameters
    ----------
    value, sigma : (rows, columns) px.
    across : px, median shift across the base. factor : of the formal σ, as the shifts across the base have it.
    """

    value: np.ndarray
    sigma: np.ndarray
    across: float
    factor: float


def parallaxes_of(images: EpipolarImages) -> Parallaxes:
    """Match a pair.

    Coarse levels are treated as the finest: the tests of least squares take out what matched by chance, in water and
    leaves, which would make the range of heights too wide for the finest level to find anything.
    """
    value = semi_global(images)
    unknown = np.isnan(value)
    cv2.patchNaNs(value, INVALID)
    value = cv2.medianBlur(value, 3)
    np.copyto(value, INVALID, where=unknown)
    return _refined(images, value)


def semi_global(images: EpipolarImages) -> np.ndarray:
    """(rows, columns) float32 px, NaN where nothing matches: what OpenCV gives."""
    g = images.geometry
    matcher = cv2.StereoSGBM.create(
        minDisparity=g.lowest, numDisparities=g.count, blockSize=BLOCK_PX, P1=SMALL_STEP, P2=LARGE_STEP,
        disp12MaxDiff=BOTH_WAYS_PX, preFilterCap=CLIPPED_GRADIENT, uniquenessRatio=UNIQUE_PERCENT,
        speckleWindowSize=SPECKLE_PX, speckleRange=SPECKLE_STEP, mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    )  # fmt: skip
    found = matcher.compute(_bytes(images.left), _bytes(images.right))
    out = np.empty(found.shape, np.float32)
    keep_seen(found, g.lowest, images.left_known, images.right_known, out)
    return out


def _bytes(grey: np.ndarray) -> np.ndarray:
    return cv2.convertScaleAbs(np.maximum(grey, 0.0, out=scratch.take(1, grey.shape)[0]))


def _refined(images: EpipolarImages, value: np.ndarray) -> Parallaxes:
    known = value > INVALID / 2
    left, right = images.left, images.right
    aligned, start, shift, across, variance, of_across, correlation, room, moved = scratch.take(9, value.shape)
    start[:] = value
    slow = left_slow = np.zeros(6)
    for _ in range(ROUNDS):
        value = _smoothed(value, known)
        if slow.any():
            move_rows(images.right, slow, images.geometry.lowest + 0.5 * images.geometry.count, moved)
            right = moved
        align(spline.along_rows(right, room), value, known, left, aligned)
        level = np.float32(aligned.mean())
        shift_windows(left, aligned, level, known, shift, across, variance, of_across, correlation)
        for rows in _bands(len(value)):
            _move(value[rows], shift[rows], known[rows], room[rows])
        left_slow = parabola_across(across, of_across, known)
        slow = slow + left_slow
    factor = scatter_across(across, of_across, known, left_slow)
    most = (ACROSS_SIGMAS * factor) ** 2
    for rows in _bands(len(value)):
        moved_by = np.subtract(value[rows], start[rows], out=room[rows])
        known[rows] &= np.abs(moved_by, out=moved_by) < LARGEST_SHIFT_PX
        known[rows] &= correlation[rows] > LEAST_CORRELATION
        of_across[rows] *= most
        of_across[rows] += LARGEST_ACROSS_PX**2
        known[rows] &= np.square(across[rows], out=across[rows]) < of_across[rows]
    known &= _alike_about(correlation, known, images.left_known) > LEAST_ALIKE
    sigma = _sigma(variance, known, factor)
    known &= sigma < LARGEST_SIGMA_PX
    for one in (value, sigma):
        np.copyto(one, np.nan, where=~known)
    return Parallaxes(value, sigma, median_across(slow, known), factor)


def _bands(rows: int) -> list[slice]:
    """Rows that are worked together: what is done to them one after the other stays in the processor's memory."""
    return [slice(first, first + BAND_ROWS) for first in range(0, rows, BAND_ROWS)]


def _move(value: np.ndarray, shift: np.ndarray, known: np.ndarray, room: np.ndarray) -> None:
    """Parallaxes by their shifts; those that move too far are known no more."""
    known &= np.abs(shift, out=room) < LARGEST_SHIFT_PX
    shift *= np.float32(SHARE_OF_SHIFT)
    value += shift
    np.copyto(value, INVALID, where=~known)


def _sigma(variance: np.ndarray, known: np.ndarray, factor: float) -> np.ndarray:
    """(rows, columns) float32 px, σ of parallaxes from what least squares states.

    Where a pixel of the window is not known both images are the same: it tells nothing and hides noise. Where few
    pixels about match, by chance, those that do are wrong by more.
    """
    matching = cv2.boxFilter(known.view(np.uint8), -1, (WINDOW_PX, WINDOW_PX), normalize=False)
    share = np.maximum(np.arange(256) / WINDOW_PX**2, LEAST_SHARE)
    times = (factor**2 / share ** (2.0 * ALONE_POWER)).astype(np.float32)
    sigma = np.empty_like(variance)
    for rows in _bands(len(sigma)):
        own = np.multiply(variance[rows], cv2.LUT(matching[rows], times), out=sigma[rows])
        own += LEAST_SIGMA_PX**2
        np.sqrt(own, out=own)
    return sigma


def _alike_about(correlation: np.ndarray, known: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """(rows, columns) mean correlation of the windows about a pixel; 0 where nothing matched, outside left out."""
    size = CROWD_PX, CROWD_PX
    alike = cv2.boxFilter(np.where(known, correlation, np.float32(0.0)), -1, size)
    about = cv2.boxFilter(seen.view(np.uint8), cv2.CV_32F, size)
    alike /= np.maximum(about, 1e-3, out=about)
    return alike


def _smoothed(value: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Smooth where it is continuous: neighbours further off than a pixel do not count."""
    out = np.empty_like(value)
    smooth(value, known, SMOOTHED_STEP_PX, SMOOTHED_PX, np.float32(INVALID), out)
    return out
