"""OpenDroneMap's gcp_list.txt and geo.txt.

Both begin with the coordinate system: ``EPSG:n``, a PROJ string, WKT, or ``WGS84 UTM 16N``. gcp_list.txt then has
``geo_x geo_y geo_z im_x im_y image [point] [extras]``, a row an image point; pixels count from 0 at the CENTRE of the
upper left one, as OpenSfM takes them, so half a pixel is added. geo.txt has ``image geo_x geo_y [geo_z] [yaw] [pitch]
[roll] [h_acc v_acc]``, angles in degrees, pitch 0 straight down [C]. Names with blanks stand in quotes, or tabs
separate the entries; the name of an image ends where its file does.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from aerotri.conventions import FilePath, InputError, counted, px_from_mm
from aerotri.coordinates.stated_systems import StatedSystem, stated_system
from aerotri.formats.assembly.losses import losses
from aerotri.formats.assembly.parts import PointList, PositionList, RayList, no_sigma, texts
from aerotri.formats.files.atomic import atomic_file
from aerotri.formats.foreign.list_systems import exchange_in_words, in_words, order_of_axes, refuse_unknown_heights
from aerotri.formats.text.notes import assumed, left_behind
from aerotri.formats.text.sigmas import REMEDY, impossible_sigmas, why_impossible
from aerotri.formats.text.text_lines import TextFile, check_words, first_lines, is_number
from aerotri.observations import Block
from aerotri.observations.names import ENDING

FIRST_PIXEL = 0.5
"""Position of the centre of the first pixel, which OpenSfM calls 0."""
UNKNOWN = ("nan", "-nan")
HEADER = re.compile(r"EPSG:|\+proj=|\+init=|WGS\s?84|ETRS\s?89|UTM|[A-Z_]+\[", re.IGNORECASE)
FIRST_LINE = "write EPSG:n, or EPSG:n+m with m the system of the heights, as the first line"
WIDTHS = (3, 4, 7, 9)
"""Words of a row of geo.txt; what follows is the user's own."""


def is_header(text: str) -> bool:
    """Whether the first line of a file names a coordinate system, a known one or not."""
    return bool(HEADER.match(text.strip())) or (" / " in text and stated_system(text) is not None)


def is_odm_gcp(path: Path) -> bool:
    """Whether a file begins with a coordinate system and a row of five numbers and a name."""
    lines = first_lines(path, 2)
    words = _cells(lines[1], 5) if len(lines) > 1 else []
    known = [is_number(word) or word.lower() in UNKNOWN for word in words[:5]]
    return len(words) > 5 and is_header(lines[0]) and all(known)


def is_odm_geo(path: Path) -> bool:
    """Whether a file begins with a coordinate system, a name and two or more numbers."""
    lines = first_lines(path, 2)
    words = _cells(lines[1], 0) if len(lines) > 1 else []
    return (
        len(words) > 2
        and is_header(lines[0])
        and not is_number(words[0])
        and all(is_number(word) or word.lower() in UNKNOWN for word in words[1:4])
    )


def _cells(line: str, before: int) -> list[str]:
    """The entries of a row with an image's name behind `before` numbers; names may have blanks.

    A name with blanks stands in quotes, or tabs separate the entries; without either the image's name ends where its
    file does.
    """
    if "\t" in line:
        return [cell.strip().strip('"') for cell in line.split("\t")]
    if '"' in line:
        return [quoted or plain for quoted, plain in re.findall(r'"([^"]*)"|(\S+)', line)]
    words = line.split()
    end = next((k for k in range(before, len(words)) if ENDING.search(words[k])), before)
    return [*words[:before], " ".join(words[before : end + 1]), *words[end + 1 :]]


def _begin(path: Path, form: str) -> tuple[TextFile, StatedSystem, tuple[str, ...]]:
    """The file, its coordinate system, and what to say of that."""
    file = TextFile(path, any_letters=True)
    if not len(file) or not is_header(file.lines[0]):
        raise file.error(0, "does not begin with a coordinate system", "the first line is EPSG:n, or WGS84 UTM 47N")
    if len(file) < 2:
        raise file.error(len(file), "has no rows", f"rows are: {form}")
    try:
        system = stated_system(file.lines[0])
    except InputError as error:
        raise file.error(0, error.message, FIRST_LINE) from error
    if system is None:
        raise file.error(0, f"the coordinate system '{file.lines[0][:80]}' is not known", FIRST_LINE)
    return file, system, (*file.notes, *in_words(system, path))


