"""Systematic image errors: value, covariance, significance, groups."""

from dataclasses import replace

import numpy as np
import pytest

from aerotri.functional_model.additional_parameters import brown, lens, parameter_set
from aerotri.image_errors import (
    field_difference,
    field_on_grid,
    field_without_orientation,
    image_groups,
    interior_elements,
    largest_effects,
    systematic_errors,
)
from aerotri.image_errors.field import significant
from aerotri.observations import Prior
from aerotri.results.adjusted_block import SharedParameters
from synthetic import make_adjusted_block, ultracam

X = np.array([-40.0, -3.0, 12.5, 40.0, 25.0])
Y = np.array([20.0, 4.0, -31.0, -20.0, 25.0])


def shared(names, values, covariance, groups="ucd2", kinds="additional", status="estimated"):
    """Shared parameters of one group."""
    s = len(names)
    full = [np.full(s, v) if isinstance(v, str) else np.array(v) for v in (groups, kinds, status)]
    return SharedParameters(
        np.array(names), full[0], full[1], np.full(s, "P"), np.array(values, float), np.array(covariance, float),
        np.zeros(s), np.full(s, ""), np.zeros(s), full[2], np.full(s, ""),
    )  # fmt: skip


def with_parameters(adjusted, parameters, camera=None):
    block = adjusted.block if camera is None else replace(adjusted.block, cameras=(camera,))
    return replace(adjusted, block=block, parameters=parameters)


@pytest.fixture(scope="module")
def adjusted():
    return make_adjusted_block(2, 4, 60)


def test_single_parameter_at_single_points(adjusted):
    """Affinity of BLUH: d = (−P·x, +P·y), the normalisation cancels."""
    one = with_parameters(adjusted, shared(["bluh.2"], [2e-5], [[1e-12]]))
    d, covariance = systematic_errors(one, "ucd2", X, Y)
    np.testing.assert_allclose(d, np.stack([-2e-5 * X, 2e-5 * Y], axis=-1), atol=1e-15)
    expected = 1e-12 * np.array([[40.0**2, 40.0 * 20.0], [40.0 * 20.0, 20.0**2]])
    np.testing.assert_allclose(covariance[0], expected, atol=1e-20)


def test_tile_shift_acts_in_its_tile_only(adjusted):
    """ultracam_d.50 shifts the upper left tile in x, whatever else the point's neighbours do."""
    one = with_parameters(adjusted, shared(["ultracam_d.50"], [0.003], [[1e-8]]))
    d, _ = systematic_errors(one, "ucd2", X, Y)
    np.testing.assert_allclose(d, [[0.003, 0], [0, 0], [0, 0], [0, 0], [0, 0]], atol=1e-15)


def test_order_of_parameters_does_not_matter(adjusted):
    p = adjusted.parameters
    order = np.random.default_rng(3).permutation(len(p))
    arrays = {name: getattr(p, name) for name in p.__dataclass_fields__ if name != "covariance"}
    arrays = {name: values[order] for name, values in arrays.items() if values is not None}
    shuffled = replace(p, covariance=p.covariance[np.ix_(order, order)], **arrays)
    for ours, theirs in zip(
        systematic_errors(adjusted, "ucd2", X, Y),
        systematic_errors(replace(adjusted, parameters=shuffled), "ucd2", X, Y),
        strict=True,
    ):
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-16)


def test_covariance_is_that_of_drawn_parameters(adjusted):
    """Monte Carlo: parameters drawn from their covariance spread d as B·Q·Bᵀ says, point by point."""
    d, covariance = systematic_errors(adjusted, "ucd2", X, Y)
    rng = np.random.default_rng(11)
    p = adjusted.parameters
    n = 4000
    draws = np.empty((n, len(X), 2))
    root = np.linalg.cholesky(p.covariance)
    for i in range(n):
        drawn = replace(p, value=p.value + root @ rng.normal(size=len(p)))
        draws[i], _ = systematic_errors(replace(adjusted, parameters=drawn), "ucd2", X, Y)
    assert np.all(np.abs(draws.mean(axis=0) - d) < 5 * np.sqrt(np.diagonal(covariance, axis1=1, axis2=2) / n))
    for k in range(len(X)):
        ratio = np.linalg.solve(covariance[k], np.cov(draws[:, k].T))
        # 5 σ of a variance estimated from n draws
        np.testing.assert_allclose(ratio, np.eye(2), atol=5 * np.sqrt(2 / n))


