"""OpenSfM's tracks.csv: rows ``image track feature x y …``, separated by tabs, after a line with the version.

Files of millions of rows are read by pyarrow; whatever it does not take as it stands is read line by line, which finds
the line of an error.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.formats.text.arrow_compute import arrow_compute
from aerotri.formats.text.text_lines import TextFile

TRACKS = "tracks.csv"
HEADER = "OPENSFM_TRACKS_VERSION"
LEAST_CELLS = 5
"""Image, track, feature, x and y; what follows differs from version to version."""
MOST_CELLS = 64
"""More are no tracks [C]."""


@dataclass(frozen=True, eq=False)
class Tracks:
    """Image points of known photographs and object points.

    Parameters
    ----------
    image, point : (m,) places among the names asked for.
    position : (m, 2) from the image centre, parts of the longer side, y down.
    left : rows of other photographs or points.
    """

    image: np.ndarray
    point: np.ndarray
    position: np.ndarray
    left: int


def read_tracks(path: Path, images: list[str], points: list[str]) -> Tracks:
    """The image points of these photographs and object points.

    Raises
    ------
    InputError
        With the line: a row that is too short, no number, a point twice in a photograph, a place outside of the image.
    """
    found = _read_quickly(path, images, points)
    return _read_line_by_line(path, images, points) if found is None else found


def track_names(path: Path) -> list[str]:
    """The names of all tracks, in the order in which they appear.

    Raises
    ------
    InputError
        When the file cannot be read.
    """
    file = TextFile(path, comments=False)
    cells = [line.split("\t", 2) for line in file.lines if not line.startswith(HEADER)]
    return list(dict.fromkeys(row[1].strip() for row in cells if len(row) > 1 and row[1].strip()))


def _read_quickly(path: Path, images: list[str], points: list[str]) -> Tracks | None:
    """As `read_tracks`, by pyarrow; None where anything is out of order."""
    import pyarrow as pa
    from pyarrow import csv

    begin, cells = _shape(path)
    if not LEAST_CELLS <= cells <= MOST_CELLS:
        return None
    names = [f"f{k}" for k in range(cells)]
    types = {"f0": pa.string(), "f1": pa.string(), "f3": pa.float64(), "f4": pa.float64()}
    try:
        table: Any = csv.read_csv(
            path,
            csv.ReadOptions(column_names=names, skip_rows=begin, block_size=1 << 24),
            csv.ParseOptions(delimiter="\t", quote_char=False),
            csv.ConvertOptions(include_columns=list(types), column_types=types, null_values=[]),
        )
    except (pa.ArrowInvalid, pa.ArrowNotImplementedError, OSError, ValueError):
        return None
    image, point = _places(table["f0"], images), _places(table["f1"], points)
    position = np.column_stack([table["f3"].to_numpy(), table["f4"].to_numpy()])
    keep = (image >= 0) & (point >= 0)
    if not keep.all():
        image, point, position = image[keep], point[keep], position[keep]
    key = np.sort(image * np.int64(len(points) or 1) + point)
    if (key[1:] == key[:-1]).any() or not (np.abs(position) <= 1.0).all():
        return None
    return Tracks(image, point, position, len(keep) - len(image))


def _shape(path: Path) -> tuple[int, int]:
    """Lines before the first row, and the cells of that; 0 cells where there is none."""
    try:
        with path.open("rb") as file:
            first = file.readline(1 << 16)
            begin = 1 if first.startswith(HEADER.encode()) else 0
            row = file.readline(1 << 16) if begin else first
    except OSError:
        return 0, 0
    return begin, row.count(b"\t") + 1 if row.strip() else 0


def _places(column: Any, names: list[str]) -> np.ndarray:
    """(m,) place of every text among the names, −1 where it is none of them."""
    import pyarrow as pa

    places = arrow_compute().index_in(column, value_set=pa.array(names, pa.string()))
    return arrow_compute().fill_null(places, -1).to_numpy().astype(np.int64)


def _read_line_by_line(path: Path, images: list[str], points: list[str]) -> Tracks:
    file = TextFile(path, comments=False)
    begin = 1 if len(file) and file.lines[0].startswith(HEADER) else 0
    words = file.words("\t")
    rows = range(begin, len(words))
    short = next((row for row in rows if len(words[row]) < LEAST_CELLS), None)
    if short is not None:
        remedy = "rows are: image, track, feature, x, y, …, separated by tabs"
        raise file.error(short, f"the row has {len(words[short])} cells", remedy)
    image_place = {name: i for i, name in enumerate(images)}
    point_place = {name: i for i, name in enumerate(points)}
    known = [row for row in rows if words[row][0] in image_place and words[row][1] in point_place]
    names = [f"{words[row][1]}' in photograph '{words[row][0]}" for row in known]
    file.refuse_repeated(names, known, "track")
    position = file.table([words[row][3:5] for row in known], known, "position").reshape(-1, 2)
    outside = np.flatnonzero((np.abs(position) > 1.0).any(axis=1))
    if len(outside):
        remedy = "positions are parts of the longer side, from the image centre"
        raise file.error(known[int(outside[0])], "an image point lies outside of its image", remedy)
    image = np.array([image_place[words[row][0]] for row in known], dtype=np.int64)
    point = np.array([point_place[words[row][1]] for row in known], dtype=np.int64)
    return Tracks(image, point, position, len(rows) - len(known))


def track_line(image: str, point: str, feature: int, x: float, y: float) -> str:
    """A row of version 2; scale and colour are made up, there is no segmentation."""
    return f"{image}\t{point}\t{feature}\t{x!r}\t{y!r}\t0.004\t255\t255\t255\t-1\t-1"
