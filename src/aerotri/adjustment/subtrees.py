"""Which supernodes of a dissection tree are worked on beside one another: whole subtrees, then what they meet in.

The order within a subtree, and in which a supernode adds up what its children leave, is the same however many threads
there are: numbers repeat bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from aerotri.adjustment.parallel import SMALL_WORK, blas_threads, run_chunks, thread_count

T = TypeVar("T")

TRUNK = 3
"""Levels of the tree that are worked on one by one [C]: the up to eight subtrees below keep two to eight threads about
equally busy, though the halves of a cut differ."""
SMALL_TREE = 2e7
"""Multiplications in the whole tree below which no threads are begun: a millisecond of work."""


@dataclass(frozen=True, eq=False)
class Schedule:
    """Supernodes in the order of work, from the leaves up.

    Parameters
    ----------
    branches : subtrees, each its supernodes with children first.
    trunk : levels of what is above, the deepest first.
    work : (k,) multiplications of every supernode.
    """

    branches: tuple[range, ...]
    trunk: tuple[tuple[int, ...], ...]
    work: np.ndarray

    def upwards(self, function: Callable[[int], T]) -> list[T]:
        """Of every supernode, its children before it, in no order."""
        found = [
            value for part in self.over_branches(lambda b: [function(k) for k in self.branches[b]]) for value in part
        ]
        for level in self.trunk:
            found += self._over_level(function, level)
        return found

    def down_the_trunk(self, function: Callable[[int], object]) -> None:
        """Of the supernodes above the branches, every one before its children."""
        for level in reversed(self.trunk):
            self._over_level(function, level)

    def over_branches(self, function: Callable[[int], T]) -> list[T]:
        """Of every branch, by its number, the largest begun first."""
        if not self._threaded:
            with blas_threads(float(self.work.sum())):
                return [function(b) for b in range(len(self.branches))]
        order = np.argsort([-self.work[branch.start : branch.stop].sum() for branch in self.branches], kind="stable")
        with blas_threads(0.0):
            found = run_chunks(lambda i: (int(order[i]), function(int(order[i]))), len(order))
        return [value for _, value in sorted(found, key=lambda pair: pair[0])]

    def _over_level(self, function: Callable[[int], T], level: Sequence[int]) -> list[T]:
        """Fewer large supernodes than threads come one after the other, all threads at each."""
        work = float(self.work[list(level)].max())
        together = self._threaded and len(level) > 1 and (len(level) >= thread_count() or work < SMALL_WORK)
        if not together:
            with blas_threads(work):
                return [function(k) for k in level]
        with blas_threads(0.0):
            return run_chunks(lambda i: function(level[i]), len(level))

    @property
    def _threaded(self) -> bool:
        return thread_count() > 1 and float(self.work.sum()) >= SMALL_TREE


def schedule(parent: np.ndarray, depth: np.ndarray, work: np.ndarray) -> Schedule:
    """The schedule of a tree whose supernodes are numbered children first, subtree by subtree.

    Parameters
    ----------
    parent, depth, work : (k,) supernode above (−1 for a root), distance from the root, multiplications.
    """
    first = np.arange(len(parent))
    for k, above in enumerate(parent.tolist()):
        if above >= 0:
            first[above] = min(first[above], first[k])
    branches = tuple(range(int(first[k]), k + 1) for k in np.flatnonzero(depth == TRUNK).tolist())
    trunk = tuple(tuple(np.flatnonzero(depth == d).tolist()) for d in range(TRUNK - 1, -1, -1) if (depth == d).any())
    return Schedule(branches, trunk, work)
