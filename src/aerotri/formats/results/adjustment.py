"""What an adjustment writes for people and programs: adjustment.json and the tables beside it.

Keys and columns are an interface: columns of our own beyond it begin with ``x_``. Metres and millimetres as in the
records, angles in degrees, what is not known is empty (CSV), null (Parquet, JSON).
"""

# pyright: reportUnknownParameterType=false
# (pyarrow has no types: what is annotated as its Table or Array is unknown to pyright)

from __future__ import annotations

import dataclasses
import re
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from aerotri.adjustment.ray_status import RAY_STATUS, RayStatus
from aerotri.conventions import MGON_PER_RADIAN
from aerotri.formats.block.used_settings import used_settings
from aerotri.formats.results.json_text import number_or_none, write_json
from aerotri.formats.results.reliability_columns import control_columns, observation_columns, ray_columns
from aerotri.formats.results.rigs import (
    movement_columns,
    movements_json,
    rig_columns,
    rigidity_json,
    rigs_json,
    station_columns,
)
from aerotri.formats.text.table_writer import with_plain_texts
from aerotri.image_errors import interior_elements, interior_model_sigmas
from aerotri.observations import Block
from aerotri.observations.block import INTERIOR_ELEMENTS
from aerotri.results.adjusted_block import AdjustedBlock, GroundPointResults, Outcome
from aerotri.results.head import Head
from aerotri.results.model_part import ModelPart
from aerotri.results.ray_correlation import RayCorrelation
from aerotri.results.relative import precision_json
from aerotri.results.rolling_shutter import Motions
from aerotri.statistics.set_aside import photograph_reasons, point_reasons, status_columns

if TYPE_CHECKING:
    import pyarrow as pa

NEEDS_QUOTES = re.compile(r'[,"\r\n#]')
NOT_LOOKED_FOR = "the adjustment has no result"
TIMINGS = ("read", "start_values", "solve", "statistics", "plots", "write")
PARAMETER_KEYS = (
    "name", "group", "value", "sigma", "t", "model_sigma", "total_sigma", "max_correlation", "max_correlation_with",
    "total_correlation", "status", "reason",
)  # fmt: skip


def write_result(adjusted: AdjustedBlock, folder: str | Path) -> None:
    """Write adjustment.json, images, points, parameters, control and check as CSV, and residuals.parquet.

    observations.csv is written besides where positions, attitudes or conditions were observed, rigs.csv and
    rig_stations.csv or rig_movements.csv where there are rigs, motion.csv where there are rolling shutters.

    Beside them variance_components.json where they were estimated. The files are written one after the other,
    adjustment.json last: who needs all or nothing passes a temporary folder and renames it.

    Parameters
    ----------
    folder : made when it is not there.
    """
    started = time.perf_counter()
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    write_csv(folder / "images.csv", image_columns(adjusted))
    write_csv(folder / "points.csv", point_columns(adjusted))
    write_csv(folder / "parameters.csv", parameter_columns(adjusted))
    control = ground_point_columns(adjusted, adjusted.control) | control_columns(adjusted)
    write_csv(folder / "control.csv", control)
    write_csv(folder / "check.csv", ground_point_columns(adjusted, adjusted.check))
    if adjusted.observations is not None:
        write_csv(folder / "observations.csv", observation_columns(adjusted))
    if adjusted.rigs:
        write_csv(folder / "rigs.csv", rig_columns(adjusted.rigs))
    if adjusted.rigidity is not None:
        write_csv(folder / "rig_stations.csv", station_columns(adjusted.rigidity, adjusted.block.images.names))
    if adjusted.rolling_shutters is not None:
        write_csv(folder / "motion.csv", motion_columns(adjusted.block, adjusted.rolling_shutters.motions))
    if adjusted.rig_movements is not None:
        write_csv(folder / "rig_movements.csv", movement_columns(adjusted.rig_movements, adjusted.block.images.names))
    _write_residuals(folder / "residuals.parquet", adjusted)
    if adjusted.components is not None:
        write_json(folder / "variance_components.json", adjusted.components.as_dict())
    content = adjustment_json(adjusted)
    content["timings_s"]["write"] += time.perf_counter() - started
    write_json(folder / "adjustment.json", content)


