"""Where blocks come from: folders and foreign formats."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from aerotri.observations import Block

if TYPE_CHECKING:
    import numpy as np

PathLike = str | os.PathLike
GnssShift = Literal["off", "block", "strip"]


def as_block(block: Block | PathLike) -> Block:
    """The block itself, or the one of a folder.

    Raises
    ------
    InputError
        For anything the block format does not allow.
    """
    return block if isinstance(block, Block) else read_block(block)


def read_block(folder: PathLike) -> Block:
    """A block from its folder.

    Parameters
    ----------
    folder : with block.toml and its tables, or the block.toml itself.

    Returns
    -------
    Block

    Raises
    ------
    InputError
        With file, line, what is wrong and the remedy, for anything the format does not allow.

    Examples
    --------
    >>> import aerotri, tempfile
    >>> with tempfile.TemporaryDirectory() as place:
    ...     folder = aerotri.simulate(aerotri.example_flight(), seed=1).save(f"{place}/flight")
    ...     block = aerotri.read_block(folder)
    >>> len(block.images)
    12
    """
    from aerotri.formats.block import folder as block_folder

    return block_folder.read_block(folder)


@dataclass(frozen=True, eq=False)
class ReadBlock:
    """A block from files of other programs.

    Parameters
    ----------
    block : what was read.
    points : (N, 3) m, object points that came along, as start values; None where none did.
    messages : what was matched, assumed or left out, in sentences.
    """

    block: Block
    points: np.ndarray | None
    messages: tuple[str, ...]


def read(
    source: PathLike,
    *,
    image_points: Sequence[PathLike] = (),
    positions: PathLike | None = None,
    control: PathLike | None = None,
    orientation: PathLike | None = None,
    check: Sequence[str] = (),
    crs: str = "",
    camera: PathLike | None = None,
    camera_name: str = "",
    camera_size: tuple[int, int] | None = None,
    pixel_um: float | None = None,
    focal_length_mm: float | None = None,
    flight_axis: Literal["+x", "-x", "+y", "-y"] | None = None,
    free_interior: bool = False,
    image_sigma_px: float | None = None,
    control_prefix: str = "",
    control_sigma_m: tuple[float, float, float] | None = None,
    positions_sigma_m: tuple[float, float, float] | None = None,
    gnss_shift: GnssShift | None = None,
    geoid: PathLike | None = None,
) -> ReadBlock:
    """A block from files of other programs; several files make one block.

    Parameters
    ----------
    source : block, result, DBAT, BAL, COLMAP, Bundler, OpenSfM, a folder of IGN or PAT-B files, image points (BINGO,
        .im, .mes, gcp_list.txt) or a list of orientations; PATH, or kind:PATH where the kind cannot be told.
    image_points : more files of image points.
    positions : observed positions of the photographs. control : control points.
    orientation : start values of the orientations.
    check : names of control points that become check points.
    crs : coordinate system, such as 'EPSG:32647' or 'EPSG:25832+7837'.
    camera : file with the camera.
    camera_name : name of the camera, where no file says it. The same of the four that follow.
    camera_size : columns and rows.
    pixel_um : size of a pixel, µm.
    focal_length_mm : principal distance.
    flight_axis : image axis that points along the flight.
    free_interior : principal distance and principal point are unknowns.
    image_sigma_px : σ of image coordinates, pixels.
    control_prefix : what image points have before the names of control points.
    control_sigma_m, positions_sigma_m : σ of X, Y, Z, m, where the files give none.
    gnss_shift : estimate a shift of the GNSS positions, of the block or of every strip.
    geoid : grid of geoid undulations for heights of the coordinate system.

    Returns
    -------
    ReadBlock

    Raises
    ------
    InputError
        For whatever is missing, damaged or contradictory, naming the file.
    """
    from aerotri.formats.assembly.assemble import Statements
    from aerotri.formats.assembly.camera_spec import CameraSpec
    from aerotri.formats.assembly.project import Request, read_project

    spec = CameraSpec(camera, camera_name, camera_size, pixel_um, focal_length_mm, flight_axis, free_interior)
    stated = Statements(
        crs=crs,
        geoid=geoid,
        control_sigma_m=control_sigma_m,
        positions_sigma_m=positions_sigma_m,
        control_prefix=control_prefix,
    )
    request = Request(
        source=_text(source),
        name="",
        image_points=tuple(_text(path) for path in image_points),
        orientation=_text(orientation),
        positions=_text(positions),
        control=_text(control),
        camera=spec,
        stated=stated,
        check=tuple(check),
        image_sigma_px=image_sigma_px,
        gnss_shift=gnss_shift,
    )
    reading = read_project(request)
    return ReadBlock(reading.block, reading.points, tuple(reading.messages))


def _text(path: PathLike | None) -> str:
    return "" if path is None else os.fspath(path)
