"""The sets of additional parameters there are, in words and in pictures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from aerotri.conventions import FilePath, InputError

if TYPE_CHECKING:
    from aerotri.functional_model.additional_parameters import ParameterDescription

USUAL_CAMERA = "ultracam_d"
"""Over its format the patterns of families are drawn that belong to no camera."""


def list_parameters(family: str | None = None) -> tuple[ParameterDescription, ...]:
    """The additional parameters that `aerotri.adjust` takes.

    Parameters
    ----------
    family : one family in full, such as 'bluh' or 'dmc'; all where None.

    Returns
    -------
    tuple of ParameterDescription
        Family, item, mark, source and meaning of every parameter.

    Raises
    ------
    InputError
        For a family that there is not.

    Examples
    --------
    >>> found = list_parameters("brown")
    >>> [parameter.item for parameter in found][:3]
    ['K1', 'K2', 'K3']
    """
    from aerotri.functional_model.additional_parameters import describe

    _refuse_unknown(family)
    return tuple(d for d in describe() if family in (None, d.family))


def draw_parameters(out: FilePath, family: str | None = None) -> tuple[str, ...]:
    """Draw what the parameters do over the format of a camera: PNG and SVG files.

    Parameters
    ----------
    out : folder of the pictures.
    family : one family; all where None.

    Returns
    -------
    tuple of str
        The families that were drawn.

    Raises
    ------
    InputError
        For a family that there is not.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as place:
    ...     draw_parameters(place, "brown")
    ('brown',)
    """
    from aerotri.functional_model.additional_parameters import FAMILIES
    from aerotri.report.plots.overview import save_plots
    from aerotri.report.plots.parameters import plot_pattern_sheets
    from aerotri.simulation.cameras import block_camera
    from aerotri.simulation.spec import CameraSpec

    _refuse_unknown(family)
    drawn = [name for name in FAMILIES if family in (None, name)]
    for name in drawn:
        model = FAMILIES[name].camera_model or USUAL_CAMERA
        camera = block_camera(model, CameraSpec.model_validate({"preset": model}))
        sheets = plot_pattern_sheets(name, camera)
        save_plots({f"{name}_{k}" if k else name: sheet for k, sheet in enumerate(sheets)}, Path(out))
    return tuple(drawn)


def _refuse_unknown(family: str | None) -> None:
    from aerotri.functional_model.additional_parameters import FAMILIES

    if family is not None and family not in FAMILIES:
        raise InputError(f"unknown parameter family '{family}'", f"known are {', '.join(FAMILIES)}")