def adjustment_json(adjusted: AdjustedBlock) -> dict[str, Any]:
    """The content of adjustment.json as plain Python values, without NaN."""
    return outcome_json(adjusted.block, adjusted.outcome) | {
        "groups": [_record(group) for group in adjusted.groups],
        "check_points": _ground_points(adjusted.block, adjusted.check),
        "control_points": _ground_points(adjusted.block, adjusted.control),
        "additional_parameters": _additional_parameters(adjusted),
        "cameras": _cameras(adjusted),
        "blunders": [_record(blunder) for blunder in adjusted.blunders],
        "deviations": None if adjusted.deviations is None else adjusted.deviations.as_dict(),
        "model_part": (adjusted.model_part or ModelPart(reason=NOT_LOOKED_FOR)).as_dict(),
        "gnss_errors": None if adjusted.position_errors is None else adjusted.position_errors.as_dict(),
        "photograph_fields": None if adjusted.photograph_fields is None else adjusted.photograph_fields.as_dict(),
        "ray_correlation": (adjusted.ray_correlation or RayCorrelation(reason=NOT_LOOKED_FOR)).as_dict(),
        "precision": both_precisions(adjusted),
        **({"rigs": rigs_json(adjusted.rigs)} if adjusted.rigs else {}),
        **({} if adjusted.rig_movements is None else {"rig_movements": movements_json(adjusted.rig_movements)}),
        **({} if adjusted.rigidity is None else {"rigidity": rigidity_json(adjusted.rigidity)}),
        **_rolling_shutters(adjusted),
    }


def both_precisions(adjusted: AdjustedBlock) -> dict[str, Any]:
    """Absolute and relative σ side by side, as adjustment.json has them."""
    relative = adjusted.relative
    free = relative is not None and not np.isfinite(relative.position).all()
    return precision_json(relative, adjusted.points.total_sigma, adjusted.images.total_sigma[:, :3], free)


def _rolling_shutters(adjusted: AdjustedBlock) -> dict[str, Any]:
    shutters = adjusted.rolling_shutters
    return {} if shutters is None else {"rolling_shutters": shutters.as_dict()}


def motion_columns(block: Block, motions: Motions) -> dict[str, np.ndarray]:
    """Columns of motion.csv: how photographs of rolling shutters moved while they were read."""
    columns = {"image": block.images.names[motions.image]}
    columns |= _split(("vX", "vY", "vZ"), motions.velocity)
    columns |= _split(("wx", "wy", "wz"), np.degrees(motions.spin))
    return columns | {"source": motions.source.astype(str)}


def outcome_json(block: Block, outcome: Outcome) -> dict[str, Any]:
    """As `adjustment_json` for an adjustment without a result: the same keys, lists empty."""
    o = outcome
    index, coordinates = np.zeros(0, np.int64), np.zeros((0, 3))
    nothing = GroundPointResults(index, coordinates, coordinates, coordinates, coordinates, index)
    return {
        **Head(block.project, block.crs, o.computed).as_dict(),
        "block": str(block.name),
        "status": o.status,
        "verdict": o.verdict,
        "reasons": list(o.reasons),
        "good_for": o.good_for,
        "purpose": o.purpose,
        "message": o.message,
        "iterations": int(o.iterations),
        "sigma0": number_or_none(o.sigma0),
        "sigma0_um": number_or_none(o.sigma0_um),
        "vtpv": number_or_none(o.vtpv),
        "observations": int(o.observations),
        "unknowns": int(o.unknowns),
        "conditions": int(o.conditions),
        "redundancy": int(o.redundancy),
        "groups": [],
        "check_points": _ground_points(block, nothing),
        "control_points": _ground_points(block, nothing),
        "additional_parameters": [],
        "cameras": [],
        "blunders": [],
        "deviations": None,
        "model_part": ModelPart(reason=NOT_LOOKED_FOR).as_dict(),
        "gnss_errors": None,
        "photograph_fields": None,
        "ray_correlation": RayCorrelation(reason=NOT_LOOKED_FOR).as_dict(),
        "precision": precision_json(None, coordinates, coordinates, free=False),
        "settings": [dataclasses.asdict(one) for one in used_settings(block)],
        "notes": list(o.notes),
        "warnings": list(o.warnings),
        "timings_s": {key: float(o.timings_s.get(key, 0.0)) for key in TIMINGS},
    }


