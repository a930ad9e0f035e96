"""The records of the reference: an item (a column or a JSON key), and a file with its items."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

Kind = Literal[
    "text", "text?", "number", "number?", "whole", "yes/no", "yes/no?", "object", "object?", "list of text", "anything"
]
Form = Literal["table", "json", "raster", "text", "picture", "page", "folder", "cloud", "other"]
AXES = ("X", "Y", "Z")


@dataclass(frozen=True)
class Item:
    """A column of a table, a key of a JSON file, or a dimension of a point cloud.

    Parameters
    ----------
    name : of the column; of a key its path, 'groups[].rms' for the key rms of every entry of the list groups. '*'
        stands for names that are not known beforehand.
    kind : what it holds; '?' where the cell may be empty, or the value null.
    text : what it is, in a plain sentence.
    unit : '' where it has none.
    values : the words that may stand there, with what each means.
    optional : whether it is not always there.
    """

    name: str
    kind: Kind
    text: str
    unit: str = ""
    values: Mapping[str, str] = field(default_factory=dict)
    optional: bool = False


@dataclass(frozen=True)
class DescribedFile:
    """A file that the program reads or writes, or what a command prints with --json.

    Parameters
    ----------
    name : of the file. place : the folder it stands in, in words, such as 'result of adjust'.
    form : what kind of file. text : what it is.
    items : its columns, keys or dimensions. when : on what condition it is written, '' always.
    """

    name: str
    place: str
    form: Form
    text: str
    items: tuple[Item, ...] = ()
    when: str = ""

    @property
    def label(self) -> str:
        """Name and place, which together are unique."""
        return f"{self.name} ({self.place})"

    @property
    def columns(self) -> tuple[str, ...]:
        """The names of its items."""
        return tuple(one.name for one in self.items)


def of_axes(name: str, kind: Kind, text: str, unit: str = "", axes: Sequence[str] = AXES) -> tuple[Item, ...]:
    """One item for each axis; '{}' in name and text is replaced by it."""
    return tuple(Item(name.replace("{}", axis), kind, text.replace("{}", axis), unit) for axis in axes)


def within(prefix: str, *items: Item) -> tuple[Item, ...]:
    """The items as keys of an object, or of the entries of a list."""
    return tuple(Item(f"{prefix}.{i.name}", i.kind, i.text, i.unit, i.values, i.optional) for i in items)


def statistics(name: str, what: str, unit: str = "m", keys: Sequence[str] = ("min", "max", "mean", "rms")):
    """An object of statistics: smallest, largest, mean and root mean square of something."""
    words = {"min": "Smallest", "max": "Largest", "mean": "Mean", "rms": "Root mean square"}
    head = Item(name, "object", f"Statistics of {what}.", unit)
    return (head, *(Item(f"{name}.{key}", "number?", f"{words[key]} of {what}.", unit) for key in keys))


def axes_object(name: str, text: str, unit: str = "m") -> tuple[Item, ...]:
    """An object with a number by axis."""
    return (
        Item(name, "object", f"{text}, by axis.", unit),
        *of_axes(f"{name}.{{}}", "number?", f"{text} in {{}}.", unit),
    )
