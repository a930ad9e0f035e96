"""Grey values of windows: sampled, normalised, multiplied. Records as in `_view_kernels`."""

from __future__ import annotations

import numpy as np

from aerotri.compiled import kernel


@kernel
def sample_linear(view, k, corner, window):
    """Grey values at the posts between corners, bilinear."""
    pixels, offset, columns = view.pixels, view.crops[k, 0], view.crops[k, 4]
    n, m = window.shape
    for q in range(n):
        t = q / (n - 1.0)
        left_c = corner[0, 0] + t * (corner[2, 0] - corner[0, 0])
        left_r = corner[0, 1] + t * (corner[2, 1] - corner[0, 1])
        step_c = (corner[1, 0] + t * (corner[3, 0] - corner[1, 0]) - left_c) / (m - 1.0)
        step_r = (corner[1, 1] + t * (corner[3, 1] - corner[1, 1]) - left_r) / (m - 1.0)
        for p in range(m):
            c, r = left_c + p * step_c, left_r + p * step_r
            ic, ir = int(c), int(r)
            fc, fr = np.float32(c - ic), np.float32(r - ir)
            at = offset + ir * columns + ic
            top = pixels[at] + fc * (np.float32(pixels[at + 1]) - pixels[at])
            low = pixels[at + columns] + fc * (np.float32(pixels[at + columns + 1]) - pixels[at + columns])
            window[q, p] = top + fr * (low - top)


@kernel
def cubic_weights(f, weight):
    """Weights of four pixels around a place f beyond the second [L: Keys 1981, a = −1/2]."""
    weight[0] = ((-0.5 * f + 1.0) * f - 0.5) * f
    weight[1] = (1.5 * f - 2.5) * f * f + 1.0
    weight[2] = ((-1.5 * f + 2.0) * f + 0.5) * f
    weight[3] = (0.5 * f - 0.5) * f * f


@kernel
def sample_cubic(view, k, corner, bend, window, weights):
    """As `sample_linear`, by cubic convolution, the posts displaced by what curves the ground.

    bend : (5,) px of column and row per metre of displacement, and m of it for u², uv, v², u and v being ±1 at the
        sides. weights : (2, 4) room.
    """
    pixels, offset, columns = view.pixels, view.crops[k, 0], view.crops[k, 4]
    n = window.shape[0]
    for q in range(n):
        t = q / (n - 1.0)
        v = 2.0 * t - 1.0
        left_c = corner[0, 0] + t * (corner[2, 0] - corner[0, 0])
        left_r = corner[0, 1] + t * (corner[2, 1] - corner[0, 1])
        step_c = (corner[1, 0] + t * (corner[3, 0] - corner[1, 0]) - left_c) / (n - 1.0)
        step_r = (corner[1, 1] + t * (corner[3, 1] - corner[1, 1]) - left_r) / (n - 1.0)
        for p in range(n):
            u = 2.0 * p / (n - 1.0) - 1.0
            more = bend[2] * u * u + bend[3] * u * v + bend[4] * v * v
            c, r = left_c + p * step_c + more * bend[0], left_r + p * step_r + more * bend[1]
            ic, ir = int(c), int(r)
            cubic_weights(c - ic, weights[0])
            cubic_weights(r - ir, weights[1])
            value = 0.0
            for b in range(4):
                at = offset + (ir - 1 + b) * columns + ic - 1
                line = 0.0
                for a in range(4):
                    line += weights[0, a] * pixels[at + a]
                value += weights[1, b] * line
            window[q, p] = value


@kernel
def normalise(window):
    """Take off the mean and divide by the length; False for a window without contrast."""
    total = 0.0
    n = window.shape[0]
    for q in range(n):
        for p in range(n):
            total += window[q, p]
    mean = np.float32(total / (n * n))
    squares = 0.0
    for q in range(n):
        for p in range(n):
            value = window[q, p] - mean
            window[q, p] = value
            squares += value * value
    if not squares > 0.0:
        return False
    scale = np.float32(1.0 / np.sqrt(squares))
    for q in range(n):
        for p in range(n):
            window[q, p] *= scale
    return True


@kernel
def product(one, other):
    """Normalised cross-correlation of two normalised windows."""
    total = np.float32(0.0)
    for q in range(one.shape[0]):
        for p in range(one.shape[1]):
            total += one[q, p] * other[q, p]
    return float(total)


@kernel
def mean_of_best(values, count):
    """Mean of the better half of values, of two at least: photographs from which something hides the place are few."""
    best = values[:count]
    best.sort()
    kept = max(min(count, 2), (count + 1) // 2)
    total = 0.0
    for k in range(count - kept, count):
        total += best[k]
    return total / kept
