"""The content of halves.json and of the tables beside it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from aerotri.diagnosis.halves import conclusion, division_sentence
from aerotri.formats.results.json_text import number_or_none
from aerotri.results.halves import DIVISIONS, AgreementTest, HalvesComparison, HalvesRecord


def halves_json(record: HalvesRecord) -> dict[str, Any]:
    """Content of halves.json; what is not known is null."""
    return {
        "block": record.block,
        "alpha": record.alpha,
        "robust": record.robust,
        "found": list(record.found),
        "conclusion": list(conclusion(record)),
        "divisions": [_division(one) for one in record.comparisons],
    }


def _division(one: HalvesComparison) -> dict[str, Any]:
    parameters, points = one.parameters, one.points
    return {
        "division": one.division,
        "text": DIVISIONS[one.division],
        "halves": [
            {"name": name, **(_half(one, k) if one.summaries else _no_half())} for k, name in enumerate(one.halves)
        ],
        "reason": one.reason,
        "same_as": one.same_as,
        "sentence": division_sentence(one),
        "notes": list(one.notes),
        "sigma0": number_or_none(one.sigma0),
        "transformed": one.transformed,
        "differs": one.differs,
        "tests": [{"of": name, **_test(test)} for name, test in one.tests],
        "image_errors": [
            {
                "group": field.group, "camera": field.camera.name, "rms_um": 1e3 * field.rms,
                "rms_of_sigma_um": 1e3 * field.rms_sigma,
            }
            for field in one.fields
        ],
        "parameters": [] if parameters is None else [
            {
                "name": str(name), "group": str(group), "first": number_or_none(first),
                "second": number_or_none(second), "sigma": number_or_none(sigma), "z": number_or_none(z),
            }
            for name, group, first, second, sigma, z in zip(
                parameters.names, parameters.groups, parameters.first, parameters.second, parameters.sigma,
                parameters.z, strict=True,
            )
        ],
        "points": None if points is None else {
            "count": len(points.point), "cells": len(points.centre), "cell_m": points.size,
            "rms": _axes(points.mean), "rms_of_sigma": _axes(points.mean_sigma),
        },
    }  # fmt: skip


def _half(one: HalvesComparison, k: int) -> dict[str, Any]:
    half = one.summaries[k]
    return {
        "photographs": half.photographs, "points": half.points, "sigma0": number_or_none(half.sigma0),
        "loose": list(half.loose),
    }  # fmt: skip


def _no_half() -> dict[str, Any]:
    return {"photographs": 0, "points": 0, "sigma0": None, "loose": []}


def _test(test: AgreementTest) -> dict[str, Any]:
    names = ("statistic", "freedom", "redundancy", "p_statistic", "rms_z", "p_rms", "p", "differs", "factor", "max_z",
             "expected_max_z", "usual_max_z")  # fmt: skip
    return {name: getattr(test, name) for name in names}


def _axes(values: np.ndarray) -> dict[str, float | None]:
    return {axis: number_or_none(v) for axis, v in zip("XYZ", np.sqrt(np.mean(values**2, axis=0)), strict=True)}


def image_columns(comparisons: Sequence[HalvesComparison]) -> dict[str, np.ndarray]:
    """Columns of image_cells.csv: the difference of the image errors by cell of the format, µm."""
    fields = [(one.division, field) for one in comparisons for field in one.fields]
    counts = [field.x.size for _, field in fields]
    columns = {
        "division": np.repeat(np.array([division for division, _ in fields], dtype=object), counts),
        "group": np.repeat(np.array([field.group for _, field in fields], dtype=object), counts),
        "camera": np.repeat(np.array([field.camera.name for _, field in fields], dtype=object), counts),
    }
    for name, values in (
        ("x", [field.x for _, field in fields]),
        ("y", [field.y for _, field in fields]),
        ("dx", [1e3 * field.d[..., 0] for _, field in fields]),
        ("dy", [1e3 * field.d[..., 1] for _, field in fields]),
        ("s_dx", [1e3 * field.sigma[..., 0] for _, field in fields]),
        ("s_dy", [1e3 * field.sigma[..., 1] for _, field in fields]),
        ("z_x", [field.z[..., 0] for _, field in fields]),
        ("z_y", [field.z[..., 1] for _, field in fields]),
    ):
        columns[name] = _joined(values)
    return columns


def ground_columns(comparisons: Sequence[HalvesComparison]) -> dict[str, np.ndarray]:
    """Columns of ground_cells.csv: the mean difference of the ground points by cell in plan, m."""
    found = [(one.division, one.points) for one in comparisons if one.points is not None]
    counts = [len(points.centre) for _, points in found]
    columns = {
        "division": np.repeat(np.array([division for division, _ in found], dtype=object), counts),
        "X": _joined([points.centre[:, 0] for _, points in found]),
        "Y": _joined([points.centre[:, 1] for _, points in found]),
        "points": _joined([points.count for _, points in found]).astype(np.int64),
    }
    for k, axis in enumerate("XYZ"):
        columns[f"d{axis}"] = _joined([points.mean[:, k] for _, points in found])
    for k, axis in enumerate("XYZ"):
        columns[f"s_d{axis}"] = _joined([points.mean_sigma[:, k] for _, points in found])
    for k, axis in enumerate("XYZ"):
        columns[f"z_{axis}"] = _joined([points.z[:, k] for _, points in found])
    return columns


def point_columns(comparisons: Sequence[HalvesComparison], names: np.ndarray) -> dict[str, np.ndarray]:
    """Columns of ground_points.csv: the difference of every point that both halves have, m.

    Parameters
    ----------
    names : of the block's points.
    """
    found = [(one.division, one.points) for one in comparisons if one.points is not None]
    counts = [len(points.point) for _, points in found]
    columns = {
        "division": np.repeat(np.array([division for division, _ in found], dtype=object), counts),
        "point": _joined([names[points.point].astype(object) for _, points in found]),
    }
    for k, axis in enumerate("XYZ"):
        columns[axis] = _joined([points.xyz[:, k] for _, points in found])
    for k, axis in enumerate("XYZ"):
        columns[f"d{axis}"] = _joined([points.d[:, k] for _, points in found])
    for k, axis in enumerate("XYZ"):
        columns[f"s_d{axis}"] = _joined([points.sigma[:, k] for _, points in found])
    return columns


def _joined(values: Sequence[np.ndarray]) -> np.ndarray:
    return np.concatenate([np.ravel(one) for one in values]) if values else np.zeros(0)
