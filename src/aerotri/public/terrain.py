"""The ground by image matching: points with σ (pickets), and the surfaces through them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from aerotri.conventions import FilePath, InputError, counted
from aerotri.crs_text import plan_of
from aerotri.execution.choice import THREADS, chosen
from aerotri.public.adjustment import Adjustment
from aerotri.public.argument_types import with_checked_types
from aerotri.public.folders import paths_of, refuse_foreign_folder
from aerotri.public.missing_photographs import missing_in_words, missing_photographs
from aerotri.public.progress import ProgressLike, stage_report
from aerotri.public.results import open_result
from aerotri.public.surfaces import Surface, dataset_of
from aerotri.public.table import Table
from aerotri.public.used_arguments import used_settings
from aerotri.results.head import Head
from aerotri.terrain.settings import DEFAULTS, Subset, TerrainSettings

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from shapely.geometry.base import BaseGeometry

    from aerotri.results.adjustment import Adjustment as Record
    from aerotri.terrain.dtm import TerrainOutcome, TerrainPlan
    from aerotri.volume.boundary import Boundary

RECORD = "dtm.json"
PICKETS = "pickets.parquet"
OWN_NAMES = (RECORD, PICKETS, "pickets.laz", "dsm.tif", "dtm.tif", "model.tif", "models.csv", "plots")
ENDINGS = (".tif", ".tiff", ".jpg", ".jpeg")
METRES = ("node_X", "node_Y", "X", "Y", "Z", "sX", "sY", "sZ", "sX_matching", "sY_matching", "sZ_matching")


@dataclass(frozen=True, eq=False)
class TerrainPlots:
    """Plots of a terrain model, each a matplotlib Figure.

    Parameters
    ----------
    record : what was measured. block : name of the block.
    """

    record: TerrainOutcome
    block: str

    def surface(self) -> Figure:
        """The surface with objects, lit from the north-west."""
        from aerotri.report.plots.terrain import plot_surface

        return plot_surface(self.record, self.block)

    def sigma(self) -> Figure:
        """The σ of its cells."""
        from aerotri.report.plots.terrain import plot_surface_sigma

        return plot_surface_sigma(self.record, self.block)

    def pickets(self) -> Figure:
        """Where pickets are: accepted, moved to a place nearby, in error, and the nodes that stayed holes."""
        from aerotri.report.plots.terrain import plot_pickets

        return plot_pickets(self.record, self.block)

    def all(self) -> dict[str, Figure]:
        """Every plot by the name of its file."""
        return {"surface": self.surface(), "sigma": self.sigma(), "pickets": self.pickets()}


@dataclass(frozen=True, eq=False, repr=False)
class TerrainModel:
    """What `aerotri.terrain` measured: pickets, and the surfaces with and without objects.

    Parameters
    ----------
    record : the numbers as arrays.
    block : name of the block. crs : its coordinate system.
    adjustment : key of the adjustment it was measured with.
    notes : what was done with the input before and what σ lacks, in sentences.
    ground_within : name of the outline within which all is ground; '' where there is none.
    head : of files. settings : every argument that was used, as dtm.json has them.
    missing : photographs of the block that were not given.
    """

    record: TerrainOutcome
    block: str
    crs: str
    adjustment: str
    notes: tuple[str, ...] = ()
    ground_within: str = ""
    head: Head = field(default_factory=Head)
    settings: list[dict[str, Any]] = field(default_factory=list)
    missing: tuple[str, ...] = ()

    @cached_property
    def dsm(self) -> Surface:
        """The surface with objects."""
        return Surface(self.record.dsm, self._crs_of_rasters, "dsm.tif")

    @cached_property
    def dtm(self) -> Surface:
        """The surface without objects."""
        return Surface(self.record.dtm, self._crs_of_rasters, "dtm.tif")

    @cached_property
    def pickets(self) -> Table:
        """The points measured, a row a node whatever became of it: the columns of pickets.parquet; m."""
        from aerotri.formats.results.pickets import picket_columns

        columns = picket_columns(self.record.pickets, self.record.adjustment)
        return Table("pickets", columns, dict.fromkeys(METRES, "m"), ("X", "Y", "Z"), self.crs)

    @cached_property
    def models(self) -> Table:
        """The pairs that measured pickets, a row a stereo model: the columns of models.csv.

        Raises
        ------
        InputError
            When the pickets were measured in all photographs, not in pairs.
        """
        import pyarrow as pa

        if self.record.models is None:
            raise InputError("the pickets were not measured in pairs", "measure with pairs=True")
        pairs = self.record.pickets.names[self.record.models.pairs].astype(str)
        columns = {"number": np.arange(len(pairs)), "left": pairs[:, 0].tolist(), "right": pairs[:, 1].tolist()}
        return Table("stereo models", pa.table(columns))

    @cached_property
    def summary(self) -> dict[str, Any]:
        """The content of dtm.json: interval, counts of pickets, σ."""
        from aerotri.formats.results.terrain import terrain_json

        stated = {
            "photographs_missing": list(self.missing), "adjustment": self.adjustment,
            "ground_within": self.ground_within, "settings": self.settings, "notes": list(self.notes),
        }  # fmt: skip
        return self.head.as_dict() | terrain_json(self.record, self.block, self.crs) | stated

    @property
    def plot(self) -> TerrainPlots:
        """Plots of surface and pickets, each a matplotlib Figure."""
        return TerrainPlots(self.record, self.block)

    def to_xarray(self) -> Any:
        """An `xarray.Dataset` with Z_dsm, Z_dtm and their σ, m, over y and x.

        Raises
        ------
        InputError
            When xarray is not installed.
        """
        return dataset_of({"dsm": self.dsm, "dtm": self.dtm}, self._crs_of_rasters)

    def save(self, out: FilePath, plots: bool = True) -> Path:
        """Write pickets, surfaces, dtm.json and the plots into a folder.

        Parameters
        ----------
        out : folder; an older result there is replaced in one step. plots : draw surface and pickets.

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

    @property
    def _crs_of_rasters(self) -> str | None:
        from aerotri.rasters.grids import crs_of_heights

        return crs_of_heights(self.crs)

    def __repr__(self) -> str:
        p = self.summary["pickets"]
        return f"<aerotri terrain model of {self.block!r}: {p['accepted']} of {p['seen']} pickets accepted>"

    def _repr_html_(self) -> str:
        return self.html()

    def html(self) -> str:
        """Pickets and σ, as a notebook shows them."""
        s = self.summary
        p, sigma = s["pickets"], s["sigma_Z_m"]
        return (
            f"<div><b>{escape(self.block)}</b>: {p['accepted']} of {p['seen']} pickets accepted, every "
            f"{s['interval_m']:g} m, σ of Z {sigma['median']:.3f} m (median){self.dsm.html()}</div>"
        )


