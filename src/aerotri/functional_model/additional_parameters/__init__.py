"""Families of additional parameters: one file a family, one contract for all.

Every family module offers ``FAMILY`` (its name in block.toml), ``ITEMS`` (the names of its parameters), ``MARK`` ('P'
printed in a source paper, 'L' literature, 'D' derived, 'C' choice), ``REFERENCE``, ``CAMERA_MODEL`` (the camera model
it belongs to, or None) and ``terms(camera, x, y)``. A `ParameterSet` is a choice of items of one family for one camera.
"""

from aerotri.functional_model.additional_parameters.registry import (
    FAMILIES,
    ParameterSet,
    parameter_set,
    parse_parameters,
)

__all__ = ["FAMILIES", "ParameterSet", "parameter_set", "parse_parameters"]
