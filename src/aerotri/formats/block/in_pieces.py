"""A block folder whose image points are read piece by piece: everything else is held, they are not."""

# pyright: reportUnknownParameterType=false
# (pyarrow has no types: what is annotated as its Table or Array is unknown to pyright)

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.formats.block.folder import BlockTables, block_of, open_tables, table_file
from aerotri.formats.block.points import IMAGE_POINT_COLUMNS, Rays, rays_of
from aerotri.formats.text.csv_text import is_blank
from aerotri.formats.text.table_pieces import table_pieces
from aerotri.observations import Block, ImagePoints

if TYPE_CHECKING:
    import pyarrow as pa


@dataclass(frozen=True, eq=False)
class PieceOfRays:
    """Some image points, in the order of the table.

    Parameters
    ----------
    rays : (m,), `point` is the index into the names. names : of their points, a pyarrow string array.
    first_row : image points of the block before these.
    """

    rays: ImagePoints
    names: pa.StringArray
    first_row: int


@dataclass(frozen=True, eq=False)
class BlockInPieces:
    """A block without its image points, and the way to them.

    Parameters
    ----------
    block : no image points; `points` are the names of control and check points alone.
    tables : of the folder.
    """

    block: Block
    tables: BlockTables

    def pieces(self) -> Iterator[PieceOfRays]:
        """All image points, some at a time.

        Raises
        ------
        InputError
            As `read_block`; of a point that is there twice in a photograph only where both rows are in one piece.
        """
        t, first_row = self.tables, 0
        for table in table_pieces(t.image_points, IMAGE_POINT_COLUMNS):
            rays = rays_of(table, t.images, t.cameras, t.settings, t.fits)
            yield PieceOfRays(rays.image_points, rays.point_names, first_row)
            first_row += table.length
        if not first_row:
            raise InputError("holds no image points", "give a row for every measured point", t.image_points)

    def twice(self, rows: tuple[int, int]) -> InputError:
        """The error of a point that is there twice in a photograph, in two rows from 0."""
        said, first = "", min(rows)
        for table in table_pieces(self.tables.image_points, IMAGE_POINT_COLUMNS):
            if table.first_row <= first < table.first_row + table.length:
                line = None if table.source is None else table.source.line_of_row(first - table.first_row)
                said = f"row {first + 1}" if line is None else f"line {line}"
            row = max(rows) - table.first_row
            if row < table.length:
                what = f"point '{table.cell('point', row)}' in photograph '{table.cell('image', row)}'"
                return table.error(row, f"{what} is there twice, first in {said}", "keep one of the rows")
        raise ValueError(f"there are no rows {rows}")


def open_in_pieces(path: FilePath) -> BlockInPieces | None:
    """A block folder, or its block.toml, without its image points; None where it has to be read whole.

    That is a folder with decisions, constraints or datum points, which name points, and one that states no σ of image
    coordinates: it follows from all of them.

    Raises
    ------
    InputError
        As `read_block`.
    """
    tables = open_tables(path)
    given, points = tables.settings.model.stochastic.image_sigma_um, tables.settings.model.adjustment.datum_points
    if given is None or points or any(_has_rows(table_file(tables.folder, n)) for n in ("edits", "constraints")):
        return None
    return BlockInPieces(block_of(tables, _no_rays(given)), tables)


def read_without_rays(path: FilePath) -> Block:
    """A block folder without its image points: photographs, control, positions and settings.

    Raises
    ------
    InputError
        As `read_block`.
    """
    tables = open_tables(path)
    return block_of(tables, _no_rays(tables.settings.model.stochastic.image_sigma_um or 1.0))


def _has_rows(path: Path | None) -> bool:
    return path is not None and not is_blank(path)


def _no_rays(image_sigma_um: float) -> Rays:
    import pyarrow as pa

    nothing, index = np.zeros((0, 2)), np.zeros(0, np.int64)
    return Rays(ImagePoints(index, index, nothing, nothing), pa.array([], pa.string()), image_sigma_um)
