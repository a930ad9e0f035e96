"""Which parameters of the linear families a camera may state values of."""

from __future__ import annotations

from aerotri.functional_model.additional_parameters.family import Parameter
from aerotri.functional_model.additional_parameters.registry import FAMILIES, LINEAR_FAMILIES, is_grid, is_item


def reason_against(name: str, model: str) -> str:
    """Why a camera of a model cannot state a value of a parameter, and the remedy; '' where it can.

    Parameters
    ----------
    name : 'bluh.9'. model : 'frame', 'ultracam_d' or 'dmc'.

    Examples
    --------
    >>> reason_against("bluh.9", "frame")
    ''
    >>> reason_against("brown.K1", "frame")
    'write it to [camera.NAME.brown]'
    """
    parameter = Parameter.of(name)
    family = FAMILIES.get(parameter.family)
    if family is None:
        return f"no such family; families are {', '.join(LINEAR_FAMILIES)}"
    if parameter.family not in LINEAR_FAMILIES:
        return f"write it to [camera.NAME.{parameter.family}]"
    if is_grid(parameter.family):
        return f"values of '{parameter.family}', nodes of a grid, cannot be given"
    if not is_item(parameter.family, parameter.item):
        return f"family '{parameter.family}' has no such parameter; `aerotri explain parameters` lists them"
    if parameter.item in family.needs_height:
        return f"{name} depends on the heights of the points: its value cannot be given"
    if family.camera_model not in (None, model):
        return f'family \'{parameter.family}\' belongs to model = "{family.camera_model}", this camera is "{model}"'
    return ""