def image_columns(adjusted: AdjustedBlock) -> dict[str, np.ndarray]:
    """Columns of images.csv; σ of the angles in degrees, and in mgon in columns of our own; what was set aside, why."""
    block, images = adjusted.block, adjusted.images
    cameras = np.array([camera.name for camera in block.cameras])
    sigma = images.sigma
    columns = {"image": block.images.names, "camera": cameras[block.images.camera], "strip": block.images.strip}
    columns |= _split(("X0", "Y0", "Z0"), images.centre)
    columns |= _split(("omega", "phi", "kappa"), np.degrees(images.angles))
    columns |= _split(("sX0", "sY0", "sZ0"), sigma[:, :3])
    columns |= _split(("s_omega", "s_phi", "s_kappa"), np.degrees(sigma[:, 3:]))
    if images.model is not None:
        model = _root_of_diagonal(images.model)
        for letter, values in (("m", model), ("t", np.hypot(sigma, model))):
            columns |= _split((f"{letter}X0", f"{letter}Y0", f"{letter}Z0"), values[:, :3])
            columns |= _split((f"{letter}_omega", f"{letter}_phi", f"{letter}_kappa"), np.degrees(values[:, 3:]))
    columns["rays"] = images.rays
    columns |= status_columns(photograph_reasons(adjusted))
    if adjusted.relative is not None:
        columns |= _split(("x_rX0", "x_rY0", "x_rZ0"), adjusted.relative.centres)
    return columns | _split(("x_s_omega_mgon", "x_s_phi_mgon", "x_s_kappa_mgon"), sigma[:, 3:] * MGON_PER_RADIAN)


def point_columns(adjusted: AdjustedBlock) -> dict[str, np.ndarray]:
    """Columns of points.csv."""
    points = adjusted.points
    columns = {"point": adjusted.block.points} | _split(("X", "Y", "Z"), points.xyz)
    columns |= _split(("sX", "sY", "sZ"), points.sigma)
    if points.model is not None:
        columns |= _split(("mX", "mY", "mZ"), _root_of_diagonal(points.model))
        columns |= _split(("tX", "tY", "tZ"), points.total_sigma)
    columns |= {"rays": points.rays, "max_abs_w": points.max_abs_w} | status_columns(point_reasons(adjusted))
    if adjusted.relative is not None:
        columns |= _split(("x_rX", "x_rY", "x_rZ"), adjusted.relative.points)
    return columns


def parameter_columns(adjusted: AdjustedBlock) -> dict[str, np.ndarray]:
    """Columns of parameters.csv: all shared parameters, `x_kind` telling interior, additional and GNSS ones apart."""
    p = adjusted.parameters
    columns = {
        "name": p.names, "group": p.groups, "mark": p.marks, "value": p.value, "sigma": p.sigma, "t": _finite(p.t),
    }  # fmt: skip
    if p.model_sigma is not None:
        columns |= {"model_sigma": p.model_sigma, "total_sigma": p.total_sigma}
    return columns | {
        "max_correlation": p.max_correlation, "max_correlation_with": p.max_correlation_with,
        "total_correlation": p.total_correlation, "status": p.status, "reason": p.reason, "x_kind": p.kinds,
    }  # fmt: skip


def ground_point_columns(adjusted: AdjustedBlock, results: GroundPointResults) -> dict[str, np.ndarray]:
    """Columns of control.csv and check.csv."""
    columns = {"point": adjusted.block.points[results.point]}
    for prefix, values in (("d", results.difference), ("s", results.sigma), ("r", results.r), ("w", results.w)):
        columns |= _split(tuple(prefix + axis for axis in "XYZ"), values)
        if prefix == "s" and results.model_sigma is not None:
            columns |= _split(("mX", "mY", "mZ"), results.model_sigma)
            columns |= _split(("tX", "tY", "tZ"), results.total_sigma)
    return columns | {"rays": results.rays}


def _write_residuals(path: Path, adjusted: AdjustedBlock) -> None:
    import pyarrow.parquet as pq

    pq.write_table(residual_table(adjusted), path, compression="zstd")


def residual_table(adjusted: AdjustedBlock) -> pa.Table:
    """The `pyarrow.Table` of residuals.parquet: a row per ray, in the order of the input; null for one left out."""
    import pyarrow as pa

    block, rays, measured = adjusted.block, adjusted.rays, adjusted.block.image_points
    used = (rays.status == RayStatus.USED)[:, None]
    numbers = _split(("x", "y"), measured.xy)
    for name, values in (("v", rays.v), ("r", rays.r), ("w", rays.w)):
        numbers |= _split((f"{name}x", f"{name}y"), np.where(used, values, np.nan))
    arrays = {
        "image": _text_by_index(block.images.names, measured.image),
        "point": _text_by_index(block.points, measured.point),
    }
    arrays |= {name: pa.array(values, from_pandas=True) for name, values in numbers.items()}
    arrays["weight"] = pa.array(np.asarray(rays.weight, dtype=float), from_pandas=True)
    arrays["status"] = _text_by_index(np.array(RAY_STATUS), rays.status)
    arrays |= ray_columns(adjusted)
    return pa.table(arrays)


