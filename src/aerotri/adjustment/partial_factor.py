"""A factor that stops before the root: some photographs and the border stay, as a Schur complement.

What a part of a block gives to the whole: its inner photographs are eliminated, and those that other parts see as well,
and the shared parameters, are left. Sums of such complements are the normal equations of what is left of the whole
[L: George 1973; Duff & Reid 1983]. What is left keeps its units, so that the complements of parts can be added.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg.blas import dtrsm  # pyright: ignore[reportAttributeAccessIssue]

from aerotri.adjustment.kernel_records import Inverse
from aerotri.adjustment.panels import DOUBLE
from aerotri.adjustment.sparse_cholesky import (
    BorderedMatrix,
    Buffers,
    Factor,
    NotPositiveDefiniteError,
    Parts,
    Symbolic,
    eliminate,
)

B = 6


@dataclass(frozen=True, eq=False)
class Eliminated:
    """The numbers of a partial factor, for a file.

    Parameters
    ----------
    panels : of all supernodes but the root. scale : (6·n + s,) in the order of elimination.
    """

    panels: np.ndarray
    scale: np.ndarray


@dataclass(frozen=True, eq=False)
class Remainder:
    """What is left of a right side.

    Parameters
    ----------
    right : (6·k + s,) of the k photographs of the root and the border.
    half : (6·n + s,) L⁻¹·b of the others, in the order of elimination.
    decrement : bᵀN⁻¹b of the others.
    """

    right: np.ndarray
    half: np.ndarray
    decrement: float


class PartialFactor(Factor):
    """All supernodes but the root eliminated.

    Parameters
    ----------
    symbolic : made with `last`, the photographs that stay. scale : see `Eliminated`.
    """

    def __init__(self, symbolic: Symbolic, scale: np.ndarray, smallest_pivot: float = 1.0):
        super().__init__(symbolic, scale, smallest_pivot)
        self._root: np.ndarray | None = None

    @property
    def kept(self) -> int:
        """Unknowns that stay: of the root's photographs and of the border."""
        return B * self._symbolic.fronts[-1].n_own + self._symbolic.n_border

    def eliminated(self) -> Eliminated:
        """Its numbers; the panels are a view that the next matrix overwrites."""
        return Eliminated(self._symbolic.eliminated, self._scale)

    def reduce_side(self, right: np.ndarray) -> Remainder:
        """What is left of a right side (6·n + s,)."""
        x = self.reduce_sides(right[:, None])[:, 0]
        inner = len(x) - self.kept
        return Remainder(x[inner:].copy(), x, float(x[:inner] @ x[:inner]))

    def reduce_sides(self, right: np.ndarray) -> np.ndarray:
        """L⁻¹·b of what is eliminated, and what is left of the others, of right sides (6·n + s, k), in that order."""
        s = self._symbolic
        x = np.asfortranarray(right[self._permutation()] * self._scale[:, None])
        for k, front in enumerate(s.fronts[:-1]):
            top, low = s.panel(k)
            own = slice(B * front.first, B * (front.first + front.n_own))
            x[own] = dtrsm(1.0, top, x[own], lower=1)
            if len(front.scalar_rows):
                x[front.scalar_rows] -= low @ x[own]
        return x

    def expand(self, half: np.ndarray, root: np.ndarray) -> np.ndarray:
        """(6·n + s,) solution of all unknowns from that of those that stay, root (6·k + s,)."""
        return self.expand_sides(half[:, None], root[:, None])[:, 0]

    def expand_sides(self, half: np.ndarray, root: np.ndarray) -> np.ndarray:
        """(6·n + s, m) solutions of all unknowns from those of what stays, root (6·k + s, m).

        Parameters
        ----------
        half : of `reduce_sides`.
        """
        s = self._symbolic
        x = half.copy(order="F")
        x[len(x) - self.kept :] = root
        for k in range(len(s.fronts) - 2, -1, -1):
            front = s.fronts[k]
            top, low = s.panel(k)
            own = slice(B * front.first, B * (front.first + front.n_own))
            side = x[own] - low.T @ x[front.scalar_rows]
            x[own] = dtrsm(1.0, top, side, lower=1, trans_a=1)
        out = np.empty(x.shape)
        out[self._permutation()] = x * self._scale[:, None]
        return out

    def inverse_below(self, root: np.ndarray) -> Inverse:
        """The inverse of the whole on the pattern of the part, from that over what stays, root (6·k + s, 6·k + s)."""
        self._root = root
        return self.inverse_on_pattern()

    def _corner_inverse(self) -> np.ndarray:
        assert self._root is not None
        border = slice(len(self._root) - self._symbolic.n_border, None)
        return self._root[border, border]

    def _inverse_front(self, k: int, buffers: Buffers, above: Parts | np.ndarray) -> None:
        s, root = self._symbolic, self._root
        if k < len(s.fronts) - 1 or root is None:
            super()._inverse_front(k, buffers, above)
            return
        own = len(root) - s.n_border
        buffers.parts = (
            np.asfortranarray(root[:own, :own]),
            np.asfortranarray(root[own:, :own]),
            np.asfortranarray(root[own:, own:]),
        )


def eliminate_inner(symbolic: Symbolic, matrix: BorderedMatrix) -> tuple[PartialFactor, np.ndarray]:
    """The factor of all photographs but the root's, and the Schur complement (6·k + s, 6·k + s) that is left.

    Raises
    ------
    NotPositiveDefiniteError
        When a pivot is not positive or drowns in rounding.
    """
    symbolic.begin(DOUBLE)
    scale = _scale_of(symbolic, matrix)
    n = symbolic.n
    by_image = np.ascontiguousarray(scale[: B * n].reshape(n, B)[symbolic.rank])
    by_border = scale[B * n :]
    root = len(symbolic.fronts) - 1

    def up(k: int) -> float:
        parts = symbolic.assemble_front(k, matrix, by_image, by_border)
        return eliminate(*parts) if k < root else 1.0

    smallest = min(symbolic.schedule.upwards(up))
    (top, low), rest = symbolic.panel(root), symbolic.update(root)
    own = len(top)
    left = np.empty((own + len(low), own + len(low)))
    lower = np.tril(top)
    left[:own, :own] = lower + np.tril(lower, -1).T
    left[own:, :own], left[:own, own:] = low, low.T
    lower = np.tril(rest)
    left[own:, own:] = matrix.corner + lower + np.tril(lower, -1).T
    return PartialFactor(symbolic, scale, smallest), left


def restored(symbolic: Symbolic, numbers: Eliminated) -> PartialFactor:
    """The factor that the numbers were taken from."""
    symbolic.begin(DOUBLE)
    symbolic.eliminated[:] = numbers.panels
    return PartialFactor(symbolic, numbers.scale)


def _scale_of(symbolic: Symbolic, matrix: BorderedMatrix) -> np.ndarray:
    """(6·n + s,) in the order of elimination: to a unit diagonal, 1 for what stays."""
    inner = symbolic.tree.order[: symbolic.n - symbolic.fronts[-1].n_own]
    diagonal = np.diagonal(matrix.blocks[inner], axis1=1, axis2=2).ravel()
    if not np.isfinite(diagonal).all() or (diagonal <= 0.0).any():
        raise NotPositiveDefiniteError
    scale = np.ones(symbolic.size)
    scale[: len(diagonal)] = 1.0 / np.sqrt(diagonal)
    return scale
