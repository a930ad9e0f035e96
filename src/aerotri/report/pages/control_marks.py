"""The folder to mark control points in: where each is expected, the pieces of the photographs, and a page."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.formats.assembly.parts import PointList
from aerotri.formats.files.atomic import atomic_folder
from aerotri.formats.text.table_writer import write_table
from aerotri.report.pages.marking import marking_page
from aerotri.tie_points.control_marks import ControlMarks, Geoid, pieces, predict_marks
from aerotri.tie_points.photographs import PhotographSet
from aerotri.tie_points.photographs_to_block import TiedBlock

MARKS, TABLE, PIECES, PAGE = "control_marks", "predicted.csv", "pieces", "marking.html"
NO_CRS = "+proj=local"
"""First line of a gcp_list.txt in local coordinates: a system that has no name, taken as it is."""


def write_control_marks(
    tied: TiedBlock, control: PointList, photographs: PhotographSet, geoid: Geoid, folder: Path
) -> None:
    """Write where every control point is expected in every photograph.

    Parameters
    ----------
    control : all that were given, marked or not. geoid : grid for heights of their coordinate system.

    Raises
    ------
    InputError
        When a photograph cannot be read.
    """
    marks, names = predict_marks(tied.block, control, tied.points, geoid), tied.block.images.names
    with atomic_folder(folder, own=(TABLE, PIECES, PAGE)) as place:
        _write_table(marks, names, place / TABLE)
        rows = _write_pieces(marks, photographs, names, place / PIECES)
        crs = control.crs or (NO_CRS if tied.block.crs == "local" else tied.block.crs)
        given = dict(zip(control.points.tolist(), map(tuple, control.xyz.tolist()), strict=True))
        (place / PAGE).write_text(marking_page(crs, given, rows), encoding="utf-8")


def _write_table(marks: ControlMarks, names: np.ndarray, path: Path) -> None:
    write_table(
        {
            "point": marks.points[marks.point],
            "image": names[marks.image],
            "column": marks.predicted[:, 0],
            "row": marks.predicted[:, 1],
            "marked_column": marks.marked[:, 0],
            "marked_row": marks.marked[:, 1],
        },
        path,
    )


def _write_pieces(
    marks: ControlMarks, photographs: PhotographSet, names: np.ndarray, folder: Path
) -> list[dict[str, Any]]:
    """The pieces as files; what the page says of each, in the order of points and photographs."""
    folder.mkdir()
    paths, rows = dict(zip(photographs.names.tolist(), photographs.paths, strict=True)), []
    for row, corner, jpeg in pieces(marks, paths, names):
        point, image = str(marks.points[marks.point[row]]), str(names[marks.image[row]])
        file = re.sub(r"[^\w.-]", "_", f"{marks.point[row] + 1}_{point}_{image}")
        (folder / f"{file}.jpg").write_bytes(jpeg)
        predicted, marked = marks.predicted[row].tolist(), marks.marked[row].tolist()
        rows.append({"point": point, "image": image, "corner": corner, "predicted": predicted,
                     "marked": None if np.isnan(marked).any() else marked, "jpeg": jpeg})  # fmt: skip
    return sorted(rows, key=lambda row: (row["point"], row["image"]))
