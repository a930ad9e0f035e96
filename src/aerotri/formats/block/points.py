"""The tables of points of a block folder: image points, control, observed projection centres."""

# pyright: reportUnknownParameterType=false
# (pyarrow has no types: what is annotated as its Table or Array is unknown to pyright)

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from aerotri.conventions import InputError, mm_from_px
from aerotri.formats.block.scanned_film import of_scans, refuse_unfitted
from aerotri.formats.text.arrow_compute import arrow_compute
from aerotri.formats.text.csv_text import is_blank
from aerotri.formats.text.table_checks import image_index, refuse_duplicates, sigma_columns, three_or_none
from aerotri.formats.text.tables import Columns, Table, TextColumn, read_table
from aerotri.observations import Camera, Control, GnssIns, ImagePoints, Images

if TYPE_CHECKING:
    import pyarrow as pa

    from aerotri.formats.block.settings import BlockToml
    from aerotri.functional_model.interior import FiducialFit

IMAGE_POINT_COLUMNS = Columns(text=("image", "point"), numbers=("x", "y"), optional_numbers=("sx", "sy"))
CONTROL_COLUMNS = Columns(text=("point", "role"), numbers=("X", "Y", "Z"), optional_numbers=("sX", "sY", "sZ"))
GNSS_COLUMNS = Columns(
    text=("image",),
    numbers=("X", "Y", "Z", "sX", "sY", "sZ"),
    optional_numbers=("omega", "phi", "kappa", "s_omega", "s_phi", "s_kappa", "time"),
)
OUTSIDE = 0.05
"""Part of the format by which an image point may lie outside of it."""


@dataclass(frozen=True, eq=False)
class Rays:
    """What image_points holds: the record, the names its points have, the a-priori σ that stands for all."""

    image_points: ImagePoints
    point_names: pa.StringArray
    image_sigma_um: float


def read_image_points(
    path: Path,
    images: Images,
    cameras: tuple[Camera, ...],
    settings: BlockToml,
    fits: Mapping[int, FiducialFit],
    may_be_empty: bool = False,
) -> Rays:
    """Image points in mm: from the image centre, or in the frame of the fiducial marks of scanned film.

    Parameters
    ----------
    fits : interior orientation of scanned photographs by index; their image points are pixel positions of the scan.
    may_be_empty : whether a table without rows will do.

    Raises
    ------
    InputError
        See `block_folder.read_block`.
    """
    table = read_table(path, IMAGE_POINT_COLUMNS)
    if not table.length and not may_be_empty:
        raise InputError("holds no image points", "give a row for every measured point", path)
    return rays_of(table, images, cameras, settings, fits)


def rays_of(
    table: Table,
    images: Images,
    cameras: tuple[Camera, ...],
    settings: BlockToml,
    fits: Mapping[int, FiducialFit],
) -> Rays:
    """Image points of a table, or of a piece of one; see `read_image_points`.

    Raises
    ------
    InputError
        See `block_folder.read_block`; of a point that is there twice in a photograph only where both rows are given.
    """
    table.require("image", "point", "x", "y")
    image = image_index(table, images)
    point = table.text["point"]
    refuse_duplicates(
        table,
        image * len(point.names) + point.index,
        lambda row: f"point '{table.cell('point', row)}' in photograph '{table.cell('image', row)}'",
    )
    camera = images.camera[image]
    unit = settings.model.image_unit
    xy = _to_mm(table.stack("x", "y"), unit, camera, cameras)
    sigma, image_sigma_um = _image_sigma(table, camera, cameras, settings)
    if fits:
        refuse_unfitted(table, image, images, fits)
        xy, sigma = of_scans(table, image, fits, xy, sigma)
    _refuse_points_outside(table, xy, camera, cameras, unit)
    return Rays(ImagePoints(image, point.index, xy, sigma), point.names, image_sigma_um)


def _to_mm(values: np.ndarray, unit: str, camera: np.ndarray, cameras: tuple[Camera, ...]) -> np.ndarray:
    if unit != "px":
        return values * 1e-3 if unit == "um" else values
    if len(cameras) == 1:
        return mm_from_px(values, cameras[0].size_px, cameras[0].pixel_mm)
    xy = np.empty_like(values)
    order = np.argsort(camera, kind="stable")
    parts = np.split(order, np.searchsorted(camera[order], np.arange(1, len(cameras))))
    for one, rows in zip(cameras, parts, strict=True):
        xy[rows] = mm_from_px(values[rows], one.size_px, one.pixel_mm)
    return xy


def _refuse_points_outside(
    table: Table, xy: np.ndarray, camera: np.ndarray, cameras: tuple[Camera, ...], unit: str
) -> None:
    limit = (1.0 + 2.0 * OUTSIDE) * np.array([one.half_format_mm for one in cameras])
    outside = np.flatnonzero((np.abs(xy) > limit[camera]).any(axis=1))
    if not len(outside):
        return
    row = int(outside[0])
    one = cameras[camera[row]]
    half = np.array(one.half_format_mm)
    raise table.error(
        row,
        f"point '{table.cell('point', row)}' lies outside the format of camera '{one.name}': "
        f"x = {xy[row, 0]:.6g} mm, y = {xy[row, 1]:.6g} mm, the format reaches to ±{half[0]:.6g}, ±{half[1]:.6g} mm",
        f"check image_unit (it is {unit}), x and y exchanged, size_px and pixel_um",
    )


