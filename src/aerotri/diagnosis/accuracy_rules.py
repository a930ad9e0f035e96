"""Requirements on check points, control and accuracy, each beside what was found.

[L: ASPRS Positional Accuracy Standards for Digital Geospatial Data, edition 2, version 2 (2024)]: 7.2 (mean error below
25 % of the target, errors distributed normally), 7.3 and 7.4 (classes; VVA is reported and has no limit), 7.9 (control
has half the class), 7.12 (check points are twice as accurate as the class), 7.13 (at least 30), annex C, table C.1
(number by area); at most 120: the summary of changes in edition 2. Places of check points: [L: National Standard for
Spatial Data Accuracy, FGDC-STD-007.3-1998, appendix 3-C].
"""

from __future__ import annotations

import math

import numpy as np

from aerotri.conventions import counted
from aerotri.results.accuracy import AccuracyRecord, Asked, CoordinateErrors, Met, Requirement

ASPRS = "ASPRS edition 2"
NSSDA = "NSSDA, appendix 3-C"
ENOUGH, MOST, TABLE_AREA, AREA_STEP, POINTS_STEP = 30, 120, 500.0, 250.0, 5
"""Check points at least and at most; km² up to which the least number holds; more points for each further piece."""
TABLE_END = 2500.0
"""km², where table C.1 ends; beyond it its step is continued up to the largest number [C]."""
ROUNDING = 1e-9
"""Classes are stated to a few digits: half of .05 may not fail against .025 by the rounding of the computer."""
MEAN_SHARE, HALF = 0.25, 0.5
QUADRANT_SHARE = 0.2
SKEW_Z = 2.58
"""|skew|/σ that a normal sample exceeds in one case of a hundred; the level is chosen [C]."""
CLASS_OPTIONS = "say what is asked for with --class-horizontal and --class-vertical"
CLASS_STEP = 1e-3
"""m, to which the class reached is rounded up; the standard has no steps [C]."""


def points_for_area(area_km2: float) -> int:
    """Check points recommended for a project area in whole km² [L: table C.1]."""
    beyond = max(round(area_km2) - TABLE_AREA, 0.0)
    return min(ENOUGH + POINTS_STEP * math.ceil(beyond / AREA_STEP), MOST)


def axis_targets(asked: Asked) -> tuple[float | None, float | None, float | None]:
    """m, target RMSE of X, Y, Z: the horizontal class shared by two coordinates."""
    plan = None if asked.horizontal is None else asked.horizontal / math.sqrt(2.0)
    return plan, plan, asked.vertical


def reached(rmse: float) -> float:
    """m, the class that an RMSE reaches: the RMSE rounded up to a millimetre; NaN stays."""
    return math.ceil(round(rmse / CLASS_STEP, 6)) * CLASS_STEP if math.isfinite(rmse) else rmse


def cm(value: float) -> str:
    """'2.24 cm'; '–' where it is not known."""
    return f"{100.0 * value:.2f} cm".replace("-", "−") if math.isfinite(value) else "–"


def class_text(value: float) -> str:
    """'7.5', cm without the unit."""
    return f"{100.0 * value:.6g}"


def requirements(r: AccuracyRecord) -> tuple[Requirement, ...]:
    """All of them, in the order of the page."""
    return (
        _of_class("Horizontal accuracy class", "7.3", "RMSE_H", r.asked.horizontal, r.rmse_h),
        _of_class("Vertical accuracy class (NVA)", "7.4", "RMSE_V", r.asked.vertical, r.nva),
        *_numbers(r), _number_by_area(r), *_places(r), _means(r), _blunders(r), _normal(r), *_surveys(r),
        _adjustment(r),
    )  # fmt: skip


def warnings(r: AccuracyRecord) -> tuple[str, ...]:
    """What a reader of the numbers has to know."""
    found = []
    if not len(r.points):
        found.append(
            "There are no check points: nothing tests this result from outside, and no accuracy can be stated. Survey "
            "points that the adjustment does not use, or give control points the role of check points "
            "(aerotri adjust --check NAME), and adjust again."
        )
    unstated = max(one.unstated for one in r.errors)
    if unstated:
        found.append(
            f"{counted(unstated, 'check point')} {'has' if unstated == 1 else 'have'} no survey error (σ 0 or not "
            "stated): the RMSE are too small by it. State sX, sY, sZ in control.csv."
        )
    if r.verdict != "accepted":
        found.append(f"The adjustment is {r.verdict}: read its reasons in report.html of the result first.")
    found += [f"Check point {one.point}: d{one.axis} {cm(one.value)} {one.reason}." for one in r.suspects]
    if r.layout is not None and r.asked.project_area is None and r.layout.area > TABLE_END * 1e6:
        found.append(
            f"Table C.1 of the standard ends at {TABLE_END:.0f} km²; its step is continued up to {MOST} points."
        )
    return tuple(found)


