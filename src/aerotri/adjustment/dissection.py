"""Nested dissection of the photographs: in which order they are eliminated so that the factor stays sparse.

The block is cut in two along a line across its projection centres, again and again; the photographs on one side that
have ties over the cut are the separator and come last. A cut is tried along two axes and at several places near the
middle, and the smallest separator wins. [L] George, Nested dissection of a regular finite element mesh (1973).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LEAF = 20
"""Photographs that are not divided any further [C]: matrices of 120 rows. Smaller ones cost more calls than they save
arithmetic, larger ones hold zeros."""
CUTS = np.linspace(0.38, 0.62, 9)
"""Shares of the photographs before a cut [C]: near the middle, so that both halves cost alike; fewer places miss the
narrowest separator, more cost time."""


@dataclass(frozen=True, eq=False)
class Tree:
    """Supernodes in elimination order (children before parents).

    Parameters
    ----------
    order : (n,) photographs in the order of elimination.
    start : (k + 1,) where each supernode begins in `order`.
    parent : (k,) supernode above, −1 for a root.
    depth : (k,) distance from the root.
    """

    order: np.ndarray
    start: np.ndarray
    parent: np.ndarray
    depth: np.ndarray


def dissect(n: int, edges: np.ndarray, position: np.ndarray, leaf: int = LEAF, last: np.ndarray | None = None) -> Tree:
    """A dissection tree.

    Parameters
    ----------
    n : number of nodes.
    edges : (e, 2) pairs of nodes that share a normal equation block.
    position : (n, 2) plan coordinates used for the cuts; NaN counts as 0.
    leaf : nodes that are not divided any further.
    last : (·,) nodes that come last, together in the root; the root is a separator of the others where None.

    Returns
    -------
    Tree
    """
    position = np.nan_to_num(np.asarray(position, dtype=float))
    side_of = np.zeros(n, dtype=np.int8)
    nodes: list[tuple[np.ndarray, int]] = []

    # explicit stack in post-order: a frame is (nodes, edges, parent slot); children are numbered before their parent
    def cut(members: np.ndarray, inner: np.ndarray) -> int:
        halves = bisect(members, inner, position, side_of) if len(members) > leaf else None
        if halves is None:
            nodes.append((members, -1))
            return len(nodes) - 1
        children = [cut(part, part_edges) for part, part_edges in halves[:2] if len(part)]
        nodes.append((halves[2], -1))
        own = len(nodes) - 1
        for child in children:
            nodes[child] = (nodes[child][0], own)
        return own

    edges = np.asarray(edges, dtype=np.int64).reshape(-1, 2)
    if last is None:
        cut(np.arange(n), edges)
    else:
        inner = np.ones(n, dtype=bool)
        inner[last] = False
        if inner.any():
            top = cut(np.flatnonzero(inner), edges[inner[edges].all(axis=1)])
            nodes[top] = (nodes[top][0], top + 1)
        nodes.append((np.sort(last), -1))
    sizes = np.array([len(members) for members, _ in nodes])
    parent = np.array([above for _, above in nodes])
    depth = np.zeros(len(nodes), dtype=np.int64)
    for k in range(len(nodes) - 1, -1, -1):
        depth[k] = 0 if parent[k] < 0 else depth[parent[k]] + 1
    order = np.concatenate([members for members, _ in nodes]) if nodes else np.zeros(0, np.int64)
    return Tree(order, np.concatenate([[0], np.cumsum(sizes)]), parent, depth)


Half = tuple[np.ndarray, np.ndarray]
"""Members and edges."""


def bisect(
    members: np.ndarray, edges: np.ndarray, position: np.ndarray, side_of: np.ndarray
) -> tuple[Half, Half, np.ndarray] | None:
    """Both halves with their edges, and the separator; None where a cut would not pay.

    Parameters
    ----------
    members : (·,) of n nodes. edges : (e, 2) among them. position : (n, 2). side_of : (n,) room to work in.
    """
    best = None
    halves = np.clip(np.rint(CUTS * len(members)).astype(np.int64), 1, len(members) - 1)
    centred = position[members] - position[members].mean(axis=0)
    _, _, axes = np.linalg.svd(centred, full_matrices=False)
    of_node = np.empty(len(side_of), dtype=np.int64)
    for axis in axes:
        rank = np.argsort(centred @ axis, kind="stable")
        of_node[members[rank]] = np.arange(len(members))
        farthest, nearest = _reach(of_node[edges], len(members))
        sizes = np.stack([_over(farthest, halves), _over(len(members) - 1 - nearest[::-1], len(members) - halves)], 1)
        costs = sizes + 0.05 * np.maximum(halves, len(members) - halves)[:, None]
        k, side = np.unravel_index(np.argmin(costs), costs.shape)
        if best is None or costs[k, side] < best[0]:
            half = int(halves[k])
            tied = half + np.flatnonzero(nearest[half:] < half) if side else np.flatnonzero(farthest[:half] >= half)
            best = (costs[k, side], rank, half, tied)
    if best is None or len(best[3]) > 0.6 * len(members):
        return None
    _, rank, half, tied = best
    separator = np.sort(members[rank[tied]])
    side_of[members[rank[:half]]] = 0
    side_of[members[rank[half:]]] = 1
    side_of[separator] = 2
    parts = [members[side_of[members] == s] for s in (0, 1)]
    if not len(parts[0]) or not len(parts[1]):
        return None
    first, second = side_of[edges[:, 0]], side_of[edges[:, 1]]
    inner = [edges[(first == s) & (second == s)] for s in (0, 1)]
    return (parts[0], inner[0]), (parts[1], inner[1]), separator


def _over(farthest: np.ndarray, cuts: np.ndarray) -> np.ndarray:
    """(c,) how many nodes before each cut are tied to one behind it; farthest (n,) the last that a node is tied to."""
    n = len(farthest)
    change = np.bincount(np.arange(1, n + 1), minlength=n + 2) - np.bincount(farthest + 1, minlength=n + 2)
    return np.cumsum(change)[cuts]


def _reach(edges: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """(n,) largest and (n,) smallest node that each of n nodes is tied to by edges (e, 2), or itself."""
    farthest, nearest = np.arange(n), np.arange(n)
    low, high = np.minimum(edges[:, 0], edges[:, 1]), np.maximum(edges[:, 0], edges[:, 1])
    np.maximum.at(farthest, low, high)
    np.minimum.at(nearest, high, low)
    return farthest, nearest
