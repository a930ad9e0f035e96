"""What is done at a joint of the tree of parts; each is a task that may run anywhere and twice."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerotri.adjustment.dense_front import DenseFront, half_solved, solved_back
from aerotri.adjustment.sparse_cholesky import NotPositiveDefiniteError
from aerotri.partition.common import Left
from aerotri.partition.part_files import SOLUTION, JointFiles, WorkFiles

B = 6


@dataclass(frozen=True, eq=False)
class Above:
    """Where a part or a joint stands in the front above it.

    Parameters
    ----------
    work : folder of the joint above. size : unknowns of its front.
    place : (k,) its photographs there, in its own order. shared : (s',) its shared parameters among all s; border : s.
    """

    work: Path
    size: int
    place: np.ndarray
    shared: np.ndarray
    border: int

    def columns(self) -> np.ndarray:
        """(6·k + s',) its unknowns among those of the front above."""
        images = (B * self.place[:, None] + np.arange(B)).ravel()
        return np.concatenate([images, self.size - self.border + self.shared])

    def solution(self, tag: str) -> np.ndarray:
        """(6·k + s',) of what stays of it."""
        return WorkFiles(self.work).array(f"{SOLUTION}_{tag}")[self.columns()]

    def inverse(self) -> np.ndarray:
        """(6·k + s', 6·k + s') symmetric, over what stays of it."""
        order = np.argsort(self.place)
        lower = JointFiles(self.work).inverse(self.border).lower_over(self.place[order])
        symmetric = np.tril(lower) + np.tril(lower, -1).T
        back = np.argsort(order)
        images = (B * back[:, None] + np.arange(B)).ravel()
        own = np.concatenate([images, B * len(back) + self.shared])
        return np.asfortranarray(symmetric[np.ix_(own, own)])


@dataclass(frozen=True, eq=False)
class JointTask:
    """A joint.

    Parameters
    ----------
    name : of the joint. work : folder of its work.
    children : files of those that it joins, and where they stand in its front.
    own, rows, border : photographs that are eliminated, photographs that stay, shared parameters.
    above : where what stays stands; None of the root.
    """

    name: str
    work: Path
    children: tuple[tuple[WorkFiles, Above], ...]
    own: int
    rows: int
    border: int
    above: Above | None

    @property
    def files(self) -> JointFiles:
        return JointFiles(self.work)

    @property
    def bytes_needed(self) -> int:
        """Of its front, and as much again for what is added to it or derived from it."""
        c, r = B * self.own, B * self.rows + self.border
        return 16 * (c * c + r * c + r * r)


@dataclass(frozen=True)
class Joined:
    """What a joint tells of its equations.

    Parameters
    ----------
    decrement : of what was eliminated. determined : whether it could be.
    """

    decrement: float
    determined: bool = True


def join(tag: str, task: JointTask) -> Joined:
    """What the children leave added up, and eliminated where nobody else needs it."""
    front = DenseFront.empty(task.own, task.rows, task.border)
    own = B * task.own
    right, diagonal = np.zeros(own + len(front.low)), np.zeros(own + len(front.low))
    for files, child in task.children:
        left = files.left(tag)
        columns = child.columns()
        right[columns] += left.right
        diagonal[columns] += left.diagonal
        front.add(_in_order(left.matrix, child), np.sort(child.place))
    try:
        scale = front.eliminate(diagonal[:own])
    except NotPositiveDefiniteError:
        return Joined(np.inf, determined=False)
    half, rest = (part[:, 0] for part in half_solved(front, scale, right[:, None]))
    task.files.keep_eliminated(front, scale, half, tag)
    task.files.keep_left(Left(front.rest, rest, diagonal[own:]), tag)
    return Joined(float(half @ half))


def follow(tag: str, task: JointTask) -> None:
    """The solution of what stays followed to what was eliminated here; that of all shared parameters at the root."""
    files = task.files
    front, scale, half = files.eliminated(task.border, tag)
    above = files.array(f"shared_{tag}") if task.above is None else task.above.solution(tag)
    own = solved_back(front, scale, half[:, None], above[:, None])[:, 0]
    files.keep_array(f"{SOLUTION}_{tag}", np.concatenate([own, above]))


def invert(tag: str, task: JointTask) -> None:
    """The inverse over the front, from that over what stays; over all shared parameters at the root."""
    files = task.files
    front, scale, _ = files.eliminated(task.border, tag)
    if task.above is None:
        rest = np.asfortranarray(files.array("corner"))
    else:
        above = task.above
        rest = JointFiles(above.work).inverse(task.border).lower_over(above.place)
    files.keep_inverse(front.inverse(scale, rest))


def _in_order(matrix: np.ndarray, child: Above) -> np.ndarray:
    """The matrix of a child with its photographs in the order of the front and the columns of all parameters."""
    order, k = np.argsort(child.place), len(child.place)
    if np.array_equal(child.shared, np.arange(child.border)) and np.array_equal(order, np.arange(k)):
        return matrix
    images = (B * order[:, None] + np.arange(B)).ravel()
    out = np.zeros((B * k + child.border, B * k + child.border), order="F")
    to = np.concatenate([np.arange(B * k), B * k + child.shared])
    out[np.ix_(to, to)] = matrix[np.ix_(*2 * [np.concatenate([images, B * k + np.arange(len(child.shared))])])]
    return out