def _of_class(name: str, section: str, measure: str, asked: float | None, rmse: float) -> Requirement:
    found = f"{measure} {cm(rmse)}"
    if not math.isfinite(rmse):
        says = "no check point tests it" if asked is not None else f"no check point tests it; {CLASS_OPTIONS}"
        text = "–" if asked is None else f"{measure} at most {cm(asked)}"
        return Requirement(name, f"{ASPRS}, {section}", "required", text, "–", "cannot be said", says)
    says = f"class reached: {class_text(reached(rmse))} cm"
    if asked is None:
        return Requirement(name, f"{ASPRS}, {section}", "required", "–", found, "cannot be said",
                           f"{says}; {CLASS_OPTIONS}")  # fmt: skip
    met: Met = "met" if rmse <= asked * (1.0 + ROUNDING) else "not met"
    return Requirement(name, f"{ASPRS}, {section}", "required", f"{measure} at most {cm(asked)}", found, met, says)


def _numbers(r: AccuracyRecord) -> list[Requirement]:
    rows = [("in plan", r.errors[0]), ("in height, outside vegetation", r.errors[2])]
    rows += [("in height, in vegetation (VVA)", r.errors[3])] if r.errors[3].count else []
    found = []
    for where, errors in rows:
        missing = ENOUGH - errors.count
        says = f"{missing} more needed; the statement has to say that there are fewer" if missing > 0 else ""
        found.append(Requirement(f"Check points {where}", f"{ASPRS}, 7.13", "required", f"at least {ENOUGH}",
                                 f"{errors.count}", "not met" if missing > 0 else "met", says))  # fmt: skip
    return found


def _number_by_area(r: AccuracyRecord) -> Requirement:
    name, source = "Check points for the project area", f"{ASPRS}, table C.1"
    area = project_area(r)
    if area is None:
        return Requirement(name, source, "recommended", "–", f"{len(r.points)}", "cannot be said",
                           "the ground points span no area; give --project-area")  # fmt: skip
    wanted = points_for_area(area / 1e6)
    says = "area stated" if r.asked.project_area is not None else "area within the outermost tied points"
    return Requirement(
        name, source, "recommended", f"{wanted} for {area / 1e6:.3g} km²", f"{len(r.points)}",
        "met" if len(r.points) >= wanted else "not met", says,
    )  # fmt: skip


def project_area(r: AccuracyRecord) -> float | None:
    """m², as stated, else of the ground points; None where neither is known."""
    if r.asked.project_area is not None:
        return r.asked.project_area
    return None if r.layout is None else r.layout.area


def _places(r: AccuracyRecord) -> list[Requirement]:
    quarter, apart = "Check points in every quarter of the area", "Check points apart from each other"
    asked = (f"at least {100 * QUADRANT_SHARE:.0f} % in each", "at least 10 % of the diagonal")
    if r.layout is None or len(r.points) < 4:
        says = "no area" if r.layout is None else "fewer than four check points"
        return [Requirement(name, NSSDA, "recommended", text, "–", "cannot be said", says)
                for name, text in zip((quarter, apart), asked, strict=True)]  # fmt: skip
    counts, n = r.layout.quadrants, int(r.layout.quadrants.sum())
    empty = [k + 1 for k, count in enumerate(counts) if count < QUADRANT_SHARE * n]
    near = r.layout.crowded
    limit = 0.1 * r.layout.diagonal
    return [
        Requirement(
            quarter, NSSDA, "recommended", asked[0], ", ".join(f"{k}: {count}" for k, count in enumerate(counts, 1)),
            "not met" if empty else "met",
            f"too few in quarter {', '.join(map(str, empty))} of the plan" if empty else "",
        ),
        Requirement(
            apart, NSSDA, "recommended", f"{asked[1]} ({limit:.0f} m)", f"smallest distance {r.layout.spacing:.0f} m",
            "not met" if near else "met", f"{len(near)} of {n} are nearer; the rule was made for 20" if near else "",
        ),
    ]  # fmt: skip


def _means(r: AccuracyRecord) -> Requirement:
    name, source, tested = "Mean error", f"{ASPRS}, 7.2", r.errors[:3]
    found = ", ".join(f"{one.axis} {cm(one.mean)}" for one in tested)
    compared = [(one, MEAN_SHARE * target) for one, target in _with_targets(r)]
    if not compared:
        return Requirement(name, source, "recommended", "below 25 % of the target RMSE", found, "cannot be said",
                           _why_not(r))  # fmt: skip
    asked = "below " + ", ".join(f"{one.axis} {cm(limit)}" for one, limit in compared)
    wrong = [one.axis for one, limit in compared if abs(one.mean) >= limit]
    says = f"the block is shifted in {', '.join(wrong)}: look for the cause and report it" if wrong else ""
    return Requirement(name, source, "recommended", asked, found, "not met" if wrong else "met", says)


def _with_targets(r: AccuracyRecord) -> list[tuple[CoordinateErrors, float]]:
    pairs = zip(r.errors[:3], axis_targets(r.asked), strict=True)
    return [(one, target) for one, target in pairs if target is not None and one.count]


