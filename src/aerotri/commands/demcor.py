"""`aerotri demcor`: a DEM freed of the deformation of the models it was made of."""

from __future__ import annotations

import json
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from aerotri.commands.console import Console
from aerotri.commands.results import reopened
from aerotri.conventions import InputError
from aerotri.public.folders import refuse_existing_file
from aerotri.public.models import check_crs, refuse_without_errors

if TYPE_CHECKING:
    from aerotri.deformation.dem_correction import DemOutcome
    from aerotri.deformation.dem_window import DemModels
    from aerotri.deformation.model_map import ModelMap
    from aerotri.deformation.orientation import Orientation
    from aerotri.rasters.grids import RasterReader
    from aerotri.results.adjustment import Adjustment

ABSORBED, RECORD = "absorbed", "demcor.json"


def run_demcor(
    source: Path, dem: Path, out: Path, pair: tuple[str, str] | None, models: Path | None, table: Path | None,
    orientation: str | None, as_json: bool, overwrite: bool = False,
) -> int:  # fmt: skip
    """Exit code of the command; arguments as on the command line."""
    console = Console(quiet=as_json)
    if (pair is None) == (models is None):
        raise InputError("either --pair or --models says which photographs the DEM was made of", "give one of the two")
    if out.resolve() == dem.resolve():
        raise InputError("source and target are the same", "choose another --out", out)
    _refuse_foreign_files(out, overwrite)
    calibration = reopened(source, console)
    from aerotri.deformation.absorbed import AbsorptionFailedError
    from aerotri.deformation.model_map import PolygonMap
    from aerotri.deformation.restitution import FREE, restitution
    from aerotri.rasters.grids import RasterReader, cache_limited
    from aerotri.rasters.metric import refuse_other_units

    try:
        used = None if orientation in (None, ABSORBED) else _orientation(calibration, Path(str(orientation)), console)
        of = restitution(calibration, ABSORBED if orientation == ABSORBED else FREE, used)
    except AbsorptionFailedError as failure:
        console.failure(str(failure))
        return 1
    if used is None:
        refuse_without_errors(of, source.name)
    with ExitStack() as stack:
        stack.enter_context(cache_limited())
        reader = stack.enter_context(RasterReader(dem))
        refuse_other_units(reader)
        check_crs(calibration, reader.epsg, dem)
        chosen = _model_map(pair, models, table, reader, stack)
        if isinstance(chosen, PolygonMap) and chosen.note:
            console.note(chosen.note)
        from aerotri.deformation.dem_window import dem_models

        content = _corrected(dem_models(calibration, of, chosen.names), chosen, reader, out, calibration, console)
    if as_json:
        print(json.dumps(content, indent=2, ensure_ascii=False))
    else:
        console.lines([*_summary(content), f"Written to {out}"])
    return 0


def _refuse_foreign_files(out: Path, overwrite: bool) -> None:
    """Files that are there are replaced where the JSON file of an older correction of this name stands beside them."""
    for file in () if beside(out, RECORD).is_file() else (out, beside(out, "dZ.tif"), beside(out, "sigma_dZ.tif")):
        refuse_existing_file(file, overwrite)


def beside(out: Path, what: str) -> Path:
    """The file of that kind beside the corrected DEM: 'dem2_dZ.tif' beside 'dem2.tif'."""
    return out.with_name(f"{out.stem}_{what}")


def _model_map(
    pair: tuple[str, str] | None, models: Path | None, table: Path | None, reader: RasterReader, stack: ExitStack
) -> ModelMap:
    from aerotri.deformation.model_map import OneModel, number_map, read_number_table, read_polygons
    from aerotri.rasters.grids import RasterReader
    from aerotri.vectors.polygons import VECTOR_ENDINGS

    if pair is not None:
        return OneModel(*pair)
    if models is None:
        raise InputError("the models of the DEM are not known", "give --pair or --models")
    if models.suffix.lower() in VECTOR_ENDINGS:
        return read_polygons(models, reader.epsg)
    numbers = stack.enter_context(RasterReader(models))
    if numbers.epsg is not None and reader.epsg is not None and numbers.epsg != reader.epsg:
        raise InputError(f"is in EPSG:{numbers.epsg}, the DEM in EPSG:{reader.epsg}", "bring it into one CRS", models)
    return number_map(numbers, read_number_table(table or _table_of(models)))


def _table_of(models: Path) -> Path:
    """models.csv, or the raster's name with .csv."""
    own = models.with_suffix(".csv")
    return own if own.exists() else models.with_name("models.csv")


def _orientation(calibration: Adjustment, path: Path, console: Console) -> Orientation:
    """The orientation a DEM was made with: of another result, or of a table as images.csv is one."""
    from dataclasses import replace

    from aerotri.deformation.orientation import given_orientation, interior_of_images

    if (path / "solution.npz").is_file():
        other = reopened(path, console)
        if other.result.block.crs != calibration.result.block.crs:
            raise InputError(f"is in {other.result.block.crs}, the block in {calibration.result.block.crs}",
                             "give an orientation in the same CRS", path)  # fmt: skip
        images = other.result.images
        found = given_orientation(calibration, other.result.block, images.angles, images.centre)
        interior = _by_name(calibration, other, interior_of_images(other.local))
        return replace(found, interior=np.where(np.isfinite(interior), interior, found.interior))
    block = _table_of_images(calibration, path)
    return given_orientation(calibration, block, block.images.angles, block.images.centre)


