"""Families of additional parameters: one file a family, one contract for all.

Every family module offers ``FAMILY`` (its name in block.toml), ``ITEMS`` (the names of its parameters), ``MARK`` ('P'
printed in a source paper, 'L' literature, 'D' derived, 'C' choice), ``REFERENCE``, ``CAMERA_MODEL`` (the camera model
it belongs to, or None), ``DESCRIPTION`` (item → a few words) and ``terms(camera, x, y, partials, items)``. Besides,
where needed: ``DEFAULT_ITEMS`` (what ``all`` means, if not ``ITEMS``), ``MARKS`` (of items unlike the family's),
``SIZES`` (the family comes in sizes, as in ``legendre:4x4``), ``check_items`` (refuses items that exclude each other)
and ``NEEDS_HEIGHT`` (items that are no pattern of the image).
A `ParameterSet` is a choice of items of one family for one camera.
"""

from aerotri.functional_model.additional_parameters.description import (
    ParameterDescription,
    describe,
    mark_of,
    text_of,
)
from aerotri.functional_model.additional_parameters.registry import (
    FAMILIES,
    ParameterSet,
    is_grid,
    is_item,
    parameter_set,
    parameter_sets,
)
from aerotri.functional_model.additional_parameters.specification import AUTO, format_parameters, parse_parameters

__all__ = [
    "AUTO",
    "FAMILIES",
    "ParameterDescription",
    "ParameterSet",
    "describe",
    "format_parameters",
    "is_grid",
    "is_item",
    "mark_of",
    "parameter_set",
    "parameter_sets",
    "parse_parameters",
    "text_of",
]
