"""Results for other programs: layers for a GIS, tables with geometries, an item of a catalogue."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Literal, cast, get_args

import numpy as np

from aerotri.conventions import FilePath, InputError, counted, real_path
from aerotri.public.adjustment import Adjustment
from aerotri.public.change import MeasuredChange
from aerotri.public.cloud_change import MeasuredCloudChange
from aerotri.public.document_origins import ORIGINS, with_origin
from aerotri.public.documents import (
    PDF_NAMES,
    DocumentKind,
    DocumentOptions,
    Made,
    adjustment_document,
    certificate,
    is_volume_or_change,
)
from aerotri.public.folders import refuse_foreign_folder
from aerotri.public.progress import ProgressLike, StageReport, stage_report
from aerotri.public.volume_result import MeasuredVolume

if TYPE_CHECKING:
    from aerotri.deformation.footprints import Footprints
    from aerotri.formats.gis.stac import Asset
    from aerotri.vectors.geopackage_writer import Layer

ExportFormat = Literal["gpkg", "geoparquet", "stac", "pdf"]
GPKG, POINTS, RAYS, ITEM = "result.gpkg", "points.parquet", "rays.parquet", "item.json"
WRITTEN: dict[str, tuple[str, ...]] = {"gpkg": (GPKG,), "geoparquet": (POINTS, RAYS), "stac": (ITEM,)}
EXPORT_NAMES = (GPKG, POINTS, RAYS, ITEM, *PDF_NAMES)
BESIDE = ("dtm", "dsm", "ortho", "volume")
"""Folders of `aerotri run` beside its result that have files of their own."""


@dataclass(frozen=True)
class Exported:
    """What was written.

    Parameters
    ----------
    folder : the folder. files : their names in it. notes : what is to be known, in sentences.
    """

    folder: Path
    files: tuple[str, ...]
    notes: tuple[str, ...] = ()


def export(
    result: Adjustment | MeasuredVolume | MeasuredChange | MeasuredCloudChange | FilePath,
    out: FilePath,
    to: ExportFormat = "gpkg",
    *,
    scale: float | None = None,
    flown: str = "",
    language: str = "en",
    document: DocumentKind = "report",
    camera: str = "",
    project: FilePath | None = None,
    progress: ProgressLike = None,
) -> Exported:
    """Write a result for other programs into a folder; files of other formats that are there stay.

    Parameters
    ----------
    result : of an adjustment, or the folder of one; as PDF also a volume or a change, or the folder of one.
    out : folder to write.
    to : 'gpkg', result.gpkg with layers and styles for QGIS; 'geoparquet', points.parquet and rays.parquet; 'stac',
        item.json for a catalogue; 'pdf', a document: adjustment.pdf, calibration.pdf, volume.pdf or change.pdf. It
        needs the package typst.
    scale : by how much error ellipses and differences are drawn larger in result.gpkg; chosen where None.
    flown : date or time of the flight, '2026-05-17' or '2026-05-17T10:30:00Z', for a catalogue.
    language : of the document, 'en' or 'de'.
    document : of an adjustment, 'report' or 'calibration', the certificate of its cameras.
    camera : name of the camera of a calibration certificate; '' for all that took photographs.
    project : block folder, or result of an adjustment, whose `[project]` stands at the head of the certificate of a
        volume or a change; looked for beside the result where None.
    progress : see `aerotri.adjust`.

    Returns
    -------
    Exported

    Raises
    ------
    InputError
        When the folder holds no result, the format, language, document or camera is not known, the block has local
        coordinates and the format none, typst is needed and missing, or the folder to write holds other files.

    Examples
    --------
    >>> import aerotri, tempfile
    >>> result = aerotri.adjust(aerotri.simulate(aerotri.example_flight(), seed=1).block)
    >>> with tempfile.TemporaryDirectory() as place:
    ...     aerotri.export(result, f"{place}/for_qgis").files
    ('result.gpkg',)
    """
    from aerotri.formats.files.atomic import atomic_folder
    from aerotri.formats.files.ownership import keep_written
    from aerotri.public.results import open_result

    target = Path(out)
    options = DocumentOptions(language, document, camera, project)
    refuse_export(target, to, scale)
    _refuse_options(to, options)
    with stage_report(progress) as report:
        if to == "pdf" and is_volume_or_change(result):
            made = certificate(cast("MeasuredVolume", result), options, report)
            return _keep(made, target, _origin(result, options, target), ())
        if isinstance(result, MeasuredVolume | MeasuredChange | MeasuredCloudChange) or is_volume_or_change(result):
            raise InputError(f"a volume or a change is not written as {to}", "use pdf, or give an adjustment")
        if not isinstance(result, Adjustment):
            report.stage("reading", None)
            result = open_result(result)
        if to == "pdf":
            _refuse_not_converged(result)
            made = adjustment_document(result, options, report)
            return _keep(made, target, _origin(result.folder or result, options, target), _doubt(result))
        _refuse_unfinished(result)
        with atomic_folder(target, own=WRITTEN[to]) as folder:
            keep_written(target, folder, [name for name in (*EXPORT_NAMES, ORIGINS) if name not in WRITTEN[to]])
            notes = _write(result, folder, target, to, scale, flown, report)
    return Exported(target, WRITTEN[to], (*_doubt(result), *notes))


def _origin(result: object, options: DocumentOptions, target: Path) -> str:
    """What tells the result of a document from others: its folder as seen from that of the document, or what it is."""
    camera = f", camera {options.camera}" if options.camera else ""
    if not isinstance(result, str | os.PathLike):
        return f"{result!r}{camera}"
    folder = real_path(Path(result))
    try:
        return os.path.relpath(folder, real_path(target)) + camera
    except ValueError:  # on another drive
        return f"{folder}{camera}"


def _keep(made: Made, target: Path, origin: str, doubts: tuple[str, ...]) -> Exported:
    """Write a document; other exports stay, and one of another result is not replaced."""
    from aerotri.formats.files.atomic import atomic_folder
    from aerotri.formats.files.ownership import keep_written

    origins = with_origin(target, made.name, origin)
    with atomic_folder(target, own=(made.name, ORIGINS)) as folder:
        keep_written(target, folder, [name for name in EXPORT_NAMES if name != made.name])
        (folder / made.name).write_bytes(made.pdf)
        (folder / ORIGINS).write_text(origins, encoding="utf-8")
    return Exported(target, (made.name,), (*doubts, *made.notes))


def _refuse_options(to: str, options: DocumentOptions) -> None:
    """Refuse options of documents for other formats, and what no document can be."""
    if to == "pdf":
        options.check()
    elif options != DocumentOptions():
        raise InputError("language, document, camera and project belong to documents", "use them with pdf")


def refuse_export(target: Path, to: str, scale: float | None) -> None:
    """Refuse, before anything is read, what cannot be written.

    Raises
    ------
    InputError
    """
    if to not in get_args(ExportFormat):
        raise InputError(
            f"'{to}' is not a format that results are exported to", f"use {', '.join(get_args(ExportFormat))}"
        )
    if scale is not None and not 0.0 < scale < np.inf:
        raise InputError(f"a scale of {scale:g} is not possible", "give a number greater than 0")
    refuse_foreign_folder(target, *EXPORT_NAMES, ORIGINS)


def _refuse_unfinished(result: Adjustment) -> None:
    from aerotri.coordinates.georeference import is_projected

    _refuse_not_converged(result)
    crs = result.block.crs
    if crs != "local" and not is_projected(crs):
        raise InputError(f"the result is in {crs}, which counts in degrees", "adjust the block in a projected CRS")


def _refuse_not_converged(result: Adjustment) -> None:
    if result.status != "converged":
        raise InputError(f"the adjustment ended '{result.status}'", "give the result of a converged one")


def _doubt(result: Adjustment) -> tuple[str, ...]:
    """A sentence where the adjustment is not simply accepted."""
    if result.verdict == "accepted" or not result.reasons:
        return ()
    return (f"the adjustment is {result.verdict}: {result.reasons[0]}",)


def _write(
    result: Adjustment, folder: Path, target: Path, to: str, scale: float | None, flown: str, report: StageReport
) -> tuple[str, ...]:
    """Write the files of one format; notes."""
    from aerotri.deformation.footprints import footprints
    from aerotri.formats.results.json_text import write_json

    if to == "geoparquet":
        report.stage("writing", None)
        return _write_parquet(result, folder)
    report.stage("footprints", None)
    found = footprints(result.record)
    report.stage("writing", None)
    if to == "stac":
        from aerotri.formats.gis.stac import stac_item

        assets = [*_assets(result, target), *_beside(result)]
        write_json(folder / ITEM, stac_item(result.adjusted, found, target, assets, _made(result), flown))
        return found.notes
    from aerotri.vectors.geopackage_writer import write_geopackage

    crs = result.block.crs
    write_geopackage(folder / GPKG, gis_layers(result, found, scale), None if crs == "local" else crs)
    return (*_about_cut(found), *found.notes)


def gis_layers(result: Adjustment, found: Footprints, scale: float | None = None) -> list[Layer]:
    """The layers of result.gpkg, with the texts of the reference and their styles."""
    from aerotri.diagnosis.work_list import work_list
    from aerotri.formats.gis import layers, vectors
    from aerotri.reference.export_files import column_texts
    from aerotri.reference.export_files import layers as described

    adjusted, local = result.adjusted, result.record.local
    k = scale or vectors.vector_scale(adjusted)
    made = [
        layers.footprint_layer(adjusted, found), layers.centre_layer(adjusted), layers.strip_layer(adjusted),
        layers.point_layer(adjusted), vectors.ellipse_layer(adjusted, scale),
        vectors.vector_layer(adjusted, adjusted.control, "control", k),
        vectors.vector_layer(adjusted, adjusted.check, "check", k), layers.residual_layer(adjusted),
        layers.work_layer(adjusted, work_list(local)), layers.finding_table(local),
    ]  # fmt: skip
    texts = {one.name: column_texts(one) for one in described()}
    fields = {one.name: {name: texts[one.name][name] for name in one.columns} for one in made}
    return layers.with_texts(made, fields)


def _about_cut(found: Footprints) -> tuple[str, ...]:
    count, blind = int(found.is_cut.sum()), sum(one is None for one in found.polygons)
    said = []
    if count:
        said.append(f"{counted(count, 'photograph')} see the horizon or nearly: footprints are cut at six heights")
    if blind:
        said.append(f"{counted(blind, 'photograph')} without a footprint: not adjusted, or without ground in view")
    return tuple(said)


def _write_parquet(result: Adjustment, folder: Path) -> tuple[str, ...]:
    from aerotri.formats.gis.parquet import write_points, write_rays
    from aerotri.reference.export_files import column_texts, export_files

    texts = {one.name: column_texts(one) for one in export_files()}
    write_points(folder / POINTS, result.adjusted, texts[POINTS])
    write_rays(folder / RAYS, result.adjusted, texts[RAYS])
    return ()


def _made(result: Adjustment) -> datetime:
    """When the result was written; now for one that was not."""
    from aerotri.public.saving import RECORD

    record = None if result.folder is None else result.folder / RECORD
    if record is None or not record.is_file():
        return datetime.now(UTC)
    return datetime.fromtimestamp(record.stat().st_mtime, UTC)


def _assets(result: Adjustment, target: Path) -> Iterator[Asset]:
    """Files of the result, and what was exported before into the same folder."""
    if result.folder is not None:
        yield from _described(result.folder, "result of adjust", "")
    yield from (one for one in _described(target, "folder of export", "") if one.key != ITEM)


def _beside(result: Adjustment) -> Iterator[Asset]:
    """Surfaces, orthophoto and volume of the project of `aerotri run` that the result belongs to."""
    from aerotri.public.run_steps import RECORD

    project = None if result.folder is None else real_path(result.folder).parent
    if project is not None and (project / RECORD).is_file():
        for name in BESIDE:
            yield from _described(project / name, f"folder of {name}", f"{name}/")


def _described(folder: Path, place: str, before: str) -> Iterator[Asset]:
    """Files of a folder that the reference knows."""
    from aerotri.formats.gis.stac import Asset
    from aerotri.reference.files import described_files

    for one in described_files():
        path = folder / one.name
        if one.place == place and path.is_file():
            yield Asset(path, f"{before}{one.name}", one.text, one.name == "ortho.tif")
