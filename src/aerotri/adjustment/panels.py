"""Where the numbers of a block sparse factor stand: supernodes, their rows, panels and work stacks.

Panels and stacks are allocated once per block and used again by every factorisation.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from aerotri.adjustment.dissection import Tree, dissect
from aerotri.adjustment.kernel_records import FrontBlocks
from aerotri.adjustment.parallel import refuse_more_than_there_is
from aerotri.adjustment.subtrees import schedule

DOUBLE, SINGLE = np.dtype(np.float64), np.dtype(np.float32)
B = 6
"""Unknowns of a photograph."""


@dataclass(frozen=True, eq=False)
class Supernode:
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


class Panels:
    """Everything about the factor that depends only on which photographs share points, and room for its numbers.

    Parameters
    ----------
    n : number of photographs.
    block_row, block_col : (nb,) photographs of each stored block, row ≤ column; the n diagonal blocks come first.
    position : (n, 2) plan coordinates of the projection centres.
    n_border : number of shared parameters s.
    last : (·,) photographs that are eliminated last, together; chosen by the dissection where None.

    `children` of every supernode; `times_factorised` counts the matrices factorised here; `corner_factor` (s, s) is the
    triangle of the last border, and `precision` the type of the numbers that stand here.
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
        self.children: list[list[int]] = [[] for _ in self.fronts]
        for k, front in enumerate(self.fronts):
            if front.parent >= 0:
                self.children[front.parent].append(k)
        self.schedule = schedule(self.tree.parent, self.tree.depth, np.array([_work(front) for front in self.fronts]))
        self.times_factorised = 0
        self._allocate()

    def __getstate__(self) -> dict[str, Any]:
        # the numbers of a factor stay where they are: only the plan travels
        rooms = ("_room", "_panels", "_stacks", "_views", "corner_factor")
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
        return self._spans[-1][2] if self._spans else 0

    @cached_property
    def flops(self) -> float:
        """Multiplications of one factorisation."""
        return float(self.schedule.work.sum())

    def _fronts(self, tree: Tree) -> list[Supernode]:
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
                Supernode(
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
    def _with_place(front: Supernode, fronts: list[Supernode]) -> Supernode:
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
        self._room = [np.empty(size) for size in (ends[-1], *room, self.n_border**2)]
        self._take(DOUBLE)

    def begin(self, precision: np.dtype[Any]) -> None:
        """Make room for another factor, of numbers of a precision: what stands here is lost."""
        self.times_factorised += 1
        self._take(precision)

    def _take(self, precision: np.dtype[Any]) -> None:
        if "_views" in self.__dict__ and precision == self.precision:
            return
        self.precision = precision
        self._panels, *self._stacks, corner = (part.view(precision)[: len(part)] for part in self._room)
        self._views = [self._view(k) for k in range(len(self.fronts))]
        self.corner_factor = corner.reshape(self.n_border, self.n_border, order="F")

    def _stack_updates(self, branch: range, room: list[int]) -> None:
        """Places of a branch's update matrices on two stacks, for even and odd depths; their sizes go into `room`."""
        tops, peaks, live = [0, 0], [0, 0], dict[int, int]()
        for k in branch:
            side, size = self.fronts[k].depth % 2, len(self.fronts[k].scalar_rows) ** 2
            for child in self.children[k]:
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
        return self._views[k]

    def _view(self, k: int) -> tuple[np.ndarray, np.ndarray]:
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


def _work(front: Supernode) -> float:
    """Multiplications that a front takes."""
    c, r = B * front.n_own, len(front.scalar_rows)
    return c**3 / 3 + c * c * r + c * r * r
