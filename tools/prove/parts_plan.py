"""Measures what a block in parts costs by its pattern: memory, files, multiplications, up to a million photographs.

Photographs stand on a grid (80/40 %: each has points in common with the four before and behind it, and with those of
the strips beside it). The cuts, the part in the middle, and the tree over the parts are those of the program; nothing
is computed but which numbers there would be, so it looks inside the package on purpose. Measured sizes stand in
tools/results/parts.md and docs/validation/speed.md. Prints Markdown.

    python tools/prove/parts_plan.py > tools/results/parts_plan.md
"""

from __future__ import annotations

import argparse

import numpy as np

from aerotri.adjustment.dissection import bisect
from aerotri.adjustment.sparse_cholesky import Symbolic
from aerotri.partition.tree import Joint, PartsTree, tree_over

ACROSS, B, PARAMETERS = 1, 6, 44
"""Strips beside that a photograph has points in common with; unknowns of a photograph; shared parameters."""
CLUSTERS, TURNS, DIRECTIONS, CONTROL, TESTS = 12, 38, 36, 48, 8
"""Of the model part of σ: groups of a large block and turns until their solutions stand; columns of the weakest
deformations and of control; tests, of which each has six columns a group and goes up only: strips, photographs, and
three random divisions of two schemes."""
MULTIPLICATIONS_A_SECOND = 10e9
"""Of one core, taken for the times; of the machine that the measured sizes were run on."""
HEAD = (
    "photographs", "parts", "shared photographs of a part", "of all", "factor of a part GB",
    "largest front of a joint GB", "its task GB", "files of an iteration GB", "of them joints",
    "multiplications of the parts 10¹²", "of the joints 10¹²", "minutes of one core, parts", "joints",
    "joints one above the other", "numbers of all factors 10⁹", "multiplications of the model part 10¹²",
    "GB read for it",
)  # fmt: skip
OF_LEVELS = (
    "joints above", "joints", "own photographs of the largest", "photographs that stay", "front GB", "files GB",
    "multiplications 10¹²",
)  # fmt: skip


class Planned(Symbolic):
    """The plan of a factor without its room."""

    def _allocate(self) -> None:
        entries = sum((B * f.n_own) * (B * f.n_own + len(f.scalar_rows)) for f in self.fronts)
        largest: dict[int, int] = {}
        for front in self.fronts:
            largest[front.depth] = max(largest.get(front.depth, 0), len(front.scalar_rows) ** 2)
        self.entries, self.updates = entries, sum(largest.values())


class JointCost:
    """Numbers of a joint: of its front, of what it keeps in files, and its multiplications."""

    def __init__(self, joint: Joint):
        c, r = B * joint.own, B * len(joint.rows) + PARAMETERS
        self.front, self.files = c * c + r * c + r * r, c * c + r * c + r * r
        self.flops = c**3 / 3 + c * c * r + c * r * r
        self.numbers, self.kept = c * c / 2 + c * r, c * c + c * r
        self.own, self.rows = joint.own, len(joint.rows)


def grid(photographs: int, along_reach: int) -> tuple[np.ndarray, np.ndarray]:
    """(n, 2) places, a base along and two and a half across; (e, 2) pairs with common points."""
    strips = max(3, round(0.63 * photographs**0.5))
    length = photographs // strips
    number = np.arange(strips * length).reshape(strips, length)
    edges = []
    for across in range(ACROSS + 1):
        for along in range(-along_reach if across else 1, along_reach + 1):
            first, last = max(0, -along), length - max(0, along)
            one = number[: strips - across, first:last].ravel()
            other = number[across:, first + along : last + along].ravel()
            edges.append(np.column_stack([one, other]))
    place = np.column_stack([np.tile(np.arange(length), strips), np.repeat(3.0 * np.arange(strips), length)])
    return place.astype(float), np.concatenate(edges)


def cut(place: np.ndarray, edges: np.ndarray, parts: int) -> np.ndarray:
    """(n,) part of every photograph, −1 where it is shared; as `partition.dividing.divide` cuts."""
    side_of, whole = np.zeros(len(place), dtype=np.int8), [(np.arange(len(place)), edges)]
    while len(whole) < parts:
        members, inner = whole.pop(max(range(len(whole)), key=lambda k: len(whole[k][0])))
        halves = bisect(members, inner, place, side_of)
        if halves is None:
            raise ValueError("no cut")
        whole += list(halves[:2])
    of = np.full(len(place), -1)
    for number, (members, _) in enumerate(whole):
        of[members] = number
    return of