def read_odm_gcp(path: FilePath, exchanged: bool = False) -> PointList:
    """Control points with their image points; a height of NaN is unknown.

    Points without a name are told apart by their coordinates and called gcp1, gcp2 …

    Parameters
    ----------
    exchanged : whether Y, or the latitude, stands first.

    Raises
    ------
    InputError
        With the line: no coordinate system, a row that is not of the form, a point with two places, a point twice in a
        photograph.
    """
    form = "geo_x geo_y geo_z im_x im_y image [point]"
    file, system, messages = _begin(Path(path), form)
    words, rows = [_cells(line, 5) for line in file.lines], list(range(1, len(file)))
    for row in rows:
        if len(words[row]) < 6:
            raise file.error(row, f"the row has {len(file.lines[row].split())} entries", f"rows are: {form}")
    heights = [words[row][2] for row in rows]
    unknown = np.array([word.lower() in UNKNOWN for word in heights])
    plain = [["0" if k == 2 and unknown[i] else words[row][k] for k in range(5)] for i, row in enumerate(rows)]
    values = file.table(plain, rows, "value")
    values[unknown, 2] = np.nan
    images = [words[row][5] for row in rows]
    names = _point_names(words, rows, values)
    file.check_names(images, rows, "photograph")
    file.check_names(names, rows, "point")
    image_place: dict[str, int] = {}
    place: dict[str, int] = {}
    image = np.array([image_place.setdefault(name, len(image_place)) for name in images], dtype=np.int64)
    point = np.array([place.setdefault(name, len(place)) for name in names], dtype=np.int64)
    refuse_unknown_heights(file, system, values[:, 2])
    xyz = _places(file, rows, names, point, values[:, :3])[:, order_of_axes(exchanged)] * system.to_metre
    file.refuse_repeated([f"{p}' in photograph '{i}" for p, i in zip(names, images, strict=True)], rows, "point")
    return PointList(
        path=file.path,
        points=texts(list(place)),
        xyz=xyz,
        sigma=no_sigma(len(xyz)),
        is_check=np.zeros(len(xyz), bool),
        crs=system.crs,
        rays=RayList(
            path=file.path,
            images=texts(list(image_place)),
            cameras=np.full(len(image_place), ""),
            points=texts(list(place)),
            image=image,
            point=point,
            xy=values[:, 3:] + FIRST_PIXEL,
            unit="px",
            focal_length_mm=np.full(len(image_place), np.nan),
        ),
        messages=(
            *messages,
            *exchange_in_words(exchanged, file.path),
            *_about_heights(file.path, xyz[:, 2], "point"),
            *_about_extra(file.path, sum(len(words[row]) > 7 for row in rows)),
        ),
    )


def _about_extra(path: Path, rows: int) -> tuple[str, ...]:
    """What to say of so many rows with more columns than are known."""
    about = f"{path.name}: what follows the known columns in {counted(rows, 'row')} was not carried over"
    return (left_behind(about),) if rows else ()


def _point_names(words: list[list[str]], rows: list[int], values: np.ndarray) -> list[str]:
    made: dict[tuple[float, ...], str] = {}
    names = []
    for row, xyz in zip(rows, np.nan_to_num(values[:, :3]).tolist(), strict=True):
        if len(words[row]) > 6:
            names.append(words[row][6])
        else:
            names.append(made.setdefault(tuple(xyz), f"gcp{len(made) + 1}"))
    return names


def _places(file: TextFile, rows: list[int], names: list[str], point: np.ndarray, given: np.ndarray) -> np.ndarray:
    """(N, 3) coordinates of the points, which all their rows have to repeat."""
    _, first = np.unique(point, return_index=True)
    xyz = given[first]
    differs = np.flatnonzero((np.nan_to_num(given) != np.nan_to_num(xyz[point])).any(axis=1))
    if len(differs):
        row = int(differs[0])
        line = file.numbers[rows[first[point[row]]]]
        message = f"point '{names[row]}' has other coordinates than in line {line}"
        raise file.error(rows[row], message, "a point has one place; give different points different names")
    return xyz


def _about_heights(path: Path, heights: np.ndarray, what: str) -> tuple[str, ...]:
    zero, unknown = int(np.sum(heights == 0.0)), int(np.isnan(heights).sum())
    said = []
    if zero:
        about = f"{path.name}: the height of {counted(zero, what)} is 0 and taken as known"
        said.append(assumed(f"{about}: write NaN if it is unknown"))
    if unknown:
        said.append(f"{path.name}: the height of {counted(unknown, what)} is unknown")
    return tuple(said)


