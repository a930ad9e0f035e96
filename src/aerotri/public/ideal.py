"""Photographs without systematic image errors, their camera, and the errors for other programs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.execution.choice import THREADS, chosen
from aerotri.public.adjustment import Adjustment
from aerotri.public.folders import paths_of, refuse_existing_file, refuse_foreign_folder
from aerotri.public.progress import ProgressLike, StageReport, stage_report
from aerotri.public.stated import StatedAdjustment
from aerotri.public.table import Table
from aerotri.public.used_arguments import used_arguments
from aerotri.rasters.photograph_settings import (
    COMPRESSION,
    COMPRESSIONS,
    RESAMPLING,
    RESAMPLINGS,
    Compression,
    Resampling,
)

if TYPE_CHECKING:
    from aerotri.formats.results.image_errors import Exports
    from aerotri.image_errors import ImageGroup
    from aerotri.image_errors.error_function import ErrorFunction
    from aerotri.observations import Block, Camera
    from aerotri.results.adjusted_block import AdjustedBlock
    from aerotri.results.adjustment import Adjustment as Record

ENDINGS = (".jpg", ".jpeg", ".tif", ".tiff")
UNITS = {"focal_length_mm": "mm", "x0_mm": "mm", "y0_mm": "mm", "d_rms_um": "µm", "d_max_um": "µm", "seconds": "s"}


@dataclass(frozen=True, eq=False, repr=False)
class IdealPhotographs:
    """What `aerotri.ideal_photographs` wrote, and the cameras of the new photographs.

    Parameters
    ----------
    folder : where the photographs, the cameras and the image errors stand.
    summary : content of imgeo.json. cameras : of the photographs without image errors, by their names.
    """

    folder: Path
    summary: dict[str, Any]
    cameras: dict[str, Camera]

    @cached_property
    def groups(self) -> Table:
        """Every group's camera and the size of its image errors, with what simpler models leave of them, µm."""
        rows = []
        for group in self.summary["groups"]:
            left = {f"{near['model'].lower()}_leaves_rms_um": near["remaining_rms_um"] for near in group["nearest"]}
            rows.append({name: value for name, value in group.items() if name != "nearest"} | left)
        return _table("groups", rows, UNITS | {name: "µm" for name in rows[0] if name.endswith("_um")})

    @cached_property
    def photographs(self) -> Table:
        """The photographs written, with their group and what could not be carried over."""
        rows = [{**one, "left_out": ", ".join(one["left_out"])} for one in self.summary["photographs"]]
        return _table("photographs", rows, UNITS, ("file", "written", "group", "left_out", "seconds"))

    def __repr__(self) -> str:
        return f"<aerotri ideal photographs in {self.folder}: {len(self.summary['photographs'])}>"

    def _repr_html_(self) -> str:
        shown = self.photographs.html() if self.summary["photographs"] else ""
        return f"<div><b>{escape(str(self.folder))}</b>{self.groups.html()}{shown}</div>"


@dataclass(frozen=True, eq=False)
class _Job:
    """A photograph to resample: its file, its group by number, and the name of what is written."""

    source: Path
    group: int
    name: str
    row: int


