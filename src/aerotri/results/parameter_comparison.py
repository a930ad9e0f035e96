"""Sets of additional parameters compared in one block."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.quantiles import chi_square_quantile

BOUNDS = (0.975, 0.025)
"""Of the confidence interval of an RMS, 95 %."""

Choice = tuple[tuple[str, tuple[str, ...]], ...]
"""Families and their parameters, as `parse_parameters` returns them."""


@dataclass(frozen=True, eq=False)
class Accuracy:
    """Differences at k points that took no part, and their RMS with its confidence bounds.

    Parameters
    ----------
    difference : (k, 3) m, NaN where there is none. rms, low, high : (3,) m; the bounds hold at 95 % for independent
        normal differences. count : (3,).
    """

    difference: np.ndarray
    rms: np.ndarray
    low: np.ndarray
    high: np.ndarray
    count: np.ndarray

    @classmethod
    def of(cls, difference: np.ndarray) -> Accuracy:
        """From differences (k, 3) m."""
        known = np.isfinite(difference)
        count = known.sum(axis=0)
        with np.errstate(divide="ignore", invalid="ignore"):
            rms = np.sqrt(np.sum(np.where(known, difference, 0.0) ** 2, axis=0) / count)
            low, high = (rms * np.sqrt(count / chi_square_quantile(p, count)) for p in BOUNDS)
        return cls(difference, rms, low, high, count)


@dataclass(frozen=True, eq=False)
class Evidence:
    """What observations that had no part in it say of a set: −2 ln of the density with which it predicts them.

    Parameters
    ----------
    areas, strips : (a,), (s,) of the image points of every area of the block and of every strip, predicted by all
        other observations; NaN where they cannot be.
    control : (k,) of every control point, predicted without itself; NaN where nothing else determines it.
    sigma_height : RMS in m of the σ of the heights so predicted, NaN where there are none.
    """

    areas: np.ndarray
    strips: np.ndarray
    control: np.ndarray
    sigma_height: float


@dataclass(frozen=True, eq=False)
class AdjustedObject:
    """The object as an adjustment has it, and what it leaves of the image points.

    Parameters
    ----------
    point : (k,) rows of the block's points that have enough rays. xyz : (k, 3) m.
    reach : (k,) m per rad, how far a point moves where all its rays err and the photographs stay; NaN where unknown.
    ray : (m,) rows of the block's image points. residual : (m, 2) rad, times the root of their robust weight.
    free : whether nothing but the datum holds the block, so that only its shape has a meaning.
    """

    point: np.ndarray
    xyz: np.ndarray
    reach: np.ndarray
    ray: np.ndarray
    residual: np.ndarray
    free: bool = False


NOTHING_KNOWN = Evidence(np.zeros(0), np.zeros(0), np.zeros(0), float("nan"))


@dataclass(frozen=True, eq=False)
class SetOutcome:
    """What one set of additional parameters did.

    Parameters
    ----------
    name : its specification. status : 'converged', or why there is nothing behind it.
    count : parameters estimated, of all groups. effective : the same, with a random field's effective number.
    significant : of them with t > 1.96.
    sigma0, sigma0_um : σ̂0, and times the a-priori σ of an image coordinate.
    aic, bic : see above. check, control : at check points; at control points predicted without themselves.
    sigma_um, length_mm : of a random field, NaN elsewhere.
    evidence : what observations say that had no part in it.
    groups : column of images.csv ('strip' among them) whose groups have values of their own, '' where there are none.
    kind : how they are tied, 'independent' or 'walk'. p : probability of their differences where there are none.
    ratio : −2·ln of the restricted likelihood ratio against one set of values for all photographs.
    object : what it makes of the object, None where that is not known.
    """

    name: str
    choice: Choice
    status: str
    count: int
    effective: float
    significant: int
    sigma0: float
    sigma0_um: float
    aic: float
    bic: float
    check: Accuracy
    control: Accuracy
    sigma_um: float = float("nan")
    length_mm: float = float("nan")
    evidence: Evidence = NOTHING_KNOWN
    groups: str = ""
    kind: str = "free"
    p: float = float("nan")
    ratio: float = float("nan")
    object: AdjustedObject | None = None

    @property
    def converged(self) -> bool:
        return self.status == "converged"


@dataclass(frozen=True, eq=False)
class ParameterComparison:
    """The sets in the order asked for.

    Parameters
    ----------
    block : its name. folds : control points were left out in as many parts; their number is the points' at most.
    check_points, control_points : names of the points behind the differences.
    """

    block: str
    outcomes: tuple[SetOutcome, ...]
    folds: int
    check_points: tuple[str, ...]
    control_points: tuple[str, ...]
    robust: str
