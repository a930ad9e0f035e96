"""A part of a large block that shows its mistake: the photographs around the worst one, some of their points."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array, csr_array

from aerotri.diagnosis.free_model import sub_block
from aerotri.observations import Block
from aerotri.results.adjusted_block import AdjustedBlock

MOST_PHOTOGRAPHS = 60
"""Photographs the search for a mistake works with [C]: a few strips show every usual mistake; more make a search of
many trials slow."""
LARGEST_PART = 240
"""Photographs of a part that is still looking for control: an adjustment of so many takes a second."""
ENOUGH_CONTROL = 5
"""Control points seen twice that a part without GNSS should have: three hold it, two more test whether they fit."""
MOST_RAYS = 12000
"""Rays it works with, likewise [C]: two hundred for each of so many photographs."""
WORST_W = 100.0
"""Test value, in σ, that a single ray counts as at most, and one without a test as [C]: so that one gross error does
not make a photograph the worst."""


def sampled(block: Block, result: AdjustedBlock | None) -> tuple[Block, bool]:
    """The block, or of a large one a part around its worst photograph; whether it is a part."""
    few = len(block.images) <= MOST_PHOTOGRAPHS
    if few and len(block.image_points) <= MOST_RAYS:
        return block, False
    images = np.arange(len(block.images)) if few else _around(block, _worst(block, result))
    part, _ = sub_block(block, images)
    keep = _some_points(part)
    part, _ = sub_block(part, np.arange(len(images)), keep)
    return part, True


def _worst(block: Block, result: AdjustedBlock | None) -> int:
    """The photograph whose rays fit worst; left out counts as worst."""
    measured = np.bincount(block.image_points.image, minlength=len(block.images))
    if result is None or len(result.rays.w) != len(block.image_points):
        return int(np.argmax(measured))
    size = np.nanmax(np.abs(np.nan_to_num(result.rays.w, nan=WORST_W)), axis=1)
    total = np.bincount(block.image_points.image, weights=np.minimum(size, WORST_W), minlength=len(block.images))
    return int(np.argmax(np.where(measured > 5, total / np.maximum(measured, 1), 0.0)))


def _around(block: Block, seed: int) -> np.ndarray:
    """Photographs that hang together with one by common points, the nearest ones."""
    rays, n = block.image_points, len(block.images)
    seen = coo_array((np.ones(len(rays)), (rays.image, rays.point)), shape=(n, len(block.points))).tocsr()
    chosen = np.zeros(n, bool)
    chosen[seed] = True
    while not _is_enough(block, seen, chosen):
        common = seen @ (seen.T @ chosen.astype(float))
        common[chosen] = 0.0
        count = int(chosen.sum())
        room = (MOST_PHOTOGRAPHS if count < MOST_PHOTOGRAPHS else LARGEST_PART) - count
        new = np.argsort(-common, kind="stable")[: min(8, room)]
        new = new[common[new] > 0.0]
        if not len(new):
            break
        chosen[new] = True
    return np.flatnonzero(chosen)


def _is_enough(block: Block, seen: csr_array, chosen: np.ndarray) -> bool:
    """Whether photographs (n,) bool are enough to judge by: many, and with the control that an adjustment needs."""
    count = int(chosen.sum())
    if count < MOST_PHOTOGRAPHS or count >= LARGEST_PART:
        return count >= LARGEST_PART
    if block.gnss_ins is not None:
        return True
    control = block.control
    whole = control.point[~control.is_check & np.isfinite(control.xyz).all(axis=1)]
    rays = np.asarray(seen.T @ chosen.astype(float))[whole]
    return int((rays >= 2).sum()) >= min(ENOUGH_CONTROL, len(whole))


def _some_points(block: Block) -> np.ndarray:
    """(N,) bool: the control and check points, and others at random up to a number of rays."""
    count = np.bincount(block.image_points.point, minlength=len(block.points))
    keep = np.zeros(len(block.points), bool)
    keep[block.control.point] = True
    order = np.random.default_rng(1).permutation(np.flatnonzero(~keep & (count >= 2)))
    order = order[np.argsort(-np.minimum(count[order], 3), kind="stable")]
    total = np.cumsum(count[order])
    keep[order[total <= MOST_RAYS - count[keep].sum()]] = True
    return keep
