"""The collinearity equations over many rays: x + vx = −c·u1/u3 + x0 + d(x, y), u = Rᵀ(X − X0) [L].

`interior` rows hold c, x0, y0, Brown's parameters, those of the forward lens and whether the camera is a fisheye (see
`INTERIOR_COLUMNS`); the linear additional parameters are added by the caller, since their columns do not change between
iterations.
"""

from __future__ import annotations

import numpy as np

from aerotri.functional_model import _kernels
from aerotri.functional_model._kernels import RayList, RayPartials
from aerotri.functional_model.additional_parameters import lens
from aerotri.observations import Camera
from aerotri.observations.block import BROWN_NAMES, INTERIOR_ELEMENTS

INTERIOR_COLUMNS = (
    *INTERIOR_ELEMENTS, *(f"brown.{name}" for name in BROWN_NAMES), *(f"lens.{name}" for name in lens.COLUMNS),
)  # fmt: skip
FIRST_LENS = len(INTERIOR_ELEMENTS) + len(BROWN_NAMES)
"""Where the forward lens begins."""


def interior_row(camera: Camera) -> np.ndarray:
    """(24,) start values of a camera's interior elements and lens parameters."""
    row = [camera.interior[name].value for name in INTERIOR_ELEMENTS]
    row += [camera.brown[name].value if name in camera.brown else 0.0 for name in BROWN_NAMES]
    return np.array([*row, *lens.vector_of(camera)])


def predict(
    rotation: np.ndarray,
    centre: np.ndarray,
    points: np.ndarray,
    interior: np.ndarray,
    image: np.ndarray,
    point: np.ndarray,
    lens_row: np.ndarray,
    xy: np.ndarray,
) -> np.ndarray:
    """Predicted image coordinates without linear additional parameters.

    Parameters
    ----------
    rotation : (n, 3, 3); centre : (n, 3) m; points : (N, 3) m; interior : (L, 24).
    image, point, lens_row : (m,) rows of these tables for every ray.
    xy : (m, 2) mm, measured positions.

    Returns
    -------
    (m, 2) mm.
    """
    _refuse_other_columns(interior)
    prediction = np.empty((len(image), 2))
    _kernels.predict_rays(rotation, centre, points, interior, RayList(image, point, lens_row, xy), prediction)
    return prediction


def linearise(
    rotation: np.ndarray,
    centre: np.ndarray,
    points: np.ndarray,
    interior: np.ndarray,
    image: np.ndarray,
    point: np.ndarray,
    lens_row: np.ndarray,
    xy: np.ndarray,
) -> RayPartials:
    """Prediction and analytic partials; arguments as in `predict`."""
    _refuse_other_columns(interior)
    m = len(image)
    out = RayPartials(
        np.empty((m, 2)), np.empty((m, 2, 6)), np.empty((m, 2, 3)), np.empty((m, 2, len(INTERIOR_COLUMNS)))
    )
    _kernels.linearise_rays(rotation, centre, points, interior, RayList(image, point, lens_row, xy), out)
    return out


def _refuse_other_columns(interior: np.ndarray) -> None:
    """Kernels do not see where an array ends.

    Raises
    ------
    ValueError
    """
    if interior.shape[1:] != (len(INTERIOR_COLUMNS),):
        raise ValueError(f"interior has the shape {interior.shape}, not (L, {len(INTERIOR_COLUMNS)})")
