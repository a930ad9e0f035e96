"""A DEM freed of the deformation of the stereo models it was made of."""

from __future__ import annotations

import os
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property, partial
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from aerotri.conventions import FilePath, InputError, real_path
from aerotri.crs_text import refuse_other_system
from aerotri.execution.choice import THREADS, chosen
from aerotri.formats.files.spool import Spool
from aerotri.public.adjustment import Adjustment
from aerotri.public.folders import refuse_existing_file
from aerotri.public.models import ModelDeformation, check_crs, refuse_without_errors
from aerotri.public.progress import ProgressLike, StageReport, stage_report
from aerotri.public.stated import StatedAdjustment
from aerotri.public.surfaces import Surface, as_surface
from aerotri.public.table import Table
from aerotri.public.used_arguments import used_arguments
from aerotri.results.head import Head

if TYPE_CHECKING:
    from aerotri.deformation.dem_correction import DemOutcome
    from aerotri.deformation.dem_window import DemModels
    from aerotri.deformation.model_map import ModelMap
    from aerotri.deformation.orientation import Orientation
    from aerotri.observations import Block
    from aerotri.public.surfaces import SurfaceLike
    from aerotri.public.terrain import TerrainModel
    from aerotri.rasters.grids import RasterReader
    from aerotri.rasters.held import HeldRaster
    from aerotri.results.adjustment import Adjustment as Record

    Reader = RasterReader | HeldRaster

ABSORBED, RECORD = "absorbed", "demcor.json"
DEM, DZ, SIGMA_DZ = "dem.tif", "dZ.tif", "sigma_dZ.tif"
Absorbed = Literal["absorbed"]


@dataclass(frozen=True, eq=False, repr=False)
class CorrectedDem:
    """What `aerotri.correct_dem` returns: the corrected DEM, what was taken off it, and its σ.

    Parameters
    ----------
    summary : content of demcor.json: counts of cells, heights before and after, dZ, σ, steps at seams.
    source : file of the DEM before; None where it was in memory.
    spool : holds the rasters until they are saved.
    notes : doubts about results and what was done with the map of the models, in sentences.
    """

    summary: dict[str, Any]
    source: Path | None
    spool: Spool
    notes: tuple[str, ...] = ()

    @property
    def dem(self) -> Surface:
        """The corrected DEM, a raster on disk as long as it is in use."""
        return Surface(self.spool.folder / DEM, keeper=self.spool)

    @property
    def dz(self) -> Surface:
        """dZ taken off the DEM, m, a raster on disk as long as it is in use."""
        return Surface(self.spool.folder / DZ, keeper=self.spool)

    @property
    def sigma_dz(self) -> Surface:
        """σ of dZ, m, on coarser cells, a raster on disk as long as it is in use."""
        return Surface(self.spool.folder / SIGMA_DZ, keeper=self.spool)

    @cached_property
    def seams(self) -> Table:
        """The largest steps at seams between models, before and after, m."""
        import pyarrow as pa

        rows = [
            {"first": ", ".join(row["first"]), "second": ", ".join(row["second"]), **_numbers(row)}
            for row in self.summary["seams"]["worst"]
        ]
        steps = ["mean_before", "rms_before", "mean_after", "rms_after"]
        columns = {name: [row[name] for row in rows] for name in ("first", "second", "places", *steps)}
        return Table("steps at seams", pa.table(columns), dict.fromkeys(steps, "m"))

    def save(self, out: FilePath, overwrite: bool = False) -> Path:
        """Write the corrected DEM; dZ, its σ and a JSON file stand beside it.

        Parameters
        ----------
        out : GeoTIFF to write. overwrite : replace files that are there and not of an older correction.

        Returns
        -------
        Path of the corrected DEM.

        Raises
        ------
        InputError
            When the file is that of the DEM before, is there already, or cannot be written.
        """
        target = Path(out)
        if self.source is not None and real_path(target) == real_path(self.source):
            raise InputError("source and target are the same", "choose another name", target)
        refuse_foreign_files(target, overwrite)
        _write(target, self)
        return target

    def __repr__(self) -> str:
        s = self.summary
        return f"<aerotri corrected DEM {s['dem']!r}: {s['corrected']} of {s['cells']} cells, {s['variant']}>"

    def _repr_html_(self) -> str:
        s, dz = self.summary, self.summary["dZ"]
        seams = self.seams.html() if len(self.seams) else ""
        return (
            f"<div><b>{escape(s['dem'])}</b>: {s['corrected']} of {s['cells']} cells corrected, dZ {dz['min']:+.3f} … "
            f"{dz['max']:+.3f} m, RMS {dz['rms']:.3f} m{seams}</div>"
        )


