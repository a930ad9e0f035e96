"""Block sparse Cholesky of the bordered reduced normal matrix, and its inverse on the same pattern.

Multifrontal [L: Duff & Reid 1983; Takahashi 1973 for the inverse]: every supernode of the dissection tree is a dense
front on BLAS. The border of shared parameters is the last supernode, so that step, covariance and correlations of all
unknowns come from one factor. Panels and work stacks are allocated once per block and reused by every factorisation;
a `Factor` is therefore valid until the next one of the same `Symbolic`.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg.blas import dtrsm  # pyright: ignore[reportAttributeAccessIssue]

from aerotri.adjustment import _factor_kernels as _kernels
from aerotri.adjustment import dense as lapack
from aerotri.adjustment.dissection import Tree, dissect
from aerotri.adjustment.kernel_records import Front, FrontBlocks, Inverse, MatrixBlocks
from aerotri.adjustment.parallel import blas_threads, refuse_more_than_there_is
from aerotri.adjustment.subtrees import schedule

B = 6
"""Unknowns of a photograph."""

PIVOT_LIMIT = 1e-13
"""Smallest pivot, relative to a unit diagonal, that is taken for a number and not for rounding."""


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


@dataclass(frozen=True, eq=False)
class _Front:
    """Symbolic part of a supernode: own columns, rows below them, and where blocks and updates go.

    columns, rows : scalar indices into the elimination-ordered vector.
    n_own, n_rows : number of photographs in either.
    blocks : the matrix blocks that begin here, with their places in the front.
    place : position of each row photograph in the parent's front.
    """

    first: int
    n_own: int
    rows: np.ndarray
    scalar_rows: np.ndarray
    blocks: FrontBlocks
    place: np.ndarray
    parent: int
    depth: int


class Symbolic:
    """Everything about the factor that depends only on which photographs share points.

    Parameters
    ----------
    n : number of photographs.
    block_row, block_col : (nb,) photographs of each stored block, row ≤ column; the n diagonal blocks come first.
    position : (n, 2) plan coordinates of the projection centres.
    n_border : number of shared parameters s.
    last : (·,) photographs that are eliminated last, together; chosen by the dissection where None.

    `times_factorised` counts the matrices factorised here; `corner_factor` (s, s) is the triangle of the last border.
    """

    def __init__(
        self, n: int, block_row: np.ndarray, block_col: np.ndarray, position: np.ndarray, n_border: int,
        last: np.ndarray | None = None,
    ):  # fmt: skip
        self.n, self.n_border = n, n_border
        self.block_row, self.block_col = block_row, block_col
        off = block_row != block_col
        self.tree = dissect(n, np.column_stack([block_row[off], block_col[off]]), position, last=last)
        self.rank = np.empty(n, dtype=np.int64)
        self.rank[self.tree.order] = np.arange(n)
        self.fronts = self._fronts(self.tree)
        self._children: list[list[int]] = [[] for _ in self.fronts]
        for k, front in enumerate(self.fronts):
            if front.parent >= 0:
                self._children[front.parent].append(k)
        self.schedule = schedule(self.tree.parent, self.tree.depth, np.array([_work(front) for front in self.fronts]))
        self.times_factorised = 0
        self._allocate()

    def __getstate__(self) -> dict[str, Any]:
        # the numbers of a factor stay where they are: only the plan travels
        rooms = ("_panels", "_stacks", "corner_factor")
        return {name: value for name, value in self.__dict__.items() if name not in rooms}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self.times_factorised = 0
        self._allocate()

    @property
    def size(self) -> int:
        return B * self.n + self.n_border

    @property
    def factor_entries(self) -> int:
        """Numbers stored in the factor."""
        return len(self._panels)

    @cached_property
    def flops(self) -> float:
        """Multiplications of one factorisation."""
        return float(self.schedule.work.sum())

    def _fronts(self, tree: Tree) -> list[_Front]:
        low = np.minimum(self.rank[self.block_row], self.rank[self.block_col])
        high = np.maximum(self.rank[self.block_row], self.rank[self.block_col])
        flipped = self.rank[self.block_row] < self.rank[self.block_col]
        by_low = np.argsort(low, kind="stable")
        bounds = np.searchsorted(low[by_low], tree.start)
        border = B * self.n + np.arange(self.n_border)
        children: list[list[int]] = [[] for _ in tree.parent]
        below: list[np.ndarray] = []
        fronts = []
        for k in range(len(tree.parent)):
            first, end = tree.start[k], tree.start[k + 1]
            block = by_low[bounds[k] : bounds[k + 1]]
            parts = [high[block]] + [below[child] for child in children[k]]
            rows = np.unique(np.concatenate(parts))
            rows = rows[rows >= end]
            below.append(rows)
            if tree.parent[k] >= 0:
                children[tree.parent[k]].append(k)
            scalar = np.concatenate([(B * rows[:, None] + np.arange(B)).ravel(), border])
            local = np.concatenate([np.arange(first, end), rows])
            fronts.append(
                _Front(
                    first=int(first),
                    n_own=int(end - first),
                    rows=rows,
                    scalar_rows=scalar,
                    blocks=FrontBlocks(block, np.searchsorted(local, high[block]), low[block] - first, flipped[block]),
                    place=np.zeros(0, np.int64),
                    parent=int(tree.parent[k]),
                    depth=int(tree.depth[k]),
                )
            )
        return [self._with_place(front, fronts) for front in fronts]

    @staticmethod
    def _with_place(front: _Front, fronts: list[_Front]) -> _Front:
        if front.parent < 0:
            return front
        above = fronts[front.parent]
        local = np.concatenate([above.first + np.arange(above.n_own), above.rows])
        return replace(front, place=np.searchsorted(local, front.rows))

    def _allocate(self) -> None:
        """Panels of the factor, and room for the update matrices: of every branch two stacks, of the trunk all."""
        sizes = [(B * front.n_own, len(front.scalar_rows)) for front in self.fronts]
        ends = np.cumsum([0, *(c * c + r * c for c, r in sizes)]).tolist()
        self._spans = [(begin, begin + c * c, end) for begin, end, (c, _) in zip(ends, ends[1:], sizes, strict=False)]
        self._updates, room = [(0, 0)] * len(sizes), [0]
        for level in self.schedule.trunk:
            for k in level:
                self._updates[k] = 0, room[0]
                room[0] += sizes[k][1] ** 2
        for branch in self.schedule.branches:
            self._stack_updates(branch, room)
        self.bytes_needed = 8 * (ends[-1] + sum(room) + self._inverse_entries())
        refuse_more_than_there_is(self.bytes_needed, f"the normal equations of {self.n} photographs")
        self._panels = np.empty(ends[-1])
        self._stacks = [np.empty(size) for size in room]
        self.corner_factor = np.empty((self.n_border, self.n_border), order="F")

    def _stack_updates(self, branch: range, room: list[int]) -> None:
        """Places of a branch's update matrices on two stacks, for even and odd depths; their sizes go into `room`."""
        tops, peaks, live = [0, 0], [0, 0], dict[int, int]()
        for k in branch:
            side, size = self.fronts[k].depth % 2, len(self.fronts[k].scalar_rows) ** 2
            for child in self._children[k]:
                tops[1 - side] -= live.pop(child)
            self._updates[k] = len(room) + side, tops[side]
            live[k] = size
            tops[side] += size
            peaks[side] = max(peaks[side], tops[side])
        room += peaks

    def _inverse_entries(self) -> int:
        """Numbers that the inverse on the pattern holds at most: its blocks, the trunk, a front a depth below."""
        total = len(self.block_row) * B * B + self.size * self.n_border
        for part in [(k,) for level in self.schedule.trunk for k in level] + list(self.schedule.branches):
            largest: dict[int, int] = {}
            for front in (self.fronts[k] for k in part):
                size = B * front.n_own + len(front.scalar_rows)
                largest[front.depth] = max(largest.get(front.depth, 0), size * size)
            total += sum(largest.values())
        return total

    def panel(self, k: int) -> tuple[np.ndarray, np.ndarray]:
        """L of supernode k: its own triangle and the rows below, Fortran order."""
        a, b, c = self._spans[k]
        own = B * self.fronts[k].n_own
        return (
            self._panels[a:b].reshape(own, own, order="F"),
            self._panels[b:c].reshape(len(self.fronts[k].scalar_rows), own, order="F"),
        )

    @property
    def eliminated(self) -> np.ndarray:
        """The numbers of all supernodes but the root, a view."""
        return self._panels[: self._spans[-1][0]]

    def update(self, k: int) -> np.ndarray:
        """Update matrix of supernode k on its stack, Fortran order."""
        r = len(self.fronts[k].scalar_rows)
        room, begin = self._updates[k]
        return self._stacks[room][begin : begin + r * r].reshape(r, r, order="F")

    def factorise(self, matrix: BorderedMatrix) -> Factor:
        """Cholesky factor of the matrix, scaled to a unit diagonal first.

        Raises
        ------
        NotPositiveDefiniteError
            When a pivot is not positive or drowns in rounding.
        """
        self.times_factorised += 1
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
        for child in self._children[k]:
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


