"""The content of compare_parameters.json and parameter_changes.json, and of the tables beside them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from aerotri.diagnosis.parameter_sets import verdict
from aerotri.formats.results.json_text import number_or_none
from aerotri.image_errors import Change
from aerotri.results.parameter_comparison import ParameterComparison, SetOutcome
from aerotri.strategies.object_change import FarMoved, far_moved
from aerotri.strategies.parameter_choice import Behind, Gain, distances, gains, standings


def comparison_json(comparison: ParameterComparison) -> dict[str, Any]:
    """Content of compare_parameters.json; what is not known is null."""
    found, behind, distance = gains(comparison), standings(comparison), distances(comparison)
    far = far_moved([o for o in comparison.outcomes if o.converged])
    return {
        "block": comparison.block,
        "folds": comparison.folds,
        "robust": comparison.robust,
        "check_points": list(comparison.check_points),
        "control_points": list(comparison.control_points),
        "sets": [
            _set_json(o, found.get(o.name), behind.get(o.name), distance.get(o.name)) | _bent_json(far.get(o.name))
            for o in comparison.outcomes
        ],
    }


def _set_json(o: SetOutcome, gain: Gain | None, behind: Gain | None, distance: Behind | None) -> dict[str, Any]:
    content: dict[str, Any] = {"set": o.name, "status": o.status, "count": o.count, "significant": o.significant}
    for key in ("effective", "sigma0", "sigma0_um", "aic", "bic"):
        content[key] = number_or_none(getattr(o, key))
    for key, accuracy in (("check", o.check), ("control", o.control)):
        content[key] = {
            "count": dict(zip("XYZ", map(int, accuracy.count), strict=True)),
            "rms": _axes(accuracy.rms),
            "low": _axes(accuracy.low),
            "high": _axes(accuracy.high),
            "differences": [[number_or_none(v) for v in row] for row in accuracy.difference],
        }
    content["collocation"] = {"sigma_um": number_or_none(o.sigma_um), "length_mm": number_or_none(o.length_mm)}
    content |= {"groups": o.groups, "kind": o.kind, "p": number_or_none(o.p)}
    content["prediction"] = {
        **{key: [number_or_none(v) for v in getattr(o.evidence, key)] for key in ("areas", "strips", "control")},
        "sigma_height": number_or_none(o.evidence.sigma_height),
        "best": None if distance is None else distance.best,
        "value": None if distance is None else number_or_none(distance.value),
        "standard_error": None if distance is None else number_or_none(distance.error),
    }
    content |= {"gain": _gain_json(gain), "behind": _gain_json(behind), "verdict": verdict(o, gain, behind)}
    return content


def _bent_json(far: FarMoved | None) -> dict[str, Any]:
    return {"bends": None if far is None else {"against": far.against, "leverage": number_or_none(far.leverage)}}


def _gain_json(gain: Gain | None) -> dict[str, Any] | None:
    if gain is None:
        return None
    return {"against": gain.against, "value": number_or_none(gain.value), "standard_error": number_or_none(gain.error)}


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
    distance = distances(comparison)
    columns["prediction"] = np.array([d.value if (d := distance.get(o.name)) else np.nan for o in out])
    columns["prediction_error"] = np.array([d.error if (d := distance.get(o.name)) else np.nan for o in out])
    columns["verdict"] = np.array([verdict(o, found.get(o.name), behind.get(o.name)) for o in out], dtype=object)
    return columns


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


def _axes(values: np.ndarray) -> dict[str, float | None]:
    return {axis: number_or_none(value) for axis, value in zip("XYZ", values, strict=True)}
