"""Two surfaces of one place at two times: what changed, against its σ."""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from aerotri.conventions import FilePath, InputError, in_digits
from aerotri.crs_text import plan_of
from aerotri.public.argument_types import with_checked_types
from aerotri.public.change_areas import notes_of_areas, refuse_unknown_areas, with_whole_areas
from aerotri.public.change_doubts import doubts_of_stable_ground
from aerotri.public.change_epochs import (
    brought_to_metres,
    common_system,
    doubts_of,
    epoch_of,
    epochs_of,
    grid_of,
    names_of,
    pair_of,
)
from aerotri.public.folders import refuse_foreign_folder
from aerotri.public.places import place_in_words
from aerotri.public.projects import project_of
from aerotri.public.table import Table
from aerotri.public.used_arguments import used_arguments
from aerotri.results.head import Head
from aerotri.volume.change.alignment import ALIGNS, Align

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from shapely.geometry.base import BaseGeometry

    from aerotri.public.adjustment import Adjustment
    from aerotri.public.surfaces import SurfaceLike
    from aerotri.rasters.grids import Grid
    from aerotri.volume.boundary import Boundary
    from aerotri.volume.change.compute import Change

RECORD, RASTER, TABLE, PAGE = "change.json", "change.tif", "change.csv", "change.html"
OWN_NAMES = (RECORD, RASTER, TABLE, "plots", PAGE)
WHOLE = "all in common"


@dataclass(frozen=True, eq=False)
class ChangePlots:
    """Plots of a change, each a matplotlib Figure."""

    record: Change
    summary: dict[str, Any]
    areas: tuple[Boundary, ...]

    def difference(self) -> Figure:
        """Map of what changed beyond the level of detection."""
        from aerotri.report.plots.change import plot_change

        return plot_change(self.record, self.summary, self.areas)

    def difference_sigma(self) -> Figure:
        """Map of the σ of the difference."""
        from aerotri.report.plots.change import plot_change_sigma

        return plot_change_sigma(self.record, self.summary, self.areas)

    def all(self) -> dict[str, Figure]:
        """Every plot of the page by the name of its file."""
        return {"difference": self.difference(), "difference_sigma": self.difference_sigma()}


@dataclass(frozen=True, eq=False, repr=False)
class MeasuredChange:
    """What `aerotri.change` returns: difference, σ and significance of every cell, volumes gained and lost.

    Parameters
    ----------
    record : the numbers, as arrays. summary : content of change.json. areas : polygons of the volumes.
    head : of page and file.
    """

    record: Change
    summary: dict[str, Any]
    areas: tuple[Boundary, ...]
    head: Head = field(default_factory=Head)

    @property
    def difference(self) -> np.ndarray:
        """(rows, columns) m, second less first after the alignment; NaN where not known."""
        return self.record.difference

    @property
    def sigma(self) -> np.ndarray:
        """(rows, columns) m, σ of the difference."""
        return self.record.sigma

    @property
    def grid(self) -> Grid:
        """The cells."""
        return self.record.grid

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the user should read, in sentences."""
        return tuple(self.summary["warnings"])

    @cached_property
    def volumes(self) -> Table:
        """Volumes of every area with their σ: the columns of change.csv; m² and m³."""
        import pyarrow as pa

        rows = [{k: v for k, v in row.items() if not isinstance(v, dict)} for row in self.summary["volumes"]]
        columns: dict[str, Any] = {name: [row[name] for row in rows] for name in rows[0]}
        units = {name: "m³" if name.endswith("m3") else "m²" for name in columns if name != "name"}
        return Table("change", pa.table(columns), units)

    @property
    def plot(self) -> ChangePlots:
        """Plots, each a matplotlib Figure."""
        return ChangePlots(self.record, self.summary, self.areas)

    def save(self, out: FilePath, plots: bool = True) -> Path:
        """Write change.json, change.tif, change.csv, the plots and the page into a folder.

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
        target = Path(out)
        refuse_foreign_folder(target, RECORD)
        _write(target, self, plots)
        return target

    def __repr__(self) -> str:
        v = self.summary["volumes"][0]
        return f"<aerotri change: net {in_digits(v['net_m3'], 6)} ± {in_digits(v['sigma_net_m3'], 3)} m³>"

    def _repr_html_(self) -> str:
        return self.html()

    def html(self) -> str:
        """The volumes, as a notebook shows them."""
        return f"<div>{self.volumes.html()}</div>"


