"""A model laid on given positions by a similarity that wrong positions do not spoil.

[L] Umeyama's closed form on the triple whose transformation leaves the least median misfit (Rousseeuw 1984), then
re-weighted until nothing changes.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from aerotri.coordinates.similarity import Similarity, nearest_similarities, nearest_similarity

TRIPLES = 150
"""Sets of three positions tried where there are more than ten [C]: with half of the positions wrong one in eight has
none of them, with four fifths wrong one in 125."""
REWEIGHTINGS = 6
"""Similarities after the best three, each with the weights of the one before [C]: weights settle in a few; the outcome
is compared, not reported."""
COLLINEAR = 0.03
"""Second extension over the first below which positions count as a line [C]: less does not hold the roll against wrong
positions, more would take two close strips for one."""
VIRTUAL_WEIGHT = 1e-3
"""Weight of the point below the block that holds the roll of a single strip."""


def lay_on(source: np.ndarray, target: np.ndarray, looking: np.ndarray) -> Similarity | None:
    """The robust similarity of two sets of positions; None where they do not determine one.

    Parameters
    ----------
    source, target : (k, 3), finite. looking : (3,) direction in the source frame that is down in the target frame,
        which holds the roll where the positions lie on a line.
    """
    if len(source) < 2 or np.ptp(target, axis=0).max() == 0.0 or np.ptp(source, axis=0).max() == 0.0:
        return None
    if len(source) == 2 or _is_line(target) or _is_line(source):
        return _along_line(source, target, looking)
    triples = _triples(len(source))
    scale, rotation, translation = nearest_similarities(source[triples], target[triples], np.ones(triples.shape))
    misfit = np.linalg.norm(
        scale[:, None, None] * (source @ np.swapaxes(rotation, 1, 2)) + translation[:, None] - target, axis=2
    )
    # of up to four positions the median says nothing
    score = np.median(misfit, axis=1) if len(source) > 4 else np.sort(misfit, axis=1)[:, :3].sum(axis=1)
    score = np.where(np.isfinite(score), score, np.inf)
    best = int(np.argmin(score))
    placed = Similarity(float(scale[best]), rotation[best], translation[best])
    return _reweighted(placed, source, target, np.ones(len(source)))


def _reweighted(placed: Similarity, source: np.ndarray, target: np.ndarray, base: np.ndarray) -> Similarity:
    for _ in range(REWEIGHTINGS):
        misfit = np.linalg.norm(placed(source) - target, axis=1)
        spread = max(float(np.median(misfit)), 1e-12 * float(np.abs(target).max() + 1.0))
        weight = base / (1.0 + (misfit / (3.0 * spread)) ** 2)
        placed = nearest_similarity(source, target, weight)
    return placed


def _along_line(source: np.ndarray, target: np.ndarray, looking: np.ndarray) -> Similarity:
    """Positions on a line, with a point far below them on either side."""
    below = target.mean(axis=0) - [0.0, 0.0, np.linalg.norm(np.ptp(target, axis=0))]
    beyond = source.mean(axis=0) + looking / np.linalg.norm(looking) * np.linalg.norm(np.ptp(source, axis=0))
    source, target = np.vstack([source, beyond]), np.vstack([target, below])
    base = np.append(np.ones(len(source) - 1), VIRTUAL_WEIGHT)
    return _reweighted(nearest_similarity(source, target, base), source, target, base)


def _is_line(xyz: np.ndarray) -> bool:
    size = np.linalg.svd(xyz - xyz.mean(axis=0), compute_uv=False)
    return bool(size[1] < COLLINEAR * max(size[0], 1e-300))


@lru_cache(maxsize=32)
def _triples(count: int) -> np.ndarray:
    """(t, 3) rows: all of them or a sample."""
    if count <= 10:
        rows = np.array(np.meshgrid(*[np.arange(count)] * 3)).reshape(3, -1).T
        return rows[(rows[:, 0] < rows[:, 1]) & (rows[:, 1] < rows[:, 2])]
    rng = np.random.default_rng(1)
    return np.array([rng.choice(count, 3, replace=False) for _ in range(TRIPLES)])
