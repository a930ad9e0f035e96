"""The similarity (Helmert) transformation of adjusted points onto given coordinates, whole or in part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.adjustment.datum import motions_of_points
from aerotri.functional_model.rotation import exponential, logarithm

MOTIONS = 7
"""Parameters of a similarity in space: three translations, three rotations, one scale."""
ITERATIONS = 30
"""[C] Steps of Gauss-Newton shrink quadratically: a few suffice; the bound ends what does not converge."""
CONVERGED = 1e-10
"""Effect of the last step, in m of the coordinate with the largest weight [C]: far below the digits of any coordinate,
far above rounding of reduced ones."""
LARGEST_CONDITION = 1e10
"""Condition of the scaled equations beyond which given coordinates do not determine all seven motions."""


@dataclass(frozen=True, eq=False)
class Similarity:
    """given ≈ scale·R·(point − centre) + centre + translation, by least squares over the given coordinates.

    Parameters
    ----------
    translation : (3,) m, at the middle of the points. rotation : (3,) rad about the object axes. scale : 1 = unchanged.
    residual : (k, 3) m, transformed − given, NaN where not given.
    redundancy : given coordinates less seven.
    """

    translation: np.ndarray
    rotation: np.ndarray
    scale: float
    residual: np.ndarray
    redundancy: int

    @property
    def rms(self) -> np.ndarray:
        """(3,) m, root mean square of the residuals in X, Y, Z; NaN where nothing is given."""
        known = np.isfinite(self.residual)
        squares = np.where(known, self.residual, 0.0) ** 2
        return np.sqrt(squares.sum(axis=0) / np.where(known.any(axis=0), known.sum(axis=0), np.nan))


def fit_similarity(points: np.ndarray, given: np.ndarray, sigma: np.ndarray) -> Similarity | None:
    """The transformation of points onto given coordinates; None where these do not determine it.

    A height-only or plan-only point takes part with the coordinates it has.

    Parameters
    ----------
    points : (k, 3) m. given : (k, 3) m, NaN where a coordinate is unknown. sigma : (k, 3) m, of the given coordinates.
    """
    known = np.isfinite(given)
    if known.sum() < MOTIONS:
        return None
    middle = points.mean(axis=0)
    moved, target = points - middle, given - middle
    turn, scale, translation = np.eye(3), 1.0, np.zeros(3)
    weight = 1.0 / sigma[known]
    for _ in range(ITERATIONS):
        g = motions_of_points(moved)[known] * weight[:, None]
        size = np.linalg.norm(g, axis=0)
        if not size.all() or np.linalg.cond(g / size) > LARGEST_CONDITION:
            return None
        motion = np.linalg.lstsq(g / size, (target - moved)[known] * weight, rcond=None)[0] / size
        step, factor = exponential(motion[3:6]), 1.0 + motion[6]
        turn, scale, translation = step @ turn, scale * factor, factor * step @ translation + motion[:3]
        moved = scale * (points - middle) @ turn.T + translation
        if np.abs(motion * size).max() < CONVERGED * max(1.0, np.abs(weight).max()):
            break
    return Similarity(translation, logarithm(turn), scale, moved - target, int(known.sum()) - MOTIONS)
