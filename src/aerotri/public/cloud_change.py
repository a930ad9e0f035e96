"""Two point clouds of one place at two times: distances along the normals of the first, each against its σ."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.public.argument_types import with_checked_types
from aerotri.public.change_epochs import plan_code, system_of_both
from aerotri.public.folders import refuse_foreign_folder
from aerotri.public.projects import project_of
from aerotri.public.table import Table
from aerotri.public.used_arguments import used_arguments
from aerotri.results.head import Head

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from shapely.geometry.base import BaseGeometry

    from aerotri.volume.change.clouds import CloudDistances

RECORD, TABLE = "cloud_change.json", "distances.parquet"
OWN_NAMES = (RECORD, TABLE, "plots")
CLOUDS = (".las", ".laz")
POINTS_IN_CYLINDER = 30.0
"""Points that a cylinder of the default diameter holds [L: Lague et al. 2013 ask for 20 and more]."""
NORMAL_TIMES, REACH_TIMES = 2.0, 5.0
"""Default diameter of the ball of a normal, and default reach, in cylinders [C]."""
BYTES_OF_POINT = 250
"""Coordinates, covariance and the tree."""


@dataclass(frozen=True, eq=False)
class CloudChangePlots:
    """Plots of distances, each a matplotlib Figure."""

    record: CloudDistances
    summary: dict[str, Any]

    def distances(self) -> Figure:
        """Map of the distances beyond the level of detection, and of σ."""
        from aerotri.report.plots.cloud_change import plot_distances

        return plot_distances(self.record, self.summary)

    def all(self) -> dict[str, Figure]:
        """Every plot by the name of its file."""
        return {"distances": self.distances()}


@dataclass(frozen=True, eq=False, repr=False)
class MeasuredCloudChange:
    """What `aerotri.cloud_change` returns: distance, σ and level of detection at every core point.

    Parameters
    ----------
    record : the numbers, as arrays. summary : content of cloud_change.json.
    """

    record: CloudDistances
    summary: dict[str, Any]

    @cached_property
    def distances(self) -> Table:
        """A row a core point: place, normal, distance, σ, level of detection, whether beyond it, points used."""
        import pyarrow as pa

        r = self.record
        level = r.level(self.summary["registration_m"])
        columns: dict[str, Any] = dict(zip(("X", "Y", "Z"), r.core.T, strict=True))
        columns |= dict(zip(("normal_X", "normal_Y", "normal_Z"), r.normal.T, strict=True))
        columns |= {
            "distance": r.distance, "sigma": r.sigma, "level_of_detection": level,
            "beyond": np.abs(r.distance) > level, "points_first": r.count[:, 0], "points_second": r.count[:, 1],
        }  # fmt: skip
        lengths = ("X", "Y", "Z", "distance", "sigma", "level_of_detection")
        return Table("distances", pa.table(columns), dict.fromkeys(lengths, "m"))

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the user should read, in sentences."""
        return tuple(self.summary["warnings"])

    @property
    def plot(self) -> CloudChangePlots:
        """Plots, each a matplotlib Figure."""
        return CloudChangePlots(self.record, self.summary)

    def save(self, out: FilePath, plots: bool = True) -> Path:
        """Write cloud_change.json, distances.parquet and the plots into a folder.

        Parameters
        ----------
        out : folder; an older result there is replaced in one step. plots : draw the map.

        Returns
        -------
        Path of the folder.

        Raises
        ------
        InputError
            When the folder holds other files, or cannot be written to.
        """
        import pyarrow.parquet as pq

        from aerotri.formats.files.atomic import atomic_folder
        from aerotri.formats.results.json_text import write_json

        target = Path(out)
        refuse_foreign_folder(target, RECORD)
        with atomic_folder(target, own=OWN_NAMES) as folder:
            pq.write_table(self.distances.to_arrow(), folder / TABLE, compression="zstd")
            if plots:
                from aerotri.report.plots.rendering import save_plots

                save_plots(self.plot.all(), folder / "plots")
            write_json(folder / RECORD, self.summary)
        return target

    def __repr__(self) -> str:
        s = self.summary
        return f"<aerotri cloud change: {s['core_points']} places, {s['beyond_level_percent']:.1f} % changed>"

    def _repr_html_(self) -> str:
        return self.html()

    def html(self) -> str:
        """The first distances, as a notebook shows them."""
        return f"<div>{self.distances.html()}</div>"


