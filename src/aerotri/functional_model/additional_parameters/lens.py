"""A forward lens: distortion as a function of the ideal direction, as OpenCV, COLMAP, Bundler and BAL have it.

[L] With a, b = −u1/u3, −u2/u3: a' = a(1 + k1ρ² + k2ρ⁴ + k3ρ⁶) + 2p1ab + p2(ρ² + 2a²), b' alike; x = c·a' + x0. It
stands beside Brown's parameters because the two models are inverse to each other only approximately: a block from those
programs is adjusted in its own model, without a fit in between.
"""

from __future__ import annotations

import numpy as np

from aerotri.functional_model.additional_parameters.family import NO_UNIT, Family
from aerotri.observations.block import LENS_NAMES

ITEMS = LENS_NAMES
DESCRIPTION = {
    "k1": "radial ρ³ of the ideal direction",
    "k2": "radial ρ⁵ of the ideal direction",
    "p1": "decentring along y",
    "p2": "decentring along x",
    "k3": "radial ρ⁷ of the ideal direction",
}


def distort(a: np.ndarray, b: np.ndarray, parameters: np.ndarray) -> np.ndarray:
    """Distorted directions of ideal ones.

    Parameters
    ----------
    a, b : (n,) tangents of the ideal direction.
    parameters : (5,) k1, k2, p1, p2, k3.

    Returns
    -------
    (n, 2).
    """
    k1, k2, p1, p2, k3 = parameters
    rho2 = a * a + b * b
    radial = 1.0 + rho2 * (k1 + rho2 * (k2 + rho2 * k3))
    return np.stack(
        [
            a * radial + 2 * p1 * a * b + p2 * (rho2 + 2 * a * a),
            b * radial + p1 * (rho2 + 2 * b * b) + 2 * p2 * a * b,
        ],
        axis=-1,
    )


FAMILY = Family(
    name="lens",
    items=ITEMS,
    mark="L",
    reference="OpenCV calib3d; Agarwal et al., Bundle Adjustment in the Large (2010)",
    text=DESCRIPTION.__getitem__,
    unit=lambda _: NO_UNIT,
)
