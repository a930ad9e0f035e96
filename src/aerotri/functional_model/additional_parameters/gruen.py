"""Grün's 44 parameters: orthogonal on 5 × 5 points of the image and to the orientation of a photograph.

[L] With k = x² − b²/2, p = x² − 17b²/20, r = x²·(x² − 31b²/28) + 9b⁴/70 and l, q, s the same in y:
dx = a12·x + a21·y + a22·xy + a31·l − (10/7)·b22·k + a14·xp + a23·yk + a32·xl + a41·yq + a15·r + a24·xyp + a33·kl
+ a42·xyq + a51·s + a25·yr + a34·xlp + a43·ykq + a52·xs + a35·lr + a44·xypq + a53·ks + a45·yqr + a54·xps + a55·rs;
dy = −a12·y + a21·x + b22·xy − (10/7)·a22·l + b13·k + the same nineteen products with b. The indices of a and b are the
degrees in y and in x, plus one. b is half the format here, not the base [C]; a format of unequal half widths takes the
generalised pairs of `products`, q = 10/7 [D]. Millimetres.
"""

from __future__ import annotations

import numpy as np

from aerotri.functional_model.additional_parameters.products import (
    AFFINITY,
    SHEAR,
    TILT_X,
    TILT_Y,
    Pattern,
    Polynomials,
    ProductBasis,
    Wording,
    literature_family,
)

COMMON = ("14", "23", "32", "41", "15", "24", "33", "42", "51", "25", "34", "43", "52", "35", "44", "53", "45", "54",
          "55")  # fmt: skip
"""Indices of the nineteen products that stand in dx and in dy alike."""

PATTERNS: dict[str, Pattern] = {
    "a12": AFFINITY,
    "a21": SHEAR,
    "a22": TILT_Y,
    "b22": TILT_X,
    "a31": ("x", 0, 2),
    "b13": ("y", 2, 0),
    **{
        f"{letter}{ij}": (axis, int(ij[1]) - 1, int(ij[0]) - 1)
        for letter, axis in (("a", "x"), ("b", "y"))
        for ij in COMMON
    },
}
"""The 44 parameters as products of polynomials [L: Grün 1978]."""


def polynomials(x: np.ndarray, b: float, partials: bool) -> Polynomials:
    """1, x, k, x·p and r: orthogonal on −b, −b/2, 0, b/2, b."""
    one, zero, x2 = np.ones_like(x), np.zeros_like(x), x**2
    value = np.stack(
        [one, x, x2 - b**2 / 2.0, x * (x2 - 17.0 * b**2 / 20.0), x2 * (x2 - 31.0 * b**2 / 28.0) + 9.0 * b**4 / 70.0]
    )
    if not partials:
        return Polynomials(value, None)
    slope = [zero, one, 2.0 * x, 3.0 * x2 - 17.0 * b**2 / 20.0, x * (4.0 * x2 - 31.0 * b**2 / 14.0)]
    return Polynomials(value, np.stack(slope))


BASIS = ProductBasis(polynomials, q=10.0 / 7.0)
"""q = 10/7 makes the tilt pairs orthogonal to the orientation on 5 × 5 points [L: Grün 1978]."""
FAMILY = literature_family(
    "gruen",
    "Grün, Experiences with self-calibrating bundle adjustment, ACSM-ASP Convention (1978)",
    PATTERNS,
    BASIS,
    Wording("(10/7)", ("", "x", "k", "x·p", "r"), ("", "y", "l", "y·q", "s")),
)
