"""Brown's lens parameters in Fraser's form, a function of the measured position.

[L] Δx = x̄(K1r² + K2r⁴ + K3r⁶) + P1(r² + 2x̄²) + 2P2x̄ȳ + b1x̄ + b2ȳ, Δy = ȳ(K1r² + …) + P2(r² + 2ȳ²) + 2P1x̄ȳ is a
correction, corrected = measured + Δ, so the image error is d = −Δ. x̄, ȳ count from the principal point, which is an
unknown of the interior orientation; the family is therefore evaluated inside the collinearity equations.
"""

from __future__ import annotations

import numpy as np

from aerotri.functional_model.additional_parameters.family import NO_UNIT, Family, per_mm
from aerotri.observations.block import BROWN_NAMES

ITEMS = BROWN_NAMES
DESCRIPTION = {
    "K1": "radial r³",
    "K2": "radial r⁵",
    "K3": "radial r⁷",
    "P1": "decentring along x",
    "P2": "decentring along y",
    "b1": "affinity, scale of x",
    "b2": "affinity, shear of x",
}
UNITS = {"K1": per_mm(2), "K2": per_mm(4), "K3": per_mm(6), "P1": per_mm(1), "P2": per_mm(1)}
"""Of parameters whose patterns are polynomials: those of image coordinates in mm; b1 and b2 have none."""


def image_error(x_bar: np.ndarray, y_bar: np.ndarray, parameters: np.ndarray) -> np.ndarray:
    """d = −Δ at positions counted from the principal point.

    Parameters
    ----------
    x_bar, y_bar : (n,) mm.
    parameters : (7,) in the order of `ITEMS`.

    Returns
    -------
    (n, 2) mm.
    """
    return basis(x_bar, y_bar) @ np.asarray(parameters, dtype=float)


def basis(x_bar: np.ndarray, y_bar: np.ndarray) -> np.ndarray:
    """(n, 2, 7) image error per unit of each parameter (K in mm⁻², mm⁻⁴, mm⁻⁶; P in mm⁻¹; b without unit)."""
    x, y = np.asarray(x_bar, dtype=float), np.asarray(y_bar, dtype=float)
    r2 = x * x + y * y
    zero = np.zeros_like(x)
    dx = [x * r2, x * r2**2, x * r2**3, r2 + 2 * x * x, 2 * x * y, x, y]
    dy = [y * r2, y * r2**2, y * r2**3, 2 * x * y, r2 + 2 * y * y, zero, zero]
    return -np.stack([np.stack(dx, axis=-1), np.stack(dy, axis=-1)], axis=1)


FAMILY = Family(
    name="brown",
    items=ITEMS,
    mark="L",
    reference="Fraser, Digital camera self-calibration, ISPRS Journal 52 (1997); sign as in DBAT",
    text=DESCRIPTION.__getitem__,
    unit=lambda item: UNITS.get(item, NO_UNIT),
)
