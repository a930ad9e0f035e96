"""What check points say about the accuracy of a block, beside what a standard asks for."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from aerotri.results.head import Head

Met = Literal["met", "not met", "cannot be said"]
Weight = Literal["required", "recommended"]


def with_survey(fit: float, survey: float) -> float:
    """m, RMSE of a coordinate: the fit to the check points and the error of their survey [L: ASPRS edition 2, 7.11]."""
    return float(np.hypot(fit, survey))


def in_plan(of_x: float, of_y: float) -> float:
    """m, √(X² + Y²). RMSE_H is that of the RMSE, which have the survey error; that of the fit has another name."""
    return float(np.hypot(of_x, of_y))


@dataclass(frozen=True, eq=False)
class CheckedPoints:
    """Check points of a result, k of them.

    Parameters
    ----------
    names : (k,) str.
    place : (k, 2) m, adjusted X and Y.
    difference : (k, 3) m, adjusted − given; NaN where there is none.
    sigma : (k, 3) m, survey error of the given coordinate; NaN or 0 where none is stated.
    vegetated : (k,) bool, whether the point stands in vegetation.
    """

    names: np.ndarray
    place: np.ndarray
    difference: np.ndarray
    sigma: np.ndarray
    vegetated: np.ndarray

    def __len__(self) -> int:
        return len(self.names)


@dataclass(frozen=True)
class Asked:
    """The accuracy that is asked for; None where nothing is.

    Parameters
    ----------
    horizontal, vertical : m, the largest RMSE_H and RMSE_V allowed.
    project_area : m², where it is not that of the ground points.
    """

    horizontal: float | None = None
    vertical: float | None = None
    project_area: float | None = None


@dataclass(frozen=True)
class CoordinateErrors:
    """Errors of one coordinate over the check points, m; NaN where there is no point.

    Parameters
    ----------
    axis : 'X', 'Y' or 'Z'. vegetated : whether of points in vegetation.
    count : points. unstated : points of them whose survey error is not stated.
    mean : of the differences. fit : their RMS. survey : RMS of the survey errors. largest : without sign.
    skew : skewness of the differences. skew_sigma : what chance gives it; NaN below eight points.
    """

    axis: str
    vegetated: bool
    count: int
    unstated: int
    mean: float
    fit: float
    survey: float
    largest: float
    skew: float
    skew_sigma: float

    @property
    def rmse(self) -> float:
        """m, the fit with the survey error included."""
        return with_survey(self.fit, self.survey)


@dataclass(frozen=True, eq=False)
class Layout:
    """How the check points lie in the project area.

    Parameters
    ----------
    area : m², of the ground points. corners : (4, 2) m, of the smallest rectangle around them.
    quadrants : (4,) check points in each quarter of it, counted from the corner that stands first, then the second …
    spacing : m, the smallest distance of two check points; NaN with fewer than two.
    crowded : names of check points that are nearer to another one than a tenth of the diagonal.
    """

    area: float
    corners: np.ndarray
    quadrants: np.ndarray
    spacing: float
    crowded: tuple[str, ...]

    @property
    def diagonal(self) -> float:
        """m, of the rectangle."""
        return float(np.hypot(*(self.corners[2] - self.corners[0])))


@dataclass(frozen=True)
class SuspectError:
    """An error of a check point that stands out.

    Parameters
    ----------
    point, axis : whose. value : m. reason : in words.
    """

    point: str
    axis: str
    value: float
    reason: str


@dataclass(frozen=True)
class Requirement:
    """One requirement of a standard beside what was found.

    Parameters
    ----------
    name : in words. source : where it is asked for. weight : whether it must or should be kept.
    asked, found : in words with their unit. met : whether it is kept. says : a sentence, '' where there is nothing to
        add.
    """

    name: str
    source: str
    weight: Weight
    asked: str
    found: str
    met: Met
    says: str = ""


@dataclass(frozen=True, eq=False)
class AccuracyRecord:
    """The accuracy of a block by its check points.

    Parameters
    ----------
    block, crs, verdict : of the result.
    points : the check points. asked : what is asked for.
    errors : of X, Y, Z outside vegetation, and of Z within it.
    control_sigma : (m, 3) m, survey error of the control points.
    layout : None where the ground points span no area.
    suspects : errors that stand out. requirements : one after the other. statements : sentences as the standard has
        them. warnings : what a reader of the numbers has to know. head : of page and file.
    """

    block: str
    crs: str
    verdict: str
    points: CheckedPoints
    asked: Asked
    errors: tuple[CoordinateErrors, ...]
    control_sigma: np.ndarray
    layout: Layout | None
    suspects: tuple[SuspectError, ...] = ()
    requirements: tuple[Requirement, ...] = ()
    statements: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    head: Head = field(default_factory=Head)

    @property
    def rmse_h(self) -> float:
        """m, √(RMSE_X² + RMSE_Y²)."""
        return in_plan(self.errors[0].rmse, self.errors[1].rmse)

    @property
    def nva(self) -> float:
        """m, RMSE_V outside vegetation."""
        return self.errors[2].rmse

    @property
    def vva(self) -> float:
        """m, RMSE_V in vegetation; NaN where no check point stands there."""
        return self.errors[3].rmse

    @property
    def rmse_3d(self) -> float:
        """m, √(RMSE_H² + RMSE_V²) outside vegetation."""
        return float(np.hypot(self.rmse_h, self.nva))

    @property
    def met(self) -> Met:
        """All that is required taken together."""
        found = {one.met for one in self.requirements if one.weight == "required"}
        if "not met" in found:
            return "not met"
        return "cannot be said" if "cannot be said" in found or not found else "met"
