"""What parts share, solved for: up the tree of parts, and down again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from aerotri.adjustment.sparse_cholesky import PIVOT_LIMIT, NotPositiveDefiniteError
from aerotri.conventions import real_path
from aerotri.execution.work import Executor, Work
from aerotri.partition.common import Common, Left
from aerotri.partition.joint_tasks import Above, Joined, JointTask, follow, invert, join
from aerotri.partition.part_files import JointFiles, WorkFiles
from aerotri.partition.part_tasks import PartTask
from aerotri.partition.tree import PartsTree, tree_over

LEAST_BYTES = 500_000_000
"""Memory of a task beside its front [C]: program and libraries."""


@dataclass(frozen=True, eq=False)
class Corner:
    """The shared parameters, all photographs eliminated.

    Parameters
    ----------
    step : (s,). decrement : of all that was eliminated at joints, and of this step. inverse : (s, s).
    """

    step: np.ndarray
    decrement: float
    inverse: np.ndarray


class Joints:
    """The joints of a block in parts.

    Parameters
    ----------
    common : what is shared. parts : tasks. folder : of all work, which every worker sees.
    """

    def __init__(self, common: Common, parts: Sequence[PartTask], executor: Executor, folder: Path):
        self._common, self._executor, self._folder = common, executor, folder
        self.tree: PartsTree = tree_over(common.of_images, common.middle, len(common.images))
        above = self._above(len(parts))
        self.parts = [replace(task, above=there) for task, there in zip(parts, above, strict=False)]
        files = [*(WorkFiles(task.work) for task in parts), *(WorkFiles(self._work(k)) for k in range(len(self)))]
        self.tasks = [
            JointTask(
                f"{k:04d}", self._work(k), tuple((files[child], _known(above[child])) for child in joint.children),
                joint.own, len(joint.rows), len(common.labels), above[len(parts) + k],
            )
            for k, joint in enumerate(self.tree.joints)
        ]  # fmt: skip
        self._corners: dict[str, Corner] = {}

    def __len__(self) -> int:
        return len(self.tree.joints)

    def solved(self, tag: str, shared: np.ndarray, damping: float) -> Corner:
        """The step of the shared parameters at a place where every part has left its equations.

        Raises
        ------
        NotPositiveDefiniteError
            When something is not determined.
        """
        if tag not in self._corners:
            decrement = sum(self._joined(tag, level) for level in self.tree.upwards())
            left = self._common.with_priors(self.root.left(tag), shared, damping)
            self.root.drop_left(tag)
            self._corners[tag] = _corner(left, decrement)
        return self._corners[tag]

    def follow(self, tag: str) -> None:
        """The solution of everything that is shared, for the parts to read."""
        self.root.keep_array(f"shared_{tag}", self._corners[tag].step)
        for level in self.tree.downwards():
            self.run(follow, tag, level)

    def invert(self, tag: str) -> None:
        """The inverse over what is shared, for the parts to read."""
        self.root.keep_array("corner", self._corners[tag].inverse)
        parents = self.tree.parents()
        needed = {parents[k] for k in range(len(self.parts))}
        levels = self.tree.downwards()
        for k, level in enumerate(levels):
            self.run(invert, tag, level)
            for joint in levels[k - 1] if k else []:
                if joint not in needed:
                    self.tasks[joint].files.drop_inverse()

    def drop(self, tag: str) -> None:
        """What belongs to the equations at one place."""
        self._corners.pop(tag, None)
        self.root.drop(f"shared_{tag}")
        for task in self.tasks:
            task.files.drop_place(tag)

    def _joined(self, tag: str, level: Sequence[int]) -> float:
        """Decrement of a level; what its children left is not needed any more."""
        found: list[Joined] = self.run(join, tag, level)
        if not all(one.determined for one in found):
            raise NotPositiveDefiniteError
        for joint in level:
            for files, _ in self.tasks[joint].children:
                files.drop_left(tag)
        return sum(one.decrement for one in found)

    def run(self, function: Callable[[Any, JointTask], Any], shared: Any, level: Sequence[int]) -> list[Any]:
        """A task for every joint of a level."""
        tasks = [self.tasks[k] for k in level]
        most = max(task.bytes_needed for task in tasks) + LEAST_BYTES
        names = [f"joint {task.name}" for task in tasks]
        return self._executor.run(Work(function, shared, tasks, names, "joints", self._folder, bytes_each=most))

    @property
    def root(self) -> JointFiles:
        """Where the shared parameters are solved for."""
        return self.tasks[-1].files

    def _above(self, parts: int) -> list[Above | None]:
        """Where every part and every joint but the root stands."""
        tree, s = self.tree, len(self._common.labels)
        out: list[Above | None] = []
        for node, joint in enumerate(tree.parents()):
            if joint < 0:
                out.append(None)
                continue
            shared = self._common.of_shared[node] if node < parts else np.arange(s)
            size = 6 * len(tree.joints[joint].images) + s
            out.append(Above(self._work(joint), size, tree.place(node, joint), shared, s))
        return out

    def _work(self, joint: int) -> Path:
        return real_path(self._folder / f"joint_{joint:04d}")


def _known(above: Above | None) -> Above:
    assert above is not None
    return above


def _corner(left: Left, decrement: float) -> Corner:
    """Solved and inverted, scaled to the diagonal that the matrix had before anything was eliminated."""
    if not len(left.right):
        return Corner(np.zeros(0), decrement, np.zeros((0, 0)))
    if not np.isfinite(left.diagonal).all() or (left.diagonal <= 0.0).any():
        raise NotPositiveDefiniteError
    scale = 1.0 / np.sqrt(left.diagonal)
    try:
        factor = cho_factor(left.matrix * scale[:, None] * scale, lower=True)
    except np.linalg.LinAlgError as error:
        raise NotPositiveDefiniteError from error
    if (np.diagonal(factor[0]) ** 2).min() < PIVOT_LIMIT:
        raise NotPositiveDefiniteError
    step = scale * cho_solve(factor, scale * left.right)
    inverse = cho_solve(factor, np.eye(len(scale))) * scale[:, None] * scale
    return Corner(step, decrement + float(step @ left.right), 0.5 * (inverse + inverse.T))
