"""Surfaces of any kind of file, ready to be asked for their heights: rasters, point clouds, pickets."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerotri.conventions import InputError
from aerotri.crs_text import plan_of
from aerotri.formats.results.pickets import read_pickets
from aerotri.formats.results.point_cloud import read_point_cloud, refuse_cloud_units, system_of_cloud
from aerotri.rasters.grids import RasterReader
from aerotri.rasters.held import HeldRaster
from aerotri.rasters.metric import MetricReader, metric_crs_for, units_of
from aerotri.terrain.compare import FileHeights, Heights, PointHeights, RasterHeights

LARGEST_HELD = 64_000_000
"""Cells of a raster that is held as a whole; a larger one is read part by part."""
CLOUDS, RASTERS = (".las", ".laz"), (".tif", ".tiff", ".asc", ".img", ".vrt")
KINDS = "give a GeoTIFF, LAZ, or pickets.parquet"


@dataclass(frozen=True, eq=False)
class HeightSource:
    """A surface and where it lies.

    Parameters
    ----------
    heights : to be asked. area : (2, 2) m, lower left and upper right corner of what it covers.
    cell : m, its typical cell.
    crs : as of `crs_text`, '' where not stated.
    note : what was done to bring it to metres, '' for nothing.
    """

    heights: Heights
    area: np.ndarray
    cell: float
    note: str = ""
    crs: str = ""

    @property
    def plan(self) -> str:
        """Its CRS in X and Y, '' where not known."""
        return plan_of(self.crs)


def file_of_surface(path: Path) -> Path:
    """The file itself, or the surface with objects in a folder of `aerotri dtm`."""
    return path / "dsm.tif" if path.is_dir() else path


def common_crs(*paths: Path) -> str | None:
    """Where a raster that does not count in metres is brought to: the CRS of another one, else None."""
    wanted = None
    for path in paths:
        file = file_of_surface(path)
        if file.suffix.lower() not in RASTERS or not file.is_file():
            continue
        with RasterReader(file) as reader:
            if units_of(reader).plan == "metre":
                if reader.plan:
                    return reader.plan
            else:
                wanted = wanted or metric_crs_for(reader)
    return wanted


def heights_of_file(path: Path, stack: ExitStack, crs: str | None) -> HeightSource:
    """The surface of a file; one that is read part by part is open as long as the stack.

    Parameters
    ----------
    crs : 'EPSG:n' that a raster in degrees or feet is brought to; None: the UTM zone.

    Raises
    ------
    InputError
        When the file is missing, of no known kind, or holds no surface.
    """
    path, system, note = file_of_surface(path), "", ""
    if not path.is_file():
        raise InputError("there is no such file", KINDS, path)
    if path.suffix.lower() in RASTERS:
        return heights_of_raster(stack.enter_context(MetricReader(path, target=crs)))
    if path.suffix.lower() in CLOUDS:
        cloud = read_point_cloud(path)
        xyz, note = cloud.xyz, cloud.note and f"{path.name}: {cloud.note}"
        refuse_cloud_units(path)
        system = system_of_cloud(path)
    elif path.suffix.lower() == ".parquet":
        table = read_pickets(path)
        xyz = table.xyz[table.accepted]
    else:
        raise InputError("is of no known kind", KINDS, path)
    try:
        surface = PointHeights.of(xyz)
    except InputError as error:
        raise InputError(error.message, error.remedy, path) from error
    area = np.array([xyz[:, :2].min(axis=0), xyz[:, :2].max(axis=0)])
    return HeightSource(surface, area, float(np.sqrt(np.prod(area[1] - area[0]) / len(xyz))), note, system)


def heights_of_raster(reader: MetricReader | HeldRaster) -> HeightSource:
    """The surface of a raster, held as a whole unless it is large.

    Raises
    ------
    InputError
        When it has no heights.
    """
    g = reader.grid
    if g.rows * g.columns > LARGEST_HELD:
        left, bottom, right, top = g.bounds
        area = np.array([[left, bottom], [right, top]])
        return HeightSource(FileHeights(reader), area, g.cell_x, reader.note, reader.system)
    z = reader.read(0, 0, g.rows, g.columns).astype(float)
    known_rows, known_columns = np.isfinite(z).any(axis=1), np.isfinite(z).any(axis=0)
    if not known_rows.any():
        raise InputError("has no data", "give a raster with heights", reader.path)
    rows, columns = np.flatnonzero(known_rows)[[0, -1]], np.flatnonzero(known_columns)[[0, -1]]
    area = np.array([[g.x(columns[0]), g.y(rows[1])], [g.x(columns[1]), g.y(rows[0])]], dtype=float)
    return HeightSource(RasterHeights(g, z), area, g.cell_x, reader.note, reader.system)
