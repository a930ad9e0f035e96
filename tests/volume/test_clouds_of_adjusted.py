"""Distances of clouds of two adjustments: what their errors leave in them, and what both have in common."""

from __future__ import annotations

import importlib
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2

import aerotri
from aerotri import InputError
from aerotri.volume.change.adjusted import variances_of_difference
from aerotri.volume.change.adjusted_clouds import (
    NAMES,
    _covariances,
    _part,
    adjusted_distances,
    with_adjustments,
)
from aerotri.volume.change.clouds import Cloud, Scales, cloud_distances, core_points
from aerotri.volume.pickets import pickets_where_seen
from places import PROJECT

RUNS, SIGMA = 4, 0.05


@pytest.fixture(scope="module")
def proof():
    """The tool that simulates the clouds of two epochs."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(PROJECT / "tools" / "prove"))
        yield importlib.import_module("change_clouds")


@pytest.fixture(scope="module")
def epochs(proof):
    """Two adjustments with control in common, one with its own, and the truth."""
    rng = np.random.default_rng(31)
    block, truth = proof.free_of_noise(7)
    errors = [rng.normal(size=block.control.xyz.shape) * proof.CONTROL_SIGMA_M for _ in range(2)]
    first, common, own = (proof.observed(block, 2.0, errors[k], rng) for k in (0, 0, 1))
    return SimpleNamespace(first=first, common=common, own=own, truth=truth)


def measured(proof, epochs, other):
    """Clouds of two adjustments without noise, and their distances."""
    rng = np.random.default_rng(1)
    true = proof.site(epochs.truth)
    clouds = tuple(proof.measured(one, epochs.truth, true, 0.0, rng) for one in (epochs.first, other))
    core = clouds[0].xyz[core_points(clouds[0].xyz, 2.0 * proof.SCALES.cylinder)]
    found = cloud_distances(*clouds, core, proof.SCALES)
    return clouds, found, adjusted_distances(found, clouds, (epochs.first, other))


@pytest.mark.slow
def test_scatter_is_what_sigma_says(proof):
    """Σz² of the place in the middle in the 99.9 % band, and every case but that which leaves out what is common."""
    runs = [proof.one(None, seed) for seed in range(1, RUNS + 1)]
    low, high = chi2.ppf([0.0005, 0.9995], RUNS)
    for k, name in enumerate(proof.CASES):
        z = np.array([errors[at] / sigma[at] for errors, sigma, at in (run[k] for run in runs)])
        if "as if nothing" not in name:
            assert low < np.sum(z**2) < high, name
    own, common, apart = (np.concatenate([run[k][1] for run in runs]) for k in (0, 1, 3))
    assert np.median(common) < 0.85 * np.median(own)
    assert np.median(common) < 0.85 * np.median(apart)


def test_control_in_common_makes_sigma_smaller(proof, epochs):
    sigma = []
    for other in (epochs.common, epochs.own):
        _, found, adjusted = measured(proof, epochs, other)
        sigma.append(np.sqrt(np.median(adjusted.difference[np.isfinite(found.distance)])))
        assert ("control points that both" in adjusted.words) == (other is epochs.common)
    assert sigma[0] < 0.85 * sigma[1]


def test_between_places_it_is_as_computed_there(proof, epochs):
    """nᵀCn, linear between 36 places, against the response of the distance itself."""
    clouds, found, adjusted = measured(proof, epochs, epochs.common)
    for row in np.flatnonzero(np.isfinite(found.distance))[::7]:
        parts = []
        for cloud_epoch in (epochs.first, epochs.common):
            pickets, seen = pickets_where_seen(
                cloud_epoch, found.core[row : row + 1], 1e-3 * cloud_epoch.local.outcome.sigma0_um, np.array([2])
            )
            assert seen.all()
            parts.append(_part(cloud_epoch, pickets, found.normal[row]))
        assert adjusted.difference[row] == pytest.approx(sum(variances_of_difference(*parts)), rel=0.35)
    assert f"{NAMES[0]} and {NAMES[1]} come from two adjustments" in adjusted.words
    assert "control points" in adjusted.words
    assert clouds[0].matching is not None


@pytest.mark.parametrize("name", ["first", "common", "own"])
def test_covariances_at_places_are_those_of_single_responses(proof, epochs, name):
    """Of the change of two places some metres apart, along slanting directions: one response each, by other code."""
    true = proof.site(epochs.truth)[::40]
    calibrations = epochs.first, getattr(epochs, name)
    given = [
        pickets_where_seen(calibration, true + move, 1e-3 * calibration.local.outcome.sigma0_um, np.array([3]))
        for calibration, move in zip(calibrations, (0.0, np.array([4.0, -3.0, 1.0])), strict=True)
    ]
    both = np.flatnonzero(given[0][1] & given[1][1])[:5]
    pickets = [one.take((np.cumsum(seen) - 1)[both]) for one, seen in given]
    one, two = (_part(c, p.take(np.array([0])), np.ones(3)) for c, p in zip(calibrations, pickets, strict=True))
    found = _covariances(one, two, pickets)
    for k in range(len(both)):
        for along in (np.array([0.0, 0.0, 1.0]), np.array([0.6, 0.0, 0.8]), np.array([1.0, -2.0, 0.5])):
            parts = [_part(c, p.take(np.array([k])), along) for c, p in zip(calibrations, pickets, strict=True)]
            alone = [part.response.variance + part.response.model for part in parts]
            expected = sum(variances_of_difference(*parts)), *alone
            # image errors are bilinear between nodes in a response, which a small difference of two places shows more
            assert [along @ part[k] @ along for part in found] == pytest.approx(expected, rel=5e-3)


def test_few_factors_tell_all_places(proof, epochs, monkeypatch):
    """The normal equations of an epoch are factorised a few times, not once for every place and direction."""
    kind, count = type(epochs.first.system), []
    factorise = kind.factorise
    monkeypatch.setattr(kind, "factorise", lambda self, *given: count.append(1) or factorise(self, *given))
    measured(proof, epochs, epochs.common)
    assert len(count) <= 10


def test_one_adjustment_cancels(proof, epochs):
    clouds, found, adjusted = measured(proof, epochs, epochs.first)
    known = np.isfinite(found.distance)
    assert adjusted.difference[known].max() < 1e-6 * adjusted.alone[known].min()
    assert "both clouds come from one adjustment" in adjusted.words
    # what is left is what the points have for themselves
    noisy = tuple(replace(cloud, matching=np.full(len(cloud.xyz), SIGMA)) for cloud in clouds)
    again = cloud_distances(*noisy, found.core, proof.SCALES)
    sigma = with_adjustments(again, noisy, adjusted).sigma[known]
    expected = SIGMA * np.abs(again.normal[known, 2]) * np.sqrt((1.0 / again.count[known]).sum(axis=1))
    np.testing.assert_allclose(sigma, expected, rtol=1e-3)


def test_noise_shared_over_a_length_is_not_averaged_away():
    """ℓ as wide as the cylinder: nothing averages out; a known σ of Z is n_z·σ along the normal."""
    rng = np.random.default_rng(5)
    xyz = np.column_stack([rng.uniform(0.0, 20.0, (4000, 2)), np.zeros(4000)])
    xyz[:, 2] = 0.5 * xyz[:, 0]
    scales = Scales(2.0, 3.0, 2.0)
    core = xyz[core_points(xyz, 4.0)]
    core = core[(core[:, :2] > 3.0).all(axis=1) & (core[:, :2] < 17.0).all(axis=1)]
    for length, share in ((None, 1.0), (10.0, 1.0), (0.5, None), (0.0, 0.0)):
        cloud = Cloud(xyz, np.zeros((4000, 6)), np.full(4000, SIGMA), None, length)
        found = cloud_distances(cloud, cloud, core, scales)
        up = found.normal[:, 2]
        assert up == pytest.approx(1.0 / np.sqrt(1.25), rel=1e-6)
        left = found.noise[:, 0] / (SIGMA * up) ** 2
        area = np.pi * up
        expected = np.maximum(1.0 / found.count[:, 0], 0.25 / area if share is None else share)
        np.testing.assert_allclose(left, expected, rtol=1e-9)


def test_covariances_without_a_noise_of_their_own_lose_the_adjustment(proof, epochs):
    """Of points whose σ holds the adjustment: what is beyond it stays for each, not averaged."""
    clouds, found, adjusted = measured(proof, epochs, epochs.common)
    known = np.isfinite(found.distance)
    plain = tuple(Cloud(cloud.xyz, np.zeros((len(cloud.xyz), 6))) for cloud in clouds)
    own = replace(found, variance=adjusted.alone + SIGMA**2)
    sigma = with_adjustments(own, plain, adjusted).sigma[known]
    np.testing.assert_allclose(sigma, np.sqrt(2.0 * SIGMA**2 + adjusted.difference[known]), rtol=1e-9)


def test_the_user_gives_two_results(proof):
    """Both adjustments make σ; one alone is refused; the same one leaves the noise alone."""
    spec = importlib.import_module("volume_proof.simulated").SPEC
    flight = aerotri.simulate(spec, 4)
    result = aerotri.adjust(flight.block, parameters="bluh:1-12", explain=False)
    xyz = proof.site(flight.truth)
    found = aerotri.cloud_change(
        xyz, xyz + [0.0, 0.0, 0.5], cylinder=30.0, first_adjustment=result, second_adjustment=result
    )
    assert found.summary["sigma_from"] == "adjustments"
    assert found.summary["adjustments_m"] < 1e-3
    assert any("one adjustment" in text for text in found.warnings)
    with pytest.raises(InputError, match="given alone"):
        aerotri.cloud_change(xyz, xyz, cylinder=30.0, first_adjustment=result)
    with pytest.raises(InputError, match="no two photographs of its adjustment see the first cloud"):
        aerotri.cloud_change(xyz + 1e5, xyz + 1e5, cylinder=30.0, first_adjustment=result, second_adjustment=result)
