"""The comparison of two adjustments as plain values."""

from __future__ import annotations

from typing import Any

import numpy as np

from aerotri.formats.results.json_text import number_or_none
from aerotri.functional_model.additional_parameters import format_parameters
from aerotri.statistics.comparison import Change, Comparison, Differences

SIGMA_NOTE = (
    "Δ = second − first; σ is that of the second run. The runs share observations, so |Δ|/σ says how much a change "
    "matters; it is no test."
)
ANGLES = ("omega", "phi", "kappa")


def comparison_json(comparison: Comparison, top: int) -> dict[str, Any]:
    """The comparison as plain values: what is counted in full, what is named limited to `top`.

    Angles in degrees; null where a value is not known.
    """
    c = comparison
    return {
        "sigma": SIGMA_NOTE,
        "notes": list(c.notes),
        "outcome": [_change(change) for change in c.outcome],
        "settings": [_change(change) for change in c.settings],
        "control": [_change(change) for change in c.roles],
        "rays": {
            "counts": dict(c.rays.counts),
            "listed": [
                {"kind": r.kind, "image": r.image, "point": r.point, "first": r.first, "second": r.second}
                for r in c.rays.listed
            ],
        },
        "orientations": _differences_json(c.orientations, top),
        "points": _differences_json(c.points, top),
        "parameters": [
            {
                "name": p.name, "group": p.group, "kind": p.kind, "first": number_or_none(p.first),
                "second": number_or_none(p.second), "delta": number_or_none(p.delta), "sigma": number_or_none(p.sigma),
                "ratio": number_or_none(p.ratio),
            }
            for p in c.parameters
        ],
        "check_points": {
            "first_count": c.check_points.counts[0],
            "second_count": c.check_points.counts[1],
            "common_count": len(c.check_points.names),
            "rms_first": dict(zip("XYZ", map(number_or_none, c.check_points.rms[0]), strict=True)),
            "rms_second": dict(zip("XYZ", map(number_or_none, c.check_points.rms[1]), strict=True)),
        },
        "warnings": {"gone": list(c.warnings_gone), "new": list(c.warnings_new)},
    }  # fmt: skip


def readable_setting(name: str, value: Any) -> Any:
    """Additional parameters as the command line takes them; what else is not a number or text, as Python writes it."""
    if name.endswith("additional_parameters") and value is not None:
        return ",".join(format_parameters(value)) or "none"
    return value


def _change(change: Change) -> dict[str, Any]:
    first, second = (_plain(readable_setting(change.name, value)) for value in (change.first, change.second))
    return {"name": change.name, "first": first, "second": second}


def _differences_json(d: Differences, top: int) -> dict[str, Any]:
    factor = np.array([np.degrees(1.0) if name in ANGLES else 1.0 for name in d.elements])
    units = ["deg" if name in ANGLES else "m" for name in d.elements]
    ratio = d.ratio
    elements = []
    for k, name in enumerate(d.elements):
        known = np.isfinite(ratio[:, k]).any() if len(d) else False
        at = int(np.nanargmax(ratio[:, k])) if known else None
        largest = np.abs(d.delta[:, k]).max(initial=0.0, where=np.isfinite(d.delta[:, k]))
        elements.append(
            {
                "element": name, "unit": units[k], "rms": number_or_none(d.rms[k] * factor[k]),
                "max": number_or_none(largest * factor[k]),
                "max_ratio": None if at is None else number_or_none(ratio[at, k]),
                "at": None if at is None else str(d.names[at]),
            }
        )  # fmt: skip
    worst = [
        {"name": str(d.names[row])}
        | {name: number_or_none(value) for name, value in zip(d.elements, d.delta[row] * factor, strict=True)}
        | {"max_ratio": number_or_none(np.nanmax(ratio[row]))}
        for row in d.worst(top)
    ]
    return {"count": len(d), "elements": elements, "worst": worst}


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return number_or_none(value)
    return value if isinstance(value, str | int | bool | None) else str(value)