def ideal_photographs(
    result: Adjustment | FilePath,
    photographs: FilePath | Sequence[FilePath] = (),
    out: FilePath = "ideal",
    *,
    resampling: Resampling = RESAMPLING,
    compression: Compression = COMPRESSION,
    group: str | None = None,
    overwrite: bool = False,
    executor: str = THREADS,
    progress: ProgressLike = None,
) -> IdealPhotographs:
    """Write photographs without systematic image errors, their camera, and the errors for other programs.

    Parameters
    ----------
    result : an adjustment, or the folder of one.
    photographs : TIFF or JPEG files named as in the block, or folders of them; none: cameras and errors alone.
    out : folder to write.
    resampling : of the grey values.
    compression : of the files; a lossy one is not kept.
    group : parameter group (camera, day) of photographs that are not in the block.
    overwrite : replace files that aerotri has not written, or that were changed since.
    executor : where photographs are resampled: 'threads', 'processes:N', 'dask:ADDRESS' or 'dask:local:N'.
    progress : as of `aerotri.adjust`.

    Returns
    -------
    IdealPhotographs

    Raises
    ------
    InputError
        For a file that is no photograph of the block or its camera, or a folder that holds other files; nothing is
        written before all files are known.
    TasksFailedError
        When photographs could not be resampled; it names them.

    Examples
    --------
    >>> import aerotri, tempfile
    >>> result = aerotri.adjust(aerotri.simulate(aerotri.example_flight(), seed=1).block, parameters="brown:K1+K2")
    >>> with tempfile.TemporaryDirectory() as place:
    ...     found = aerotri.ideal_photographs(result, out=f"{place}/ideal")
    >>> found.groups.columns[:4]
    ('group', 'camera', 'ideal_camera', 'focal_length_mm')
    """
    from aerotri.formats.files.work_place import held
    from aerotri.formats.results.image_errors import RECORD, exports_of
    from aerotri.image_errors import image_groups
    from aerotri.image_errors.error_exports import ideal_camera
    from aerotri.image_errors.error_function import error_function

    folder = Path(out)
    _check(resampling, compression)
    chosen(executor)
    refuse_foreign_folder(folder, RECORD)
    calibration = StatedAdjustment(result).record
    adjusted = calibration.result
    groups = image_groups(adjusted.block)
    jobs = _jobs(adjusted.block, groups, paths_of(photographs), folder, group)
    _refuse_unknown_motion(adjusted, groups, jobs)
    used = sorted({job.group for job in jobs}) if jobs else range(len(groups))
    errors = {k: error_function(adjusted, groups[k]) for k in used}
    with held(folder), stage_report(progress) as report:
        exports = exports_of(adjusted, errors, resampling)
        record = _write_exports(exports, folder, [job.name for job in jobs], overwrite)
        asked = {"resampling": resampling, "compression": compression, "group": group}
        record["settings"] = used_arguments(ideal_photographs, asked, {})
        record["photographs"] = _resample_all(
            calibration, jobs, errors, folder, (resampling, compression), report, executor
        )  # fmt: skip
        _write_record(record, folder)
    names = [entry["ideal_camera"] for entry in record["groups"]]
    return IdealPhotographs(
        folder, record, {name: ideal_camera(errors[k]) for name, k in zip(names, errors, strict=True)}
    )


def _check(resampling: str, compression: str) -> None:
    for name, value, known in (
        ("resampling", resampling, RESAMPLINGS), ("compression", compression, COMPRESSIONS)
    ):  # fmt: skip
        if value not in known:
            raise InputError(f"there is no {name} '{value}'", f"choose one of {', '.join(known)}")


def _jobs(
    block: Block, groups: tuple[ImageGroup, ...], photographs: list[Path], out: Path, group: str | None
) -> list[_Job]:
    """Which group every file belongs to, by its name; nothing is written before all are known."""
    from aerotri.formats.files.photograph_files import match_files, photographs_in
    from aerotri.image_errors.ideal_photographs import check_photograph, name_of

    photographs = list(dict.fromkeys(photographs_in(photographs, ENDINGS)))
    jobs, taken = [], {}
    for path, row in zip(photographs, match_files(photographs, block.images.names).tolist(), strict=True):
        if row in block.interior_fits:
            raise InputError(
                "is scanned film, whose interior orientation imgeo does not resample", "use the correction grid", path
            )
        number = _named_group(groups, group, path) if row < 0 else _group_of(groups, row)
        check_photograph(path, groups[number].camera)
        # in the subfolder that the block knows the photograph by
        within = Path(str(block.images.names[row])).parent if row >= 0 else Path()
        name = (within / name_of(path)).as_posix() if not within.is_absolute() else name_of(path)
        if name in taken:
            raise InputError(f"'{name}' would be written twice, for {taken[name]} too", "give other names", path)
        if (out / name).exists() and (out / name).samefile(path):
            raise InputError("would be overwritten by its own correction", "choose another --out", path)
        taken[name] = path
        jobs.append(_Job(path, number, name, row))
    return jobs


def _group_of(groups: tuple[ImageGroup, ...], row: int) -> int:
    return next(k for k, group in enumerate(groups) if group.images[row])