def _by_name(calibration: Adjustment, other: Adjustment, values: np.ndarray) -> np.ndarray:
    """Rows of another block's photographs for the photographs of the calibrated one, NaN where it has none."""
    row = {str(name): k for k, name in enumerate(other.local.block.images.names)}
    rows = np.array([row.get(str(name), -1) for name in calibration.local.block.images.names])
    return np.where(rows[:, None] >= 0, values[rows], np.nan)


def _table_of_images(calibration: Adjustment, path: Path):
    """A block with the photographs of a table: image, X0, Y0, Z0, omega, phi, kappa in degrees."""
    from dataclasses import replace

    from aerotri.formats.text.table_checks import refuse_duplicates
    from aerotri.formats.text.tables import Columns, read_table

    numbers = ("X0", "Y0", "Z0", "omega", "phi", "kappa")
    if not path.is_file():
        raise InputError("there is no such file or result", "give images.csv, a result folder, or absorbed", path)
    table = read_table(path, Columns(text=("image",), numbers=numbers, free_text=True))
    table.require("image", *numbers)
    refuse_duplicates(table, table.text["image"].index, lambda row: f"image '{table.cell('image', row)}'")
    block = calibration.result.block
    values = np.column_stack([table.numbers[name] for name in numbers])
    images = replace(
        block.images, names=table.text["image"].rows(), camera=np.zeros(table.length, np.int64),
        strip=np.full(table.length, ""), centre=values[:, :3], angles=np.radians(values[:, 3:]), columns={},
    )  # fmt: skip
    return replace(block, images=images)


def _corrected(
    models: DemModels, numbers: ModelMap, reader: RasterReader, out: Path, calibration: Adjustment, console: Console
) -> dict[str, Any]:
    """Correct and write all files whole or not at all; returns the content of the JSON file."""
    from aerotri.adjustment.parallel import thread_count
    from aerotri.deformation.dem_correction import correct_dem
    from aerotri.deformation.outcome_json import correction_json
    from aerotri.formats.files.atomic import atomic_file
    from aerotri.rasters.grids import NO_DATA, RasterWriter, write_raster

    no_data = NO_DATA if reader.no_data is None else reader.no_data
    common = {"crs": reader.crs, "no_data": no_data, "options": reader.options, "threads": thread_count()}
    with ExitStack() as files:
        places = {what: files.enter_context(atomic_file(beside(out, what)))
                  for what in ("dZ.tif", "sigma_dZ.tif", RECORD)}  # fmt: skip
        place = files.enter_context(atomic_file(out))
        with (
            RasterWriter(place, reader.grid, reader.dtype, **common) as writer,
            RasterWriter(places["dZ.tif"], reader.grid, np.float32, **common) as dz_writer,
        ):
            dz_writer.describe("dZ taken off the DEM, m")
            report = partial(console.work, "correcting")
            outcome = correct_dem(models, numbers, reader, writer, dz_writer, report)
        _refuse_nothing(outcome, models, reader)
        write_raster(
            places["sigma_dZ.tif"], outcome.sigma, outcome.sigma_grid, reader.crs, "σ of dZ, m"
        )  # fmt: skip
        name = str(calibration.result.block.name)
        content = correction_json(outcome, models, reader.grid, name, reader.path.name)
        text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
        places[RECORD].write_text(text + "\n", encoding="utf-8")
    return content


def _refuse_nothing(outcome: DemOutcome, models: DemModels, reader: RasterReader) -> None:
    if not outcome.sums[0]:
        said = "has no data" if not outcome.sums[2] else "lies outside the models"
        names = ", ".join(models.names[0])
        raise InputError(f"{said}: nothing to correct", f"check the CRS and the photographs ({names} …)", reader.path)


def _summary(content: dict[str, Any]) -> list[str]:
    from aerotri.report.quality import printable

    c = content
    lines = [
        f"{c['corrected']} of {c['cells']} cells corrected, {c['no_data']} without data, {c['outside_models']} outside "
        f"the models; {len(c['models'])} model{'s' * (len(c['models']) != 1)}, {c['variant']}"
    ]
    for when in ("before", "after"):
        s = c[when]
        lines.append(f"{when:<7} Z {s['min']:.3f} … {s['max']:.3f} m, mean {s['mean']:.3f}")
    s, sigma = c["dZ"], c["sigma_dZ"]
    lines.append(f"dZ  {s['min']:+.3f} … {s['max']:+.3f} m, mean {s['mean']:+.3f}, RMS {s['rms']:.3f}")
    if sigma["mean"] is not None:
        lines.append(f"σ of dZ  {sigma['min']:.4f} … {sigma['max']:.4f} m: {c['sigma_includes']}")
    seams = c["seams"]
    if seams["count"]:
        lines.append(
            f"steps at {seams['count']} seams between models: RMS {seams['rms_before']:.3f} m before, "
            f"{seams['rms_after']:.3f} m after (roughness of the terrain included); worst:"
        )
        for seam in seams["worst"][:5]:
            first, second = (printable(", ".join(seam[key])) for key in ("first", "second"))
            lines.append(f"  {first} | {second}: mean {seam['mean_before']:+.3f} → {seam['mean_after']:+.3f} m")
    return lines
