"""Ebner's twelve parameters: orthogonal on 3 × 3 points of the image and to the orientation of a photograph.

[L] With k = x² − 2b²/3 and l = y² − 2b²/3: dx = p1·x + p2·y − 2·p3·k + p4·xy + p5·l + p7·xl + p9·yk + p11·kl,
dy = −p1·y + p2·x + p3·xy − 2·p4·l + p6·k + p8·yk + p10·xl + p12·kl. b is half the format here, not the base [C]; a
format of unequal half widths takes the generalised pairs of `products`, q = 2 [D]. Millimetres.
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

PATTERNS: dict[str, Pattern] = {
    "1": AFFINITY,
    "2": SHEAR,
    "3": TILT_X,
    "4": TILT_Y,
    "5": ("x", 0, 2),
    "6": ("y", 2, 0),
    "7": ("x", 1, 2),
    "8": ("y", 2, 1),
    "9": ("x", 2, 1),
    "10": ("y", 1, 2),
    "11": ("x", 2, 2),
    "12": ("y", 2, 2),
}
"""p1 to p12 as products of polynomials [L: Ebner 1976]."""


def polynomials(x: np.ndarray, b: float, partials: bool) -> Polynomials:
    """1, x and k = x² − 2b²/3: orthogonal on −b, 0, b."""
    one, zero = np.ones_like(x), np.zeros_like(x)
    value = np.stack([one, x, x**2 - 2.0 * b**2 / 3.0])
    return Polynomials(value, np.stack([zero, one, 2.0 * x]) if partials else None)


BASIS = ProductBasis(polynomials, q=2.0)
"""q = 2 makes the tilt pairs orthogonal to the orientation on 3 × 3 points [L: Ebner 1976]."""
FAMILY = literature_family(
    "ebner",
    "Ebner, Self calibrating block adjustment, Bildmessung und Luftbildwesen 44 (1976)",
    PATTERNS,
    BASIS,
    Wording("2", ("", "x", "k"), ("", "y", "l")),
)
