"""OpenSfM's JSON: its text, the pieces of it with their places for errors, and object points in one array."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.conventions import InputError, counted
from aerotri.foreign_json import read_foreign_json
from aerotri.formats.text.notes import left_behind

REMEDY = "export the reconstruction anew"
LARGEST = 1e9
"""Largest number of a reconstruction; chosen [C]: beyond every coordinate in metres and every pixel; squares of it keep
their digits."""


class Node:
    """A piece of the JSON text with the words to name it in an error.

    Parameters
    ----------
    value : what it holds. where : its place in words. path : the file. remedy : what to do where it is damaged.
    """

    def __init__(self, value: Any, where: str, path: Path, remedy: str = REMEDY):
        self.value, self.where, self.path, self.remedy = value, where, path, remedy

    def at(self, value: Any, where: str) -> Node:
        """Another piece of the same file."""
        return Node(value, where, self.path, self.remedy)

    def error(self, message: str, remedy: str = "") -> InputError:
        """An error that names the place."""
        return InputError(f"{self.where}: {message}", remedy or self.remedy, self.path)

    def items(self) -> dict[str, Node]:
        """The pieces of a table by name."""
        if not isinstance(self.value, dict):
            raise self.error("is no table")
        return {key: self.at(value, f"{self.where}.{key}"[:120]) for key, value in self.value.items()}

    def get(self, key: str) -> Node:
        """A piece of a table; an error where it is missing."""
        found = self.items().get(key)
        if found is None:
            raise self.error(f"has no {key}")
        return found

    def has(self, key: str) -> bool:
        """Whether there is a piece of that name that is not null."""
        return isinstance(self.value, dict) and self.value.get(key) is not None

    def number(self) -> float:
        """A finite number."""
        if isinstance(self.value, bool) or not isinstance(self.value, int | float):
            raise self.error("is not a number")
        try:
            value = float(self.value)
        except OverflowError:
            value = math.inf
        if not abs(value) <= LARGEST:
            raise self.error(f"{value:g} is not possible")
        return value

    def numbers(self, count: int) -> list[float]:
        """A list of so many numbers."""
        if not isinstance(self.value, list) or len(self.value) != count:
            raise self.error(f"is no list of {count} numbers")
        return [self.at(value, f"{self.where}[{i}]").number() for i, value in enumerate(self.value)]

    def text(self) -> str:
        """A text that is not empty."""
        if not isinstance(self.value, str) or not self.value:
            raise self.error("is no text")
        return self.value


def read_reconstructions(path: Path) -> list[Node]:
    """The reconstructions of a file, each with its shots.

    Raises
    ------
    InputError
    """
    content = read_foreign_json(path, REMEDY)
    if not isinstance(content, list) or not content:
        raise InputError("holds no reconstruction", "it is a list of reconstructions", path)
    return [Node(value, f"reconstruction {i}", path) for i, value in enumerate(content)]


def largest(nodes: list[Node]) -> tuple[Node, list[str]]:
    """The reconstruction with most photographs, and a message on the others."""
    sizes = [len(node.get("shots").items()) for node in nodes]
    best = sizes.index(max(sizes))
    smaller = counted(len(nodes) - 1, "smaller reconstruction")
    others = f"left out: {smaller} with {counted(sum(sizes) - sizes[best], 'photograph')}"
    return nodes[best], [left_behind(others)] if len(nodes) > 1 else []


def points_of(section: Node) -> tuple[list[str], np.ndarray]:
    """Names and (N, 3) coordinates of the object points.

    Raises
    ------
    InputError
        At the first that has no three numbers.
    """
    table = section.value
    if isinstance(table, dict):
        try:
            rows = [point["coordinates"] for point in table.values()]
            kinds = {type(value) for row in rows for value in row}
            xyz = np.array(rows, dtype=float).reshape(-1, 3)
            if kinds <= {int, float} and len(xyz) == len(rows) and (np.abs(xyz) <= LARGEST).all():
                return list(table), xyz
        except (TypeError, KeyError, ValueError, OverflowError):
            pass
    found = {key: node.get("coordinates").numbers(3) for key, node in section.items().items()}
    return list(found), np.array(list(found.values()), dtype=float).reshape(-1, 3)
