"""Products of Legendre polynomials: orthogonal over the format and to the orientation of a photograph.

[C] P_m(x/bx)·P_n(y/by) in dx and in dy up to order M × N, less the six functions that are orientation: the low orders
are replaced by affinity, shear and two pairs, q = 5/4 for k = x² − bx²/3 (see `products`), which is 5/6 for P_2.
12 parameters for 2 × 2, 44 for 4 × 4, 66 for 5 × 5. The parameters are millimetres.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, partial

import numpy as np

from aerotri.functional_model.additional_parameters.family import Family
from aerotri.functional_model.additional_parameters.products import (
    Pattern,
    Polynomials,
    ProductBasis,
    evaluation,
    pattern_text,
    products_up_to,
)
from aerotri.functional_model.additional_parameters.sizes import Sizes

LARGEST = (6, 6)
"""Orders offered at most [C]: 92 parameters; finer image errors are for the random field."""
OfDegree = Callable[[int], ProductBasis]
Q = 5.0 / 6.0
"""Of the tilt pairs for P_2 as it is scaled."""


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


def square_family(name: str, reference: str, letter: str, q_text: str, basis: OfDegree) -> Family:
    """A family of products of polynomials of x/bx and y/by, in orders M × N.

    Parameters
    ----------
    letter : of the polynomials in texts, as P or T. q_text : factor of the tilt pairs in texts.
    basis : the products with polynomials up to a degree.
    """
    names = [["", *(f"{letter}{k}({axis})" for k in range(1, max(LARGEST) + 1))] for axis in "xy"]
    sizes = Sizes("order in x and in y", (2, 2), (2, 2), LARGEST, items_of_order)
    return Family(
        name=name,
        items=tuple(PATTERNS),
        mark="C",
        reference=reference,
        text=lambda item: pattern_text(PATTERNS[item], q_text, *names),
        unit=lambda _: "mm",
        evaluate=evaluation(PATTERNS, lambda chosen: basis(largest_degree(chosen))),
        default_items=sizes.items(sizes.default),
        sizes=sizes,
    )


FAMILY = square_family(
    "legendre",
    "Products of Legendre polynomials over the format less the orientation; composition of this project",
    "P",
    "5/6·",
    lambda degree: ProductBasis(partial(polynomials, degree), Q, of_unit_square=True),
)