def _text_by_index(names: np.ndarray, index: np.ndarray) -> pa.Array:
    import pyarrow as pa

    return pa.array(names.astype(str), pa.string()).take(pa.array(np.asarray(index, dtype=np.int64)))


def write_csv(path: Path, columns: dict[str, np.ndarray]) -> None:
    """A table with a plain header; text is quoted only where a name would break the table or read as a comment."""
    import pyarrow as pa
    from pyarrow import csv

    arrays = {}
    quoting = "none"
    for name, values in columns.items():
        text = np.asarray(values).dtype.kind in "OU"
        arrays[name] = pa.array(values.astype(str), pa.string()) if text else pa.array(values, from_pandas=True)
        if text and any(NEEDS_QUOTES.search(str(value)) for value in values):
            quoting = "needed"
    options = csv.WriteOptions(include_header=False, quoting_style=quoting)
    with open(path, "wb") as file:
        file.write((",".join(columns) + "\n").encode())
        csv.write_csv(with_plain_texts(pa.table(arrays)), file, options)


def _root_of_diagonal(covariance: np.ndarray) -> np.ndarray:
    return np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))


def _split(names: tuple[str, ...], values: np.ndarray) -> dict[str, np.ndarray]:
    return {name: np.ascontiguousarray(values[:, k]) for k, name in enumerate(names)}


def _ground_points(block: Block, results: GroundPointResults) -> dict[str, Any]:
    """Statistics over the coordinates that were given, and the points one by one; `max` is without sign."""
    statistics: dict[str, dict[str, float | None]] = {"rms": {}, "mean": {}, "max": {}}
    for k, axis in enumerate("XYZ"):
        d = results.difference[:, k]
        d = d[np.isfinite(d)]
        statistics["rms"][axis] = float(np.sqrt(np.mean(d**2))) if len(d) else None
        statistics["mean"][axis] = float(np.mean(d)) if len(d) else None
        statistics["max"][axis] = float(np.abs(d).max()) if len(d) else None
    names = block.points[results.point]
    keys, rows = ("dX", "dY", "dZ", "sX", "sY", "sZ"), np.concatenate([results.difference, results.sigma], axis=1)
    if results.model_sigma is not None:
        keys = (*keys, "mX", "mY", "mZ", "tX", "tY", "tZ")
        rows = np.concatenate([rows, results.model_sigma, results.total_sigma], axis=1)
    points = [
        {"point": str(name)} | {key: number_or_none(value) for key, value in zip(keys, row, strict=True)}
        for name, row in zip(names, rows, strict=True)
    ]
    return {"count": len(results), **statistics, "points": points}


def _additional_parameters(adjusted: AdjustedBlock) -> list[dict[str, Any]]:
    columns = parameter_columns(adjusted)
    rows = np.flatnonzero(adjusted.parameters.kinds == "additional")
    keys = [key for key in columns if key in PARAMETER_KEYS]
    return [{key: _plain(columns[key][row]) for key in keys} for row in rows]


def _cameras(adjusted: AdjustedBlock) -> list[dict[str, Any]]:
    cameras = []
    for camera in adjusted.block.cameras:
        entry: dict[str, Any] = {"name": camera.name}
        for name, value, sigma in zip(INTERIOR_ELEMENTS, *interior_elements(adjusted, camera), strict=True):
            entry |= {name: number_or_none(value), f"s_{name}": number_or_none(sigma)}
        model = interior_model_sigmas(adjusted, camera)
        if model is not None:
            total = np.hypot(model, interior_elements(adjusted, camera)[1])
            for letter, sigmas in (("m", model), ("t", total)):
                entry |= {f"{letter}_{k}": number_or_none(v) for k, v in zip(INTERIOR_ELEMENTS, sigmas, strict=True)}
        held = {parameter: prior.value for parameter, prior in camera.parameters.items() if prior.fixed}
        cameras.append(entry | ({"held_parameters": held} if held else {}))
    return cameras


def _record(record: Any) -> dict[str, Any]:
    return {key: _plain(value) for key, value in dataclasses.asdict(record).items()}


def _plain(value: Any) -> Any:
    """A value of an array or record as JSON knows it."""
    if isinstance(value, str):
        return str(value)
    if isinstance(value, int | np.integer):
        return int(value)
    return number_or_none(value)


def _finite(values: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(values), values, np.nan)
