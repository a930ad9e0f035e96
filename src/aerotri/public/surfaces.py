"""Surfaces as a notebook sees them: a raster of heights, in a file or in memory."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.crs_text import heights_of, with_heights
from aerotri.public.folders import refuse_existing_file
from aerotri.public.optional import optional_module
from aerotri.rasters.grids import Grid
from aerotri.rasters.held import HeldRaster
from aerotri.terrain.surface import Surface as Heights
from aerotri.volume.settings import LAYER, Layer

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from aerotri.formats.files.spool import Spool
    from aerotri.public.dense import DenseSurface
    from aerotri.public.table import Table
    from aerotri.rasters.metric import MetricReader

    Reader: TypeAlias = MetricReader | HeldRaster
    SurfaceLike: TypeAlias = "Surface | WithSurfaces | DenseSurface | FilePath"


class WithSurfaces(Protocol):
    """What `aerotri.terrain` returns: a surface with objects, one without, and the pickets they were measured from.

    adjustment : key of the adjustment it was measured with.
    """

    adjustment: str

    @property
    def dsm(self) -> Surface: ...
    @property
    def dtm(self) -> Surface: ...
    @property
    def pickets(self) -> Table: ...


BYTES_OF_CELL = 32
"""Of a surface that is held as a whole: heights and σ, as they are read and as they are kept."""


@dataclass(frozen=True, eq=False, repr=False)
class Surface:
    """Heights on the cells of a grid, in a raster or in memory.

    Parameters
    ----------
    source : GeoTIFF of heights, read when it is needed; or heights in memory.
    crs : of heights in memory, 'EPSG:25832', None for local coordinates; a file says it itself.
    name : as it stands in results; that of the file where empty.
    keeper : what removes the file when nobody uses it any more, None for a file that stays.
    target : 'EPSG:n' that a file in degrees or feet is brought to; its UTM zone where None.

    Examples
    --------
    >>> import numpy as np
    >>> surface = Surface.of_array(np.full((3, 4), 100.0), left=0.0, top=6.0, cell=2.0)
    >>> surface.grid.columns, float(surface.z[0, 0])
    (4, 100.0)
    """

    source: Heights | FilePath
    crs: str | None = None
    name: str = ""
    keeper: Spool | None = None
    target: str | None = None

    @classmethod
    def of_array(
        cls, z: np.ndarray, *, left: float, top: float, cell: float, sigma: np.ndarray | None = None,
        crs: str | None = None, name: str = "surface",
    ) -> Surface:  # fmt: skip
        """A surface of heights in an array.

        Parameters
        ----------
        z : (rows, columns) m, rows from north to south; NaN where not known.
        left : X of the western edge of the first column, m.
        top : Y of the northern edge of the first row, m.
        cell : side of a cell, m.
        sigma : (rows, columns) m, σ of the heights.
        crs : 'EPSG:25832'; None for local coordinates.
        name : as it stands in results.

        Returns
        -------
        Surface

        Raises
        ------
        InputError
            When the heights are no table, σ has another size, or the cell has none.
        """
        heights = np.asarray(z, dtype=float)
        spread = np.full_like(heights, np.nan) if sigma is None else np.asarray(sigma, dtype=float)
        if heights.ndim != 2 or not heights.size or spread.shape != heights.shape or not cell > 0.0:
            raise InputError(
                f"heights {heights.shape}, σ {spread.shape} and a cell of {cell:g} m are no surface",
                "give (rows, columns), σ of the same size, and a cell larger than 0",
            )
        rows, columns = heights.shape
        grid = Grid(rows, columns, float(left), float(top), float(cell), float(cell))
        return cls(Heights(grid, heights, spread), crs, name)

    @property
    def path(self) -> Path | None:
        """The file; None in memory."""
        return None if isinstance(self.source, Heights) else Path(self.source)

    @property
    def label(self) -> str:
        """The name, else that of the file."""
        return self.name or ("surface" if isinstance(self.source, Heights) else Path(self.source).name)

    @cached_property
    def heights(self) -> Heights:
        """The whole surface in memory: grid, heights and σ, m.

        Raises
        ------
        InputError
            When the file cannot be read, or does not fit into memory.
        """
        return self.source if isinstance(self.source, Heights) else _read_whole(Path(self.source), self.target)

    @property
    def grid(self) -> Grid:
        """The cells: size, place, number of rows and columns."""
        return self.heights.grid

    @property
    def z(self) -> np.ndarray:
        """(rows, columns) m, NaN where not known."""
        return self.heights.z

    @property
    def sigma(self) -> np.ndarray:
        """(rows, columns) m, σ of the heights; NaN where not known."""
        return self.heights.sigma

    def reader(self, target: str | None = None) -> Reader:
        """The surface to be read window by window, in metres; to be closed.

        Parameters
        ----------
        target : 'EPSG:n' that a file in degrees or feet is brought to; that of the surface, or its UTM zone, without.

        Raises
        ------
        InputError
            When the file is no raster of heights, or heights in memory are in degrees or feet.
        """
        if isinstance(self.source, Heights):
            from aerotri.rasters.metric import refuse_plan_not_in_metres

            if self.crs:
                refuse_plan_not_in_metres(self.crs, self.label)
            h = self.source
            return HeldRaster(np.where(_is_written(h), h.z, np.nan), h.grid, self.crs, self.label)
        from aerotri.rasters.metric import MetricReader

        return MetricReader(self.source, target=target or self.target)

    def plot(self) -> Figure:
        """The surface lit from the north-west, and its σ where it is known."""
        from aerotri.report.plots.terrain import plot_heights

        h = self.heights
        sigma = h.sigma if np.isfinite(h.sigma).any() else None
        return plot_heights(h.grid, h.z, sigma, self.label, self._crs_text() is None)

    def to_xarray(self) -> Any:
        """An `xarray.Dataset` with Z and its σ, m, over y and x.

        Raises
        ------
        InputError
            When xarray is not installed.
        """
        return dataset_of({"": self}, self._crs_text())

    def save(self, path: FilePath, overwrite: bool = False) -> Path:
        """Write heights and σ as the two bands of a cloud-optimised GeoTIFF.

        Parameters
        ----------
        path : file to write. overwrite : replace a file that is there.

        Raises
        ------
        InputError
            When the file is there already, or cannot be written.
        """
        from aerotri.formats.files.atomic import atomic_file
        from aerotri.rasters.grids import write_raster
        from aerotri.rasters.surface_files import write_surface

        target, h = Path(path), self.heights
        refuse_existing_file(target, overwrite)
        with atomic_file(target) as place:
            if np.isfinite(h.sigma).any():
                write_surface(place, h.z, h.sigma, h.grid, self._crs_text(), f"{self.label} Z, m")
            else:
                write_raster(place, h.z, h.grid, self._crs_text(), f"{self.label} Z, m")
        return target

    def _crs_text(self) -> str | None:
        """With the system of heights in metres, as the heights are."""
        from aerotri.rasters.height_systems import metric_height_system

        if isinstance(self.source, Heights):
            heights = heights_of(self.crs or "")
            return with_heights(self.crs or "", metric_height_system(heights)) if heights else self.crs
        with self.reader() as reader:
            return reader.system or None

    def __repr__(self) -> str:
        return f"<aerotri.Surface {self.label!r}, {'in memory' if self.path is None else self.path}>"

    def _repr_html_(self) -> str:
        return self.html()

    def html(self) -> str:
        """Name, size and heights, as a notebook shows them."""
        from html import escape

        g, z = self.grid, self.z
        known = np.isfinite(z)
        span = f"{np.nanmin(z):.2f} … {np.nanmax(z):.2f} m" if known.any() else "no heights"
        return (
            f"<div><b>{escape(self.label)}</b>: {g.rows} × {g.columns} cells of {g.cell_x:g} m, {span}, "
            f"{100.0 * known.mean():.0f} % known</div>"
        )


def as_surface(surface: SurfaceLike, layer: Layer = LAYER) -> Surface:
    """The surface itself, that of a terrain model, or that of a file.

    Parameters
    ----------
    layer : of a terrain model, or of the folder it was written to: with objects (dsm) or without (dtm).

    Raises
    ------
    InputError
        For a folder without it.
    """
    if isinstance(surface, Surface):
        return surface
    if isinstance(surface, str | os.PathLike):
        path = Path(surface)
        if not path.is_dir():
            return Surface(path)
        if not (path / f"{layer}.tif").is_file():
            raise InputError(
                f"holds no surface: there is no {layer}.tif",
                "give the folder that dsm or dtm wrote, or a GeoTIFF",
                path,
            )
        return Surface(path / f"{layer}.tif")
    from aerotri.public.dense import DenseSurface

    if isinstance(surface, DenseSurface):
        return surface.dtm if layer == "dtm" else surface.surface
    return surface.dsm if layer == "dsm" else surface.dtm


def dataset_of(surfaces: dict[str, Surface], crs: str | None) -> Any:
    """An `xarray.Dataset` of surfaces on one grid; their names stand behind Z and sigma_Z.

    Raises
    ------
    InputError
        When xarray is not installed.
    """
    xarray = optional_module("xarray", "z and sigma are arrays of numpy")
    values = {}
    for name, surface in surfaces.items():
        behind = f"_{name}" if name else ""
        values[f"Z{behind}"] = (("y", "x"), surface.z, {"units": "m"})
        values[f"sigma_Z{behind}"] = (("y", "x"), surface.sigma, {"units": "m"})
    grid = next(iter(surfaces.values())).grid
    places = {"x": grid.x(np.arange(grid.columns)), "y": grid.y(np.arange(grid.rows))}
    return xarray.Dataset(values, places, {"crs": crs or "local"})


def _is_written(heights: Heights) -> np.ndarray:
    """(rows, columns) bool: cells that a file of heights with σ holds, those whose σ is known too."""
    known = np.isfinite(heights.sigma)
    return known if known.any() else np.ones(known.shape, bool)


def _read_whole(path: Path, target: str | None) -> Heights:
    from aerotri.memory import refuse_beyond_memory
    from aerotri.rasters.metric import MetricReader

    with MetricReader(path, target=target) as reader:
        g = reader.grid
        refuse_beyond_memory(
            float(BYTES_OF_CELL) * g.rows * g.columns, f"{path.name} with {g.rows} × {g.columns} cells",
            "cut out the part that is needed",
        )  # fmt: skip
        z, bands = reader.read(0, 0, g.rows, g.columns).astype(float), reader.bands
    if bands < 2:
        return Heights(g, z, np.full_like(z, np.nan))
    with MetricReader(path, band=2, target=target) as reader:
        return Heights(g, z, reader.read(0, 0, g.rows, g.columns).astype(float))
