"""Image points of PAT-B (.im) and BINGO, read some photographs at a time: sections that end with -99."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from aerotri.formats.assembly.bulk import Bulk, Sample
from aerotri.formats.assembly.parts import RayList, texts
from aerotri.formats.foreign import bingo, patb
from aerotri.formats.text.csv_text import unreadable, without_mark
from aerotri.formats.text.text_lines import TextFile

PIECE_BYTES = 4 << 20
"""Text that is read at a time [C], at least one photograph."""
BYTES_A_RAY = 40
"""About, of a row [C]."""
ReadPart = Callable[[TextFile], tuple[RayList, list[int], frozenset[tuple[str, ...]]]]


def open_patb_im(path: Path, always: frozenset[str]) -> Bulk:
    """The image points of an .im file in pieces.

    Parameters
    ----------
    always : names of points that belong to the sample.

    Raises
    ------
    InputError
        As `read_patb_im`.
    """
    try:
        in_mm = patb.is_in_mm(path)
    except OSError as error:
        raise unreadable(path, error) from error

    def part(file: TextFile) -> tuple[RayList, list[int], frozenset[tuple[str, ...]]]:
        found = patb.patb_im_of(file, in_mm)
        return found.rays, found.heads, found.classes

    bulk, classes = _opened(path, False, part, always)
    return replace(bulk, heads=replace(bulk.heads, messages=patb.about_im(in_mm, classes)))


def open_bingo(path: Path, always: frozenset[str]) -> Bulk:
    """The image points of a BINGO file in pieces.

    Parameters
    ----------
    always : names of points that belong to the sample.

    Raises
    ------
    InputError
        As `read_bingo`.
    """

    def part(file: TextFile) -> tuple[RayList, list[int], frozenset[tuple[str, ...]]]:
        rays, heads = bingo.bingo_of(file)
        return rays, heads, frozenset()

    return _opened(path, True, part, always)[0]


def _opened(
    path: Path, comments: bool, part: ReadPart, always: frozenset[str]
) -> tuple[Bulk, frozenset[tuple[str, ...]]]:
    """The photographs, a sample, and the way to all; and the classes of the image points."""
    sample, classes, lines, first = Sample(path.stat().st_size // BYTES_A_RAY, always), set[tuple[str, ...]](), [], 0
    names, cameras, c, file = list[str](), list[str](), list[float](), TextFile(path, comments, b"")
    for file in _files(path, comments):
        rays, heads, seen = part(file)
        sample.add(replace(rays, image=rays.image + first))
        classes |= seen
        first += len(rays.images)
        names += rays.images.tolist()
        cameras += rays.cameras.tolist()
        c += rays.focal_length_mm.tolist()
        lines += [file.numbers[row] for row in heads]
    _refuse_repeated(path, names, lines)
    nothing = np.zeros(0, np.int64)
    bare = RayList(
        path, texts(names), texts(cameras), np.zeros(0, "<U1"), nothing, nothing, np.zeros((0, 2)), "mm", np.array(c)
    )

    def pieces() -> Iterator[RayList]:
        first = 0
        for file in _files(path, comments):
            rays, _, _ = part(file)
            yield replace(
                rays,
                image=rays.image + first,
                images=bare.images,
                cameras=bare.cameras,
                focal_length_mm=bare.focal_length_mm,
            )
            first += len(rays.images)

    heads = sample.of(bare)
    if not sample.rays:
        raise (bingo if comments else patb).no_measurements(file)
    return Bulk(heads, pieces), frozenset(classes)


def _refuse_repeated(path: Path, names: list[str], lines: list[int]) -> None:
    """A photograph that is there twice, in pieces that were read apart."""
    file = TextFile(path, part=b"")
    file.numbers = lines
    file.refuse_repeated(names, range(len(names)), "photograph")


def _files(path: Path, comments: bool) -> Iterator[TextFile]:
    """Whole sections of the file, some at a time."""
    line = 1
    try:
        with path.open("rb") as file:
            while raw := file.read(PIECE_BYTES):
                raw += file.readline()
                last, more = raw[raw.rfind(b"\n", 0, -1) + 1 :], list[bytes]()
                while last and last.strip() != bingo.END.encode():
                    last = file.readline()
                    more.append(last)
                raw = b"".join([without_mark(raw) if line == 1 else raw, *more])
                yield TextFile(path, comments, raw, line)
                line += raw.count(b"\n")
    except OSError as error:
        raise unreadable(path, error) from error