@with_checked_types
def change(
    first: SurfaceLike,
    second: SurfaceLike,
    *,
    stable: BaseGeometry | FilePath | None = None,
    align: Align = "shift",
    area: BaseGeometry | Mapping[str, BaseGeometry] | FilePath | None = None,
    noise_length: float | None = None,
    first_adjustment: Adjustment | FilePath | None = None,
    second_adjustment: Adjustment | FilePath | None = None,
    project: FilePath | None = None,
) -> MeasuredChange:
    """What changed between two surfaces, cell by cell against its σ, and the volumes gained and lost.

    Parameters
    ----------
    first : the earlier surface: GeoTIFF with σ as second band (its description begins with σ), folder of `dsm` or
        `dtm`, or what these returned; or a folder of `run`, whose dense surface (else its terrain) and adjustment are
        taken. A GeoTIFF in degrees or feet is brought to metres: to the system of the other one where that is in
        metres, else to the UTM zone of the first.
    second : the later surface.
    stable : ground that did not change: file of polygons as for `aerotri.volume`, WKT text, or a shapely polygon.
        The second surface is aligned on it, and it tells the noise.
    align : what the second surface is moved by on stable ground: 'none', 'height', 'shift' (X, Y and height) or 'tilt'
        (these and two tilts).
    area : where volumes are wanted: as `stable`, or polygons by their names; all that both have in common where
        None.
    noise_length : m, side of the square whose cells share one noise; what the surfaces say, or stable ground
        shows, where None.
    first_adjustment : what the first surface was measured with, a result or its folder. With both adjustments σ knows
        what bends a surface beyond the alignment, and what both have in common: one adjustment, control points,
        values of the camera.
    second_adjustment : of the second; the same one for two surfaces of one adjustment.
    project : block, or result of an adjustment, whose [project] stands at the head of page and file; that of the
        adjustments or of the surfaces where None.

    Returns
    -------
    MeasuredChange

    Raises
    ------
    InputError
        For surfaces that do not meet or have no σ, or too little stable ground.

    Examples
    --------
    >>> import aerotri, numpy as np
    >>> before = aerotri.Surface.of_array(
    ...     np.full((40, 40), 100.0), left=0.0, top=40.0, cell=1.0, sigma=np.full((40, 40), 0.02)
    ... )
    >>> z = before.z.copy()
    >>> z[10:20, 10:20] += 1.0
    >>> after = aerotri.Surface.of_array(z, left=0.0, top=40.0, cell=1.0, sigma=np.full((40, 40), 0.02))
    >>> found = aerotri.change(before, after, align="none")
    >>> f"{found.volumes['gained_m3'][0]:.0f} ± {found.volumes['sigma_gained_m3'][0]:.2f} m³"
    '100 ± 0.28 m³'
    """
    from aerotri.formats.results.change import change_json
    from aerotri.volume.change.compute import compute_change

    if align not in ALIGNS:
        raise InputError(f"an alignment by '{align}' is not known", f"choose one of {', '.join(ALIGNS)}")
    if noise_length is not None and not 0.0 <= noise_length < 1e6:
        raise InputError(f"a noise length of {noise_length:g} m is not possible", "give metres")
    with ExitStack() as stack:
        epochs, brought = brought_to_metres(epochs_of((first, second), (first_adjustment, second_adjustment)))
        crs, of_heights = common_system(epochs)
        grid = grid_of(epochs)
        same = epochs[0].key != "" and epochs[0].key == epochs[1].key
        (before, of_before), (after, of_after) = (epoch_of(one, grid, stack, noise_length, same) for one in epochs)
        notes = [*brought, *([of_heights] if of_heights else [])]
        notes += [text for text in (of_before, of_after) if text and stable is None]
        ground = None if stable is None else _boundary_of(stable, crs)
        areas = _areas(area, grid, crs)
        held = None if ground is None else ground.coverage(grid) > STABLE_PART
        _refuse_apart(ground, held, grid)
        if ground is None:
            if not all(np.isfinite(one.noise).any() for one in (before, after)):
                raise InputError("a surface has no σ", "give --stable, ground that did not change: it shows the noise")
            align = "none"
            if not same:
                notes.append("without stable ground the surfaces are compared as they lie")
        pair = pair_of(epochs, grid, (before.z, after.z), crs)
        if pair is not None:
            notes += [*doubts_of(epochs), pair.in_words()]
        elif same:
            notes.append("both surfaces come from one adjustment: its errors cancel")
        parts = [(name, boundary.coverage(grid)) for name, boundary in areas.items()]
        found = with_whole_areas(compute_change(grid, before, after, held, align, parts, pair), areas)
    refuse_unknown_areas(found, epochs, WHOLE)
    notes += notes_of_areas(found, WHOLE)
    if ground is not None and noise_length is None and found.alignment.sharing == 0.0:
        notes.append("too little stable ground to tell over what length neighbouring cells share noise: --noise-length")
    if ground is not None:
        notes += doubts_of_stable_ground(found.alignment, ground, {} if area is None else areas)
    if ground is not None and align == "none":
        notes.append("nothing was moved: a mean difference on stable ground is in the volumes and not in σ")
    by = dict(zip(found.alignment.names, found.alignment.values.tolist(), strict=True))
    if max(abs(by.get("dX", 0.0)), abs(by.get("dY", 0.0))) > FARTHEST * grid.cell_x:
        notes.append("the surfaces are shifted by more than a few cells: bring the second nearer and measure again")
    unsure = [f"{name} ± {sigma:.2g} m" for name, sigma in zip(found.alignment.names, found.moved_sigma, strict=True)
              if name in ("dX", "dY") and sigma > grid.cell_x]  # fmt: skip
    if unsure:
        notes.append(
            f"the stable ground is too level to tell a shift in plan ({', '.join(unsure)}): where both surfaces have "
            "good positions, --align height moves the second in height alone, which lowers the level of detection on "
            "slopes"
        )
    summary = change_json(found, names_of(epochs), crs, "" if ground is None else ground.name, align, tuple(notes))
    head = Head(project_of(project, second_adjustment, second, first_adjustment, first), crs)
    asked = {"stable": stable, "align": align, "area": area, "noise_length": noise_length}
    summary["settings"] = used_arguments(change, asked, {"noise_length": "m"})
    return MeasuredChange(found, head.as_dict() | summary, tuple(areas.values()), head)


