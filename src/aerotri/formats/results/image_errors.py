"""Beside photographs without image errors: the ideal camera, and the image errors for other programs."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from aerotri.results.head import Head

if TYPE_CHECKING:
    from aerotri.image_errors.error_exports import NearestLens
    from aerotri.image_errors.error_function import ErrorFunction
    from aerotri.observations import Camera
    from aerotri.results.adjusted_block import AdjustedBlock

SIGN = "measured = ideal + d; corrected = measured - d"
RECORD = "imgeo.json"
EXPORTS = ("correction.csv", "camera.toml", "cameras.txt", "ideal_cameras.txt", "correction.tif",
           *(f"correction_{k}.tif" for k in range(1, 100)))  # fmt: skip
"""Names that older versions, whose records do not list them, gave their exports; of 99 cameras or groups at most."""
CORRECTION_HEAD = f"""# {SIGN}
# x y dx dy sx sy in mm from the image centre, y up; column row in pixels, (0, 0) the corner of the upper left pixel
# interpolate between nodes of one tile only; nodes on a seam stand here once for either side
camera,group,tile,column,row,x,y,dx,dy,sx,sy
"""


@dataclass(frozen=True, eq=False)
class Exports:
    """What is written beside the photographs.

    Parameters
    ----------
    record : of imgeo.json, without photographs and files. texts : content of text files by their names.
    rasters : image errors by the names of the rasters that hold them.
    """

    record: dict[str, Any]
    texts: dict[str, str]
    rasters: dict[str, ErrorFunction]

    @property
    def names(self) -> list[str]:
        """Of all files but the record."""
        return [*self.rasters, *self.texts]

    def write(self, out: Path) -> None:
        """Write the rasters and the texts into a folder, each whole or not at all.

        Raises
        ------
        InputError
            When the folder cannot be written to.
        """
        from aerotri.formats.files.atomic import atomic_file

        for name, function in self.rasters.items():
            _write_correction_raster(function, out / name)
        for name, text in self.texts.items():
            with atomic_file(out / name) as place:
                place.write_text(text, encoding="utf-8")


def exports_of(adjusted: AdjustedBlock, errors: Mapping[int, ErrorFunction], resampling: str) -> Exports:
    """Cameras and correction grids.

    Parameters
    ----------
    errors : of the groups in use, by their number in the block.
    resampling : of the photographs, for the record.
    """
    from aerotri.formats.text.toml_text import toml_of
    from aerotri.image_errors.error_exports import ideal_camera, nearest_opencv

    cameras = _camera_names(errors)
    nearest = {k: nearest_opencv(function) for k, function in errors.items()}
    records, tables, rasters = [], [], {}
    for number, (k, function) in enumerate(errors.items(), start=1):
        raster = "correction.tif" if len(errors) == 1 else f"correction_{number}.tif"
        rasters[raster] = function
        records.append(_group_record(function, nearest[k], cameras[k], raster))
        tables.append(_correction_rows(adjusted, function))
    ideal = {cameras[k]: _camera_table(function) for k, function in errors.items()}
    record = {
        **Head(adjusted.block.project, adjusted.block.crs).as_dict(), "block": str(adjusted.block.name), "sign": SIGN,
        "resampling": resampling,
        "groups": records, "photographs": [],
    }  # fmt: skip
    texts = {
        "correction.csv": CORRECTION_HEAD + "".join(tables),
        "camera.toml": toml_of({"camera": ideal}),
        "cameras.txt": _colmap_text({k: (cameras[k], found.camera, _left(found)) for k, found in nearest.items()}),
        "ideal_cameras.txt": _colmap_text(
            {k: (cameras[k], ideal_camera(function), "no image errors") for k, function in errors.items()}
        ),
    }
    return Exports(record, texts, rasters)


def older_files(out: Path) -> set[str]:
    """What the record of an older run in this folder says it has written."""
    try:
        record = json.loads((out / RECORD).read_text(encoding="utf-8"))
        written = {str(photograph["written"]) for photograph in record["photographs"]}
        # records of older versions do not list the exports, whose names are fixed
        return written | {str(name) for name in record.get("files", EXPORTS)}
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return set()


def _camera_names(errors: Mapping[int, ErrorFunction]) -> dict[int, str]:
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


def _group_record(errors: ErrorFunction, opencv: NearestLens, camera: str, raster: str) -> dict[str, Any]:
    from aerotri.image_errors.error_exports import correction_raster, nearest_brown

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
        "nearest": [_nearest_record(nearest) for nearest in (opencv, nearest_brown(errors))],
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


def _correction_rows(adjusted: AdjustedBlock, errors: ErrorFunction) -> str:
    from aerotri.image_errors import systematic_errors
    from aerotri.image_errors.error_exports import correction_nodes
    from aerotri.spreadsheet import plain_row

    nodes = correction_nodes(errors.camera)
    d = errors.of_measured(nodes.xy)
    _, covariance = systematic_errors(adjusted, errors.group, *nodes.xy.T, camera=errors.camera.name)
    sigma = np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 0.0))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    numbers = np.hstack([nodes.column_row, nodes.xy, d, sigma])
    for tile, row in zip(nodes.tile.tolist(), numbers.tolist(), strict=True):
        place = [f"{value:.3f}" for value in row[:2]]
        names = plain_row([errors.camera.name, errors.group])
        writer.writerow([*names, tile, *place, *(f"{value:.7f}" for value in row[2:])])
    return text.getvalue()


def _write_correction_raster(errors: ErrorFunction, path: Path) -> None:
    from aerotri.formats.files.atomic import atomic_file
    from aerotri.image_errors.error_exports import correction_raster
    from aerotri.rasters.images import write_grid

    camera = errors.camera
    values, cell = correction_raster(errors)
    half_x, half_y = camera.half_format_mm
    tags = {"SIGN": SIGN, "UNIT": "mm", "PLANE": "image coordinates, mm from the image centre, y up"}
    with atomic_file(path) as place:
        write_grid(
            place, values.astype(np.float32), (-half_x, half_y), cell * camera.pixel_mm, ("dx mm", "dy mm"), tags
        )


def _colmap_text(cameras: Mapping[int, tuple[str, Camera, str]]) -> str:
    """cameras.txt of COLMAP, of cameras with their names and a remark."""
    from aerotri.formats.foreign.colmap_cameras import colmap_camera

    lines = ["# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]"]
    for number, (name, camera, remark) in enumerate(cameras.values(), start=1):
        model, values = colmap_camera(camera)
        lines.append(f"# {number}: {one_line(name)}, {remark}")
        lines.append(" ".join([str(number), model, *(str(n) for n in camera.size_px), *(repr(v) for v in values)]))
    return "\n".join(lines) + "\n"


def _left(nearest: NearestLens) -> str:
    return f"as measured; the model leaves {nearest.rms_mm * 1e3:.2f} um RMS, {nearest.max_mm * 1e3:.2f} um at most"


def one_line(name: str) -> str:
    """A name that cannot end its line."""
    return "".join(c if c.isprintable() else " " for c in name)
