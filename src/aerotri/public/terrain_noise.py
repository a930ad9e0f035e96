"""The noise of the cells of a terrain model, from its ground points (pickets): σ of matching and interpolation.

The second band of dsm.tif and dtm.tif holds the part of the adjustment as well. It is the same for neighbours, and so
much larger at times that it cannot be taken off the band again: σ is made anew of what the pickets have each for
itself, in the way `aerotri dtm` made the surface.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerotri.conventions import InputError
from aerotri.formats.results.pickets import read_pickets
from aerotri.public.dense import DenseSurface
from aerotri.public.terrain import PICKETS, RECORD, TerrainModel
from aerotri.public.volume_sigma import MeasuredSurface
from aerotri.rasters.grids import Grid
from aerotri.terrain.compare import RasterHeights
from aerotri.terrain.settings import WIDEST_OBJECT_M
from aerotri.terrain.surface import Surface, surface_of

SURFACES = ("dsm.tif", "dtm.tif")
OBJECT_SIGMAS = 4.0
"""Of matching and interpolation, by which a ground point lies off the surface without objects where it is on one."""
FEWEST = 3
"""Pickets that make a surface."""
BESIDE = "give the folder that `aerotri dtm` wrote"


@dataclass(frozen=True, eq=False)
class PicketNoise:
    """What the pickets of a terrain model have each for itself.

    Parameters
    ----------
    xyz : (n, 3) m, of accepted ones. variance : (n,) m², of the heights, of matching. interval : m, between them.
    interpolation : m, RMS error of a place between them.
    """

    xyz: np.ndarray
    variance: np.ndarray
    interval: float
    interpolation: float

    def on_ground(self, ground: Surface) -> PicketNoise | None:
        """Without those on objects, which the surface without objects does not have."""
        height = RasterHeights(ground.grid, ground.z).at(self.xyz[:, :2], "linear")
        off = np.abs(self.xyz[:, 2] - height)
        own = off <= OBJECT_SIGMAS * np.sqrt(self.variance + self.interpolation**2)
        if own.sum() < FEWEST:
            return None
        return PicketNoise(self.xyz[own], self.variance[own], self.interval, self.interpolation)

    def sigma(self, grid: Grid) -> np.ndarray:
        """(rows, columns) m, of matching and interpolation; NaN where no pickets are around.

        Triangles may be as long as those that the surface without objects has under objects.
        """
        longest = max(self.interval, WIDEST_OBJECT_M)
        return surface_of(self.xyz, self.variance, longest, grid, (), self.interpolation).sigma


def noise_of_terrain(measured: MeasuredSurface) -> PicketNoise | None:
    """Of a terrain model in memory, or as `aerotri dtm` wrote it; None of another surface, or without its pickets.

    Raises
    ------
    InputError
        When dtm.json or pickets.parquet beside the surface cannot be read.
    """
    given = measured.given
    if isinstance(given, DenseSurface):
        return None
    if isinstance(given, TerrainModel):
        o = given.record
        own = o.pickets.accepted & np.isfinite(o.pickets.covariance[:, 2, 2])
        own &= o.ground if measured.layer == "dtm" else True
        return PicketNoise(o.pickets.xyz[own], o.pickets.covariance[own, 2, 2], o.interval, o.interpolation)
    path = measured.surface.path
    if path is None or path.name not in SURFACES:
        return None
    record, pickets = path.with_name(RECORD), path.with_name(PICKETS)
    if not (record.is_file() and pickets.is_file()):
        return None
    found = _of_files(record, pickets)
    return found.on_ground(measured.surface.heights) if found and path.name == "dtm.tif" else found


def _of_files(record: Path, pickets: Path) -> PicketNoise | None:
    try:
        content = json.loads(record.read_text(encoding="utf-8"))
        interval = float(content["interval_m"])
        interpolation = float(content["sigma_Z_m"]["interpolation"])
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise InputError("does not say how its surface was made", BESIDE, record) from error
    if not (0.0 < interval < np.inf and 0.0 <= interpolation < np.inf):
        raise InputError("states an interval or an error of interpolation that is not possible", BESIDE, record)
    table = read_pickets(pickets)
    own = table.accepted & np.isfinite(table.xyz).all(axis=1) & np.isfinite(table.sigma_matching[:, 2])
    if own.sum() < FEWEST:
        return None
    return PicketNoise(table.xyz[own], table.sigma_matching[own, 2] ** 2, interval, interpolation)
