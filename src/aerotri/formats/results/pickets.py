"""Pickets as a table: pickets.parquet, one row a node, whatever became of it.

| column | |
|---|---|
| node_X, node_Y | where the picket was planned, m |
| X, Y, Z | where it was measured, m in the CRS of the block; empty where it was not |
| sX, sY, sZ | σ, m, of matching and adjustment together |
| sX_matching, sY_matching, sZ_matching | σ, m, of matching alone: what pickets do not share |
| correlation | lowest of its rays, or the best there was |
| rays | number of photographs it was measured in |
| photographs | their names, a list; the first is the one the others were matched to |
| status | 'accepted', or why not |
| steps_aside | how often it had to be moved |
| model | number of the pair of photographs, −1 where they were chosen freely |
"""

# pyright: reportUnknownParameterType=false
# (pyarrow has no types: what is annotated as its Table or Array is unknown to pyright)

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from aerotri.conventions import InputError
from aerotri.formats.text.parquet import load_parquet
from aerotri.terrain.picket_status import PicketStatus
from aerotri.terrain.pickets import Pickets
from aerotri.terrain.tin import order_in_plan
from aerotri.volume.pickets import MeasuredPickets

if TYPE_CHECKING:
    import pyarrow as pa

NUMBERS = ("node_X", "node_Y", "X", "Y", "Z", "sX", "sY", "sZ", "sX_matching", "sY_matching", "sZ_matching",
           "correlation")  # fmt: skip


@dataclass(frozen=True, eq=False)
class PicketTable:
    """Pickets as a file has them.

    Parameters
    ----------
    node (n, 2), xyz, sigma, sigma_matching (n, 3) m. photographs : names for each. status : (n,) str.
    """

    node: np.ndarray
    xyz: np.ndarray
    sigma: np.ndarray
    sigma_matching: np.ndarray
    photographs: tuple[tuple[str, ...], ...]
    status: np.ndarray

    @property
    def accepted(self) -> np.ndarray:
        """(n,) bool."""
        return self.status == PicketStatus.ACCEPTED.text


def picket_columns(pickets: Pickets, adjustment: np.ndarray) -> pa.Table:
    """The columns of pickets.parquet.

    Parameters
    ----------
    adjustment : (n, 3) m², variances that the adjustment adds to those of matching.
    """
    import pyarrow as pa

    p, matching = pickets, pickets.sigma
    sigma = np.sqrt(matching**2 + adjustment)
    values = np.column_stack([p.node, p.xyz, sigma, matching, p.correlation])
    columns = {name: pa.array(values[:, k], mask=~np.isfinite(values[:, k])) for k, name in enumerate(NUMBERS)}
    columns["rays"] = pa.array((p.photographs >= 0).sum(axis=1).astype(np.int32))
    names = [str(name) for name in p.names]
    listed = [[names[k] for k in row if k >= 0] for row in p.photographs.tolist()]
    columns["photographs"] = pa.array(listed, pa.list_(pa.string()))
    columns["status"] = pa.array([PicketStatus(k).text for k in p.status.tolist()])
    columns["steps_aside"] = pa.array(p.tries.astype(np.int32))
    columns["model"] = pa.array(p.model.astype(np.int32))
    return pa.table(columns)


def write_pickets(path: Path, pickets: Pickets, adjustment: np.ndarray) -> None:
    """Write pickets.parquet; arguments as of `picket_columns`."""
    from pyarrow import parquet

    parquet.write_table(picket_columns(pickets, adjustment), path)


def measured_pickets(table: pa.Table, path: Path | None = None) -> MeasuredPickets:
    """The pickets of a table that were accepted, for σ of a volume: X, Y, Z, photographs, status, sZ_matching.

    Parameters
    ----------
    table : the columns; status and sZ_matching may be missing. path : file they come from, for messages.

    Raises
    ------
    InputError
        When a column is missing, or hardly a picket was accepted.
    """
    import pyarrow as pa

    for name in ("X", "Y", "Z", "photographs"):
        if name not in table.column_names:
            raise InputError(f"has no column '{name}'", "give pickets.parquet of `aerotri dtm`", path)
    xyz = np.column_stack([table.column(axis).cast(pa.float64()).to_numpy() for axis in "XYZ"])
    names = table.column("photographs").to_pylist()
    used = np.isfinite(xyz).all(axis=1) & (np.array([len(own or ()) for own in names]) >= 2)
    if "status" in table.column_names:
        used &= np.array(table.column("status").to_pylist(), dtype=str) == "accepted"
    if used.sum() < 3:
        raise InputError(
            "has fewer than three accepted ground points (pickets)",
            "measure again with a lower --threshold of `aerotri dtm`",
            path,
        )
    rows = np.flatnonzero(used)
    # what is drawn of them at random must not hang on the order of the file
    rows = rows[order_in_plan(xyz[rows])]
    stated = None
    if "sZ_matching" in table.column_names:
        stated = table.column("sZ_matching").cast(pa.float64()).to_numpy()[rows]
    return MeasuredPickets(xyz[rows], [[str(name) for name in names[k]] for k in rows], stated)


def read_pickets(path: Path) -> PicketTable:
    """Read pickets.parquet.

    Raises
    ------
    InputError
    """
    import pyarrow as pa

    table = load_parquet(path)
    missing = [name for name in (*NUMBERS, "photographs", "status") if name not in table.column_names]
    if missing:
        raise InputError(f"has no column '{missing[0]}'", "give pickets.parquet of `aerotri dtm`", path)
    if len(set(table.column_names)) < len(table.column_names):
        raise InputError("has a column twice", "give pickets.parquet of `aerotri dtm`", path)
    try:
        v = np.column_stack([table.column(name).cast(pa.float64()).to_numpy() for name in NUMBERS])
        listed = tuple(tuple(str(name) for name in row or ()) for row in table.column("photographs").to_pylist())
    except (pa.ArrowException, TypeError, ValueError) as error:
        raise InputError(f"cannot be read: {error}", "give pickets.parquet of `aerotri dtm`", path) from error
    if not pa.types.is_string(table.column("status").type):
        raise InputError("column 'status' holds no text", "give pickets.parquet of `aerotri dtm`", path)
    status = np.array([one or "" for one in table.column("status").to_pylist()], dtype=str)
    return PicketTable(v[:, :2], v[:, 2:5], v[:, 5:8], v[:, 8:11], listed, status)
