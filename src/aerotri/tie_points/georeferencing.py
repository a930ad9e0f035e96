"""A first orientation, in a frame of its own, brought onto control points or observed positions: robust similarity.

[L] Umeyama's closed form on the triple whose transformation fits most of the others (least median of squares,
Rousseeuw 1984), then with weights that fall with the misfit, until nothing changes.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from aerotri.conventions import SIGMA_PER_MAD, InputError, counted
from aerotri.coordinates.similarity import nearest_similarity

COLLINEAR = 0.03
"""Width over length of a set of points below which it is a line."""
TRIPLES = 1000
"""Triples of points that are tried; chosen [C]: with half of the points wrong one in eight is right, so that 1000 hold
more than a hundred right ones."""
REWEIGHTINGS = 30
"""Rounds of reweighted least squares; chosen [C]: more than the weights need to settle, and a round costs next to
nothing."""
TUNING = 3.0
"""Misfit, in robust standard deviations, at which a point has half its weight."""
VIRTUAL_WEIGHT = 1e-4
"""Weight of the points that hold the roll of a single straight strip."""


@dataclass(frozen=True, eq=False)
class Placement:
    """target ≈ scale·R·source + translation.

    Parameters
    ----------
    misfit : (k,) m, of the points it was found from.
    """

    scale: float
    rotation: np.ndarray
    translation: np.ndarray
    misfit: np.ndarray

    def __call__(self, xyz: np.ndarray) -> np.ndarray:
        return self.scale * xyz @ self.rotation.T + self.translation


def place(
    source: np.ndarray, target: np.ndarray, sigma: np.ndarray, looking: np.ndarray | None = None, seed: int = 1
) -> Placement:
    """The similarity of points in two frames.

    Parameters
    ----------
    source, target : (k, 3). sigma : (k,) m, how well the target is known.
    looking : (3,) mean direction of view in the source frame, which is taken as down where the points lie on a line;
        None: that is refused.

    Raises
    ------
    InputError
        When the points do not determine it.
    """
    if len(source) < 2 or (looking is None and len(source) < 3):
        raise InputError(
            f"{counted(len(source), 'known point is', 'known points are')} too few to place the block",
            "give three control points, or positions of the photographs",
        )
    # triples are drawn by place: the same points in another order, or another frame, have to give the same
    order = np.lexsort(source.T)
    source, target, sigma = source[order], target[order], sigma[order]
    weight = 1.0 / sigma**2
    if is_line(target):
        if looking is None:
            raise InputError("the control points lie on a line", "add one beside it, or positions of the photographs")
        source, target, weight = _with_down(source, target, weight, looking)
        scale, rotation, translation = _similarity(source, target, weight)
    else:
        scale, rotation, translation = _best_triple(source, target, sigma, seed)
    count = len(sigma)
    misfit = np.full(count, np.nan)
    for _ in range(REWEIGHTINGS):
        misfit = np.linalg.norm(scale * source @ rotation.T + translation - target, axis=1)
        relative = misfit[:count] / sigma
        spread = max(SIGMA_PER_MAD * float(np.median(relative)), 1e-9)
        robust = weight.copy()
        robust[:count] /= 1.0 + (relative / (TUNING * spread)) ** 2
        scale, rotation, translation = _similarity(source, target, robust)
    return Placement(scale, rotation, translation, misfit[np.argsort(order)])


def is_line(xyz: np.ndarray) -> bool:
    """Whether points (k, 3) lie nearly on a line."""
    size = np.linalg.svd(xyz - xyz.mean(axis=0), compute_uv=False)
    return len(xyz) < 3 or size[1] < COLLINEAR * max(size[0], 1e-300)


def _similarity(source: np.ndarray, target: np.ndarray, weight: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Scale, rotation and translation by weighted least squares."""
    found = nearest_similarity(source, target, weight)
    return found.scale, found.rotation, found.translation


def _best_triple(source: np.ndarray, target: np.ndarray, sigma: np.ndarray, seed: int):
    """The similarity of the three points that leaves the least median misfit over σ at all points."""
    count, best = len(source), None
    every = count * (count - 1) * (count - 2) // 6
    rng = np.random.default_rng(seed)
    triples = (
        combinations(range(count), 3)
        if every <= TRIPLES
        else (rng.choice(count, 3, replace=False) for _ in range(TRIPLES))
    )
    for triple in triples:
        own = list(triple)
        if is_line(target[own]):
            continue
        found = _similarity(source[own], target[own], np.ones(3))
        misfit = np.linalg.norm(found[0] * source @ found[1].T + found[2] - target, axis=1) / sigma
        # of three points the median says nothing
        score = float(np.median(misfit)) if count > 4 else float(misfit.sum())
        if best is None or score < best[0]:
            best = (score, found)
    if best is None:
        return _similarity(source, target, 1.0 / sigma**2)
    return best[1]


def _with_down(source: np.ndarray, target: np.ndarray, weight: np.ndarray, looking: np.ndarray):
    """The points of a line and, with hardly any weight, others below them: the roll that the line leaves free."""
    long_source, long_target = (np.linalg.norm(np.ptp(xyz, axis=0)) for xyz in (source, target))
    below = target - [0.0, 0.0, long_target]
    beyond = source + looking / np.linalg.norm(looking) * long_source
    return np.vstack([source, beyond]), np.vstack([target, below]), np.append(weight, VIRTUAL_WEIGHT * weight)
