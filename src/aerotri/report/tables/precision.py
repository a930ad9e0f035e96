"""Tables of how precise the unknowns are: means, error ellipsoids, correlations by name; what parameters change."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from aerotri.diagnosis.purpose import plus_minus
from aerotri.report.quality import metre_digits
from aerotri.report.tables.adjustment import Column, Table, table
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.relative import medians
from aerotri.statistics.parameter_effects import ParameterEffects, rms_by_axis
from aerotri.statistics.precision import (
    HIGH_CORRELATION,
    NamedCorrelation,
    centre_ellipsoids,
    parameter_correlations,
    photograph_correlations,
    point_ellipsoids,
    practical_precision,
    theoretical_precision,
)

MOST_CORRELATIONS = 200
"""Pairs of a table at most; chosen [C]: nobody reads more, and a block of many cameras can have thousands."""
NAMED_FROM = 0.7
"""Correlation of shared parameters from which on a pair is named in the table [C]."""

ERRORS_IN_COMMON = {
    "height: shift": "all heights too high or too low together",
    "height: tilt": "the whole block leans",
    "height: bend": "the whole block is bent: a bowl, a saddle",
    "height: local": "every point by itself",
    "plan: shift": "all points shifted together",
    "plan: turn and scale": "the whole block turned, too large or too small",
    "plan: local": "every point by itself",
}
"""Parts of σ of the object points by the names of `CommonPart`."""


def precision(adjusted: AdjustedBlock) -> Table:
    """Theoretical precision μ of the object points and practical precision at the check points."""
    of_model = "" if adjusted.points.model is None else ", with the model part"
    rows = [(f"theoretical, all points (μ = σ₀·√(tr Q/3n){of_model})", theoretical_precision(adjusted))]
    for name, results in (("control", adjusted.control), ("check", adjusted.check)):
        if len(results):
            chosen = np.zeros(len(adjusted.block.points), bool)
            chosen[results.point] = True
            rows.append((f"theoretical, {name} points", theoretical_precision(adjusted, chosen)))
    if len(adjusted.check):
        rows.append(("practical: differences at check points, with the errors of the given coordinates",
                     practical_precision(adjusted)))  # fmt: skip
    form = f".{metre_digits(adjusted.points.total_sigma)}f"
    return table(
        "Precision of the object points",
        (Column("precision"), [name for name, _ in rows]),
        (Column("points", "", "d"), [one.count for _, one in rows]),
        *((Column(axis, "m", form), [getattr(one, axis.lower()) for _, one in rows]) for axis in "XYZ"),
        (Column("of a coordinate", "m", form), [one.mean for _, one in rows]),
    )


def relative(adjusted: AdjustedBlock) -> Table:
    """Absolute and relative σ side by side, medians, with what each is good for; no rows where they are not known."""
    columns = (Column("total σ, median"), *(Column(axis, "m", ".3g") for axis in "XYZ"), Column("good for"))
    found = adjusted.relative
    if found is None:
        return Table("In the coordinate system, and relative", columns, ())
    held = np.isfinite(found.position).all()
    rows: list[tuple[Any, ...]] = []
    for what, absolute, left in (
        ("object points", adjusted.points.total_sigma, found.points),
        ("projection centres", adjusted.images.total_sigma[:, :3], found.centres),
    ):
        place = medians(absolute) if held else np.full(3, np.nan)
        rows.append((f"{what}, in the coordinate system", *_values(place), "maps, heights above the datum"))
        rows.append((f"{what}, relative", *_values(medians(left)), "lengths, height differences, volumes"))
    near = found.neighbours
    if near is not None:
        apart = f"height difference of points {near.distance:.3g} m apart"
        rows.append((apart, None, None, _value(near.sigma), "slopes: with the tilt of the block"))
        rows.append((f"{apart}, relative", None, None, _value(near.relative), "shape of what lies between"))
    return Table("In the coordinate system, and relative", columns, tuple(rows))


def similarity_in_words(adjusted: AdjustedBlock) -> str:
    """How well the whole block is placed, turned and scaled; '' where nothing says it."""
    found = adjusted.relative
    if found is None or not np.isfinite(found.position).all():
        return ""
    x, y, z = (plus_minus(value) for value in found.position)
    a, b, c = (plus_minus(np.degrees(value), "°") for value in found.rotation)
    scale = f"{100.0 * found.scale:.2g}"
    return f"The block as a whole: shift {x}, {y}, {z} (X, Y, Z), rotation {a}, {b}, {c}, scale ± {scale} %."


def _values(values: np.ndarray) -> list[float | None]:
    return [_value(value) for value in values]


def _value(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def common(adjusted: AdjustedBlock) -> Table:
    """How much of σ of the points is one error of all of them, and how much is local; no rows where it is not known."""
    part = adjusted.model_part
    rows = [] if part is None else [(one.part, ERRORS_IN_COMMON[one.part], one) for one in part.common]
    squares = {
        kind: sum(one.total_m**2 for *_, one in rows if one.part.startswith(kind)) or np.nan
        for kind in ("height", "plan")
    }
    noise = [(Column("σ of the noise", "m", ".3g"), [one.sigma_m for *_, one in rows])]
    return table(
        "One common error, or many local ones",
        (Column("part"), [name for name, *_ in rows]),
        (Column("what it is"), [says for _, says, _ in rows]),
        *(noise if any(one.total_m != one.sigma_m for *_, one in rows) else []),
        (Column("total σ", "m", ".3g"), [one.total_m for *_, one in rows]),
        (
            Column("share of the variance", "%", ".0f"),
            [100.0 * one.total_m**2 / squares[name.partition(":")[0]] for name, _, one in rows],
        ),
    )


def control_evidence(adjusted: AdjustedBlock) -> Table:
    """What the control points say of σ; no rows where too few are known."""
    found = None if adjusted.model_part is None else adjusted.model_part.control
    rows: list[tuple[Any, ...]] = []
    if found is not None and found.freedom > 0:
        contradictions = f"contradictions among control points and photographs ({found.freedom} independent)"
        rows.append((f"{contradictions}, over σ", _value(found.ratio), _value(found.p)))
        rows.append((f"{contradictions}, over total σ", _value(found.ratio_total), _value(found.p_total)))
        rows.append(("each control point left out in turn: its error over σ", _value(found.left_out), None))
        rows.append(("the same over total σ", _value(found.left_out_total), None))
    columns = (Column("what"), Column("RMS", "", ".2f"), Column("probability", "", ".3g"))
    return Table("What the control points say of σ", columns, tuple(row for row in rows if row[1] is not None))


def ellipsoids(adjusted: AdjustedBlock) -> Table:
    """Semi-axes of the standard ellipsoids of points and projection centres: median, 95 % quantile, the largest."""
    form = f".{metre_digits(adjusted.points.total_sigma)}f"
    rows = []
    for what, found, names in (
        ("object points", point_ellipsoids(adjusted), adjusted.block.points),
        ("projection centres", centre_ellipsoids(adjusted), adjusted.block.images.names),
    ):
        axes = found.semi_axes
        known = np.flatnonzero(np.isfinite(axes).all(axis=1))
        if not len(known):
            continue
        largest = known[np.argmax(axes[known, 0])]
        middle = np.median(axes[known], axis=0)
        steep = float(np.median(np.degrees(found.elevation[known, 0])))
        most = float(np.quantile(axes[known, 0], 0.95)), float(axes[largest, 0])
        rows.append((what, len(known), *(float(value) for value in middle), steep, *most, str(names[largest])))
    columns = (
        Column("ellipsoids of"), Column("number", "", "d"), Column("a, median", "m", form),
        Column("b, median", "m", form), Column("c, median", "m", form), Column("a rises by", "°", ".0f"),
        Column("a, 95 % below", "m", form), Column("a, largest", "m", form), Column("at"),
    )  # fmt: skip
    sigma = "one σ" if adjusted.points.model is None else "one total σ"
    return Table(f"Error ellipsoids ({sigma}, semi-axes a ≥ b ≥ c)", columns, tuple(rows))


def correlations(adjusted: AdjustedBlock) -> Table:
    """Pairs of shared parameters with a correlation of at least 0.7, the largest first."""
    found = parameter_correlations(adjusted.parameters, NAMED_FROM, MOST_CORRELATIONS)
    return _pairs(f"Correlations of parameters with |r| ≥ {NAMED_FROM:g}", found, photograph=False)


def orientation_correlations(adjusted: AdjustedBlock) -> Table:
    """Pairs of orientation elements of one photograph with a correlation of at least 0.95, the largest first."""
    found = photograph_correlations(adjusted, HIGH_CORRELATION, MOST_CORRELATIONS)
    return _pairs(f"Correlations within photographs with |r| ≥ {HIGH_CORRELATION:g}", found, photograph=True)


def _pairs(title: str, found: Iterable[NamedCorrelation], photograph: bool) -> Table:
    found = list(found)
    if len(found) == MOST_CORRELATIONS:
        title += f", the {MOST_CORRELATIONS} largest"
    of_photograph = [(Column("photograph"), [one.photograph for one in found])] if photograph else []
    return table(
        title,
        *of_photograph,
        (Column("first"), [one.first for one in found]),
        (Column("second"), [one.second for one in found]),
        (Column("r", "", "+.3f"), [one.value for one in found]),
    )


def check_effects(effects: ParameterEffects, digits: int) -> Table:
    """RMS at check points as adjusted, and with all, with a family, with one parameter left out."""
    rows: list[tuple[Any, ...]] = [("as adjusted", "", None, *rms_by_axis(effects.difference).tolist(), None, "")]
    before = rms_by_axis(effects.difference).tolist()
    for one in effects.left_out:
        rms = rms_by_axis(one.difference).tolist()
        share = 100.0 * (np.hypot(np.hypot(*rms[:2]), rms[2]) / np.hypot(np.hypot(*before[:2]), before[2]) - 1.0)
        label = {"all": "without any"}.get(one.label, f"without {one.label}")
        rows.append((label, one.group, one.t, *rms, float(share), one.verdict))
    form = f".{digits}f"
    columns = (
        Column("adjustment"), Column("group"), Column("t", "", ".1f"),
        *(Column(f"RMS {axis}", "m", form) for axis in "XYZ"), Column("RMS grows by", "%", "+.1f"),
        Column("the parameter"),
    )  # fmt: skip
    return Table("Check points with parameters left out", columns, tuple(rows))
