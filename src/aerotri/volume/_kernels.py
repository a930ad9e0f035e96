"""Kernels of volumes: scalar functions of differences surface − base, without checks or objects.

Sums are (cut volume, fill volume, cut area, fill area, area not known); cut is what lies above the base.
"""

from __future__ import annotations

import numpy as np

from aerotri.compiled import kernel


@kernel
def triangle_above(d0, d1, d2):
    """Share of the volume Σd/3 above zero, and share of the area where a linear function is above zero."""
    if d0 >= 0.0 and d1 >= 0.0 and d2 >= 0.0:
        return (d0 + d1 + d2) / 3.0, 1.0
    if d0 <= 0.0 and d1 <= 0.0 and d2 <= 0.0:
        return 0.0, 0.0
    positive = int(d0 > 0.0) + int(d1 > 0.0) + int(d2 > 0.0)
    sign = 1.0 if positive == 1 else -1.0
    a, b, c = sign * d0, sign * d1, sign * d2
    if b > a and b >= c:
        a, b = b, a
    elif c > a and c >= b:
        a, c = c, a
    share = a * a / ((a - b) * (a - c))
    volume = share * a / 3.0
    if sign > 0.0:
        return volume, share
    return volume + (d0 + d1 + d2) / 3.0, 1.0 - share


@kernel
def add_triangles(d, area, sums):
    """Add triangles: d (t, 3) m, area (t,) m²."""
    for k in range(len(d)):
        mean = (d[k, 0] + d[k, 1] + d[k, 2]) / 3.0
        if np.isnan(mean):
            sums[4] += area[k]
            continue
        above, share = triangle_above(d[k, 0], d[k, 1], d[k, 2])
        sums[0] += area[k] * above
        sums[1] += area[k] * (above - mean)
        sums[2] += area[k] * share
        sums[3] += area[k] * (1.0 - share)


@kernel
def add_quads(d, whole, half_area, sums):
    """Add the two triangles of every quad that lies inside as a whole.

    d : (r + 1, c + 1) at the corners; whole : (r, c) bool. The diagonal runs from the upper left to the lower right.
    """
    for i in range(whole.shape[0]):
        for j in range(whole.shape[1]):
            if not whole[i, j]:
                continue
            a, b, c, e = d[i, j], d[i, j + 1], d[i + 1, j], d[i + 1, j + 1]
            for half in range(2):
                side = b if half == 0 else c
                mean = (a + side + e) / 3.0
                if np.isnan(mean):
                    sums[4] += half_area
                    continue
                above, share = triangle_above(a, side, e)
                sums[0] += half_area * above
                sums[1] += half_area * (above - mean)
                sums[2] += half_area * share
                sums[3] += half_area * (1.0 - share)


@kernel
def quadratic_above(f0, fm, f1):
    """Integral over 0 … 1 of the part above zero of the quadratic with these values at 0, ½, 1, and where it is."""
    c = f0
    b = 4.0 * fm - 3.0 * f0 - f1
    a = 2.0 * f0 - 4.0 * fm + 2.0 * f1
    r0, r1 = 1.0, 1.0
    size = abs(f0) + abs(fm) + abs(f1)
    if abs(a) > 1e-13 * size:
        under = b * b - 4.0 * a * c
        if under > 0.0:
            q = -0.5 * (b + np.copysign(np.sqrt(under), b))
            r0 = q / a
            r1 = c / q if q != 0.0 else 1.0
    elif abs(b) > 1e-13 * size:
        r0 = -c / b
    r0, r1 = min(max(r0, 0.0), 1.0), min(max(r1, 0.0), 1.0)
    if r1 < r0:
        r0, r1 = r1, r0
    above, length, low = 0.0, 0.0, 0.0
    for k in range(3):
        high = r0 if k == 0 else (r1 if k == 1 else 1.0)
        middle = 0.5 * (low + high)
        if high > low and c + middle * (b + middle * a) > 0.0:
            above += ((a * high / 3.0 + b / 2.0) * high + c) * high - ((a * low / 3.0 + b / 2.0) * low + c) * low
            length += high - low
        low = high
    return above, length


@kernel
def add_pieces(f, length, section, sums):
    """Add line pieces to the sums (s, 5) of their sections: f (n, 3) at the ends and the middle, length (n,) m."""
    for k in range(len(f)):
        mean = (f[k, 0] + 4.0 * f[k, 1] + f[k, 2]) / 6.0
        own = sums[section[k]]
        if np.isnan(mean):
            own[4] += length[k]
            continue
        above, share = quadratic_above(f[k, 0], f[k, 1], f[k, 2])
        own[0] += length[k] * above
        own[1] += length[k] * (above - mean)
        own[2] += length[k] * share
        own[3] += length[k] * (1.0 - share)
