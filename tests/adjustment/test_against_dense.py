"""Solution, covariances and redundancy numbers of the sparse adjustment against dense algebra on small blocks."""

from dataclasses import replace

import numpy as np
import pytest

from aerotri.adjustment.datum import datum_rows, motions_of_points
from aerotri.functional_model.rotation import small_rotation_per_angle
from aerotri.observations import CollocationSettings, Control, Prior
from aerotri.observations.block import Constraints
from aerotri.pipeline import adjust_keeping_system
from dense_algebra import TINY, dense_design
from small_blocks import small_block, with_adjustment


def dense_cofactors(adjustment, inner=False):
    """Pseudo-inverse of the scaled normal matrix; with `inner`, bordered by the datum conditions."""
    design = dense_design(adjustment)
    u, state = adjustment.system.unknowns, adjustment.solution.state
    norm = np.linalg.norm(design, axis=0)
    live = norm > 0
    scaled = design[:, live] / norm[live]
    q = np.zeros((design.shape[1], design.shape[1]))
    if not inner:
        q[np.ix_(live, live)] = np.linalg.inv(scaled.T @ scaled) / np.outer(norm[live], norm[live])
        return design, q
    basis = u.motions.basis
    d = basis.shape[1]
    g = np.zeros((design.shape[1], d))
    first = 6 * len(u.images) + len(u.shared)
    motions, of_points = motions_of_points(state.points) @ basis, g[first:].reshape(-1, 3, d)
    for row in datum_rows(u):
        if u.kept[row] >= 0:
            g[6 * len(u.images) + u.kept[row] :][:3] = motions[row]
        else:
            of_points[row] = motions[row]
    conditions = g[live] / norm[live][:, None]
    conditions /= np.linalg.norm(conditions, axis=0)
    size = live.sum()
    bordered = np.block([[scaled.T @ scaled, conditions], [conditions.T, np.zeros((d, d))]])
    q[np.ix_(live, live)] = np.linalg.inv(bordered)[:size, :size] / np.outer(norm[live], norm[live])
    return design, q


def assert_same(got, expected, scale, tolerance):
    """Compare cofactors as fractions of the σ of their unknowns."""
    np.testing.assert_allclose(got / scale, expected / scale, atol=tolerance)


def check(adjustment, q, design, tolerance=1e-9):
    result, u = adjustment.result, adjustment.system.unknowns
    s0 = result.outcome.sigma0
    n, s = len(u.images), len(u.shared)
    first = 6 * n + s
    sigma = np.sqrt(np.maximum(np.diagonal(q), 0))
    points = result.points.covariance[u.points] / s0**2
    for p in range(len(u.points)):
        at = slice(first + 3 * p, first + 3 * p + 3)
        assert_same(points[p], q[at, at], np.outer(sigma[at], sigma[at]) + 1e-30, tolerance)
    angles = result.images.angles[u.images]
    e = small_rotation_per_angle(angles, u.block.rotation)
    for i in range(n):
        at = slice(6 * i, 6 * i + 6)
        jacobian = np.eye(6)
        jacobian[3:, 3:] = np.linalg.solve(e[i], u.turn(adjustment.solution.state)[i])
        expected = jacobian @ q[at, at] @ jacobian.T
        got = result.images.covariance[u.images[i]] / s0**2
        scale = np.sqrt(np.outer(np.diagonal(expected), np.diagonal(expected))) + 1e-30
        assert_same(got, expected, scale, tolerance)
    shared = slice(6 * n, first)
    assert_same(
        result.parameters.covariance / s0**2, q[shared, shared], np.outer(sigma[shared], sigma[shared]), tolerance
    )
    redundancy = 1.0 - np.einsum("ij,jk,ik->i", design, q, design)
    m = len(u.rays.image)
    np.testing.assert_allclose(result.rays.r[u.rays.source].ravel(), redundancy[: 2 * m], atol=tolerance)
    assert abs(redundancy.sum() - result.outcome.redundancy) < 1e-6 * result.outcome.redundancy
    assert abs(sum(g.redundancy for g in result.groups) - result.outcome.redundancy) < 1e-6 * result.outcome.redundancy