def planned_block(photographs: int, of_a_part: int, along_reach: int) -> tuple[str, PartsTree]:
    """The row of one size, and its tree."""
    place, edges = grid(photographs, along_reach)
    n, parts = len(place), max(2, round(photographs / of_a_part))
    of = cut(place, edges, parts)
    both = np.concatenate([edges, edges[:, ::-1]])
    touch = both[(of[both[:, 0]] >= 0) & (of[both[:, 1]] < 0)]
    codes = np.unique(of[touch[:, 0]] * n + touch[:, 1])
    shared = [codes[codes // n == k] % n for k in range(parts)]
    means = np.array([place[of == k].mean(axis=0) for k in range(parts)])
    middle = int(np.argmin(np.abs(means - place.mean(axis=0)).sum(axis=1)))
    here = np.sort(np.concatenate([np.flatnonzero(of == middle), shared[middle]]))
    own = planned(place, edges, here, np.flatnonzero(of[here] < 0))
    kept = np.unique(np.concatenate(shared))
    tree = tree_over([np.searchsorted(kept, one) for one in shared], means, len(kept))
    joints = [JointCost(joint) for joint in tree.joints]
    left = sum(8.0 * (B * len(one) + PARAMETERS) ** 2 for one in shared)
    of_joints = sum(8.0 * joint.files for joint in joints)
    largest, flops = max(joint.front for joint in joints), sum(joint.flops for joint in joints)
    in_a_row = sum(max(joints[k].flops for k in level) for level in tree.upwards())
    minute = 60.0 * MULTIPLICATIONS_A_SECOND
    of_factors = own.entries * parts + sum(joint.numbers for joint in joints)
    columns = DIRECTIONS + CONTROL + (TURNS + 2) * CLUSTERS + TESTS * 6 * CLUSTERS / 2
    passes = 2 * (TURNS + 3) + TESTS
    read = 8e-9 * passes * (own.entries * parts + sum(joint.kept for joint in joints))
    numbers = (
        f"{n}", f"{parts}", f"{np.mean([len(one) for one in shared]):.0f}", f"{len(kept)}",
        f"{8.0 * (own.entries + own.updates) / 1e9:.2f}", f"{8.0 * largest / 1e9:.2f}", f"{16.0 * largest / 1e9:.2f}",
        f"{(left + 8.0 * own.entries * parts + of_joints) / 1e9:.1f}", f"{of_joints / 1e9:.1f}",
        f"{own.flops * parts / 1e12:.2f}", f"{flops / 1e12:.2f}", f"{own.flops * parts / minute:.1f}",
        f"{flops / minute:.1f}", f"{in_a_row / minute:.1f}", f"{of_factors / 1e9:.2f}",
        f"{2.0 * columns * of_factors / 1e12:.2f}", f"{read:.0f}",
    )  # fmt: skip
    return "| " + " | ".join(numbers) + " |", tree


def planned(place: np.ndarray, edges: np.ndarray, here: np.ndarray, last: np.ndarray) -> Planned:
    """The plan of a part."""
    inside = np.zeros(len(place), dtype=bool)
    inside[here] = True
    own = np.searchsorted(here, np.sort(edges[inside[edges].all(axis=1)], axis=1))
    own_row, own_column = (np.concatenate([np.arange(len(here)), column]) for column in own.T)
    return Planned(len(here), own_row, own_column, place[here], PARAMETERS, last)


def say_levels(tree: PartsTree) -> None:
    """A row for every level of a tree, from the root down."""
    print("| " + " | ".join(OF_LEVELS) + " |")
    print("|" + "---|" * len(OF_LEVELS))
    for depth, level in enumerate(tree.downwards()):
        joints = [JointCost(tree.joints[k]) for k in level]
        largest = max(joints, key=lambda joint: joint.front)
        print(
            f"| {depth} | {len(joints)} | {largest.own} | {largest.rows} | {8.0 * largest.front / 1e9:.3f} | "
            f"{8.0 * sum(joint.files for joint in joints) / 1e9:.1f} | {sum(j.flops for j in joints) / 1e12:.2f} |"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=int, nargs="*", default=[10_000, 60_000, 250_000, 1_000_000])
    parser.add_argument("--of-a-part", type=int, default=2000, help="photographs")
    parser.add_argument("--along", type=int, default=4, help="neighbours in the strip with common points: 2 of 60 %%")
    asked = parser.parse_args()
    print(f"# Blocks in parts of some {asked.of_a_part} photographs, from their pattern (tools/prove/parts_plan.py)\n")
    print("| " + " | ".join(HEAD) + " |")
    print("|" + "---|" * len(HEAD))
    tree = None
    for size in asked.sizes:
        row, tree = planned_block(size, asked.of_a_part, asked.along)
        print(row, flush=True)
    if tree is not None:
        print("\nThe joints of the largest, level by level from the root:\n")
        say_levels(tree)


if __name__ == "__main__":
    main()
