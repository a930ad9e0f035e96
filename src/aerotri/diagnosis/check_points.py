"""Rules on check points: differences against what σ of the adjusted and the given coordinates let expect."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.diagnosis.finding import SIGNIFICANCE, Finding, Grade, chi_square_p, graded, metre_digits, times
from aerotri.diagnosis.geometry import usual_distance
from aerotri.quantiles import chi_square_quantile
from aerotri.results.accuracy import in_plan, with_survey
from aerotri.results.adjusted_block import AdjustedBlock, GroundPointResults

ENOUGH_CHECK_POINTS = 30
"""Check points that a tested accuracy needs at least [L: ASPRS Positional Accuracy Standards, edition 2]."""
AT_CHECK_POINTS = "at check points"

POOR, WORTHLESS = 2.0, 10.0
"""RMS over what σ let expect. Up to two, errors not modelled in real cameras are usual; at ten σ say nothing."""

ABSURD = 0.2
"""RMS over the distance from the cameras to the ground: such a result is none, however large its σ."""


@dataclass(frozen=True, eq=False)
class GroundStatistics:
    """Differences adjusted − given over control or check points, metres; NaN where there is no coordinate.

    Parameters
    ----------
    count, rms, mean, max : (3,) of X, Y, Z; max without sign.
    expected : (3,) the RMS that the σ of the adjusted and the given coordinates lead to expect.
    survey : (3,) RMS of the σ of the given coordinates, 0 where none is stated.
    """

    count: np.ndarray
    rms: np.ndarray
    mean: np.ndarray
    max: np.ndarray
    expected: np.ndarray
    survey: np.ndarray

    @property
    def fit_h(self) -> float:
        """m, √(RMS_X² + RMS_Y²): of the differences alone."""
        return in_plan(self.rms[0], self.rms[1])

    @property
    def expected_h(self) -> float:
        """m, what the σ lead to expect of it."""
        return in_plan(self.expected[0], self.expected[1])

    @property
    def rmse_h(self) -> float:
        """m, RMSE_H as ASPRS has it: with the survey error of the points."""
        return in_plan(*(with_survey(self.rms[k], self.survey[k]) for k in (0, 1)))

    @property
    def rmse_v(self) -> float:
        """m, RMSE_V likewise."""
        return with_survey(self.rms[2], self.survey[2])


def ground_statistics(adjusted: AdjustedBlock, results: GroundPointResults) -> GroundStatistics:
    """Count, RMS, mean and largest difference by coordinate.

    The given coordinates enter the expected RMS with their own σ. Control points were adjusted: their differences are
    residuals, whose expected size is σ·√r. The σ of check points are total, with their model part.
    """
    d = results.difference
    given = np.isfinite(d)
    n = given.sum(axis=0)
    filled = np.where(given, d, 0.0)
    sigma = sigma_given(adjusted, results)
    of_residuals = (adjusted.outcome.sigma0 * sigma) ** 2 * results.r
    variance = results.total_sigma**2 + sigma**2 if results is adjusted.check else of_residuals
    with np.errstate(invalid="ignore", divide="ignore"):
        rms = np.sqrt((filled**2).sum(axis=0) / n)
        mean = filled.sum(axis=0) / n
        largest = np.where(n > 0, np.abs(filled).max(axis=0, initial=0.0), np.nan)
        expected = np.sqrt(np.where(given, variance, 0.0).sum(axis=0) / n)
        survey = np.sqrt(np.where(given, sigma**2, 0.0).sum(axis=0) / n)
    return GroundStatistics(n, rms, mean, largest, expected, survey)


def sigma_given(adjusted: AdjustedBlock, results: GroundPointResults) -> np.ndarray:
    """(k, 3) m, σ of the given coordinates; 0 where none was given."""
    control = adjusted.block.control
    row_of = {int(point): row for row, point in enumerate(control.point)}
    sigma = np.zeros((len(results), 3))
    for i, point in enumerate(results.point):
        row = row_of.get(int(point))
        if row is not None:
            sigma[i] = np.nan_to_num(control.sigma[row])
    return sigma


def asprs_warning(adjusted: AdjustedBlock) -> str:
    """A sentence where there are too few check points for the ASPRS standard, '' otherwise."""
    n = len(adjusted.check)
    if n >= ENOUGH_CHECK_POINTS:
        return ""
    found = (
        "There are no check points" if n == 0 else f"There {'is' if n == 1 else 'are'} {n} check point{'s' * (n > 1)}"
    )
    return (
        f"{found}; the ASPRS Positional Accuracy Standards, edition 2, require at least {ENOUGH_CHECK_POINTS} to test "
        "the accuracy of a product."
    )


def of_check_points(adjusted: AdjustedBlock) -> list[Finding]:
    """How many there are, and their RMS in plan and height."""
    results = adjusted.check
    if not len(results):
        return [
            Finding("check points", "none", f"at least {ENOUGH_CHECK_POINTS}", asprs_warning(adjusted), "attention")
        ]
    s = ground_statistics(adjusted, results)
    few, digits = len(results) < ENOUGH_CHECK_POINTS, metre_digits(results.sigma)
    found = [
        Finding("check points", f"{len(results)}", f"at least {ENOUGH_CHECK_POINTS} (ASPRS, edition 2)",
                "too few to report a tested accuracy" if few else "enough", "attention" if few else "good"),
    ]  # fmt: skip
    distance = usual_distance(adjusted)
    for name, fit, axes in (("fit in plan", s.fit_h, [0, 1]), ("fit in height", float(s.rms[2]), [2])):
        expected, n = float(np.hypot.reduce(s.expected[axes])), _freedom(s, results, axes)
        found.append(_fit(f"{name} {AT_CHECK_POINTS}", fit, expected, n, digits, distance))
    return found


def _freedom(s: GroundStatistics, results: GroundPointResults, axes: list[int]) -> float:
    """Degrees of freedom of the differences in some coordinates: all of them, where their correlations are not known.

    Of coordinates together by (Σ tr)²/Σ(tr²/ν), as `check_freedom` has it.
    """
    count = s.count[axes].astype(float)
    if results.freedom is None or not (count > 0).all():
        return float(count.sum())
    trace = count * s.expected[axes] ** 2
    return float(trace.sum() ** 2 / np.sum(trace**2 / results.freedom[axes]))


def in_doubt(adjusted: AdjustedBlock) -> bool:
    """Whether the correlations of the check points decide on the verdict."""
    doubtful = [finding for finding in of_check_points(adjusted) if finding.grade != "accepted"]
    return bool(doubtful) and adjusted.check.freedom is None


def _fit(name: str, rms: float, expected: float, n: float, digits: int, distance: float) -> Finding:
    """RMS against the σ of adjusted and given coordinates; n independent differences make the χ² bound."""
    if n == 0 or not np.isfinite(rms):
        return Finding(name, "–", "–", "no coordinate to compare", "note")
    if rms > ABSURD * distance:
        reason = f"{name} is {rms:.3g} m, at a distance of {distance:.3g} m from the cameras"
        return Finding(name, f"{rms:.3g} m", f"{expected:.3g} m from the σ", "no result", "attention", "rejected",
                       reason)  # fmt: skip
    limit = expected * float(np.sqrt(chi_square_quantile(0.975, n) / n))
    value = f"{rms:.{digits}f} m"
    text = f"{expected:.{digits}f} m from the σ; at most {limit:.{digits}f} m (χ², 97.5 %)"
    if not rms > limit:
        return Finding(name, value, text, "as the σ say", "good")
    grade: Grade = "accepted"
    if chi_square_p(n * (rms / expected) ** 2, n) < SIGNIFICANCE:
        grade = graded(rms / expected, POOR, WORTHLESS)
    reason = f"{name} is {value}, {times(rms / expected)} as large as expected from the σ"
    return Finding(name, value, text, "larger than the σ say: systematic errors, or σ too small", "attention", grade,
                   reason if grade != "accepted" else "")  # fmt: skip


def of_means(adjusted: AdjustedBlock) -> list[Finding]:
    """Coordinates whose mean difference is not what chance leaves."""
    found = []
    if not len(adjusted.check):
        return found
    s, digits = ground_statistics(adjusted, adjusted.check), metre_digits(adjusted.check.sigma)
    for axis, n, mean, rms in zip("XYZ", s.count, s.mean, s.rms, strict=True):
        if n < 5 or not rms > abs(mean):
            continue
        t = abs(mean) / np.sqrt((rms**2 - mean**2) / (n - 1))
        if t > 3.0:
            expected = f"0 within 3 σ of the mean; t = {t:.1f}"
            says = "the block is shifted against the check points"
            value = f"{mean:+.{digits}f} m"
            found.append(Finding(f"mean of d{axis} {AT_CHECK_POINTS}", value, expected, says, "attention"))
    return found
