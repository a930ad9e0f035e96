"""Families that come in sizes: orders M × N of a series, nodes nx × ny of a grid."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from aerotri.conventions import InputError


@dataclass(frozen=True)
class Sizes:
    """How a family is asked for by a size, as in ``legendre:4x4``.

    Parameters
    ----------
    meaning : of the two numbers, in words.
    default, smallest, largest : sizes (along x, along y).
    make : the items of a size.
    """

    meaning: str
    default: tuple[int, int]
    smallest: tuple[int, int]
    largest: tuple[int, int]
    make: Callable[[int, int], tuple[str, ...]]

    def items(self, size: tuple[int, int]) -> tuple[str, ...]:
        """The items of a size in the family's order.

        Raises
        ------
        InputError
            When the size is out of bounds.
        """
        if any(not low <= n <= high for low, n, high in zip(self.smallest, size, self.largest, strict=True)):
            raise InputError(
                f"{size_text(size)} is out of bounds: {self.meaning}",
                f"choose from {size_text(self.smallest)} to {size_text(self.largest)}",
            )
        return self.make(*size)

    def all(self) -> Iterator[tuple[int, int]]:
        """Every size within the bounds."""
        for m in range(self.smallest[0], self.largest[0] + 1):
            for n in range(self.smallest[1], self.largest[1] + 1):
                yield m, n


def size_text(size: tuple[int, int]) -> str:
    """'4x4'."""
    return f"{size[0]}x{size[1]}"


def size_of(text: str) -> tuple[int, int] | None:
    """The size that a text such as '4x4' names; None for any other text."""
    found = re.fullmatch(r"([0-9]{1,4})x([0-9]{1,4})", text)
    return None if found is None else (int(found[1]), int(found[2]))
