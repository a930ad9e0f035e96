"""`aerotri imgeo`: photographs without systematic image errors, their camera, and the errors for other programs."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerotri.commands.console import Console
from aerotri.commands.imgeo_exports import RECORD, export, plain, write_record
from aerotri.commands.results import reopened
from aerotri.conventions import InputError
from aerotri.public.folders import refuse_foreign_folder

if TYPE_CHECKING:
    from aerotri.image_errors import ImageGroup
    from aerotri.image_errors.error_function import ErrorFunction
    from aerotri.image_errors.ideal_map import IdealMap
    from aerotri.results.adjusted_block import AdjustedBlock


ENDINGS = (".jpg", ".jpeg", ".tif", ".tiff")


@dataclass(frozen=True)
class ImgeoOptions:
    """What the command line says besides the photographs.

    Parameters
    ----------
    resampling : bicubic or lanczos.
    compression : keep, deflate, lzw, zstd or none.
    group : parameter group of photographs that the block does not name.
    """

    resampling: str = "bicubic"
    compression: str = "keep"
    group: str | None = None


@dataclass(frozen=True, eq=False)
class Job:
    """A photograph to resample: its file, its group by number, and the name of what is written."""

    source: Path
    group: int
    name: str


def run_imgeo(
    result: Path, photographs: list[Path], out: Path, options: ImgeoOptions, as_json: bool, overwrite: bool = False
) -> None:
    """Resample and export; arguments as on the command line.

    Raises
    ------
    InputError
    """
    console = Console(quiet=as_json)
    refuse_foreign_folder(out, RECORD)
    _check_options(options)
    from aerotri.image_errors import image_groups
    from aerotri.image_errors.error_function import error_function

    adjusted = reopened(result, console).result
    groups = image_groups(adjusted.block)
    jobs = _jobs(adjusted, groups, photographs, out, options)
    used = sorted({job.group for job in jobs}) if jobs else range(len(groups))
    errors = {k: error_function(adjusted, groups[k]) for k in used}
    from aerotri.formats.files.work_place import held

    with held(out):
        record = export(adjusted, errors, out, options.resampling, [job.name for job in jobs], overwrite)
        record["photographs"] = _resample_all(jobs, errors, out, options, console)
        write_record(record, out)
    _tell(record, out, console, as_json)


def _check_options(options: ImgeoOptions) -> None:
    from aerotri.image_errors.ideal_photographs import RESAMPLINGS
    from aerotri.rasters.images import COMPRESSIONS

    for name, value, known in (
        ("resampling", options.resampling, RESAMPLINGS), ("compression", options.compression, COMPRESSIONS)
    ):  # fmt: skip
        if value not in known:
            raise InputError(f"--{name} '{value}' is not known", f"choose one of {', '.join(known)}")


def _jobs(
    adjusted: AdjustedBlock, groups: tuple[ImageGroup, ...], photographs: list[Path], out: Path, options: ImgeoOptions
) -> list[Job]:
    """Which group every file belongs to, by its name; nothing is written before all are known."""
    from aerotri.formats.files.photograph_files import match_files, photographs_in
    from aerotri.image_errors.ideal_photographs import check_photograph, name_of

    block = adjusted.block
    photographs = list(dict.fromkeys(photographs_in(photographs, ENDINGS)))
    jobs, taken = [], {}
    for path, row in zip(photographs, match_files(photographs, block.images.names).tolist(), strict=True):
        if row in block.interior_fits:
            raise InputError(
                "is scanned film, whose interior orientation imgeo does not resample", "use the correction grid", path
            )
        group = _named_group(groups, options.group, path) if row < 0 else _group_of(groups, row)
        check_photograph(path, groups[group].camera)
        # in the subfolder that the block knows the photograph by
        within = Path(str(block.images.names[row])).parent if row >= 0 else Path()
        name = (within / name_of(path)).as_posix() if not within.is_absolute() else name_of(path)
        if name in taken:
            raise InputError(f"'{name}' would be written twice, for {taken[name]} too", "give other names", path)
        if (out / name).exists() and (out / name).samefile(path):
            raise InputError("would be overwritten by its own correction", "choose another --out", path)
        taken[name] = path
        jobs.append(Job(path, group, name))
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


def _resample_all(
    jobs: list[Job], errors: dict[int, ErrorFunction], out: Path, options: ImgeoOptions, console: Console
) -> list[dict[str, Any]]:
    from aerotri.compiled import compilation_notice
    from aerotri.formats.files.atomic import atomic_file
    from aerotri.image_errors.ideal_map import ideal_map
    from aerotri.image_errors.ideal_photographs import ideal_photograph

    if jobs:
        console.progress(compilation_notice())
    maps: dict[int, IdealMap] = {}
    done = []
    for number, job in enumerate(jobs):
        if job.group not in maps:
            maps[job.group] = ideal_map(errors[job.group])

        def report(share: float, number: int = number) -> None:
            console.work("correcting", (number + share) / len(jobs), f"photograph {number + 1} of {len(jobs)}")

        started = time.perf_counter()
        (out / job.name).parent.mkdir(parents=True, exist_ok=True)
        with atomic_file(out / job.name) as place:
            lost = ideal_photograph(job.source, place, maps[job.group], options.resampling, options.compression, report)
        done.append({
            "file": str(job.source), "written": job.name, "group": errors[job.group].group,
            "left_out": list(lost), "seconds": round(time.perf_counter() - started, 3),
        })  # fmt: skip
    return done


def _tell(record: dict[str, Any], out: Path, console: Console, as_json: bool) -> None:
    if as_json:
        print(json.dumps(record, indent=2, ensure_ascii=False))
        return
    lines = []
    for group in record["groups"]:
        opencv, brown = (near["remaining_rms_um"] for near in group["nearest"])
        lines.append(
            f"{plain(group['ideal_camera'])}: image errors {group['d_rms_um']:.2f} µm RMS, {group['d_max_um']:.2f} at "
            f"most; the nearest OpenCV model leaves {opencv:.2f}, Brown's {brown:.2f} µm RMS"
        )
    for photograph in record["photographs"]:
        lost = f", without {', '.join(photograph['left_out'])}" if photograph["left_out"] else ""
        lines.append(f"{plain(photograph['written'])}: {photograph['seconds']:.1f} s{lost}")
    console.lines([*lines, f"Written to {out}: ideal camera in camera.toml, image errors in correction.csv"])
