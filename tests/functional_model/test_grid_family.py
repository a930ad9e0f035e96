"""Nodes of a bilinear grid: the correction grid and collocation, with the covariance before anything is measured."""

from dataclasses import replace

import numpy as np
import pytest
from test_additional_parameters import orientation_columns

from aerotri.functional_model.additional_parameters import collocation, grid, parameter_set, parse_parameters
from aerotri.functional_model.additional_parameters.beside_field import patterns_of_other_unknowns
from aerotri.observations import Camera, Prior
from family_cameras import INTERIOR

CAMERA = Camera("c", "frame", (11500, 7500), 9.0, INTERIOR)
HALF = np.array(CAMERA.half_format_mm)
RNG_POINTS = np.random.default_rng(3).uniform(-1, 1, (200, 2)) * HALF


def nodes_of(size, family="grid"):
    ((_, items),) = parse_parameters(f"{family}:{size}")
    return parameter_set(family, items, CAMERA)


def test_a_node_by_hand():
    """4 × 3 nodes: spacing 34.5 and 33.75 mm. A point a quarter of a cell right of node (1, 1) and half a cell up."""
    chosen = nodes_of("4x3")
    x, y = -HALF[0] + 1.25 * 34.5, -HALF[1] + 1.5 * 33.75
    basis = chosen.basis(np.array([x]), np.array([y]))[0]
    weights = {item: column for item, column in zip(chosen.items, basis.T, strict=True) if column.any()}
    expected = {(1, 1): 0.375, (2, 1): 0.125, (1, 2): 0.375, (2, 2): 0.125}
    assert set(weights) == {f"4x3_{axis}_{i}_{j}" for axis in "xy" for i, j in expected}
    for (i, j), weight in expected.items():
        np.testing.assert_allclose(weights[f"4x3_x_{i}_{j}"], (weight, 0.0))
        np.testing.assert_allclose(weights[f"4x3_y_{i}_{j}"], (0.0, weight))


@pytest.mark.parametrize("size", ["2x2", "13x9", "19x13"])
def test_weights_sum_to_one_and_nodes_hold_their_own_values(size):
    chosen = nodes_of(size)
    position, axis = grid.node_positions(CAMERA, chosen.items)
    at_nodes = chosen.basis(*position.T)
    rows = np.arange(len(axis))
    np.testing.assert_allclose(at_nodes[rows, axis, rows], 1.0)
    np.testing.assert_allclose(np.abs(at_nodes).sum(axis=2), 1.0)
    anywhere = chosen.basis(*RNG_POINTS.T)
    assert (anywhere >= 0.0).all()
    np.testing.assert_allclose(anywhere.sum(axis=2), 1.0)


def test_bilinear_fields_are_held_exactly():
    """Shift, scale, rotation and xy: why a free grid takes them from the orientation; the tilts are not bilinear."""
    chosen = nodes_of("5x4")
    position, axis = grid.node_positions(CAMERA, chosen.items)
    x, y = RNG_POINTS.T

    def field(x, y):
        return np.stack([3.0 + 0.1 * x - 0.2 * y + 0.01 * x * y, -1.0 + 0.3 * x + 0.2 * y - 0.02 * x * y], axis=-1)

    values = field(*position.T)[np.arange(len(axis)), axis]
    np.testing.assert_allclose(chosen.basis(x, y) @ values, field(x, y), atol=1e-10)
    design = np.hstack([chosen.basis(x, y).reshape(-1, 40), orientation_columns(x, y, 101.4).reshape(-1, 6)])
    assert np.linalg.matrix_rank(design / np.linalg.norm(design, axis=0), tol=1e-9) == 40 + 6 - 4


def test_beyond_the_edges_the_field_goes_on():
    chosen = nodes_of("5x4")
    inside = chosen.basis(np.array([HALF[0], -HALF[0], 3.0]), np.array([2.0, HALF[1], -HALF[1]]))
    outside = chosen.basis(np.array([HALF[0] + 9, -HALF[0] - 1, 3.0]), np.array([2.0, HALF[1] + 5, -HALF[1] - 2]))
    np.testing.assert_allclose(outside, inside)
    partials = chosen.partials(np.array([HALF[0] + 9]), np.array([2.0]))
    assert not partials[..., 0].any()
    assert partials[..., 1].any()


def test_few_columns_act_and_any_nodes_can_be_left_out():
    chosen = nodes_of("19x13", "collocation")
    assert len(chosen.items) == 494
    terms = chosen.terms(*RNG_POINTS.T)
    assert terms.value.shape == (200, 2, 8)
    some = parameter_set("collocation", [item for item in chosen.items if item.endswith("_6")], CAMERA)
    part = some.basis(*RNG_POINTS.T)
    whole = dict(zip(chosen.items, np.moveaxis(chosen.basis(*RNG_POINTS.T), 2, 0), strict=True))
    for item, column in zip(some.items, np.moveaxis(part, 2, 0), strict=True):
        np.testing.assert_array_equal(column, whole[item])


