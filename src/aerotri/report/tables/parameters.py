"""Sets of additional parameters side by side, removals of the selection, random fields, changes between groups."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from aerotri.diagnosis.parameter_sets import verdict
from aerotri.image_errors import Change
from aerotri.report.tables.adjustment import Column, Table
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.parameter_comparison import Accuracy, ParameterComparison, SetOutcome
from aerotri.strategies.parameter_choice import Behind, Gain, distances, gains, standings

NOTE = (
    "check: RMS at check points with 95 % bounds; control: RMS at control points predicted without themselves; "
    "parameters: estimated (effective number of a random field), of them significant (t > 1.96); gain: on the best of "
    "the sets it contains, at check points and predicted control together, ± its standard error; prediction: how much "
    "worse than by the best set areas, strips and control points are predicted by everything else (−2 ln of the "
    "density), ± its standard error; ΔAIC, ΔBIC: above the least"
)


def comparison_table(comparison: ParameterComparison) -> Table:
    """A row for each set; where there are no check points their columns are left out."""
    found, behind, distance = gains(comparison), standings(comparison), distances(comparison)
    there = [o for o in comparison.outcomes if o.converged]
    least_aic, least_bic = (min((getattr(o, k) for o in there), default=0.0) for k in ("aic", "bic"))
    digits = _digits(there)
    columns = [Column("set"), Column("parameters"), Column("significant"), Column("σ₀", "µm", ".2f")]
    for where, points in (("check", comparison.check_points), ("control", comparison.control_points)):
        if points:
            columns += [Column(f"{where} {axis}", "m") for axis in "XYZ"]
    columns += [
        Column("ΔAIC", "", ".0f"),
        Column("ΔBIC", "", ".0f"),
        Column("prediction"),
        Column("gain"),
        Column("verdict"),
    ]
    rows = []
    for o in comparison.outcomes:
        cells: list[Any] = [o.name, _count_text(o), str(o.significant) if o.converged else "–", o.sigma0_um]
        if comparison.check_points:
            cells += [_bounds_text(o.check, k, digits) for k in range(3)]
        if comparison.control_points:
            cells += [_rms_text(o.control, k, digits) for k in range(3)]
        gain = found.get(o.name)
        cells += [o.aic - least_aic, o.bic - least_bic, _distance_text(distance.get(o.name)), _gain_text(gain)]
        cells.append(verdict(o, gain, behind.get(o.name)))
        rows.append(tuple(cells))
    return Table("Sets of additional parameters compared", tuple(columns), tuple(rows))


def held_table(adjusted: AdjustedBlock) -> Table:
    """Additional parameters that cameras state and that were held."""
    columns = (Column("camera"), Column("parameter"), Column("value", "", ".4e"))
    rows = [
        (camera.name, name, prior.value)
        for camera in adjusted.block.cameras
        for name, prior in camera.parameters.items()
        if prior.fixed
    ]
    return Table("Additional parameters held at the values of block.toml", columns, tuple(rows))


def removals_table(adjusted: AdjustedBlock) -> Table:
    """What the selection took out, in order, and why."""
    columns = (Column("order", "", "d"), Column("parameter"), Column("group"), Column("value", "", ".4e"),
               Column("σ", "", ".1e"), Column("t", "", ".2f"), Column("reason"))  # fmt: skip
    rows = [
        (k, r.name, r.group, r.value, r.sigma, abs(r.value) / r.sigma if r.sigma > 0.0 else None, r.reason)
        for k, r in enumerate(adjusted.removals, start=1)
    ]
    return Table("Parameters removed by the selection", columns, tuple(rows))


def fields_table(adjusted: AdjustedBlock) -> Table:
    """The image error as a random field: what was assumed, and how much of it the block determined."""
    known, p = adjusted.block.settings.collocation, adjusted.parameters
    groups = [g for g in adjusted.groups if g.name == "collocation field"]
    names = dict.fromkeys(
        str(group) for name, group in zip(p.names, p.groups, strict=True) if str(name).startswith("collocation.")
    )
    columns = (
        Column("group"), Column("nodes", "", "d"), Column("effective number", "", ".0f"),
        Column("σ of the field", "µm", ".2f"), Column("correlation length", "mm", ".0f"),
        Column("RMS of nodes / σ", "", ".2f"),
    )  # fmt: skip
    rows = [
        (name, g.count // 2, g.redundancy, known.sigma_um, known.length_mm, g.rms)
        for name, g in zip(names, groups, strict=False)
    ]
    return Table("Image error as a random field", columns, tuple(rows))


def changes_table(changes: Sequence[Change]) -> Table:
    """Differences between groups of photographs and the test of 'no change'."""
    columns = (
        Column("groups"), Column("RMS", "µm", ".2f"), Column("largest", "µm", ".2f"),
        Column("RMS from σ alone", "µm", ".2f"), Column("F", "", ".2f"), Column("degrees of freedom", "", "d"),
        Column("p", "", ".2g"), Column("verdict"),
    )  # fmt: skip
    rows = [
        (
            f"{c.first} − {c.second}", 1e3 * c.field.rms, 1e3 * c.field.max, 1e3 * c.noise_mm, c.statistic, c.freedom,
            c.p, "changed" if c.changed else "no change seen",
        )
        for c in changes
    ]  # fmt: skip
    return Table("Change of the image errors between groups", columns, tuple(rows))


def _digits(outcomes: list[SetOutcome]) -> int:
    """Decimals of metres that show two digits of the smallest RMS."""
    rms = np.concatenate([np.concatenate([o.check.rms, o.control.rms]) for o in outcomes] or [np.zeros(0)])
    rms = rms[np.isfinite(rms) & (rms > 0.0)]
    return int(np.clip(1 - np.floor(np.log10(rms.min())), 3, 6)) if len(rms) else 3


def _count_text(o: SetOutcome) -> str:
    if not o.converged:
        return "–"
    return f"{o.count}" if abs(o.effective - o.count) < 1e-6 else f"{o.count} ({o.effective:.0f})"


def _rms_text(accuracy: Accuracy, axis: int, digits: int) -> str:
    return f"{accuracy.rms[axis]:.{digits}f}" if np.isfinite(accuracy.rms[axis]) else "–"


def _bounds_text(accuracy: Accuracy, axis: int, digits: int) -> str:
    if not np.isfinite(accuracy.rms[axis]):
        return "–"
    return f"{accuracy.rms[axis]:.{digits}f} ({accuracy.low[axis]:.{digits}f}–{accuracy.high[axis]:.{digits}f})"


def _distance_text(distance: Behind | None) -> str:
    if distance is None or not np.isfinite(distance.value):
        return "–"
    return "best" if distance.value == 0.0 else f"{distance.value:.0f} ± {distance.error:.0f}"


def _gain_text(gain: Gain | None) -> str:
    if gain is None or not np.isfinite(gain.value):
        return "–"
    return f"{100 * gain.value:+.0f} ± {100 * gain.error:.0f} %"
