"""PAT-B: image points (.im), orientations (.ori) and control (.con).

.im : sections ``photo c``, ``point x y [class]`` … ``-99``, x, y and c in µm (or in mm: c below 1000 tells [C]), from
the principal point, x right, y up. .ori : three lines a photograph, ``I16,16x,3F16.5`` photo X0 Y0 Z0, ``5F16.12`` a11
a12 a13 a21 a22, ``4F16.12`` a23 a31 a32 a33. Whether that matrix turns camera into object coordinates or the other way
differs between writers: reprojection of tie points decides. .con : rows ``point X Y Z [h v]`` up to ``-99`` or the end,
h and v classes of accuracy, 0 where plan position or height is no control; 1 and 1 where they are left out [C].
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from aerotri.conventions import FilePath, InputError, counted
from aerotri.formats.assembly.losses import losses
from aerotri.formats.assembly.oriented import OrientedBlock
from aerotri.formats.assembly.parts import OrientationList, PointList, RayList, no_sigma, texts
from aerotri.formats.files.atomic import atomic_folder
from aerotri.formats.foreign.bingo import FARTHEST_MM
from aerotri.formats.text.notes import assumed, left_behind
from aerotri.formats.text.tables import SMALLEST_POSITIVE
from aerotri.formats.text.text_lines import TextFile, all_numbers, first_lines, is_number
from aerotri.observations import Block
from aerotri.spreadsheet import without_formula

END = "-99"
SMALLEST_C_UM = 1000.0
"""Principal distances below are millimetres: no lens is shorter than 1 mm, none of an aerial camera longer than 1 m."""
CAMERA_TO_OBJECT, OBJECT_TO_CAMERA = "camera-to-object", "object-to-camera"
ROTATIONS = (CAMERA_TO_OBJECT, OBJECT_TO_CAMERA)
WIDTH = 16
"""Longest name of a photograph or point."""
FILES = ("block.im", "block.ori", "block.con", "names.csv")
SKEW = 1e-4
"""Largest deviation of RᵀR from the unit matrix in a rotation written with twelve decimals or fewer."""


def is_patb_im(path: Path) -> bool:
    """Whether a file begins with a photograph, its principal distance, and an image point or the end."""
    lines = [line.split() for line in first_lines(path)]
    if len(lines) < 2 or len(lines[0]) != 2 or not is_number(lines[0][1]):
        return False
    return lines[1] == [END] or (len(lines[1]) in (3, 4) and all_numbers(lines[1][1:]))


def is_patb_ori(path: Path) -> bool:
    """Whether a file begins with lines of 4, 5 and 4 words, numbers but for the first."""
    lines = [line.split() for line in first_lines(path)]
    if [len(line) for line in lines[:3]] != [4, 5, 4]:
        return False
    return all_numbers(lines[0][1:]) and all_numbers(lines[1]) and all_numbers(lines[2])


def is_patb_con(path: Path) -> bool:
    """Whether a file begins with a point, three coordinates, and two small classes or nothing."""
    lines = [line.split() for line in first_lines(path, 1)]
    if not lines or len(lines[0]) not in (4, 6) or not all_numbers(lines[0][1:]):
        return False
    return all(_is_class(word) for word in lines[0][4:])


def _is_class(word: str) -> bool:
    return word.isascii() and word.isdigit() and len(word) < 3


def read_patb_im(path: FilePath) -> RayList:
    """Image points from an .im file.

    Raises
    ------
    InputError
        With the line: a section without head or end, a row that is no image point, a photograph or point there twice.
    """
    file = TextFile(Path(path), comments=False)
    words = file.words()
    heads, _, _ = _sections(file, words)
    # one unit for the whole file, as writers have it
    in_mm = all(float(words[row][1]) < SMALLEST_C_UM for row in heads)
    found = patb_im_of(file, in_mm)
    if not len(found.rays.image):
        raise no_measurements(file)
    return replace(found.rays, messages=about_im(in_mm, found.classes))


@dataclass(frozen=True, eq=False)
class ImPart:
    """Image points of whole sections of an .im file.

    Parameters
    ----------
    rays : without messages. heads : row of each photograph. classes : texts behind the coordinates, each once.
    """

    rays: RayList
    heads: list[int]
    classes: frozenset[tuple[str, ...]]


def about_im(in_mm: bool, classes: frozenset[tuple[str, ...]]) -> tuple[str, ...]:
    """What to say of an .im file with these classes of image points."""
    said = [assumed("coordinates are taken as mm: the principal distances are below 1000")] if in_mm else []
    lost = left_behind("could not be carried over: the classes of the image points")
    return (*said, *([lost] if len(classes) > 1 else []))


def no_measurements(file: TextFile) -> InputError:
    """The error of a file without image points."""
    return file.error(0, "holds no image points", "give a file with measurements")


def is_in_mm(path: Path) -> bool:
    """Whether all principal distances of an .im file are millimetres, its lines read one by one."""
    inside, in_mm = False, True
    with path.open("rb") as file:
        for line in file:
            words = line.split()
            if words == [END.encode()]:
                inside = False
            elif words and not inside:
                inside = True
                word = words[-1].decode("utf-8", "replace")
                in_mm = in_mm and is_number(word) and float(word) < SMALLEST_C_UM
    return in_mm


def patb_im_of(file: TextFile, in_mm: bool) -> ImPart:
    """Image points of the sections of an .im file, or of some of them.

    Parameters
    ----------
    in_mm : whether its coordinates are mm, else µm.

    Raises
    ------
    InputError
        As `read_patb_im`, but for what concerns photographs of other sections.
    """
    words = file.words()
    heads, rows, image = _sections(file, words)
    images = [words[row][0] for row in heads]
    file.check_names(images, heads, "photograph")
    file.refuse_repeated(images, heads, "photograph")
    c = file.values([words[row][1] for row in heads], heads, "principal distance")
    small = np.flatnonzero(c < SMALLEST_POSITIVE)
    if len(small):
        raise file.error(heads[int(small[0])], "the principal distance is not greater than 0", "give it in µm")
    scale = 1.0 if in_mm else 1e-3
    xy = file.table([words[row][1:3] for row in rows], rows, "image coordinate").reshape(-1, 2) * scale
    place: dict[str, int] = {}
    point = np.array([place.setdefault(words[row][0], len(place)) for row in rows], dtype=np.int64)
    file.check_names([words[row][0] for row in rows], rows, "point")
    file.refuse_repeated(
        [f"{words[row][0]}' in photograph '{images[i]}" for row, i in zip(rows, image, strict=True)], rows, "point"
    )
    far = np.flatnonzero((np.abs(xy) > FARTHEST_MM).any(axis=1))
    if len(far):
        raise file.error(
            rows[int(far[0])],
            "an image point lies outside of any image",
            "give coordinates in µm from the image centre",
        )
    rays = RayList(
        file.path, texts(images), np.full(len(images), ""), texts(list(place)), np.array(image, dtype=np.int64), point,
        xy, "mm", c * scale,
    )  # fmt: skip
    return ImPart(rays, heads, frozenset(tuple(words[row][3:]) for row in rows))


def _sections(file: TextFile, words: list[list[str]]) -> tuple[list[int], list[int], list[int]]:
    """Rows of the heads, rows of the image points and the photograph of each, checked for their form."""
    heads, rows, image, inside = [], [], [], False
    for row, line in enumerate(words):
        if line == [END]:
            # a second one closes the file
            inside = False
        elif not inside:
            if len(line) != 2 or not is_number(line[1]):
                remedy = "a section begins: photo principal-distance"
                raise file.error(row, f"'{' '.join(line)[:60]}' begins no photograph", remedy)
            heads.append(row)
            inside = True
        elif len(line) not in (3, 4):
            remedy = f"rows are: point x y [class]; a photograph ends with {END}"
            raise file.error(row, f"the row has {len(line)} entries", remedy)
        else:
            rows.append(row)
            image.append(len(heads) - 1)
    if inside:
        photograph = words[heads[-1]][0][:60]
        raise file.error(len(words), f"photograph '{photograph}' does not end", f"close it with {END}; is it cut off?")
    return heads, rows, image


def read_patb_ori(path: FilePath, rotation: str | None = None) -> OrientationList:
    """Orientations from an .ori file.

    Parameters
    ----------
    rotation : 'camera-to-object' or 'object-to-camera', the meaning of the matrix; None: both are offered as choices.

    Raises
    ------
    InputError
        With the line: rows missing, no numbers, a matrix that is no rotation, a photograph there twice.
    """
    file = TextFile(Path(path), comments=False)
    words = file.words()
    if words and words[-1] == [END]:
        words = words[:-1]
    heads = list(range(0, len(words), 3))
    for row, line in enumerate(words):
        wanted = (4, 5, 4)[row % 3]
        if len(line) != wanted:
            remedy = "a photograph has three lines: photo X0 Y0 Z0, five and four elements of the matrix"
            raise file.error(row, f"the row has {len(line)} entries, not {wanted}", remedy)
    if not words or len(words) % 3:
        raise file.error(len(words), "ends within a photograph" if words else "is empty", "is it cut off?")
    names = [words[row][0] for row in heads]
    file.check_names(names, heads, "photograph")
    file.refuse_repeated(names, heads, "photograph")
    centre = file.table([words[row][1:] for row in heads], heads, "coordinate")
    elements = file.table([words[row + 1] + words[row + 2] for row in heads], [row + 1 for row in heads], "element")
    matrix = elements.reshape(-1, 3, 3)
    skew = np.abs(matrix @ np.swapaxes(matrix, 1, 2) - np.eye(3)).max(axis=(1, 2))
    bad = np.flatnonzero((skew > SKEW) | (np.linalg.det(matrix) < 0.0))
    if len(bad):
        raise file.error(3 * int(bad[0]) + 1, "the matrix is no rotation", "its rows are a11 a12 a13, a21 …")
    readings = {CAMERA_TO_OBJECT: matrix, OBJECT_TO_CAMERA: np.swapaxes(matrix, 1, 2)}
    cameras = np.full(len(names), "")
    if rotation is not None:
        return OrientationList(file.path, texts(names), cameras, centre, readings[rotation])
    return OrientationList(file.path, texts(names), cameras, centre, matrix, tuple(readings.items()))


def read_patb_con(path: FilePath) -> PointList:
    """Control points from a .con file.

    Raises
    ------
    InputError
        With the line: a row that is no control point, a point there twice.
    """
    file = TextFile(Path(path), comments=False)
    words = file.words()
    words = words[: words.index([END])] if [END] in words else words
    rows = list(range(len(words)))
    for row, line in enumerate(words):
        if len(line) not in (4, 6) or not all(_is_class(word) for word in line[4:]):
            remedy = "rows are: point X Y Z, or point X Y Z and the classes of plan position and height"
            raise file.error(row, "the row is no control point", remedy)
    names = [line[0] for line in words]
    file.check_names(names, rows, "point")
    file.refuse_repeated(names, rows, "point")
    xyz = file.table([line[1:4] for line in words], rows, "coordinate").reshape(-1, 3)
    wanted = np.array([[int(part) > 0 for part in line[4:] or ("1", "1")] for line in words], bool)
    wanted = wanted.reshape(-1, 2)[:, [0, 0, 1]]
    kept = wanted.any(axis=1)
    messages = []
    if not kept.all():
        about = f"left out: {counted(int((~kept).sum()), 'point')} of classes 0 0, which are not control"
        messages.append(left_behind(about))
    if len({tuple(line[4:]) for line in words}) > 1:
        about = "could not be carried over: the classes of the control points, but for 0 as unknown"
        messages.append(left_behind(about))
    xyz = np.where(wanted, xyz, np.nan)[kept]
    return PointList(
        file.path, texts(names)[kept], xyz, no_sigma(len(xyz)), np.zeros(len(xyz), bool), messages=tuple(messages)
    )


def write_patb(oriented: OrientedBlock, folder: FilePath) -> tuple[str, ...]:
    """Write block.im, block.ori and block.con; rotations turn camera into object coordinates.

    Names of more than 16 characters or with blanks are replaced by numbers, all of their kind; names.csv then says
    which. Image points are written as measured, from the principal point, to a nanometre.

    Returns
    -------
    What could not be carried over, in words.

    Raises
    ------
    InputError
        When there is nothing to write.
    """
    block = oriented.block
    if not len(block.image_points) and not oriented.oriented.any():
        raise InputError(f"block '{block.name}' has neither image points nor orientations", "give a block with some")
    photographs, points = _fitting_names(block.images.names), _fitting_names(block.points)
    renamed = [
        (kind, new, old)
        for kind, names, short in (("photo", block.images.names, photographs), ("point", block.points, points))
        if short is not names
        for new, old in zip(short.tolist(), names.tolist(), strict=True)
    ]
    contents = {
        "block.im": _im(block, photographs, points) if len(block.image_points) else [],
        "block.ori": _ori(oriented, photographs),
        "block.con": _con(block, points),
        "names.csv": ["kind,number,name", *(f"{k},{n},{_quoted(o)}" for k, n, o in renamed)],
    }
    with atomic_folder(folder, own=FILES) as place:
        for name, lines in contents.items():
            if lines and (name != "names.csv" or renamed):
                (place / name).write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
    lost = losses(block, "cameras", "principal points", "image points", "orientations", "control")
    numbered = (
        f"{counted(len(renamed), 'name is', 'names are')} too long for PAT-B and replaced by numbers, see names.csv"
    )
    return (*lost, *((numbered,) if renamed else ()), *oriented.unoriented())


def _quoted(name: str) -> str:
    return '"' + without_formula(name).replace('"', '""') + '"'


def _fitting_names(names: np.ndarray) -> np.ndarray:
    """The names as they are, or numbers from 1 where one of them does not fit."""
    fits = all(len(name) <= WIDTH and len(name.split()) == 1 and name != END for name in names.tolist())
    return names if fits else np.arange(1, len(names) + 1).astype(str)


def _im(block: Block, photographs: np.ndarray, points: np.ndarray) -> list[str]:
    rays, lines = block.image_points, []
    order = np.argsort(rays.image, kind="stable")
    bounds = np.searchsorted(rays.image[order], np.arange(len(block.images) + 1))
    for number, name in enumerate(photographs.tolist()):
        camera = block.cameras[block.images.camera[number]]
        own = order[bounds[number] : bounds[number + 1]]
        um = (rays.xy[own] - np.array(camera.principal_point_mm)) * 1e3
        lines.append(f"{name:>{WIDTH}} {camera.focal_length_mm * 1e3:15.3f}")
        named = zip(points[rays.point[own]].tolist(), um.tolist(), strict=True)
        lines += [f"{point:>{WIDTH}} {x:15.3f} {y:15.3f}" for point, (x, y) in named]
        lines.append(f"{END:>{WIDTH}}")
    return lines


def _ori(oriented: OrientedBlock, photographs: np.ndarray) -> list[str]:
    lines = []
    for row in np.flatnonzero(oriented.oriented).tolist():
        elements = oriented.rotation[row].ravel()
        centre = "".join(f"{value:{WIDTH}.5f}" for value in oriented.centre[row])
        lines.append(f"{photographs[row]:>{WIDTH}}{'':{WIDTH}}{centre}")
        lines += ["".join(f"{value:{WIDTH}.12f}" for value in part) for part in (elements[:5], elements[5:])]
    return lines


def _con(block: Block, points: np.ndarray) -> list[str]:
    control, lines = block.control, []
    for row in np.flatnonzero(~control.is_check).tolist():
        known = np.isfinite(control.xyz[row])
        # a plan position counts as a whole in PAT-B
        horizontal, vertical = int(known[:2].all()), int(known[2])
        if horizontal or vertical:
            values = " ".join(f"{value:16.5f}" for value in np.nan_to_num(control.xyz[row]))
            lines.append(f"{points[control.point[row]]:>{WIDTH}} {values} {horizontal} {vertical}")
    return [*lines, f"{END:>{WIDTH}}"] if lines else []
