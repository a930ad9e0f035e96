"""Products of Chebyshev polynomials: the set of `legendre` with T_m(x/bx)·T_n(y/by), which weighs the edges more.

[C] Orthogonal over the format, and to the orientation of a photograph, with the weight of Chebyshev's polynomials,
1/√((1 − x²/bx²)·(1 − y²/by²)); in that weight q = 2 for k = x² − bx²/2 (see `products`), which is 1 for T_2.
12 parameters for 2 × 2, 44 for 4 × 4, 66 for 5 × 5. The parameters are millimetres.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from aerotri.functional_model.additional_parameters.legendre import square_family
from aerotri.functional_model.additional_parameters.products import Polynomials, ProductBasis

Q = 1.0
"""Of the tilt pairs for T_2 as it is scaled."""


def polynomials(degree: int, x: np.ndarray, b: float, partials: bool) -> Polynomials:
    """T_0 … T_degree of x/b: T_{k+1} = 2u·T_k − T_{k−1}, and the same differentiated."""
    u = x / b
    value = np.empty((degree + 1, len(u)))
    value[0], value[1] = 1.0, u
    for k in range(1, degree):
        value[k + 1] = 2.0 * u * value[k] - value[k - 1]
    if not partials:
        return Polynomials(value, None)
    slope = np.zeros_like(value)
    slope[1] = 1.0 / b
    for k in range(1, degree):
        slope[k + 1] = 2.0 / b * value[k] + 2.0 * u * slope[k] - slope[k - 1]
    return Polynomials(value, slope)


FAMILY = square_family(
    "chebyshev",
    "Products of Chebyshev polynomials over the format less the orientation; composition of this project",
    "T",
    "",
    lambda degree: ProductBasis(partial(polynomials, degree), Q, of_unit_square=True),
)