@with_checked_types
def terrain(
    result: Adjustment | FilePath,
    photographs: FilePath | Sequence[FilePath],
    *,
    interval: float | None = DEFAULTS.interval,
    cell: float | None = DEFAULTS.cell,
    pairs: bool = DEFAULTS.pairs,
    step: int | None = DEFAULTS.step,
    subset: Subset = DEFAULTS.subset,
    area: tuple[float, float, float, float] | None = DEFAULTS.area,
    window: int = DEFAULTS.window,
    threshold: float = DEFAULTS.threshold,
    agreeing: float = DEFAULTS.agreeing,
    edge: float | None = DEFAULTS.edge,
    most_photographs: int = DEFAULTS.most_photographs,
    breaklines: FilePath | None = DEFAULTS.breaklines,
    ground_within: BaseGeometry | FilePath | None = DEFAULTS.ground_within,
    ideal: bool = DEFAULTS.ideal,
    executor: str = THREADS,
    scratch: FilePath | None = None,
    progress: ProgressLike = None,
) -> TerrainModel:
    """Measure the ground by image matching, with σ, and lay surfaces through it with and without objects.

    Parameters
    ----------
    result : an adjustment, or the folder of one.
    photographs : folder or files of the photographs, TIFF or JPEG.
    interval : m between the points measured (pickets); from the GSD and the relief where None.
    cell : m, of the rasters; half the interval where None.
    pairs : measure every picket in its best pair, as `aerotri.correct_dem` wants it, not in all photographs.
    step : with pairs: a photograph and the step-th after it in its strip; nearest to 60 % end lap where None.
    subset : all photographs, or the even or odd ones of every strip.
    area : m, X and Y of the lower left, then of the upper right corner; as far as photographs reach where None.
    window : pixels a side of the windows that are matched, odd.
    threshold : correlation from which a match counts, 0 … 1.
    agreeing : the same of three photographs and more whose rays meet; 1: never.
    edge : share of the format at its edge that is not used; 0.02, of pairs 0.10, where None.
    most_photographs : of a picket.
    breaklines : file of lines with heights: .gpkg, .geojson, .shp, .fgb or .dxf.
    ground_within : outline within which everything is ground, as `aerotri.volume` takes its boundary: a stockpile is
        steep and would be taken off the DTM as an object.
    ideal : the photographs are those of `aerotri.ideal_photographs`, free of image errors.
    executor : where the points are measured: 'threads', 'processes:N', 'dask:ADDRESS' or 'dask:local:N'.
    scratch : folder for what other processes need, as long as they work; the temporary one of the system where None.
        Workers on other machines have to see it.
    progress : as of `aerotri.adjust`.

    Returns
    -------
    TerrainModel
        Its `dsm` and `dtm` are surfaces, its `pickets` a table.

    Raises
    ------
    InputError
        For a setting that makes no sense, photographs that are not found, or where hardly anything could be matched.
    TasksFailedError
        When tiles could not be measured; it names them.

    Examples
    --------
    >>> import aerotri
    >>> surface = aerotri.terrain("saar_result", "photographs", interval=5.0)  # doctest: +SKIP
    >>> surface.save("saar_dtm")  # doctest: +SKIP
    """
    lines = None if breaklines is None else Path(breaklines)
    settings = TerrainSettings(
        interval,
        cell,
        pairs,
        step,
        subset,
        area,
        window,
        threshold,
        agreeing,
        edge,
        most_photographs,
        lines,
        ground_within,
        ideal,
    )
    return measure_terrain(result, paths_of(photographs), settings, progress, executor, scratch)


