"""A block folder: block.toml and tables, read into a `Block` and checked to the last cell.

The format stands in the reference of the documentation. Two keys of this program's own: ``[adjustment] datum_fixed =
["IMAGE:X0", …]`` names the orientation elements held by datum = "fixed"; ``[camera.<name>.lens]`` holds the forward
lens parameters k1 k2 p1 p2 k3 as `[camera.<name>.brown]` holds Brown's. Of scanned film see `scanned_film`.
"""

from __future__ import annotations

import difflib
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from aerotri.conventions import RADIANS_PER, FilePath, InputError, real_path
from aerotri.formats.block.extras import edits_of, read_constraints
from aerotri.formats.block.journal import read_journal, with_given, with_marks
from aerotri.formats.block.logo import with_logo
from aerotri.formats.block.points import Rays, read_control, read_gnss_ins, read_image_points
from aerotri.formats.block.scanned_film import read_fiducials
from aerotri.formats.block.writer import write_block
from aerotri.formats.text.table_checks import refuse_duplicates, three_or_none
from aerotri.formats.text.tables import Columns, Table, as_str_array, read_table
from aerotri.observations import Block, Camera, Images, Rig
from aerotri.observations.rigs import station_fault

if TYPE_CHECKING:
    from aerotri.formats.block.settings import BlockToml
    from aerotri.functional_model.interior import FiducialFit
    from aerotri.observations.block import Fiducials

__all__ = ["BlockTables", "block_of", "open_tables", "read_block", "read_photographs", "table_file", "write_block"]

NEAR = 0.7
"""Likeness of a file's name from which it seems to be the table that is missing."""
IMAGE_COLUMNS = Columns(
    text=("image", "camera"),
    optional_text=("strip",),
    optional_numbers=("X0", "Y0", "Z0", "omega", "phi", "kappa"),
    free_text=True,
)


def read_block(path: FilePath, rays_needed: bool = True, images_needed: bool = True) -> Block:
    """A block from its folder.

    Parameters
    ----------
    path : the folder, or its block.toml.
    rays_needed : whether a block without image points is an error; photographs alone will do for what only needs them.
    images_needed : whether a block without photographs is an error.

    Returns
    -------
    The block; `points` holds the names of the image points in order of first appearance, then those of control points
    that were never measured.

    Raises
    ------
    InputError
        With file, line, what is wrong and the remedy, for anything the format does not allow.
    """
    tables = open_tables(path, images_needed)
    rays = read_image_points(
        tables.image_points, tables.images, tables.cameras, tables.settings, tables.fits, may_be_empty=not rays_needed
    )
    return block_of(tables, rays)


@dataclass(frozen=True, eq=False)
class BlockTables:
    """A block folder whose settings and photographs are read; image points and what refers to them are not.

    Parameters
    ----------
    fiducials : measured marks of scanned film. fits : what follows from them, by photograph.
    image_points : the table.
    """

    folder: Path
    settings: BlockToml
    cameras: tuple[Camera, ...]
    rigs: tuple[Rig, ...]
    images: Images
    fiducials: Fiducials | None
    fits: Mapping[int, FiducialFit]
    image_points: Path


def open_tables(path: FilePath, images_needed: bool = True) -> BlockTables:
    """What `read_block` reads before the image points.

    Raises
    ------
    InputError
        As `read_block`.
    """
    toml = settings_file(Path(path))
    folder = toml.parent
    # pydantic is imported by the settings model only when a block is read
    from aerotri.formats.block.settings import read_block_toml

    settings = read_block_toml(toml)
    cameras, rigs, model = settings.cameras(), settings.rigs(), settings.model
    radians = RADIANS_PER[model.angle_unit]
    images = _images(_required_table(folder, "images"), cameras, rigs, radians, may_be_empty=not images_needed)
    fiducials, fits = read_fiducials(table_file(folder, "fiducials"), images, cameras)
    if fiducials is not None and model.image_unit != "px":
        message = f"image_unit = '{model.image_unit}', but fiducials.csv says the photographs are scans"
        raise settings.error(("image_unit",), message, 'measure in pixels of the scan: image_unit = "px"')
    table = _required_table(folder, "image_points")
    return BlockTables(folder, settings, cameras, rigs, images, fiducials, fits, table)


def block_of(tables: BlockTables, rays: Rays) -> Block:
    """What `read_block` reads after the image points, and all of it together.

    Raises
    ------
    InputError
        As `read_block`.
    """
    folder, settings, images, cameras = tables.folder, tables.settings, tables.images, tables.cameras
    model = settings.model
    listed, known = read_control(table_file(folder, "control"), rays.point_names, settings)
    default = settings.settings(rays.image_sigma_um)
    journal = read_journal(table_file(folder, "edits"))
    control, names = with_given(listed, as_str_array(known), journal)
    image_points, points = with_marks(
        rays.image_points, names, control, journal, images, cameras, tables.fits, default.image_sigma_um * 1e-3
    )
    block = Block(
        name=real_path(folder).name if model.name is None else model.name,
        cameras=cameras,
        images=images,
        points=points,
        image_points=image_points,
        control=control,
        gnss_ins=read_gnss_ins(table_file(folder, "gnss_ins"), images, RADIANS_PER[model.angle_unit]),
        settings=default,
        crs=model.crs,
        rotation=model.rotation,
        edits=edits_of(journal, images, points, image_points, control),
        fiducials=tables.fiducials,
        constraints=read_constraints(table_file(folder, "constraints"), points),
        interior_fits=tables.fits,
        rigs=tables.rigs,
        project=with_logo(model.project.project(), settings),
    )
    _check_names_in_settings(block, settings)
    return block


