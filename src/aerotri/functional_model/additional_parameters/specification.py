"""Choices of additional parameters as text: ``bluh:1-8+12,ultracam_d:42-73``, ``legendre:4x4``, ``none``.

Families are separated by commas. Inside one, items are joined by ``+`` and ranges of numbers by ``-``; ``all`` or no
item means the family's full set. A family that comes in sizes takes a size: ``fourier:1x1``, ``collocation:19x13``.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from aerotri.conventions import InputError
from aerotri.functional_model.additional_parameters.registry import (
    FAMILIES,
    checked_items,
    default_items,
    items_text,
    joined_items,
    sizes_of,
)
from aerotri.functional_model.additional_parameters.sizes import size_of, size_text

Choice = tuple[tuple[str, tuple[str, ...]], ...]
"""(family, items) pairs; items without repetition in the family's order."""

AUTO: Choice = (("auto", ()),)
"""Stands for the set that cross-validation chooses; none of the families."""

LONGEST_RANGE, MOST_DIGITS = 1000, 9
"""Items of a range and digits of its ends [C]: no numbered family has a tenth as many; a slip of the keyboard is
refused and not written out."""


def parse_parameters(spec: str | Iterable[str]) -> Choice:
    """Families and items of a specification.

    Parameters
    ----------
    spec : the text of the command line, or the list of block.toml.

    Raises
    ------
    InputError
        For an unknown family or item, naming those there are, and for items that exclude each other.
    """
    parts = spec.split(",") if isinstance(spec, str) else list(spec)
    parts = [part.strip() for part in parts if part.strip()]
    if parts == ["none"]:
        return ()
    if parts == ["auto"]:
        return AUTO
    chosen: dict[str, list[str]] = {}
    for part in parts:
        family, _, items = part.partition(":")
        if family not in FAMILIES:
            known = ", ".join((*FAMILIES, "none", "auto"))
            raise InputError(f"unknown parameter family '{family}'", f"known are {known}")
        for piece in (items or "all").split("+"):
            chosen.setdefault(family, []).extend(_items(family, piece.strip()))
    return tuple((family, checked_items(family, items)) for family, items in chosen.items())


def _items(family: str, piece: str) -> Iterable[str]:
    """Items that one piece of a specification names: all, a size, a range or an item."""
    if piece == "all":
        return default_items(family)
    size, sizes = size_of(piece), sizes_of(family)
    if size is not None and sizes is not None:
        return sizes.items(size)
    span = re.fullmatch(r"([0-9]+)-([0-9]+)", piece)
    if span is None:
        return (piece,)
    longest = max(len(text.lstrip("0")) for text in span.groups())
    first, last = (int(text) if longest <= MOST_DIGITS else 0 for text in span.groups())
    if longest > MOST_DIGITS or last - first >= LONGEST_RANGE:
        shown = piece if len(piece) <= 40 else piece[:37] + "..."
        raise InputError(f"the range '{shown}' is longer than any set of parameters", items_text(family))
    if last < first:
        raise InputError(f"'{family}' has no parameters '{piece}'", "a range goes upwards, as in 1-12")
    return (str(i) for i in range(first, last + 1))


def format_parameters(parameters: Choice) -> list[str]:
    """The shortest specification of every family, the inverse of `parse_parameters`: 'bluh:1-12', 'legendre:4x4'.

    Items are written by name or number, so that a text keeps its meaning, except where a family's full set is long.
    """
    if parameters == AUTO:
        return ["auto"]
    return [f"{family}:{_items_text(family, tuple(items))}" for family, items in parameters if items]


def _items_text(family: str, items: tuple[str, ...]) -> str:
    sizes = sizes_of(family)
    if sizes is not None:
        own = size_of(items[0].partition("_")[0])
        for size in sizes.all() if own is None else (own,):
            if sizes.items(size) == items:
                return size_text(size)
    elif items == default_items(family) and not items[0].isdigit():
        return "all"
    return joined_items(items)
