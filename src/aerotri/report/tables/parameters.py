"""Sets of additional parameters side by side, removals of the selection, random fields, changes between groups."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from aerotri.image_errors import Change
from aerotri.report.tables.adjustment import Column, Table
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.parameter_comparison import Accuracy, ParameterComparison, SetOutcome
from aerotri.strategies.parameter_choice import Gain, gains, standings

NOTE = (
    "check: RMS at check points with 95 % bounds; control: RMS at control points predicted without themselves; "
    "parameters: estimated (effective number of a random field), of them significant (t > 1.96); gain: on the best of "
    "the sets it contains, at check points and predicted control together, ± its standard error; ΔAIC, ΔBIC: above the "
    "least"
)
HELPS = 1.645
"""Standard errors beyond which a gain is taken for one (95 %, one-sided)."""


def comparison_table(comparison: ParameterComparison) -> Table:
    """A row for each set; where there are no check points their columns are left out."""
    found, behind = gains(comparison), standings(comparison)
    there = [o for o in comparison.outcomes if o.converged]
    least_aic, least_bic = (min((getattr(o, k) for o in there), default=0.0) for k in ("aic", "bic"))
    digits = _digits(there)
    columns = [Column("set"), Column("parameters"), Column("significant"), Column("σ₀", "µm", ".2f")]
    for where, points in (("check", comparison.check_points), ("control", comparison.control_points)):
        if points:
            columns += [Column(f"{where} {axis}", "m") for axis in "XYZ"]
    columns += [Column("ΔAIC", "", ".0f"), Column("ΔBIC", "", ".0f"), Column("gain"), Column("verdict")]
    rows = []
    for o in comparison.outcomes:
        cells: list[Any] = [o.name, _count_text(o), str(o.significant) if o.converged else "–", o.sigma0_um]
        if comparison.check_points:
            cells += [_bounds_text(o.check, k, digits) for k in range(3)]
        if comparison.control_points:
            cells += [_rms_text(o.control, k, digits) for k in range(3)]
        gain = found.get(o.name)
        cells += [o.aic - least_aic, o.bic - least_bic, _gain_text(gain), verdict(o, gain, behind.get(o.name))]
        rows.append(tuple(cells))
    return Table("Sets of additional parameters compared", tuple(columns), tuple(rows))


def verdict(outcome: SetOutcome, gain: Gain | None, behind: Gain | None) -> str:
    """Whether a set earns its parameters, and whether another does better, in a few words.

    Parameters
    ----------
    gain : on the best of the sets it contains. behind : how far it is behind the best of all.
    """
    if not outcome.converged:
        return outcome.status
    said = []
    if gain is not None and np.isfinite(gain.value):
        mostly = 2 * outcome.significant > outcome.count > 0
        if gain.value > HELPS * gain.error:
            said.append("helps")
        else:
            said.append(f"{'significant but useless: ' * mostly}no better than {gain.against}")
    if behind is not None and np.isfinite(behind.value):
        if behind.against == outcome.name:
            said.append("the best")
        elif behind.value < -HELPS * behind.error:
            said.append(f"worse than {behind.against}")
        else:
            said.append("as good as the best")
    return "; ".join(said) or "–"


def comparison_json(comparison: ParameterComparison) -> dict[str, Any]:
    """Content of compare_parameters.json; what is not known is null."""
    found, behind = gains(comparison), standings(comparison)
    return {
        "block": comparison.block,
        "folds": comparison.folds,
        "robust": comparison.robust,
        "check_points": list(comparison.check_points),
        "control_points": list(comparison.control_points),
        "sets": [_set_json(o, found.get(o.name), behind.get(o.name)) for o in comparison.outcomes],
    }


def _set_json(o: SetOutcome, gain: Gain | None, behind: Gain | None) -> dict[str, Any]:
    content: dict[str, Any] = {"set": o.name, "status": o.status, "count": o.count, "significant": o.significant}
    for key in ("effective", "sigma0", "sigma0_um", "aic", "bic"):
        content[key] = _number(getattr(o, key))
    for key, accuracy in (("check", o.check), ("control", o.control)):
        content[key] = {
            "count": dict(zip("XYZ", map(int, accuracy.count), strict=True)),
            "rms": _axes(accuracy.rms),
            "low": _axes(accuracy.low),
            "high": _axes(accuracy.high),
            "differences": [[_number(v) for v in row] for row in accuracy.difference],
        }
    content["collocation"] = {"sigma_um": _number(o.sigma_um), "length_mm": _number(o.length_mm)}
    content |= {"gain": _gain_json(gain), "behind": _gain_json(behind), "verdict": verdict(o, gain, behind)}
    return content


def _gain_json(gain: Gain | None) -> dict[str, Any] | None:
    if gain is None:
        return None
    return {"against": gain.against, "value": _number(gain.value), "standard_error": _number(gain.error)}


def comparison_columns(comparison: ParameterComparison) -> dict[str, np.ndarray]:
    """Columns of compare_parameters.csv."""
    out, found, behind = comparison.outcomes, gains(comparison), standings(comparison)
    columns: dict[str, np.ndarray] = {
        "set": np.array([o.name for o in out], dtype=object),
        "status": np.array([o.status for o in out], dtype=object),
    }
    for key in ("count", "effective", "significant", "sigma0", "sigma0_um", "aic", "bic"):
        columns[key] = np.array([getattr(o, key) for o in out])
    for where in ("check", "control"):
        for kind in ("rms", "low", "high"):
            for k, axis in enumerate("XYZ"):
                columns[f"{where}_{kind}_{axis}"] = np.array([getattr(getattr(o, where), kind)[k] for o in out])
    columns["gain"] = np.array([g.value if (g := found.get(o.name)) else np.nan for o in out])
    columns["gain_against"] = np.array([g.against if (g := found.get(o.name)) else "" for o in out], dtype=object)
    columns["verdict"] = np.array([verdict(o, found.get(o.name), behind.get(o.name)) for o in out], dtype=object)
    return columns


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


def changes_json(changes: Sequence[Change]) -> list[dict[str, Any]]:
    """Content of parameter_changes.json."""
    return [
        {
            "first": c.first, "second": c.second, "camera": c.field.camera.name, "rms_um": 1e3 * c.field.rms,
            "max_um": 1e3 * c.field.max, "rms_of_sigma_um": 1e3 * c.noise_mm, "statistic": c.statistic,
            "freedom": c.freedom, "p": c.p, "changed": c.changed, "sentence": c.sentence,
        }
        for c in changes
    ]  # fmt: skip


def changes_columns(changes: Sequence[Change]) -> dict[str, np.ndarray]:
    """Columns of parameter_changes.csv: the difference on a grid over the format, mm, with σ."""
    counts = [c.field.x.size for c in changes]
    columns = {
        "first": np.repeat(np.array([c.first for c in changes], dtype=object), counts),
        "second": np.repeat(np.array([c.second for c in changes], dtype=object), counts),
    }
    for name, values in (
        ("x", [c.field.x for c in changes]),
        ("y", [c.field.y for c in changes]),
        ("dx", [c.field.d[..., 0] for c in changes]),
        ("dy", [c.field.d[..., 1] for c in changes]),
        ("s_dx", [c.field.sigma[..., 0] for c in changes]),
        ("s_dy", [c.field.sigma[..., 1] for c in changes]),
        ("significant", [c.field.significant.astype(int) for c in changes]),
    ):
        columns[name] = np.concatenate([v.ravel() for v in values])
    return columns


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


def _gain_text(gain: Gain | None) -> str:
    if gain is None or not np.isfinite(gain.value):
        return "–"
    return f"{100 * gain.value:+.0f} ± {100 * gain.error:.0f} %"


def _axes(values: np.ndarray) -> dict[str, float | None]:
    return {axis: _number(value) for axis, value in zip("XYZ", values, strict=True)}


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