def measure_terrain(
    result: Adjustment | FilePath, photographs: Sequence[Path], settings: TerrainSettings,
    progress: ProgressLike = None, executor: str = THREADS, scratch: FilePath | None = None,
) -> TerrainModel:  # fmt: skip
    """As `terrain`, with the settings in one record.

    Raises
    ------
    InputError, TasksFailedError
    """
    from aerotri.execution.opening import opened
    from aerotri.execution.work import Workplace
    from aerotri.formats.files.spool import Spool
    from aerotri.statistics.camera_field import missing_in_sigma
    from aerotri.terrain.dtm import chosen_rows, make_terrain_model
    from aerotri.volume.shared import adjustment_key

    settings.check()
    chosen(executor)
    record = (result if isinstance(result, Adjustment) else open_result(result)).record
    block, spool = record.result.block, Spool(scratch)
    with stage_report(progress) as report:
        plan, notes = terrain_plan(record, photographs, settings)
        name = ""
        if settings.ground_within is not None:
            outline = outline_of(settings.ground_within, block.crs)
            plan, name = replace(plan, ground_within=outline.polygon), outline.name
            notes = (*notes, outline.note) if outline.note else notes
        with opened(executor, report.said) as workers:
            outcome = make_terrain_model(record, plan, report.stage, Workplace(workers, spool.folder))
    lacks = missing_in_sigma(record)
    notes = (*notes, lacks) if lacks else notes
    head = Head(block.project, block.crs)
    missing = missing_photographs(record, chosen_rows(record, settings.subset), plan.rows)
    used = used_settings(terrain, settings, {"interval": "m", "cell": "m", "area": "m", "window": "px"})
    return TerrainModel(outcome, str(block.name), block.crs, adjustment_key(record), notes, name, head, used, missing)


