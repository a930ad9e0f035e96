"""`aerotri imgeo`: photographs without systematic image errors, their camera, and the errors for other programs."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from aerotri.commands.console import Console
from aerotri.conventions import InputError

if TYPE_CHECKING:
    from aerotri.image_errors import ImageGroup
    from aerotri.image_errors.error_exports import NearestLens
    from aerotri.image_errors.error_function import ErrorFunction
    from aerotri.image_errors.ideal_photographs import IdealMap
    from aerotri.observations import Camera
    from aerotri.statistics.adjusted_block import AdjustedBlock

SIGN = "measured = ideal + d; corrected = measured - d"
RECORD = "imgeo.json"


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


def run_imgeo(result: Path, photographs: list[Path], out: Path, options: ImgeoOptions, as_json: bool) -> None:
    """Resample and export; arguments as on the command line.

    Raises
    ------
    InputError
    """
    console = Console(quiet=as_json)
    refuse_foreign_folder(out)
    _check_options(options)
    from aerotri.image_errors import image_groups
    from aerotri.image_errors.error_function import error_function

    adjusted = _read_result(result, console)
    groups = image_groups(adjusted.block)
    jobs = _jobs(adjusted, groups, photographs, out, options)
    used = sorted({job.group for job in jobs}) if jobs else range(len(groups))
    errors = {k: error_function(adjusted, groups[k]) for k in used}
    record = _export(adjusted, errors, out, options)
    record["photographs"] = _resample_all(jobs, errors, out, options, console)
    _write_json(record, out / RECORD)
    _tell(record, out, console, as_json)


def refuse_foreign_folder(out: Path) -> None:
    """Results stand beside older ones of this command, or in an empty folder.

    Raises
    ------
    InputError
    """
    if out.is_dir() and any(out.iterdir()) and not (out / RECORD).exists():
        raise InputError(f"'{out}' holds other files", "choose another --out, or an empty folder")


def _check_options(options: ImgeoOptions) -> None:
    from aerotri.image_errors.ideal_photographs import RESAMPLINGS
    from aerotri.rasters_images import COMPRESSIONS

    for name, value, known in (
        ("resampling", options.resampling, RESAMPLINGS), ("compression", options.compression, COMPRESSIONS)
    ):  # fmt: skip
        if value not in known:
            raise InputError(f"--{name} '{value}' is not known", f"choose one of {', '.join(known)}")


def _read_result(result: Path, console: Console) -> AdjustedBlock:
    from aerotri.compiled import compilation_notice
    from aerotri.formats.block_folder import read_block
    from aerotri.formats.solution import read_solution
    from aerotri.pipeline import reopen

    if not (result / "solution.npz").is_file():
        raise InputError("holds no adjustment", "give the folder that `aerotri adjust` wrote", result)
    console.progress(compilation_notice())
    saved = read_solution(result / "solution.npz")
    if saved.status != "converged":
        raise InputError(f"the adjustment ended '{saved.status}'", "correct photographs by a converged one", result)
    return reopen(read_block(result / "block"), saved).result


def _jobs(
    adjusted: AdjustedBlock, groups: tuple[ImageGroup, ...], photographs: list[Path], out: Path, options: ImgeoOptions
) -> list[Job]:
    """Which group every file belongs to, by its name; nothing is written before all are known."""
    from aerotri.formats.names_match import match_photographs
    from aerotri.image_errors.ideal_photographs import name_of

    block = adjusted.block
    names = np.array([path.name for path in photographs], dtype=str)
    rows, _ = match_photographs(names, block.images.names) if len(names) else (np.zeros(0, np.int64), 0)
    jobs, taken = [], {}
    for path, row in zip(photographs, rows.tolist(), strict=True):
        if not path.is_file():
            raise InputError("there is no such file", "give a photograph, TIFF or JPEG", path)
        if row in block.interior_fits:
            raise InputError(
                "is scanned film, whose interior orientation imgeo does not resample", "use the correction grid", path
            )
        group = _named_group(groups, options.group, path) if row < 0 else _group_of(groups, row)
        name = name_of(path)
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


def _export(
    adjusted: AdjustedBlock, errors: dict[int, ErrorFunction], out: Path, options: ImgeoOptions
) -> dict[str, Any]:
    """Cameras and correction grids; the record of the run without its photographs, written as well."""
    from aerotri.formats.atomic import atomic_file
    from aerotri.formats.result import adjustment_json
    from aerotri.formats.toml_text import toml_of

    cameras = _camera_names(errors)
    records, tables = [], []
    for number, (k, function) in enumerate(errors.items(), start=1):
        raster = "correction.tif" if len(errors) == 1 else f"correction_{number}.tif"
        records.append(_group_record(function, cameras[k], raster))
        tables.append(_correction_rows(adjusted, function))
        _write_correction_raster(function, out / raster)
    ideal = {cameras[k]: _camera_table(function) for k, function in errors.items()}
    content = adjustment_json(adjusted)
    record = {
        "aerotri": content["aerotri"], "block": content["block"], "sign": SIGN, "resampling": options.resampling,
        "groups": records, "photographs": [],
    }  # fmt: skip
    texts = {
        "correction.csv": CORRECTION_HEAD + "".join(tables),
        "camera.toml": toml_of({"camera": ideal}),
        "cameras.txt": _colmap_text(errors, cameras, as_measured=True),
        "ideal_cameras.txt": _colmap_text(errors, cameras, as_measured=False),
    }
    for name, text in texts.items():
        with atomic_file(out / name) as place:
            place.write_text(text, encoding="utf-8")
    _write_json(record, out / RECORD)
    return record


def _camera_names(errors: dict[int, ErrorFunction]) -> dict[int, str]:
    """A name for the camera of every group: its own, with the group where several groups share it."""
    own = [function.camera.name for function in errors.values()]
    return {
        k: f.camera.name if own.count(f.camera.name) == 1 else f"{f.camera.name} {f.group}" for k, f in errors.items()
    }


def _camera_table(errors: ErrorFunction) -> dict[str, Any]:
    """The ideal camera as block.toml has it; what is not named is held."""
    from aerotri.image_errors.error_exports import ideal_camera

    camera = ideal_camera(errors)
    table = {
        "model": camera.model,
        "size_px": list(camera.size_px),
        "pixel_um": camera.pixel_um,
        "focal_length_mm": camera.focal_length_mm,
        "principal_point_mm": list(camera.principal_point_mm),
    }
    return table | ({} if camera.flight_axis is None else {"flight_axis": camera.flight_axis})


def _group_record(errors: ErrorFunction, camera: str, raster: str) -> dict[str, Any]:
    from aerotri.image_errors.error_exports import correction_raster, nearest_brown, nearest_opencv

    length = np.hypot(*correction_raster(errors)[0]) * 1e3
    return {
        "group": errors.group,
        "camera": errors.camera.name,
        "ideal_camera": camera,
        "focal_length_mm": float(errors.interior[0]),
        "x0_mm": float(errors.interior[1]),
        "y0_mm": float(errors.interior[2]),
        "d_rms_um": float(np.sqrt(np.mean(length**2))),
        "d_max_um": float(length.max()),
        "correction_raster": raster,
        "nearest": [_nearest_record(nearest) for nearest in (nearest_opencv(errors), nearest_brown(errors))],
    }


def _nearest_record(nearest: NearestLens) -> dict[str, Any]:
    camera = nearest.camera
    priors = {**camera.interior, **camera.lens, **camera.brown}
    return {
        "model": nearest.model,
        "parameters": {name: prior.value for name, prior in priors.items()},
        "remaining_rms_um": nearest.rms_mm * 1e3,
        "remaining_max_um": nearest.max_mm * 1e3,
    }


CORRECTION_HEAD = f"""# {SIGN}
# x y dx dy sx sy in mm from the image centre, y up; column row in pixels, (0, 0) the corner of the upper left pixel
# interpolate between nodes of one tile only; nodes on a seam stand here once for either side
camera,group,tile,column,row,x,y,dx,dy,sx,sy
"""


def _correction_rows(adjusted: AdjustedBlock, errors: ErrorFunction) -> str:
    import csv
    import io

    from aerotri.image_errors import systematic_errors
    from aerotri.image_errors.error_exports import correction_nodes

    nodes = correction_nodes(errors.camera)
    d = errors.of_measured(nodes.xy)
    _, covariance = systematic_errors(adjusted, errors.group, *nodes.xy.T, camera=errors.camera.name)
    sigma = np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 0.0))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    numbers = np.hstack([nodes.column_row, nodes.xy, d, sigma])
    for tile, row in zip(nodes.tile.tolist(), numbers.tolist(), strict=True):
        place = [f"{value:.3f}" for value in row[:2]]
        writer.writerow([errors.camera.name, errors.group, tile, *place, *(f"{value:.7f}" for value in row[2:])])
    return text.getvalue()


def _write_correction_raster(errors: ErrorFunction, path: Path) -> None:
    from aerotri.formats.atomic import atomic_file
    from aerotri.image_errors.error_exports import correction_raster
    from aerotri.rasters_images import write_grid

    camera = errors.camera
    values, cell = correction_raster(errors)
    half_x, half_y = camera.half_format_mm
    tags = {"SIGN": SIGN, "UNIT": "mm", "PLANE": "image coordinates, mm from the image centre, y up"}
    with atomic_file(path) as place:
        write_grid(
            place, values.astype(np.float32), (-half_x, half_y), cell * camera.pixel_mm, ("dx mm", "dy mm"), tags
        )


def _colmap_text(errors: dict[int, ErrorFunction], names: dict[int, str], as_measured: bool) -> str:
    """cameras.txt of COLMAP: of the photographs as they were taken by the nearest lens, or of the ideal ones."""
    from aerotri.formats.colmap import colmap_camera
    from aerotri.image_errors.error_exports import ideal_camera, nearest_opencv

    lines = ["# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]"]
    for number, (k, function) in enumerate(errors.items(), start=1):
        told, camera = "without systematic image errors", ideal_camera(function)
        if as_measured:
            nearest = nearest_opencv(function)
            camera = nearest.camera
            left = f"{nearest.rms_mm * 1e3:.2f} um RMS, {nearest.max_mm * 1e3:.2f} um at most"
            told = f"as measured; the model leaves {left}"
        lines.append(f"# {number}: {_plain(names[k])}, {told}")
        lines.append(_colmap_line(number, camera, *colmap_camera(camera)))
    return "\n".join(lines) + "\n"


def _colmap_line(number: int, camera: Camera, model: str, values: list[float]) -> str:
    return " ".join([str(number), model, *(str(n) for n in camera.size_px), *(repr(float(v)) for v in values)])


def _plain(name: str) -> str:
    """A name that cannot end its line."""
    return "".join(c if c.isprintable() else " " for c in name)


def _resample_all(
    jobs: list[Job], errors: dict[int, ErrorFunction], out: Path, options: ImgeoOptions, console: Console
) -> list[dict[str, Any]]:
    from aerotri.compiled import compilation_notice
    from aerotri.formats.atomic import atomic_file
    from aerotri.image_errors.ideal_photographs import ideal_map, ideal_photograph

    if jobs:
        console.progress(compilation_notice())
    maps: dict[int, IdealMap] = {}
    done, begun = [], time.perf_counter()
    for number, job in enumerate(jobs):
        if job.group not in maps:
            maps[job.group] = ideal_map(errors[job.group])

        def report(share: float, number: int = number) -> None:
            whole = (number + share) / len(jobs)
            left = (time.perf_counter() - begun) * (1.0 - whole) / whole
            console.progress(f"photograph {number + 1} of {len(jobs)}: {100 * share:.0f} %, {left:.0f} s left")

        started = time.perf_counter()
        with atomic_file(out / job.name) as place:
            lost = ideal_photograph(job.source, place, maps[job.group], options.resampling, options.compression, report)
        done.append({
            "file": str(job.source), "written": job.name, "group": errors[job.group].group,
            "left_out": list(lost), "seconds": round(time.perf_counter() - started, 3),
        })  # fmt: skip
    return done


def _write_json(record: dict[str, Any], path: Path) -> None:
    from aerotri.formats.atomic import atomic_file

    text = json.dumps(record, indent=2, ensure_ascii=False, allow_nan=False)
    with atomic_file(path) as place:
        place.write_text(text + "\n", encoding="utf-8")


def _tell(record: dict[str, Any], out: Path, console: Console, as_json: bool) -> None:
    if as_json:
        print(json.dumps(record, indent=2, ensure_ascii=False))
        return
    lines = []
    for group in record["groups"]:
        opencv, brown = (near["remaining_rms_um"] for near in group["nearest"])
        lines.append(
            f"{_plain(group['ideal_camera'])}: image errors {group['d_rms_um']:.2f} µm RMS, {group['d_max_um']:.2f} at "
            f"most; the nearest OpenCV model leaves {opencv:.2f}, Brown's {brown:.2f} µm RMS"
        )
    for photograph in record["photographs"]:
        lost = f", without {', '.join(photograph['left_out'])}" if photograph["left_out"] else ""
        lines.append(f"{_plain(photograph['written'])}: {photograph['seconds']:.1f} s{lost}")
    console.lines([*lines, f"Written to {out}: ideal camera in camera.toml, image errors in correction.csv"])
