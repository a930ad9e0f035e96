"""Products of one-dimensional orthogonal polynomials, less what the orientation of a photograph does.

Ebner's, Grün's, Legendre's and Chebyshev's sets are all X_m(x)·Y_n(y) in dx and in dy. Of the twelve functions up to
degree two, six are the shifts, the scale, the rotation and the two tilts over flat ground, (k, x·y) and (x·y, l) with
the quadratics k and l. Affinity, shear and two pairs of k, l and x·y stand in for the rest. Formats of unequal half
widths bx, by [D]: affinity (by/bx·x, −bx/by·y), shear (bx/by·y, by/bx·x), pairs (−q·(by/bx)²·k, x·y) and
(x·y, −q·(bx/by)²·l), orthogonal to the orientation when q is the mean of x²y² over that of k² where bx = by.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aerotri.functional_model.additional_parameters.family import NO_UNIT, Evaluate, Family, per_mm
from aerotri.functional_model.additional_parameters.terms import Terms, dense_terms
from aerotri.observations import Camera

AFFINITY, SHEAR, TILT_X, TILT_Y = "affinity", "shear", "tilt_x", "tilt_y"
PAIRS = (AFFINITY, SHEAR, TILT_X, TILT_Y)

ORIENTATION_PRODUCTS = {
    "x": {(0, 0), (1, 0), (0, 1), (1, 1), (2, 0)},
    "y": {(0, 0), (1, 0), (0, 1), (1, 1), (0, 2)},
}
"""Products (m, n) in dx and in dy that orientation and pairs make up."""

Pattern = str | tuple[str, int, int]
"""One of `PAIRS`, or the axis 'x' or 'y' of the displacement and the degrees m in x and n in y of a product."""


@dataclass(frozen=True, eq=False)
class Polynomials:
    """One-dimensional functions of degree 0, 1, … at n points.

    Parameters
    ----------
    value : (K, n).
    slope : (K, n) derivative by the coordinate in mm; None where no partials are wanted.
    """

    value: np.ndarray
    slope: np.ndarray | None


@dataclass(frozen=True)
class ProductBasis:
    """What tells one set of products from another.

    Parameters
    ----------
    polynomials : of coordinates (n,) mm and the half width in mm; with slopes when the last argument is true.
    q : of the tilt pairs, for k and l as the polynomials of degree two are scaled.
    of_unit_square : polynomials of x/bx and y/by; the four pairs are then without unit as well.
    """

    polynomials: Callable[[np.ndarray, float, bool], Polynomials]
    q: float
    of_unit_square: bool = False


def product_terms(
    basis: ProductBasis, patterns: Sequence[Pattern], camera: Camera, x: np.ndarray, y: np.ndarray, partials: bool
) -> Terms:
    """`Terms` of patterns at points (n,) mm from the image centre, a column each."""
    bx, by = camera.half_format_mm
    ratio = float(np.sqrt(by / bx)) if basis.of_unit_square else by / bx
    products = [(k, *part) for k, pattern in enumerate(patterns) for part in _components(pattern, ratio, basis.q)]

    def fill(x: np.ndarray, y: np.ndarray, value: np.ndarray, partial: np.ndarray | None) -> None:
        along_x, along_y = basis.polynomials(x, bx, partials), basis.polynomials(y, by, partials)
        for k, axis, coefficient, m, n in products:
            np.multiply(coefficient * along_x.value[m], along_y.value[n], out=value[:, axis, k])
            if partial is not None and along_x.slope is not None and along_y.slope is not None:
                partial[:, axis, k, 0] = coefficient * along_x.slope[m] * along_y.value[n]
                partial[:, axis, k, 1] = coefficient * along_x.value[m] * along_y.slope[n]

    return dense_terms(x, y, len(patterns), partials, fill)


def _components(pattern: Pattern, ratio: float, q: float) -> list[tuple[int, float, int, int]]:
    """(axis, coefficient, m, n) of the one or two products of a pattern."""
    if pattern == AFFINITY:
        return [(0, ratio, 1, 0), (1, -1.0 / ratio, 0, 1)]
    if pattern == SHEAR:
        return [(0, 1.0 / ratio, 0, 1), (1, ratio, 1, 0)]
    if pattern == TILT_X:
        return [(0, -q * ratio**2, 2, 0), (1, 1.0, 1, 1)]
    if pattern == TILT_Y:
        return [(0, 1.0, 1, 1), (1, -q / ratio**2, 0, 2)]
    axis, m, n = pattern
    return [("xy".index(axis), 1.0, int(m), int(n))]


def products_up_to(m: int, n: int) -> tuple[Pattern, ...]:
    """All patterns up to degrees m in x and n in y, both at least 2: 2·(m + 1)·(n + 1) − 6, by total degree."""
    degrees = sorted(((i, j) for i in range(m + 1) for j in range(n + 1)), key=lambda d: (d[0] + d[1], d[1]))
    return (*PAIRS, *((axis, i, j) for i, j in degrees for axis in "xy" if (i, j) not in ORIENTATION_PRODUCTS[axis]))


def pattern_text(pattern: Pattern, q: str, along_x: Sequence[str], along_y: Sequence[str]) -> str:
    """A pattern in a few words; q and the polynomials of degree 0, 1, … as they are to be written."""
    if pattern in (AFFINITY, SHEAR):
        return "affinity" if pattern == AFFINITY else "angular affinity"
    if isinstance(pattern, str):
        tilt_x = pattern == TILT_X
        quadratic, other = f"−{q}{(along_x if tilt_x else along_y)[2]}", f"{along_x[1]}·{along_y[1]}"
        return f"pair ({quadratic}, {other})" if tilt_x else f"pair ({other}, {quadratic})"
    axis, m, n = pattern
    return f"d{axis} = " + "·".join(names[k] for names, k in ((along_x, m), (along_y, n)) if k)


def evaluation(patterns: Mapping[str, Pattern], basis_of: Callable[[Sequence[Pattern]], ProductBasis]) -> Evaluate:
    """The evaluation of a family of products.

    Parameters
    ----------
    patterns : by item. basis_of : the basis for some patterns, whose polynomials need not reach beyond them.
    """

    def evaluate(camera: Camera, x: np.ndarray, y: np.ndarray, partials: bool, items: tuple[str, ...]) -> Terms:
        chosen = [patterns[item] for item in items]
        return product_terms(basis_of(chosen), chosen, camera, x, y, partials)

    return evaluate


@dataclass(frozen=True)
class Wording:
    """How the texts of a set write it.

    Parameters
    ----------
    q : the factor of the tilt pairs.
    along_x, along_y : the polynomials of degree 0, 1, …
    """

    q: str
    along_x: tuple[str, ...]
    along_y: tuple[str, ...]


def literature_family(
    name: str, reference: str, patterns: Mapping[str, Pattern], basis: ProductBasis, wording: Wording
) -> Family:
    """A set of the literature: named products of polynomials in millimetres."""
    text = {item: pattern_text(p, wording.q, wording.along_x, wording.along_y) for item, p in patterns.items()}
    return Family(
        name=name,
        items=tuple(patterns),
        mark="L",
        reference=reference,
        text=text.__getitem__,
        unit=lambda item: unit_of_product(patterns[item]),
        evaluate=evaluation(patterns, lambda _: basis),
    )


def unit_of_product(pattern: Pattern) -> str:
    """Unit of the parameter of a product in millimetres: one over mm to the degree less one."""
    if isinstance(pattern, str):
        return NO_UNIT if pattern in (AFFINITY, SHEAR) else per_mm(1)
    return per_mm(int(pattern[1]) + int(pattern[2]) - 1)