def test_held_and_removed_parameters(adjusted):
    """A held value acts without variance, a removed one not at all, a weighted one with its variance."""
    names, values = ["bluh.2", "bluh.1", "bluh.9"], [2e-5, 1e-5, 3.0]
    p = shared(names, values, 1e-12 * np.eye(3), status=["fixed", "weighted", "removed"])
    d, covariance = systematic_errors(with_parameters(adjusted, p), "ucd2", X, Y)
    np.testing.assert_allclose(d[0], [-2e-5 * -40 - 1e-5 * 20, 2e-5 * 20 - 1e-5 * -40], atol=1e-15)
    np.testing.assert_allclose(np.diagonal(covariance[0]), 1e-12 * np.array([20.0**2, 40.0**2]), atol=1e-20)


def test_no_parameters(adjusted):
    none = with_parameters(adjusted, shared([], [], np.zeros((0, 0))))
    field = field_on_grid(none, "ucd2", nx=5)
    assert field.d.shape == (3, 5, 2)
    assert field.rms == 0.0
    assert field.max == 0.0
    assert not field.significant.any()
    assert not field.sigma.any()


def test_brown_counts_from_the_adjusted_principal_point(adjusted):
    names = ["x0_mm", "y0_mm", "brown.K1", "brown.P2"]
    p = shared(names, [0.4, -0.3, 2e-8, 1e-7], 1e-18 * np.eye(4), kinds=["interior"] * 2 + ["additional"] * 2)
    d, covariance = systematic_errors(with_parameters(adjusted, p), "ucd2", X, Y)
    basis = brown.basis(X - 0.4, Y + 0.3)
    np.testing.assert_allclose(d, 2e-8 * basis[:, :, 0] + 1e-7 * basis[:, :, 4], rtol=1e-12)
    both = basis[:, :, [0, 4]]
    np.testing.assert_allclose(covariance, 1e-18 * both @ both.transpose(0, 2, 1), rtol=1e-12)


def test_given_lens_values_belong_to_the_image_error(adjusted):
    """Brown's values that the camera gives and nobody adjusts act as they do in the observation equations."""
    camera = replace(ultracam(), brown={"K1": Prior(2e-8, fixed=True)})
    d, covariance = systematic_errors(with_parameters(adjusted, shared([], [], np.zeros((0, 0))), camera), "ucd2", X, Y)
    np.testing.assert_allclose(d, 2e-8 * brown.basis(X, Y)[:, :, 0], rtol=1e-12)
    assert not covariance.any()


def test_forward_lens_is_inverted(adjusted):
    """The ideal position measured − d, distorted by the lens, is the measured position again."""
    p = shared(["lens.k1", "lens.p2"], [-0.02, 1e-3], np.diag([1e-10, 1e-12]))
    d, covariance = systematic_errors(with_parameters(adjusted, p), "ucd2", X, Y)
    c = 101.4
    again = c * lens.distort((X - d[:, 0]) / c, (Y - d[:, 1]) / c, lens.vector({"k1": -0.02, "p2": 1e-3}))
    np.testing.assert_allclose(again, np.stack([X, Y], axis=-1), atol=1e-12)
    step = with_parameters(adjusted, shared(["lens.k1", "lens.p2"], [-0.02 + 1e-5, 1e-3], np.zeros((2, 2))))
    sigma_k1 = (systematic_errors(step, "ucd2", X, Y)[0] - d)[0]
    only_k1 = with_parameters(adjusted, shared(["lens.k1", "lens.p2"], [-0.02, 1e-3], np.diag([1e-10, 0.0])))
    np.testing.assert_allclose(systematic_errors(only_k1, "ucd2", X, Y)[1][0], np.outer(sigma_k1, sigma_k1), rtol=1e-4)
    assert np.all(np.linalg.eigvalsh(covariance) > -1e-20)


def test_grid_nodes_are_cell_centres_in_their_place(adjusted):
    """Node (row 1, column 3) of 5 × 3 lies where it should and holds the error of that place."""
    field = field_on_grid(adjusted, "ucd2", nx=5)
    half_x, half_y = adjusted.block.cameras[0].half_format_mm
    assert field.x[1, 3] == pytest.approx(0.4 * half_x)
    assert field.y[1, 3] == pytest.approx(0.0, abs=1e-12)
    assert field.y[2, 0] == pytest.approx(2.0 / 3.0 * half_y)
    d, covariance = systematic_errors(adjusted, "ucd2", field.x[2, 1:2], field.y[2, 1:2])
    np.testing.assert_allclose(field.d[2, 1], d[0])
    np.testing.assert_allclose(field.sigma[2, 1], np.sqrt(np.diagonal(covariance[0])))
    lengths = np.hypot(field.d[..., 0], field.d[..., 1])
    assert field.max == pytest.approx(lengths.max())
    assert field.rms == pytest.approx(np.sqrt((lengths**2).mean()))


