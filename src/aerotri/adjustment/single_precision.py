"""Steps with a factor in single precision: half the work, and steps that are right to three digits or more.

The right side and the cost are in double precision, so that such steps lead to the same minimum: what one leaves, the
next takes [L: iterative refinement, Higham, Accuracy and stability of numerical algorithms, 2002, chapter 12]. Where
the matrix is so near to singular that single precision would not tell it from singular, the factor is a double one.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.null_space import smallest_eigenvalue
from aerotri.adjustment.panels import DOUBLE, SINGLE
from aerotri.adjustment.reduced_equations import NormalEquations
from aerotri.adjustment.secants import Secants
from aerotri.adjustment.sparse_cholesky import Factor
from aerotri.adjustment.steps import Place, Trial, take_step

LEAST_WORK = 1e9
"""Multiplications of a factor from which single precision is taken [C]: below, it saves less than ten milliseconds."""

SURE_EIGENVALUE = 1e-6
"""Smallest eigenvalue by a factor in single precision that its rounding, some 1e-7 of the diagonal, did not make."""


def first_precision(system: NormalSystem, is_robust: bool) -> np.dtype[Any]:
    """Of the first factor. Re-weighting compares steps so nearly alike that it needs all digits."""
    return SINGLE if not is_robust and system.symbolic.flops >= LEAST_WORK else DOUBLE


def is_sure(factor: Factor, equations: NormalEquations) -> bool:
    """Whether a factor in single precision shows that nothing is free."""
    return smallest_eigenvalue(factor, equations.diagonal) >= SURE_EIGENVALUE


def precise_enough(
    system: NormalSystem, at: Place, damping: float, secants: Secants | None, precision: np.dtype[Any], is_first: bool
) -> tuple[Trial | None, np.dtype[Any]]:
    """A step in this precision, in double precision where single does not serve; and the precision of the next.

    Parameters
    ----------
    is_first : the matrix has not been looked at yet, whether anything is free.
    """
    step = take_step(system, at, damping, secants, precision)
    serves = step is not None and (not is_first or is_sure(step.factor, at.equations))
    if precision == DOUBLE or serves:
        return step, precision
    return take_step(system, at, damping, secants), DOUBLE
