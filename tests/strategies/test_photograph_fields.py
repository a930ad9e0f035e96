"""Smooth errors of single photographs: against dense covariances, sizes found again, nothing found in white noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import aerotri
from aerotri.adjustment.photograph_fields import MOST_COLUMNS, grid_of
from aerotri.conventions import InputError
from aerotri.formats.block.folder import read_block, write_block
from aerotri.formats.results.solution import read_solution, write_solution
from aerotri.functional_model.additional_parameters import collocation
from aerotri.observations import Block, PhotographFieldSettings
from aerotri.pipeline import adjust_keeping_system, reopen
from aerotri.results.photograph_fields import PhotographFields
from aerotri.strategies.field_estimation import FieldCovariance, ReducedToFields
from aerotri.strategies.photograph_field_estimation import chance
from dense_algebra import TINY, dense_design
from small_blocks import small_block, with_adjustment

SIZE_UM, LENGTH_MM = 3.0, 30.0


def asked(block: Block, sigma_um: float | None = None, length_mm: float | None = None, correlated: str = "on") -> Block:
    """The block with smooth errors of its photographs, known or to be estimated."""
    settings = PhotographFieldSettings(correlated, sigma_um, length_mm)
    return with_adjustment(
        replace(block, settings=replace(block.settings, photograph_fields=settings)), model_part="off"
    )


def with_errors(block: Block, seed: int) -> Block:
    """The block with a smooth error of another shape in every photograph, of σ SIZE_UM; waves in all directions."""
    rng, rays = np.random.default_rng(seed), block.image_points
    n, waves = len(block.images), 30
    number = rng.normal(0.0, 1.0 / LENGTH_MM, (n, 2, waves, 2))
    phase = rng.uniform(0.0, 2.0 * np.pi, (n, 2, waves))
    d = np.einsum("rawk,rk->raw", number[rays.image], rays.xy) + phase[rays.image]
    error = 1e-3 * SIZE_UM * np.sqrt(2.0 / waves) * np.cos(d).sum(axis=2)
    return replace(block, image_points=replace(rays, xy=rays.xy + error))


def parts(found):
    """Whitened columns of the nodes at the rays (2m, p), those of all other unknowns, and whitened residuals (2m,)."""
    system, u = found.system, found.system.unknowns
    design = dense_design(found)
    columns = 6 * len(u.images) + np.concatenate([prior.columns for prior in system.priors.photograph_fields])
    others = np.delete(design, columns, axis=1)
    residuals = (found.solution.equations.residual * u.rays.inv_sigma).ravel()
    return design[: len(residuals), columns], others, residuals


def covariance_of(found, sigma_um: float, length_mm: float) -> np.ndarray:
    """(p, p) mm² of all nodes: photographs are independent."""
    fields = found.system.unknowns.shared.photograph_fields
    total = np.zeros((sum(len(field.items) for field in fields),) * 2)
    at = 0
    for field in fields:
        own = slice(at, at + len(field.items))
        total[own, own] = collocation.prior_covariance(field.camera, field.items, 1e-3 * sigma_um, length_mm)
        at = own.stop
    return total


def test_the_solution_is_that_of_a_full_covariance_of_the_image_points():
    """Aᵀ·V⁻¹·l = 0 with V the covariance of noise and smooth errors together, nodes nowhere among the unknowns."""
    found = adjust_keeping_system(asked(with_errors(small_block(3, **TINY)[0], 3), SIZE_UM, LENGTH_MM))
    nodes, others, white = parts(found)
    state, u = found.solution.state, found.system.unknowns
    values = state.shared[np.concatenate([p.columns for p in found.system.priors.photograph_fields])]
    m = len(white)
    full = np.eye(m) + nodes @ covariance_of(found, SIZE_UM, LENGTH_MM) @ nodes.T
    # what the model leaves of an image point is noise and smooth error together
    weighted = np.linalg.solve(full, white + nodes @ values)
    np.testing.assert_allclose(weighted, white, atol=1e-7 * np.abs(white).max())
    only_rays = 6 * len(u.images)
    assert np.abs(others[:m, :only_rays].T @ weighted).max() < 1e-5 * np.abs(others[:m, :only_rays]).sum(axis=0).max()


def test_likelihood_against_dense_algebra():
    """−2 ln L up to a constant, from the covariance of the image points with all other unknowns projected out."""
    found = adjust_keeping_system(asked(with_errors(small_block(4, **TINY)[0], 4), 2.0, 30.0))
    nodes, others, white = parts(found)
    system, state, u = found.system, found.solution.state, found.system.unknowns
    priors = system.priors.photograph_fields
    factor = system.factorise(found.solution.equations)
    reduced = ReducedToFields.of_fields(system, found.solution, factor, u.shared.photograph_fields, priors)
    columns = np.concatenate([p.columns for p in priors])
    rows, axes = np.nonzero(u.prior_weight)
    control = (np.sqrt(u.prior_weight) * (u.prior_xyz - state.points))[rows, axes]
    y = np.concatenate([white + nodes @ state.shared[columns], control])
    others = others[: len(y)]
    seen = np.concatenate([nodes, np.zeros((len(control), nodes.shape[1]))])
    others = others[:, (others != 0.0).any(axis=0)]
    left = np.linalg.svd(others / np.linalg.norm(others, axis=0), full_matrices=True)[0][:, others.shape[1] :]
    y, seen = left.T @ y, left.T @ seen
    cases = [(2.0, 30.0), (0.5, 10.0), (6.0, 100.0)]

    def dense(sigma_um: float, length_mm: float) -> float:
        v = np.eye(len(y)) + seen @ covariance_of(found, sigma_um, length_mm) @ seen.T
        return len(y) * np.log(y @ np.linalg.solve(v, y)) + np.linalg.slogdet(v)[1]

    ours = np.array([reduced.deviance(FieldCovariance(*case)) for case in cases])
    expected = np.array([dense(*case) for case in cases])
    assert reduced.freedom == pytest.approx(len(y))
    np.testing.assert_allclose(ours - ours[0], expected - expected[0], atol=1e-4)
    # without such errors
    assert reduced.freedom * np.log(reduced.omega) - ours[0] == pytest.approx(
        len(y) * np.log(y @ y) - expected[0], abs=1e-4
    )


def test_smooth_errors_are_found_and_the_noise_beside_them():
    block, truth = small_block(10)
    plain, found = (
        aerotri.adjust(asked(with_errors(block, 10), correlated=how), explain=False).adjusted for how in ("off", "on")
    )
    fields = found.photograph_fields
    assert plain.photograph_fields is None
    assert fields is not None
    assert fields.source == "estimated"
    assert fields.p < 1e-6
    # σ²/ℓ is well known, σ alone is not: these errors are smoother than the covariance says
    assert 0.5 * SIZE_UM < fields.sigma_um < 3.0 * SIZE_UM
    # the noise was simulated with 2 µm
    assert found.outcome.sigma0_um == pytest.approx(2.0, abs=0.15)
    assert plain.outcome.sigma0_um > 2.15
    assert any("errors in common, other ones in every photograph" in said for said in found.outcome.warnings)
    error, before = ((result.points.xyz - truth.points)[:, 2] for result in (found, plain))
    assert 0.75 < np.sqrt(np.nanmean((error / found.points.sigma[:, 2]) ** 2)) < 1.25
    assert np.sqrt(np.nanmean(error**2)) < 0.9 * np.sqrt(np.nanmean(before**2))
    assert not {"photograph field"} & set(found.parameters.kinds.tolist())


def test_white_noise_has_no_smooth_errors():
    """The result is the same as where nobody asked."""
    block = small_block(6)[0]
    asked_for = aerotri.adjust(asked(block), explain=False).adjusted
    plain = aerotri.adjust(asked(block, correlated="off"), explain=False).adjusted
    assert asked_for.photograph_fields is not None
    assert not asked_for.photograph_fields.counts
    assert asked_for.photograph_fields.p > 0.01
    np.testing.assert_allclose(asked_for.points.xyz, plain.points.xyz, atol=1e-6)
    np.testing.assert_allclose(asked_for.points.sigma, plain.points.sigma, rtol=1e-4)


def test_what_is_given_stays_and_is_read_again(tmp_path):
    """Block and result on disk and back."""
    block = asked(with_errors(small_block(7, **TINY)[0], 7), 2.5, 35.0)
    write_block(block, tmp_path / "block")
    again = read_block(tmp_path / "block")
    assert again.settings.photograph_fields == block.settings.photograph_fields
    found = adjust_keeping_system(again)
    write_solution(tmp_path / "solution.npz", found.system, found.solution, found.result)
    opened = reopen(found.result.block, read_solution(tmp_path / "solution.npz", found.result.block))
    assert opened.result.photograph_fields == found.result.photograph_fields
    assert found.result.photograph_fields is not None
    assert found.result.photograph_fields.source == "given"
    np.testing.assert_allclose(opened.result.points.sigma, found.result.points.sigma, rtol=1e-6)
    record = PhotographFields(source="estimated", sigma_um=1.0)
    assert PhotographFields.from_dict(record.as_dict()).as_dict() == record.as_dict()


def test_the_grid_is_as_fine_as_the_block_allows():
    assert grid_of(40) == (5, 4)
    assert grid_of(120) == (4, 3)
    assert grid_of(MOST_COLUMNS // 18) == (3, 3)
    with pytest.raises(InputError, match="too many for 581 photographs"):
        grid_of(581)


def test_chance_of_a_gain():
    assert chance(0.0) == 1.0
    # half of P(χ²₁ > 3.84) and of P(χ²₂ > 3.84)
    assert chance(3.8415) == pytest.approx(0.5 * (0.05 + np.exp(-3.8415 / 2.0)), rel=1e-3)