def _image_sigma(
    table: Table, camera: np.ndarray, cameras: tuple[Camera, ...], settings: BlockToml
) -> tuple[np.ndarray, float]:
    """(m, 2) mm, and the σ in µm that stands for all: the block's own, or the median of the table."""
    given = settings.model.stochastic.image_sigma_um
    unit = settings.model.image_unit
    if unit == "px":
        scale = np.array([one.pixel_mm for one in cameras])[camera]
    else:
        scale = np.full(table.length, 1.0 if unit == "mm" else 1e-3)
    sigma = sigma_columns(
        table,
        ("sx", "sy"),
        np.ones((table.length, 2), bool),
        np.full(2, np.nan if given is None else np.inf),
        "give it in the table, or image_sigma_um under [stochastic] in block.toml",
    )
    if given is None:
        sigma *= scale[:, None]
        return sigma, float(np.median(sigma) * 1e3) if len(sigma) else float("nan")
    # an infinite σ marks the empty cells: the default is in µm, whatever unit the table has
    return np.where(np.isinf(sigma), given * 1e-3, sigma * scale[:, None]), float(given)


def read_control(path: Path | None, measured: pa.StringArray, settings: BlockToml) -> tuple[Control, pa.StringArray]:
    """Control and check points, and the names of all points: the measured ones, then the others of this table.

    Raises
    ------
    InputError
        See `block_folder.read_block`.
    """
    if path is None or is_blank(path):
        return Control.empty(), measured
    table = read_table(path, CONTROL_COLUMNS)
    table.require("point", "role")
    refuse_duplicates(table, table.text["point"].index, lambda row: f"point '{table.cell('point', row)}'")
    xyz = table.stack("X", "Y", "Z")
    nothing = np.flatnonzero(np.isnan(xyz).all(axis=1))
    if len(nothing):
        raise table.error(
            int(nothing[0]), "X, Y and Z are all empty", "give at least one coordinate, or remove the row"
        )
    default = settings.model.stochastic.default_control_sigma_m
    sigma = sigma_columns(
        table,
        ("sX", "sY", "sZ"),
        ~np.isnan(xyz),
        np.full(3, np.nan) if default is None else np.array(default, dtype=float),
        "give it in the table, or default_control_sigma_m under [stochastic] in block.toml",
        may_be_zero=True,
        on_ground=True,
    )
    point, names = _with_points_never_measured(table.text["point"], measured)
    return Control(point, xyz, sigma, _is_check(table)), names


def _is_check(table: Table) -> np.ndarray:
    role = table.text["role"].rows()
    other = np.flatnonzero((role != "control") & (role != "check"))
    if len(other):
        raise table.error(int(other[0]), f"role = '{role[other[0]]}' is not possible", "a role is control or check")
    return role == "check"


def _with_points_never_measured(column: TextColumn, measured: pa.StringArray) -> tuple[np.ndarray, pa.StringArray]:
    """(k,) index of the control points among all names, and these names."""
    import pyarrow as pa

    compute = arrow_compute()
    place = compute.index_in(column.names, value_set=measured).fill_null(-1).to_numpy().astype(np.int64)
    new = place < 0
    place[new] = len(measured) + np.arange(np.count_nonzero(new))
    names = pa.concat_arrays([measured, column.names.filter(pa.array(new))]) if new.any() else measured
    return place[column.index], names


def read_gnss_ins(path: Path | None, images: Images, radians: float) -> GnssIns | None:
    """Observed antenna positions and attitudes; None where there are none.

    Parameters
    ----------
    radians : radians per angle unit of the block.

    Raises
    ------
    InputError
        See `block_folder.read_block`.
    """
    if path is None or is_blank(path):
        return None
    table = read_table(path, GNSS_COLUMNS)
    if not table.length:
        return None
    table.require("image")
    image = image_index(table, images)
    refuse_duplicates(table, image, lambda row: f"photograph '{table.cell('image', row)}'")
    xyz, angles = three_or_none(table, ("X", "Y", "Z")), three_or_none(table, ("omega", "phi", "kappa"))
    nothing = np.flatnonzero(np.isnan(xyz[:, 0]) & np.isnan(angles[:, 0]))
    if len(nothing):
        raise table.error(
            int(nothing[0]), "the row has neither a position nor angles", "give one of them, or remove the row"
        )
    unknown = np.full(3, np.nan)
    remedy = "give a standard deviation for every position and angle"
    return GnssIns(
        image=image,
        xyz=xyz,
        sigma=sigma_columns(table, ("sX", "sY", "sZ"), ~np.isnan(xyz), unknown, remedy, on_ground=True),
        angles=angles * radians,
        angles_sigma=sigma_columns(table, ("s_omega", "s_phi", "s_kappa"), ~np.isnan(angles), unknown, remedy)
        * radians,
        time=table.stack("time")[:, 0],
    )
