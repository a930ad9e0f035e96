"""The photographs of a block as matching takes them: image pyramids, and views of a piece of ground.

Grey values are taken in 16 bits, 8-bit photographs times 256, so that means over pixels do not round. A level of the
pyramid has half the columns and rows of the one below; its pixels are means of four.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from aerotri.conventions import InputError
from aerotri.deformation.error_tables import ErrorTables, error_tables
from aerotri.deformation.model_grid import Places, mean_ground, places_of
from aerotri.deformation.orientation import Orientation, photo_rows
from aerotri.deformation.photo_errors import PhotoErrors
from aerotri.deformation.restitution import FREE, Restitution, restitution_of
from aerotri.rasters.images import open_photograph
from aerotri.results.adjustment import Adjustment
from aerotri.statistics.camera_field import known_field
from aerotri.terrain._view_kernels import View

CACHE_BYTES = 500_000_000
"""Bytes of pyramids kept in memory; chosen [C]: seventeen photographs of 12 Mpx or three of 86 Mpx, and well below the
2 GB that the whole command may take."""
ROWS_AT_A_TIME = 1024
"""Rows that are read and averaged at a time."""
EIGHT = 256
"""By which grey values of 8 bits become such of 16."""
COLOURS = 3
"""Bands that are averaged to grey, red, green and blue: what follows them is infrared or a mask."""
TABLE_TOLERANCE_PX = 0.01
"""Largest error of tabulated image errors, pixels; chosen [C]: far below any σ of matching, so that it does not
count."""
CROP_MARGIN_PX = 24
"""By which crops reach beyond the windows of their nodes, pixels of the level."""


class PyramidStore:
    """Pyramids of photographs, the levels used last kept in memory.

    The finest level is most of a pyramid: it is read again when it is asked for, after the coarser ones were.

    Parameters
    ----------
    paths : of the photographs; sizes : (columns, rows) that each must have. levels : of every pyramid.
    most_bytes : kept.
    """

    def __init__(
        self, paths: Sequence[Path], sizes: Sequence[tuple[int, int]], levels: int, most_bytes: int = CACHE_BYTES
    ):
        self._paths, self._sizes, self.levels, self._most = paths, sizes, levels, most_bytes
        self._kept: OrderedDict[tuple[int, int], np.ndarray] = OrderedDict()
        self._lock, self._bytes = Lock(), 0
        self.reads = 0

    def __reduce__(self) -> tuple[Any, ...]:
        """Another process reads the photographs itself."""
        return PyramidStore, ([path.absolute() for path in self._paths], self._sizes, self.levels, self._most)

    @property
    def most_bytes(self) -> int:
        """Bytes that are kept at most, of pixels with 16 bits."""
        return min(self._most, sum(8 * columns * rows // 3 for columns, rows in self._sizes))

    def level(self, k: int, level: int) -> np.ndarray:
        """(rows, columns) of photograph k: uint16, or uint8 for the finest level of 8-bit photographs."""
        with self._lock:
            if (k, level) not in self._kept:
                self._read(k, level)
            self._kept.move_to_end((k, level))
            return self._kept[k, level]

    def _read(self, k: int, level: int) -> None:
        found = read_pyramid(self._paths[k], self._sizes[k], self.levels)
        self.reads += 1
        for n in reversed(range(min(level, 1), self.levels)):
            if (k, n) not in self._kept:
                self._kept[k, n] = found[n]
                self._bytes += found[n].nbytes
        self._kept.move_to_end((k, level))
        while self._bytes > self._most and len(self._kept) > 1:
            self._bytes -= self._kept.popitem(last=False)[1].nbytes


def read_pyramid(path: Path, size: tuple[int, int], levels: int) -> list[np.ndarray]:
    """Grey values of a photograph, 8 bits as they are, then of its coarser levels, 16 bits.

    Raises
    ------
    InputError
    """
    with open_photograph(path) as photograph:
        if (photograph.columns, photograph.rows) != tuple(size):
            raise InputError(
                f"is {photograph.columns} × {photograph.rows} pixels large, its camera has {size[0]} × {size[1]}",
                "give the photographs as they were measured", path,
            )  # fmt: skip
        # floating point is stretched over the range of the whole photograph
        step = ROWS_AT_A_TIME if np.issubdtype(photograph.dtype, np.integer) else photograph.rows
        parts = []
        for first in range(0, photograph.rows, step):
            bands = photograph.read(first, min(first + step, photograph.rows))
            parts.append(_grey(bands[: COLOURS if len(bands) >= COLOURS else 1]))
    found = [parts[0] if len(parts) == 1 else np.concatenate(parts)]
    for n in range(levels - 1):
        found.append(_halved(found[-1], EIGHT if n == 0 and found[0].dtype == np.uint8 else 1))
    return found


def sixteen_bits(pixels: np.ndarray) -> np.ndarray:
    """uint16; what has 8 bits is multiplied by 256."""
    return pixels.astype(np.uint16) * np.uint16(EIGHT) if pixels.dtype == np.uint8 else pixels


def _grey(bands: np.ndarray) -> np.ndarray:
    """(rows, columns) the mean of the bands, uint16; a single band of 8 bits as it is."""
    if bands.dtype == np.uint8 and len(bands) == 1:
        return bands[0]
    if bands.dtype == np.uint8:
        return (bands.sum(axis=0, dtype=np.uint32) * np.uint32(256) // len(bands)).astype(np.uint16)
    if bands.dtype == np.uint16:
        return bands[0] if len(bands) == 1 else (bands.sum(axis=0, dtype=np.uint32) // len(bands)).astype(np.uint16)
    grey = bands.mean(axis=0)
    low, high = float(np.nanmin(grey)), float(np.nanmax(grey))
    return np.nan_to_num((grey - low) * (65535.0 / (high - low if high > low else 1.0))).astype(np.uint16)


def _halved(pixels: np.ndarray, times: int) -> np.ndarray:
    """(rows // 2, columns // 2) uint16, means of four pixels times a number."""
    rows, columns = pixels.shape[0] // 2 * 2, pixels.shape[1] // 2 * 2
    p = pixels[:rows, :columns]
    total = np.zeros((rows // 2, columns // 2), np.uint32)
    for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
        total += p[i::2, j::2]
    return ((total * np.uint32(times) + np.uint32(2)) // np.uint32(4)).astype(np.uint16)


@dataclass(frozen=True, eq=False)
class Photographs:
    """Oriented photographs with their pixels.

    Parameters
    ----------
    rows : (n,) photographs of the block. orientation : theirs. names : (n,).
    of : all photographs of the block, with their image errors. tables, source : image errors for kernels.
    sensor : (n, 3) half columns, half rows, pixels per mm.
    places : between the CRS and the frame of the orientations. ground : m, mean height in the CRS.
    gsd : (n,) m. centres : (n, 3) m in the CRS. error_px : largest image error.
    """

    rows: np.ndarray
    orientation: Orientation
    names: np.ndarray
    restitution: Restitution
    tables: ErrorTables
    source: np.ndarray
    sensor: np.ndarray
    places: Places
    ground: float
    gsd: np.ndarray
    centres: np.ndarray
    error_px: float
    store: PyramidStore

    def __len__(self) -> int:
        return len(self.rows)


@dataclass(frozen=True, eq=False)
class Site:
    """Photographs in coordinates Δ about a place of the CRS, in which they are affine images of the frame.

    Parameters
    ----------
    place : (3,) in the CRS. local : (3,), axes : (3, 3), local + axes·Δ lies in the frame.
    photos : (1, n, 23), centres : (n, 3) m, both in Δ.
    """

    photographs: Photographs
    place: np.ndarray
    local: np.ndarray
    axes: np.ndarray
    photos: np.ndarray
    centres: np.ndarray

    def from_delta(self, delta: np.ndarray) -> np.ndarray:
        """(n, 3) in the CRS."""
        p = self.photographs.places
        return self.place + delta if p.frame is None else p.from_local(self.local + delta @ self.axes.T)

    def view(self, level: int, low: np.ndarray, high: np.ndarray, edge: float, reach: float) -> View:
        """What kernels need to work within a box.

        Parameters
        ----------
        low, high : (3,) m, corners of the box in Δ. edge : share of the format that is not used.
        reach : m by which windows reach beyond the box.
        """
        p = self.photographs
        scale = 0.5**level
        parts, crops, offset = [], np.zeros((len(p), 5), np.int64), 0
        for k in range(len(p)):
            window = self._window(k, low, high, reach, scale)
            if window is None:
                continue
            pixels = p.store.level(k, level)
            row, column = max(window[0], 0), max(window[1], 0)
            part = pixels[row : window[2] + 1, column : window[3] + 1]
            if part.size == 0:
                continue
            crops[k] = offset, row, column, *part.shape
            parts.append(sixteen_bits(part).ravel())
            offset += part.size
        pixels = np.concatenate(parts) if parts else np.zeros(1, np.uint16)
        errors = p.tables.for_kernels
        return View(self.photos, p.source, errors, p.sensor, self.centres, crops, pixels, scale, edge)

    def _while_read(self, k: int, u: np.ndarray) -> np.ndarray:
        """Places (n, 3) in camera k as they are when the first and the last rows are read; (n, 3) or (2n, 3)."""
        velocity, spin, rate = np.split(self.photos[0, k, 15:], [3, 6])
        half_c, half_r, per_mm = self.photographs.sensor[k]
        tau = float(np.abs(rate) @ np.array([half_c, half_r])) / per_mm
        if tau == 0.0:
            return u
        moved = [(u - velocity * t, t) for t in (-tau, tau)]
        return np.concatenate([w - t * np.cross(spin, w) for w, t in moved])

    def _window(
        self, k: int, low: np.ndarray, high: np.ndarray, reach: float, scale: float
    ) -> tuple[int, int, int, int] | None:
        """First row and column, last row and column of the level that show the box; None where it is not seen."""
        x, y = (np.array([low[a] - reach, high[a] + reach]) for a in range(2))
        corners = np.stack(np.meshgrid(x, y, [low[2], high[2]]), axis=-1).reshape(-1, 3)
        u = corners @ self.photos[0, k, :12].reshape(3, 4)[:, :3].T + self.photos[0, k, :12].reshape(3, 4)[:, 3]
        u = self._while_read(k, u)
        c, x0, y0 = self.photos[0, k, 12:15]
        if not (u[:, 2] < 0.0).all():
            return None
        half_c, half_r, per_mm = self.photographs.sensor[k]
        column = (half_c + per_mm * (x0 - c * u[:, 0] / u[:, 2])) * scale
        row = (half_r - per_mm * (y0 - c * u[:, 1] / u[:, 2])) * scale
        margin = CROP_MARGIN_PX + self.photographs.error_px * scale
        if column.max() < 0 or row.max() < 0 or column.min() > 2 * half_c * scale or row.min() > 2 * half_r * scale:
            return None
        return (
            int(row.min() - margin), int(column.min() - margin), int(row.max() + margin), int(column.max() + margin)
        )  # fmt: skip


def photographs_of(
    calibration: Adjustment, rows: np.ndarray, paths: Sequence[Path], ideal: bool = False
) -> Photographs:
    """Photographs of an adjusted block, their image errors being those of its additional parameters.

    Parameters
    ----------
    rows : (n,) photographs of the block; paths : their files. ideal : whether they have been freed of image errors.

    Raises
    ------
    InputError
        For scanned film, whose pixels are no image coordinates, and for photographs without orientation.
    """
    block = calibration.local.block
    restitution = replace(restitution_of(calibration, FREE), left=known_field(calibration))
    for row, path in zip(rows.tolist(), paths, strict=True):
        if row in block.interior_fits:
            raise InputError("is scanned film, which matching does not read", "resample it to its fiducials", path)
        if not restitution.true.known[row]:
            raise InputError("is not oriented", "leave it out, or adjust it", path)
    places = places_of(calibration)
    orientation = restitution.true.take(rows)
    cameras = [block.cameras[c] for c in block.images.camera[rows]]
    pixel, in_force = min(camera.pixel_mm for camera in cameras), restitution.errors
    if ideal:
        # rows of a rolling shutter have been moved to where the middle of the readout shows them
        orientation = orientation.standing_still
        # the restitution keeps the errors: those of their parameters are in photographs freed by them as well
        in_force = tuple(_without_errors(e) for e in restitution.errors)
    tables = error_tables(in_force, TABLE_TOLERANCE_PX * pixel)
    ground = mean_ground(calibration)
    centres = places.from_local(orientation.centre)
    height = centres[:, 2] - ground
    sizes = [camera.size_px for camera in cameras]
    most = max(int(np.log2(max(min(s) for s in sizes) / 96.0)) + 1, 1)
    return Photographs(
        rows=rows, orientation=orientation, names=block.images.names[rows], restitution=restitution, tables=tables,
        source=restitution.group[rows],
        sensor=np.array([[s[0] / 2.0, s[1] / 2.0, 1.0 / c.pixel_mm] for s, c in zip(sizes, cameras, strict=True)]),
        places=places, ground=ground, gsd=height * [c.pixel_mm for c in cameras] / orientation.interior[:, 0],
        centres=centres, error_px=float(np.abs(tables.values).max(initial=0.0)) / pixel,
        store=PyramidStore(paths, sizes, most),
    )  # fmt: skip


def _without_errors(errors: PhotoErrors) -> PhotoErrors:
    """The same camera, its errors taken out of the photographs already."""
    f = errors.function
    return replace(errors, function=replace(f, linear=(), brown=np.zeros_like(f.brown), lens=np.zeros_like(f.lens)))


def site_at(photographs: Photographs, x: float, y: float) -> Site:
    """The photographs about a place of the CRS at the mean height of the ground."""
    place = np.array([x, y, photographs.ground])
    local, axes = photographs.places.axes_at(place)
    photos = photo_rows(photographs.orientation, local, axes)
    centres = np.linalg.solve(axes, (photographs.orientation.centre - local).T).T
    return Site(photographs, place, local, axes, np.ascontiguousarray(photos[None]), np.ascontiguousarray(centres))