@pytest.mark.parametrize("parameters", ["none", "bluh:1-4+9", "brown:K1+P1+P2"])
def test_control_datum(parameters):
    adjustment = adjust_keeping_system(small_block(3, parameters, **TINY)[0])
    design, q = dense_cofactors(adjustment)
    check(adjustment, q, design)
    control = adjustment.result.control
    u = adjustment.system.unknowns
    row = {int(p): k for k, p in enumerate(u.points)}
    first = 6 * len(u.images) + len(u.shared)
    at = first + 3 * row[int(control.point[0])]
    given = adjustment.result.block.control
    weight = 1.0 / given.sigma[list(given.point).index(control.point[0])] ** 2
    np.testing.assert_allclose(control.r[0], 1.0 - weight * np.diagonal(q)[at : at + 3], atol=1e-9)


@pytest.mark.parametrize("datum", ["control", "minimal"])
def test_nodes_of_a_random_field(datum):
    """Observed together, with a full weight matrix; two groups, each with a field of its own."""
    flight = TINY["flight"] | {"days": 2}
    block = small_block(11, "bluh:9,collocation:4x3", **(TINY | {"flight": flight}))[0]
    block = with_adjustment(block, parameter_groups="day", datum=datum)
    known = CollocationSettings(sigma_um=3.0, length_mm=40.0)
    adjustment = adjust_keeping_system(replace(block, settings=replace(block.settings, collocation=known)))
    assert len(adjustment.system.priors.fields) == 2
    design, q = dense_cofactors(adjustment)
    check(adjustment, q, design)
    names = adjustment.result.parameters.names.astype(str)
    status = adjustment.result.parameters.status
    assert set(status[np.char.startswith(names, "collocation")]) == {"weighted"}


def test_interior_orientation_weighted_and_gnss():
    """Principal distance and point observed, GNSS with a shift per strip: every kind of border column at once."""
    block, _ = small_block(
        4,
        "bluh:1-2",
        **TINY,
        gnss={"sigma_m": [0.05, 0.05, 0.08], "shift_sigma_m": [0.2, 0.2, 0.2], "lever_arm_m": [0.2, -0.3, 1.1]},
    )
    camera = block.cameras[0]
    priors = {name: Prior(prior.value, 0.02) for name, prior in camera.interior.items()}
    adjustment = adjust_keeping_system(replace(block, cameras=(replace(camera, interior=priors),)))
    assert {"focal_length_mm", "gnss.shift_X", "bluh.1"} <= set(adjustment.result.parameters.names)
    design, q = dense_cofactors(adjustment)
    check(adjustment, q, design)


@pytest.mark.parametrize("sigma_um", [0.01, 0.005])
def test_weakly_held_datum_has_its_sigma(sigma_um):
    """GNSS to some metres beside very sharp image points: no rank defect, and σ is that of an orthogonal decomposition,
    which forms no normal matrix."""
    sharp = TINY | {"tie_points": {"per_image": 25, "probability": 1.0, "sigma_um": sigma_um}}
    block = small_block(4, **sharp, gnss={"sigma_m": [3.0, 3.0, 6.0]})[0]
    given = block.control
    none = Control(given.point[:0], given.xyz[:0], given.sigma[:0], given.is_check[:0])
    adjustment = adjust_keeping_system(replace(block, control=none))
    assert adjustment.result.outcome.status == "converged"
    design = dense_design(adjustment)
    norm = np.linalg.norm(design, axis=0)
    assert 1e-13 < np.linalg.svd(design / norm, compute_uv=False)[-1] ** 2 < 1e-12
    root = np.linalg.inv(np.linalg.qr(design / norm, mode="r"))
    sigma = adjustment.result.outcome.sigma0 * np.linalg.norm(root, axis=1) / norm
    u = adjustment.system.unknowns
    first = 6 * len(u.images) + len(u.shared)
    got = np.sqrt(np.diagonal(adjustment.result.points.covariance[u.points], axis1=1, axis2=2))
    np.testing.assert_allclose(got.ravel(), sigma[first:], rtol=0.001)


def test_minimal_datum():
    block = with_adjustment(small_block(5, "bluh:1-2", **TINY)[0], datum="minimal")
    adjustment = adjust_keeping_system(block)
    assert (~adjustment.system.unknowns.point_free).sum() == 7
    design, q = dense_cofactors(adjustment)
    check(adjustment, q, design)


@pytest.mark.parametrize("chosen", [False, True])
def test_inner_datum(chosen):
    block = small_block(6, "bluh:1-2", **TINY)[0]
    names = tuple(block.points[:12].tolist()) if chosen else ()
    adjustment = adjust_keeping_system(with_adjustment(block, datum="inner", datum_points=names))
    u = adjustment.system.unknowns
    free = replace(u, point_free=np.ones_like(u.point_free))
    adjustment.system.unknowns = free
    design, q = dense_cofactors(adjustment, inner=True)
    check(adjustment, q, design, tolerance=2e-9)
    assert adjustment.result.outcome.conditions == 7


