"""A wrong principal distance, or size of a pixel: from how high the model has to be, or from the image points alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from aerotri.diagnosis.evidence import Evidence, fit
from aerotri.diagnosis.free_model import FreeModel, free_model, with_focal_factor
from aerotri.diagnosis.hypothesis import Hypothesis
from aerotri.observations import Block

FACTORS = np.exp(np.linspace(np.log(0.08), np.log(12.5), 25))
"""Factors of the principal distance that are tried before the search, 23 % apart [C]: a mistake of ten times either
way lies inside; wider steps might miss the minimum."""
LEAST_FACTOR = 0.002
"""Change of the principal distance, as a share, that is worth saying."""
SAME_FACTOR = 0.03
"""Difference, as a share, below which a factor that was found is taken for a usual one [C]: above the uncertainty of a
factor found from positions, below the distance of two usual ones."""
KNOWN_FACTORS = (0.1, 24.0 / 35.0, 0.5, 35.0 / 24.0, 2.0, 10.0)
"""Usual mistakes: mm and cm, reduced and enlarged images, a lens of 24 mm exchanged with one of 35 mm [C]."""
POOR_FIT = 1.0
"""Median miss of the rays in the model, in tolerances, from which other principal distances are tried for it."""
MUCH_BETTER = 3.0
"""Factor by which the median miss has to shrink [C]: a wrong principal distance spoils the fit by far more; a few
percent any change can give."""


def of_focal_length(
    block: Block, model: FreeModel, evidence_of: Callable[[FreeModel], Evidence]
) -> Iterator[Hypothesis]:
    """The principal distance that the positions ask for, from how high the model has to be.

    Parameters
    ----------
    evidence_of : a model, as function of it.
    """
    if _is_free(block):
        return

    def cost(log_factor: float) -> float:
        return fit(evidence_of(model.stretched(float(np.exp(log_factor))))).cost

    grid = np.log(FACTORS)
    costs = np.array([cost(g) for g in grid])
    best = int(np.argmin(costs))
    low, high = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
    ratio = (np.sqrt(5.0) - 1.0) / 2.0
    for _ in range(12):
        a, b = high - ratio * (high - low), low + ratio * (high - low)
        low, high = (low, b) if cost(a) <= cost(b) else (a, high)
    factor = float(np.exp(0.5 * (low + high)))
    near = min(KNOWN_FACTORS, key=lambda known: abs(np.log(factor / known)))
    if abs(np.log(factor / near)) < SAME_FACTOR:
        factor = near
    if abs(np.log(factor)) > LEAST_FACTOR:
        yield focal_hypothesis(factor)


def of_inner_fit(block: Block, model: FreeModel) -> Iterator[Hypothesis]:
    """A usual factor with which the image points fit one another much better, whatever is given beside them."""
    miss = _median_miss(model)
    if miss < POOR_FIT or _is_free(block):
        return
    for factor in KNOWN_FACTORS:
        other = free_model(with_focal_factor(block, factor))
        if other is not None and other.joined.sum() >= model.joined.sum() and MUCH_BETTER * _median_miss(other) < miss:
            yield replace(focal_hypothesis(factor), on_model=_instead(other))


def _instead(model: FreeModel) -> Callable[[FreeModel], FreeModel]:
    return lambda _: model


def _median_miss(model: FreeModel) -> float:
    return float(np.median(model.miss[model.joined]))


def _is_free(block: Block) -> bool:
    return all(camera.interior["focal_length_mm"].kind == "free" for camera in block.cameras)


def focal_hypothesis(factor: float) -> Hypothesis:
    """Another principal distance, estimated from there on."""

    def change(block: Block) -> Block:
        cameras = []
        for camera in with_focal_factor(block, factor).cameras:
            prior = camera.interior["focal_length_mm"]
            free = replace(prior, fixed=False, sigma=None)
            cameras.append(replace(camera, interior={**camera.interior, "focal_length_mm": free}))
        return replace(block, cameras=tuple(cameras))

    return Hypothesis(
        "block", f"{factor:.4g} times the principal distance", change, on_model=lambda m: m.stretched(factor),
        plural=False, free_focal=True,
    )  # fmt: skip
