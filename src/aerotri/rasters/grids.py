"""Reading and writing of rasters window by window; nothing else knows rasterio, which is imported when it is needed.

Rasters are north-up: columns to the right, rows down. A value belongs to the centre of its cell. What is not known is
NaN inside the program and the no-data value in a file.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterable, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from aerotri.conventions import FilePath, InputError, regular_file
from aerotri.crs_text import crs_text, plan_of
from aerotri.rasters.quiet import quietly
from aerotri.vectors.geojson import LARGEST_M

if TYPE_CHECKING:
    from rasterio.windows import Window

NO_DATA = -9999.0
"""Stands for what is not known in the files of this program."""
CACHE_BYTES = 256 << 20
"""Of blocks that GDAL keeps: it would take a share of the machine's memory otherwise. rasterio hands bytes on, not
MB."""
TILE = 512
"""Side of the tiles of files written, pixels; a multiple of 16 as TIFF asks for, and the size usual for cloud-optimised
files."""
SAMPLED_CELLS, FEWEST_ROWS = 64e6, 16
"""Cells that are read for a sample at most, but for so many rows [C]: a second or two of a packed file."""
SIGMA = "σ"
"""The description of a band of σ begins with it."""
BANDS_REMEDY = "give heights in one band, and their σ in a second one whose description begins with 'σ', if it has one"
COMPOUND = ("COMPD_CS", "COMPOUNDCRS")
"""Beginnings of the WKT of a CRS with a system of heights."""
DAMAGED = "write the file anew, it is damaged"
KEPT_OPTIONS = ("compress", "predictor")


@dataclass(frozen=True)
class Grid:
    """The cells of a north-up raster.

    Parameters
    ----------
    rows, columns : size.
    left, top : outer edges of the first cell, in the unit of the coordinates.
    cell_x, cell_y : size of a cell, both positive.
    """

    rows: int
    columns: int
    left: float
    top: float
    cell_x: float
    cell_y: float

    def x(self, column: ArrayLike) -> np.ndarray:
        """Coordinate of the centres of columns; whole and broken numbers alike."""
        return self.left + (np.asarray(column) + 0.5) * self.cell_x

    def y(self, row: ArrayLike) -> np.ndarray:
        """Coordinate of the centres of rows."""
        return self.top - (np.asarray(row) + 0.5) * self.cell_y

    def column(self, x: ArrayLike) -> np.ndarray:
        """Broken number of the column whose centre is at x; the inverse of `x`."""
        return (np.asarray(x) - self.left) / self.cell_x - 0.5

    def row(self, y: ArrayLike) -> np.ndarray:
        """The inverse of `y`."""
        return (self.top - np.asarray(y)) / self.cell_y - 0.5

    def window(self, row: int, column: int, rows: int, columns: int) -> Grid:
        """The grid of some rows and columns."""
        left, top = self.left + column * self.cell_x, self.top - row * self.cell_y
        return Grid(rows, columns, left, top, self.cell_x, self.cell_y)

    def between_centres(self) -> Grid:
        """The grid whose cells have their corners at the centres of this one's."""
        left, top = self.left + self.cell_x / 2.0, self.top - self.cell_y / 2.0
        return Grid(self.rows - 1, self.columns - 1, left, top, self.cell_x, self.cell_y)

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Outer edges: left, bottom, right, top."""
        return (
            self.left, self.top - self.rows * self.cell_y, self.left + self.columns * self.cell_x, self.top,
        )  # fmt: skip

    def coarser(self, cells: int) -> Grid:
        """The grid with `cells` × `cells` cells made one; the last ones reach beyond the edge."""
        rows, columns = -(-self.rows // cells), -(-self.columns // cells)
        return Grid(rows, columns, self.left, self.top, self.cell_x * cells, self.cell_y * cells)

    @classmethod
    def of_nodes(cls, x: np.ndarray, y: np.ndarray) -> Grid:
        """The grid whose cells have their centres at equally spaced nodes, x rising, y falling."""
        cell_x, cell_y = float(x[-1] - x[0]) / (len(x) - 1), float(y[0] - y[-1]) / (len(y) - 1)
        return cls(len(y), len(x), float(x[0]) - cell_x / 2.0, float(y[0]) + cell_y / 2.0, cell_x, cell_y)


def bilinear(read: Callable[[int, int, int, int], np.ndarray], grid: Grid, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(n,) values at places (n,), linear between the four cells around; NaN where one of these is not known.

    Parameters
    ----------
    read : a window by its first row and column and its size.
    """
    column, row = grid.column(x), grid.row(y)
    out = np.full(len(column), np.nan)
    there = (column >= 0.0) & (row >= 0.0) & (column <= grid.columns - 1) & (row <= grid.rows - 1)
    if not there.any():
        return out
    first_row, first_column = int(row[there].min()), int(column[there].min())
    size = int(row[there].max()) - first_row + 2, int(column[there].max()) - first_column + 2
    window = read(first_row, first_column, *size).astype(float)
    i, j = np.floor(row[there]).astype(int) - first_row, np.floor(column[there]).astype(int) - first_column
    t, s = row[there] % 1.0, column[there] % 1.0
    corners = (window[i, j], window[i, j + 1], window[i + 1, j], window[i + 1, j + 1])
    weights = ((1.0 - t) * (1.0 - s), (1.0 - t) * s, t * (1.0 - s), t * s)
    # a cell of no weight may be unknown: places on the last column have nothing to their right
    out[there] = sum(np.where(w > 0.0, w * c, 0.0) for w, c in zip(weights, corners, strict=True))
    return out


