"""Which photographs share points: the different pairs, numbered."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.adjustment import _pair_kernels


@dataclass(frozen=True, eq=False)
class PhotographPairs:
    """The e different pairs of photographs that share a point or are tied, rising by the first and then the second.

    Parameters
    ----------
    first, second : (e,) photographs, first < second.
    of_rays : number of the pair for every pair of rays of every point, in the order the assembly meets them.
    of_ties : (t,) number of the pair of every tie.
    """

    first: np.ndarray
    second: np.ndarray
    of_rays: np.ndarray
    of_ties: np.ndarray


def photograph_pairs(start: np.ndarray, image: np.ndarray, n: int, tied: np.ndarray | None = None) -> PhotographPairs:
    """The pairs among n photographs.

    Parameters
    ----------
    start : (P + 1,) first ray of every point. image : (m,) photograph of every ray, rising within a point.
    tied : (t, 2) photographs that are tied to one another without a common point.
    """
    tied = np.zeros((0, 2), np.int64) if tied is None else np.sort(tied, axis=1)
    order, counts = np.argsort(tied[:, 0], kind="stable"), np.diff(start)
    of_rays, of_ties = np.empty(int(np.sum(counts * (counts - 1) // 2)), np.int64), np.empty(len(tied), np.int64)
    codes, first_pair, in_order = (
        np.empty(len(of_rays) + len(tied), np.int64),
        np.zeros(n + 1, np.int64),
        of_ties.copy(),
    )
    _pair_kernels.count_pairs(start, image, first_pair)
    count = _pair_kernels.number_pairs(start, image, tied[order], first_pair, of_rays, in_order, codes)
    of_ties[order] = in_order
    return PhotographPairs(codes[:count] // n, codes[:count] % n, of_rays, of_ties)
