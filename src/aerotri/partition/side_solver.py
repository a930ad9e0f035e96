"""Right sides of all parts solved for together, up the tree of parts and down again."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from aerotri.partition.course import Course, Place
from aerotri.partition.part_tasks import PartTask
from aerotri.partition.side_tasks import REST, SHARED, SUMS, Sides, drop_sides, follow_sides, join_sides


class SideSolver:
    """Solves with the factors at the place where an adjustment ended.

    Parameters
    ----------
    course : over the parts. place : where it ended.

    `inverse` is that over the shared parameters (s, s).
    """

    def __init__(self, course: Course, place: Place):
        self.course, self.at = course, place.at
        self.inverse, self._names = course.solved(place).inverse, 0

    def next_sides(self, summed: bool = False) -> Sides:
        """Right sides of a new name."""
        self._names += 1
        return Sides(self.at.tag, f"sides{self._names}", summed)

    def solve(
        self, sides: Sides, function: Callable[[Any, PartTask], Any], shared: Any, own: np.ndarray | None = None
    ) -> tuple[list[Any], np.ndarray]:
        """Let every part leave its right sides, and solve; what the parts say, and the shared parameters (s, k).

        Parameters
        ----------
        function : task of a part, which keeps what it reduced; given `shared`. own : (s, k) of the shared parameters.
        """
        found, rest = self._up(sides, function, shared)
        solution = self.inverse @ (rest if own is None else rest + own)
        joints = self.course.joints
        joints.root.keep_array(f"{SHARED}_{sides.name}", solution)
        for level in joints.tree.downwards():
            joints.run(follow_sides, sides, level)
        return found, solution

    def sum_up(self, sides: Sides, function: Callable[[Any, PartTask], Any], shared: Any) -> np.ndarray:
        """(k, ·) what the parts keep as sums added up, less RᵀN⁻¹R of their right sides R in the first k columns."""
        _, rest = self._up(sides, function, shared)
        sums = self.course.joints.root.array(f"{SUMS}_{sides.name}")
        sums[:, : rest.shape[1]] -= rest.T @ self.inverse @ rest
        self.drop(sides)
        return sums

    def drop(self, sides: Sides) -> None:
        """Remove the files of right sides."""
        joints = self.course.joints
        for task in (*joints.parts, *joints.tasks):
            drop_sides(task.files, sides.name)

    def _up(self, sides: Sides, function: Callable[[Any, PartTask], Any], shared: Any) -> tuple[list[Any], np.ndarray]:
        joints = self.course.joints
        found = self.course.run(function, shared)
        for level in joints.tree.upwards():
            joints.run(join_sides, sides, level)
        return found, joints.root.array(f"{REST}_{sides.name}")
