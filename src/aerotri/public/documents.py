"""Results as PDF documents: which document belongs to which result, and what stands at its head."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

from aerotri.conventions import FilePath, InputError, real_path
from aerotri.public.adjustment import Adjustment
from aerotri.public.change import RECORD as CHANGE
from aerotri.public.change import MeasuredChange
from aerotri.public.cloud_change import RECORD as CLOUD_CHANGE
from aerotri.public.cloud_change import MeasuredCloudChange
from aerotri.public.progress import StageReport
from aerotri.public.volume_result import RECORD as VOLUME
from aerotri.public.volume_result import MeasuredVolume

if TYPE_CHECKING:
    from aerotri.observations.project import Project
    from aerotri.report.documents.head import Context
    from aerotri.report.plots.rendering import RenderedPlot

DocumentKind = Literal["report", "calibration"]
REPORT, CALIBRATION, OF_VOLUME, OF_CHANGE = "adjustment.pdf", "calibration.pdf", "volume.pdf", "change.pdf"
PDF_NAMES = (REPORT, CALIBRATION, OF_VOLUME, OF_CHANGE)
KINDS = {MeasuredVolume: VOLUME, MeasuredChange: CHANGE, MeasuredCloudChange: CLOUD_CHANGE}
"""Results that have a certificate, and the file that says so in a folder."""
NEEDED = {VOLUME: "dtm", CHANGE: "volumes", CLOUD_CHANGE: "core_points"}
"""What such a file cannot be without."""
PICTURES = ("thickness", "budget", "difference", "difference_sigma", "distances", "distances_sigma", "histogram")


@dataclass(frozen=True)
class DocumentOptions:
    """What a document is to be.

    Parameters
    ----------
    language : code of the language. kind : of the documents of an adjustment. camera : of a calibration; '' for all.
    project : block folder or result of an adjustment whose [project] stands at the head of the certificate of a volume
        or a change; None: looked for beside the result.
    """

    language: str = "en"
    kind: str = "report"
    camera: str = ""
    project: FilePath | None = None

    def check(self) -> None:
        """Refuse what there is not, before anything is read.

        Raises
        ------
        InputError
        """
        from aerotri.report.documents.typesetting import typst_module
        from aerotri.report.documents.words import texts_of

        typst_module()
        texts_of(self.language)
        if self.kind not in get_args(DocumentKind):
            raise InputError(f"there is no document '{self.kind}'", f"use {', '.join(get_args(DocumentKind))}")
        if self.camera and self.kind != "calibration":
            raise InputError(f"a camera '{self.camera}' belongs to a calibration certificate", "ask for a calibration")


@dataclass(frozen=True)
class Made:
    """A document. name : of its file. pdf : its bytes. notes : what is to be known, in sentences."""

    name: str
    pdf: bytes
    notes: tuple[str, ...] = ()


def is_volume_or_change(result: object) -> bool:
    """Whether a result, or the folder of one, is a volume or a change."""
    return _record_of(result) is not None


def _record_of(result: object) -> str | None:
    """Name of the file with the numbers of a volume or a change, given itself or its folder."""
    if isinstance(result, Adjustment):
        return None
    own = next((name for kind, name in KINDS.items() if isinstance(result, kind)), None)
    return own or next((name for name in KINDS.values() if (Path(str(result)) / name).is_file()), None)


def adjustment_document(result: Adjustment, options: DocumentOptions, report: StageReport) -> Made:
    """The report of an adjustment, or the certificate of its cameras.

    Raises
    ------
    InputError
        When no photograph was taken with the camera.
    """
    from aerotri.report.documents.adjustment import adjustment_report
    from aerotri.report.documents.calibration import calibration_certificate
    from aerotri.report.documents.typesetting import pdf_of

    record = {} if result.folder is None else _read(result.folder / "adjustment.json")
    adjusted = result.adjusted
    outcome = adjusted.outcome
    said = {key: tuple(dict.fromkeys((*record.get(key, ()), *getattr(outcome, key)))) for key in ("warnings", "notes")}
    adjusted = replace(adjusted, outcome=replace(outcome, **said))
    made = _time_of(None if result.folder is None else result.folder / "adjustment.json")
    context = _context(options, made, adjusted.block.project, adjusted.block.name, True)
    report.stage("drawing", None)
    if options.kind == "report":
        name, found = REPORT, adjustment_report(adjusted, context, _version(record))
    else:
        name, found = CALIBRATION, calibration_certificate(adjusted, context, _version(record), options.camera)
    report.stage("writing", None)
    return Made(name, pdf_of(found, made))


def certificate(
    result: MeasuredVolume | MeasuredChange | MeasuredCloudChange | FilePath, options: DocumentOptions,
    report: StageReport,
) -> Made:  # fmt: skip
    """The certificate of a volume or of a change, given itself or its folder.

    Raises
    ------
    InputError
        When the folder cannot be read, or a document of another kind is asked for.
    """
    from aerotri.report.documents.change import change_certificate
    from aerotri.report.documents.cloud_change import cloud_change_certificate
    from aerotri.report.documents.typesetting import pdf_of
    from aerotri.report.documents.volume import volume_certificate

    if options.kind != "report":
        raise InputError("a volume or a change has no calibration", "give the result of an adjustment")
    folder = None if isinstance(result, MeasuredVolume | MeasuredChange | MeasuredCloudChange) else Path(result)
    record = _record_of(result) or CHANGE
    content, plots = _content_of(result, folder, record, options.language)
    made = _time_of(None if folder is None else folder / record)
    project, notes = _project(options.project, folder, content)
    context = _context(options, made, project, content["dtm"] if record == VOLUME else content["second"], False)
    report.stage("writing", None)
    certificates = {
        VOLUME: volume_certificate, CHANGE: change_certificate, CLOUD_CHANGE: cloud_change_certificate,
    }  # fmt: skip
    try:
        found = certificates[record](content, plots, context)
    except (KeyError, TypeError) as error:
        if folder is None:
            raise
        raise InputError(
            f"was written by another version ({_version(content)}): {error}", "compute the result again",
            folder / record,
        ) from error  # fmt: skip
    return Made(OF_VOLUME if record == VOLUME else OF_CHANGE, pdf_of(found, made), notes)


def _context(options: DocumentOptions, made: datetime, project: Project, name: str, of_block: bool) -> Context:
    from aerotri.report.documents.head import Context
    from aerotri.report.documents.words import Words

    return Context(Words(options.language), made, project, str(name), of_block)


def _content_of(
    result: Any, folder: Path | None, record: str, language: str
) -> tuple[dict[str, Any], dict[str, RenderedPlot]]:
    """Content and plots of a volume or a change; those of a folder in the language where they were drawn in it."""
    from aerotri.report.documents.picture_texts import in_language
    from aerotri.report.plots.rendering import RenderedPlot, render_plots
    from aerotri.report.plots.volume import plot_budget

    if folder is None:
        return result.summary, render_plots(in_language(result.plot.all(), language))
    content = _read(folder / record)
    if NEEDED[record] not in content:
        raise InputError("is damaged", "compute the result again", folder / record)
    plots: dict[str, RenderedPlot] = {}
    for name in PICTURES:
        for drawn in (name, f"{name}.{language}"):
            svg, png = folder / "plots" / f"{drawn}.svg", folder / "plots" / f"{drawn}.png"
            if svg.is_file() and png.is_file():
                plots[name] = RenderedPlot(svg.read_bytes(), png.read_bytes())
    if record == VOLUME and content["sigma"] is not None and plots:
        plots |= render_plots(in_language({"budget": plot_budget(content)}, language))
    return content, plots


def _read(path: Path) -> dict[str, Any]:
    if not path.is_file():
        return {}
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        raise InputError("cannot be read", "compute the result again", path) from None
    return content if isinstance(content, dict) else {}


def _version(record: Mapping[str, Any]) -> str:
    from aerotri.version import __version__

    return str(record.get("aerotri", __version__))


def _time_of(record: Path | None) -> datetime:
    """When the result was computed; of an older one when it was written; now for one that was not."""
    from aerotri.results.head import now, time_of

    if record is None or not record.is_file():
        return now()
    return time_of(_read(record).get("computed")) or datetime.fromtimestamp(int(record.stat().st_mtime), UTC)


def _project(given: FilePath | None, folder: Path | None, content: dict[str, Any]) -> tuple[Project, tuple[str, ...]]:
    """The [project] that was named, or what the result and what it names say; a sentence about it."""
    from aerotri.public.projects import project_in, project_of

    if given is not None:
        found = project_of(given)
        return found, (f"the head is that of {given}",) if found.given() else ()
    for place in _places(folder, content):
        beside = project_of(None, place)
        if beside.given():
            return beside, (f"the head is that of {place}",)
    found = project_in(content)
    return found, () if found.given() else ("nothing is known of a project: name its block with --project",)


def _places(folder: Path | None, content: Mapping[str, Any]) -> list[Path]:
    """Folders beside a result that may hold its block: of `aerotri run`, and the adjustment that it names."""
    from aerotri.public.run_steps import RECORD, RESULT

    if folder is None:
        return []
    around = real_path(folder).parent
    sigma = content.get("sigma")
    named = str(sigma.get("adjustment") or "") if isinstance(sigma, dict) else ""
    places = [around / RESULT] if (around / RECORD).is_file() else []
    places += [around / Path(named).name] if named else []
    return [one for one in places if one.is_dir()]
