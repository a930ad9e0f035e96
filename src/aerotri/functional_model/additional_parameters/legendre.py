"""Products of Legendre polynomials: orthogonal over the format and to the orientation of a photograph.

[C] P_m(x/bx)·P_n(y/by) in dx and in dy up to order M × N, less the six functions that are orientation: the low orders
are replaced by affinity, shear and two pairs, q = 5/4 for k = x² − bx²/3 (see `products`), which is 5/6 for P_2.
12 parameters for 2 × 2, 44 for 4 × 4, 66 for 5 × 5. The parameters are millimetres.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, partial

import numpy as np

from aerotri.functional_model.additional_parameters.products import (
    Pattern,
    Polynomials,
    ProductBasis,
    pattern_text,
    product_terms,
    products_up_to,
)
from aerotri.functional_model.additional_parameters.sizes import Sizes
from aerotri.functional_model.additional_parameters.terms import Terms
from aerotri.observations import Camera

FAMILY = "legendre"
MARK = "C"
CAMERA_MODEL = None
REFERENCE = "Products of Legendre polynomials over the format less the orientation; composition of this project"
LARGEST = (6, 6)
Q = 5.0 / 6.0


def item_name(pattern: Pattern) -> str:
    """'affinity', 'shear', 'tilt_x', 'tilt_y', or for a product in dx 'ax0y2', in dy 'bx2y0'."""
    if isinstance(pattern, str):
        return pattern
    axis, m, n = pattern
    return f"{'ab'['xy'.index(axis)]}x{m}y{n}"


@cache
def items_of_order(m: int, n: int) -> tuple[str, ...]:
    """Items of the set of order m × n; the first of every larger one of the same shape."""
    return tuple(item_name(pattern) for pattern in products_up_to(m, n))


PATTERNS: dict[str, Pattern] = {item_name(pattern): pattern for pattern in products_up_to(*LARGEST)}
ITEMS = tuple(PATTERNS)
SIZES = Sizes("order in x and in y", (2, 2), (2, 2), LARGEST, items_of_order)
DEFAULT_ITEMS = SIZES.items(SIZES.default)
NAMES = [["", *(f"P{k}({axis})" for k in range(1, max(LARGEST) + 1))] for axis in "xy"]
DESCRIPTION = {item: pattern_text(pattern, "5/6·", *NAMES) for item, pattern in PATTERNS.items()}


def largest_degree(patterns: Sequence[Pattern]) -> int:
    """The largest degree that occurs in patterns, at least 2."""
    return max([2, *(max(int(p[1]), int(p[2])) for p in patterns if not isinstance(p, str))])


def polynomials(degree: int, x: np.ndarray, b: float, partials: bool) -> Polynomials:
    """P_0 … P_degree of x/b by the three-term recurrence; P'_{k+1} = P'_{k−1} + (2k + 1)·P_k."""
    u = x / b
    value = np.empty((degree + 1, len(u)))
    value[0], value[1] = 1.0, u
    for k in range(1, degree):
        value[k + 1] = ((2 * k + 1) * u * value[k] - k * value[k - 1]) / (k + 1)
    if not partials:
        return Polynomials(value, None)
    slope = np.zeros_like(value)
    slope[1] = 1.0 / b
    for k in range(1, degree):
        slope[k + 1] = slope[k - 1] + (2 * k + 1) / b * value[k]
    return Polynomials(value, slope)


def terms(
    camera: Camera, x: np.ndarray, y: np.ndarray, partials: bool = False, items: Sequence[str] | None = None
) -> Terms:
    """Legendre patterns at image points.

    Parameters
    ----------
    x, y : (n,) mm from the image centre.
    partials : whether the derivatives are wanted.
    items : which items, all there are unless given.

    Returns
    -------
    Terms with a column for every item.
    """
    patterns = [PATTERNS[item] for item in (ITEMS if items is None else items)]
    basis = ProductBasis(partial(polynomials, largest_degree(patterns)), Q, of_unit_square=True)
    return product_terms(basis, patterns, camera, x, y, partials)
