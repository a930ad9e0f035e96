"""Block sparse Cholesky of the bordered reduced normal matrix, and its inverse on the same pattern.

Multifrontal [L: Duff & Reid 1983; Takahashi 1973 for the inverse]: every supernode of the dissection tree is a dense
front on BLAS. The border of shared parameters is the last supernode, so that step, covariance and correlations of all
unknowns come from one factor. Its numbers stand in `panels`, which every factorisation uses again: a `Factor` is valid
until the next one of the same `Symbolic`.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg.blas import dtrsm, dtrsv, strsm, strsv  # pyright: ignore[reportAttributeAccessIssue]

from aerotri.adjustment import _factor_kernels as _kernels
from aerotri.adjustment import dense as lapack
from aerotri.adjustment.kernel_records import Front, Inverse, MatrixBlocks
from aerotri.adjustment.panels import DOUBLE, SINGLE, B, Panels
from aerotri.adjustment.parallel import blas_threads

PIVOT_LIMIT = 1e-13
"""Smallest pivot, relative to a unit diagonal, that is taken for a number and not for rounding."""
SINGLE_PIVOT_LIMIT = 1e-5
"""The same of a factor in single precision, whose solutions would have no sure digit below."""
_LIMITS = {DOUBLE: PIVOT_LIMIT, SINGLE: SINGLE_PIVOT_LIMIT}
_MATRIX_SOLVE, _VECTOR_SOLVE = {DOUBLE: dtrsm, SINGLE: strsm}, {DOUBLE: dtrsv, SINGLE: strsv}


class NotPositiveDefiniteError(Exception):
    """The matrix is singular within rounding."""


class StaleFactorError(RuntimeError):
    """The factor's place was taken by that of another matrix."""


@dataclass(frozen=True, eq=False)
class BorderedMatrix:
    """Symmetric matrix [[S, B], [Bᵀ, C]] of n photographs and s shared parameters.

    Parameters
    ----------
    blocks : (nb, 6, 6) blocks of S listed in the pattern of `Symbolic` (row photograph ≤ column photograph).
    border : (n, s, 6); corner : (s, s).
    """

    blocks: np.ndarray
    border: np.ndarray
    corner: np.ndarray