def read_photographs(path: FilePath) -> Images:
    """The photographs of a block folder, without its rays.

    Raises
    ------
    InputError
        As `read_block`.
    """
    toml = settings_file(Path(path))
    from aerotri.formats.block.settings import read_block_toml

    settings = read_block_toml(toml)
    table = _required_table(toml.parent, "images")
    radians = RADIANS_PER[settings.model.angle_unit]
    return _images(table, settings.cameras(), settings.rigs(), radians, may_be_empty=False)


def settings_file(path: Path) -> Path:
    """The block.toml of a folder, or itself.

    Raises
    ------
    InputError
        When there is none.
    """
    if path.is_dir():
        path = path / "block.toml"
    if not path.exists():
        raise InputError(
            "there is no block.toml" if path.name == "block.toml" else "there is no such file or folder",
            "give the folder of a block, with block.toml, images.csv and image_points.csv in it",
            path,
        )
    if path.suffix != ".toml":
        raise InputError("is no block", "give the folder of a block or its block.toml", path)
    return path


def _required_table(folder: Path, name: str) -> Path:
    path = table_file(folder, name)
    if path is None:
        place = folder / f"{name}.csv"
        near = difflib.get_close_matches(place.name, [one.name for one in folder.iterdir() if one.is_file()], 1, NEAR)
        remedy = f"there is {near[0]}: rename it" if near else (
            f"a block needs a table {place.name} beside its block.toml; `aerotri init` writes empty ones")  # fmt: skip
        raise InputError("is missing", remedy, place)
    return path


def table_file(folder: Path, name: str) -> Path | None:
    """The table of a name as .csv or .parquet; None where there is none."""
    found = [path for path in (folder / f"{name}.csv", folder / f"{name}.parquet") if os.path.lexists(path)]
    if len(found) > 1:
        raise InputError(f"{name}.csv and {name}.parquet are both there", "remove one of them", folder / name)
    return found[0] if found else None


def _images(
    path: Path, cameras: tuple[Camera, ...], rigs: tuple[Rig, ...], radians: float, may_be_empty: bool
) -> Images:
    table = read_table(path, IMAGE_COLUMNS)
    table.require("image", "camera")
    if not table.length and not may_be_empty:
        raise InputError("holds no photographs", "give a row for every photograph", path)
    refuse_duplicates(table, table.text["image"].index, lambda row: f"photograph '{table.cell('image', row)}'")
    known = {camera.name: i for i, camera in enumerate(cameras)}
    column = table.text["camera"]
    code = np.array([known.get(name, -1) for name in column.names.to_pylist()], dtype=np.int64)
    camera = code[column.index]
    unknown = np.flatnonzero(camera < 0)
    if len(unknown):
        row = int(unknown[0])
        raise table.error(
            row,
            f"there is no camera '{table.cell('camera', row)}'",
            f"block.toml has {', '.join(known)}; or add it there",
        )
    nothing = np.full(table.length, "", dtype="<U1")
    grouping = {n: c.rows() for n, c in table.text.items() if n not in ("image", "camera", "strip")}
    images = Images(
        names=table.text["image"].rows(),
        camera=camera,
        strip=table.text["strip"].rows() if "strip" in table.text else nothing,
        centre=three_or_none(table, ("X0", "Y0", "Z0")),
        angles=three_or_none(table, ("omega", "phi", "kappa")) * radians,
        columns=grouping,
    )
    if any(one.rolling_shutter is not None for one in cameras) and "time" in grouping:
        _refuse_odd_times(table, images.columns["time"])
    fault = station_fault(images, cameras, rigs)
    if fault is not None and fault.image >= 0:
        raise table.error(fault.image, fault.message, fault.remedy)
    if fault is not None:
        raise InputError(fault.message, fault.remedy, path, 1)
    return images


def _refuse_odd_times(table: Table, times: np.ndarray) -> None:
    """Times that give no velocity: they would be passed over in silence."""
    for row, text in enumerate(times.tolist()):
        try:
            usable = not text or np.isfinite(float(text))
        except ValueError:
            usable = False
        if not usable:
            raise table.error(
                row, f"time = '{text[:40]}' is not a number, and a camera has a rolling shutter",
                "give seconds, such as 45296.25 for 12:34:56.25, or leave it empty",
            )  # fmt: skip


def _check_names_in_settings(block: Block, settings: BlockToml) -> None:
    """Names that the settings refer to: grouping column, datum points, images of a fixed datum."""
    adjustment = block.settings.adjustment
    groups = adjustment.parameter_groups
    if groups not in ("camera", "block", "strip", *block.images.columns):
        there = ", ".join(("camera", "block", "strip", *block.images.columns))
        raise settings.error(
            ("adjustment", "parameter_groups"),
            f"images.csv has no column '{groups}' to group by",
            f"known are {there}; or add the column",
        )
    points = np.array(adjustment.datum_points, dtype=str)
    missing = points[~np.isin(points, block.points)] if len(points) else points
    if len(missing):
        raise settings.error(
            ("adjustment", "datum_points"),
            f"there is no point '{missing[0]}'",
            "name points of image_points or control",
        )
    known = set(block.images.names.tolist())
    for image, _ in adjustment.datum_fixed:
        if image not in known:
            raise settings.error(
                ("adjustment", "datum_fixed"), f"there is no photograph '{image}'", "name photographs of images.csv"
            )