@with_checked_types
def cloud_change(
    first: FilePath | np.ndarray,
    second: FilePath | np.ndarray,
    *,
    cylinder: float | None = None,
    normal: float | None = None,
    reach: float | None = None,
    spacing: float | None = None,
    stable: BaseGeometry | FilePath | None = None,
    registration: float | None = None,
    project: FilePath | None = None,
) -> MeasuredCloudChange:
    """Distances from a point cloud to a later one along its normals (M3C2), each with σ and level of detection.

    Parameters
    ----------
    first : the earlier cloud: LAS or LAZ, or an array (n, 3), m. With σ and covariances of its points, as `dsm` writes
        them, these give the σ of a distance; else the scatter of the points does.
    second : the later cloud.
    cylinder : m, diameter of the cylinder whose points are averaged; from the density of the first cloud where None.
    normal : m, diameter of the ball whose points give a normal; twice that of the cylinder where None.
    reach : m, largest distance that is sought; five diameters of the cylinder where None.
    spacing : m, of the places where distances are wanted; the diameter of the cylinder where None.
    stable : ground that did not change, as in `aerotri.change`. It tells the registration.
    registration : m, error of the position of one cloud to the other, 1 σ; from stable ground, else 0, where None.
    project : block, or result of an adjustment, whose [project] stands at the head of the file; that of the folders of
        the clouds where None.

    Returns
    -------
    MeasuredCloudChange

    Raises
    ------
    InputError
        For clouds that cannot be read, are in two systems, do not meet, or sizes that make no sense.

    Notes
    -----
    Lague, Brodu and Leroux (2013), ISPRS J. 82; with σ of the points James, Robson and Smith (2017), Earth Surf.
    Process. Landf. 42.

    Examples
    --------
    >>> import aerotri, numpy as np
    >>> rng = np.random.default_rng(1)
    >>> before = np.column_stack([rng.uniform(0, 10, (4000, 2)), rng.normal(0, 0.02, 4000)])
    >>> after = np.column_stack([rng.uniform(0, 10, (4000, 2)), rng.normal(0.3, 0.02, 4000)])
    >>> found = aerotri.cloud_change(before, after)
    >>> f"{np.nanmedian(found.distances['distance']):.2f} m"
    '0.30 m'
    """
    from aerotri.volume.change.clouds import Cloud, Scales, cloud_distances, core_points, registration_of

    asked = {
        "cylinder": cylinder, "normal": normal, "reach": reach, "spacing": spacing, "stable": stable,
        "registration": registration,
    }  # fmt: skip
    (before, of_before), (after, of_after) = (_opened(one) for one in (first, second))
    crs, of_heights = system_of_both((of_before, of_after), (_label(first), _label(second)))
    width = _default_width(before.xyz) if cylinder is None else cylinder
    scales = Scales(
        width, NORMAL_TIMES * width if normal is None else normal, REACH_TIMES * width if reach is None else reach
    )
    between = width if spacing is None else spacing
    _check((("cylinder", width), ("normal", scales.normal), ("reach", scales.reach), ("spacing", between)))
    if registration is not None and not 0.0 <= registration < 1e6:
        raise InputError(f"a registration of {registration:g} m is not possible", "give metres")
    notes = [of_heights] if of_heights else []
    if (before.covariance is None) != (after.covariance is None):
        notes.append("one of the clouds has no σ of its points: the scatter of the points is taken for both")
        before, after = Cloud(before.xyz, None), Cloud(after.xyz, None)
    core = before.xyz[core_points(before.xyz, between)]
    found = cloud_distances(before, after, core, scales)
    if not np.isfinite(found.distance).any():
        raise InputError("the two clouds do not meet", "check the CRS of both, or give a larger --cylinder and --reach")
    held = None if stable is None else _within(stable, plan_code(crs), core)
    shift, excess = (np.nan, np.nan) if held is None else registration_of(found, held)
    if held is not None and not np.isfinite(excess):
        raise InputError("no place with a distance lies on the stable ground", "give other ground, or check its CRS")
    used = registration if registration is not None else excess if held is not None else 0.0
    if registration is None and held is None:
        notes.append("nothing is known of how the clouds lie to one another: give --stable or --registration")
    beyond = np.abs(found.distance) > found.level(used)
    known = np.isfinite(found.distance)
    head = Head(project_of(project, *(one for one in (second, first) if not isinstance(one, np.ndarray))), crs)
    summary = head.as_dict() | {
        "first": _label(first), "second": _label(second), "cylinder_m": scales.cylinder, "normal_m": scales.normal,
        "reach_m": scales.reach, "spacing_m": between, "points_first": len(before.xyz),
        "points_second": len(after.xyz), "core_points": len(core), "with_distance": int(known.sum()),
        "sigma_from": "points" if before.covariance is not None else "scatter", "registration_m": float(used),
        "stable": None if held is None else {"core_points": int((held & known).sum()), "mean_m": shift},
        "sigma_m": float(np.nanmedian(found.sigma)), "level_of_detection_m": float(np.nanmedian(found.level(used))),
        "beyond_level_percent": 100.0 * float(beyond[known].mean()), "warnings": notes,
        "settings": used_arguments(cloud_change, asked, dict.fromkeys(asked.keys() - {"stable"}, "m")),
    }  # fmt: skip
    return MeasuredCloudChange(found, summary)


