"""Lists of Pix4D: ground control, image positions, exterior orientation, and the offset of its local coordinates.

Ground control, no header: ``label,c1,c2,z[,acc_h,acc_v]``. Image positions: ``image,c1,c2,z[,yaw,pitch,roll][,acc_h,
acc_v]``; one accuracy instead of two counts for all three coordinates [C]. c1, c2 come in the order that the coordinate
system has or the writer chose: the reader is told. Exterior orientation: a header ``imageName X Y Z Omega Phi Kappa``,
rows separated by blanks, degrees, R = Rx·Ry·Rz camera → object. Offset (``…_offset.xyz``): what is to be added to local
X Y Z.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aerotri.conventions import FilePath, InputError, counted
from aerotri.coordinates.stated_systems import StatedSystem
from aerotri.formats.assembly.losses import losses
from aerotri.formats.assembly.oriented import OrientedBlock
from aerotri.formats.assembly.parts import OrientationList, PointList, PositionList, no_sigma, texts
from aerotri.formats.files.atomic import atomic_file
from aerotri.formats.foreign.list_header import is_named
from aerotri.formats.foreign.list_systems import axes_of, order_of_axes, refuse_unknown_heights, system_above
from aerotri.formats.text.notes import assumed
from aerotri.formats.text.sigmas import REMEDY, impossible_sigmas, why_impossible
from aerotri.formats.text.text_lines import TextFile, all_numbers, check_words, first_lines
from aerotri.functional_model.rotation import angles_from_rotation, rotation_from_angles
from aerotri.observations import Block

EO_HEADER = ["imageName", "X", "Y", "Z", "Omega", "Phi", "Kappa"]
GCP_WIDTHS, GEO_WIDTHS = (4, 5, 6), (4, 5, 6, 7, 8, 9)
"""Entries of a row, the name among them: a position, then one or two accuracies; of photographs also three angles in
front of them."""
AXES = ("xy", "yx")


def is_pix4d_eo(path: Path) -> bool:
    """Whether a file begins with the header of exterior orientations."""
    lines = first_lines(path, 1)
    return bool(lines) and lines[0].split() == EO_HEADER


def is_pix4d_gcp(path: Path) -> bool:
    """Whether rows are a name and three to five numbers."""
    return _is_list(path, GCP_WIDTHS)


def is_pix4d_geo(path: Path) -> bool:
    """Whether rows are a name and three to eight numbers."""
    return _is_list(path, GEO_WIDTHS)


def _is_list(path: Path, widths: tuple[int, ...]) -> bool:
    lines = [line.split(",") for line in first_lines(path, 3)]
    rows = [len(line) in widths and all_numbers([word.strip() for word in line[1:]]) for line in lines]
    return bool(lines) and all(rows) and not is_named(path)


def read_pix4d_eo(path: FilePath, offset: np.ndarray | None = None) -> OrientationList:
    """Exterior orientations.

    Parameters
    ----------
    offset : (3,) m, added to the positions.

    Raises
    ------
    InputError
        With the line.
    """
    file = TextFile(Path(path))
    words = file.words()
    if not words or words[0] != EO_HEADER:
        raise file.error(0, f"does not begin with {' '.join(EO_HEADER)}", "give an exterior orientation of Pix4D")
    rows = list(range(1, len(words)))
    for row in rows:
        if len(words[row]) < 7:
            raise file.error(row, f"the row has {len(words[row])} entries", f"rows are: {' '.join(EO_HEADER)}")
    names = [" ".join(words[row][:-6]) for row in rows]
    file.check_names(names, rows, "photograph")
    file.refuse_repeated(names, rows, "photograph")
    values = file.table([words[row][-6:] for row in rows], rows, "value").reshape(-1, 6)
    rotation = rotation_from_angles(np.radians(values[:, 3:]))
    centre = values[:, :3] + (0.0 if offset is None else offset)
    return OrientationList(file.path, texts(names), np.full(len(names), ""), centre, rotation)


def read_pix4d_offset(path: FilePath) -> np.ndarray:
    """(3,) m, from an _offset.xyz file.

    Raises
    ------
    InputError
    """
    file = TextFile(Path(path))
    words = file.words()
    if len(words) != 1 or len(words[0]) != 3:
        raise file.error(0, "is no offset", "it is one row of three numbers")
    return file.values(words[0], [0, 0, 0], "offset")


def read_pix4d_gcp(path: FilePath, axes: str | None = None, crs: str = "") -> PointList:
    """Ground control points.

    Parameters
    ----------
    axes : 'xy' when c1 is X (east, longitude), 'yx' when it is Y (north, latitude); None: as the system has them that
        a comment names, or else `crs`.

    Raises
    ------
    InputError
        With the line.
    """
    file, names, values = _rows(Path(path), GCP_WIDTHS, "label,c1,c2,z, then acc_h,acc_v or not", "point")
    xyz, system, messages = _placed(file, values, axes, crs)
    sigma = _spread(file, values[:, 3:], may_be_zero=True) * system.to_metre
    return PointList(file.path, texts(names), xyz, sigma, np.zeros(len(names), bool), system.crs, messages=messages)


def read_pix4d_geo(path: FilePath, axes: str | None = None, crs: str = "") -> PositionList:
    """Positions of photographs, with yaw, pitch and roll where the file has them.

    Parameters
    ----------
    axes, crs : as in `read_pix4d_gcp`.

    Raises
    ------
    InputError
        With the line.
    """
    form = "image,c1,c2,z, then yaw,pitch,roll or not, then acc_h,acc_v or not"
    file, names, values = _rows(Path(path), GEO_WIDTHS, form, "photograph")
    has_angles = values.shape[1] > 5
    angles = np.radians(values[:, 3:6]) if has_angles else no_sigma(len(names))
    xyz, system, messages = _placed(file, values, axes, crs, has_angles)
    sigma = _spread(file, values[:, 6 if has_angles else 3 :]) * system.to_metre
    return PositionList(file.path, texts(names), xyz, sigma, angles, system.crs, messages)


def _placed(
    file: TextFile, values: np.ndarray, axes: str | None, crs: str, has_angles: bool = False
) -> tuple[np.ndarray, StatedSystem, tuple[str, ...]]:
    """(n, 3) m in the order X, Y, Z, the system that a comment names, and what to say of the list.

    Accuracies count as the coordinates do, beside degrees in metres [L: Pix4D].
    """
    system, said = system_above(file.path)
    refuse_unknown_heights(file, system, values[:, 2])
    axes = axes_of(system.crs or crs) if axes is None else axes
    return (
        _ordered(values[:, :3], axes) * system.to_metre,
        system,
        (*_guessed(file, values, axes, has_angles), *said),
    )


def _guessed(file: TextFile, values: np.ndarray, axes: str, has_angles: bool) -> tuple[str, ...]:
    """How the columns were taken, which no line of the file names."""
    accuracies = {1: ("accuracy",), 2: ("accuracy in plan", "accuracy of the height")}
    left = values.shape[1] - (6 if has_angles else 3)
    columns = (
        *("name", *axes.upper(), "Z"),
        *(("yaw", "pitch", "roll") if has_angles else ()),
        *accuracies.get(left, ()),
    )
    said = f"{file.path.name}: no line names the columns; taken as {', '.join(columns)}"
    return (*file.notes, assumed(f"{said}: state others with --columns"))


def _rows(path: Path, widths: tuple[int, ...], form: str, what: str) -> tuple[TextFile, list[str], np.ndarray]:
    """Names and numbers of a comma separated list of constant width."""
    file = TextFile(path, any_letters=True)
    words = file.words(",")
    if not words:
        raise file.error(0, f"holds no {what}s", f"rows are: {form}")
    rows = list(range(len(words)))
    for row in rows:
        if len(words[row]) not in widths or len(words[row]) != len(words[0]):
            raise file.error(row, f"the row has {len(words[row])} cells", f"all rows are: {form}")
    names = [line[0] for line in words]
    file.check_names(names, rows, what)
    file.refuse_repeated(names, rows, what)
    return file, names, file.table([line[1:] for line in words], rows, "value")


def _ordered(values: np.ndarray, axes: str) -> np.ndarray:
    if axes not in AXES:
        raise InputError(f"axes = '{axes}'", "xy or yx")
    return values[:, order_of_axes(axes == "yx")]


def _spread(file: TextFile, accuracy: np.ndarray, may_be_zero: bool = False) -> np.ndarray:
    """(n, 3) σ of horizontal and vertical accuracies, of one for both, or of none."""
    if not accuracy.shape[1]:
        return no_sigma(len(accuracy))
    bad = np.argwhere(impossible_sigmas(accuracy, may_be_zero))
    if len(bad):
        row, k = bad[0].tolist()
        raise file.error(row, f"an accuracy {why_impossible(float(accuracy[row, k]), may_be_zero)}", REMEDY)
    return accuracy[:, [0, 0, -1]]


def write_pix4d_eo(oriented: OrientedBlock, path: FilePath) -> tuple[str, ...]:
    """Write exterior orientations: positions to a micrometre, angles to twelve decimals of a degree.

    Returns
    -------
    What could not be carried over, in words.

    Raises
    ------
    InputError
        When nothing is oriented, or a name has a blank.
    """
    rows = oriented.rows_with_orientation("a list of orientations")
    names = oriented.block.images.names[rows]
    check_words(names, "photograph", "Pix4D's list")
    angles = np.degrees(angles_from_rotation(oriented.rotation[rows]))
    with atomic_file(path) as place, place.open("w", encoding="utf-8", newline="\n") as file:
        file.write(" ".join(EO_HEADER) + "\n")
        for name, centre, opk in zip(names.tolist(), oriented.centre[rows].tolist(), angles.tolist(), strict=True):
            numbers = [*(f"{value:.6f}" for value in centre), *(f"{value:.12f}" for value in opk)]
            file.write(" ".join([name, *numbers]) + "\n")
    return (*losses(oriented.block, "orientations"), *oriented.unoriented())


def write_pix4d_gcp(block: Block, path: FilePath) -> tuple[str, ...]:
    """Write control and check points as ``label,X,Y,Z,acc_h,acc_v``; the horizontal accuracy is the larger of X and Y.

    Returns
    -------
    What could not be carried over, in words.

    Raises
    ------
    InputError
        When there are none.
    """
    control = block.control
    rows = np.flatnonzero(np.isfinite(control.xyz).all(axis=1))
    if not len(rows):
        raise InputError(
            f"block '{block.name}' has no control points known in X, Y and Z",
            "add such points to control.csv, or write another format",
        )
    sigma = np.column_stack([control.sigma[rows, :2].max(axis=1), control.sigma[rows, 2]])
    _write_list(path, block.points[control.point[rows]], np.hstack([control.xyz[rows], sigma]))
    partial = len(control) - len(rows)
    checks = int(control.is_check.sum())
    said = (
        (f"could not be carried over: {counted(partial, 'point')} with only plan position or height", partial),
        (f"{counted(checks, 'check point')} written like control points: the format does not tell them apart", checks),
    )
    return (*losses(block, "control", "control sigmas", "check points"), *(words for words, count in said if count))


def write_pix4d_geo(block: Block, path: FilePath) -> tuple[str, ...]:
    """Write observed positions as ``image,X,Y,Z,acc_h,acc_v``.

    Returns
    -------
    What could not be carried over, in words.

    Raises
    ------
    InputError
        When there are none.
    """
    observed = block.gnss_ins
    rows = np.zeros(0, np.int64) if observed is None else np.flatnonzero(np.isfinite(observed.xyz).all(axis=1))
    if observed is None or not len(rows):
        raise InputError(
            f"block '{block.name}' has no observed positions", "add them in gnss_ins.csv, or write another format"
        )
    sigma = np.column_stack([observed.sigma[rows, :2].max(axis=1), observed.sigma[rows, 2]])
    _write_list(path, block.images.names[observed.image[rows]], np.hstack([observed.xyz[rows], sigma]))
    attitudes = int(np.isfinite(observed.angles).all(axis=1).sum())
    said = (f"could not be carried over: {counted(attitudes, 'observed attitude')}",) if attitudes else ()
    return (*losses(block, "gnss"), *said)


def _write_list(path: FilePath, names: np.ndarray, values: np.ndarray) -> None:
    odd = [name for name in names.tolist() if "," in name or name.startswith("#")]
    if odd:
        raise InputError(f"'{odd[0]}' cannot stand in a list separated by commas", "rename it")
    with atomic_file(path) as place, place.open("w", encoding="utf-8", newline="\n") as file:
        for name, row in zip(names.tolist(), values.tolist(), strict=True):
            file.write(",".join([name, *(f"{value:.6f}" for value in row)]) + "\n")