def test_significance_by_hand():
    """d = (2σ, 1.3σ): 4 + 1.69 < 5.99; d = (2σ, 1.5σ): 6.25 > 5.99; known without variance; singular along one line."""
    covariance = np.array([np.eye(2), np.eye(2), np.zeros((2, 2)), np.zeros((2, 2)), np.diag([1.0, 0.0]), np.eye(2)])
    covariance[5] *= np.nan
    d = np.array([[2.0, 1.3], [2.0, 1.5], [1e-9, 0.0], [0.0, 0.0], [2.5, 0.0], [9.0, 9.0]])
    assert significant(d, covariance).tolist() == [False, True, True, False, True, False]


def test_days_have_their_own_fields():
    adjusted = make_adjusted_block(2, 4, 60, groups="day")
    groups = image_groups(adjusted.block)
    assert [g.name for g in groups] == ["day 1", "day 2"]
    assert groups[0].images.tolist() == [True] * 4 + [False] * 4
    one, two = (systematic_errors(adjusted, name, X, Y)[0] for name in ("day 1", "day 2"))
    difference = field_difference(adjusted, "day 1", "day 2", nx=5)
    at = systematic_errors(adjusted, "day 1", difference.x[0], difference.y[0])
    other = systematic_errors(adjusted, "day 2", difference.x[0], difference.y[0])
    np.testing.assert_allclose(difference.d[0], at[0] - other[0], atol=1e-15)
    variance = np.diagonal(at[1] + other[1], axis1=1, axis2=2)
    np.testing.assert_allclose(difference.sigma[0] ** 2, variance, rtol=1e-9)
    assert np.abs(one - two).max() > 1e-5


def test_difference_of_a_group_with_itself_has_no_variance(adjusted):
    field = field_difference(adjusted, "ucd2", "ucd2", nx=5)
    assert np.abs(field.d).max() == 0.0
    assert field.sigma.max() < 1e-9
    assert not field.significant.any()


def test_unknown_group_is_named(adjusted):
    with pytest.raises(ValueError, match=r"no image group 'nobody'.*ucd2 \(ucd2\)"):
        systematic_errors(adjusted, "nobody", X, Y)


def test_interior_elements(adjusted):
    values, sigmas = interior_elements(adjusted, adjusted.block.cameras[0])
    np.testing.assert_allclose(values, [101.4021, 0.0, 0.0])
    np.testing.assert_allclose(sigmas, [0.004, 0.0, 0.0])


def test_largest_effect_is_that_of_the_parameter_alone(adjusted):
    effects = largest_effects(adjusted)
    p = adjusted.parameters
    assert np.isnan(effects[0])
    row = int(np.flatnonzero(p.names == "bluh.4")[0])
    x, y = field_on_grid(adjusted, "ucd2").x.ravel(), field_on_grid(adjusted, "ucd2").y.ravel()
    basis = parameter_set("bluh", ["4"], adjusted.block.cameras[0]).basis(x, y)[:, :, 0]
    assert effects[row] == pytest.approx(abs(p.value[row]) * np.hypot(*basis.T).max())


def test_without_orientation(adjusted):
    """Orthogonal to shifts, scale, rotation and tilts; unchanged but for these; σ by the dense projection."""
    camera = adjusted.block.cameras[0]
    field, whole = field_without_orientation(adjusted, "ucd2", nx=7), field_on_grid(adjusted, "ucd2", nx=7)
    x, y = field.x.ravel(), field.y.ravel()
    c, one, zero = camera.focal_length_mm, np.ones_like(x), np.zeros_like(x)
    pairs = [(one, zero), (zero, one), (x, y), (-y, x), (c + x * x / c, x * y / c), (x * y / c, c + y * y / c)]
    patterns = np.stack([np.stack(pair, axis=1).ravel() for pair in pairs], axis=1)
    left, taken = field.d.ravel(), (whole.d - field.d).ravel()
    assert np.abs(patterns.T @ left).max() < 1e-9 * np.abs(patterns).sum()
    assert np.abs(taken).max() > 1e-4
    assert np.linalg.matrix_rank(np.column_stack([patterns, taken / np.abs(taken).max()]), tol=1e-6) == 6
    p = adjusted.parameters
    rows = np.flatnonzero(p.kinds == "additional")
    sets = [parameter_set(f, [n.split(".")[1] for n in p.names[rows] if n.startswith(f)], camera) for f in
            dict.fromkeys(n.split(".")[0] for n in p.names[rows])]  # fmt: skip
    names = [name for chosen in sets for name in chosen.names]
    basis = np.concatenate([chosen.basis(x, y) for chosen in sets], axis=2).reshape(len(left), -1)
    order = [names.index(name) for name in p.names[rows]]
    projected = (np.eye(len(left)) - patterns @ np.linalg.pinv(patterns)) @ basis[:, order]
    covariance = projected @ p.covariance[np.ix_(rows, rows)] @ projected.T
    np.testing.assert_allclose(field.sigma.ravel(), np.sqrt(np.diagonal(covariance)), rtol=1e-6)
