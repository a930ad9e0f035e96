"""Robust estimators: cost and weight fit each other, gross errors do no harm, weights and covariance come together."""

from dataclasses import replace

import numpy as np
import pytest

from aerotri.adjustment import _robust_kernels as _kernels
from aerotri.adjustment.robust import CODES, LIMITS, STAGES, Estimator, estimator_for, weights_and_costs
from aerotri.pipeline import adjust
from small_blocks import small_block, with_adjustment

ROBUST = [name for name in STAGES if name not in ("off", "data-snooping")]
REDESCENDING = [name for name in ROBUST if len(STAGES[name]) == 2]
ADAPTIVE = {
    f"adaptive {wide} {step}": _kernels.ADAPTIVE + _kernels.ADAPTIVE_STEPS * wide + step
    for wide, step in ((0, 4), (2, 16), (4, 30))
}
ESTIMATORS = {**{name: code for name, code in CODES.items() if name != "off"}, **ADAPTIVE}


@pytest.mark.parametrize("name", ESTIMATORS)
def test_weight_is_the_slope_of_the_cost(name):
    """w = ρ'(e)/(2e): otherwise a step that is tested by its cost is not the step that the weights make."""
    estimator = Estimator(ESTIMATORS[name], 1.7)
    e = np.concatenate([np.linspace(0.01, 12.0, 400), [50.0, 900.0]])
    h = 1e-5 * e
    weight, cost = weights_and_costs(estimator, e)
    slope = (weights_and_costs(estimator, e + h)[1] - weights_and_costs(estimator, e - h)[1]) / (2.0 * h)
    corner = np.abs(e - 1.7) < 0.05
    np.testing.assert_allclose(weight[~corner], (slope / (2.0 * e))[~corner], rtol=2e-6, atol=1e-9)
    np.testing.assert_allclose(cost[0], weight[0] * e[0] ** 2, rtol=1e-3)
    assert (np.diff(weight) <= 1e-12).all()
    assert (weight > 0.0).all()
    assert (np.diff(cost) >= 0.0).all()


def test_adaptive_finds_share_and_spread():
    """A tenth of the lengths thirty times as long; then none: the weights of least squares."""
    rng = np.random.default_rng(3)
    good = np.hypot(*rng.normal(size=(2, 20000)))
    gross = 30.0 * np.hypot(*rng.normal(size=(2, 2000)))
    estimator = estimator_for("adaptive", np.concatenate([good, gross]), 1.0)
    weight = weights_and_costs(estimator, np.concatenate([good, gross]))[0]
    # what Bayes would say, knowing share and spread
    odds = 2000 / 20000 / 30.0**2
    expected = 1.0 / (1.0 + odds * np.exp(0.5 * good**2 * (1.0 - 1.0 / 900.0)))
    assert np.abs(weight[:20000] - expected).mean() < 0.01
    assert np.median(weight[20000:]) < 0.01
    clean = weights_and_costs(estimator_for("adaptive", good, 1.0), good)[0]
    assert clean.mean() > 0.999


def test_cauchy_keeps_95_per_cent_of_the_efficiency():
    """[D] For normal errors in two coordinates: E[w·e²/2]²/E[w²·e²/2], by Stein's identity; Huber at 2 more."""
    e = np.linspace(0.0, 12.0, 200001)
    density = e * np.exp(-0.5 * e**2)
    for name, expected in (("cauchy", 0.950), ("huber", 0.982), ("danish", 0.996)):
        w = weights_and_costs(Estimator(CODES[name], LIMITS[name]), e)[0]
        numerator, denominator = (np.trapezoid(w**k * e**2 / 2.0 * density, e) for k in (1, 2))
        assert numerator**2 / denominator == pytest.approx(expected, abs=1.5e-3), name


@pytest.fixture(scope="module")
def blocks():
    clean, _ = small_block(18)
    foul, truth = small_block(18, gross_errors={"fraction": 0.05, "range_sigma": [10.0, 100.0]})
    return clean, foul, np.asarray(truth.gross_errors)


@pytest.mark.parametrize("name", ROBUST)
def test_gross_errors_do_no_harm(blocks, name):
    clean, foul, wrong = blocks
    reference, result = adjust(clean), adjust(with_adjustment(foul, robust=name))
    off = np.abs((result.images.centre - reference.images.centre) / reference.images.sigma[:, :3])
    assert result.outcome.status == "converged"
    assert off.max() < 3.0
    # along the base a ray of two hides its error
    assert np.median(result.rays.weight[wrong]) < 0.3
    good = np.setdiff1d(np.arange(len(foul.image_points)), wrong)
    assert np.nanmean(result.rays.weight[good]) > (0.75 if name == "cauchy" else 0.9)


@pytest.mark.parametrize("name", REDESCENDING)
def test_sigma0_of_the_good_rays(blocks, name):
    """vᵀPv over Σ weight·r: gross errors count in neither, and σ of the unknowns is that of the good rays."""
    clean, foul, _ = blocks
    reference = adjust(clean)
    for block in (clean, foul):
        result = adjust(with_adjustment(block, robust=name))
        assert result.outcome.sigma0 == pytest.approx(1.0, abs=0.13)
        ratio = np.median(result.images.sigma / reference.images.sigma)
        assert 0.93 < ratio < 1.25
        groups = sum(g.redundancy for g in result.groups)
        assert abs(groups - result.outcome.redundancy) < 1e-6 * result.outcome.redundancy


@pytest.mark.parametrize("name", ROBUST)
def test_a_wrong_a_priori_sigma_changes_nothing(blocks, name):
    """The scale comes from the residuals; the σ of control goes along, so that the block is the same."""
    _, foul, _ = blocks
    rays, control = foul.image_points, foul.control
    scaled = replace(
        foul, image_points=replace(rays, sigma=3.0 * rays.sigma), control=replace(control, sigma=3.0 * control.sigma)
    )
    first, second = (adjust(with_adjustment(block, robust=name)) for block in (foul, scaled))
    np.testing.assert_allclose(second.rays.weight, first.rays.weight, atol=2e-3)
    assert second.outcome.sigma0 == pytest.approx(first.outcome.sigma0 / 3.0, rel=1e-2)


def test_clean_observations_are_left_alone(blocks):
    clean = blocks[0]
    plain = adjust(clean)
    for name, most in (("huber", 0.6), ("danish", 0.6), ("cauchy", 1.5), ("adaptive", 0.2)):
        robust = adjust(with_adjustment(clean, robust=name))
        shift = np.abs(plain.images.centre - robust.images.centre) / plain.images.sigma[:, :3]
        assert shift.max() < most, name