def terrain_plan(
    record: Record, given: Sequence[Path], settings: TerrainSettings
) -> tuple[TerrainPlan, tuple[str, ...]]:
    """Which photographs are matched, where and how; and what was done with the breaklines, in sentences.

    Raises
    ------
    InputError
        When fewer than two photographs of the block are found.
    """
    from aerotri.formats.foreign.breaklines import breaklines_and_note
    from aerotri.rasters.grids import horizontal_crs
    from aerotri.terrain.dtm import TerrainPlan, chosen_rows
    from aerotri.terrain.pickets import Area

    wanted = chosen_rows(record, settings.subset)
    rows, paths = rows_and_files(record, given, wanted)
    s, area, lines, note = settings, None, (), ""
    if s.area is not None:
        area = Area(np.array(s.area[:2]), np.array(s.area[2:]))
    if s.breaklines is not None:
        lines, note = breaklines_and_note(s.breaklines, horizontal_crs(record.result.block.crs))
    plan = TerrainPlan(
        rows=rows, paths=paths, interval=s.interval, cell=s.cell, pairs=s.in_pairs,
        step=s.step, area=area, window_px=s.window, threshold=s.threshold, agreeing=s.agreeing, edge=s.unused_edge,
        most_photographs=s.most_photographs, breaklines=lines, ideal=s.ideal,
    )  # fmt: skip
    missing = missing_photographs(record, wanted, rows)
    return plan, (*missing_in_words(missing, given), *((note,) if note else ()))


def rows_and_files(record: Record, given: Sequence[Path], wanted: np.ndarray) -> tuple[np.ndarray, tuple[Path, ...]]:
    """Photographs of a block that are found in folders and files, of those wanted, and their files.

    Raises
    ------
    InputError
        When fewer than two are found.
    """
    from aerotri.formats.files.photograph_files import match_files, photographs_in

    files = [f for f in photographs_in(given, ENDINGS) if f.suffix.lower() in ENDINGS]
    found = match_files(files, record.result.block.images.names)
    path_of = {int(row): file for row, file in zip(found, files, strict=True) if row >= 0}
    rows = np.array([r for r in wanted.tolist() if r in path_of], dtype=np.int64)
    if len(rows) < 2:
        where = ", ".join(str(path) for path in given) or "nothing"
        said = counted(len(rows), "photograph of the block is", "photographs of the block are")
        raise InputError(f"{said} in {where}", "give the folder that holds them: two at least are matched")
    return rows, tuple(path_of[int(r)] for r in rows)


def outline_of(stated: BaseGeometry | FilePath, crs: str) -> Boundary:
    """A polygon as `aerotri.volume` takes its boundary, in the CRS of a block.

    Raises
    ------
    InputError
    """
    from shapely.geometry.base import BaseGeometry

    from aerotri.rasters.grids import horizontal_crs
    from aerotri.volume.boundary import boundary_of, read_boundary

    if isinstance(stated, BaseGeometry):
        return boundary_of(stated, "the polygon given")
    plane = horizontal_crs(crs)
    return read_boundary(os.fspath(stated), plan_of(plane or ""))


def _write(target: Path, model: TerrainModel, plots: bool) -> None:
    """Write all files whole or not at all."""
    from aerotri.formats.files.atomic import atomic_folder
    from aerotri.formats.results.json_text import write_json
    from aerotri.formats.results.pickets import write_pickets
    from aerotri.formats.results.point_cloud import write_point_cloud
    from aerotri.public.tables import write_rows
    from aerotri.rasters.grids import crs_of_heights, horizontal_crs, write_raster
    from aerotri.rasters.surface_files import write_surface

    outcome, p, crs = model.record, model.record.pickets, horizontal_crs(model.crs)
    of_heights = crs_of_heights(model.crs)
    with atomic_folder(target, own=OWN_NAMES) as folder:
        write_pickets(folder / PICKETS, p, outcome.adjustment)
        own = p.accepted
        sigma = np.sqrt(p.covariance[own, 2, 2] + outcome.adjustment[own, 2])
        write_point_cloud(folder / "pickets.laz", p.xyz[own], sigma, outcome.ground[own], of_heights)
        for name, surface in (("dsm", outcome.dsm), ("dtm", outcome.dtm)):
            title = f"{name.upper()} Z, m"
            write_surface(folder / f"{name}.tif", surface.z, surface.sigma, surface.grid, of_heights, title)
        if outcome.models is not None:
            write_raster(folder / "model.tif", outcome.number, outcome.dsm.grid, crs, "number of the model")
            write_rows(model.models, folder / "models.csv")
        if plots:
            from aerotri.report.plots.rendering import save_plots

            save_plots(model.plot.all(), folder / "plots")
        write_json(folder / RECORD, model.summary)
