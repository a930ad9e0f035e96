"""Files of the French mapping agency IGN: orientations (.OPK), image points (.mes), control (.app) and cameras (.txt).

.OPK : a header ``NOM X Y Z O P K CAMERA``, then a row a photograph; ω, φ, κ in degrees (settled by reprojection where
there are image points), R = Rx·Ry·Rz. Heights are as a rule above the geoid and corrected for the scale of the
projection ("altération linéaire", see `without_linear_alteration`). .mes : ``point photo column row``, pixels with 0
the corner of the first one (the principal point of a symmetric camera is half its format); 0 0 is not measured. .app :
``"point" code X Y Z``. Camera: ``Name, PPAx, PPAy, focal, width, height``, each ``key = value``, pixels.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aerotri.conventions import RADIANS_PER, FilePath, InputError, counted, mm_from_px
from aerotri.formats.assembly.losses import losses
from aerotri.formats.assembly.oriented import OrientedBlock
from aerotri.formats.assembly.parts import OrientationList, PointList, RayList, no_sigma, texts
from aerotri.formats.files.atomic import atomic_file
from aerotri.formats.text.notes import left_behind
from aerotri.formats.text.tables import LARGEST_FORMAT_PX, SMALLEST_POSITIVE
from aerotri.formats.text.text_lines import TextFile, all_numbers, check_words, first_lines
from aerotri.functional_model.rotation import angles_from_rotation, rotation_from_angles
from aerotri.observations import Camera, Prior

HEADERS = (["NOM", "X", "Y", "Z", "O", "P", "K"], ["N", "X", "Y", "Z", "O", "P", "K"])
CAMERA_KEYS = ("name", "ppax", "ppay", "focal", "width", "height")
UNIT_NAMES = {"deg": "degrees", "gon": "gon", "rad": "radians"}


def is_ign_opk(path: Path) -> bool:
    """Whether a file begins with the header of an .OPK file."""
    lines = first_lines(path, 1)
    return bool(lines) and lines[0].upper().split()[:7] in HEADERS


def is_ign_mes(path: Path) -> bool:
    """Whether a file begins with a point, a photograph and two numbers."""
    lines = [line.split() for line in first_lines(path, 2)]
    return bool(lines) and all(len(line) == 4 and all_numbers(line[2:]) and not all_numbers(line[1:]) for line in lines)


def is_ign_app(path: Path) -> bool:
    """Whether a file begins with a point, a code and three coordinates."""
    lines = [line.split() for line in first_lines(path, 2)]
    # a code has three digits at most: longer ones are coordinates, of a list that is another one
    return bool(lines) and all(
        len(line) == 5 and line[1].isdigit() and len(line[1]) <= 3 and all_numbers(line[1:]) for line in lines
    )


def is_ign_camera(path: Path) -> bool:
    """Whether a file is the description of a camera."""
    keys = [line.partition("=")[0].strip().lower() for line in first_lines(path)]
    return {"ppax", "ppay", "focal"} <= set(keys)


def is_ign(path: Path) -> bool:
    """Whether a folder holds an .OPK file."""
    return path.is_dir() and bool(files_of(path, ".opk"))


def files_of(folder: Path, ending: str) -> list[Path]:
    """The files of an ending, upper or lower case, in order of their names."""
    return sorted(path for path in folder.iterdir() if path.suffix.lower() == ending and path.is_file())


def read_ign_opk(path: FilePath) -> OrientationList:
    """Orientations; the units of the angles other than degrees are offered as choices.

    Raises
    ------
    InputError
        With the line.
    """
    file = TextFile(Path(path))
    words = file.words()
    if not words or [word.upper() for word in words[0][:7]] not in HEADERS:
        raise file.error(0, "does not begin with NOM X Y Z O P K CAMERA", "give an .OPK file")
    rows = list(range(1, len(words)))
    for row in rows:
        if len(words[row]) != len(words[0]):
            message = f"the row has {len(words[row])} entries, the header {len(words[0])}"
            raise file.error(row, message, "give every photograph all columns; is the file cut off?")
    if not rows:
        raise file.error(0, "holds no photographs", "give a row for each")
    names = [words[row][0] for row in rows]
    file.check_names(names, rows, "photograph")
    file.refuse_repeated(names, rows, "photograph")
    values = file.table([words[row][1:7] for row in rows], rows, "value")
    cameras = [words[row][7] if len(words[row]) > 7 else "" for row in rows]
    if len(words[0]) > 7:
        file.check_names(cameras, rows, "camera")
    rotations = tuple((UNIT_NAMES[u], rotation_from_angles(values[:, 3:] * RADIANS_PER[u])) for u in UNIT_NAMES)
    said = "heights of .OPK files are as a rule above the geoid and corrected for the scale of the projection"
    return OrientationList(
        file.path, texts(names), texts(cameras), values[:, :3], rotations[0][1], rotations, first_unless=True,
        messages=(said,),
    )  # fmt: skip


def read_ign_mes(path: FilePath) -> RayList:
    """Image points; rows of 0 0 are left out.

    Raises
    ------
    InputError
        With the line.
    """
    file = TextFile(Path(path))
    words = [[word.strip('"') for word in line[:2]] + line[2:] for line in file.words()]
    rows = list(range(len(words)))
    for row in rows:
        if len(words[row]) != 4:
            raise file.error(row, f"the row has {len(words[row])} entries", "rows are: point photo column row")
    px = file.table([line[2:] for line in words], rows, "pixel position").reshape(-1, 2)
    file.check_names([line[0] for line in words], rows, "point")
    file.check_names([line[1] for line in words], rows, "photograph")
    file.refuse_repeated([f"{line[0]}' in photograph '{line[1]}" for line in words], rows, "point")
    measured = np.flatnonzero((px != 0.0).any(axis=1))
    images: dict[str, int] = {}
    points: dict[str, int] = {}
    image = [images.setdefault(words[row][1], len(images)) for row in measured]
    point = [points.setdefault(words[row][0], len(points)) for row in measured]
    left = len(words) - len(measured)
    return RayList(
        path=file.path,
        images=texts(list(images)),
        cameras=np.full(len(images), ""),
        points=texts(list(points)),
        image=np.array(image, dtype=np.int64),
        point=np.array(point, dtype=np.int64),
        xy=px[measured],
        unit="px",
        focal_length_mm=np.full(len(images), np.nan),
        messages=(left_behind(f"{file.path.name}: {counted(left, 'row')} of 0 0 left out: not measured"),)
        if left
        else (),
    )


def read_ign_app(path: FilePath) -> PointList:
    """Control points; the codes are not interpreted.

    Raises
    ------
    InputError
        With the line.
    """
    file = TextFile(Path(path))
    words = file.words()
    rows = list(range(len(words)))
    for row, line in enumerate(words):
        if len(line) != 5 or not line[1].isdigit():
            raise file.error(row, "the row is no control point", 'rows are: "point" code X Y Z')
    names = [line[0].strip('"') for line in words]
    file.check_names(names, rows, "point")
    file.refuse_repeated(names, rows, "point")
    xyz = file.table([line[2:] for line in words], rows, "coordinate").reshape(-1, 3)
    codes = ", ".join(sorted({line[1][:9] for line in words}))
    about = f"the codes of the points ({codes}) are not interpreted: all are control unless named with --check"
    said = left_behind(about)
    return PointList(file.path, texts(names), xyz, no_sigma(len(xyz)), np.zeros(len(xyz), bool), messages=(said,))


def read_ign_camera(path: FilePath, pixel_um: float) -> Camera:
    """A camera without lens parameters.

    Parameters
    ----------
    pixel_um : size of a pixel, which the file does not tell.

    Raises
    ------
    InputError
    """
    file = TextFile(Path(path))
    found: dict[str, tuple[int, str]] = {}
    for row, line in enumerate(file.lines):
        key, _, value = line.partition("=")
        found.setdefault(key.strip().lower(), (row, value.strip()))
    for key in CAMERA_KEYS:
        if key not in found:
            raise InputError(f"has no line '{key} = …'", f"a camera has {', '.join(CAMERA_KEYS)}", file.path)
    rows, words = zip(*(found[key] for key in CAMERA_KEYS[1:]), strict=True)
    px, py, focal, width, height = file.values(words, rows, "value").tolist()
    for row, value in ((rows[2], focal), (rows[3], width), (rows[4], height)):
        if not SMALLEST_POSITIVE <= value <= LARGEST_FORMAT_PX or (row != rows[2] and value != int(value)):
            raise file.error(row, f"{value:g} is not possible here", "sizes are pixels, greater than 0")
    name_row, name = found["name"]
    file.check_names([name], [name_row], "camera")
    size = (int(width), int(height))
    x0, y0 = mm_from_px(np.array([[px, py]]), size, pixel_um * 1e-3)[0].tolist()
    held = {"focal_length_mm": focal * pixel_um * 1e-3, "x0_mm": x0, "y0_mm": y0}
    interior = {element: Prior(value, fixed=True) for element, value in held.items()}
    return Camera(name, "frame", size, pixel_um, interior)


def without_linear_alteration(height: np.ndarray, ground: float, scale: np.ndarray) -> np.ndarray:
    """Heights of projection centres free of the correction for the scale of the projection.

    Parameters
    ----------
    height : (n,) m, as given: true + (scale − 1)·(true − ground).
    ground : m, mean height of the ground.
    scale : (n,) of the projection at the photographs.

    Returns
    -------
    (n,) m.
    """
    return (height + (scale - 1.0) * ground) / scale


def write_ign_opk(oriented: OrientedBlock, path: FilePath) -> tuple[str, ...]:
    """Write an .OPK file: positions to a tenth of a millimetre, angles in degrees with twelve decimals.

    Returns
    -------
    What could not be carried over, in words.

    Raises
    ------
    InputError
        When nothing is oriented, or a name has a blank.
    """
    rows = oriented.rows_with_orientation("an .OPK file")
    block = oriented.block
    cameras = np.array([camera.name for camera in block.cameras])[block.images.camera[rows]]
    check_words(block.images.names[rows], "photograph", ".OPK")
    check_words(cameras, "camera", ".OPK")
    angles = np.degrees(angles_from_rotation(oriented.rotation[rows]))
    with atomic_file(path) as place, place.open("w", encoding="utf-8", newline="") as file:
        file.write("\t".join([*HEADERS[0], "CAMERA"]) + "\r\n")
        for row, opk, camera in zip(rows.tolist(), angles.tolist(), cameras.tolist(), strict=True):
            centre = " ".join(f"{value:14.4f}" for value in oriented.centre[row])
            turned = " ".join(f"{value:18.12f}" for value in opk)
            file.write(f"{block.images.names[row]} {centre} {turned}     {camera}\r\n")
    said = "heights are those of the block, without a correction for the scale of the projection"
    return (*losses(block, "orientations"), *oriented.unoriented(), said)
