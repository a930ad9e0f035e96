"""From photographs to stations and mountings: normal matrix, right sides, solutions, and the inverse on its pattern.

With dx = C·dy, y the unknowns of stations and the shared parameters, the normal equations are CᵀNC·dy = Cᵀb and every
cofactor of photographs is C·(CᵀNC)⁻¹·Cᵀ. All beside the factor itself goes on in the unknowns of the photographs.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerotri.adjustment import _rig_kernels
from aerotri.adjustment.kernel_records import Inverse
from aerotri.adjustment.rigging import Chain, Rigging
from aerotri.adjustment.sparse_cholesky import BorderedMatrix, Factor


class Places(NamedTuple):
    """Blocks of photographs: `row` and `col` (nb,), their `place` among the reduced ones, `of` (n,) the stations."""

    row: np.ndarray
    col: np.ndarray
    place: np.ndarray
    of: np.ndarray


class RigReduction:
    """Which blocks of photographs become which of stations.

    Parameters
    ----------
    rigging : who follows whom. block_row, block_col : (nb,) pattern of the photographs, their own blocks first.
    """

    def __init__(self, rigging: Rigging, block_row: np.ndarray, block_col: np.ndarray):
        self.leads = rigging.leads
        count = len(self.leads)
        number = np.full(len(rigging.lead), -1, dtype=np.int64)
        number[self.leads] = np.arange(count)
        self.pattern = block_row, block_col
        of = number[rigging.lead]
        low, high = np.minimum(of[block_row], of[block_col]), np.maximum(of[block_row], of[block_col])
        unique, inverse = np.unique(low * count + high, return_inverse=True)
        apart = unique // count != unique % count
        place_of = np.where(apart, count + np.cumsum(apart) - 1, unique // count)
        self.block_row = np.concatenate([np.arange(count), unique[apart] // count])
        self.block_col = np.concatenate([np.arange(count), unique[apart] % count])
        self._places = Places(
            block_row.astype(np.int64), block_col.astype(np.int64), place_of[inverse.ravel()].astype(np.int64), of
        )

    def reduced(self, matrix: BorderedMatrix, chain: Chain) -> BorderedMatrix:
        """CᵀNC."""
        s = matrix.border.shape[1]
        sums = BorderedMatrix(
            np.zeros((len(self.block_row), 6, 6)), np.zeros((len(self.leads), s, 6)), matrix.corner.copy()
        )
        arrays = Inverse(sums.blocks, sums.border, sums.corner)
        _rig_kernels.reduce_blocks(self._places, chain, matrix.blocks, arrays)
        _rig_kernels.reduce_border(self._places, chain, matrix.border, arrays)
        return sums

    def reduced_side(self, right: np.ndarray, chain: Chain) -> np.ndarray:
        """Cᵀ·right, (6·n + s, ·) → (6·stations + s, ·)."""
        n, size = len(chain.columns), right.shape[1:]
        images, shared = right[: 6 * n].reshape(n, 6, -1), right[6 * n :].reshape(len(right) - 6 * n, -1).copy()
        stations = np.zeros((len(self.leads), 6, images.shape[2]))
        np.add.at(stations, self._places.of, np.swapaxes(chain.by_station, 1, 2) @ images)
        there = chain.columns >= 0
        pulls = np.swapaxes(chain.by_mounting, 1, 2) @ images
        np.add.at(shared, chain.columns[there], pulls[there])
        return np.concatenate([stations.reshape(6 * len(self.leads), -1), shared]).reshape(-1, *size)

    def on_leads(self, right: np.ndarray, chain: Chain) -> np.ndarray:
        """Cᵀ·right at the photographs that lead, 0 at those that follow: a right side (6·n + s,) that says the same."""
        n, reduced = len(chain.columns), self.reduced_side(right, chain)
        images = np.zeros((n, 6))
        images[self.leads] = reduced[: 6 * len(self.leads)].reshape(-1, 6)
        return np.concatenate([images.ravel(), reduced[6 * len(self.leads) :]])

    def expanded(self, x: np.ndarray, chain: Chain) -> np.ndarray:
        """C·x, (6·stations + s, ·) → (6·n + s, ·)."""
        count, size = 6 * len(self.leads), x.shape[1:]
        stations, shared = x[:count].reshape(len(self.leads), 6, -1), x[count:].reshape(len(x) - count, -1)
        of_mounting = np.where((chain.columns >= 0)[:, :, None], shared[np.maximum(chain.columns, 0)], 0.0)
        images = chain.by_station @ stations[self._places.of] + chain.by_mounting @ of_mounting
        return np.concatenate([images.reshape(6 * len(images), -1), shared]).reshape(-1, *size)

    def expanded_inverse(self, inverse: Inverse, chain: Chain) -> Inverse:
        """C·Q·Cᵀ on the pattern of the photographs."""
        blocks = np.empty((len(self._places.row), 6, 6))
        _rig_kernels.expand_blocks(self._places, chain, inverse, blocks)
        border = inverse.border[self._places.of] @ np.swapaxes(chain.by_station, 1, 2)
        there = (chain.columns >= 0)[:, None, :]
        of_mounting = np.where(there, np.swapaxes(inverse.corner[np.maximum(chain.columns, 0)], 1, 2), 0.0)
        return Inverse(blocks, border + of_mounting @ np.swapaxes(chain.by_mounting, 1, 2), inverse.corner)


class RigFactor(Factor):
    """A factor of the equations of stations and mountings that answers in the unknowns of the photographs.

    Parameters
    ----------
    factor : of CᵀNC.
    """

    def __init__(self, factor: Factor, reduction: RigReduction, chain: Chain):
        self._factor, self._reduction, self._chain = factor, reduction, chain
        self.smallest_pivot = factor.smallest_pivot

    @property
    def pattern(self) -> tuple[np.ndarray, np.ndarray]:
        """Row and column photograph of every block of the inverse on the pattern."""
        return self._reduction.pattern

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """C·(CᵀNC)⁻¹·Cᵀ·rhs, (6·n + s,) or (6·n + s, k)."""
        return self._reduction.expanded(self._factor.solve(self._reduction.reduced_side(rhs, self._chain)), self._chain)

    def half_solve(self, rhs: np.ndarray) -> np.ndarray:
        """H with HᵀH = rhsᵀ·C·(CᵀNC)⁻¹·Cᵀ·rhs."""
        return self._factor.half_solve(self._reduction.reduced_side(rhs, self._chain))

    def border_normals(self) -> np.ndarray:
        """(s, s) the normal matrix of the shared parameters with the stations eliminated."""
        return self._factor.border_normals()

    def border_inverse(self) -> np.ndarray:
        """(s, s) cofactors of the shared parameters."""
        return self._factor.border_inverse()

    def columns(self, indices: np.ndarray) -> np.ndarray:
        """(size, k) columns of C·(CᵀNC)⁻¹·Cᵀ."""
        unit = np.zeros((self._chain.columns.size + len(self.border_inverse()), len(indices)))
        unit[indices, np.arange(len(indices))] = 1.0
        return self.solve(unit)

    def inverse_on_pattern(self) -> Inverse:
        """C·(CᵀNC)⁻¹·Cᵀ on the pattern of the photographs."""
        return self._reduction.expanded_inverse(self._factor.inverse_on_pattern(), self._chain)
