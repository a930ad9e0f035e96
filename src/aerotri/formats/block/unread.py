"""Tables in the folder of a block that the reader does not read, and which table each seems to be meant for."""

from __future__ import annotations

import csv
import difflib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from aerotri.formats.block.extras import CONSTRAINT_COLUMNS
from aerotri.formats.block.folder import IMAGE_COLUMNS
from aerotri.formats.block.journal import EDIT_COLUMNS
from aerotri.formats.block.points import CONTROL_COLUMNS, GNSS_COLUMNS, IMAGE_POINT_COLUMNS
from aerotri.formats.block.scanned_film import FIDUCIAL_COLUMNS
from aerotri.formats.block.writer import OWN_ENTRIES
from aerotri.formats.files.ownership import recorded_files
from aerotri.formats.text.tables import Columns

TABLES: Mapping[str, Columns] = {
    "images": IMAGE_COLUMNS,
    "image_points": IMAGE_POINT_COLUMNS,
    "control": CONTROL_COLUMNS,
    "gnss_ins": GNSS_COLUMNS,
    "fiducials": FIDUCIAL_COLUMNS,
    "edits": EDIT_COLUMNS,
    "constraints": CONSTRAINT_COLUMNS,
}
"""The columns of every table of a block."""
ENDINGS = (".csv", ".parquet", ".tsv", ".txt", ".dat", ".xlsx", ".xls", ".ods")
"""Of files that may be meant as tables."""
SPOKEN = ("readme", "license", "notes")
"""Beginnings of names of files that are meant for people."""
LIKELY = 0.8
"""Share of the columns of a file that belong to a table from which it seems to be meant as that one [C]."""
SIMILAR = 0.6
"""Likeness of names from which a file seems to be meant."""
HEADER_BYTES = 10_000
SHOWN = 5


@dataclass(frozen=True)
class UnreadFile:
    """A file that is not read; meant : name of the table it seems to be, '' where it seems to be none."""

    name: str
    meant: str = ""


def unread_files(folder: Path) -> tuple[UnreadFile, ...]:
    """The files of a block folder that may be meant as tables and are not read; not those aerotri has written."""
    written = recorded_files(folder) or {}
    found = sorted(
        path
        for path in folder.iterdir()
        if path.is_file() and path.suffix.lower() in ENDINGS and not path.name.startswith(".")
        and path.name not in OWN_ENTRIES and path.name not in written and not path.name.lower().startswith(SPOKEN)
    )  # fmt: skip
    return tuple(UnreadFile(path.name, _meant(path, folder)) for path in found)


def unread_in_words(block: Path) -> tuple[str, ...]:
    """Sentences about them, one for each that seems to be meant, one for the others together.

    Parameters
    ----------
    block : its folder, or its block.toml.
    """
    files = unread_files(block.parent if block.is_file() else block)
    said = [f"{one.name} is not read: it seems to be {one.meant}; rename it" for one in files if one.meant]
    others = [one.name for one in files if not one.meant]
    if others:
        more = f" and {len(others) - SHOWN} more" if len(others) > SHOWN else ""
        said.append(f"not read, as a block has no such table: {', '.join(others[:SHOWN])}{more}")
    return tuple(said)


def _meant(path: Path, folder: Path) -> str:
    """The table whose columns a file has, else whose name is near; only one that is not there."""
    missing = [name for name in TABLES if not any((folder / f"{name}{end}").is_file() for end in (".csv", ".parquet"))]
    columns = _header(path)
    fitting = {name: _share(columns, TABLES[name]) for name in missing}
    best = max(fitting, key=lambda name: fitting[name], default="")
    if best and fitting[best] >= LIKELY:
        return f"{best}{path.suffix if path.suffix == '.parquet' else '.csv'}"
    near = difflib.get_close_matches(path.stem.lower().replace(" ", "_").replace("-", "_"), missing, 1, SIMILAR)
    return f"{near[0]}.csv" if near else ""


def _share(columns: list[str], table: Columns) -> float:
    """Share of the columns that the table knows, 0 where one is missing that it needs besides σ and role."""
    wanted = {name for name in table.required if not name.startswith("s") and name != "role"}
    if not columns or not wanted <= set(columns):
        return 0.0
    return sum(name in table.known for name in columns) / len(columns)


def _header(path: Path) -> list[str]:
    """Names of the columns; [] where there are none to be read."""
    if path.suffix.lower() == ".parquet":
        return _parquet_header(path)
    try:
        with path.open("rb") as file:
            first = file.read(HEADER_BYTES).decode("utf-8-sig").splitlines()[:1]
    except (OSError, UnicodeDecodeError):
        return []
    return [cell.strip() for cell in next(csv.reader(first), [])]


def _parquet_header(path: Path) -> list[str]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        return list(pq.read_schema(path).names)
    except (OSError, pa.ArrowException):
        return []