def test_fixed_datum_with_single_angles():
    block = small_block(7, **TINY)[0]
    first, second = block.images.names[0], block.images.names[3]
    held = tuple((first, e) for e in ("X0", "Y0", "Z0", "omega", "phi", "kappa")) + ((second, "X0"), (second, "phi"))
    adjustment = adjust_keeping_system(with_adjustment(block, datum="fixed", datum_fixed=held))
    design, q = dense_cofactors(adjustment)
    check(adjustment, q, design)
    result = adjustment.result
    np.testing.assert_array_equal(result.images.sigma[0], 0.0)
    np.testing.assert_allclose(result.images.angles[3, 1], block.images.angles[3, 1], atol=1e-12)
    assert result.images.sigma[3, 4] < 1e-12
    assert result.images.sigma[3, 3] > 1e-7


def test_datums_agree_in_what_does_not_depend_on_them():
    block = small_block(8, "bluh:1-2", **TINY)[0]
    results = [adjust_keeping_system(with_adjustment(block, datum=datum)).result for datum in ("minimal", "inner")]
    np.testing.assert_allclose(results[0].outcome.sigma0, results[1].outcome.sigma0, rtol=1e-9)
    np.testing.assert_allclose(results[0].rays.r, results[1].rays.r, atol=1e-8)
    np.testing.assert_allclose(results[0].parameters.sigma, results[1].parameters.sigma, rtol=1e-7)
    assert np.trace(np.nansum(results[1].points.covariance, axis=0)) < np.trace(
        np.nansum(results[0].points.covariance, axis=0)
    )


def test_same_result_bit_for_bit():
    block = small_block(9, "bluh:1-12", **TINY)[0]
    first, second = (adjust_keeping_system(block).result for _ in range(2))
    np.testing.assert_array_equal(first.points.xyz, second.points.xyz)
    np.testing.assert_array_equal(first.rays.w, second.rays.w)
    np.testing.assert_array_equal(first.parameters.covariance, second.parameters.covariance)


@pytest.mark.parametrize("datum", ["control", "inner"])
def test_conditions_with_points_in_the_border(datum):
    """Plane, vertical and distance at once: points that are not eliminated, with unknowns of the conditions."""
    block, truth = small_block(10, "bluh:1-2", **TINY)
    often = np.setdiff1d(np.argsort(-np.bincount(block.image_points.point)), block.control.point, assume_unique=True)
    members = (often[:5], often[5:7], np.append(often[7], block.control.point[0]))
    length = np.linalg.norm(np.diff(truth.points[members[2]], axis=0))
    given = Constraints(
        np.array(["plane", "vertical", "distance"], object), members, np.array([np.nan, np.nan, length]),
        np.array([40.0, 300.0, 0.05]),
    )  # fmt: skip
    if datum == "inner":
        given = Constraints(given.kind[2:], given.points[2:], given.value[2:], given.sigma[2:])
    adjustment = adjust_keeping_system(with_adjustment(replace(block, constraints=given), datum=datum))
    u = adjustment.system.unknowns
    assert (u.kept >= 0).sum() == (9 if datum == "control" else 2)
    if datum == "control":
        design, q = dense_cofactors(adjustment)
        check_points_and_shared(adjustment, q, design)
    else:
        held = u.point_held
        assert u.motions.count == held.sum() == adjustment.result.outcome.conditions == 6
        adjustment.system.unknowns = replace(u, point_free=u.point_free | held)
        design, q = dense_cofactors(adjustment, inner=True)
        check_points_and_shared(adjustment, q, design)


