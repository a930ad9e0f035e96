"""What there is to choose from, as a list: every family with its items, where they come from and what they do."""

from __future__ import annotations

from dataclasses import dataclass

from aerotri.functional_model.additional_parameters.registry import FAMILIES, default_items, is_item, sizes_of
from aerotri.functional_model.additional_parameters.sizes import size_text


@dataclass(frozen=True)
class ParameterDescription:
    """One line of the list.

    Parameters
    ----------
    family, item : as in a specification; the item may be a size such as '19x13'.
    mark : 'P' printed in a source paper, 'L' literature, 'D' derived, 'C' choice.
    reference : the source.
    text : what it is, in a few words; '' where nothing is known.
    """

    family: str
    item: str
    mark: str
    reference: str
    text: str


def mark_of(family: str, item: str) -> str:
    """Mark of a parameter, its own where it differs from the family's."""
    return FAMILIES[family].mark_of(item)


def text_of(family: str, item: str) -> str:
    """What a parameter is, in a few words; '' for one that the family does not have."""
    own = FAMILIES[family]
    return own.text(item) if item in own.needs_height or is_item(family, item) else ""


def describe() -> list[ParameterDescription]:
    """All families: every item, or of a family that comes in sizes its default size and, of a series, its terms."""
    return [line for family in FAMILIES for line in _lines(family)]


def _lines(family: str) -> list[ParameterDescription]:
    own, sizes = FAMILIES[family], sizes_of(family)
    items, lines = (*own.needs_height, *own.items), []
    if sizes is not None:
        items = default_items(family)
        text = f"{sizes.meaning}, up to {size_text(sizes.largest)}; {len(items)} parameters"
        lines.append(ParameterDescription(family, size_text(sizes.default), own.mark, own.reference, text))
        if items[0].startswith(size_text(sizes.default)):
            return lines
    return lines + [
        ParameterDescription(family, item, mark_of(family, item), own.reference, text_of(family, item))
        for item in items
    ]
