"""Polynomials, waves and grids over the format, written anew for the cross-check.

Nothing here comes from `functional_model`. All patterns are the image error per unit of a parameter, mm, at a position
(x, y) in mm from the image centre; bx and by are half the width and half the height of the format.
"""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
from numpy.polynomial import Chebyshev, Legendre

Pair = tuple[np.ndarray, np.ndarray]
"""dx and dy."""

Polynomial = Callable[[int], Callable[[np.ndarray], np.ndarray]]
"""The polynomial of a degree."""

PRODUCT = re.compile(r"([ab])x(\d+)y(\d+)")
WAVE = re.compile(r"([xy])([cs])(\d+)([pm])(\d+)")
NODE = re.compile(r"(\d+)x(\d+)_([xy])_(\d+)_(\d+)")

GRUEN_PRODUCTS = {
    "14": "x p", "23": "y k", "32": "x l", "41": "y q", "15": "r", "24": "x y p", "33": "k l", "42": "x y q", "51": "s",
    "25": "y r", "34": "x l p", "43": "y k q", "52": "x s", "35": "l r", "44": "x y p q", "53": "k s", "45": "y q r",
    "54": "x p s", "55": "r s",
}  # fmt: skip
"""Factors of the nineteen products of Grün's set, by the indices of their coefficients [L]."""


def _parts(form: re.Pattern[str], item: str) -> tuple[str, ...]:
    """What stands in the name of an item.

    Raises
    ------
    KeyError
        When the item has another form.
    """
    match = form.fullmatch(item)
    if match is None:
        raise KeyError(item)
    return match.groups()


def ebner(item: str, x: np.ndarray, y: np.ndarray, half: tuple[float, float]) -> Pair:
    """Ebner's twelve parameters [L: Ebner 1976; formats of unequal halves D]."""
    bx, by = half
    k, l, zero = x**2 - 2.0 * bx**2 / 3.0, y**2 - 2.0 * by**2 / 3.0, 0.0 * x
    return {
        "1": (x * by / bx, -y * bx / by),
        "2": (y * bx / by, x * by / bx),
        "3": (-2.0 * k * (by / bx) ** 2, x * y),
        "4": (x * y, -2.0 * l * (bx / by) ** 2),
        "5": (l, zero),
        "6": (zero, k),
        "7": (x * l, zero),
        "8": (zero, y * k),
        "9": (y * k, zero),
        "10": (zero, x * l),
        "11": (k * l, zero),
        "12": (zero, k * l),
    }[item]


def gruen(item: str, x: np.ndarray, y: np.ndarray, half: tuple[float, float]) -> Pair:
    """Grün's forty-four parameters [L: Grün 1978; formats of unequal halves D]."""
    bx, by = half
    factor = {
        "x": x, "k": x**2 - bx**2 / 2.0, "p": x**2 - 17.0 * bx**2 / 20.0,
        "r": x**4 - 31.0 / 28.0 * bx**2 * x**2 + 9.0 / 70.0 * bx**4,
        "y": y, "l": y**2 - by**2 / 2.0, "q": y**2 - 17.0 * by**2 / 20.0,
        "s": y**4 - 31.0 / 28.0 * by**2 * y**2 + 9.0 / 70.0 * by**4,
    }  # fmt: skip
    low = {
        "a12": (x * by / bx, -y * bx / by),
        "a21": (y * bx / by, x * by / bx),
        "a22": (x * y, -10.0 / 7.0 * factor["l"] * (bx / by) ** 2),
        "b22": (-10.0 / 7.0 * factor["k"] * (by / bx) ** 2, x * y),
        "a31": (factor["l"], 0.0 * x),
        "b13": (0.0 * x, factor["k"]),
    }
    if item in low:
        return low[item]
    product = np.ones(len(x))
    for name in GRUEN_PRODUCTS[item[1:]].split():
        product = product * factor[name]
    return (product, 0.0 * x) if item[0] == "a" else (0.0 * x, product)


def legendre(item: str, x: np.ndarray, y: np.ndarray, half: tuple[float, float]) -> Pair:
    """Products of Legendre polynomials over the format less the orientation [C]."""
    return _product(item, x / half[0], y / half[1], half[1] / half[0], (Legendre.basis, 5.0 / 6.0))


def chebyshev(item: str, x: np.ndarray, y: np.ndarray, half: tuple[float, float]) -> Pair:
    """Products of Chebyshev polynomials over the format less the orientation [C]."""
    return _product(item, x / half[0], y / half[1], half[1] / half[0], (Chebyshev.basis, 1.0))


def _product(item: str, u: np.ndarray, v: np.ndarray, ratio: float, basis: tuple[Polynomial, float]) -> Pair:
    """A product of two polynomials, or one of the pairs that are orthogonal to the orientation.

    Parameters
    ----------
    u, v : x/bx, y/by. ratio : by/bx. basis : the polynomial of a degree, and the factor of the second in the tilt
        pairs: mean of u²v² over the mean of u² times the polynomial, in the weight of the polynomials [D].
    """
    polynomial, q = basis
    if item == "affinity":
        return u * ratio**0.5, -v / ratio**0.5
    if item == "shear":
        return v / ratio**0.5, u * ratio**0.5
    if item == "tilt_x":
        return -q * ratio * polynomial(2)(u), u * v
    if item == "tilt_y":
        return u * v, -q / ratio * polynomial(2)(v)
    axis, m, n = _parts(PRODUCT, item)
    value = polynomial(int(m))(u) * polynomial(int(n))(v)
    return (value, 0.0 * u) if axis == "a" else (0.0 * u, value)


def fourier(item: str, x: np.ndarray, y: np.ndarray, half: tuple[float, float]) -> Pair:
    """Waves over the format: cos or sin of m·πx/bx ± n·πy/by, in dx or in dy [C]."""
    axis, function, m, sign, n = _parts(WAVE, item)
    along_y = -int(n) if sign == "m" else int(n)
    phase = int(m) * np.pi * x / half[0] + along_y * np.pi * y / half[1]
    value = np.cos(phase) if function == "c" else np.sin(phase)
    return (value, 0.0 * x) if axis == "x" else (0.0 * x, value)


def grid(item: str, x: np.ndarray, y: np.ndarray, half: tuple[float, float]) -> Pair:
    """A node of a bilinear grid over the format, counted from the lower left [C].

    Beyond the format the field goes on as it is at the edge.
    """
    columns, rows, axis, column, row = _parts(NODE, item)
    value = np.ones(len(x))
    for position, b, count, node in ((x, half[0], columns, column), (y, half[1], rows, row)):
        corners = np.linspace(-b, b, int(count))
        value = value * np.interp(position, corners, np.arange(int(count)) == int(node))
    return (value, 0.0 * x) if axis == "x" else (0.0 * x, value)


FORMULAS: dict[str, Callable[[str, np.ndarray, np.ndarray, tuple[float, float]], Pair]] = {
    "ebner": ebner, "gruen": gruen, "legendre": legendre, "chebyshev": chebyshev, "fourier": fourier, "grid": grid,
}  # fmt: skip
"""The image error of one parameter, by family."""


def knows(family: str, item: str) -> bool:
    """Whether a family has a formula for a parameter."""
    here = np.zeros(1)
    try:
        FORMULAS[family](item, here, here, (1.0, 1.0))
    except KeyError:
        return False
    return True