def is_cloud(path: Any) -> bool:
    """Whether a path is that of a point cloud."""
    return isinstance(path, str | os.PathLike) and Path(path).suffix.lower() in CLOUDS


def _opened(given: FilePath | np.ndarray) -> tuple[Any, str]:
    from aerotri.formats.results.point_cloud import read_precise_cloud
    from aerotri.memory import refuse_beyond_memory
    from aerotri.volume.change.clouds import FEWEST, Cloud

    if isinstance(given, np.ndarray):
        xyz, covariance, crs = np.asarray(given, dtype=float), None, ""
        if xyz.ndim != 2 or xyz.shape[1] != 3 or not np.isfinite(xyz).all():
            raise InputError("a cloud is no array (n, 3) of numbers", "give X, Y, Z of every point")
    else:
        if not is_cloud(given):
            raise InputError("is no point cloud", "give a LAS or LAZ file", Path(given))
        xyz, covariance, crs = read_precise_cloud(Path(given))
    if len(xyz) < FEWEST:
        raise InputError(f"{_label(given)} has {len(xyz)} points", "give a cloud of more points")
    refuse_beyond_memory(float(BYTES_OF_POINT) * len(xyz), f"{len(xyz)} points", "cut out the part that is needed")
    return Cloud(xyz, covariance), crs


def _default_width(xyz: np.ndarray) -> float:
    """m, diameter of a cylinder that holds some 30 points on level ground of median density."""
    size = float(np.ptp(xyz[:, :2], axis=0).max()) / max(np.sqrt(len(xyz)) / 10.0, 1.0)
    if not size > 0.0:
        raise InputError("all points of a cloud have one place", "give a cloud of an area")
    _, count = np.unique(np.floor(xyz[:, :2] / size), axis=0, return_counts=True)
    density = float(np.median(count)) / size**2
    return float(f"{2.0 * np.sqrt(POINTS_IN_CYLINDER / (np.pi * density)):.2g}")


def _check(sizes: Sequence[tuple[str, float]]) -> None:
    for name, value in sizes:
        if not 0.0 < value < 1e6:
            raise InputError(f"{name} {value:g} m is not possible", "give metres above 0")


def _within(stable: BaseGeometry | FilePath, epsg: int | None, core: np.ndarray) -> np.ndarray:
    import shapely

    from aerotri.volume.boundary import read_boundary

    polygon = read_boundary(os.fspath(stable), epsg).polygon if isinstance(stable, str | os.PathLike) else stable
    return shapely.contains_xy(polygon, core[:, 0], core[:, 1])


def _label(given: FilePath | np.ndarray) -> str:
    return "array" if isinstance(given, np.ndarray) else Path(given).name