def _why_not(r: AccuracyRecord) -> str:
    return CLASS_OPTIONS if len(r.points) else "no check points"


def _blunders(r: AccuracyRecord) -> Requirement:
    name, source, asked = "No blunder among the check points", f"{ASPRS}, 7.2", "no error over 3 times the target RMSE"
    if not _with_targets(r):
        return Requirement(name, source, "recommended", asked, "–", "cannot be said", _why_not(r))
    own = [one for one in r.suspects if "blunder" in one.reason]
    says = "measure them again; leave none out without a reason that is reported" if own else ""
    text = ", ".join(f"{one.point} d{one.axis} {cm(one.value)}" for one in own[:6]) + (" …" if len(own) > 6 else "")
    return Requirement(name, source, "recommended", asked, text or "none", "not met" if own else "met", says)


def _normal(r: AccuracyRecord) -> Requirement:
    name, source = "Errors distributed normally", f"{ASPRS}, 7.2"
    asked = f"skew below {SKEW_Z:g} times its σ"
    tested = [one for one in r.errors[:3] if math.isfinite(one.skew)]
    if not tested:
        return Requirement(name, source, "recommended", asked, "–", "cannot be said", "fewer than eight check points")
    found = ", ".join(f"{one.axis} {one.skew:+.2f} (σ {one.skew_sigma:.2f})" for one in tested).replace("-", "−")
    skewed = [one.axis for one in tested if abs(one.skew) > SKEW_Z * one.skew_sigma]
    says = (
        f"the errors of {', '.join(skewed)} lean to one side: look for wrong points and a bent block" if skewed else ""
    )
    return Requirement(name, source, "recommended", asked, found, "not met" if skewed else "met", says)


def survey_errors(r: AccuracyRecord) -> dict[str, tuple[float, float]]:
    """m, RMS of the survey errors in plan and in height, of check points and of control points; NaN without any."""
    sigma = r.control_sigma
    plan = np.sum(sigma[np.isfinite(sigma[:, :2]).all(axis=1), :2] ** 2, axis=1)
    height = sigma[np.isfinite(sigma[:, 2]), 2] ** 2
    control = [float(np.sqrt(np.mean(squares))) if len(squares) else float("nan") for squares in (plan, height)]
    check = float(np.hypot(r.errors[0].survey, r.errors[1].survey)), r.errors[2].survey
    return {"check points": check, "control points": (control[0], control[1])}


def smallest_class(r: AccuracyRecord, k: int) -> float:
    """m, the smallest class that the RMSE and the surveys of check and control points allow, in plan (0) or height (1).

    What is not known limits nothing: 0 without check and control points.
    """
    limits = ((r.rmse_h, r.nva)[k], *(errors[k] / HALF for errors in survey_errors(r).values()))
    return max((value for value in limits if math.isfinite(value)), default=0.0)


def _surveys(r: AccuracyRecord) -> list[Requirement]:
    sigma, errors = r.control_sigma, r.errors
    unstated = {
        "check points": (max(errors[0].unstated, errors[1].unstated), errors[2].unstated),
        "control points": (int((sigma[:, :2] <= 0.0).any(axis=1).sum()), int((sigma[:, 2] <= 0.0).sum())),
    }
    classes = (r.asked.horizontal, r.asked.vertical)
    return [
        _half(f"Survey of the {what} in {where}", section, error[k], classes[k], unstated[what][k], what)
        for section, (what, error) in zip(("7.12", "7.9"), survey_errors(r).items(), strict=True)
        for k, where in enumerate(("plan", "height"))
    ]


def _half(name: str, section: str, error: float, asked: float | None, unstated: int, what: str) -> Requirement:
    """A survey that has to have half the error of the class."""
    source, found = f"{ASPRS}, {section}", f"RMS of σ {cm(error)}" if math.isfinite(error) else "–"
    text = "at most half the class" + ("" if asked is None else f" ({cm(HALF * asked)})")
    if not math.isfinite(error):
        return Requirement(name, source, "required", text, found, "cannot be said", f"no {what}")
    if unstated:
        return Requirement(name, source, "required", text, found, "cannot be said",
                           f"{unstated} of the {what} state no error (σ 0): state it in control.csv")  # fmt: skip
    if asked is None:
        return Requirement(name, source, "required", text, found, "cannot be said", CLASS_OPTIONS)
    met: Met = "met" if error <= HALF * asked * (1.0 + ROUNDING) else "not met"
    return Requirement(
        name,
        source,
        "required",
        text,
        found,
        met,
        "" if met == "met" else f"the {what} were surveyed too coarsely for the class",
    )


def _adjustment(r: AccuracyRecord) -> Requirement:
    met: dict[str, Met] = {"accepted": "met", "doubtful": "cannot be said", "rejected": "not met"}
    says = "" if r.verdict == "accepted" else "read the reasons in report.html of the result"
    return Requirement("The adjustment itself", "aerotri", "required", "accepted", r.verdict,
                       met.get(r.verdict, "cannot be said"), says)  # fmt: skip
