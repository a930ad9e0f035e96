"""A dense front: what is left of several matrices added up, its own photographs eliminated, and its inverse.

A front lists its own photographs, then those of its rows, then the border; of symmetric parts the lower triangle holds.
[L: Duff & Reid 1983; Takahashi 1973 for the inverse]
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg.blas import dgemm, dsymm, dtrsm  # pyright: ignore[reportAttributeAccessIssue]
from scipy.linalg.lapack import dpotri  # pyright: ignore[reportAttributeAccessIssue]

from aerotri.adjustment import _factor_kernels as _kernels
from aerotri.adjustment.kernel_records import Front
from aerotri.adjustment.sparse_cholesky import NotPositiveDefiniteError, eliminate

B = 6


@dataclass(frozen=True, eq=False)
class DenseFront:
    """The three parts of a front, Fortran order.

    Parameters
    ----------
    top : (6·c, 6·c) own. low : (6·r + s, 6·c) rows and border by own. rest : (6·r + s, 6·r + s).
    border : s.
    """

    top: np.ndarray
    low: np.ndarray
    rest: np.ndarray
    border: int

    @staticmethod
    def empty(own: int, rows: int, border: int) -> DenseFront:
        """Of zeros; own, rows : number of photographs."""
        c, r = B * own, B * rows + border
        top, low, rest = (np.zeros(shape, order="F") for shape in ((c, c), (r, c), (r, r)))
        return DenseFront(top, low, rest, border)

    @property
    def n_own(self) -> int:
        return len(self.top) // B

    def add(self, matrix: np.ndarray, place: np.ndarray) -> None:
        """Add a matrix (6·k + s, 6·k + s) in Fortran order over photographs that stand at `place` (k,), rising."""
        own, rows = len(self.top), len(self.low)
        front = Front(own, rows, _flat(self.top), _flat(self.low))
        _kernels.extend_add(_flat(matrix), place, self.n_own, self.border, front, _flat(self.rest))

    def eliminate(self, diagonal: np.ndarray) -> np.ndarray:
        """Eliminate the own photographs in place: `top` is the factor then, `rest` what is left.

        Parameters
        ----------
        diagonal : (6·c,) that the matrix had before anything was eliminated: pivots are judged by it.

        Returns
        -------
        (6·c,) what the own rows and columns were multiplied by.

        Raises
        ------
        NotPositiveDefiniteError
            When a pivot is not positive or drowns in rounding.
        """
        if not np.isfinite(diagonal).all() or (diagonal <= 0.0).any():
            raise NotPositiveDefiniteError
        scale = 1.0 / np.sqrt(diagonal)
        if len(scale):
            self.top[:] *= scale[:, None]
            self.top[:] *= scale
            self.low[:] *= scale
            eliminate(self.top, self.low, self.rest)
        return scale

    def inverse(self, scale: np.ndarray, rest: np.ndarray) -> DenseFront:
        """The inverse over the front from that over its rows and border, `rest`, lower triangle, which it keeps.

        Z_RC = −Z_RR·Y and Z_CC = L11⁻ᵀ·L11⁻¹ − Yᵀ·Z_RC with Y = L21·L11⁻¹; this front holds L11 and L21, scaled.
        """
        if not len(self.top):
            return DenseFront(self.top, self.low, rest, self.border)
        own, _ = dpotri(self.top, lower=1)
        rows = np.zeros_like(self.low)
        if len(self.low):
            y = dtrsm(1.0, self.top, self.low, side=1, lower=1)
            rows = dsymm(-1.0, rest, y, lower=1)
            own = dgemm(-1.0, y, rows, beta=1.0, c=own, trans_a=1, overwrite_c=1)
        own *= scale[:, None]
        own *= scale
        rows *= scale
        return DenseFront(own, rows, rest, self.border)

    def lower_over(self, place: np.ndarray) -> np.ndarray:
        """(6·k + s, 6·k + s) lower triangle over the photographs at `place` (k,), rising, and the border."""
        size = B * len(place) + self.border
        out = np.zeros((size, size), order="F")
        parts = (_flat(self.top), _flat(self.low), _flat(self.rest))
        _kernels.extract_lower(*parts, self.n_own, place, self.border, _flat(out))
        return out


def half_solved(front: DenseFront, scale: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """L⁻¹ times the right sides of an eliminated front (6·c + 6·r + s, k), and what is left for rows and border."""
    own = len(scale)
    if not own:
        return np.zeros((0, right.shape[1])), right.copy()
    half = dtrsm(1.0, front.top, right[:own] * scale[:, None], lower=1)
    return half, right[own:] - front.low @ half


def solved_back(front: DenseFront, scale: np.ndarray, half: np.ndarray, above: np.ndarray) -> np.ndarray:
    """(6·c, k) solutions of the own photographs from those of rows and border, above (6·r + s, k)."""
    if not len(scale):
        return np.zeros((0, above.shape[1]))
    return dtrsm(1.0, front.top, half - front.low.T @ above, lower=1, trans_a=1) * scale[:, None]


def _flat(a: np.ndarray) -> np.ndarray:
    """A Fortran-ordered matrix as its elements in memory order."""
    return a.reshape(-1, order="F")