def _named_group(groups: tuple[ImageGroup, ...], name: str | None, path: Path) -> int:
    known = ", ".join(dict.fromkeys(group.name for group in groups))
    if name is None:
        raise InputError(
            "is no photograph of the block", f"name the file as the photograph, or state --group ({known})", path
        )
    found = [k for k, group in enumerate(groups) if group.name == name]
    if len(found) != 1:
        problem = "several cameras belong to" if found else "there is no"
        raise InputError(f"{problem} group '{name}'", f"groups are {known}", path)
    return found[0]


def _write_exports(exports: Exports, out: Path, photographs: list[str], overwrite: bool) -> dict[str, Any]:
    """Write cameras and image errors; the record of the run, without its photographs so far."""
    from aerotri.formats.results.image_errors import older_files

    record = {**exports.record, "files": [*exports.names, *photographs]}
    older = older_files(out)
    for name in record["files"]:
        if name not in older:
            refuse_existing_file(out / name, overwrite)
    # first, so that a run after one that was killed knows what is ours
    _write_record({**record, "files": list(dict.fromkeys([*record["files"], *older]))}, out)
    exports.write(out)
    return record


def _write_record(record: dict[str, Any], out: Path) -> None:
    from aerotri.formats.files.atomic import atomic_file
    from aerotri.formats.results.image_errors import RECORD
    from aerotri.formats.results.json_text import write_json

    with atomic_file(out / RECORD) as place:
        write_json(place, record)


def _refuse_unknown_motion(adjusted: AdjustedBlock, groups: tuple[ImageGroup, ...], jobs: list[_Job]) -> None:
    """Photographs of a rolling shutter that were not adjusted: how they moved is not known."""
    if adjusted.rolling_shutters is None:
        return
    rolling = {one.camera for one in adjusted.rolling_shutters.readouts}
    oriented = np.asarray(np.isfinite(adjusted.images.centre).all(axis=1))
    for job in jobs:
        if groups[job.group].camera.name in rolling and (job.row < 0 or not bool(oriented[job.row])):
            raise InputError(
                "its camera has a rolling shutter, and how it moved is not known: it was not adjusted",
                "leave it out, or adjust it with the others", job.source,
            )  # fmt: skip


def _resample_all(
    calibration: Record, jobs: list[_Job], errors: dict[int, ErrorFunction], out: Path,
    how: tuple[Resampling, Compression], report: StageReport, executor: str,
) -> list[dict[str, Any]]:  # fmt: skip
    from aerotri.compiled import compilation_notice
    from aerotri.deformation.moving_photographs import moving_errors, relief_left
    from aerotri.deformation.orientation import calibrated_orientation
    from aerotri.execution.opening import opened
    from aerotri.formats.files.atomic import room_beside
    from aerotri.image_errors.ideal_map import ideal_map
    from aerotri.public.resampling import ResampledPhotograph, Resamplings, resample_photographs

    if not jobs:
        return []
    if notice := compilation_notice():
        report.stage(notice, None)
    orientation = calibrated_orientation(calibration)
    own = [moving_errors(calibration, orientation, j.row, errors[j.group]) if j.row >= 0 else None for j in jobs]
    maps = {k: ideal_map(errors[k]) for k in sorted({j.group for j, o in zip(jobs, own, strict=True) if o is None})}
    to_do = [
        ResampledPhotograph(j.source.absolute(), j.name, j.group, o) for j, o in zip(jobs, own, strict=True)
    ]  # fmt: skip
    done = 0.0

    def told(share: float) -> None:
        nonlocal done
        done = share
        report.stage("correcting", share)

    def within(share: float) -> None:
        report.stage("correcting", done + share / len(jobs))

    shared = Resamplings(maps, out, *how, within)
    with opened(executor, report.said) as workers, room_beside(out) as room:
        found = resample_photographs(shared, to_do, workers, room, told)
    record = []
    for job, errors_of, (lost, seconds) in zip(jobs, own, found, strict=True):
        record.append({
            "file": str(job.source), "written": job.name, "group": errors[job.group].group,
            "left_out": list(lost), "seconds": seconds,
        })  # fmt: skip
        if errors_of is not None:
            record[-1]["relief_rms_px"] = relief_left(calibration, orientation, job.row, errors_of)
    return record


def _table(name: str, rows: list[dict[str, Any]], units: dict[str, str], columns: Sequence[str] = ()) -> Table:
    import pyarrow as pa

    names = columns or tuple(rows[0])
    return Table(name, pa.table({column: [row[column] for row in rows] for column in names}), units)
