"""Two point clouds of one place at two times: distances along the normals of the first, each against its σ."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.public.argument_types import with_checked_types
from aerotri.public.change_epochs import system_of_both
from aerotri.public.cloud_epochs import (
    by_adjustments,
    check_sizes,
    default_width,
    known_alike,
    labels_of,
    opened,
    within,
)
from aerotri.public.folders import refuse_foreign_folder
from aerotri.public.projects import project_of
from aerotri.public.table import Table
from aerotri.public.used_arguments import used_arguments
from aerotri.results.head import Head

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from shapely.geometry.base import BaseGeometry

    from aerotri.public.adjustment import Adjustment
    from aerotri.volume.change.clouds import CloudDistances

RECORD, TABLE, PAGE = "cloud_change.json", "distances.parquet", "change.html"
OWN_NAMES = (RECORD, TABLE, "plots", PAGE)
NORMAL_TIMES, REACH_TIMES = 2.0, 5.0
"""Default diameter of the ball of a normal, and default reach, in cylinders [C]."""


@dataclass(frozen=True, eq=False)
class CloudChangePlots:
    """Plots of distances, each a matplotlib Figure."""

    record: CloudDistances
    summary: dict[str, Any]

    def distances(self) -> Figure:
        """Map of the distances beyond the level of detection."""
        from aerotri.report.plots.cloud_change import plot_distances

        return plot_distances(self.record, self.summary)

    def distances_sigma(self) -> Figure:
        """Map of the σ of the distances."""
        from aerotri.report.plots.cloud_change import plot_distances_sigma

        return plot_distances_sigma(self.record, self.summary)

    def histogram(self) -> Figure:
        """Histogram of the distances, those beyond the level of detection apart."""
        from aerotri.report.plots.cloud_change import plot_histogram

        return plot_histogram(self.record, self.summary)

    def all(self) -> dict[str, Figure]:
        """Every plot by the name of its file."""
        return {
            "distances": self.distances(), "distances_sigma": self.distances_sigma(), "histogram": self.histogram()
        }  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class MeasuredCloudChange:
    """What `aerotri.cloud_change` returns: distance, σ and level of detection at every core point.

    Parameters
    ----------
    record : the numbers, as arrays. summary : content of cloud_change.json. head : of page and file.
    """

    record: CloudDistances
    summary: dict[str, Any]
    head: Head = field(default_factory=Head)

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
        """Write cloud_change.json, distances.parquet, the plots and the page into a folder.

        Parameters
        ----------
        out : folder; an older result there is replaced in one step. plots : draw the plots and the page.

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
                from aerotri.report.documents.picture_texts import save_translated
                from aerotri.report.pages.cloud_change import write_cloud_change_page
                from aerotri.report.plots.rendering import save_plots

                for name in ("distances", "distances_sigma", "histogram"):
                    save_translated(name, getattr(self.plot, name), folder / "plots")
                drawn = save_plots(self.plot.all(), folder / "plots")
                write_cloud_change_page(self.summary, drawn, folder / PAGE, self.head)
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
    first_adjustment: Adjustment | FilePath | None = None,
    second_adjustment: Adjustment | FilePath | None = None,
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
    first_adjustment : what the first cloud was measured with, a result or its folder. With both adjustments σ has
        what their errors leave in a distance, and what both have in common (control points, values of the camera, or
        all of it where they are one adjustment) cancels.
    second_adjustment : of the second; the same one for two clouds of one adjustment.
    project : block, or result of an adjustment, whose [project] stands at the head of page and file; that of the
        adjustments or of the folders of the clouds where None.

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
    from aerotri.formats.results.cloud_change import CloudSettings, cloud_change_json
    from aerotri.volume.change.clouds import Scales, cloud_distances, core_points, registration_of

    asked = {
        "cylinder": cylinder, "normal": normal, "reach": reach, "spacing": spacing, "stable": stable,
        "registration": registration,
    }  # fmt: skip
    epochs = opened(first), opened(second)
    names = labels_of(*epochs, (first, second))
    crs, of_heights = system_of_both([one.crs for one in epochs], names)
    before, after, unlike = known_alike(epochs[0].cloud, epochs[1].cloud)
    width = default_width(before.xyz) if cylinder is None else cylinder
    scales = Scales(
        width, NORMAL_TIMES * width if normal is None else normal, REACH_TIMES * width if reach is None else reach
    )
    between = width if spacing is None else spacing
    check_sizes((("cylinder", width), ("normal", scales.normal), ("reach", scales.reach), ("spacing", between)))
    if registration is not None and not 0.0 <= registration < 1e6:
        raise InputError(f"a registration of {registration:g} m is not possible", "give metres")
    core = before.xyz[core_points(before.xyz, between)]
    found = cloud_distances(before, after, core, scales)
    if not np.isfinite(found.distance).any():
        raise InputError("the two clouds do not meet", "check the CRS of both, or give a larger --cylinder and --reach")
    stated = (first_adjustment, second_adjustment)
    found, adjusted, said, is_known = by_adjustments(found, epochs, (before, after), stated, crs)
    notes = [text for text in (*(one.note for one in epochs), of_heights, unlike, *said) if text]
    held = None if stable is None else within(stable, crs, core)
    on_stable = None if held is None else registration_of(found, held)
    if on_stable is not None and not np.isfinite(on_stable[1]):
        raise InputError("no place with a distance lies on the stable ground", "give other ground, or check its CRS")
    used = registration if registration is not None else on_stable[1] if on_stable is not None else 0.0
    if registration is None and held is None and not is_known:
        notes.append("nothing is known of how the clouds lie to one another: give --stable or --registration")
    sources = (one for one in (second_adjustment, second, first_adjustment, first) if not isinstance(one, np.ndarray))
    head = Head(project_of(project, *sources), crs)
    settings = CloudSettings(scales, between, used, held, np.nan if on_stable is None else on_stable[0])
    origin = "adjustments" if adjusted is not None else "points" if before.covariance is not None else "scatter"
    summary = head.as_dict() | {"first": names[0], "second": names[1]}
    summary |= cloud_change_json(found, (before, after), adjusted, settings, origin)
    of_arguments = used_arguments(cloud_change, asked, dict.fromkeys(asked.keys() - {"stable"}, "m"))
    summary |= {"warnings": notes, "settings": of_arguments}
    return MeasuredCloudChange(found, summary, head)
