"""The files of a Metashape project: archives with doc.xml, and point clouds in PLY.

A .psz is one archive. A .psx is a small XML file that names project.zip in its folder NAME.files, which names the
chunks, whose frames have archives of their own. Exported cameras are one XML file. Nothing is unpacked to the disk, and
no archive may grow beyond bounds.
"""

from __future__ import annotations

import io
import lzma
import re
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from xml.etree.ElementTree import Element

import numpy as np

from aerotri.conventions import InputError
from aerotri.formats.text.csv_text import read_bytes
from aerotri.formats.text.notes import left_behind
from aerotri.formats.text.text_lines import first_lines
from aerotri.formats.text.xml_text import read_xml, xml_of

PROJECTS = (".psx", ".psz")
DOCUMENT = "doc.xml"
LARGEST_MEMBER, LARGEST_RATIO, SMALL_MEMBER = 4 << 30, 200, 16 << 20
"""Bytes of a file in an archive at most, and how many times its packed size above the small ones [C]: XML shrinks 20
times, image points hardly."""
REMEDY = "save the project in Metashape again"
DAMAGED = (
    zipfile.BadZipFile, zlib.error, lzma.LZMAError, RuntimeError, ValueError, OSError, EOFError, NotImplementedError,
)  # fmt: skip
"""What reading a damaged archive may raise."""
PLY_TYPES = {
    "char": "i1", "uchar": "u1", "short": "<i2", "ushort": "<u2", "int": "<i4", "uint": "<u4", "float": "<f4",
    "double": "<f8", "int8": "i1", "uint8": "u1", "int16": "<i2", "uint16": "<u2", "int32": "<i4", "uint32": "<u4",
    "float32": "<f4", "float64": "<f8",
}  # fmt: skip
PLY_HEADER = 1 << 16
"""Bytes of a header at most [C]."""


@dataclass(frozen=True)
class Project:
    """One chunk of a project.

    Parameters
    ----------
    path : file the user named.
    chunk, frame : elements; frame is empty where there is none.
    cloud : element that lists the tie points; None where there is none.
    member : bytes of a file beside that list.
    messages : what the user should know.
    """

    path: Path
    chunk: Element
    frame: Element
    cloud: Element | None
    member: Callable[[str], bytes]
    messages: tuple[str, ...] = ()


def is_metashape_project(path: Path) -> bool:
    """Whether a file is a project, or an XML file of cameras."""
    if not path.is_file():
        return False
    if path.suffix.lower() in PROJECTS:
        return True
    head = "".join(first_lines(path, 5))
    return path.suffix.lower() == ".xml" and "<document" in head and "<chunk" in head


def open_project(path: Path) -> Project:
    """The active chunk of a project.

    Raises
    ------
    InputError
        When a file is missing or damaged, or an archive grows beyond bounds.
    """
    kind = path.suffix.lower()
    if kind == ".psz":
        archive = Archive(path)
        return _of_document(archive.xml(DOCUMENT), path, archive.read)
    if kind == ".psx":
        return _psx(path)
    return _of_document(read_xml(path), path, lambda name: b"")


def _of_document(root: Element, path: Path, member: Callable[[str], bytes]) -> Project:
    chunks = [chunk for chunk in root.iter("chunk") if chunk.find("cameras") is not None]
    if not chunks:
        raise InputError("holds no chunk with photographs", REMEDY, path)
    active = root.find("chunks")
    wanted = None if active is None else active.get("active_id")
    chunk = next((chunk for chunk in chunks if wanted is not None and chunk.get("id") == wanted), chunks[0])
    frame = chunk.find("frames/frame")
    frame = Element("frame") if frame is None else frame
    return Project(path, chunk, frame, _cloud_of(frame), member, _others(len(chunks), chunk))


def _others(count: int, chunk: Element) -> tuple[str, ...]:
    said = f"of {count} chunks '{chunk.get('label', '')[:60]}' is read, the active one: activate another in Metashape"
    return (left_behind(said),) if count > 1 else ()


def _cloud_of(frame: Element) -> Element | None:
    """The list of tie points; called point_cloud before version 2, which gave that name to dense points."""
    for name in ("tie_points", "point_cloud"):
        found = frame.find(name)
        if found is not None and (found.find("projections") is not None or found.get("path")):
            return found
    return None