class RasterReader:
    """A raster of one band, or a surface with its σ, open for reading; used as a context manager, from one thread.

    Parameters
    ----------
    band : which is read: 1 the heights, 2 the σ of a file of `write_surface`.

    Attributes
    ----------
    grid : its cells. dtype : float type in which it is delivered. no_data : its no-data value, None if it has none.
    crs : rasterio's CRS or None. bands : how many there are. options : how the file is written, for a copy of the same
    kind.
    """

    def __init__(self, path: FilePath, band: int = 1):
        import rasterio

        self.path, self.band = Path(path), band
        if os.path.lexists(self.path) and not self.path.is_dir():  # GDAL opens folders, and files inside archives
            regular_file(self.path)
        with _told(self.path, "is no raster", "give a GeoTIFF"), quietly():
            self._file = rasterio.open(self.path)
        try:
            with _told(self.path, "cannot be read", DAMAGED):
                self._check()
                self._look()
        except InputError:
            self._file.close()
            raise

    def __reduce__(self) -> tuple[Any, ...]:
        """Another process opens the file itself."""
        return type(self), (self.path.absolute(), self.band)

    def _look(self) -> None:
        t = self._file.transform
        self.grid = Grid(self._file.height, self._file.width, t.c, t.f, t.a, -t.e)
        given = np.dtype(self._file.dtypes[0])
        self.dtype = given if given.kind == "f" and given.itemsize >= 4 else np.dtype(np.float32)
        if given.kind in "iu" and given.itemsize > 2:
            self.dtype = np.dtype(np.float64)
        self.no_data: float | None = self._file.nodata
        self.crs: Any = self._file.crs
        self.bands = self._file.count
        self.options = {key: self._file.profile[key] for key in KEPT_OPTIONS if key in self._file.profile}
        self._masked = self.no_data is None and "all_valid" not in {f.name for f in self._file.mask_flag_enums[0]}

    def _check(self) -> None:
        file = self._file
        if file.count != 1 and not (file.count == 2 and str(file.descriptions[1]).startswith(SIGMA)):
            raise InputError(f"has {file.count} bands", BANDS_REMEDY, self.path)
        if self.band > file.count:
            raise InputError("has no σ", "give a surface of `aerotri dtm`", self.path)
        t = file.transform
        if t.b or t.d or t.a <= 0.0 or t.e >= 0.0:
            raise InputError("is turned, mirrored or without georeference", "give a north-up GeoTIFF", self.path)
        if not all(abs(value) <= LARGEST_M for value in (t.a, t.c, t.e, t.f)):
            raise InputError("lies at no possible place", "give a north-up GeoTIFF in metres", self.path)
        if np.dtype(file.dtypes[0]).kind not in "iuf":
            raise InputError(f"has values of type {file.dtypes[0]}", "give numbers", self.path)
        if file.scales[0] != 1.0 or file.offsets[0] != 0.0:
            raise InputError("has a scale or an offset", "write the values out (gdal_translate -unscale)", self.path)

    @property
    def system(self) -> str:
        """The CRS with that of its heights, as of `crs_text`; '' where the file states none."""
        if self.crs is None:
            return ""
        from pyproj import CRS
        from pyproj.exceptions import CRSError

        with _told(self.path, "has a CRS that cannot be read", "write the file anew"):
            text = self.crs.to_wkt()
        try:
            return crs_text(CRS.from_wkt(text))
        except CRSError:
            return text

    @property
    def plan(self) -> str:
        """The CRS of X and Y, as of `crs_text`; '' where the file states none."""
        return plan_of(self.system)

    @property
    def stated_unit(self) -> str:
        """What the file says its values count in, in lower case, of a σ what it says of the heights; '' if nothing."""
        units = [(unit or "").strip().lower() for unit in self._file.units]
        return units[self.band - 1] or units[0]

    def tag(self, name: str) -> str:
        """What the file says under a name in its metadata; '' where it says nothing."""
        return str(self._file.tags().get(name, ""))

    def read(self, row: int, column: int, rows: int, columns: int) -> np.ndarray:
        """A window, (rows, columns) of `dtype`; NaN where nothing is known, beyond the edges and for infinities."""
        top, left = max(row, 0), max(column, 0)
        bottom, right = min(row + rows, self.grid.rows), min(column + columns, self.grid.columns)
        if bottom <= top or right <= left:
            return np.full((rows, columns), np.nan, self.dtype)
        values = self._values(window_of(left, top, right - left, bottom - top))
        if values.shape == (rows, columns):
            return values
        out = np.full((rows, columns), np.nan, self.dtype)
        out[top - row : bottom - row, left - column : right - column] = values
        return out

    def _values(self, window: Window) -> np.ndarray:
        with _told(self.path, "cannot be read", DAMAGED):
            raw = self._file.read(self.band, window=window)
            mask = self._file.read_masks(self.band, window=window) if self._masked else None
        values = raw.astype(self.dtype, copy=False)
        if mask is not None:
            values[mask == 0] = np.nan
        elif self.no_data is not None and not np.isnan(self.no_data):
            values[raw == float(self.no_data)] = np.nan
        # a division by zero in another program is no height either
        values[np.isinf(values)] = np.nan
        return values

    @property
    def is_masked(self) -> bool:
        """Whether the file has a mask of the cells that are known."""
        return self._masked

    def sampled(self, most: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Every so manyth cell, `most` rows and columns at most; and the rows and columns that they are in.

        Fewer rows where each costs the reading of large tiles.
        """
        cost = self._file.block_shapes[0][0] * self.grid.columns
        most_rows = int(np.clip(SAMPLED_CELLS / cost, FEWEST_ROWS, most))
        rows, columns = (
            np.unique(np.linspace(0, count - 1, min(count, limit)).astype(np.int64))
            for count, limit in ((self.grid.rows, most_rows), (self.grid.columns, most))
        )
        found = np.empty((len(rows), len(columns)), self.dtype)
        for k, row in enumerate(rows.tolist()):
            found[k] = self.read(row, 0, 1, self.grid.columns)[0, columns]
        return found, rows, columns

    def sample(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """(n,) bilinear values at places (n,); NaN where one of the four cells is not known.

        The window around all places is read at once: call it for places near one another.
        """
        return bilinear(self.read, self.grid, x, y)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._file.close()


class RasterWriter:
    """A raster of one band being written; used as a context manager, from one thread.

    Parameters
    ----------
    crs : rasterio's CRS, a text such as 'EPSG:25832', or None.
    options : creation options, such as those of a `RasterReader`. threads : for compression.
    """

    def __init__(
        self,
        path: FilePath,
        grid: Grid,
        dtype: np.dtype | type = np.float32,
        crs: Any = None,
        no_data: float | None = NO_DATA,
        options: Mapping[str, Any] | None = None,
        threads: int = 1,
    ):
        import rasterio

        made: dict[str, Any] = {"tiled": True, "blockxsize": TILE, "blockysize": TILE, "bigtiff": "IF_SAFER"}
        made |= dict(options or {})
        if "compress" in made and threads > 1:
            made["num_threads"] = threads
        self.no_data = no_data
        with quietly():
            self._file = rasterio.open(
                path, "w", driver="GTiff", height=grid.rows, width=grid.columns, count=1, dtype=np.dtype(dtype),
                crs=crs, transform=transform_of(grid), nodata=no_data, **made,
            )  # fmt: skip

    def write(self, row: int, column: int, values: np.ndarray) -> None:
        """Write a window from its upper left cell on; NaN becomes the no-data value, in `values` too."""
        if self.no_data is not None and not np.isnan(self.no_data) and values.dtype.kind == "f":
            np.copyto(values, self.no_data, where=np.isnan(values))
        window = window_of(column, row, values.shape[1], values.shape[0])
        self._file.write(values, 1, window=window)

    def describe(self, text: str) -> None:
        """What the values are, for those who open the file."""
        self._file.set_band_description(1, text)

    def __enter__(self) -> RasterWriter:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._file.close()


def write_raster(path: FilePath, values: np.ndarray, grid: Grid, crs: Any = None, text: str = "") -> None:
    """Write a whole raster (rows, columns); whole numbers as they are, others as float32 with no-data for NaN."""
    whole = values.dtype.kind in "iu"
    with RasterWriter(path, grid, values.dtype if whole else np.float32, crs, -1 if whole else NO_DATA) as writer:
        if text:
            writer.describe(text)
        writer.write(0, 0, values if whole else values.astype(np.float32))


def horizontal_crs(crs: str) -> str | None:
    """The CRS of a raster of a block: 'EPSG:25832' of 'EPSG:25832+7837', None for 'local'."""
    return None if crs == "local" else plan_of(crs)


def crs_of_heights(crs: str) -> str | None:
    """The CRS of a file of heights of a block: with its vertical part where it has one, None for 'local'."""
    return None if crs == "local" else crs


def cache_limited(most: int = CACHE_BYTES) -> Any:
    """A context in which GDAL keeps so many bytes of blocks and no more."""
    import rasterio

    return rasterio.Env(GDAL_CACHEMAX=most)


def rasterise(
    shapes: Iterable[tuple[Mapping[str, Any], int]], grid: Grid, background: int = -1, touched: bool = False
) -> np.ndarray:
    """(rows, columns) int32: the number of the last polygon that holds the centre of a cell.

    Parameters
    ----------
    shapes : pairs of a GeoJSON geometry and its number.
    touched : every cell that a geometry touches counts, not only its centre.
    """
    from rasterio.features import rasterize

    shapes = list(shapes)
    if not shapes:
        return np.full((grid.rows, grid.columns), background, np.int32)
    shape = grid.rows, grid.columns
    return rasterize(
        shapes, out_shape=shape, fill=background, dtype=np.int32, transform=transform_of(grid), all_touched=touched
    )


def transform_of(grid: Grid) -> Any:
    from rasterio import Affine

    return Affine(grid.cell_x, 0.0, grid.left, 0.0, -grid.cell_y, grid.top)


def window_of(column: int, row: int, columns: int, rows: int) -> Window:
    """rasterio's window from its upper left cell on."""
    from rasterio.windows import Window

    # attrs makes the class, in a way that cannot be read from its source
    return Window(column, row, columns, rows)  # pyright: ignore[reportCallIssue]


@contextmanager
def _told(path: Path, what: str, remedy: str) -> Generator[None]:
    """What rasterio and GDAL raise over a damaged file as an error that names it."""
    from rasterio._err import CPLE_BaseError
    from rasterio.errors import RasterioError

    try:
        yield
    except (RasterioError, CPLE_BaseError, OSError, ValueError, MemoryError, SystemError) as error:
        short = (str(error.__cause__ or error).splitlines() or [""])[0][:200] or type(error).__name__
        raise InputError(f"{what}: {short}", remedy, path) from error
