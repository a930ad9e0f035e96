"""Points and rays as GeoParquet 1.1: the columns of their tables, a geometry in WKB, and a box a row for readers that
look for a part of the block [L: OGC GeoParquet 1.1].
"""

# pyright: reportUnknownParameterType=false
# (pyarrow has no types: what is annotated as its Table or Array is unknown to pyright)

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from aerotri.formats.gis.layers import points_at, points_table_columns
from aerotri.formats.results.adjustment import residual_table
from aerotri.results.adjusted_block import AdjustedBlock

if TYPE_CHECKING:
    import pyarrow as pa

GEOMETRY, BOX = "geometry", "bbox"
SIDES = ("xmin", "ymin", "xmax", "ymax")
ROWS_AT_A_TIME = 200_000
"""Rows of a group [C]: 50 MB of geometries at a time."""
Geometries = Callable[[slice], np.ndarray]


def write_points(path: Path, adjusted: AdjustedBlock, texts: Mapping[str, str]) -> None:
    """Write the object points.

    Parameters
    ----------
    texts : what columns are, by name.
    """
    import pyarrow as pa

    columns = {
        name: pa.array(values.astype(str), pa.string())
        if values.dtype.kind in "OU"
        else pa.array(values, from_pandas=True)
        for name, values in points_table_columns(adjusted).items()
    }
    xyz = adjusted.points.xyz
    _write(path, pa.table(columns), lambda rows: points_at(xyz[rows]), (xyz,), ("Point Z", adjusted.block.crs), texts)


def write_rays(path: Path, adjusted: AdjustedBlock, texts: Mapping[str, str]) -> None:
    """Write the image points, as lines from the projection centre to the object point; `texts` as of `write_points`."""
    rays = adjusted.block.image_points
    begin, end = adjusted.images.centre[rays.image], adjusted.points.xyz[rays.point]
    known = np.isfinite(np.concatenate([begin, end], axis=1)).all(axis=1)

    def lines(rows: slice) -> np.ndarray:
        import shapely

        own = np.asarray(known)[rows]
        out = np.full(len(own), None)
        out[own] = shapely.linestrings(np.stack([begin[rows][own], end[rows][own]], axis=1))
        return out

    kind = "LineString Z", adjusted.block.crs
    _write(path, residual_table(adjusted), lines, (begin[known], end[known]), kind, texts)


def _write(
    path: Path, table: pa.Table, geometries: Geometries, places: tuple[np.ndarray, ...], kind: tuple[str, str],
    texts: Mapping[str, str],
) -> None:  # fmt: skip
    """Write a table with its geometries, group by group.

    Parameters
    ----------
    geometries : of some rows, None for one that has no place. places : (k, 3) m, all that lie in them.
    kind : of the geometries, and the CRS.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    numbers = pa.float64()
    box = pa.struct([(side, numbers) for side in SIDES])
    schema = table.schema.append(pa.field(GEOMETRY, pa.binary())).append(pa.field(BOX, box))
    for number, name in enumerate(schema.names):
        if name in texts:
            schema = schema.set(number, schema.field(number).with_metadata({"description": texts[name]}))
    schema = schema.with_metadata({"geo": json.dumps(_geo(places, *kind))})
    with pq.ParquetWriter(path, schema, compression="zstd") as writer:
        for first in range(0, max(len(table), 1), ROWS_AT_A_TIME):
            rows = slice(first, first + ROWS_AT_A_TIME)
            part = table.slice(first, ROWS_AT_A_TIME)
            arrays = [*part.combine_chunks().columns, *_arrays(geometries(rows), box)]
            writer.write_table(pa.table(arrays, schema=schema))


def _arrays(geometries: np.ndarray, box: Any) -> tuple[pa.Array, pa.Array]:
    """Geometries as WKB, and their boxes; null where there is none."""
    import pyarrow as pa
    import shapely

    wkb = shapely.to_wkb(geometries, output_dimension=3, byte_order=1, flavor="iso")
    missing = np.array([one is None for one in geometries], dtype=bool)
    sides = [pa.array(values, pa.float64()) for values in shapely.bounds(geometries).T]
    return pa.array(wkb.tolist(), pa.binary()), pa.StructArray.from_arrays(
        sides, fields=list(box), mask=pa.array(missing)
    )


def _geo(places: tuple[np.ndarray, ...], kind: str, crs: str) -> dict[str, Any]:
    """The metadata of the file."""
    together = np.concatenate(places)
    together = together[np.isfinite(together).all(axis=1)]
    column: dict[str, Any] = {
        "encoding": "WKB", "geometry_types": [kind], "crs": projjson(crs), "edges": "planar",
        "covering": {BOX: {side: [BOX, side] for side in SIDES}},
    }  # fmt: skip
    if len(together):
        column["bbox"] = [*together.min(axis=0).tolist(), *together.max(axis=0).tolist()]
    return {"version": "1.1.0", "primary_column": GEOMETRY, "columns": {GEOMETRY: column}}


def projjson(crs: str) -> dict[str, Any] | None:
    """A CRS as PROJ writes it in JSON; None of local coordinates."""
    from pyproj import CRS

    return None if crs == "local" else CRS.from_user_input(crs).to_json_dict()
