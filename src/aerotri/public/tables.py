"""The tables of an adjusted block; their columns are those of the written files."""

# pyright: reportUnknownParameterType=false
# (pyarrow has no types: what is annotated as its Table or Array is unknown to pyright)

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa

from aerotri.formats.results.adjustment import (
    ground_point_columns,
    image_columns,
    parameter_columns,
    point_columns,
    residual_table,
)
from aerotri.formats.results.reliability_columns import control_columns
from aerotri.public.table import Table
from aerotri.results.adjusted_block import AdjustedBlock, GroundPointResults

METRES = tuple(f"{letter}{axis}{of}" for letter in ("", "s", "m", "t", "x_r") for axis in "XYZ" for of in ("", "0"))
DIFFERENCES = ("dX", "dY", "dZ")
DEGREES = tuple(f"{letter}{angle}" for letter in ("", "s_", "m_", "t_") for angle in ("omega", "phi", "kappa"))
UNITS = {
    **dict.fromkeys((*METRES, *DIFFERENCES), "m"), **dict.fromkeys(DEGREES, "°"),
    **dict.fromkeys(("x", "y", "vx", "vy"), "mm"),
    **dict.fromkeys(("x_s_omega_mgon", "x_s_phi_mgon", "x_s_kappa_mgon"), "mgon"),
}  # fmt: skip


def images_table(adjusted: AdjustedBlock) -> Table:
    """Exterior orientation, a row a photograph."""
    return _table("photographs", image_columns(adjusted), ("X0", "Y0", "Z0"), adjusted.block.crs)


def points_table(adjusted: AdjustedBlock) -> Table:
    """Object points."""
    return _table("points", point_columns(adjusted), ("X", "Y", "Z"), adjusted.block.crs)


def rays_table(adjusted: AdjustedBlock) -> Table:
    """Image points with residuals and tests."""
    return Table("rays", residual_table(adjusted), UNITS)


def parameters_table(adjusted: AdjustedBlock) -> Table:
    """Parameters shared by many rays."""
    return _table("parameters", parameter_columns(adjusted))


def control_table(adjusted: AdjustedBlock) -> Table:
    """Control points: adjusted − given."""
    return _table("control", _ground(adjusted, adjusted.control) | control_columns(adjusted), *_place(adjusted))


def check_table(adjusted: AdjustedBlock) -> Table:
    """Check points: adjusted − given."""
    return _table("check", _ground(adjusted, adjusted.check), *_place(adjusted))


def groups_table(adjusted: AdjustedBlock) -> Table:
    """Groups of observations; the unit is that of both σ and the RMS."""
    names = ("name", "count", "sigma_apriori", "rms", "redundancy", "sigma_aposteriori")
    columns = {name: np.array([getattr(group, name) for group in adjusted.groups]) for name in names}
    columns["unit"] = np.array([_unit_of_group(group.name) for group in adjusted.groups], dtype=str)
    return _table("groups of observations", columns)


def set_aside_table(adjusted: AdjustedBlock) -> Table:
    """Photographs and points that did not take part, and why."""
    from aerotri.statistics.set_aside import photograph_reasons, point_reasons

    block = adjusted.block
    kinds = (("photograph", block.images.names, photograph_reasons(adjusted)),
             ("point", block.points, point_reasons(adjusted)))  # fmt: skip
    rows = [(kind, names[why != ""], why[why != ""]) for kind, names, why in kinds]
    columns = {
        "kind": np.concatenate([np.full(len(names), kind) for kind, names, _ in rows]),
        "name": np.concatenate([names.astype(str) for _, names, _ in rows]),
        "reason": np.concatenate([why.astype(str) for _, _, why in rows]),
    }
    return _table("set aside", columns)


def _unit_of_group(name: str) -> str:
    if name == "image points":
        return "µm"
    return "rad" if name == "attitudes" else "m"


def write_rows(table: Table, path: Path) -> None:
    """Write a table as CSV; names that a spreadsheet would run as formulas are marked."""
    import csv

    from aerotri.spreadsheet import plain_row

    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table.columns)
        writer.writerows(plain_row(row.values()) for row in table.arrow.to_pylist())


def _ground(adjusted: AdjustedBlock, results: GroundPointResults) -> dict[str, np.ndarray]:
    """Columns of control.csv or check.csv, and where the adjusted point lies."""
    xyz = adjusted.points.xyz[results.point]
    return ground_point_columns(adjusted, results) | {axis: xyz[:, k] for k, axis in enumerate("XYZ")}


def _place(adjusted: AdjustedBlock) -> tuple[tuple[str, str, str], str]:
    return ("X", "Y", "Z"), adjusted.block.crs


def _table(
    name: str, columns: Mapping[str, np.ndarray], geometry: tuple[str, str, str] | None = None, crs: str = "local"
) -> Table:
    arrays = {key: _array(np.asarray(values)) for key, values in columns.items()}
    return Table(name, pa.table(arrays), {key: UNITS[key] for key in arrays if key in UNITS}, geometry, crs)


def _array(values: np.ndarray) -> pa.Array:
    return pa.array(values.astype(str), pa.string()) if values.dtype.kind in "OU" else pa.array(values)
