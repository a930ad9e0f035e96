"""Families of additional parameters: one file a family, one contract for all.

Every module of a family ends in ``FAMILY``, a `Family` with everything the rest of the program asks of it: names,
texts, units, marks, sources, and the patterns at image points. `registry.FAMILIES` lists them; a new family is one
file and one word there. A `ParameterSet` is a choice of items of one family for one camera, a `Parameter` one of them
by its name.
"""

from aerotri.functional_model.additional_parameters.description import (
    ParameterDescription,
    describe,
    mark_of,
    text_of,
)
from aerotri.functional_model.additional_parameters.family import Family, Parameter
from aerotri.functional_model.additional_parameters.registry import (
    FAMILIES,
    ParameterSet,
    is_grid,
    is_item,
    parameter_set,
    parameter_sets,
    unit_of,
)
from aerotri.functional_model.additional_parameters.specification import AUTO, format_parameters, parse_parameters

__all__ = [
    "AUTO",
    "FAMILIES",
    "Family",
    "Parameter",
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
    "unit_of",
]
