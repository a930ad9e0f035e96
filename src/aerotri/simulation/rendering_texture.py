"""A texture on the ground, the same from wherever it is seen: noise of many octaves, without end and without storage.

[C] Every octave is a cubic B-spline surface whose coefficients are hashed from the place of their node, the octaves a
factor 2 apart and of equal variance, as in natural images [L: Field 1987]. A B-spline surface is one on a lattice twice
as fine as well, so that all octaves are added up into the coefficients of the finest, and every pixel costs one
evaluation. Beyond one cycle in two nodes it holds nearly nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.simulation import _rendering_kernels as kernels
from aerotri.simulation.random_streams import stream

COARSEST_M = 400.0
"""Spacing of the coarsest octave, m; chosen [C]: a good part of the ground of a photograph, so that coarse levels of
pyramids have texture too."""
RMS_OF_NODES = 151.0 / 315.0 / np.sqrt(3.0)
"""RMS of a B-spline surface over the amplitude of its uniform coefficients: (Σ w²) averaged, along both axes."""
MARGIN = 4
"""Nodes beyond the ground asked for; a cubic B-spline reaches over two, the others are spare [C]."""


@dataclass(frozen=True, eq=False)
class Lattice:
    """Coefficients (k, l) of nodes from (row, column) on; node (i, j) lies at Y = i·spacing, X = j·spacing, m."""

    row: int
    column: int
    spacing: float
    values: np.ndarray


@dataclass(frozen=True)
class Texture:
    """Mean 0, RMS 1.

    Parameters
    ----------
    spacing : m between the nodes of the finest octave.
    seed : of the simulation.
    """

    spacing: float
    seed: int

    @property
    def octaves(self) -> int:
        return max(int(np.ceil(np.log2(COARSEST_M / self.spacing))), 1)

    @property
    def amplitude(self) -> float:
        """Of the coefficients of every octave."""
        return 1.0 / np.sqrt(self.octaves) / RMS_OF_NODES

    def lattice(self, low: np.ndarray, high: np.ndarray) -> Lattice:
        """Coefficients for the ground between two corners (2,) X, Y in m."""
        column, row = (int(np.floor(v / self.spacing)) - MARGIN for v in low)
        last_column, last_row = (int(np.ceil(v / self.spacing)) + MARGIN for v in high)
        ranges = [(row, column, last_row, last_column)]
        for _ in range(self.octaves - 1):
            r, c, last_r, last_c = ranges[-1]
            ranges.append((r // 2 - 1, c // 2 - 1, last_r // 2 + 2, last_c // 2 + 2))
        keys = stream(self.seed, "texture").integers(2**63, size=self.octaves, dtype=np.uint64)
        values = None
        for k in reversed(range(self.octaves)):
            r, c, last_r, last_c = ranges[k]
            fine = np.zeros((last_r - r + 1, last_c - c + 1), np.float32)
            if values is not None:
                kernels.refine(values, ranges[k + 1][0], ranges[k + 1][1], fine, r, c)
            kernels.add_noise(fine, r, c, keys[k], self.amplitude)
            values = fine
        return Lattice(row, column, self.spacing, np.zeros((0, 0), np.float32) if values is None else values)