class Symbolic(Panels):
    """The panels of a block, filled with the factor of one matrix after the other."""

    def factorise(self, matrix: BorderedMatrix, precision: np.dtype[Any] = DOUBLE) -> Factor:
        """Cholesky factor of the matrix, scaled to a unit diagonal first.

        Parameters
        ----------
        precision : of its numbers. SINGLE takes half the time and gives three to five digits of a solution.

        Raises
        ------
        NotPositiveDefiniteError
            When a pivot is not positive or drowns in rounding.
        """
        self.begin(precision)
        scale = self._scale(matrix)
        by_image = np.ascontiguousarray(scale[: B * self.n].reshape(self.n, B)[self.rank])
        by_border = scale[B * self.n :]
        corner = self.corner_factor
        corner[:] = matrix.corner * by_border[:, None] * by_border[None, :]
        smallest = min(
            self.schedule.upwards(lambda k: self._factorise_front(k, matrix, by_image, by_border)), default=1.0
        )
        if self.n_border:
            for k in (k for k, front in enumerate(self.fronts) if front.parent < 0):
                corner += self.update(k)
            with blas_threads(self.n_border**3 / 3):
                smallest = min(smallest, _factor_triangle(corner))
        return Factor(self, scale, smallest)

    def _factorise_front(self, k: int, matrix: BorderedMatrix, by_image: np.ndarray, by_border: np.ndarray) -> float:
        """Supernode k, those below being done; the smallest pivot."""
        parts = self.assemble_front(k, matrix, by_image, by_border)
        return eliminate(*parts) if self.fronts[k].n_own else 1.0

    def assemble_front(
        self, k: int, matrix: BorderedMatrix, by_image: np.ndarray, by_border: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Supernode k with what the supernodes below leave: own triangle, rows below, update, in place.

        Parameters
        ----------
        by_image : (n, 6) of every photograph, by_border : (s,) what rows and columns are multiplied by.
        """
        front = self.fronts[k]
        top, low, rest = self.panel(k)[0], self.panel(k)[1], self.update(k)
        flat_top, flat_low, flat_rest = _flat(top), _flat(low), _flat(rest)
        for part in (flat_top, flat_low, flat_rest):
            part.fill(0.0)
        dense = Front(len(top), len(low), flat_top, flat_low)
        _kernels.scatter_blocks(
            front.blocks, MatrixBlocks(matrix.blocks, self.block_row, self.block_col, by_image), dense
        )
        own = self.tree.order[front.first : front.first + front.n_own]
        _kernels.scatter_border(own, matrix.border, by_image, by_border, len(low), flat_low)
        for child in self.children[k]:
            _kernels.extend_add(
                _flat(self.update(child)), self.fronts[child].place, front.n_own, self.n_border, dense, flat_rest
            )
        return top, low, rest

    def _scale(self, matrix: BorderedMatrix) -> np.ndarray:
        diagonal = np.concatenate(
            [
                np.diagonal(matrix.blocks[: self.n], axis1=1, axis2=2)[self.tree.order].ravel(),
                np.diagonal(matrix.corner),
            ]
        )
        if not np.isfinite(diagonal).all() or (diagonal <= 0.0).any():
            raise NotPositiveDefiniteError
        return 1.0 / np.sqrt(diagonal)


def _factor_triangle(a: np.ndarray) -> float:
    """Lower Cholesky in place; the smallest pivot."""
    found = lapack.cholesky(a)
    pivots = np.diagonal(a)
    if not found or not np.isfinite(pivots).all() or (pivots * pivots).min() < _LIMITS[a.dtype]:
        raise NotPositiveDefiniteError
    return float((pivots * pivots).min())


def eliminate(top: np.ndarray, low: np.ndarray, rest: np.ndarray) -> float:
    """One front: L11 = chol(top), L21 = low·L11⁻ᵀ, rest −= L21·L21ᵀ, all in place."""
    smallest = _factor_triangle(top)
    lapack.solve_from_right(top, low, transposed=True)
    lapack.subtract_square(low, rest)
    return smallest


def _triangle_solved(lower: np.ndarray, right: np.ndarray, transposed: bool = False) -> np.ndarray:
    """L⁻¹·right or L⁻ᵀ·right; right (k,) or (k, ·)."""
    if right.ndim == 1:
        return _VECTOR_SOLVE[lower.dtype](lower, right, lower=1, trans=int(transposed))
    return _MATRIX_SOLVE[lower.dtype](1.0, lower, right, lower=1, trans_a=int(transposed))


class Factor:
    """A factor of a `BorderedMatrix`: solves, inverts on the pattern, gives columns of the inverse.

    `smallest_pivot` is relative to a unit diagonal: 1 / smallest_pivot is a lower bound of the scaled condition number.
    """

    def __init__(self, symbolic: Symbolic, scale: np.ndarray, smallest_pivot: float):
        self._of, self._scale, self.smallest_pivot = symbolic, scale, smallest_pivot
        self._number = symbolic.times_factorised

    @property
    def _symbolic(self) -> Symbolic:
        """Where the factor stands.

        Raises
        ------
        StaleFactorError
            When another matrix was factorised there since.
        """
        if self._number != self._of.times_factorised:
            raise StaleFactorError("another matrix was factorised in the place of this factor: factorise anew")
        return self._of

    @property
    def pattern(self) -> tuple[np.ndarray, np.ndarray]:
        """Row and column photograph of every block of the inverse on the pattern."""
        return self._of.block_row, self._of.block_col

    def _permutation(self) -> np.ndarray:
        s = self._symbolic
        images = (B * s.tree.order[:, None] + np.arange(B)).ravel()
        return np.concatenate([images, B * s.n + np.arange(s.n_border)])

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """x with matrix·x = rhs; rhs (size,) or (size, k), the photographs' unknowns first, then the border's."""
        with blas_threads(self._symbolic.factor_entries * (rhs.size / len(rhs))):
            return self._solve(rhs)

    def half_solve(self, rhs: np.ndarray) -> np.ndarray:
        """(size, k) H with HᵀH = rhsᵀ·N⁻¹·rhs of the matrix N, rows in no order: half the work of a solution."""
        with blas_threads(self._symbolic.factor_entries * (rhs.size / len(rhs)) / 2):
            return self._half(rhs, self._permutation())

    def _half(self, rhs: np.ndarray, permutation: np.ndarray) -> np.ndarray:
        s = self._symbolic
        scale = self._scale if rhs.ndim == 1 else self._scale[:, None]
        x = np.asfortranarray(rhs[permutation] * scale, dtype=s.precision)
        corner = slice(B * s.n, None)
        for k, front in enumerate(s.fronts):
            top, low = s.panel(k)
            if not front.n_own:
                continue
            own = slice(B * front.first, B * (front.first + front.n_own))
            x[own] = _triangle_solved(top, x[own])
            if len(front.scalar_rows):
                x[front.scalar_rows] -= low @ x[own]
        if s.n_border:
            x[corner] = _triangle_solved(s.corner_factor, x[corner])
        return x

    def _solve(self, rhs: np.ndarray) -> np.ndarray:
        s = self._symbolic
        permutation = self._permutation()
        x, corner = self._half(rhs, permutation), slice(B * s.n, None)
        if s.n_border:
            x[corner] = _triangle_solved(s.corner_factor, x[corner], transposed=True)
        for k in range(len(s.fronts) - 1, -1, -1):
            front = s.fronts[k]
            if not front.n_own:
                continue
            top, low = s.panel(k)
            own = slice(B * front.first, B * (front.first + front.n_own))
            right = x[own] - low.T @ x[front.scalar_rows] if len(front.scalar_rows) else x[own]
            x[own] = _triangle_solved(top, right, transposed=True)
        out = np.empty(x.shape)
        out[permutation] = x * (self._scale if rhs.ndim == 1 else self._scale[:, None])
        return out

    def border_normals(self) -> np.ndarray:
        """(s, s) the normal matrix of the border with the photographs eliminated."""
        lower = np.tril(self._symbolic.corner_factor) / self._scale[B * self._symbolic.n :, None]
        return lower @ lower.T

    def border_inverse(self) -> np.ndarray:
        """(s, s) the inverse over the border alone: cofactors of the shared parameters."""
        if not self._symbolic.n_border:
            return np.zeros((0, 0))
        by_border = self._scale[B * self._symbolic.n :]
        inverse = _symmetric_from_lower(_inverted(self._symbolic.corner_factor))
        return inverse * by_border[:, None] * by_border[None, :]

    def columns(self, indices: np.ndarray) -> np.ndarray:
        """(size, k) columns of the inverse."""
        unit = np.zeros((self._symbolic.size, len(indices)))
        unit[indices, np.arange(len(indices))] = 1.0
        return self.solve(unit)

    def inverse_on_pattern(self) -> Inverse:
        """The inverse on the pattern of the matrix, by the Takahashi recursion from the root down."""
        s = self._symbolic
        out = Inverse(
            np.zeros((len(s.block_row), B, B)), np.zeros((s.n, s.n_border, B)), np.zeros((s.n_border, s.n_border))
        )
        if s.n_border:
            out.corner[:] = self._corner_inverse()
        by_image = np.ascontiguousarray(self._scale[: B * s.n].reshape(s.n, B)[s.rank])
        by_border = self._scale[B * s.n :]
        trunk = {k: Buffers() for level in s.schedule.trunk for k in level}

        def invert(k: int, own: Buffers, above: Buffers | None) -> None:
            self._inverse_front(k, own, out.corner if above is None else above.parts)
            self._gather(k, own.parts, out, by_image, by_border)

        room = threading.local()

        def down_a_branch(b: int) -> None:
            of_depth = room.__dict__.setdefault("of_depth", dict[int, Buffers]())
            branch = s.schedule.branches[b]
            for k in reversed(branch):
                depth = s.fronts[k].depth
                above = trunk[s.fronts[k].parent] if k == branch[-1] else of_depth[depth - 1]
                invert(k, of_depth.setdefault(depth, Buffers()), above)

        s.schedule.down_the_trunk(lambda k: invert(k, trunk[k], trunk.get(s.fronts[k].parent)))
        s.schedule.over_branches(down_a_branch)
        out.corner[:] *= by_border[:, None] * by_border[None, :]
        return out

    def _gather(self, k: int, parts: Parts, out: Inverse, by_image: np.ndarray, by_border: np.ndarray) -> None:
        """What belongs into the inverse of supernode k, scaled back."""
        s, (top, low, _) = self._of, parts
        front = s.fronts[k]
        own = s.tree.order[front.first : front.first + front.n_own]
        _kernels.gather_blocks(
            front.blocks, Front(len(top), len(low), _flat(top), _flat(low)),
            MatrixBlocks(out.blocks, s.block_row, s.block_col, by_image),
        )  # fmt: skip
        _kernels.gather_border(own, _flat(low), len(low), by_image, by_border, out.border)

    def _corner_inverse(self) -> np.ndarray:
        """(s, s) the scaled inverse over the border."""
        return _symmetric_from_lower(_inverted(self._symbolic.corner_factor))

    def _inverse_front(self, k: int, buffers: Buffers, above: Parts | np.ndarray) -> None:
        """Lower triangle of the inverse over the front's own columns and its rows, in the three parts of a front.

        Z_RR comes from the parent, of a root from the border; Z_RC = −Z_RR·Y and Z_CC = L11⁻ᵀ·L11⁻¹ − Yᵀ·Z_RC with
        Y = L21·L11⁻¹.
        """
        s = self._symbolic
        front = s.fronts[k]
        top, low = s.panel(k)
        c, r = len(top), len(low)
        rest = buffers.matrix("rest", r, r)
        if isinstance(above, np.ndarray):
            rest[:] = above
        else:
            flat_above = (_flat(part) for part in above)
            _kernels.extract_lower(
                *flat_above, s.fronts[front.parent].n_own, front.place, s.n_border, _flat(rest)
            )  # fmt: skip
        own, rows, y = buffers.matrix("own", c, c), buffers.matrix("rows", r, c), buffers.matrix("y", r, c)
        own[:], y[:] = top, low
        lapack.inverse_of_cholesky(own)
        lapack.solve_from_right(top, y, transposed=False)
        lapack.minus_product(rest, y, rows)
        lapack.subtract_transposed_product(y, rows, own)
        buffers.parts = own, rows, rest


Parts = tuple[np.ndarray, np.ndarray, np.ndarray]


class Buffers:
    """Work space of one supernode at a time, grown as needed, and its three parts."""

    def __init__(self):
        self._memory: dict[str, np.ndarray] = {}
        self.parts: Parts = (np.zeros((0, 0)), np.zeros((0, 0)), np.zeros((0, 0)))

    def matrix(self, name: str, rows: int, columns: int) -> np.ndarray:
        """An uninitialised Fortran-ordered matrix."""
        if name not in self._memory or len(self._memory[name]) < rows * columns:
            self._memory[name] = np.empty(rows * columns)
        return self._memory[name][: rows * columns].reshape(rows, columns, order="F")


def _flat(a: np.ndarray) -> np.ndarray:
    """A Fortran-ordered matrix as its elements in memory order."""
    return a.reshape(-1, order="F")


def _inverted(lower: np.ndarray) -> np.ndarray:
    """(L·Lᵀ)⁻¹, the lower half."""
    inverse = lower.copy(order="F")
    lapack.inverse_of_cholesky(inverse)
    return inverse


def _symmetric_from_lower(a: np.ndarray) -> np.ndarray:
    lower = np.tril(a)
    return lower + np.tril(a, -1).T
