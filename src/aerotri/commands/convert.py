"""`aerotri convert`: between formats, and a block from several files at once; what the target cannot hold is said.

The source is a whole block (a block folder, a DBAT script, BAL, COLMAP, Bundler, OpenSfM), a folder of IGN or PAT-B
files, a file of image points (BINGO, PAT-B .im, IGN .mes, gcp_list.txt), or a list of orientations (photographs
alone). Positions, control points, orientations and more image points are added from further files, and the camera from
options or a file. Kinds of files are told from their content, or stated: ``kind:PATH``. Kinds:

- image points: bingo, patb-im, ign-mes, odm-gcp
- orientations: pix4d-eo, metashape, ign-opk, patb-ori, opk-list (photo X Y Z ω φ κ), opk-csv (columns by name)
- positions: csv (columns by name), pix4d-geo, odm-geo
- control: csv (columns by name), pix4d-gcp, ign-app, patb-con, odm-gcp (with its image points)

The data sets that stand beside the project:

.. code-block:: sh

    # 581 photographs, image points of BINGO, RTK positions, six control points named GCP02 here and GCP_GCP02 there
    aerotri convert ../shared/data/cu_sbr_p1/tp_bingo.txt cu_sbr_p1 \\
      --positions ../shared/data/cu_sbr_p1/gnss_positions.csv --gnss-shift off \\
      --control ../shared/data/cu_sbr_p1/control_points.csv --control-prefix GCP_ \\
      --camera-name P1 --camera-size 8192x5460 --pixel-um 4.27246 --focal-length-mm 35.01 --free-interior \\
      --image-sigma-px 0.5 --crs EPSG:32647

    # seven UltraCam Eagle M3: heights of .OPK above the geoid and corrected for scale, those of .app ellipsoidal; the
    # seventeen tie points alone do not hold them, so the orientations are observations too
    aerotri convert ../shared/data/ultracam_eagle_m3 eagle --pixel-um 4 --image-sigma-px 0.5 --crs EPSG:2154+5720 \\
      --geoid ../shared/data/ultracam_eagle_m3/fr_ign_RAF20.tif --control-heights ellipsoidal \\
      --linear-alteration 5 --control-sigma-m 0.05 --orientation-sigma-m 0.1 --orientation-sigma-deg 0.002

    # four DMC photographs: orientations and camera, no image points
    aerotri convert ../shared/data/dmc_ngi/camera_pos_ori.txt dmc --camera ../shared/data/dmc_ngi/config.yaml
"""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from aerotri.commands.console import Console
from aerotri.conventions import FLIGHT_AXES, LARGEST, InputError
from aerotri.formats.assembly.camera_spec import CameraSpec
from aerotri.formats.text.text_lines import is_number
from aerotri.public.folders import refuse_existing_file, refuse_foreign_entries

if TYPE_CHECKING:
    from aerotri.formats.assembly.oriented import OrientedBlock
    from aerotri.formats.assembly.parts import Reading
    from aerotri.formats.assembly.project import Request
    from aerotri.observations import Block


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
            raise InputError(f"--camera-size {size[:60]}", "give columns and rows, as 8192x5460")
        size_px = (int(found[1]), int(found[2]))
    if flight_axis is not None and flight_axis not in FLIGHT_AXES:
        raise InputError(f"--flight-axis {flight_axis[:60]}", f"it is one of {', '.join(FLIGHT_AXES)}")
    return CameraSpec(file, name, size_px, pixel_um, focal_length_mm, flight_axis, free)


def run_convert(request: Request, target: Path, to: str, as_json: bool, overwrite: bool = False) -> None:
    """Convert; arguments as on the command line.

    Raises
    ------
    InputError
    """
    from aerotri.formats.convert import FOLDER_TARGETS, TARGETS

    if to not in TARGETS:
        raise InputError(f"'{to}' is not a format that is written", f"known are {', '.join(TARGETS)}")
    source = Path(request.source)
    if target.resolve() == source.resolve():
        raise InputError("source and target are the same", "choose another target", target)
    if to in FOLDER_TARGETS:
        refuse_foreign_entries(target, FOLDER_TARGETS[to], overwrite)
    else:
        refuse_existing_file(target, overwrite)
    is_result = (source / "solution.npz").is_file()
    messages = _from_result(request, target, to) if is_result else _from_files(request, target, to)
    if as_json:
        print(json.dumps({"target": str(target), "format": to, "messages": list(messages)}, ensure_ascii=False))
        return
    for sentence in messages:
        print(sentence)
    print(f"Written to {target}")


