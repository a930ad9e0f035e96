"""The files of an OPF project (Open Photogrammetry Format): its container, JSON by format, and arrays of a glTF file.

[L] OPF specification 1.0, pix4d.github.io/opf-spec. A project names resources by their place beside it. The points of a
calibration are glTF: accessors of buffer views of binary files, little-endian and packed.
"""

from __future__ import annotations

import math
from pathlib import Path, PurePosixPath
from urllib.parse import unquote

import numpy as np

from aerotri.conventions import InputError, regular_file
from aerotri.foreign_json import json_head, read_foreign_json
from aerotri.formats.foreign.opensfm_json import Node

PROJECT = "application/opf-project+json"
GLTF = "model/gltf+json"
REMEDY = "export the project as OPF again"
COMPONENTS = {5121: "u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
MOST = 1 << 32
"""Elements of an array at most [C]."""


def is_opf(path: Path) -> bool:
    """Whether a path is the container of an OPF project, or a folder with one."""
    file = container_of(path)
    return file is not None and f'"{PROJECT}"' in json_head(file, (".opf", ".json"))


def container_of(path: Path) -> Path | None:
    """The container: the file itself, or the only .opf of a folder."""
    if not path.is_dir():
        return path if path.suffix.lower() in (".opf", ".json") else None
    try:
        found = sorted(one for one in path.iterdir() if one.suffix.lower() == ".opf")
    except OSError:
        return None
    return found[0] if len(found) == 1 else None


class Resources:
    """The resources of a project by their format.

    Parameters
    ----------
    path : the container.

    Raises
    ------
    InputError
        When it is damaged, or names a file outside of its folder.
    """

    def __init__(self, path: Path):
        self.path = path
        root = Node(read_foreign_json(path, REMEDY), "the project", path, REMEDY)
        self.places: dict[str, list[Path]] = {}
        self.of_calibration: dict[str, list[Path]] = {}
        for item in entries(root.get("items")):
            kind = item.get("type").text()
            for resource in entries(item.get("resources")):
                format_, place = resource.get("format").text(), inside(path, resource.get("uri"))
                self.places.setdefault(format_, []).append(place)
                if kind == "calibration":
                    self.of_calibration.setdefault(format_, []).append(place)

    def has(self, name: str) -> bool:
        return f"application/opf-{name}+json" in self.places

    def node(self, name: str) -> Node:
        """The JSON of a format, such as 'calibrated-cameras'.

        Raises
        ------
        InputError
            When there is none, or several.
        """
        found = self.places.get(f"application/opf-{name}+json", [])
        if len(found) != 1:
            count = len(found) or "no"
            raise InputError(
                f"names {count} files of {name.replace('-', ' ')}", "calibrate the project first", self.path
            )
        return Node(read_foreign_json(found[0], REMEDY), "the file", found[0], REMEDY)

    def gltf(self) -> Path | None:
        """The points of the calibration."""
        found = self.of_calibration.get(GLTF, [])
        return found[0] if found else None


def inside(path: Path, uri: Node) -> Path:
    """A file below the folder of another.

    Raises
    ------
    InputError
        When the address leads elsewhere.
    """
    text = unquote(uri.text()).partition("#")[0]
    relative = PurePosixPath(text)
    if "\\" in text or "\0" in text or ":" in text or relative.is_absolute() or ".." in relative.parts:
        raise uri.error(f"'{text[:60]}' is no file below the folder of the project", REMEDY)
    return path.parent / relative


def entries(node: Node) -> list[Node]:
    """The pieces of a list.

    Raises
    ------
    InputError
    """
    if not isinstance(node.value, list):
        raise node.error("is no list", REMEDY)
    return [node.at(value, f"{node.where}[{k}]"[:120]) for k, value in enumerate(node.value)]


def whole(node: Node) -> int:
    """A whole number, such as an identifier of 64 bits.

    Raises
    ------
    InputError
    """
    if isinstance(node.value, bool) or not isinstance(node.value, int):
        raise node.error("is no whole number", REMEDY)
    return node.value


def identifier(node: Node) -> int | str:
    """A number or a text that names something.

    Raises
    ------
    InputError
    """
    if isinstance(node.value, bool) or not isinstance(node.value, int | str):
        raise node.error("is no identifier", REMEDY)
    return node.value


class Gltf:
    """The arrays of a glTF file.

    Raises
    ------
    InputError
        When it is damaged.
    """

    def __init__(self, path: Path):
        self.root = Node(read_foreign_json(path, REMEDY), "the file", path, REMEDY)

    def element(self, section: str, number: Node) -> Node:
        """An element of a list of the file, by the number that another one states."""
        listed, k = entries(self.root.get(section)), whole(number)
        if not 0 <= k < len(listed):
            raise number.error(f"there is no {section}[{k}]", REMEDY)
        return listed[k]

    def array(self, number: Node, component: int, kind: str) -> np.ndarray:
        """(n,) or (n, width) of an accessor.

        Parameters
        ----------
        component : its type as glTF numbers it. kind : 'SCALAR', 'VEC2' …

        Raises
        ------
        InputError
            When the accessor is of another type, or its file is too short.
        """
        accessor = self.element("accessors", number)
        if whole(accessor.get("componentType")) != component or accessor.get("type").text() != kind:
            raise accessor.error(f"is no {kind} of type {component}", REMEDY)
        view = self.element("bufferViews", accessor.get("bufferView"))
        buffer = self.element("buffers", view.get("buffer"))
        count, width = whole(accessor.get("count")), WIDTHS[kind]
        offset = whole(view.get("byteOffset")) if view.has("byteOffset") else 0
        if accessor.has("byteOffset") or view.has("byteStride") or accessor.has("sparse"):
            raise accessor.error("is not packed", REMEDY)
        place, form = inside(self.root.path, buffer.get("uri")), np.dtype(COMPONENTS[component])
        size = regular_file(place).stat().st_size
        if not 0 <= count <= MOST or not 0 <= offset <= size - count * width * form.itemsize:
            raise InputError(f"is shorter than {count} × {width} numbers", REMEDY, place)
        found = np.fromfile(place, form, count * width, offset=offset)
        if form.kind == "f" and not np.isfinite(found).all():
            raise InputError("holds what is no number", REMEDY, place)
        return found if width == 1 else found.reshape(count, width)


def matrix_of(node: Node) -> np.ndarray:
    """(4, 4) of the matrix of a node, which is written column by column; the identity where there is none.

    Raises
    ------
    InputError
    """
    if not node.has("matrix"):
        return np.eye(4)
    values = node.get("matrix").numbers(16)
    if not all(math.isfinite(value) for value in values):
        raise node.error("its matrix is not finite", REMEDY)
    return np.array(values).reshape(4, 4).T
