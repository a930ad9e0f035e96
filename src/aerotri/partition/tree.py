"""The tree over the parts of a block: what parts share is eliminated where they meet, not all at once.

The parts are divided in two, again and again, where they have the fewest photographs in common. Where two sides meet is
a joint: photographs that no part beyond it sees are eliminated there. [L: George 1973]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

MIDDLE = (0.3, 0.7)
"""Shares of the parts between which a cut is looked for [C]: both sides cost about alike."""


@dataclass(frozen=True, eq=False)
class Joint:
    """Where two sides meet.

    Parameters
    ----------
    children : two numbers of nodes: the parts come first, then the joints in the order of elimination.
    images : (c + r,) shared photographs, by their rank in the order of elimination, rising.
    own : c, those that are eliminated here.
    height : of its subtree, 1 above two parts. depth : below the root.
    """

    children: tuple[int, int]
    images: np.ndarray
    own: int
    height: int
    depth: int

    @property
    def rows(self) -> np.ndarray:
        """(r,) photographs that stay."""
        return self.images[self.own :]


@dataclass(frozen=True, eq=False)
class PartsTree:
    """All joints, children before parents; the root is the last.

    Parameters
    ----------
    rank : (n,) of every shared photograph in the order of elimination.
    of_parts : ranks of the photographs of every part, in the order of the part.
    """

    joints: tuple[Joint, ...]
    rank: np.ndarray
    of_parts: tuple[np.ndarray, ...]

    def parents(self) -> list[int]:
        """Joint above every node but the root, by the number of the node."""
        parent = [-1] * (len(self.of_parts) + len(self.joints))
        for k, joint in enumerate(self.joints):
            for child in joint.children:
                parent[child] = k
        return parent

    def place(self, node: int, joint: int) -> np.ndarray:
        """(k,) where what a node leaves stands in the front of the joint above it; that of a part in its order."""
        count = len(self.of_parts)
        images = self.of_parts[node] if node < count else self.joints[node - count].rows
        return np.searchsorted(self.joints[joint].images, images)

    def upwards(self) -> list[list[int]]:
        """Joints that can be done at the same time, from the parts to the root."""
        return _together([joint.height for joint in self.joints])

    def downwards(self) -> list[list[int]]:
        """Joints that can be done at the same time, from the root to the parts."""
        return _together([joint.depth for joint in self.joints])


def tree_over(of_images: Sequence[np.ndarray], middle: np.ndarray, n: int) -> PartsTree:
    """The tree over two parts or more.

    Parameters
    ----------
    of_images : shared photographs of every part among all n, each once. middle : (p, 2) m, of the parts.
    """
    count = np.bincount(np.concatenate(of_images), minlength=n)
    found: list[tuple[tuple[int, int], np.ndarray, np.ndarray, int, int]] = []

    def meet(parts: np.ndarray, depth: int) -> tuple[int, np.ndarray, np.ndarray, int]:
        """Number of the node over some parts, what it leaves, how many parts inside see each, its height."""
        if len(parts) == 1:
            images = of_images[parts[0]]
            return int(parts[0]), images, np.ones(len(images), dtype=np.int64), 0
        one, other = (meet(side, depth + 1) for side in _split(parts, of_images, middle, n))
        seen = np.bincount(one[1], one[2], minlength=n) + np.bincount(other[1], other[2], minlength=n)
        images = np.flatnonzero(seen)
        stays = seen[images] < count[images]
        height = 1 + max(one[3], other[3])
        found.append(((one[0], other[0]), images[~stays], images[stays], height, depth))
        rows = images[stays]
        return len(of_images) + len(found) - 1, rows, seen[rows].astype(np.int64), height

    meet(np.arange(len(of_images)), 0)
    rank = np.empty(n, dtype=np.int64)
    rank[np.concatenate([own for _, own, _, _, _ in found])] = np.arange(n)
    joints = tuple(
        Joint(children, np.concatenate([np.sort(rank[own]), np.sort(rank[rows])]), len(own), height, depth)
        for children, own, rows, height, depth in found
    )
    return PartsTree(joints, rank, tuple(rank[images] for images in of_images))


def _split(
    parts: np.ndarray, of_images: Sequence[np.ndarray], middle: np.ndarray, n: int
) -> tuple[np.ndarray, np.ndarray]:
    """Both sides of the line across the middles of the parts that fewest photographs lie on."""
    if len(parts) == 2:
        return parts[:1], parts[1:]
    centred = np.nan_to_num(middle[parts] - np.nanmean(middle[parts], axis=0))
    _, _, axes = np.linalg.svd(centred, full_matrices=False)
    low = max(1, round(MIDDLE[0] * len(parts)))
    cuts = np.arange(low, len(parts) - low + 1)
    best = None
    for axis in axes:
        order = parts[np.argsort(centred @ axis, kind="stable")]
        first, last = np.full(n, len(parts)), np.full(n, -1)
        for k, part in enumerate(order):
            first[of_images[part]] = np.minimum(first[of_images[part]], k)
            last[of_images[part]] = k
        across = [int(np.sum((first < cut) & (last >= cut))) for cut in cuts]
        k = min(range(len(cuts)), key=lambda k: (across[k], abs(2 * int(cuts[k]) - len(parts))))
        if best is None or across[k] < best[0]:
            best = (across[k], order, int(cuts[k]))
    assert best is not None
    _, order, cut = best
    return np.sort(order[:cut]), np.sort(order[cut:])


def _together(level: Sequence[int]) -> list[list[int]]:
    out: dict[int, list[int]] = {}
    for k, its in enumerate(level):
        out.setdefault(its, []).append(k)
    return [out[its] for its in sorted(out)]
