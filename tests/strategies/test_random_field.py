"""Covariance of the image error as a random field: the likelihood against dense algebra, known fields found again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aerotri.adjustment.sparse_cholesky import NotPositiveDefiniteError
from aerotri.formats.block.folder import read_block, write_block
from aerotri.formats.results.solution import read_solution, write_solution
from aerotri.functional_model.additional_parameters import collocation, parameter_set, parse_parameters
from aerotri.functional_model.additional_parameters.beside_field import patterns_of_other_unknowns
from aerotri.functional_model.orientation_patterns import orientation_patterns
from aerotri.image_errors import field_on_grid, systematic_errors
from aerotri.observations import Block, CollocationSettings, Prior
from aerotri.pipeline import adjust_keeping_system, reopen
from aerotri.simulation import parse_spec, simulate
from aerotri.statistics.summarise import inseparable
from aerotri.strategies.field_estimation import FieldCovariance, ReducedToFields, border_marginal
from dense_algebra import TINY, dense_design
from small_blocks import small_block, small_spec, with_adjustment

GRID = (9, 6)


def with_collocation(block: Block, *known: float) -> Block:
    return replace(block, settings=replace(block.settings, collocation=CollocationSettings(*known)))


def reduced_and_dense(datum: str = "control"):
    """What the sparse factor says of a field, and the design matrix with the whitened misclosures at p = 0."""
    block = with_adjustment(small_block(3, "bluh:9,collocation:4x3", **TINY)[0], datum=datum)
    adjustment = adjust_keeping_system(with_collocation(block, 4.0, 30.0))
    system, solution = adjustment.system, adjustment.solution
    reduced = ReducedToFields.of(system, solution, system.factorise(solution.equations))
    return adjustment, reduced


def test_likelihood_against_dense_algebra():
    """−2 ln L up to a constant from the covariance of all observations, the other unknowns projected out."""
    adjustment, reduced = reduced_and_dense()
    system, state = adjustment.system, adjustment.solution.state
    u, field = system.unknowns, system.unknowns.shared.fields[0]
    design = dense_design(adjustment)
    first = 6 * len(u.images) + field.columns.start
    nodes = np.arange(first, first + len(field.items))
    is_prior = (design[:, nodes] != 0.0).any(axis=1) & (np.delete(design, nodes, axis=1) == 0.0).all(axis=1)
    a, others = design[~is_prior][:, nodes], np.delete(design[~is_prior], nodes, axis=1)
    others = others[:, (others != 0.0).any(axis=0)]
    others = others / np.linalg.norm(others, axis=0)
    left = np.linalg.svd(others, full_matrices=True)[0][:, others.shape[1] :]
    # misclosures at p = 0: v at the solution, and what the nodes explain, in the order of the design matrix
    residual = (adjustment.solution.equations.residual * u.rays.inv_sigma).ravel()
    given = [
        np.sqrt(u.prior_weight[p, axis]) * (u.prior_xyz[p, axis] - state.points[p, axis])
        for p, axis in zip(*np.nonzero(u.prior_weight), strict=True)
    ]
    y = left.T @ (np.concatenate([residual, given]) + a @ state.shared[field.columns])
    seen = left.T @ a

    def deviance(known: FieldCovariance) -> float:
        k = field.prior_covariance(known.sigma_um, known.length_mm)
        covariance = np.eye(len(y)) + seen @ k @ seen.T
        omega = y @ np.linalg.solve(covariance, y)
        return len(y) * np.log(omega) + np.linalg.slogdet(covariance)[1]

    assert reduced.freedom == len(y)
    cases = [FieldCovariance(s, length) for s, length in ((4.0, 30.0), (1.0, 10.0), (0.05, 100.0), (20.0, 200.0))]
    ours, dense = (np.array([f(c) for c in cases]) for f in (reduced.deviance, deviance))
    np.testing.assert_allclose(ours - ours[0], dense - dense[0], atol=1e-5)


def test_what_the_nodes_see_does_not_depend_on_the_datum():
    """And the right side neither: N and b belong to the image points."""
    several = [reduced_and_dense(datum)[1] for datum in ("minimal", "inner")]
    scale = np.sqrt(np.diagonal(several[0].normals))
    np.testing.assert_allclose(
        several[0].normals / np.outer(scale, scale), several[1].normals / np.outer(scale, scale), atol=1e-6
    )
    np.testing.assert_allclose(several[0].right / scale, several[1].right / scale, atol=1e-4)


def simulated(seed: int, sigma_um: float, length_mm: float):
    """A block whose camera errs by a random field of known covariance, sampled at the nodes of the grid."""
    content = small_spec()
    content["tie_points"]["per_image"] = 150
    camera = simulate(parse_spec(content), seed)[0].cameras[0]
    items = collocation.FAMILY.sizes.items(GRID)
    held = patterns_of_other_unknowns(camera, items, [])
    covariance = collocation.prior_covariance(camera, items, 1e-3 * sigma_um, length_mm, held)
    values = np.linalg.cholesky(covariance) @ np.random.default_rng(seed).normal(size=len(items))
    names = [f"collocation.{item}" for item in items]
    content["camera"]["ucd"]["errors"] = {"parameters": dict(zip(names, values.tolist(), strict=True))}
    block, _ = simulate(parse_spec(content), seed)
    return with_adjustment(block, additional_parameters=(("collocation", items),)), values


@pytest.mark.parametrize("seed", [1, 2])
def test_covariance_recovered(seed):
    """σ_d²/ℓ within what 108 nodes say of it, and the nodes within their covariance."""
    block, values = simulated(seed, 4.0, 40.0)
    result = adjust_keeping_system(block).result
    known = result.block.settings.collocation
    assert known.sigma_um is not None
    assert known.length_mm is not None
    # neighbouring nodes, 20 mm and less apart, tell σ_d²/ℓ to about √(2/108)
    assert abs(np.log(known.sigma_um**2 / known.length_mm / (16.0 / 40.0))) < 4.0 * np.sqrt(2.0 / 108)
    p = result.parameters
    # node by node they are correlated: all see the shifts and tilts of the whole image badly
    error = p.value - values
    assert abs(error @ np.linalg.solve(p.covariance, error) / 108 - 1.0) < 4.0 * np.sqrt(2.0 / 108)
    assert np.abs(error / p.sigma).max() < 4.0
    # the covariance goes on into the field, as any set's does
    camera = result.block.cameras[0]
    x, y = (a.ravel() for a in np.meshgrid(*(np.linspace(-0.9, 0.9, 12) * half for half in camera.half_format_mm)))
    d, covariance = systematic_errors(result, "ucd", x, y)
    truth = parameter_set("collocation", collocation.FAMILY.sizes.items(GRID), camera).basis(x, y) @ values
    statistic = np.einsum("ni,nij,nj->n", d - truth, np.linalg.inv(covariance), d - truth)
    assert statistic.max() < 25.0
    # the picture leaves out what orientation takes: smaller σ, and the truth without it within them
    field = field_on_grid(result, "ucd")
    assert field.without_orientation
    g = orientation_patterns(field.x.ravel(), field.y.ravel(), camera.focal_length_mm).reshape(-1, 6)
    assert np.abs(g.T @ field.d.ravel()).max() < 1e-9 * np.linalg.norm(g, axis=0).max()
    nodes = parameter_set("collocation", collocation.FAMILY.sizes.items(GRID), camera)
    truth = (nodes.basis(field.x.ravel(), field.y.ravel()) @ values).ravel()
    z = (field.d.ravel() - truth + g @ np.linalg.lstsq(g, truth, rcond=None)[0]) / field.sigma.ravel()
    assert 0.7 < np.sqrt(np.mean(z**2)) < 1.4
    assert field.significant.mean() > 0.5
    assert 0.95 < result.outcome.sigma0 < 1.05


def test_a_field_beside_a_free_interior_orientation_and_lens():
    """The corrected plane does not shrink: the field has nothing of principal distance, principal point and lens."""
    content = small_spec(camera={"ucd": {"preset": "ultracam_d", "errors": {"brown": {"K1": 2e-7}}}})
    content["gnss"] = {"sigma_m": [0.05, 0.05, 0.05]}
    block, _ = simulate(parse_spec(content), 7)
    true_c = block.cameras[0].focal_length_mm
    interior = {name: Prior(prior.value + 0.05) for name, prior in block.cameras[0].interior.items()}
    block = replace(block, cameras=(replace(block.cameras[0], interior=interior),))
    chosen = parse_parameters("brown:K1+K2,collocation:9x6")
    adjustment = adjust_keeping_system(with_adjustment(block, additional_parameters=chosen))
    p = adjustment.result.parameters
    rows = {str(name): k for k, name in enumerate(p.names)}
    truth = {"focal_length_mm": true_c, "x0_mm": 0.0, "y0_mm": 0.0, "brown.K1": 2e-7, "brown.K2": 0.0}
    for name, true in truth.items():
        z = (p.value[rows[name]] - true) / p.sigma[rows[name]]
        assert abs(z) < 3.5, name
    assert 0.95 < adjustment.result.outcome.sigma0 < 1.05
    (field,) = adjustment.system.unknowns.shared.fields
    assert field.held.shape == (108, 5)  # scale, x0, y0, K1, K2
    values = adjustment.solution.state.shared[field.columns]
    assert np.abs(field.held.T @ values).max() < 1e-5


def test_a_large_field_does_not_shrink_the_image_plane():
    """A lens of half a millimetre and no set for it: the field takes it, c stays the mean scale, and is determined."""
    content = small_spec(camera={"ucd": {"preset": "ultracam_d", "errors": {"brown": {"K1": 2e-6}}}})
    content["gnss"] = {"sigma_m": [0.05, 0.05, 0.05]}
    block, _ = simulate(parse_spec(content), 7)
    interior = {name: Prior(prior.value) for name, prior in block.cameras[0].interior.items()}
    block = replace(block, cameras=(replace(block.cameras[0], interior=interior),))
    p = adjust_keeping_system(with_adjustment(block, additional_parameters=parse_parameters("collocation:9x6"))).result
    names, value, sigma = p.parameters.names, p.parameters.value, p.parameters.sigma
    at = names.tolist().index("focal_length_mm")
    assert sigma[at] < 0.01
    # d = −K1·r²·(x, y) has the scale −K1·Σr⁴/Σr² over the nodes, which c takes
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(-1, 1, 9), np.linspace(-1, 1, 6)))
    r2 = (x * p.block.cameras[0].half_format_mm[0]) ** 2 + (y * p.block.cameras[0].half_format_mm[1]) ** 2
    expected = block.cameras[0].focal_length_mm * (1.0 - 2e-6 * np.sum(r2**2) / np.sum(r2))
    assert abs(value[at] / expected - 1.0) < 1e-3


def test_many_rays_do_not_pay_for_a_shrinking_image():
    """Residuals are formed in the corrected plane: a field free to shrink it would make them, and σ0, smaller."""
    content = small_spec()
    camera = content["camera"]["ucd"] | {"size_px": [575, 375], "pixel_um": 180.0}
    content["camera"] = {"ucd": camera | {"errors": {"physical": {"rms_um": 80.0, "seed": 4}}}}
    content["flight"]["gsd_m"] = 1.8
    content["tie_points"] |= {"per_image": 1000, "sigma_um": 18.0, "margin_px": 5.0}
    content["control"]["sigma_m"] = [0.1, 0.1, 0.1]
    content["adjustment"] = {"additional_parameters": ["ultracam_d:42-73", "collocation:10x7"]}
    result = adjust_keeping_system(simulate(parse_spec(content), 5)[0]).result
    rms = {group.name: group.rms for group in result.groups}
    assert max(rms["control plan"], rms["control height"]) < 0.1
    sigma_um = result.block.settings.collocation.sigma_um
    assert sigma_um is not None
    assert sigma_um < 300.0


def test_no_field_where_there_is_none():
    block = small_block(4, "collocation:7x5")[0]
    result = adjust_keeping_system(block).result
    sigma_um = result.block.settings.collocation.sigma_um
    assert sigma_um is not None
    assert sigma_um < 0.6
    assert result.groups[-1].name == "collocation field"
    assert result.groups[-1].redundancy < 12.0


def test_doubts_about_nodes_are_one_sentence():
    """Free nodes of a grid are poorly told from one another; that is one thing to say, not one for each."""
    parameters = adjust_keeping_system(small_block(6, "grid:5x4")[0]).result.parameters
    doubtful = replace(parameters, max_correlation=np.full(40, 0.9995))
    (said,) = inseparable(doubtful)
    assert said == "40 values of grid:5x4 (ucd) cannot be told from a neighbour (correlations up to 99.95 %)"
    assert inseparable(replace(parameters, max_correlation=np.zeros(40))) == ()


def test_what_is_given_is_kept_and_a_result_reopens(tmp_path):
    block = with_collocation(small_block(5, "collocation:5x4")[0], 2.5)
    a = adjust_keeping_system(block)
    assert a.result.block.settings.collocation.sigma_um == 2.5
    assert a.result.block.settings.collocation.length_mm is not None
    write_block(a.result.block, tmp_path / "block")
    write_solution(tmp_path / "solution.npz", a.system, a.solution, a.local)
    again = reopen(read_block(tmp_path / "block"), read_solution(tmp_path / "solution.npz"))
    scale = np.sqrt(np.diagonal(a.result.parameters.covariance))
    np.testing.assert_allclose(again.result.parameters.sigma, a.result.parameters.sigma, rtol=1e-9)
    np.testing.assert_allclose(
        again.result.parameters.covariance / np.outer(scale, scale),
        a.result.parameters.covariance / np.outer(scale, scale), atol=1e-9,
    )  # fmt: skip


class OfCofactors:
    """A factor that knows its cofactors well and has lost its normal equations to rounding."""

    def __init__(self, cofactors, normals):
        self._cofactors, self._normals = cofactors, normals

    def border_inverse(self):
        return self._cofactors

    def border_normals(self):
        return self._normals


def test_normals_lost_to_rounding_come_from_cofactors():
    """Found with a flight that positions of 5 m hold: marginal normals are the inverse of a part of the cofactors."""
    root = np.random.default_rng(1).normal(size=(9, 5)) * [1.0, 1e-6, 1.0, 1e4, 1.0]
    normals = root.T @ root
    cofactors, columns = np.linalg.inv(normals), np.array([0, 2, 3])
    lost = normals - np.diag([0.0, 2.0 * normals[1, 1], 0.0, 0.0, 0.0])
    found = border_marginal(OfCofactors(cofactors, lost), columns)
    np.testing.assert_allclose(found, border_marginal(OfCofactors(cofactors, normals), columns), rtol=1e-6)
    for bad in (-cofactors, np.full_like(cofactors, np.nan)):
        with pytest.raises(NotPositiveDefiniteError):
            border_marginal(OfCofactors(bad, lost), columns)
