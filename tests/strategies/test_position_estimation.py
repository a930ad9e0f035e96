"""Errors of positions that stay: restricted likelihood against a dense one, estimate, test of need, warning."""

from dataclasses import replace

import numpy as np
import pytest

from aerotri.diagnosis.position_errors import position_errors_in_words
from aerotri.formats.results.solution import read_solution, write_solution
from aerotri.observations.settings import GnssSettings
from aerotri.pipeline import adjust_keeping_system, reopen
from aerotri.strategies.position_estimation import LEVEL, chance, estimate, neighbours
from aerotri.strategies.position_likelihood import (
    ErrorModel,
    Given,
    ReducedToPositions,
    best_noise,
    best_process,
    sample,
)
from dense_algebra import TINY, dense_design
from small_blocks import small_block

GNSS = {"sigma_m": [0.02, 0.02, 0.03]}
FLIGHT = {
    "gsd_m": 0.05, "strips": 4, "images_per_strip": 10, "end_lap": 0.7, "side_lap": 0.4,
    "attitude_sigma_deg": [1.0, 1.0, 2.0], "position_sigma_m": [2.0, 2.0, 2.0], "turn_s": 30.0,
}  # fmt: skip
TIES = {"per_image": 40, "probability": 0.9, "sigma_um": 3.0}


def block_with(seed=1, correlated="off", **gnss):
    block = small_block(seed, flight=FLIGHT, tie_points=TIES, gnss=GNSS | gnss)[0]
    return replace(block, settings=replace(block.settings, gnss=replace(block.settings.gnss, correlated=correlated)))


def reduced_of(adjustment, most=400):
    factor = adjustment.system.factorise(adjustment.solution.equations)
    return ReducedToPositions.of(adjustment.system, adjustment.solution, factor, most)


@pytest.fixture(scope="module")
def reduced():
    return reduced_of(adjust_keeping_system(block_with()))


def drawn(reduced, rng, model=None):
    """Residuals as positions with errors of a model would have them: cofactors G + G·(C − I)·G."""
    values, vectors = np.linalg.eigh(reduced.cofactor)
    residual = vectors @ (np.sqrt(np.maximum(values, 0.0)) * rng.normal(size=len(values)))
    if model is not None:
        for axis in range(3):
            own = np.flatnonzero(reduced.axis == axis)
            covariance = reduced.exposures.correlation(model.time)[np.ix_(reduced.row[own], reduced.row[own])]
            errors = np.linalg.cholesky(covariance + 1e-12 * np.eye(len(own))) @ rng.normal(size=len(own))
            residual = residual + reduced.cofactor[:, own] @ (model.sigma[axis] / reduced.sigma[own] * errors)
    return replace(reduced, residual=residual, omega=reduced.freedom + float(residual @ residual))


def test_likelihood_equals_the_dense_one():
    """−2 ln L = ν·ln Ω + ln|V| + ln|AᵀV⁻¹A| of all observations, differences between models."""
    block = small_block(4, "bluh:1-2", **TINY, gnss={"sigma_m": [0.05, 0.05, 0.08], "shift_sigma_m": [0.1] * 3})[0]
    gnss = replace(block.settings.gnss, shift="block")
    adjustment = adjust_keeping_system(replace(block, settings=replace(block.settings, gnss=gnss)))
    found, design = reduced_of(adjustment), dense_design(adjustment)
    design = design[:, np.abs(design).sum(axis=0) > 0.0]
    at = np.arange(len(design) - len(found.row), len(design))
    order = np.lexsort((found.axis, sample_rows(adjustment)[found.row]))

    def dense(model):
        v = np.eye(len(design))
        for axis in range(3):
            own = np.flatnonzero(found.axis[order] == axis)
            row, sigma = found.row[order][own], found.sigma[order][own]
            k = model.sigma[axis] ** 2 * found.exposures.correlation(model.time)[np.ix_(row, row)]
            k = k / (sigma[:, None] * sigma) + model.noise[int(axis == 2)] ** 2 * np.eye(len(own))
            v[np.ix_(at[own], at[own])] = k
        p = np.linalg.inv(v)
        normals = design.T @ p @ design
        # the gaps of the rays add the same to every model but for vᵀPv itself: l = (gaps of rays, of positions)
        gaps = full_gaps(adjustment)
        rest = gaps - design @ np.linalg.solve(normals, design.T @ p @ gaps)
        omega = float(rest @ p @ rest)
        return found.freedom * np.log(omega) + np.linalg.slogdet(v)[1] + np.linalg.slogdet(normals)[1]

    base = ErrorModel()
    for model in (
        ErrorModel((1.0, 1.0), (0.1, 0.1, 0.2), 8.0),
        ErrorModel((0.4, 1.7), (0.02, 0.05, 0.3), 60.0),
        ErrorModel((2.0, 0.2)),
    ):
        expected = dense(model) - dense(base)
        assert abs(found.deviance(model) - found.deviance(base) - expected) < 1e-5 * max(abs(expected), 1.0)


def sample_rows(adjustment):
    """Rows of the exposures of a reduced block, in its order."""
    from aerotri.adjustment.exposures import exposures_of
    from aerotri.strategies.position_likelihood import observed_rows

    u, (_, image) = adjustment.system.unknowns, observed_rows(adjustment.system, adjustment.solution)
    return sample(exposures_of(u.block, u.images[image], adjustment.solution.state.centre[image]), 400)


