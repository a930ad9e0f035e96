"""Measures what a block in parts costs by its pattern: memory, files, multiplications, up to a million photographs.

Photographs stand on a grid (80/40 %: each has points in common with the four before and behind it, and with those of
the strips beside it). The cuts, the part in the middle, and the equations of what is shared are those of the program;
nothing is computed but which numbers there would be, so it looks inside the package on purpose. Measured sizes stand in
tools/results/parts.md. Prints Markdown.

    python tools/prove/parts_plan.py > tools/results/parts_plan.md
"""

from __future__ import annotations

import argparse

import numpy as np

from aerotri.adjustment.dissection import bisect
from aerotri.adjustment.sparse_cholesky import Symbolic
from aerotri.partition.common import pattern

ALONG, ACROSS, B, PARAMETERS = 4, 1, 6, 44
"""Neighbours in the strip and strips beside that a photograph has points in common with; unknowns of a photograph;
shared parameters."""
OF_A_PART = 2000
MULTIPLICATIONS_A_SECOND = 10e9
"""Of one core, taken for the times; of the machine that the measured sizes were run on."""
HEAD = (
    "photographs", "parts", "shared photographs of a part", "of all", "factor of a part GB", "files of an iteration GB",
    "memory of what is shared GB", "multiplications of the parts 10¹²", "of what is shared 10¹²",
    "minutes of one core, parts", "what is shared",
)  # fmt: skip


class Planned(Symbolic):
    """The plan of a factor without its room."""

    def _allocate(self) -> None:
        entries = sum((B * f.n_own) * (B * f.n_own + len(f.scalar_rows)) for f in self.fronts)
        largest: dict[int, int] = {}
        for front in self.fronts:
            largest[front.depth] = max(largest.get(front.depth, 0), len(front.scalar_rows) ** 2)
        self.entries, self.updates = entries, sum(largest.values())


def grid(photographs: int) -> tuple[np.ndarray, np.ndarray]:
    """(n, 2) places, a base along and two and a half across; (e, 2) pairs with common points."""
    strips = max(3, round(0.63 * photographs**0.5))
    length = photographs // strips
    number = np.arange(strips * length).reshape(strips, length)
    edges = []
    for across in range(ACROSS + 1):
        for along in range(-ALONG if across else 1, ALONG + 1):
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


def row(photographs: int) -> str:
    """One size."""
    place, edges = grid(photographs)
    n, parts = len(place), max(2, round(photographs / OF_A_PART))
    of = cut(place, edges, parts)
    both = np.concatenate([edges, edges[:, ::-1]])
    touch = both[(of[both[:, 0]] >= 0) & (of[both[:, 1]] < 0)]
    codes = np.unique(of[touch[:, 0]] * n + touch[:, 1])
    shared = [codes[codes // n == k] % n for k in range(parts)]
    middle = int(np.argmin([np.abs(place[of == k].mean(axis=0) - place.mean(axis=0)).sum() for k in range(parts)]))
    here = np.sort(np.concatenate([np.flatnonzero(of == middle), shared[middle]]))
    own = planned(place, edges, here, np.flatnonzero(of[here] < 0))
    kept = np.unique(np.concatenate(shared))
    _, first, second = pattern([np.searchsorted(kept, one) for one in shared], len(kept))
    root = Planned(len(kept), first, second, place[kept], PARAMETERS)
    left = [8.0 * (B * len(one) + PARAMETERS) ** 2 for one in shared]
    of_root = 8.0 * (root.entries + root.updates + 36 * len(first)) / 1e9
    numbers = (
        f"{n}", f"{parts}", f"{np.mean([len(one) for one in shared]):.0f}", f"{len(kept)}",
        f"{8.0 * (own.entries + own.updates) / 1e9:.2f}", f"{(sum(left) + 8.0 * own.entries * parts) / 1e9:.1f}",
        f"{of_root:.1f}", f"{own.flops * parts / 1e12:.2f}", f"{root.flops / 1e12:.2f}",
        f"{own.flops * parts / MULTIPLICATIONS_A_SECOND / 60:.1f}", f"{root.flops / MULTIPLICATIONS_A_SECOND / 60:.1f}",
    )  # fmt: skip
    return "| " + " | ".join(numbers) + " |"


def planned(place: np.ndarray, edges: np.ndarray, here: np.ndarray, last: np.ndarray) -> Planned:
    """The plan of a part."""
    inside = np.zeros(len(place), dtype=bool)
    inside[here] = True
    own = np.searchsorted(here, np.sort(edges[inside[edges].all(axis=1)], axis=1))
    own_row, own_column = (np.concatenate([np.arange(len(here)), column]) for column in own.T)
    return Planned(len(here), own_row, own_column, place[here], PARAMETERS, last)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=int, nargs="*", default=[10_000, 60_000, 250_000, 1_000_000])
    print("# Blocks in parts of some 2000 photographs, from their pattern (tools/prove/parts_plan.py)\n")
    print("| " + " | ".join(HEAD) + " |")
    print("|" + "---|" * len(HEAD))
    for size in parser.parse_args().sizes:
        print(row(size), flush=True)


if __name__ == "__main__":
    main()
