"""RealityCapture's (RealityScan's) list of registrations: ``#name,x,y,alt,heading,pitch,roll`` and what follows.

Angles in degrees, heading clockwise from grid north; all of them zero is a photograph that looks straight down with its
top to the north: R = Rz(−heading)·Rx(pitch)·Ry(roll), x right, y up, z backwards → object [L: nerfstudio's reader of
these lists]. Focal length and lens are not taken: the format of the photographs is not in the list.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aerotri.conventions import FilePath
from aerotri.formats.assembly.parts import OrientationList, texts
from aerotri.formats.text.notes import left_behind
from aerotri.formats.text.text_lines import TextFile, first_lines

COLUMNS = ("name", "x", "y", "alt", "heading", "pitch", "roll")


def is_realitycapture(path: Path) -> bool:
    """Whether a comment of the file names the columns."""
    return any(_is_header(_names(line)) for line in first_lines(path, 4, comments=False))


def _is_header(names: list[str]) -> bool:
    return names[: len(COLUMNS)] == list(COLUMNS)


def _names(line: str) -> list[str]:
    return [word.strip().lower() for word in line.lstrip("#").split(",")] if line.startswith("#") else []


def read_realitycapture(path: FilePath) -> OrientationList:
    """The orientations of a list.

    Raises
    ------
    InputError
        With the line: a row that is too short, no number, a photograph twice.
    """
    file = TextFile(Path(path))
    header = next(
        (names for line in first_lines(file.path, 4, comments=False) if _is_header(names := _names(line))), None
    )
    if header is None:
        raise file.error(0, "does not name its columns", f"begin it with #{','.join(COLUMNS)}")
    words = file.words(",")
    rows = list(range(len(words)))
    if not rows:
        raise file.error(0, "holds no photographs", "export the registrations again")
    for row in rows:
        if len(words[row]) < len(COLUMNS):
            raise file.error(row, f"the row has {len(words[row])} entries", f"rows are: {','.join(COLUMNS)},…")
    names = [words[row][0].strip('"') for row in rows]
    file.check_names(names, rows, "photograph")
    file.refuse_repeated(names, rows, "photograph")
    values = file.table([words[row][1 : len(COLUMNS)] for row in rows], rows, "value").reshape(-1, 6)
    others = header[len(COLUMNS) :]
    said = left_behind(f"{file.path.name}: not used: {', '.join(others)[:120]}; state the camera with --camera")
    return OrientationList(
        file.path,
        texts(names),
        np.full(len(names), ""),
        values[:, :3],
        rotation_of_registration(np.radians(values[:, 3:])),
        messages=(said,) if others else (),
    )


def rotation_of_registration(angles: np.ndarray) -> np.ndarray:
    """(n, 3, 3) camera → object of heading, pitch and roll (n, 3) in radians."""
    (ch, cp, cr), (sh, sp, sr) = np.cos(angles).T, np.sin(angles).T
    columns = [
        [ch * cr + sh * sp * sr, -sh * cr + ch * sp * sr, -cp * sr],
        [sh * cp, ch * cp, sp],
        [ch * sr - sh * sp * cr, -sh * sr - ch * sp * cr, cp * cr],
    ]
    return np.stack([np.stack(column, axis=-1) for column in columns], axis=-1)
