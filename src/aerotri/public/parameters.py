"""The sets of additional parameters there are: in words, in numbers and in pictures.

>>> from aerotri import parameters
>>> [one.item for one in parameters.list_parameters("brown")][:3]
['K1', 'K2', 'K3']
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.public.folders import refuse_no_folder

if TYPE_CHECKING:
    from aerotri.functional_model.additional_parameters import ParameterDescription
    from aerotri.observations import Camera

__all__ = ["draw_parameters", "list_parameters", "orientation_patterns", "patterns"]
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
        For a family that there is not, or a folder that cannot be written to.

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
    from aerotri.simulation.camera_spec import CameraSpec
    from aerotri.simulation.cameras import block_camera

    _refuse_unknown(family)
    refuse_no_folder(Path(out))
    drawn = [name for name in FAMILIES if family in (None, name)]
    for name in drawn:
        model = FAMILIES[name].camera_model or USUAL_CAMERA
        camera = block_camera(model, CameraSpec.model_validate({"preset": model}))
        sheets = plot_pattern_sheets(name, camera)
        save_plots({f"{name}_{k}" if k else name: sheet for k, sheet in enumerate(sheets)}, Path(out))
    return tuple(drawn)


def patterns(parameters: str, camera: Camera, xy: np.ndarray) -> tuple[tuple[str, ...], np.ndarray]:
    """What a unit of each parameter moves image points by.

    Parameters
    ----------
    parameters : as `aerotri.adjust` takes them, such as 'bluh:1-12,ultracam_d:42-73'; not Brown's, which count from
        the principal point and not from the image centre.
    camera : of the photographs.
    xy : (n, 2) mm from the image centre.

    Returns
    -------
    names : (p,) of the parameters.
    patterns : (n, 2, p) mm for a unit of each.

    Raises
    ------
    InputError
        For parameters that there are not, or that the camera does not have.

    Examples
    --------
    >>> import aerotri, numpy as np
    >>> camera = aerotri.simulate(aerotri.example_flight(), seed=1).block.cameras[0]
    >>> names, values = patterns("bluh:1-2", camera, np.array([[1.0, 2.0], [3.0, -1.0]]))
    >>> names, values.shape
    (('bluh.1', 'bluh.2'), (2, 2, 2))
    """
    from aerotri.functional_model.additional_parameters import AUTO, FAMILIES, parameter_set, parse_parameters

    choice = parse_parameters(parameters)
    if choice == AUTO:
        raise InputError("'auto' is no set of parameters", "name the parameters")
    others = [family for family, _ in choice if not FAMILIES[family].is_linear]
    if others:
        raise InputError(f"'{others[0]}' is no function of the image position alone", "leave it out")
    at = np.asarray(xy, dtype=float)
    sets = [parameter_set(family, items, camera) for family, items in choice]
    values = [one.basis(at[:, 0], at[:, 1]) for one in sets]
    names = tuple(name for one in sets for name in one.names)
    return names, np.concatenate([np.zeros((len(at), 2, 0)), *values], axis=2)


def orientation_patterns(xy: np.ndarray, focal_length_mm: float) -> np.ndarray:
    """(n, 2, 6) what the orientation of a photograph over flat ground takes: shifts, scale, rotation, two tilts.

    Parameters
    ----------
    xy : (n, 2) mm from the image centre.
    focal_length_mm : principal distance.

    Examples
    --------
    >>> import numpy as np
    >>> orientation_patterns(np.array([[1.0, 2.0]]), 100.0).shape
    (1, 2, 6)
    """
    from aerotri.functional_model.orientation_patterns import orientation_patterns as six_patterns

    at = np.asarray(xy, dtype=float)
    return six_patterns(at[:, 0], at[:, 1], focal_length_mm)


def _refuse_unknown(family: str | None) -> None:
    from aerotri.functional_model.additional_parameters import FAMILIES

    if family is not None and family not in FAMILIES:
        raise InputError(f"unknown parameter family '{family}'", f"known are {', '.join(FAMILIES)}")
