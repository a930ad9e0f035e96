"""The accuracy by check points as tables and as lines."""

from __future__ import annotations

import numpy as np

from aerotri.diagnosis.accuracy_inspire import inspire_accuracy
from aerotri.diagnosis.accuracy_rules import cm, reached
from aerotri.report.quality import printable
from aerotri.report.tables.adjustment import Column, Table, table
from aerotri.report.tables.terminal import table_lines
from aerotri.results.accuracy import AccuracyRecord, CoordinateErrors

MARKS = {"met": "✓ met", "not met": "✗ not met", "cannot be said": "? cannot be said"}
"""A sign before the words, so that a print without colours is read at a glance."""
CONCLUSIONS = {
    "met": "All that is required is met.",
    "not met": "Not all that is required is met.",
    "cannot be said": "Nothing that is required is missed, but part of it cannot be said.",
}
LISTED = 40
"""Characters of what was found that a line of the terminal has at most."""


def conclusion(r: AccuracyRecord) -> str:
    """All requirements in a sentence."""
    if not len(r.points):
        return "Without check points no accuracy can be stated."
    missed = sum(one.met == "not met" and one.weight == "recommended" for one in r.requirements)
    also = f" {missed} recommendation{'s' if missed > 1 else ''} not kept." if missed else ""
    return CONCLUSIONS[r.met] + also


def requirements_table(r: AccuracyRecord) -> Table:
    """A row a requirement, as the terminal shows it."""
    rows = r.requirements
    return table(
        "Requirements",
        (Column("requirement"), [one.name for one in rows]),
        (Column("asked"), [one.asked for one in rows]),
        (Column("found"), [printable(one.found, 500) for one in rows]),
        (Column(""), [MARKS[one.met] for one in rows]),
    )


def errors_table(r: AccuracyRecord) -> Table:
    """A row a coordinate, cm."""
    rows = [one for one in r.errors if one.count or not one.vegetated]
    numbers = [("mean", "mean", ".2f"), ("fit to the check points", "fit", ".2f"), ("survey", "survey", ".2f"),
               ("RMSE with survey", "rmse", ".2f"), ("largest", "largest", ".2f")]  # fmt: skip
    return table(
        "Errors by coordinate",
        (Column("coordinate"), [_name(one, r) for one in rows]),
        (Column("points", "", "d"), [one.count for one in rows]),
        *((Column(head, "cm", form), [100.0 * getattr(one, name) for one in rows]) for head, name, form in numbers),
        (Column("skew", "", ".2f"), [one.skew for one in rows]),
    )


def _name(one: CoordinateErrors, r: AccuracyRecord) -> str:
    if one.vegetated:
        return "Z in vegetation (VVA)"
    return f"{one.axis} outside vegetation (NVA)" if one.axis == "Z" and r.errors[3].count else one.axis


def inspire_table(r: AccuracyRecord) -> Table:
    """A row a measure of INSPIRE, cm."""
    one, plan, height = inspire_accuracy(r), r.errors[0].count, r.errors[2].count
    rows = [
        ("root mean square error of planimetry (RMSEP)", "47", one.rmse_p, plan),
        ("root mean square error in X (RMSE-x)", "adapted from 39", one.rmse_x, plan),
        ("root mean square error in Y (RMSE-y)", "adapted from 39", one.rmse_y, plan),
        ("root mean square error of heights (RMSE)", "39", one.rmse_z, height),
    ]
    return table(
        "In the measures of INSPIRE",
        (Column("measure"), [name for name, _, _, _ in rows]),
        (Column("ISO 19157"), [number for _, number, _, _ in rows]),
        (Column("result", "cm", ".2f"), [100.0 * value for _, _, value, _ in rows]),
        (Column("points", "", "d"), [count for _, _, _, count in rows]),
    )


def inspire_words(r: AccuracyRecord) -> str:
    """What INSPIRE recommends such an accuracy for."""
    one = inspire_accuracy(r)
    said = "INSPIRE has no minimum requirements. Its recommendations for elevation data are kept by"
    parts = (
        (one.spacing, f"grids with a spacing of {_cm_up(one.spacing):.2f} m or more"),
        (one.interval, f"contour lines every {_cm_up(one.interval):.2f} m or more"),
        (one.scale, f"vector data at scales of 1:{np.ceil(one.scale):.0f} or smaller"),
    )
    known = [text for value, text in parts if np.isfinite(value)]
    return f"{said} {', '.join(known)}." if known else ""


def _cm_up(length: float) -> float:
    """m, rounded up to a centimetre: what is kept by a length is not kept by less."""
    return float(np.ceil(100.0 * length - 1e-9)) / 100.0


def points_table(r: AccuracyRecord) -> Table:
    """A row a check point, cm."""
    p = r.points
    remarks = {name: "in vegetation" for name in p.names[p.vegetated]}
    for one in r.suspects:
        before = remarks.get(one.point, "")
        remarks[one.point] = f"{before}; " * bool(before) + f"d{one.axis} {one.reason}"
    return table(
        "Check points",
        (Column("point"), [printable(name) for name in p.names]),
        *((Column(f"d{axis}", "cm", "+.2f"), (100.0 * p.difference[:, k]).tolist()) for k, axis in enumerate("XYZ")),
        *((Column(f"survey σ{axis}", "cm", ".2f"), (100.0 * p.sigma[:, k]).tolist()) for k, axis in enumerate("XYZ")),
        (Column("remark"), [remarks.get(name, "") for name in p.names]),
    )


def accuracy_lines(r: AccuracyRecord) -> list[str]:
    """What the command prints: the accuracy, the requirements, the sentences to report."""
    lines = [f"{printable(r.block)}: {len(r.points)} check points, {len(r.control_sigma)} control points"]
    if len(r.points):
        lines.append(
            f"RMSE_H {cm(r.rmse_h)}, RMSE_V {cm(r.nva)}, RMSE_3D {cm(r.rmse_3d)}, survey error included; "
            f"class reached: {cm(reached(r.rmse_h))} in plan, {cm(reached(r.nva))} in height"
        )
        if r.errors[3].count:
            lines.append(f"in vegetation (VVA): RMSE_V {cm(r.vva)} of {r.errors[3].count} check points")
    lines += ["", *table_lines(requirements_table(r)), "", conclusion(r)]
    lines += [f"statement: {text}" for text in r.statements]
    return [*lines, *(f"warning: {printable(text, 1000)}" for text in r.warnings)]