def correct_dem(
    dem: SurfaceLike,
    result: Adjustment | FilePath,
    *,
    pair: tuple[str, str] | None = None,
    models: ModelDeformation | TerrainModel | FilePath | None = None,
    model_table: FilePath | None = None,
    orientation: Adjustment | Absorbed | FilePath | None = None,
    scratch: FilePath | None = None,
    executor: str = THREADS,
    progress: ProgressLike = None,
) -> CorrectedDem:
    """Free a DEM of the deformation of its stereo models: heights and plan, window by window, with σ.

    Parameters
    ----------
    dem : raster of heights in the coordinate system of the block, or a surface in memory.
    result : an adjustment with additional parameters, or the folder of one.
    pair : the two photographs the whole DEM was made of, left and right.
    models : map of the models: polygons (GeoPackage, GeoJSON, Shapefile, FlatGeobuf) with left and right; a raster of
        numbers; or what `aerotri.deform` found for a block, or `aerotri.terrain` with pairs.
    model_table : table number,left,right of a raster; NAME.csv or models.csv beside it where None.
    orientation : the one the DEM was made with: a result or its folder, images.csv, or 'absorbed' (of an adjustment
        without additional parameters); that of `result` where None.
    scratch : folder for the rasters until they are saved; the temporary one of the system where None. Workers on other
        machines have to see it.
    executor : where windows are corrected: 'threads', 'processes:N', 'dask:ADDRESS' or 'dask:local:N'.
    progress : as of `aerotri.adjust`.

    Returns
    -------
    CorrectedDem

    Raises
    ------
    InputError
        When files cannot be read, the block lacks a photograph, or nothing of the DEM lies in the models.
    TasksFailedError
        When windows could not be corrected; it names them.

    Examples
    --------
    >>> import aerotri, numpy as np
    >>> result = aerotri.adjust(aerotri.simulate(aerotri.example_flight(), seed=1).block, parameters="brown:K1+K2")
    >>> x, y = (result.images[name][1:3].mean() for name in ("X0", "Y0"))
    >>> flat = aerotri.Surface.of_array(np.full((30, 30), 100.0), left=x - 15.0, top=y + 15.0, cell=1.0)
    >>> found = aerotri.correct_dem(flat, result, pair=tuple(result.images["image"][1:3]))
    >>> found.summary["corrected"], found.dem.z.shape
    (900, (30, 30))
    """
    if (pair is None) == (models is None):
        raise InputError("either a pair or a map of models says what the DEM was made of", "give one of the two")
    chosen(executor)
    from aerotri.deformation.dem_window import dem_models
    from aerotri.deformation.model_map import OneModel, PolygonMap
    from aerotri.deformation.restitution import FREE, restitution_of
    from aerotri.rasters.grids import cache_limited

    stated, spool = StatedAdjustment(result), Spool(scratch)
    with stage_report(progress) as report, ExitStack() as stack:
        record = stated.record
        used, doubt = _orientation(record, orientation)
        photographs = restitution_of(record, ABSORBED if orientation == ABSORBED else FREE, used)
        if used is None:
            refuse_without_errors(photographs, stated.name)
        stack.enter_context(cache_limited())
        reader = _reader(dem, stack)
        check_crs(record, reader.plan, reader.path)
        numbers = OneModel(*pair) if pair is not None else _model_map(models, model_table, reader, stack)
        crs_note = numbers.note if isinstance(numbers, PolygonMap) else ""
        models_of_dem = dem_models(record, photographs, numbers.names)
        content = _correct(models_of_dem, numbers, reader, record.result.block, spool, report, executor)
    asked = {"pair": pair, "models": models, "model_table": model_table, "orientation": orientation}
    content["settings"] = used_arguments(correct_dem, asked, {})
    return CorrectedDem(content, as_surface(dem).path, spool, tuple(text for text in (doubt, crs_note) if text))


def refuse_foreign_files(out: Path, overwrite: bool = False) -> None:
    """Files that are there are replaced where the JSON file of an older correction of this name stands beside them.

    Raises
    ------
    InputError
    """
    for file in () if beside(out, RECORD).is_file() else (out, beside(out, DZ), beside(out, SIGMA_DZ)):
        refuse_existing_file(file, overwrite)


def beside(out: Path, what: str) -> Path:
    """The file of that kind beside the corrected DEM: 'dem2_dZ.tif' beside 'dem2.tif'."""
    return out.with_name(f"{out.stem}_{what}")


def _numbers(row: dict[str, Any]) -> dict[str, float]:
    return {name: value for name, value in row.items() if name not in ("first", "second")}


def _reader(dem: SurfaceLike, stack: ExitStack) -> Reader:
    """The DEM in its own cells, which has to be in metres; open as long as the stack."""
    from aerotri.rasters.grids import RasterReader
    from aerotri.rasters.held import HeldRaster
    from aerotri.rasters.metric import refuse_other_units

    surface = as_surface(dem)
    if surface.path is None:
        held = stack.enter_context(surface.reader())
        if isinstance(held, HeldRaster):
            return held
    reader = stack.enter_context(RasterReader(surface.path or ""))
    refuse_other_units(reader)
    return reader


