"""Smoothing that stops at steps: a bilateral filter, neighbours one at a time over whole rows."""

from __future__ import annotations

import numpy as np

from aerotri.compiled import kernel, leaf_kernel

REACH = 3
"""Pixels to the farthest neighbour."""
POWER = 8
"""(1 − Δ²/(2·8·σ²))⁸ stands for exp(−Δ²/2σ²): within a hundredth below 1σ, .035 at 2σ, and 0 from 4σ on [D]."""


@kernel
def smooth(value, known, step, distance, unknown, out):
    """Means of what lies around a pixel, less the farther it is in place and in value.

    value : (rows, columns) float32; what is not known is farther than 4·`step` from all others.
    known : (rows, columns) bool. step, distance : σ of the weights in value, and in place in pixels.
    unknown : float32, where not known. out : (rows, columns) float32.
    """
    rows, columns = value.shape
    total, weight = np.empty(columns, np.float32), np.empty(columns, np.float32)
    scale = np.float32(1.0 / (2.0 * POWER * step * step))
    for i in range(rows):
        total[:], weight[:] = 0.0, 1.0
        for k in range(max(-REACH, -i), min(REACH, rows - 1 - i) + 1):
            for m in range(-REACH, REACH + 1):
                apart = k * k + m * m
                if 0 < apart <= REACH * REACH:
                    near = np.float32(np.exp(-0.5 * apart / distance**2))
                    first, last = max(-m, 0), columns - max(m, 0)
                    _add(
                        value[i, first:last], value[i + k, first + m : last + m], near, scale,
                        total[first:last], weight[first:last],
                    )  # fmt: skip
        for j in range(columns):
            out[i, j] = value[i, j] + total[j] / weight[j] if known[i, j] else unknown


@leaf_kernel
def _add(value, neighbour, near, scale, total, weight):
    one, nothing = np.float32(1.0), np.float32(0.0)
    for j in range(len(value)):
        off = neighbour[j] - value[j]
        w = max(one - off * off * scale, nothing)
        w = w * w
        w = w * w
        w = w * w * near
        total[j] += w * off
        weight[j] += w