def _psx(path: Path) -> Project:
    folder = path.with_suffix(".files")
    root = read_xml(path)
    stated = root.get("path", "").replace("{projectname}", path.stem)
    archive = Archive(_inside(path.parent, stated, path) if stated else folder / "project.zip")
    chunks = archive.xml(DOCUMENT).find("chunks")
    listed = [] if chunks is None else [chunk for chunk in chunks if chunk.get("path")]
    if chunks is None or not listed:
        raise InputError("holds no chunk", REMEDY, path)
    entry = next((chunk for chunk in listed if chunk.get("id") == chunks.get("active_id")), listed[0])
    place = _inside(folder, entry.get("path", ""), path)
    chunk = Archive(place).xml(DOCUMENT)
    if chunk.find("cameras") is None:
        raise InputError("its chunk holds no photographs", REMEDY, path)
    said = _others(len(listed), chunk)
    listed_frame = chunk.find("frames/frame")
    if listed_frame is None or not listed_frame.get("path"):
        return Project(path, chunk, Element("frame"), None, lambda name: b"", said)
    place = _inside(place.parent, listed_frame.get("path", ""), path)
    frame = Archive(place).xml(DOCUMENT)
    cloud = _cloud_of(frame)
    if cloud is None or not cloud.get("path"):
        return Project(path, chunk, frame, None, lambda name: b"", said)
    points = Archive(_inside(place.parent, cloud.get("path", ""), path))
    return Project(path, chunk, frame, points.xml(DOCUMENT), points.read, said)


def _inside(folder: Path, stated: str, path: Path) -> Path:
    """A path below a folder.

    Raises
    ------
    InputError
        When it leads elsewhere.
    """
    relative = PurePosixPath(stated.replace("\\", "/"))
    if relative.is_absolute() or ".." in relative.parts or re.match(r"[A-Za-z]:", stated):
        raise InputError(f"names a file outside of its folder: '{stated[:60]}'", REMEDY, path)
    return folder / relative


class Archive:
    """A zip archive whose members are read within bounds.

    Raises
    ------
    InputError
        When it is missing or none.
    """

    def __init__(self, path: Path):
        self.path = path
        if not path.is_file():
            raise InputError("there is no such file", "give the project together with its folder .files", path)
        try:
            self.archive = zipfile.ZipFile(io.BytesIO(read_bytes(path)))
        except DAMAGED as error:
            raise InputError(f"is no archive: {error}", REMEDY, path) from error

    def read(self, name: str) -> bytes:
        """A file of the archive.

        Raises
        ------
        InputError
        """
        try:
            info = self.archive.getinfo(name)
        except KeyError:
            raise InputError(f"holds no {name[:60]}", REMEDY, self.path) from None
        size, packed = info.file_size, info.compress_size
        if size > LARGEST_MEMBER or size > max(SMALL_MEMBER, LARGEST_RATIO * packed):
            raise InputError(f"{name[:60]} would grow to {size / 1e6:.0f} MB", REMEDY, self.path)
        try:
            with self.archive.open(info) as file:
                # the stated size may be wrong
                content = file.read(size + 1)
        except DAMAGED as error:
            raise InputError(f"{name[:60]} is damaged: {error}", REMEDY, self.path) from error
        if len(content) != size:
            raise InputError(f"{name[:60]} is damaged", REMEDY, self.path)
        return content

    def xml(self, name: str) -> Element:
        """The root element of an XML file of the archive.

        Raises
        ------
        InputError
        """
        return xml_of(self.read(name), self.path)


def read_ply(raw: bytes, wanted: tuple[str, ...], name: str, path: Path) -> dict[str, np.ndarray]:
    """Properties of the vertices of a binary PLY file.

    Parameters
    ----------
    wanted : names of scalar properties.
    name, path : for errors.

    Raises
    ------
    InputError
        When it is no binary PLY file, lacks a property or is cut off.
    """
    end = raw.find(b"end_header\n", 0, PLY_HEADER)
    lines = raw[: max(end, 0)].decode("latin-1").split("\n")
    if (
        end < 0
        or lines[0].strip() != "ply"
        or not any(line.strip() == "format binary_little_endian 1.0" for line in lines)
    ):
        raise InputError(f"{name[:60]} is no binary PLY file", REMEDY, path)
    elements = [k for k, line in enumerate(lines) if line.startswith("element ")]
    found = re.fullmatch(r"element vertex (\d{1,12})\s*", lines[elements[0]]) if elements else None
    if found is None:
        raise InputError(f"{name[:60]} has no vertices", REMEDY, path)
    last = elements[1] if len(elements) > 1 else len(lines)
    properties = [line.split() for line in lines[elements[0] + 1 : last] if line.startswith("property ")]
    if not all(len(words) == 3 and words[1] in PLY_TYPES for words in properties):
        raise InputError(f"{name[:60]} has properties that are no numbers", REMEDY, path)
    names = [words[2] for words in properties]
    if len(set(names)) < len(names) or not set(wanted) <= set(names):
        raise InputError(f"{name[:60]} lacks {' or '.join(wanted)}", REMEDY, path)
    form = np.dtype([(words[2], PLY_TYPES[words[1]]) for words in properties])
    count, begin = int(found[1]), end + len(b"end_header\n")
    if count * form.itemsize > len(raw) - begin:
        raise InputError(f"{name[:60]} is cut off", REMEDY, path)
    table = np.frombuffer(raw, form, count, begin)
    return {key: table[key].copy() for key in wanted}
