"""Interior orientation of a group of photographs about that of its camera: changes of c, x0 and y0.

[D] With ideal coordinates x = x0 + c·a, y = y0 + c·b a change of c moves an image point by (x − x0)/c, (y − y0)/c per
millimetre, one of x0 by (1, 0), one of y0 by (0, 1). c, x0 and y0 here are the start values of the camera; the camera's
own unknowns are the mean of its groups, and `adjustment.deviations` keeps the mean of the changes at 0.
"""

from __future__ import annotations

import numpy as np

from aerotri.functional_model.additional_parameters.family import Family
from aerotri.functional_model.additional_parameters.terms import Terms, dense_terms
from aerotri.observations import Camera

TEXTS = {
    "c": "change of the principal distance, of a group of photographs",
    "x0": "change of the principal point in x, of a group of photographs",
    "y0": "change of the principal point in y, of a group of photographs",
}
ELEMENTS = {"c": "focal_length_mm", "x0": "x0_mm", "y0": "y0_mm"}
"""The element of the camera that each of them is a change of."""


def terms(camera: Camera, x: np.ndarray, y: np.ndarray, partials: bool, items: tuple[str, ...]) -> Terms:
    """Patterns of some items at image points (n,) mm."""
    c, (x0, y0) = camera.focal_length_mm, camera.principal_point_mm

    def fill(x: np.ndarray, y: np.ndarray, value: np.ndarray, partial: np.ndarray | None) -> None:
        for k, item in enumerate(items):
            if item == "c":
                value[:, 0, k], value[:, 1, k] = (x - x0) / c, (y - y0) / c
                if partial is not None:
                    partial[:, 0, k, 0] = partial[:, 1, k, 1] = 1.0 / c
            else:
                value[:, "xy".index(item[0]), k] = 1.0

    return dense_terms(x, y, len(items), partials, fill)


FAMILY = Family(
    name="interior",
    items=tuple(TEXTS),
    mark="D",
    reference="derived: the collinearity equations by c, x0 and y0",
    text=TEXTS.__getitem__,
    unit=lambda item: "mm",
    evaluate=terms,
)