def _model_map(
    models: ModelDeformation | TerrainModel | FilePath | None, table: FilePath | None, reader: Reader, stack: ExitStack
) -> ModelMap:
    """Which model every cell was made in."""
    from aerotri.deformation.model_map import number_map, read_number_table, read_polygons, table_beside
    from aerotri.rasters.grids import RasterReader
    from aerotri.vectors.polygons import VECTOR_ENDINGS

    if models is None or not isinstance(models, str | os.PathLike):
        numbers, names = _numbers_in_memory(models)
    else:
        path = Path(models)
        if path.suffix.lower() in VECTOR_ENDINGS:
            return read_polygons(path, reader.plan)
        numbers, names = stack.enter_context(RasterReader(path)), None
    refuse_other_system(numbers.plan, reader.plan, "the DEM", numbers.path)
    if names is None:
        names = read_number_table(Path(table) if table is not None else table_beside(numbers.path))
    return number_map(numbers, names)


def _numbers_in_memory(models: ModelDeformation | TerrainModel | None) -> tuple[HeldRaster, dict[int, tuple[str, str]]]:
    """The numbers of models on a grid, and their photographs."""
    from aerotri.deformation.block_models import BlockDeformation
    from aerotri.rasters.grids import Grid, horizontal_crs
    from aerotri.rasters.held import HeldRaster

    if isinstance(models, ModelDeformation):
        d = models.record
        if not isinstance(d, BlockDeformation):
            raise InputError("a single model is no map of models", "deform the whole block, or give the pair")
        names = {k: (str(one.model.names[0]), str(one.model.names[1])) for k, one in enumerate(d.models)}
        return HeldRaster(d.number, Grid.of_nodes(d.x, d.y), horizontal_crs(d.crs), "models"), names
    if models is None:
        raise InputError("the models of the DEM are not known", "give the pair or a map of models")
    rows = models.models.to_arrow().to_pylist()
    held = HeldRaster(models.record.number, models.record.dsm.grid, models.dsm.crs, "model.tif")
    return held, {row["number"]: (row["left"], row["right"]) for row in rows}


def _orientation(record: Record, stated: Adjustment | FilePath | None) -> tuple[Orientation | None, str]:
    """The orientation a DEM was made with, None for that of the result or without parameters; a doubt in a sentence."""
    from aerotri.deformation.orientation import given_orientation, orientation_of_result
    from aerotri.formats.results.orientations import block_with_orientations

    if stated is None or stated == ABSORBED:
        return None, ""
    if not isinstance(stated, Adjustment) and not (Path(stated) / "solution.npz").is_file():
        block = block_with_orientations(Path(stated), record.result.block)
        return given_orientation(record, block, block.images.angles, block.images.centre), ""
    other = StatedAdjustment(stated)
    crs, own = other.record.result.block.crs, record.result.block.crs
    if crs != own:
        place = None if isinstance(stated, Adjustment) else Path(stated)
        raise InputError(f"is in {crs}, the block in {own}", "give an orientation in the same CRS", place)
    return orientation_of_result(record, other.record), other.doubt


def _correct(
    models: DemModels, numbers: ModelMap, reader: Reader, block: Block, spool: Spool, report: StageReport, executor: str
) -> dict[str, Any]:
    """Correct and write the rasters; returns the content of the JSON file."""
    from aerotri.adjustment.parallel import thread_count
    from aerotri.deformation import dem_correction
    from aerotri.execution.opening import opened
    from aerotri.formats.results.deformation import correction_json
    from aerotri.rasters.grids import NO_DATA, RasterWriter, write_raster

    no_data = NO_DATA if reader.no_data is None else reader.no_data
    common: dict[str, Any] = {
        "crs": reader.crs,
        "no_data": no_data,
        "options": reader.options,
        "threads": thread_count(),
    }
    with (
        opened(executor, report.said) as workers,
        RasterWriter(spool.folder / DEM, reader.grid, reader.dtype, **common) as writer,
        RasterWriter(spool.folder / DZ, reader.grid, np.float32, **common) as dz_writer,
    ):
        dz_writer.describe("dZ taken off the DEM, m")
        outcome = dem_correction.correct_dem(
            models, numbers, reader, writer, dz_writer, partial(report.stage, "correcting"),
            None if chosen(executor).kind == "threads" else workers, spool.folder,
        )  # fmt: skip
    _refuse_nothing(outcome, models, reader.path)
    write_raster(spool.folder / SIGMA_DZ, outcome.sigma, outcome.sigma_grid, reader.crs, "σ of dZ, m")
    spool.refuse_full()
    found = correction_json(outcome, models, reader.grid, str(block.name), reader.path.name)
    return Head(block.project, block.crs).as_dict() | found


def _refuse_nothing(outcome: DemOutcome, models: DemModels, dem: Path) -> None:
    if not outcome.sums[0]:
        problem = "has no data" if not outcome.sums[2] else "lies outside the models"
        names = ", ".join(models.names[0])
        raise InputError(f"{problem}: nothing to correct", f"check the CRS and the photographs ({names} …)", dem)


def _write(out: Path, found: CorrectedDem) -> None:
    """Write all files whole or not at all."""
    from aerotri.formats.files.atomic import atomic_file
    from aerotri.formats.results.json_text import write_json

    with ExitStack() as files:
        for name in (DZ, SIGMA_DZ):
            found.spool.give(name, files.enter_context(atomic_file(beside(out, name))))
        write_json(files.enter_context(atomic_file(beside(out, RECORD))), found.summary)
        found.spool.give(DEM, files.enter_context(atomic_file(out)))
