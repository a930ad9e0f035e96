"""The reduced normal equations at a state, as records: the right side alone, and with the matrix."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.adjustment.rigging import Chain
from aerotri.adjustment.robust import Estimator
from aerotri.adjustment.sparse_cholesky import BorderedMatrix
from aerotri.adjustment.unknowns import State


@dataclass(frozen=True, eq=False)
class RightSide:
    """The right side of the reduced normal equations at a state.

    Parameters
    ----------
    right : (6·n + s,) right side.
    cost : Σρ of all observations (vᵀPv when not robust).
    point_decrement : the points' part of the Newton decrement.
    residual : (m, 2) mm, measured − predicted, in ray order; weight : (m,) robust factors.
    undetermined : row of a point that its rays do not determine, −1 if there is none.
    of_photographs : (6·n + s,) the right side before photographs follow others on a rigid rig.
    rounding : what the cost, and the decrement of a step, are uncertain by since numbers have sixteen digits.
    """

    right: np.ndarray
    cost: float
    point_decrement: float
    residual: np.ndarray
    weight: np.ndarray
    undetermined: int
    of_photographs: np.ndarray
    rounding: float

    @property
    def are_numbers(self) -> bool:
        """Whether a step can be had from them: nothing in them overflowed."""
        return bool(np.isfinite(self.cost) and np.isfinite(self.point_decrement) and np.isfinite(self.right).all())


@dataclass(frozen=True, eq=False)
class NormalEquations(RightSide):
    """The reduced normal equations at a state.

    Parameters
    ----------
    matrix : of photographs and shared parameters.
    diagonal : (6·n + s,) of the same unknowns before the points are eliminated: what rounding is measured against.
    of_rays : (6·n + s,) the part of the diagonal that rays alone make, undamped.
    chain : of rigid rigs, what leads from stations and mountings to the photographs; None without.
    at : where they were assembled, the estimator of their weights; None where they are damped.
    """

    matrix: BorderedMatrix
    diagonal: np.ndarray
    of_rays: np.ndarray
    chain: Chain | None = None
    at: tuple[State, Estimator] | None = None

    @property
    def are_numbers(self) -> bool:
        """As of the right side; with the matrix."""
        parts = self.matrix.blocks, self.matrix.border, self.matrix.corner, self.diagonal
        return super().are_numbers and all(bool(np.isfinite(part).all()) for part in parts)
