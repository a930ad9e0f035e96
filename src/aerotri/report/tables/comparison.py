"""Two adjustments side by side as tables and as JSON."""

from __future__ import annotations

from typing import Any

import numpy as np

from aerotri.conventions import MGON_PER_RADIAN
from aerotri.formats.results.run_comparison import readable_setting
from aerotri.report.tables.adjustment import Column, Table, cell_text, table
from aerotri.statistics.comparison import Change, Comparison, Differences, ParameterChange

WORDS = {"sigma0": "σ0", "sigma0_um": "σ0 [µm]", "vtpv": "sum of squared residuals, weighted (vᵀPv)"}
"""Of the outcome, where its key in adjustment.json is no word."""
UNITS = {"X0": "m", "Y0": "m", "Z0": "m", "omega": "mgon", "phi": "mgon", "kappa": "mgon", "X": "m", "Y": "m", "Z": "m"}


def comparison_tables(comparison: Comparison, top: int) -> list[Table]:
    """All tables of a comparison, those without rows left out.

    Parameters
    ----------
    top : how many things of a kind are named.
    """
    c = comparison
    tables = [
        _changes("Outcome", c.outcome),
        _changes(_titled("Settings that differ", len(c.settings), 4 * top), c.settings[: 4 * top]),
        _changes(_titled("Control and check points that differ", len(c.roles), 4 * top), c.roles[: 4 * top]),
        *_ray_tables(c, top),
        _elements(c.orientations, f"Orientation of the {len(c.orientations)} photographs in common"),
        _worst(c.orientations, top, "Photographs that changed most", "photograph"),
        _elements(c.points, f"Coordinates of the {len(c.points)} points in common"),
        _worst(c.points, top, "Points that changed most", "point"),
        _parameters(c.parameters, top),
        _of_one_run(c.parameters),
        _check_points(c),
        _warnings(c),
    ]
    return [one for one in tables if len(one)]


def _titled(title: str, count: int, shown: int) -> str:
    return f"{title} ({shown} of {count})" if count > shown else title


def _changes(title: str, changes: tuple[Change, ...]) -> Table:
    rows = [
        (WORDS.get(c.name, c.name), *(_text(readable_setting(c.name, value)) for value in (c.first, c.second)))
        for c in changes
    ]
    return Table(title, (Column("what"), Column("first"), Column("second")), tuple(rows))


def _text(value: Any) -> str:
    if value is None:
        return "–"
    if isinstance(value, float):
        return f"{value:.6g}"
    return cell_text(str(value), Column(""))


def _ray_tables(c: Comparison, top: int) -> list[Table]:
    counts = [(kind, count) for kind, count in c.rays.counts.items() if count]
    listed = [r for kind, _ in counts for r in [r for r in c.rays.listed if r.kind == kind][:top]]
    rows = [(r.kind, r.image, r.point, r.first or "–", r.second or "–") for r in listed]
    columns = (Column("rays"), Column("photograph"), Column("point"), Column("first"), Column("second"))
    total = sum(count for _, count in counts)
    said = ", ".join(f"{count} {kind}" for kind, count in counts)
    title = f"Rays used differently: {said}" + (f" ({len(rows)} listed)" if len(rows) < total else "")
    return [Table(title, columns, tuple(rows))]


def _in_file_units(values: np.ndarray, elements: tuple[str, ...]) -> np.ndarray:
    """Angles, in rad, as mgon."""
    return values * np.array([MGON_PER_RADIAN if UNITS[name] == "mgon" else 1.0 for name in elements])


def _elements(d: Differences, title: str) -> Table:
    """A row per element: RMS and largest change, where the largest is against σ."""
    if not len(d):
        return Table(title, (), ())
    rms = _in_file_units(d.rms, d.elements)
    delta, ratio = _in_file_units(d.delta, d.elements), np.nan_to_num(d.ratio)
    rows = []
    for k, name in enumerate(d.elements):
        at = int(np.argmax(ratio[:, k]))
        largest = float(np.max(np.abs(np.nan_to_num(delta[:, k]))))
        named = str(d.names[at]) if ratio[at, k] > 0.0 else "–"
        rows.append((name, UNITS[name], float(rms[k]), largest, float(ratio[at, k]), named))
    columns = (Column("element"), Column("unit"), Column("RMS Δ", "", ".4f"), Column("largest |Δ|", "", ".4f"),
               Column("largest |Δ|/σ", "", ".2f"), Column("at"))  # fmt: skip
    return Table(title, columns, tuple(rows))


def _worst(d: Differences, top: int, title: str, what: str) -> Table:
    rows = d.worst(top)
    delta = _in_file_units(d.delta, d.elements)[rows]
    columns = [
        (Column(what), d.names[rows]),
        (Column("largest |Δ|/σ", "", ".2f"), np.nan_to_num(d.ratio[rows]).max(axis=1, initial=0.0)),
    ]
    for k, name in enumerate(d.elements):
        columns.append((Column(f"Δ{name}", UNITS[name], "+.4f"), delta[:, k]))
    return table(title, *columns)


def _parameters(parameters: tuple[ParameterChange, ...], top: int) -> Table:
    """Parameters of both runs: interior elements all, of the others those that changed most against σ."""
    both = [p for p in parameters if np.isfinite(p.delta)]
    interior = [p for p in both if p.kind == "interior"]
    others = sorted((p for p in both if p.kind != "interior"), key=lambda p: -np.nan_to_num(p.ratio))
    shown = interior + others[: 2 * top]
    return table(
        _titled("Cameras and parameters", len(both), len(shown)),
        (Column("parameter"), [p.name for p in shown]),
        (Column("group"), [p.group for p in shown]),
        (Column("first", "", ".6g"), [p.first for p in shown]),
        (Column("second", "", ".6g"), [p.second for p in shown]),
        (Column("Δ", "", "+.3g"), [p.delta for p in shown]),
        (Column("σ", "", ".2g"), [p.sigma for p in shown]),
        (Column("|Δ|/σ", "", ".2f"), [p.ratio for p in shown]),
    )


def _of_one_run(parameters: tuple[ParameterChange, ...]) -> Table:
    """Parameters that only one run has, counted by run and group."""
    named: dict[tuple[str, str], list[str]] = {}
    for p in parameters:
        if np.isnan(p.delta):
            named.setdefault(("second" if np.isnan(p.first) else "first", p.group), []).append(p.name)
    rows = [(run, group, len(names), ", ".join(names)) for (run, group), names in named.items()]
    columns = (Column("only in"), Column("group"), Column("count", "", "d"), Column("parameters"))
    return Table("Parameters of one run only", columns, tuple(rows))


def _check_points(c: Comparison) -> Table:
    check = c.check_points
    if not len(check.names):
        return Table("Check points", (), ())
    first, second = check.rms
    title = f"RMS at the {len(check.names)} check points in common (first {check.counts[0]}, second {check.counts[1]})"
    return table(
        title,
        (Column("coordinate"), list("XYZ")),
        (Column("first", "m", ".4f"), first),
        (Column("second", "m", ".4f"), second),
        (Column("change", "m", "+.4f"), second - first),
    )


def _warnings(c: Comparison) -> Table:
    rows = [("gone", text) for text in c.warnings_gone] + [("new", text) for text in c.warnings_new]
    return Table("Warnings", (Column(""), Column("warning")), tuple(rows))
