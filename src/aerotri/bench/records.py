"""What the bench shows of a result, from its tables alone: there before the equations are set up again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.bench.json_record import read_record
from aerotri.conventions import InputError, px_from_mm
from aerotri.formats.block.folder import read_block
from aerotri.formats.block.scanned_film import scan_from_mm
from aerotri.formats.text.tables import Columns, Table, read_table
from aerotri.observations import Block

RECORD, RAYS = "adjustment.json", "residuals.parquet"
NUMBERS = ("vx", "vy", "wx", "wy", "weight")
ANGLES = ("omega", "phi", "kappa")
WANTED = (
    "X0",
    "Y0",
    "Z0",
    *ANGLES,
    "sX0",
    "sY0",
    "sZ0",
    "X",
    "Y",
    "Z",
    "sX",
    "sY",
    "sZ",
    "max_abs_w",
    "dX",
    "dY",
    "dZ",
)
RAY_COLUMNS = Columns(text=("image", "point", "status"), numbers=("x", "y", "rx", "ry", *NUMBERS))
REMEDY = "give the folder that `aerotri adjust` wrote, or adjust the block again"


@dataclass(frozen=True, eq=False)
class Records:
    """A block with what its adjustment found; NaN where it found nothing.

    Parameters
    ----------
    block : as it was adjusted, or as it was measured where there is no result.
    outcome : the content of adjustment.json, empty without a result.
    centre : (n, 3) m. angles : (n, 3) rad. sigma_centre : (n, 3) m.
    xyz, sigma : (N, 3) m, the object points; largest_w : (N,) of their rays.
    v : (m, 2) mm. w : (m, 2). weight : (m,). status : (m,) str.
    differences : (k, 3) m, adjusted − given of the block's control and check points.
    """

    block: Block
    outcome: Mapping[str, Any]
    centre: np.ndarray
    angles: np.ndarray
    sigma_centre: np.ndarray
    xyz: np.ndarray
    sigma: np.ndarray
    largest_w: np.ndarray
    v: np.ndarray
    w: np.ndarray
    weight: np.ndarray
    status: np.ndarray
    differences: np.ndarray

    @property
    def size(self) -> np.ndarray:
        """(m,) the larger |w| of every ray, NaN where it was not used."""
        return np.where(np.isnan(self.w).all(axis=1), np.nan, np.nanmax(np.nan_to_num(np.abs(self.w)), axis=1))

    @property
    def is_adjusted(self) -> bool:
        """Whether there is a result."""
        return bool(self.outcome)


def read_records(folder: Path) -> Records:
    """What the tables of a result folder say.

    Raises
    ------
    InputError
        Where a table is missing, damaged, or not of the block beside it.
    """
    record = folder / RECORD
    if not record.is_file():
        raise InputError(f"holds no {RECORD}", REMEDY, folder)
    block = read_block(folder / "block")
    images = _Rows(folder / "images.csv", "image", block.images.names)
    points = _Rows(folder / "points.csv", "point", block.points)
    v, w, weight, status = _rays(folder / RAYS, block)
    names = block.points[block.control.point]
    found = [_Rows(folder / f"{name}.csv", "point", names) for name in ("control", "check")]
    both = [rows.numbers("dX", "dY", "dZ") for rows in found]
    return Records(
        block=block, outcome=read_record(record, "a result", REMEDY), centre=images.numbers("X0", "Y0", "Z0"),
        angles=np.radians(images.numbers(*ANGLES)), sigma_centre=images.numbers("sX0", "sY0", "sZ0"),
        xyz=points.numbers("X", "Y", "Z"), sigma=points.numbers("sX", "sY", "sZ"),
        largest_w=points.numbers("max_abs_w")[:, 0], v=v, w=w, weight=weight, status=status,
        differences=np.where(np.isnan(both[0]), both[1], both[0]),
    )  # fmt: skip


def records_of_block(block: Block) -> Records:
    """A block without a result: start values and given coordinates alone."""
    n, count, m = len(block.images), len(block.points), len(block.image_points)
    xyz = np.full((count, 3), np.nan)
    xyz[block.control.point] = block.control.xyz
    return Records(
        block=block, outcome={}, centre=block.images.centre, angles=block.images.angles,
        sigma_centre=np.full((n, 3), np.nan), xyz=xyz, sigma=np.full((count, 3), np.nan),
        largest_w=np.full(count, np.nan), v=np.full((m, 2), np.nan), w=np.full((m, 2), np.nan),
        weight=np.full(m, np.nan), status=np.full(m, "not adjusted"),
        differences=np.full((len(block.control), 3), np.nan),
    )  # fmt: skip


def pixels_of_rays(block: Block, rows: np.ndarray, xy: np.ndarray) -> np.ndarray:
    """(k, 2) px, column and row in the photographs, of image coordinates (k, 2) mm of some rays.

    Scanned film is shown as it was scanned: its fiducials say where a position lies.
    """
    out = np.full((len(rows), 2), np.nan)
    image = block.image_points.image[rows]
    for number in np.unique(image).tolist():
        own = image == number
        out[own] = pixels_in(block, number, xy[own])
    return out


def pixels_in(block: Block, image: int, xy: np.ndarray) -> np.ndarray:
    """(k, 2) px, column and row, of (k, 2) mm in one photograph."""
    camera = block.cameras[block.images.camera[image]]
    fit = block.interior_fits.get(image)
    return px_from_mm(xy, camera.size_px, camera.pixel_mm) if fit is None else scan_from_mm(fit, xy)


class _Rows:
    """A table of a result by the names of the block; NaN in rows that it does not have."""

    def __init__(self, path: Path, key: str, names: np.ndarray):
        if not path.is_file():
            raise InputError("is missing", REMEDY, path)
        self._table: Table = read_table(path, Columns(text=(key,), optional_numbers=WANTED, free_text=True))
        row = {name: k for k, name in enumerate(self._table.text[key].rows().tolist())}
        self._rows = np.array([row.get(name, -1) for name in names.tolist()], dtype=np.int64)

    def numbers(self, *columns: str) -> np.ndarray:
        """(n, columns)."""
        out = np.full((len(self._rows), len(columns)), np.nan)
        there = self._rows >= 0
        for k, name in enumerate(columns):
            if name in self._table.numbers:
                out[there, k] = self._table.numbers[name][self._rows[there]]
        return out


def _rays(path: Path, block: Block) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """v (m, 2) mm, w (m, 2), weight (m,) and status (m,) in the order of the block's rays."""
    if not path.is_file():
        raise InputError("is missing", REMEDY, path)
    table = read_table(path, RAY_COLUMNS)
    if table.length != len(block.image_points):
        message = f"has {table.length} rays, the block beside it {len(block.image_points)}"
        raise InputError(message, REMEDY, path)
    columns = table.numbers
    v, w = (np.column_stack([columns[a], columns[b]]) for a, b in (("vx", "vy"), ("wx", "wy")))
    return v, w, columns["weight"], table.text["status"].rows()