def check_points_and_shared(adjustment, q, design, tolerance=2e-9):
    """As `check`, for blocks whose kept points stand in the border."""
    result, u = adjustment.result, adjustment.system.unknowns
    s0, n = result.outcome.sigma0, len(adjustment.system.unknowns.images)
    first = 6 * n + len(u.shared)
    for p in range(len(u.points)):
        at = (
            slice(first + 3 * p, first + 3 * p + 3)
            if u.kept[p] < 0
            else slice(6 * n + u.kept[p], 6 * n + u.kept[p] + 3)
        )
        sigma = np.sqrt(np.diagonal(q)[at])
        assert_same(result.points.covariance[u.points[p]] / s0**2, q[at, at], np.outer(sigma, sigma), tolerance)
    sigma = np.sqrt(np.diagonal(q)[6 * n : 6 * n + 2])
    got = result.parameters.covariance / s0**2
    assert_same(got, q[6 * n : 6 * n + 2, 6 * n : 6 * n + 2], np.outer(sigma, sigma), tolerance)
    redundancy = 1.0 - np.einsum("ij,jk,ik->i", design, q, design)
    m = len(u.rays.image)
    np.testing.assert_allclose(result.rays.r[u.rays.source].ravel(), redundancy[: 2 * m], atol=tolerance)
    np.testing.assert_allclose(result.observations.r, redundancy[-len(result.observations) :], atol=tolerance)
    assert abs(sum(g.redundancy for g in result.groups) - result.outcome.redundancy) < 1e-6 * result.outcome.redundancy


@pytest.fixture(scope="module")
def of_132_photographs():
    flight = TINY["flight"] | {"strips": 6, "images_per_strip": 22, "end_lap": 0.8}
    gnss = {"sigma_m": [0.05, 0.05, 0.08], "shift_sigma_m": [0.2, 0.2, 0.2]}
    tie_points = {"per_image": 40, "probability": 0.9, "sigma_um": 2.0}
    adjustment = adjust_keeping_system(small_block(1, "bluh:1-12", flight=flight, tie_points=tie_points, gnss=gnss)[0])
    assert len(adjustment.result.block.images) == 132
    return adjustment


def test_right_side_is_that_of_the_whole_equations(of_132_photographs):
    system, solution = of_132_photographs.system, of_132_photographs.solution
    off = replace(solution.state, centre=solution.state.centre + [0.3, -0.2, 0.5])
    whole, side = system.assemble(off, 0.0, solution.estimator), system.right_side(off, solution.estimator)
    size = np.sqrt(np.abs(whole.right).max() * np.abs(whole.right) + 1.0)
    np.testing.assert_allclose(side.right / size, whole.right / size, rtol=0, atol=1e-9)
    np.testing.assert_allclose(side.cost, whole.cost, rtol=1e-13)
    np.testing.assert_allclose(side.point_decrement, whole.point_decrement, rtol=1e-12)
    np.testing.assert_array_equal(side.residual, whole.residual)


def test_inverse_on_the_pattern_of_132_photographs(of_132_photographs):
    """Every block of the sparse inverse, against the dense inverse of the same reduced normal matrix."""
    system, matrix = of_132_photographs.system, of_132_photographs.solution.equations.matrix
    symbolic = system.symbolic
    n, s = symbolic.n, symbolic.n_border
    dense = np.zeros((symbolic.size, symbolic.size))
    for b, (i, j) in enumerate(zip(symbolic.block_row, symbolic.block_col, strict=True)):
        dense[6 * i : 6 * i + 6, 6 * j : 6 * j + 6] = matrix.blocks[b]
        dense[6 * j : 6 * j + 6, 6 * i : 6 * i + 6] = matrix.blocks[b].T
    dense[6 * n :, : 6 * n] = np.swapaxes(matrix.border, 0, 1).reshape(s, 6 * n)
    dense[: 6 * n, 6 * n :] = dense[6 * n :, : 6 * n].T
    dense[6 * n :, 6 * n :] = matrix.corner
    unit = 1.0 / np.sqrt(np.diagonal(dense))
    inverse = np.linalg.inv(dense * np.outer(unit, unit)) * np.outer(unit, unit)
    sigma = np.sqrt(np.diagonal(inverse))
    normed = inverse / np.outer(sigma, sigma)
    found = system.factorise(of_132_photographs.solution.equations).inverse_on_pattern()
    for b, (i, j) in enumerate(zip(symbolic.block_row, symbolic.block_col, strict=True)):
        own, other = slice(6 * i, 6 * i + 6), slice(6 * j, 6 * j + 6)
        got = found.blocks[b] / np.outer(sigma[own], sigma[other])
        np.testing.assert_allclose(got, normed[own, other], rtol=0, atol=1e-10)
    border = np.swapaxes(found.border, 1, 2).reshape(6 * n, s) / np.outer(sigma[: 6 * n], sigma[6 * n :])
    np.testing.assert_allclose(border, normed[: 6 * n, 6 * n :], rtol=0, atol=1e-10)
    np.testing.assert_allclose(
        found.corner / np.outer(sigma[6 * n :], sigma[6 * n :]), normed[6 * n :, 6 * n :], rtol=0, atol=1e-10
    )
