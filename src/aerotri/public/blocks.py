"""Where blocks come from: folders and foreign formats."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from aerotri.conventions import FilePath, InputError
from aerotri.observations import Block

if TYPE_CHECKING:
    import numpy as np

    from aerotri.formats.assembly.imported import ImportRecord, ImportSource
    from aerotri.formats.assembly.project import Request

Sigmas = tuple[float, float, float]
GnssShift = Literal["off", "block", "strip"]
FlightAxis = Literal["+x", "-x", "+y", "-y"]
ControlHeights = Literal["crs", "ellipsoidal"]
Axes = Literal["xy", "yx"]
PatbRotation = Literal["camera-to-object", "object-to-camera"]


def as_block(block: Block | FilePath) -> Block:
    """The block itself, or the one of a folder.

    Raises
    ------
    InputError
        For anything the block format does not allow.
    """
    return block if isinstance(block, Block) else read_block(block)


def read_block(folder: FilePath) -> Block:
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


@dataclass(frozen=True, eq=False, repr=False)
class ReadBlock:
    """A block from files of other programs.

    Parameters
    ----------
    block : what was read.
    points : (N, 3) m, object points that came along, as start values; None where none did.
    messages : what was matched, assumed or left out, in sentences.
    source : what was read, as it was stated.
    is_result : whether that is the folder of a result; its block is the one that was adjusted.
    sources : files and folders that were read, with their formats.
    """

    block: Block
    points: np.ndarray | None
    messages: tuple[str, ...]
    source: str = ""
    is_result: bool = False
    sources: tuple[ImportSource, ...] = ()

    @property
    def imported(self) -> ImportRecord:
        """What was taken, what was assumed, and what was left behind: the content of import.json."""
        from aerotri.formats.assembly.imported import ImportRecord

        return ImportRecord(self.block, self.sources, self.messages)

    def __repr__(self) -> str:
        block = self.block
        return (
            f"<aerotri.ReadBlock {block.name!r}: {len(block.images)} photographs, {len(block.image_points)} image "
            f"points of {len(block.points)} points>"
        )

    def _repr_html_(self) -> str:
        """What was read, and what is to be known about it."""
        said = "".join(f"<li>{escape(text)}</li>" for text in self.messages)
        return f"<div><b>{escape(repr(self)[1:-1])}</b><ul>{said}</ul></div>"


def read(
    source: FilePath,
    *,
    name: str = "",
    image_points: Sequence[FilePath] = (),
    positions: FilePath | None = None,
    control: FilePath | None = None,
    orientation: FilePath | None = None,
    check: Sequence[str] = (),
    crs: str = "",
    camera: FilePath | None = None,
    camera_name: str = "",
    camera_size: tuple[int, int] | None = None,
    pixel_um: float | None = None,
    focal_length_mm: float | None = None,
    flight_axis: FlightAxis | None = None,
    free_interior: bool = False,
    image_sigma_um: float | None = None,
    image_sigma_px: float | None = None,
    control_prefix: str = "",
    control_sigma_m: Sigmas | None = None,
    control_heights: ControlHeights = "crs",
    positions_sigma_m: Sigmas | None = None,
    orientation_sigma_m: Sigmas | None = None,
    orientation_sigma_deg: Sigmas | None = None,
    gnss_shift: GnssShift | None = None,
    geoid: FilePath | None = None,
    axes: Axes | None = None,
    columns: str = "",
    offset: FilePath | None = None,
    patb_rotation: PatbRotation | None = None,
    linear_alteration_m: float | None = None,
    station_pattern: str = "",
    rig_reference: str = "",
    time_stamps: FilePath | None = None,
) -> ReadBlock:
    """A block from files of other programs; several files make one block.

    Parameters
    ----------
    source : block, result, DBAT, BAL, COLMAP, Bundler, OpenSfM, Metashape (.psx, .psz, cameras XML), a folder of IGN or
        PAT-B files, image points (BINGO, .im, .mes, gcp_list.txt) or a list of orientations; PATH, or kind:PATH where
        the kind cannot be told.
    name : of the block; that of the source where ''.
    image_points : more files of image points.
    positions : observed positions of the photographs: a list, a trajectory (RTKLIB, GrafNav), or time stamps (.MRK).
    control : control points.
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
    image_sigma_um : σ of image coordinates, µm.
    image_sigma_px : the same in pixels.
    control_prefix : what image points have before the names of control points.
    control_sigma_m : σ of X, Y, Z, m, of control points where the files give none; 0: without error, held.
    control_heights : 'ellipsoidal' where the list has such heights and the coordinate system others.
    positions_sigma_m : σ of X, Y, Z, m, of positions where the files give none.
    orientation_sigma_m : orientations are observations: σ of X, Y, Z, m.
    orientation_sigma_deg : the same of ω, φ, κ, degrees.
    gnss_shift : estimate a shift of the GNSS positions, of the block or of every strip.
    geoid : grid of geoid undulations for heights of the coordinate system.
    axes : 'yx' where lists that do not name their columns have Y, or the latitude, first; as their coordinate
        system has them where None. Lists with an order of their own: X and Y change places, of the control points
        alone where there are any.
    columns : of such a list of control points (of positions where there are none): letters such as 'PNEZD', or names
        separated by commas.
    offset : _offset.xyz of Pix4D, added to orientations.
    patb_rotation : meaning of the matrices of an .ori file; told by the image points where None.
    linear_alteration_m : m, mean height of the ground, where heights of orientations are corrected for the scale of the
        projection.
    station_pattern : where exposure and camera of a rig stand in the names of the photographs, such as
        'IMG_{station}_{camera}.tif'; the block gets a rigid rig.
    rig_reference : its reference camera, as in the names; that with most photographs where ''.
    time_stamps : when the photographs were taken, where `positions` is a trajectory: file .MRK, or a folder of them.

    Returns
    -------
    ReadBlock

    Raises
    ------
    InputError
        For whatever is missing, damaged or contradictory, naming the file.
    """
    return read_request(
        request_of(
            source,
            name=name,
            image_points=image_points,
            positions=positions,
            control=control,
            orientation=orientation,
            check=check,
            crs=crs,
            camera=camera,
            camera_name=camera_name,
            camera_size=camera_size,
            pixel_um=pixel_um,
            focal_length_mm=focal_length_mm,
            flight_axis=flight_axis,
            free_interior=free_interior,
            image_sigma_um=image_sigma_um,
            image_sigma_px=image_sigma_px,
            control_prefix=control_prefix,
            control_sigma_m=control_sigma_m,
            control_heights=control_heights,
            positions_sigma_m=positions_sigma_m,
            orientation_sigma_m=orientation_sigma_m,
            orientation_sigma_deg=orientation_sigma_deg,
            gnss_shift=gnss_shift,
            geoid=geoid,
            axes=axes,
            columns=columns,
            offset=offset,
            patb_rotation=patb_rotation,
            linear_alteration_m=linear_alteration_m,
            station_pattern=station_pattern,
            rig_reference=rig_reference,
            time_stamps=time_stamps,
        )
    )


def request_of(
    source: FilePath,
    *,
    name: str = "",
    image_points: Sequence[FilePath] = (),
    positions: FilePath | None = None,
    control: FilePath | None = None,
    orientation: FilePath | None = None,
    check: Sequence[str] = (),
    crs: str = "",
    camera: FilePath | None = None,
    camera_name: str = "",
    camera_size: tuple[int, int] | None = None,
    pixel_um: float | None = None,
    focal_length_mm: float | None = None,
    flight_axis: FlightAxis | None = None,
    free_interior: bool = False,
    image_sigma_um: float | None = None,
    image_sigma_px: float | None = None,
    control_prefix: str = "",
    control_sigma_m: Sigmas | None = None,
    control_heights: ControlHeights = "crs",
    positions_sigma_m: Sigmas | None = None,
    orientation_sigma_m: Sigmas | None = None,
    orientation_sigma_deg: Sigmas | None = None,
    gnss_shift: GnssShift | None = None,
    geoid: FilePath | None = None,
    axes: Axes | None = None,
    columns: str = "",
    offset: FilePath | None = None,
    patb_rotation: PatbRotation | None = None,
    linear_alteration_m: float | None = None,
    station_pattern: str = "",
    rig_reference: str = "",
    time_stamps: FilePath | None = None,
) -> Request:
    """What `read` is asked for, in one record; arguments as there.

    Raises
    ------
    InputError
    """
    from aerotri.formats.assembly.assemble import Statements
    from aerotri.formats.assembly.camera_spec import CameraSpec
    from aerotri.formats.assembly.project import Request

    stated = Statements(
        crs=crs,
        geoid=geoid,
        control_sigma_m=control_sigma_m,
        positions_sigma_m=positions_sigma_m,
        orientation_sigma_m=orientation_sigma_m,
        orientation_sigma_deg=orientation_sigma_deg,
        control_prefix=control_prefix,
        control_heights=control_heights,
        linear_alteration_m=linear_alteration_m,
        patb_rotation=patb_rotation,
        axes=axes,
        columns=columns,
    )
    return Request(
        source=text_of_path(source),
        name=name,
        image_points=tuple(text_of_path(path) for path in image_points),
        orientation=text_of_path(orientation),
        positions=text_of_path(positions),
        control=text_of_path(control),
        camera=CameraSpec(camera, camera_name, camera_size, pixel_um, focal_length_mm, flight_axis, free_interior),
        stated=stated,
        check=tuple(check),
        offset=offset,
        image_sigma_um=image_sigma_um,
        image_sigma_px=image_sigma_px,
        gnss_shift=gnss_shift,
        station_pattern=station_pattern,
        rig_reference=rig_reference,
        time_stamps=text_of_path(time_stamps),
    )


def read_request(request: Request) -> ReadBlock:
    """As `read`, with everything that is stated in one record.

    Raises
    ------
    InputError
    """
    from aerotri.formats.assembly.imported import sources_of
    from aerotri.formats.assembly.project import read_project

    if not (Path(request.source) / "solution.npz").is_file():
        reading = read_project(request)
        messages, sources = tuple(reading.messages), sources_of(request)
        return ReadBlock(reading.block, reading.points, messages, request.source, sources=sources)
    if request != type(request)(request.source, request.name, stated=request.stated):
        raise InputError(
            "is the result of an adjustment, to which nothing can be added",
            "leave the other arguments out, or give the block that was adjusted",
            request.source,
        )
    return ReadBlock(read_block(Path(request.source) / "block"), None, (), request.source, is_result=True)


def text_of_path(path: FilePath | None) -> str:
    """A path as text, which may say its kind; '' for None."""
    return "" if path is None else os.fspath(path)