def full_gaps(adjustment):
    """Whitened gaps of all observations in the order of `dense_design`."""
    system, solution = adjustment.system, adjustment.solution
    u, state = system.unknowns, solution.state
    rays = (solution.equations.residual * u.rays.inv_sigma).ravel()
    rows, axes = np.nonzero(u.prior_weight * (u.kept < 0)[:, None])
    control = (u.prior_xyz - state.points)[rows, axes] * np.sqrt(u.prior_weight[rows, axes])
    sigma = np.array(u.shared.sigma)
    known = np.isfinite(sigma)
    shared = ((np.array(u.shared.observed) - state.shared) / sigma)[known]
    beside = [r.gap[r.inv_sigma > 0.0] for r in system.whitened_rows(state)]
    return np.concatenate([rays, control, shared, *beside])


def test_estimate_finds_what_was_drawn(reduced):
    truth = ErrorModel((1.0, 1.0), (0.05, 0.05, 0.07), 12.0)
    rng, found, needed = np.random.default_rng(5), [], 0
    for _ in range(7):
        model, errors = estimate(drawn(reduced, rng, truth), GnssSettings(correlated="on"))
        needed += errors.p < LEVEL
        found.append([model.sigma[0], model.sigma[2], model.time])
    assert needed == 7
    sigma_plan, sigma_height, time = np.median(found, axis=0)
    assert 0.035 < sigma_plan < 0.065
    assert 0.05 < sigma_height < 0.09
    assert 5.0 < time < 25.0


def test_not_found_where_there_is_none(reduced):
    """False alarms of the test and of the warning stay near their levels, also where the noise is twice as large."""
    rng = np.random.default_rng(7)
    gains, correlations = [], []
    for _ in range(12):
        residuals = drawn(reduced, rng)
        white, without = best_noise(residuals, Given())
        gains.append(without - best_process(residuals, Given(), white)[1])
        correlations.append(neighbours(residuals)[1])
    assert sum(chance(max(gain, 0.0)) < LEVEL for gain in gains) <= 2
    assert sum(p < 0.01 for p in correlations) <= 2
    assert 0.2 < np.mean(correlations) < 0.8


def test_neighbours_alike_are_seen(reduced):
    rng = np.random.default_rng(8)
    found = [neighbours(drawn(reduced, rng, ErrorModel(sigma=(0.05, 0.05, 0.05), time=15.0))) for _ in range(5)]
    assert sum(correlation > 0.15 and p < 0.01 for correlation, p in found) >= 4


def test_what_is_given_stays(reduced):
    residuals = drawn(reduced, np.random.default_rng(1), ErrorModel(sigma=(0.05, 0.05, 0.05), time=15.0))
    given = Given((1.0, 1.0), None, 33.0)
    model, _ = best_process(residuals, given, best_noise(residuals, given)[0])
    assert model.time == 33.0
    assert model.noise == (1.0, 1.0)
    given = Given(None, (0.01, 0.02, 0.03), None)
    model, _ = best_process(residuals, given, best_noise(residuals, given)[0])
    assert model.sigma == (0.01, 0.02, 0.03)


def test_a_sample_is_runs_of_neighbours(reduced):
    chosen = sample(reduced.exposures, 20)
    assert len(chosen) == 20
    assert (np.diff(np.flatnonzero(np.isin(reduced.exposures.order, chosen))) == 1).sum() == 15


@pytest.fixture(scope="module")
def block_with_errors():
    return block_with(1, "on", correlated_sigma_m=[0.06, 0.06, 0.09], correlation_time_s=12.0)


def test_adjusted_with_what_was_found(block_with_errors, tmp_path):
    adjustment = adjust_keeping_system(block_with_errors)
    errors = adjustment.result.position_errors
    assert errors.source == "estimated"
    assert errors.nodes == errors.exposures == 40
    gnss = adjustment.result.block.settings.gnss
    assert not gnss.to_estimate
    np.testing.assert_allclose(errors.height_m, gnss.correlated_sigma_m[2] * adjustment.result.outcome.sigma0)
    assert any("errors that stay" in text and "correlation time" in text for text in adjustment.result.outcome.warnings)
    write_solution(tmp_path / "solution.npz", adjustment.system, adjustment.solution, adjustment.local)
    again = reopen(adjustment.result.block, read_solution(tmp_path / "solution.npz", adjustment.result.block))
    assert again.result.position_errors == errors
    np.testing.assert_allclose(again.result.points.sigma, adjustment.result.points.sigma, rtol=1e-6)
    same = adjust_keeping_system(adjustment.result.block).result
    assert same.position_errors.source == "given"
    np.testing.assert_allclose(same.points.sigma, adjustment.result.points.sigma, rtol=1e-4)


def test_without_it_the_user_is_told(block_with_errors):
    gnss = replace(block_with_errors.settings.gnss, correlated="off")
    block = replace(block_with_errors, settings=replace(block_with_errors.settings, gnss=gnss))
    result = adjust_keeping_system(block).result
    assert result.position_errors.neighbours_agree
    assert any('correlated = "on"' in text for text in result.outcome.warnings)


def test_no_need_is_said(reduced):
    found = adjust_keeping_system(block_with(2, "on")).result
    assert found.position_errors.source == ""
    assert found.position_errors.p > LEVEL
    assert found.block.settings.gnss.correlated == "off"
    assert "adjusted as independent" in position_errors_in_words(found.position_errors)
