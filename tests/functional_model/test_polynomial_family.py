"""Ebner, Grün, Legendre and Chebyshev of models.md 4: counts, formulas, orthogonality on equal and unequal formats."""

import numpy as np
import pytest
from numpy.polynomial import chebyshev as chebyshev_series
from numpy.polynomial import legendre as legendre_series
from test_additional_parameters import orientation_columns

from aerotri.functional_model.additional_parameters import parameter_set, parse_parameters
from aerotri.functional_model.additional_parameters.registry import default_items
from aerotri.observations import Camera
from family_cameras import INTERIOR

SIZES = [(23000, 23000), (11500, 7500), (7680, 13824)]
F = 101.4


def camera_of(size):
    return Camera("c", "frame", size, 9.0, INTERIOR)


def points_and_weights(family, half):
    """Where, and with which weights, a family is orthogonal."""
    if family in ("ebner", "gruen"):
        one = np.linspace(-1, 1, 3 if family == "ebner" else 5)
        weight = np.ones_like(one)
    elif family == "legendre":
        one, weight = legendre_series.leggauss(8)
    else:
        one, weight = chebyshev_series.chebgauss(8)
    x, y = (g.ravel() for g in np.meshgrid(one * half[0], one * half[1]))
    return x, y, np.outer(weight, weight).ravel()


def chosen_items(family):
    return dict(parse_parameters(f"{family}:4x4" if family in ("legendre", "chebyshev") else family))[family]


def cosines(columns, weight):
    weighted = columns * np.sqrt(np.repeat(weight, 2))[:, None]
    weighted /= np.linalg.norm(weighted, axis=0)
    return weighted.T @ weighted


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("family", ["ebner", "gruen", "legendre", "chebyshev"])
def test_orthogonal_to_each_other_and_to_the_orientation(family, size):
    """Equal and unequal half widths alike; on 3 × 3 points, 5 × 5 points, over the format, in Chebyshev's weight."""
    camera = camera_of(size)
    x, y, weight = points_and_weights(family, camera.half_format_mm)
    items = chosen_items(family)
    basis = parameter_set(family, items, camera).basis(x, y).reshape(-1, len(items))
    orientation = orientation_columns(x, y, F).reshape(-1, 6)
    # the tilts without the shift that is in them
    shifts, tilts = orientation[:, :2], orientation[:, 4:]
    w = np.repeat(weight, 2)[:, None]
    orientation[:, 4:] -= shifts * (np.sum(w * shifts * tilts, axis=0) / np.sum(w * shifts**2, axis=0))
    table = cosines(np.hstack([basis, orientation]), weight)
    np.testing.assert_allclose(table, np.eye(len(table)), atol=1e-10)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("family", ["ebner", "gruen", "legendre:4x4", "chebyshev:4x4", "legendre:5x5"])
def test_with_the_orientation_the_sets_span_all_products(family, size):
    """12 + 6 = 2·3·3, 44 + 6 = 2·5·5, 66 + 6 = 2·6·6: nothing is missing and nothing is there twice."""
    ((name, items),) = parse_parameters(family)
    camera = camera_of(size)
    half = camera.half_format_mm
    x, y = (g.ravel() for g in np.meshgrid(np.linspace(-half[0], half[0], 9), np.linspace(-half[1], half[1], 9)))
    basis = parameter_set(name, items, camera).basis(x, y).reshape(-1, len(items))
    degree = round(np.sqrt((len(items) + 6) / 2)) - 1
    powers = [(x / half[0]) ** i * (y / half[1]) ** j for i in range(degree + 1) for j in range(degree + 1)]
    zero = np.zeros_like(x)
    products = np.array([np.stack(d, -1).ravel() for p in powers for d in ((p, zero), (zero, p))])
    together = np.hstack([basis, orientation_columns(x, y, F).reshape(-1, 6)])
    together /= np.linalg.norm(together, axis=0)
    assert np.linalg.matrix_rank(together, tol=1e-8) == len(items) + 6 == len(products)
    left = together - products.T @ np.linalg.lstsq(products.T, together, rcond=None)[0]
    np.testing.assert_allclose(left, 0.0, atol=1e-10)


def test_affinity_of_the_equal_width_formula_would_correlate_with_the_scale():
    """models.md 4: (x, −y) correlates .39 with the scale on an UltraCamD format; the generalised one does not."""
    camera = camera_of((11500, 7500))
    half = camera.half_format_mm
    x, y = (g.ravel() for g in np.meshgrid(np.linspace(-half[0], half[0], 3), np.linspace(-half[1], half[1], 3)))
    scale, plain = np.stack([x, y], -1).ravel(), np.stack([x, -y], -1).ravel()
    general = parameter_set("ebner", ["1"], camera).basis(x, y).ravel()

    def cosine(a, b):
        return a @ b / np.linalg.norm(a) / np.linalg.norm(b)

    assert cosine(scale, plain) == pytest.approx(0.39, abs=0.02)
    assert cosine(scale, general) == pytest.approx(0.0, abs=1e-12)


