"""BINGO image coordinates: sections ``photo camera``, ``point x y`` … ``-99``, mm from the image centre, y up.

Pix4D writes such files with the format of the camera as its name: H_34.99999_23.32763 is 35.0 mm × 23.3 mm [C].
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.formats.assembly.losses import losses
from aerotri.formats.assembly.parts import RayList, texts
from aerotri.formats.files.atomic import atomic_file
from aerotri.formats.text.text_lines import TextFile, check_words, first_lines, is_number
from aerotri.observations import Block

END = "-99"
FARTHEST_MM = 1e4
"""No photograph reaches farther from its centre."""


def is_bingo(path: Path) -> bool:
    """Whether a file begins with a photograph, its camera and an image point, or nothing measured."""
    lines = [line.split() for line in first_lines(path)]
    if len(lines) < 2 or len(lines[0]) < 2 or is_number(lines[0][1]):
        return False
    return lines[1] == [END] or (len(lines[1]) == 3 and all(is_number(word) for word in lines[1][1:]))


def read_bingo(path: FilePath) -> RayList:
    """Image points from a BINGO file.

    Raises
    ------
    InputError
        With the line: a section without head or end, a row that is no image point, a photograph there twice, a point
        twice in a photograph.
    """
    file = TextFile(Path(path))
    if not len(file):
        raise InputError("is empty", "give a BINGO file of image coordinates", file.path)
    rays, _ = bingo_of(file)
    if not len(rays.image):
        raise no_measurements(file)
    return rays


def no_measurements(file: TextFile) -> InputError:
    """The error of a file without image points."""
    return file.error(0, "holds no image points", "give a file with measurements")


def bingo_of(file: TextFile) -> tuple[RayList, list[int]]:
    """Image points of the sections of a BINGO file, or of some of them, and the row of each photograph.

    Raises
    ------
    InputError
        As `read_bingo`, but for what concerns photographs of other sections.
    """
    words = file.words()
    heads = _sections(file, words)
    images, cameras = [words[row][0] for row in heads], [" ".join(words[row][1:]) for row in heads]
    file.check_names(images, heads, "photograph")
    file.check_names(cameras, heads, "camera")
    file.refuse_repeated(images, heads, "photograph")
    rays, image, row_of = [], [], []
    bounds = [*heads, len(words)]
    for number, head in enumerate(heads):
        rows = range(head + 1, bounds[number + 1] - 1)
        rays += words[head + 1 : bounds[number + 1] - 1]
        row_of += rows
        image += [number] * len(rows)
    place: dict[str, int] = {}
    point = np.array([place.setdefault(ray[0], len(place)) for ray in rays], dtype=np.int64)
    image_of_ray = np.array(image, dtype=np.int64)
    xy = file.table([ray[1:] for ray in rays], row_of, "image coordinate").reshape(-1, 2)
    _check_rays(file, image_of_ray, point, xy, row_of, list(place), images)
    found = RayList(
        path=file.path,
        images=texts(images),
        cameras=texts(cameras),
        points=texts(list(place)),
        image=image_of_ray,
        point=point,
        xy=xy,
        unit="mm",
        focal_length_mm=np.full(len(images), np.nan),
    )
    return found, heads


def _sections(file: TextFile, words: list[list[str]]) -> list[int]:
    """Rows of the heads; every section is checked to be closed and to hold rows of three words."""
    heads, inside = [], False
    for row, line in enumerate(words):
        if not inside:
            if len(line) < 2:
                raise file.error(row, f"'{line[0][:60]}' begins no photograph", "a section begins: photo camera")
            heads.append(row)
            inside = True
        elif line[0] == END and len(line) == 1:
            inside = False
        elif len(line) != 3:
            remedy = f"rows are: point x y; a photograph ends with {END}"
            raise file.error(row, f"the row has {len(line)} entries", remedy)
    if inside:
        photograph = words[heads[-1]][0]
        raise file.error(len(words), f"photograph '{photograph}' does not end", f"close it with {END}; is it cut off?")
    return heads


def _check_rays(
    file: TextFile,
    image: np.ndarray,
    point: np.ndarray,
    xy: np.ndarray,
    row_of: list[int],
    points: list[str],
    images: list[str],
) -> None:
    far = np.flatnonzero((np.abs(xy) > FARTHEST_MM).any(axis=1))
    if len(far):
        raise file.error(
            row_of[int(far[0])],
            "an image point lies outside of any image",
            "give coordinates in mm from the image centre",
        )
    _, first = np.unique(point, return_index=True)
    file.check_names(points, [row_of[i] for i in np.sort(first)], "point")
    key = image * np.int64(len(points)) + point
    _, first = np.unique(key, return_index=True)
    if len(first) < len(key):
        again = int(np.setdiff1d(np.arange(len(key)), first)[0])
        earlier = file.numbers[row_of[int(np.flatnonzero(key == key[again])[0])]]
        where = f"point '{points[point[again]]}' is there twice in photograph '{images[image[again]]}'"
        raise file.error(row_of[again], f"{where}, first in line {earlier}", "keep one of the rows")


def format_in_name(camera: str) -> tuple[float, float] | None:
    """Width and height in mm that a camera's name tells, None where it does not."""
    found = re.fullmatch(r"H_(\d+(?:\.\d+)?)_(\d+(?:\.\d+)?)", camera)
    return (float(found[1]), float(found[2])) if found else None


def write_bingo(block: Block, path: FilePath) -> tuple[str, ...]:
    """Write image points as measured, photograph by photograph, to a nanometre.

    Returns
    -------
    What could not be carried over, in words.

    Raises
    ------
    InputError
        When a name has a blank, or there are no image points.
    """
    rays = block.image_points
    if not len(rays):
        raise InputError(f"block '{block.name}' has no image points", "BINGO files hold nothing else")
    check_words(block.images.names, "photograph", "BINGO")
    check_words(block.points, "point", "BINGO")
    order = np.argsort(rays.image, kind="stable")
    bounds = np.searchsorted(rays.image[order], np.arange(len(block.images) + 1))
    names, xy, of_ray = block.points.tolist(), rays.xy.tolist(), rays.point.tolist()
    with atomic_file(path) as place, place.open("w", encoding="utf-8", newline="\n") as file:
        for number, photograph in enumerate(block.images.names.tolist()):
            camera = block.cameras[block.images.camera[number]].name
            file.write(f"{photograph} {camera}\n")
            for k in order[bounds[number] : bounds[number + 1]].tolist():
                file.write(f"{names[of_ray[k]]} {xy[k][0]:.6f} {xy[k][1]:.6f}\n")
            file.write(f"{END}\n")
    return losses(block, "image points")