def _from_files(request: Request, target: Path, to: str) -> tuple[str, ...]:
    from aerotri.formats.assembly.project import read_project
    from aerotri.formats.convert import BLOCK_WRITERS, ORIENTATION_WRITERS, write_any, write_oriented

    if to == "block":
        request = replace(request, name=request.name or target.resolve().name)
    reading = read_project(request)
    geoid = request.stated.geoid
    reading = replace(reading, messages=(*reading.messages, *_about_held(reading.block)))
    if to == "block" or to in BLOCK_WRITERS:
        return (*reading.messages, *write_any(reading.block, target, to, reading.points))
    if to in ORIENTATION_WRITERS:
        oriented, said = _at_start_values(reading, to)
    else:
        oriented, said = _with_points(reading), ()
    if oriented is None:
        oriented = _adjusted(reading.block, request)
    return (*reading.messages, *said, *write_oriented(oriented, target, to, geoid))


def _about_held(block: Block) -> tuple[str, ...]:
    """A sentence about control without error."""
    count = int((block.control.sigma[~block.control.is_check] == 0.0).sum())
    return (f"{count} coordinates of control points have σ = 0: an adjustment holds them",) if count else ()


def _from_result(request: Request, target: Path, to: str) -> tuple[str, ...]:
    """Orientation and points of a result of `aerotri adjust`."""
    from aerotri.formats.assembly.oriented import oriented_from_adjusted
    from aerotri.formats.block.folder import read_block
    from aerotri.formats.convert import BLOCK_WRITERS, write_any, write_oriented
    from aerotri.opening import open_result

    if request != type(request)(request.source, request.name, stated=request.stated):
        raise InputError("a result is whole", "leave out what would add to it", request.source)
    source = Path(request.source)
    block = read_block(source / "block")
    if to == "block" or to in BLOCK_WRITERS:
        return write_any(block, target, to)
    return write_oriented(oriented_from_adjusted(open_result(source).result), target, to, request.stated.geoid)


def _at_start_values(reading: Reading, to: str) -> tuple[OrientedBlock | None, tuple[str, ...]]:
    """The block at the orientations it came with; None where it has none and the format needs them."""
    from aerotri.formats.assembly.oriented import OrientedBlock
    from aerotri.functional_model.rotation import rotation_from_angles

    block = reading.block
    rotation = rotation_from_angles(block.images.angles, block.rotation)
    unknown = np.full((len(block.points), 3), np.nan)
    points = unknown if reading.points is None else reading.points
    used = np.ones(len(block.image_points), bool)
    oriented = OrientedBlock(block, block.images.centre, rotation, points, used)
    if oriented.oriented.any():
        return oriented, ("orientations are those that the files gave, not adjusted",)
    return (oriented, ()) if to == "patb" else (None, ())


def _with_points(reading: Reading) -> OrientedBlock | None:
    from aerotri.formats.assembly.oriented import oriented_block

    return None if reading.points is None else oriented_block(reading.block, reading.points)


def _adjusted(block: Block, request: Request) -> OrientedBlock:
    """The block adjusted for the purpose.

    Raises
    ------
    InputError
        When that fails.
    """
    from aerotri.compiled import compilation_notice
    from aerotri.formats.assembly.oriented import oriented_from_adjusted
    from aerotri.pipeline import AdjustmentFailedError, adjust_keeping_system

    if not len(block.image_points):
        raise InputError("holds no image points", "the target needs object points", request.source)
    console = Console()
    console.progress(compilation_notice())
    try:
        done = adjust_keeping_system(block, console.iteration, geoid=request.stated.geoid)
    except AdjustmentFailedError as failure:
        raise InputError(
            f"the block has to be adjusted first, and that failed: {failure}", "mend the block", request.source
        ) from None
    return oriented_from_adjusted(done.result)
