"""The kinds of files a block is put together from, by what they hold: how they are told and read."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.conventions import InputError, regular_file
from aerotri.formats.assembly.assemble import Statements
from aerotri.formats.assembly.parts import OrientationList, PointList, PositionList, RayList
from aerotri.formats.assembly.stamped import events, joined, positions_at, positions_of_stamps
from aerotri.formats.assembly.timed import TimeStamps, Trajectory
from aerotri.formats.files.photograph_files import files_of
from aerotri.formats.foreign.bingo import is_bingo, read_bingo
from aerotri.formats.foreign.dji_mrk import MRK, is_dji_mrk, read_dji_mrk
from aerotri.formats.foreign.grafnav import is_grafnav, read_grafnav
from aerotri.formats.foreign.ign import is_ign_app, is_ign_mes, is_ign_opk, read_ign_app, read_ign_mes, read_ign_opk
from aerotri.formats.foreign.list_header import is_named_list, is_named_orientations, stated_columns
from aerotri.formats.foreign.metashape import is_metashape, read_metashape
from aerotri.formats.foreign.metashape_markers import is_metashape_markers, read_metashape_markers
from aerotri.formats.foreign.named_lists import read_control_list, read_named_orientations, read_positions
from aerotri.formats.foreign.odm import is_odm_gcp, is_odm_geo, read_odm_gcp, read_odm_geo
from aerotri.formats.foreign.opensfm_gcp import is_opensfm_gcp, read_opensfm_gcp
from aerotri.formats.foreign.orientation_list import is_orientation_list, read_orientation_list
from aerotri.formats.foreign.patb import (
    ROTATIONS,
    is_patb_con,
    is_patb_im,
    is_patb_ori,
    read_patb_con,
    read_patb_im,
    read_patb_ori,
)
from aerotri.formats.foreign.pix4d import (
    AXES,
    is_pix4d_eo,
    is_pix4d_gcp,
    is_pix4d_geo,
    read_pix4d_eo,
    read_pix4d_gcp,
    read_pix4d_geo,
)
from aerotri.formats.foreign.realitycapture import is_realitycapture, read_realitycapture
from aerotri.formats.foreign.rtklib import is_rtklib, read_rtklib


@dataclass(frozen=True)
class ReadingOptions:
    """What single formats leave open.

    Parameters
    ----------
    axes : 'xy' or 'yx', the order of coordinates in lists that do not name them; None: as their system has it.
    crs : of such lists where they name none.
    exchanged : whether the user says that X and Y stand in the other order where a list has one.
    offset : (3,) m, added to orientations of Pix4D; None: nothing.
    patb_rotation : see `patb.ROTATIONS`; None: settled by reprojection.
    columns : of a list that does not name them, see `list_header.stated_columns`; '' where it does.
    """

    axes: str | None = None
    crs: str = ""
    exchanged: bool = False
    offset: np.ndarray | None = None
    patb_rotation: str | None = None
    columns: str = ""

    def __post_init__(self) -> None:
        if self.axes is not None and self.axes not in AXES:
            raise InputError(f"--axes '{self.axes}' is not possible", "give xy or yx")
        if self.patb_rotation is not None and self.patb_rotation not in ROTATIONS:
            raise InputError(
                f"--patb-rotation '{self.patb_rotation}' is not possible", f"give {' or '.join(ROTATIONS)}"
            )
        stated_columns(self.columns)

    def beside_control(self) -> ReadingOptions:
        """For another list than that of control, whose columns these are.

        What the user states of the order counts there only where the list has none of its own.
        """
        return replace(self, columns="", exchanged=False)


Kinds = Mapping[str, tuple[Callable[[Path], bool], Callable[[Path, ReadingOptions], Any]]]
RAYS: Kinds = {
    "patb-im": (is_patb_im, lambda path, _: read_patb_im(path)),
    "bingo": (is_bingo, lambda path, _: read_bingo(path)),
    "ign-mes": (is_ign_mes, lambda path, _: read_ign_mes(path)),
    "odm-gcp": (is_odm_gcp, lambda path, _: read_odm_gcp(path).rays),
}
ORIENTATIONS: Kinds = {
    "pix4d-eo": (is_pix4d_eo, lambda path, options: read_pix4d_eo(path, options.offset)),
    "metashape": (is_metashape, lambda path, _: read_metashape(path)),
    "realitycapture": (is_realitycapture, lambda path, _: read_realitycapture(path)),
    "ign-opk": (is_ign_opk, lambda path, _: read_ign_opk(path)),
    "patb-ori": (is_patb_ori, lambda path, options: read_patb_ori(path, options.patb_rotation)),
    "opk-list": (is_orientation_list, lambda path, _: read_orientation_list(path)),
    "opk-csv": (is_named_orientations, lambda path, _: read_named_orientations(path)),
}
TRAJECTORIES: Mapping[str, tuple[Callable[[Path], bool], Callable[[Path], Trajectory]]] = {
    "rtklib": (is_rtklib, read_rtklib),
    "grafnav": (lambda path: is_grafnav(path) and not is_named_list(path), read_grafnav),
}
DJI_MRK = "dji-mrk"
OF_TRAJECTORIES = (".pos", ".txt", ".csv")
"""Endings of files in a folder that may be trajectories."""
POSITIONS: Kinds = {
    DJI_MRK: (is_dji_mrk, lambda path, _: positions_of_stamps(read_dji_mrk(path))),
    "rtklib": (TRAJECTORIES["rtklib"][0], lambda path, _: events(read_rtklib(path))),
    "grafnav": (TRAJECTORIES["grafnav"][0], lambda path, _: events(read_grafnav(path))),
    "odm-geo": (is_odm_geo, lambda path, options: read_odm_geo(path, options.exchanged)),
    "csv": (is_named_list, lambda path, options: read_positions(path, options.columns, options.exchanged)),
    "pix4d-geo": (is_pix4d_geo, lambda path, options: read_pix4d_geo(path, options.axes, options.crs)),
}
CONTROL: Kinds = {
    "metashape-markers": (is_metashape_markers, lambda path, _: read_metashape_markers(path)),
    "opensfm-gcp": (is_opensfm_gcp, lambda path, _: read_opensfm_gcp(path)),
    "odm-gcp": (is_odm_gcp, lambda path, options: read_odm_gcp(path, options.exchanged)),
    "csv": (is_named_list, lambda path, options: read_control_list(path, options.columns, options.exchanged)),
    "pix4d-gcp": (is_pix4d_gcp, lambda path, options: read_pix4d_gcp(path, options.axes, options.crs)),
    "ign-app": (is_ign_app, lambda path, _: read_ign_app(path)),
    "patb-con": (is_patb_con, lambda path, _: read_patb_con(path)),
}


def split_kind(text: str, *known: Mapping[str, Any]) -> tuple[str | None, Path]:
    """Kind and path of ``kind:PATH``; no kind where what stands before the colon is none of the known."""
    kind, colon, path = text.partition(":")
    if colon and any(kind in kinds for kinds in known):
        return kind, Path(path)
    return None, Path(text)


def kind_of(path: Path, kinds: Kinds) -> str | None:
    """The kind of a file, None where it is none of these.

    Raises
    ------
    InputError
        When there is no such file.
    """
    if not path.is_dir():
        regular_file(path)
    return next((name for name, (recognises, _) in kinds.items() if recognises(path)), None)


def stated_or_told(text: str, kinds: Kinds, options: ReadingOptions) -> tuple[str | None, Path]:
    """The kind that ``PATH`` or ``kind:PATH`` is read as, None where it is none of these, and the path.

    Raises
    ------
    InputError
        When there is no such file.
    """
    stated, path = split_kind(text, kinds)
    if stated not in (None, "csv") and options.columns and "csv" in kinds:
        remedy = f"leave --columns out, or put csv before the path: csv:{path.name}"
        raise InputError(f"--columns is given, and the columns of {stated} are known", remedy, path)
    return stated or ("csv" if options.columns and "csv" in kinds else kind_of(path, kinds)), path


def _read(text: str, kinds: Kinds, what: str, options: ReadingOptions) -> Any:
    kind, path = stated_or_told(text, kinds, options)
    if kinds is ORIENTATIONS and kind != "pix4d-eo" and options.offset is not None:
        raise InputError("is not an orientation of Pix4D; --offset is only for these", "leave --offset out", path)
    if kind is None:
        known = ", ".join(kinds)
        more = "; or add a first row that names the columns, or state them with --columns" if "csv" in kinds else ""
        raise InputError(
            f"is not in a known format of {what}",
            f"known are {known}; put the format before the path, as {next(iter(kinds))}:{path.name}{more}",
            path,
        )
    if path.is_dir():
        raise InputError(f"is a folder, not a file of {what}", "give the file", path)
    return kinds[kind][1](path, options)


def read_rays(text: str, options: ReadingOptions) -> RayList:
    """Image points from ``PATH`` or ``kind:PATH``.

    Raises
    ------
    InputError
    """
    return _read(text, RAYS, "image points", options)


def read_orientations(text: str, options: ReadingOptions) -> OrientationList:
    """Orientations from ``PATH`` or ``kind:PATH``.

    Raises
    ------
    InputError
    """
    return _read(text, ORIENTATIONS, "orientations", options)


def read_position_list(
    text: str, options: ReadingOptions, time_stamps: str = "", photographs: Path | None = None
) -> PositionList:
    """Observed positions from ``PATH`` or ``kind:PATH``.

    Parameters
    ----------
    text : also a folder of trajectories, one of each flight.
    time_stamps : file, or folder of files, with the times of photographs, where `text` is a trajectory; '' for those
        that lie beside the photographs.
    photographs : their folder, None where it is not known.

    Raises
    ------
    InputError
    """
    path, found = _trajectories(text)
    if not path.is_dir():
        regular_file(path)
    if not found or options.columns:
        if time_stamps:
            message = "is no trajectory, so that --time-stamps says nothing of it"
            raise InputError(message, f"leave it out; trajectories are {', '.join(TRAJECTORIES)}", path)
        return _read(text, POSITIONS, "positions", options)
    files = files_of_stamps(text, time_stamps, photographs)
    if not files:
        return _read(text, POSITIONS, "positions", options)
    whole = joined([TRAJECTORIES[kind][1](file) for kind, file in found], path)
    return positions_at(whole, [_time_stamps(file) for file in files])


def _trajectories(text: str) -> tuple[Path, list[tuple[str, Path]]]:
    """The path of ``PATH`` or ``kind:PATH``, and kinds and files of the trajectories there, several of a folder."""
    stated, path = split_kind(text, POSITIONS)
    if not path.is_dir():
        told = stated or _told(path)
        return path, [(told, path)] if told is not None and told in TRAJECTORIES else []
    told = [(_told(file), file) for file in files_of(path, OF_TRAJECTORIES)]
    return path, [(kind, file) for kind, file in told if kind is not None]


def _told(path: Path) -> str | None:
    return next((name for name, (recognises, _) in TRAJECTORIES.items() if recognises(path)), None)


def files_of_stamps(text: str, time_stamps: str, photographs: Path | None = None) -> list[Path]:
    """The files of time stamps for positions; none where these are no trajectory. Arguments as `read_position_list`.

    Raises
    ------
    InputError
        When the folder that is stated has none.
    """
    if not text or not _trajectories(text)[1]:
        return []
    if not time_stamps:
        return [] if photographs is None else list(files_of(photographs, (MRK,)))
    path = Path(time_stamps)
    found = list(files_of(path, (MRK,))) if path.is_dir() else [path]
    if not found:
        raise InputError(f"holds no file {MRK.upper()}", "give the file of time stamps", path)
    return found


def _time_stamps(path: Path) -> TimeStamps:
    if not is_dji_mrk(regular_file(path)):
        raise InputError("is no file of time stamps", "give the .MRK that the drone wrote beside the photographs", path)
    return read_dji_mrk(path)


def read_control(text: str, options: ReadingOptions) -> PointList:
    """Control points from ``PATH`` or ``kind:PATH``.

    Raises
    ------
    InputError
    """
    return _read(text, CONTROL, "control points", options)


def options_of(stated: Statements, offset: np.ndarray | None = None) -> ReadingOptions:
    """What the user states of lists.

    Raises
    ------
    InputError
        When what is stated makes no sense.
    """
    exchanged = stated.axes == "yx"
    return ReadingOptions(stated.axes, stated.crs, exchanged, offset, stated.patb_rotation, stated.columns)
