"""Texture of the ground: lattices of hashed numbers, their refinement, and the surface they span, pixel by pixel."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerotri.compiled import inlined, kernel

M1, M2, M3 = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
"""Increment and factors of SplitMix64 [L: Steele, Lea, Flood 2014]."""
S27, S30, S31, S40 = np.uint64(27), np.uint64(30), np.uint64(31), np.uint64(40)
"""Its shifts in bits; by the last, 24 bits are left, as many as a 32 bit real number holds exactly."""


class LatticeArrays(NamedTuple):
    """(k, l) coefficients of nodes from (row, column) on; node (i, j) lies at Y = i·spacing, X = j·spacing, m."""

    values: np.ndarray
    row: int
    column: int
    spacing: float


class PixelPlaces(NamedTuple):
    """(m, n, 2) m, X and Y of pixels every `step` from pixel `origin` (2,) = row, column on, linear between."""

    nodes: np.ndarray
    origin: np.ndarray
    step: int


@inlined
def _mixed(z):
    """A 64 bit number stirred (SplitMix64) [L: Steele, Lea, Flood 2014]."""
    z = (z ^ (z >> S30)) * M2
    z = (z ^ (z >> S27)) * M3
    return z ^ (z >> S31)


@kernel
def add_noise(lattice, row, column, key, amplitude):
    """Add to every node a number in −amplitude … amplitude that depends on its place and the key alone.

    Parameters
    ----------
    lattice : (k, l) in and out; row, column : of its first node. key : uint64.
    """
    step = np.float32(2.0 * amplitude / 16777215.0)
    for i in range(lattice.shape[0]):
        of_row = _mixed(np.uint64(row + i) * M1 + key)
        for j in range(lattice.shape[1]):
            drawn = _mixed(np.uint64(column + j) * M1 + of_row) >> S40
            lattice[i, j] += np.float32(np.int64(drawn)) * step - np.float32(amplitude)


@kernel
def refine(coarse, row, column, fine, fine_row, fine_column):
    """Coefficients of the same cubic B-spline surface on a lattice twice as fine [L: de Boor, two-scale relation].

    Along one axis the coefficient of an even node 2i is (c[i−1] + 6c[i] + c[i+1])/8, of an odd one 2i+1
    (c[i] + c[i+1])/2.

    Parameters
    ----------
    coarse : (k, l), of nodes from (row, column) on, one more than `fine` needs on every side.
    fine : (m, n) out, of nodes from (fine_row, fine_column) on.
    """
    between = np.empty((coarse.shape[0], fine.shape[1]), np.float32)
    eighth, half, six = np.float32(0.125), np.float32(0.5), np.float32(6.0)
    for j in range(fine.shape[1]):
        number = fine_column + j
        c = number // 2 - column
        for i in range(coarse.shape[0]):
            if number % 2:
                between[i, j] = half * (coarse[i, c] + coarse[i, c + 1])
            else:
                between[i, j] = eighth * (coarse[i, c - 1] + six * coarse[i, c] + coarse[i, c + 1])
    for i in range(fine.shape[0]):
        number = fine_row + i
        c = number // 2 - row
        for j in range(fine.shape[1]):
            if number % 2:
                fine[i, j] = half * (between[c, j] + between[c + 1, j])
            else:
                fine[i, j] = eighth * (between[c - 1, j] + six * between[c, j] + between[c + 1, j])


@inlined
def _spline(t):
    """Weights of the cubic B-spline at the place t between the inner two of four nodes."""
    sixth, one = np.float32(1.0 / 6.0), np.float32(1.0)
    u = one - t
    first, fourth = sixth * u * u * u, sixth * t * t * t
    second = sixth * (np.float32(4.0) + np.float32(3.0) * t * t * (t - np.float32(2.0)))
    return first, second, one - first - second - fourth, fourth


@kernel
def texture_of_pixels(lattice, places, first, out):
    """The surface at the ground positions of pixels.

    Parameters
    ----------
    lattice : `LatticeArrays`. places : `PixelPlaces`.
    out : (rows, columns) out, pixels from `first` = (row, column) on.
    """
    nodes, origin, step = places.nodes, places.origin, places.step
    values, row, column, spacing = lattice.values, lattice.row, lattice.column, lattice.spacing
    first_row, first_column = first
    for r in range(out.shape[0]):
        at = first_row + r - origin[0]
        i = min(max(at // step, 0), nodes.shape[0] - 2)
        t = at / step - i
        for c in range(out.shape[1]):
            place = first_column + c - origin[1]
            j = min(max(place // step, 0), nodes.shape[1] - 2)
            s = place / step - j
            x = (1.0 - t) * ((1.0 - s) * nodes[i, j, 0] + s * nodes[i, j + 1, 0])
            x += t * ((1.0 - s) * nodes[i + 1, j, 0] + s * nodes[i + 1, j + 1, 0])
            y = (1.0 - t) * ((1.0 - s) * nodes[i, j, 1] + s * nodes[i, j + 1, 1])
            y += t * ((1.0 - s) * nodes[i + 1, j, 1] + s * nodes[i + 1, j + 1, 1])
            u, v = x / spacing - column, y / spacing - row
            k, m = int(np.floor(u)), int(np.floor(v))
            a, b = _spline(np.float32(u - k)), _spline(np.float32(v - m))
            value = np.float32(0.0)
            for q in range(4):
                line = values[m - 1 + q]
                value += b[q] * (a[0] * line[k - 1] + a[1] * line[k] + a[2] * line[k + 1] + a[3] * line[k + 2])
            out[r, c] = value
