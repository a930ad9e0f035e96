"""What the user states beside the photographs, read from its files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.formats.assembly import kinds
from aerotri.formats.assembly.assemble import Statements
from aerotri.formats.assembly.by_stamps import named_by_stamps
from aerotri.formats.assembly.camera_spec import CameraSpec, cameras_of
from aerotri.formats.assembly.imported import (
    CAMERA,
    PHOTOGRAPHS,
    ImportSource,
    sources_of_lists,
)
from aerotri.formats.assembly.parts import PointList, PositionList
from aerotri.tie_points.given import Given
from aerotri.tie_points.photographs import PhotographSet, StatedCamera


@dataclass(frozen=True)
class GivenFiles:
    """Files beside the photographs, PATH or kind:PATH, '' for none.

    Parameters
    ----------
    control : control points, with their image points where they were marked.
    check : names of those that are check points.
    positions : of the photographs, in place of EXIF. orientation : in place of a first orientation.
    time_stamps : file or folder of time stamps, where `positions` is a trajectory; '' for those beside the photographs.
    """

    control: str = ""
    check: Sequence[str] = ()
    positions: str = ""
    orientation: str = ""
    stated: Statements = field(default_factory=Statements)
    time_stamps: str = ""


def stated_camera(spec: CameraSpec) -> StatedCamera:
    """The cameras of a file, or what is stated in place of EXIF.

    Raises
    ------
    InputError
        When the file holds no camera.
    """
    if spec.file is None:
        return StatedCamera((), spec.focal_length_mm, spec.pixel_um)
    nothing = np.zeros(0)
    return StatedCamera(cameras_of(spec, (), nothing.astype(str), nothing))


def read_given(files: GivenFiles, mark_sigma_px: float, photographs: PhotographSet | None = None) -> Given:
    """Read the files.

    Parameters
    ----------
    mark_sigma_px : σ of the image points of control.
    photographs : which positions at time stamps are given to; None where there are no such.

    Raises
    ------
    InputError
        For a file that cannot be read, or check points without control.
    """
    stated, reading = files.stated, kinds.options_of(files.stated)
    if files.check and not files.control:
        raise InputError("--check names control points, and there are none", "give them: --gcp gcp_list.txt")
    if stated.columns and not (files.control or files.positions):
        raise InputError("--columns is given, but no list of points", "give it: --gcp FILE, or --positions FILE")
    if files.time_stamps and not files.positions:
        raise InputError("--time-stamps is given, but no trajectory", "give it: --positions FILE")
    of_positions = reading.beside_control() if files.control else reading
    control = None
    if files.control:
        control = _with_prefix(kinds.read_control(files.control, reading), stated.control_prefix)
    return Given(
        # the names have the prefix already
        stated=replace(stated, control_prefix=""),
        positions=_positions(files, of_positions, photographs) if files.positions else None,
        control=control,
        check=tuple(_in_block(name, control, stated.control_prefix) for name in files.check),
        orientation=kinds.read_orientations(files.orientation, reading) if files.orientation else None,
        mark_sigma_px=mark_sigma_px,
    )


def sources_of_photographs(
    photographs: PhotographSet, folder: FilePath, files: GivenFiles, camera: FilePath | None
) -> tuple[ImportSource, ...]:
    """The folder of photographs and the files beside it, as they were read.

    Raises
    ------
    InputError
        When a file is no longer there.
    """
    reading = kinds.options_of(files.stated)
    models = ", ".join(one.name for one in photographs.cameras) if camera is None else ""
    found = [ImportSource(str(folder), PHOTOGRAPHS, "EXIF and XMP", models)]
    found += sources_of_lists(files, reading, photographs.folder)
    if camera is not None:
        found.append(ImportSource(str(camera), CAMERA))
    return tuple(found)


def _positions(files: GivenFiles, reading: kinds.ReadingOptions, photographs: PhotographSet | None) -> PositionList:
    """The positions of a file, under the names of the photographs."""
    folder = None if photographs is None else photographs.folder
    found = kinds.read_position_list(files.positions, reading, files.time_stamps, folder)
    if photographs is None:
        return found
    time = np.full(len(photographs), np.nan) if photographs.time is None else photographs.time
    return named_by_stamps(found, photographs.names, time)


def _in_block(name: str, control: PointList | None, prefix: str) -> str:
    """The name of a check point as the block has it, whether it was given with the prefix or without."""
    known = () if control is None else control.points.tolist()
    return prefix + name if name not in known and prefix + name in known else name


def _with_prefix(control: PointList, prefix: str) -> PointList:
    """The control points under the names they have in the block."""
    if not prefix:
        return control
    rays = control.rays
    if rays is not None:
        rays = replace(rays, points=np.array([prefix + name for name in rays.points.tolist()], dtype=str))
    return replace(control, points=np.array([prefix + name for name in control.points.tolist()], dtype=str), rays=rays)
