"""Adjusted blocks for tests of what a GIS reads: local, in a CRS, with names that need quotes."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import shapely

from aerotri.coordinates.local_frame import local_frame
from aerotri.functional_model.rotation import angles_from_rotation, rotation_from_angles
from aerotri.observations import Block
from small_blocks import small_block

PLAIN = "EPSG:25832"


def in_crs(block: Block, crs: str = PLAIN, place: tuple[float, float, float] = (360000.0, 5450000.0, 0.0)) -> Block:
    """The block as if its coordinates were those of the tangent plane at a place, in a CRS.

    Parameters
    ----------
    place : of the origin, m in the CRS.
    """
    frame = local_frame(crs, np.array([place]))
    images, control = block.images, block.control
    centre = frame.from_local(images.centre)
    turned = np.swapaxes(frame.axes_at(centre), 1, 2) @ rotation_from_angles(images.angles, block.rotation)
    angles = angles_from_rotation(turned, block.rotation)
    return replace(
        block, crs=crs, control=replace(control, xyz=frame.from_local(control.xyz)),
        images=replace(images, centre=centre, angles=angles),
    )  # fmt: skip


def odd_names(block: Block) -> Block:
    """Names with spaces, quotes and letters of other languages."""
    points = np.array([f"point {k} “a” 'b' ß" for k in range(len(block.points))], dtype=object)
    names = np.array([f"photo {k}; Höhe in {k}" for k in range(len(block.images))], dtype=object)
    strip = np.array([f'strip "{name}"' for name in block.images.strip], dtype=object)
    return replace(block, points=points, images=replace(block.images, names=names, strip=strip))


def plain_block(seed: int = 1) -> Block:
    """A small block in local coordinates with control, check points and Brown's K1."""
    return small_block(seed, "brown:K1", control={"distance_bases": 1.5, "sigma_m": [0.03, 0.03, 0.05],
                                                  "check_points": 8})[0]  # fmt: skip


def layers_of(path: Path) -> dict[str, list[dict]]:
    """Rows of all layers by name, as any program with SQLite reads them; geom as a shapely geometry."""
    with closing(sqlite3.connect(path)) as database:
        database.row_factory = sqlite3.Row
        found = {}
        for name, kind in database.execute("SELECT table_name, data_type FROM gpkg_contents").fetchall():
            rows = [dict(row) for row in database.execute(f'SELECT * FROM "{name}"')]
            if kind == "features":
                rows = [row | {"geom": geometry(row["geom"])} for row in rows]
            found[name] = rows
    return found


def geometry(blob: bytes | None) -> shapely.Geometry | None:
    """A geometry of a GeoPackage; its header is checked."""
    if blob is None:
        return None
    assert blob[:4] == b"GP\x00\x03"
    return shapely.from_wkb(blob[40:])
