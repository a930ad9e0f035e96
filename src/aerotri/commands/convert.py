"""`aerotri convert`: between formats, and a block from several files at once; what the target cannot hold is said.

The source is a whole block (a block folder, a DBAT script, BAL, COLMAP, Bundler, OpenSfM), a folder of IGN or PAT-B
files, a file of image points (BINGO, PAT-B .im, IGN .mes, gcp_list.txt), or a list of orientations (photographs
alone). Positions, control points, orientations and more image points are added from further files, and the camera from
options or a file. Kinds of files are told from their content, or stated: ``kind:PATH``. Kinds:

- image points: bingo, patb-im, ign-mes, odm-gcp
- orientations: pix4d-eo, metashape, ign-opk, patb-ori, opk-list (photo X Y Z ω φ κ), opk-csv (columns by name)
- positions: csv (columns by name), pix4d-geo, odm-geo
- control: csv (columns by name), pix4d-gcp, ign-app, patb-con, odm-gcp (with its image points)

The commands for the public data sets stand in docs/validation/data.md.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from aerotri.commands.console import Console
from aerotri.conventions import FLIGHT_AXES, LARGEST, InputError
from aerotri.formats.assembly.camera_spec import CameraSpec
from aerotri.formats.results.json_text import json_text
from aerotri.formats.text.text_lines import is_number

if TYPE_CHECKING:
    from aerotri.formats.assembly.project import Request


def three_values(text: str, option: str, may_be_zero: bool = False) -> tuple[float, float, float] | None:
    """Three standard deviations of ``X,Y,Z``, or of one value for all; None for ''. 0, where it may be: without error.

    Raises
    ------
    InputError
    """
    if not text:
        return None
    words = [word.strip() for word in text.split(",")]
    least = 0.0 if may_be_zero else np.nextafter(0.0, 1.0)
    if len(words) not in (1, 3) or not all(is_number(word) and least <= float(word) <= LARGEST for word in words):
        size = "that are not negative" if may_be_zero else "greater than 0"
        raise InputError(f"{option} {text[:60]}", f"give three values {size}, as 0.1,0.1,0.2, or one for all")
    values = [float(word) for word in words] * (3 // len(words))
    return values[0], values[1], values[2]


def camera_spec(
    file: Path | None,
    name: str,
    size: str,
    pixel_um: float | None,
    focal_length_mm: float | None,
    flight_axis: str | None,
    free: bool,
) -> CameraSpec:
    """What the options say of the camera.

    Raises
    ------
    InputError
    """
    size_px = None
    if size:
        found = re.fullmatch(r"([1-9][0-9]{0,6})\s*[x×,]\s*([1-9][0-9]{0,6})", size.strip())
        if not found:
            raise InputError(
                f"--camera-size '{size[:60]}' is not a size in pixels", "give columns and rows, such as 8192x5460"
            )
        size_px = (int(found[1]), int(found[2]))
    if flight_axis is not None and flight_axis not in FLIGHT_AXES:
        raise InputError(
            f"--flight-axis '{flight_axis[:60]}' is not an image axis", f"give one of {', '.join(FLIGHT_AXES)}"
        )
    return CameraSpec(file, name, size_px, pixel_um, focal_length_mm, flight_axis, free)


def run_convert(
    request: Request, target: Path, to: Any, as_json: bool, overwrite: bool = False, in_place: bool = False
) -> None:
    """Convert; arguments as on the command line.

    Raises
    ------
    InputError
    """
    from aerotri.public.blocks import read_request
    from aerotri.public.converting import convert, imported_as_written, name_of_target, refuse_no_project, refuse_target

    if in_place:
        refuse_no_project(request.source, target, to)
    else:
        refuse_target(request.source, target, to, overwrite)
    found = read_request(replace(request, name=request.name or name_of_target(target, to)))
    geoid, tell = request.stated.geoid, Console().stage
    said = convert(found, target, to, geoid=geoid, in_place=in_place, overwrite=overwrite, progress=tell)
    messages = [*found.messages, *said]
    if to == "block" and not as_json and found.sources:
        record = imported_as_written(found)
        print("\n".join([*record.remarks, *record.lines(), f"Written to {target}"]))
        return
    if as_json:
        print(json_text({"target": str(target), "format": to, "messages": messages}, None))
        return
    print("\n".join([*messages, f"Written to {target}"]))


def run_convert_parts(request: Request, target: Path, to: str, parts: int, as_json: bool, in_place: bool) -> None:
    """Convert into parts; arguments as on the command line.

    Raises
    ------
    InputError
    """
    from aerotri.commands.divide import parts_in_words
    from aerotri.formats.block.folder import read_photographs
    from aerotri.partition.part_list import part_folders
    from aerotri.public.parts import convert_request_parts

    if to != "block" or in_place:
        option = "--in-place" if in_place else f"--to {to}"
        raise InputError(f"{option} does not go with --parts", "parts are block folders: leave it out")
    messages = convert_request_parts(request, target, parts=parts, progress=Console(quiet=as_json).stage)
    counts = {folder.name: len(read_photographs(folder)) for folder in part_folders(target)}
    if as_json:
        print(json_text({"target": str(target), "format": "block", "parts": counts, "messages": list(messages)}, None))
        return
    print("\n".join([*messages, parts_in_words(counts, parts), f"Written to {target}: aerotri adjust {target}"]))
