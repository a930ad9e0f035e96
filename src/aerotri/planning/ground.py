"""The ground of a plan: a DEM, or a level."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerotri.conventions import InputError
from aerotri.crs_text import same_system, system_in_words
from aerotri.planning.area import Area

MOST_NODES = 600
"""Nodes of the ground along its longer side [C]: a footprint then has tens of them."""


@dataclass(frozen=True, eq=False)
class Ground:
    """Heights at the nodes of a grid, bilinear between them; beyond it as at its border.

    Parameters
    ----------
    z : (rows, columns) m, rows northwards. left, bottom : m of the first node. step : m. name : where it comes from.
    """

    z: np.ndarray
    left: float
    bottom: float
    step: float
    name: str

    def heights(self, xy: np.ndarray) -> np.ndarray:
        """(n,) m at (n, 2) m."""
        rows, columns = self.z.shape
        u = np.clip((xy[:, 0] - self.left) / self.step, 0.0, columns - 1.0)
        v = np.clip((xy[:, 1] - self.bottom) / self.step, 0.0, rows - 1.0)
        i, j = np.minimum(v.astype(int), max(rows - 2, 0)), np.minimum(u.astype(int), max(columns - 2, 0))
        s, t = u - j, v - i
        i2, j2 = np.minimum(i + 1, rows - 1), np.minimum(j + 1, columns - 1)
        low = (1.0 - s) * self.z[i, j] + s * self.z[i, j2]
        high = (1.0 - s) * self.z[i2, j] + s * self.z[i2, j2]
        return (1.0 - t) * low + t * high

    def on(self, xy: np.ndarray) -> np.ndarray:
        """(n, 3) m."""
        return np.column_stack([xy, self.heights(xy)])


def level_ground(height: float) -> Ground:
    """A plane."""
    if not np.isfinite(height):
        raise InputError(f"the ground height {height} is not possible", "give metres")
    return Ground(np.full((1, 1), float(height)), 0.0, 0.0, 1.0, f"level ground at {height:g} m")


def ground_of_dem(path: Path, area: Area, reach: float) -> Ground:
    """Heights of a DEM around an area.

    Parameters
    ----------
    reach : m beyond the area that photographs look; outside the DEM the nearest height stands there.

    Raises
    ------
    InputError
        When the DEM cannot be read, has another CRS than the area, or does not cover it.
    """
    from aerotri.rasters.metric import MetricReader

    left, bottom, right, top = area.polygon.buffer(reach).bounds
    with MetricReader(path, target=area.crs) as reader:
        if area.crs is not None and reader.plan and not same_system(reader.plan, area.crs):
            message = f"is in {system_in_words(reader.plan)}, the plan in {system_in_words(area.crs)}"
            has_code = reader.plan.upper().startswith("EPSG:")
            raise InputError(message, f"give --crs {reader.plan}" if has_code else "bring the DEM into that CRS", path)
        step = max(reader.grid.cell_x, max(right - left, top - bottom) / MOST_NODES)
        x, y = np.arange(left, right + step, step), np.arange(bottom, top + step, step)
        shape = len(y), len(x)
        z = reader.sample(*(values.ravel() for values in np.meshgrid(x, y))).reshape(shape)
        cells = area.cells(2000)
        missing = ~np.isfinite(reader.sample(cells[:, 0], cells[:, 1]))
    if missing.any():
        share = 100.0 * missing.mean()
        raise InputError(
            f"does not cover the area: {share:.2g} % of it have no height", "give a DEM of the whole area", path
        )
    return Ground(_filled(z), left, bottom, step, path.name)


def crs_of_dem(path: Path) -> str | None:
    """'EPSG:n' of the metres that a DEM counts in; None where it does not say."""
    from aerotri.rasters.metric import MetricReader

    with MetricReader(path) as reader:
        return reader.plan or None


def _filled(z: np.ndarray) -> np.ndarray:
    from scipy.ndimage import distance_transform_edt

    missing = ~np.isfinite(z)
    if not missing.any():
        return z
    nearest = distance_transform_edt(missing, return_distances=False, return_indices=True)
    return z[tuple(np.asarray(nearest))]
