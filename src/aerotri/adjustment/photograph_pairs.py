"""Which photographs share points: the different pairs, numbered."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.adjustment import _pair_kernels
from aerotri.adjustment.kernel_records import PairedRays


@dataclass(frozen=True, eq=False)
class PhotographPairs:
    """The e different pairs of photographs that share a point or are tied, rising by the first and then the second.

    Parameters
    ----------
    first, second : (e,) photographs, first < second.
    start : (P + 1,) first pair of rays of every point.
    of_rays : number of the pair for every pair of rays of every point, in the order the assembly meets them; 32 bits,
        for there are many.
    of_ties : (t,) number of the pair of every tie.
    """

    first: np.ndarray
    second: np.ndarray
    start: np.ndarray
    of_rays: np.ndarray
    of_ties: np.ndarray


def photograph_pairs(
    start: np.ndarray, image: np.ndarray, n: int, tied: np.ndarray | None = None, first_number: int = 0
) -> PhotographPairs:
    """The pairs among n photographs.

    Parameters
    ----------
    start : (P + 1,) first ray of every point. image : (m,) photograph of every ray, rising within a point.
    tied : (t, 2) photographs that are tied to one another without a common point.
    first_number : of the first pair.
    """
    tied = np.zeros((0, 2), np.int64) if tied is None else np.sort(tied, axis=1)
    order = np.argsort(tied[:, 0], kind="stable")
    rays = _rays_of(start, image, n)
    of_rays, of_ties = np.empty(rays.pair_start[-1], np.int32), np.empty(len(tied), np.int64)
    codes, in_order = np.empty(len(of_rays) + len(tied), np.int64), of_ties.copy()
    count = _pair_kernels.number_pairs(rays, tied[order], first_number, of_rays, in_order, codes)
    of_ties[order] = in_order
    return PhotographPairs(codes[:count] // n, codes[:count] % n, rays.pair_start, of_rays, of_ties)


def _rays_of(start: np.ndarray, image: np.ndarray, n: int) -> PairedRays:
    """The rays with their points, and in order of their photographs."""
    counts = np.diff(start)
    first_ray = np.concatenate([[0], np.cumsum(np.bincount(image, minlength=n))])
    return PairedRays(
        start=start,
        image=image,
        point=np.repeat(np.arange(len(counts), dtype=np.int32), counts),
        pair_start=np.concatenate([[0], np.cumsum(counts * (counts - 1) // 2)]).astype(np.int64),
        by_image=ordered(image, first_ray[:-1], np.arange(len(image))),
        first_ray=first_ray,
    )


def ordered(key: np.ndarray, first: np.ndarray, items: np.ndarray) -> np.ndarray:
    """The items in order of their keys; those of one key stay in the order they have.

    Parameters
    ----------
    key : of every item, a whole number from 0. first : where the items of every key begin.
    """
    order = np.empty(len(items), np.int64)
    _pair_kernels.order_by(key, first.copy(), items, order)
    return order