def test_ebner_by_formula():
    """models.md 4, equal half widths b: the whole sum with twelve parameters."""
    camera = camera_of((20000, 20000))
    b = camera.half_format_mm[0]
    rng = np.random.default_rng(4)
    x, y = rng.uniform(-b, b, (2, 20))
    p = np.concatenate([[0.0], rng.normal(size=12)])
    k, l = x**2 - 2 * b**2 / 3, y**2 - 2 * b**2 / 3
    dx = p[1] * x + p[2] * y - 2 * p[3] * k + p[4] * x * y + p[5] * l + p[7] * x * l + p[9] * y * k + p[11] * k * l
    dy = -p[1] * y + p[2] * x + p[3] * x * y - 2 * p[4] * l + p[6] * k + p[8] * y * k + p[10] * x * l + p[12] * k * l
    basis = parameter_set("ebner", default_items("ebner"), camera).basis(x, y)
    np.testing.assert_allclose(basis @ p[1:], np.column_stack([dx, dy]), rtol=1e-10)


def test_gruen_by_formula():
    """models.md 4, equal half widths b: the whole sum with 44 parameters."""
    camera = camera_of((20000, 20000))
    b = camera.half_format_mm[0]
    rng = np.random.default_rng(5)
    x, y = rng.uniform(-b, b, (2, 20))
    k, l = x**2 - b**2 / 2, y**2 - b**2 / 2
    p, q = x**2 - 17 * b**2 / 20, y**2 - 17 * b**2 / 20
    r, s = (z**2 * (z**2 - 31 * b**2 / 28) + 9 * b**4 / 70 for z in (x, y))
    common = [
        x * p, y * k, x * l, y * q, r, x * y * p, k * l, x * y * q, s, y * r, x * l * p, y * k * q, x * s, l * r,
        x * y * p * q, k * s, y * q * r, x * p * s, r * s,
    ]  # fmt: skip
    order = (
        "14", "23", "32", "41", "15", "24", "33", "42", "51", "25", "34", "43", "52", "35", "44", "53", "45", "54", "55"
    )  # fmt: skip
    chosen = parameter_set("gruen", default_items("gruen"), camera)
    assert len(chosen.items) == 44
    value = dict(zip(chosen.items, rng.normal(size=44), strict=True))
    dx = value["a12"] * x + value["a21"] * y + value["a22"] * x * y + value["a31"] * l - 10 / 7 * value["b22"] * k
    dy = -value["a12"] * y + value["a21"] * x + value["b22"] * x * y - 10 / 7 * value["a22"] * l + value["b13"] * k
    dx = dx + sum(value[f"a{ij}"] * c for ij, c in zip(order, common, strict=True))
    dy = dy + sum(value[f"b{ij}"] * c for ij, c in zip(order, common, strict=True))
    found = chosen.basis(x, y) @ np.array([value[item] for item in chosen.items])
    np.testing.assert_allclose(found, np.column_stack([dx, dy]), rtol=1e-9)


@pytest.mark.parametrize(
    ("family", "series"), [("legendre", legendre_series.legval), ("chebyshev", chebyshev_series.chebval)]
)
def test_products_by_numpy(family, series):
    """ax3y2 is P_3(x/bx)·P_2(y/by) in x; bx0y6 in y."""
    camera = camera_of((11500, 7500))
    half = camera.half_format_mm
    x, y = np.array([10.0, -51.0]), np.array([-20.0, 33.0])

    def polynomial(degree, u):
        return series(u, np.eye(degree + 1)[degree])

    basis = parameter_set(family, ["ax3y2", "bx0y6"], camera).basis(x, y)
    np.testing.assert_allclose(basis[:, 0, 0], polynomial(3, x / half[0]) * polynomial(2, y / half[1]))
    np.testing.assert_allclose(basis[:, 1, 1], polynomial(6, y / half[1]))
    assert not basis[:, 1, 0].any()
    assert not basis[:, 0, 1].any()


@pytest.mark.parametrize("family", ["legendre", "chebyshev"])
def test_sizes_are_nested(family):
    """A larger order holds a smaller one, in the same sequence; M along x, N along y."""
    small, large = (dict(parse_parameters(f"{family}:{size}"))[family] for size in ("2x3", "4x4"))
    assert tuple(item for item in large if item in small) == small
    assert "ax0y3" in small
    assert "ax3y0" not in small


def test_ebner_and_gruen_are_orthogonal_on_their_own_points_only():
    """On the other's points they are not: the points are part of the model."""
    camera = camera_of((20000, 20000))
    for family, other in (("ebner", "gruen"), ("gruen", "ebner")):
        x, y, weight = points_and_weights(other, camera.half_format_mm)
        items = default_items("ebner") if family == "ebner" else ("a12", "a14", "a32")
        table = cosines(parameter_set(family, items, camera).basis(x, y).reshape(-1, len(items)), weight)
        assert np.abs(table - np.eye(len(items))).max() > 0.05
