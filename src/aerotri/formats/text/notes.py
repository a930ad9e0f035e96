"""Sentences on an import by what they tell: what was taken, what was assumed, what was left behind.

A note is a text as any other, so that who prints messages need not know of kinds. A sentence without a kind is a
remark: how well something fits, or what is to be looked at.
"""

from __future__ import annotations

from typing import Literal

LEFT_BEHIND = ("left out: ", "not used: ", "could not be carried over: ")
"""Usual beginnings of sentences on what stands in a file and not in the block."""
Kind = Literal["taken", "assumed", "left behind"]


class Note(str):
    """A sentence with its kind. It keeps the kind only as it is: a text made from it is a remark again."""

    __slots__ = ("kind",)
    kind: Kind

    def __new__(cls, text: str, kind: Kind = "taken") -> Note:
        note = super().__new__(cls, text)
        note.kind = kind
        return note


def taken(text: str) -> Note:
    """A note on what was used in another way than it stands in the file: brought to metres, to another system."""
    return Note(text, "taken")


def assumed(text: str) -> Note:
    """A note on what no file and no option said: a default, a guess, the order of columns, one value for several."""
    return Note(text, "assumed")


def left_behind(text: str) -> Note:
    """A note on what stands in the file and not in the block."""
    return Note(text, "left behind")


def without_beginning(text: str) -> str:
    """A sentence on what was left behind, where a heading says so already."""
    return next((text.removeprefix(words) for words in LEFT_BEHIND if text.startswith(words)), text)


def kind_of_note(text: str) -> str:
    """The kind of a sentence, '' of a remark; one that begins as such sentences do tells what was left behind."""
    if isinstance(text, Note):
        return text.kind
    return "left behind" if text.startswith(LEFT_BEHIND) else ""