def read_odm_geo(path: FilePath, exchanged: bool = False) -> PositionList:
    """Positions of photographs; photographs without a height are left out, since a position needs it.

    Parameters
    ----------
    exchanged : whether Y, or the latitude, stands first.

    Raises
    ------
    InputError
        With the line: no coordinate system, a row that is not of the form, a photograph there twice.
    """
    form = "image geo_x geo_y [geo_z] [yaw pitch roll] [h_acc v_acc]"
    file, system, messages = _begin(Path(path), form)
    words, rows = [_cells(line, 0) for line in file.lines], list(range(1, len(file)))
    for row in rows:
        if len(words[row]) < min(WIDTHS):
            raise file.error(row, f"the row has {len(file.lines[row].split())} entries", f"rows are: {form}")
    names = [words[row][0] for row in rows]
    file.check_names(names, rows, "photograph")
    file.refuse_repeated(names, rows, "photograph")
    values, extra = np.full((len(rows), 8), np.nan), 0
    for i, row in enumerate(rows):
        width = max(width for width in WIDTHS if width <= len(words[row]))
        extra += len(words[row]) > width
        part = words[row][1:width]
        known = [k for k, word in enumerate(part) if word.lower() not in UNKNOWN]
        values[i, known] = file.values([part[k] for k in known], [row] * len(known), "value")
    if np.isnan(values[:, :2]).any():
        bad = int(np.flatnonzero(np.isnan(values[:, :2]).any(axis=1))[0])
        raise file.error(rows[bad], "the plan position is missing", f"rows are: {form}")
    refuse_unknown_heights(file, system, values[:, 2])
    accuracy = values[:, 6:8]
    bad = np.argwhere(impossible_sigmas(accuracy))
    if len(bad):
        row, k = bad[0].tolist()
        raise file.error(rows[row], f"an accuracy {why_impossible(float(accuracy[row, k]))}", REMEDY)
    angles = np.radians(values[:, 3:6])
    angles[np.isnan(angles).any(axis=1)] = np.nan
    there = ~np.isnan(values[:, 2])
    said = [
        *messages,
        *exchange_in_words(exchanged, file.path),
        *_about_heights(file.path, values[there, 2], "photograph"),
    ]
    if not there.all():
        about = f"{file.path.name}: {counted(int((~there).sum()), 'position')} without height left out"
        said.append(left_behind(about))
    said += _about_extra(file.path, extra)
    return PositionList(
        file.path,
        texts(names)[there],
        values[there][:, order_of_axes(exchanged)] * system.to_metre,
        accuracy[there][:, [0, 0, 1]],
        angles[there],
        system.crs,
        tuple(said),
    )


def write_odm_gcp(block: Block, path: FilePath) -> tuple[str, ...]:
    """Write gcp_list.txt: the image points of control and check points; a height that is unknown as NaN.

    Returns
    -------
    What could not be carried over, in words.

    Raises
    ------
    InputError
        When there are none, a name has a blank, or the block has no CRS.
    """
    rays, control = block.image_points, block.control
    if block.crs == "local" or "+" in block.crs:
        raise InputError(
            f"gcp_list.txt needs a coordinate system EPSG:n, that of the block is '{block.crs}'",
            "bring the block into such a system, or write another format",
        )
    row_of_point = np.full(len(block.points), -1)
    row_of_point[control.point] = np.arange(len(control))
    plan = np.isfinite(control.xyz[:, :2]).all(axis=1)
    keep = np.flatnonzero((row_of_point[rays.point] >= 0) & np.append(plan, False)[row_of_point[rays.point]])
    if not len(keep):
        raise InputError(
            f"block '{block.name}' has no image points of control points with X and Y",
            "measure some, or write another format",
        )
    check_words(block.images.names, "photograph", "gcp_list.txt")
    check_words(block.points[control.point], "point", "gcp_list.txt")
    with atomic_file(path) as place, place.open("w", encoding="utf-8", newline="\n") as file:
        file.write(f"{block.crs}\n")
        for k in keep.tolist():
            camera = block.cameras[block.images.camera[rays.image[k]]]
            x, y = (px_from_mm(rays.xy[k], camera.size_px, camera.pixel_mm) - FIRST_PIXEL).tolist()
            xyz = control.xyz[row_of_point[rays.point[k]]].tolist()
            place_of_point = " ".join("NaN" if np.isnan(value) else f"{value:.6f}" for value in xyz)
            image, point = block.images.names[rays.image[k]], block.points[rays.point[k]]
            file.write(f"{place_of_point} {x:.6f} {y:.6f} {image} {point}\n")
    others = len(rays) - len(keep)
    lost = losses(block, "control", "check points", "image points", "crs")
    checks = int(control.is_check.sum())
    return (
        *lost,
        *((f"could not be carried over: {counted(others, 'image point')} of other points",) if others else ()),
        *(
            (f"{counted(checks, 'check point')} written like control points: the format does not tell them apart",)
            if checks
            else ()
        ),
    )