def _work(front: _Front) -> float:
    """Multiplications that a front takes."""
    c, r = B * front.n_own, len(front.scalar_rows)
    return c**3 / 3 + c * c * r + c * r * r


def _factor_triangle(a: np.ndarray) -> float:
    """Lower Cholesky in place; the smallest pivot."""
    found = lapack.cholesky(a)
    pivots = np.diagonal(a)
    if not found or not np.isfinite(pivots).all() or (pivots * pivots).min() < PIVOT_LIMIT:
        raise NotPositiveDefiniteError
    return float((pivots * pivots).min())


def eliminate(top: np.ndarray, low: np.ndarray, rest: np.ndarray) -> float:
    """One front: L11 = chol(top), L21 = low·L11⁻ᵀ, rest −= L21·L21ᵀ, all in place."""
    smallest = _factor_triangle(top)
    lapack.solve_from_right(top, low, transposed=True)
    lapack.subtract_square(low, rest)
    return smallest


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
        flat = rhs.reshape(len(permutation), -1)
        x = np.asfortranarray(flat[permutation] * self._scale[:, None])
        corner = slice(B * s.n, None)
        for k, front in enumerate(s.fronts):
            top, low = s.panel(k)
            if not front.n_own:
                continue
            own = slice(B * front.first, B * (front.first + front.n_own))
            x[own] = dtrsm(1.0, top, x[own], lower=1)
            if len(front.scalar_rows):
                x[front.scalar_rows] -= low @ x[own]
        if s.n_border:
            x[corner] = dtrsm(1.0, s.corner_factor, x[corner], lower=1)
        return x

    def _solve(self, rhs: np.ndarray) -> np.ndarray:
        s = self._symbolic
        permutation = self._permutation()
        x, corner = self._half(rhs, permutation), slice(B * s.n, None)
        if s.n_border:
            x[corner] = dtrsm(1.0, s.corner_factor, x[corner], lower=1, trans_a=1)
        for k in range(len(s.fronts) - 1, -1, -1):
            front = s.fronts[k]
            if not front.n_own:
                continue
            top, low = s.panel(k)
            own = slice(B * front.first, B * (front.first + front.n_own))
            right = x[own] - low.T @ x[front.scalar_rows] if len(front.scalar_rows) else x[own]
            x[own] = dtrsm(1.0, top, right, lower=1, trans_a=1)
        out = np.empty_like(x)
        out[permutation] = x * self._scale[:, None]
        return out.reshape(rhs.shape)

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