def test_prior_covariance():
    """σ_d²·exp(−ρ/ℓ) within dx and within dy, nothing between."""
    chosen = nodes_of("4x3", "collocation")
    n, sigma, length = 12, 0.004, 30.0
    covariance = collocation.prior_covariance(CAMERA, chosen.items, sigma, length)
    assert covariance.shape == (24, 24)
    np.testing.assert_array_equal(covariance, covariance.T)
    np.testing.assert_allclose(np.diag(covariance), sigma**2)
    assert not covariance[:n, n:].any()
    np.testing.assert_array_equal(covariance[:n, :n], covariance[n:, n:])
    assert covariance[0, 1] == pytest.approx(sigma**2 * np.exp(-34.5 / 30.0))
    assert covariance[0, 5] == pytest.approx(sigma**2 * np.exp(-np.hypot(34.5, 33.75) / 30.0))


def test_prior_weight_is_the_inverse():
    items = collocation.FAMILY.sizes.items((7, 5))
    covariance = collocation.prior_covariance(CAMERA, items, 0.004, 30.0)
    weight, log_determinant = collocation.prior_weight(CAMERA, items, 0.004, 30.0)
    np.testing.assert_allclose(weight @ covariance, np.eye(len(items)), atol=1e-8)
    assert log_determinant == pytest.approx(np.linalg.slogdet(covariance)[1], rel=1e-9)


def test_a_field_has_no_scale():
    """And nothing else is held: the camera's own parts and other grids are no matter."""
    items = collocation.FAMILY.sizes.items((5, 4))
    others = [("collocation", items), ("ultracam_d", ("42",)), ("grid", ("4x3_x_0_0",))]
    held = patterns_of_other_unknowns(CAMERA, items, others)
    position, axis = grid.node_positions(CAMERA, items)
    scale = position[np.arange(40), axis]
    np.testing.assert_allclose(held, (scale / np.linalg.norm(scale))[:, None])


def test_a_field_is_orthogonal_to_what_others_say():
    """Free principal point, Brown, BLUH: the covariance has nothing of them."""
    items = collocation.FAMILY.sizes.items((7, 5))
    position, axis = grid.node_positions(CAMERA, items)
    free = replace(CAMERA, interior={name: Prior(prior.value) for name, prior in CAMERA.interior.items()})
    chosen = [("collocation", items), ("brown", ("K1",)), ("bluh", ("1", "2"))]
    held = patterns_of_other_unknowns(free, items, chosen)
    assert held.shape == (70, 6)
    np.testing.assert_allclose(held.T @ held, np.eye(6), atol=1e-12)
    basis = parameter_set("bluh", ["1", "2"], free).basis(*position.T)[np.arange(70), axis]
    radial = position[np.arange(70), axis] * np.sum(position**2, axis=1)
    for pattern in (axis == 0, axis == 1, basis[:, 0], basis[:, 1], radial):
        np.testing.assert_allclose(held @ (held.T @ pattern), pattern, atol=1e-9 * np.abs(pattern).max())
    covariance = collocation.prior_covariance(CAMERA, items, 0.004, 30.0, held)
    weight, log_determinant = collocation.prior_weight(CAMERA, items, 0.004, 30.0, held)
    assert np.abs(held.T @ covariance @ held).max() < 1.01 * collocation.HELD_MM**2
    np.testing.assert_allclose(weight @ covariance, np.eye(70), atol=1e-6)
    assert log_determinant == pytest.approx(np.linalg.slogdet(covariance)[1], rel=1e-6)
    inside = np.eye(70) - held @ held.T
    plain = np.linalg.inv(collocation.prior_covariance(CAMERA, items, 0.004, 30.0))
    np.testing.assert_allclose(inside @ weight @ inside, inside @ plain @ inside, atol=1e-6 * plain.max())


def test_the_lens_beside_a_field():
    items = collocation.FAMILY.sizes.items((7, 5))
    held = patterns_of_other_unknowns(CAMERA, items, [("lens", ("k1",))])
    position, axis = grid.node_positions(CAMERA, items)
    pattern = position[np.arange(70), axis] * np.sum(position**2, axis=1)
    np.testing.assert_allclose(held @ (held.T @ pattern), pattern, atol=1e-9 * np.abs(pattern).max())


def test_items_of_one_node_set_may_be_in_any_order_for_the_covariance():
    items = nodes_of("4x3", "collocation").items
    shuffled = np.random.default_rng(1).permutation(24)
    covariance = collocation.prior_covariance(CAMERA, items, 0.004, 30.0)
    other = collocation.prior_covariance(CAMERA, [items[k] for k in shuffled], 0.004, 30.0)
    np.testing.assert_allclose(other, covariance[np.ix_(shuffled, shuffled)], atol=1e-18)
