"""Many right sides at once through the tree of parts, with the factors that the equations at a place left.

A part reduces its right sides and leaves what remains for its shared unknowns; joints add that up and reduce it on, up
to the shared parameters at the root, and the solutions go down again. What belongs to the right sides of one name are
files beside those of the equations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.adjustment.dense_front import half_solved, solved_back
from aerotri.adjustment.partial_factor import PartialFactor
from aerotri.partition.joint_tasks import JointTask
from aerotri.partition.part_files import SOLUTION, WorkFiles
from aerotri.partition.part_tasks import PartTask

HALF, REST, SUMS, SHARED = "half", "rest", "sums", "shared"


@dataclass(frozen=True)
class Sides:
    """Right sides.

    Parameters
    ----------
    tag : of the equations. name : of their files. summed : whether matrices over them are added up on the way.
    """

    tag: str
    name: str
    summed: bool = False


def keep_reduced(factor: PartialFactor, sides: Sides, right: np.ndarray, task: PartTask) -> np.ndarray:
    """Reduce right sides (6·n + s, k) of a part; HᵀH (k, k) of what is eliminated."""
    half = factor.reduce_sides(right)
    inner = len(half) - factor.kept
    task.files.keep_array(f"{HALF}_{sides.name}", half)
    task.files.keep_array(f"{REST}_{sides.name}", half[inner:])
    return half[:inner].T @ half[:inner]


def followed(factor: PartialFactor, sides: Sides, task: PartTask) -> np.ndarray:
    """(6·n + s, k) solutions of a part."""
    return factor.expand_sides(task.files.array(f"{HALF}_{sides.name}"), task.there.solution(sides.name))


def keep_sums(sums: np.ndarray, sides: Sides, task: PartTask) -> None:
    """Keep what is added up over all parts; (k, ·), from the first k columns of which joints take HᵀH."""
    task.files.keep_array(f"{SUMS}_{sides.name}", sums)


def join_sides(sides: Sides, task: JointTask) -> None:
    """What the children leave added up, and reduced by the photographs that are eliminated here."""
    front, scale, _ = task.files.eliminated(task.border, sides.tag)
    rests = [files.array(f"{REST}_{sides.name}") for files, _ in task.children]
    right = np.zeros((len(scale) + len(front.low), rests[0].shape[1]), order="F")
    for (_, child), rest in zip(task.children, rests, strict=True):
        right[child.columns()] += rest
    half, rest = half_solved(front, scale, right)
    task.files.keep_array(f"{HALF}_{sides.name}", half)
    task.files.keep_array(f"{REST}_{sides.name}", rest)
    if sides.summed:
        sums = np.sum([files.array(f"{SUMS}_{sides.name}") for files, _ in task.children], axis=0)
        sums[:, : half.shape[1]] -= half.T @ half
        task.files.keep_array(f"{SUMS}_{sides.name}", sums)


def follow_sides(sides: Sides, task: JointTask) -> None:
    """The solutions of what stays followed to what was eliminated here; those of all shared parameters at the root."""
    files = task.files
    front, scale, _ = files.eliminated(task.border, sides.tag)
    half = files.array(f"{HALF}_{sides.name}")
    above = files.array(f"{SHARED}_{sides.name}") if task.above is None else task.above.solution(sides.name)
    files.keep_array(f"{SOLUTION}_{sides.name}", np.concatenate([solved_back(front, scale, half, above), above]))


def drop_sides(files: WorkFiles, name: str) -> None:
    """Remove what belongs to right sides."""
    files.drop(*(f"{what}_{name}" for what in (HALF, REST, SUMS, SHARED, SOLUTION)))