FARTHEST = 3.0
"""Cells of shift up to which slopes tell its effect."""
STABLE_PART = 0.999
"""Share of a cell that must be stable."""


def _refuse_apart(ground: Boundary | None, held: np.ndarray | None, grid: Grid) -> None:
    """Refuse stable ground that has no cell of both surfaces.

    Raises
    ------
    InputError
    """
    if ground is not None and held is not None and not held.any():
        raise InputError(
            f"the stable ground '{ground.name}' holds no cell that both surfaces have: it lies at "
            f"{place_in_words(ground.polygon.bounds)}, they at {place_in_words(grid.bounds)}",
            "draw it inside both surfaces, in their CRS",
        )


def _boundary_of(stated: BaseGeometry | FilePath, crs: str) -> Boundary:
    from aerotri.volume.boundary import boundary_of_parts, read_boundary

    if isinstance(stated, str | os.PathLike):
        return read_boundary(os.fspath(stated), plan_of(crs))
    return boundary_of_parts(stated, "the polygon given")


def _areas(
    stated: BaseGeometry | Mapping[str, BaseGeometry] | FilePath | None, grid: Grid, crs: str
) -> dict[str, Boundary]:
    """The polygons of volumes by their names; more than one and all together."""
    import shapely

    from aerotri.volume.boundary import boundary_of, boundary_of_piles

    if stated is None:
        return {WHOLE: boundary_of(shapely.box(*grid.bounds), WHOLE)}
    if isinstance(stated, Mapping):
        if not stated:
            raise InputError("no polygon is given", "give a polygon for every name")
        whole = boundary_of_piles([(str(name), polygon) for name, polygon in stated.items()], "the polygons given")
    else:
        whole = _boundary_of(stated, crs)
    each = {name: boundary_of(polygon, name) for name, polygon in whole.piles}
    return {**each, "all together": whole} if each else {whole.name: whole}


def _write(target: Path, found: MeasuredChange, plots: bool) -> None:
    from aerotri.formats.files.atomic import atomic_folder
    from aerotri.formats.results.json_text import write_json
    from aerotri.public.tables import write_rows
    from aerotri.rasters.surface_files import write_bands

    c = found.record
    bands = {"difference second − first, m": c.difference, "σ of the difference, m": c.sigma,
             "difference over σ": c.significance}  # fmt: skip
    with atomic_folder(target, own=OWN_NAMES) as folder:
        # differences are no heights: their raster has the system of the plan alone
        write_bands(folder / RASTER, bands, c.grid, plan_of(found.summary["crs"]) or None)
        write_rows(found.volumes, folder / TABLE)
        if plots:
            from aerotri.report.documents.picture_texts import save_translated
            from aerotri.report.pages.change import write_change_page
            from aerotri.report.plots.rendering import save_plots

            for name in ("difference", "difference_sigma"):
                save_translated(name, getattr(found.plot, name), folder / "plots")
            write_change_page(found.summary, save_plots(found.plot.all(), folder / "plots"), folder / PAGE, found.head)
        write_json(folder / RECORD, found.summary)
