"""Metashape's "Omega Phi Kappa" list of cameras.

Comments begin with #, one of them names the columns: ``PhotoID, X, Y, Z, Omega, Phi, Kappa, r11, r12, … r33``; rows are
separated by tabs, or by commas. Angles in degrees, R = Rx(ω)·Ry(φ)·Rz(κ) camera → object. The matrix repeats the
angles; whether as R or as its transpose is not told, so it only has to agree with one of the two [C].
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aerotri.conventions import FilePath, counted
from aerotri.formats.assembly.losses import losses
from aerotri.formats.assembly.oriented import OrientedBlock
from aerotri.formats.assembly.parts import OrientationList, texts
from aerotri.formats.files.atomic import atomic_file
from aerotri.formats.foreign.list_systems import refuse_unknown_heights, system_above
from aerotri.formats.text.notes import left_behind
from aerotri.formats.text.text_lines import TextFile, first_lines
from aerotri.functional_model.rotation import angles_from_rotation, rotation_from_angles

COLUMNS = ("PhotoID", "X", "Y", "Z", "Omega", "Phi", "Kappa")
MATRIX = tuple(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))
"""Columns of the rotation matrix, row by row, as Metashape names them."""
AGREEMENT = 1e-4
"""Largest difference of an element of the matrix from that of the angles."""


def is_metashape(path: Path) -> bool:
    """Whether a comment of the file names the columns."""
    lines = [line for line in first_lines(path, 8, comments=False) if line.startswith("#")]
    return any(_columns(line)[:7] == [name.lower() for name in COLUMNS] for line in lines)


def _columns(line: str) -> list[str]:
    return [word.strip().lower() for word in line.lstrip("# ").replace("\t", ",").split(",")]


def read_metashape(path: FilePath) -> OrientationList:
    """Orientations of the cameras that have one.

    Raises
    ------
    InputError
        With the line: a row that is not of these columns, a matrix that contradicts the angles, a photograph twice.
    """
    file = TextFile(Path(path))
    separator = "\t" if any("\t" in line for line in file.lines) else ","
    words = file.words(separator)
    if not words:
        raise file.error(0, "holds no photographs", "export the cameras as Omega Phi Kappa")
    rows, left = [], 0
    for row, line in enumerate(words):
        if not any(line[1:7]):
            left += 1
            continue
        if len(line) < 7 or len(line) > 7 + len(MATRIX) or 7 < len(line) < 7 + len(MATRIX):
            message = f"the row has {len(line)} entries"
            raise file.error(row, message, f"rows are: {', '.join(COLUMNS)}, and nine elements of a matrix or none")
        rows.append(row)
    names = [words[row][0] for row in rows]
    file.check_names(names, rows, "photograph")
    file.refuse_repeated(names, rows, "photograph")
    values = file.table([words[row][1:7] for row in rows], rows, "value").reshape(-1, 6)
    rotation = rotation_from_angles(np.radians(values[:, 3:]))
    system, said = system_above(file.path)
    refuse_unknown_heights(file, system, values[:, 2])
    _check_matrices(file, words, rows, rotation)
    without = left_behind(f"{counted(left, 'photograph')} without orientation left out")
    return OrientationList(
        file.path,
        texts(names),
        np.full(len(names), ""),
        values[:, :3] * system.to_metre,
        rotation,
        messages=(*said, *([without] if left else [])),
        crs=system.crs,
    )


def _check_matrices(file: TextFile, words: list[list[str]], rows: list[int], rotation: np.ndarray) -> None:
    given = [(k, row) for k, row in enumerate(rows) if len(words[row]) > 7]
    if not given:
        return
    elements = file.table([words[row][7:] for _, row in given], [row for _, row in given], "element")
    matrix, wanted = elements.reshape(-1, 3, 3), rotation[[k for k, _ in given]]
    off = np.abs(matrix - wanted).max(axis=(1, 2))
    off_transposed = np.abs(matrix - np.swapaxes(wanted, 1, 2)).max(axis=(1, 2))
    bad = np.flatnonzero(np.minimum(off, off_transposed) > AGREEMENT)
    if len(bad):
        remedy = "export omega, phi, kappa again; yaw, pitch, roll are other angles"
        raise file.error(given[int(bad[0])][1], "the matrix contradicts omega, phi, kappa", remedy)


def write_metashape(oriented: OrientedBlock, path: FilePath) -> tuple[str, ...]:
    """Write the list, separated by tabs; the matrix is R, camera → object, row by row.

    Returns
    -------
    What could not be carried over, in words.

    Raises
    ------
    InputError
        When nothing is oriented.
    """
    rows = oriented.rows_with_orientation("a list of cameras")
    block = oriented.block
    angles = np.degrees(angles_from_rotation(oriented.rotation[rows]))
    with atomic_file(path) as place, place.open("w", encoding="utf-8", newline="\n") as file:
        file.write(f"# Cameras ({len(rows)})\n# {', '.join([*COLUMNS, *MATRIX])}\n")
        for row, opk in zip(rows.tolist(), angles.tolist(), strict=True):
            numbers = [
                *(f"{value:.6f}" for value in oriented.centre[row]),
                *(f"{value:.12f}" for value in opk),
                *(f"{value:.12f}" for value in oriented.rotation[row].ravel()),
            ]
            file.write("\t".join([str(block.images.names[row]), *numbers]) + "\n")
    return (*losses(block, "orientations"), *oriented.unoriented())
