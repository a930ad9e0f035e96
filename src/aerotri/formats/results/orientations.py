"""Orientations of photographs in a table as images.csv is one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from aerotri.conventions import InputError
from aerotri.formats.text.table_checks import refuse_duplicates
from aerotri.formats.text.tables import Columns, read_table
from aerotri.observations import Block

NUMBERS = ("X0", "Y0", "Z0", "omega", "phi", "kappa")


def block_with_orientations(path: Path, block: Block) -> Block:
    """The block with the photographs of a table in place of its own: image, X0, Y0, Z0, omega, phi, kappa in degrees.

    Raises
    ------
    InputError
        When there is no such table, or it lacks a column.
    """
    if not path.is_file():
        raise InputError("there is no such file or result", "give images.csv, a result folder, or absorbed", path)
    table = read_table(path, Columns(text=("image",), numbers=NUMBERS, free_text=True))
    table.require("image", *NUMBERS)
    refuse_duplicates(table, table.text["image"].index, lambda row: f"image '{table.cell('image', row)}'")
    values = np.column_stack([table.numbers[name] for name in NUMBERS])
    images = replace(
        block.images, names=table.text["image"].rows(), camera=np.zeros(table.length, np.int64),
        strip=np.full(table.length, ""), centre=values[:, :3], angles=np.radians(values[:, 3:]), columns={},
    )  # fmt: skip
    return replace(block, images=images)
