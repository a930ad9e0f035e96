"""Which points are measured, with what noise and which gross errors."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from aerotri.conventions import InputError
from aerotri.simulation import simulate

QUIET = {"sigma_um": 0.0, "stated_sigma_um": 2.0}


@pytest.mark.parametrize("distribution", ["uniform", "clusters"])
def test_points_per_image_and_rays_per_point(small_spec, distribution):
    spec = small_spec(
        flight={"end_lap": 0.8, "side_lap": 0.6, "strips": 4},
        tie_points={"per_image": 80.0, "rays_per_point": 5.0, "distribution": distribution},
    )
    block, _ = simulate(spec, 2)
    assert len(block.image_points) / len(block.images) == pytest.approx(80.0, rel=0.03)
    assert len(block.image_points) / len(block.points) == pytest.approx(5.0, rel=0.04)
    rays = np.bincount(block.image_points.point)
    assert rays.min() >= 2
    pairs = set(zip(block.image_points.image.tolist(), block.image_points.point.tolist(), strict=True))
    assert len(pairs) == len(block.image_points)


def test_least_and_most_rays_are_kept(small_spec):
    spec = small_spec(flight={"end_lap": 0.8, "side_lap": 0.6}, tie_points={"min_rays": 3, "max_rays": 6})
    block, _ = simulate(spec, 2)
    rays = np.bincount(block.image_points.point)
    assert rays.min() >= 3
    assert rays.max() == 6


def test_uniform_points_spread_evenly_and_clusters_gather(small_spec):
    def variation(distribution):
        spec = small_spec(tie_points={"per_image": 200.0, "distribution": distribution, "cluster_sigma": 0.02})
        block, _ = simulate(spec, 2)
        xy = block.image_points.xy[block.image_points.image == 10]
        counts = np.histogram2d(*xy.T, bins=5, range=[[-51.75, 51.75], [-33.75, 33.75]])[0]
        return counts.std() / counts.mean()

    assert variation("uniform") < 0.4
    assert variation("clusters") > 0.6


def test_clusters_lie_about_the_nodes_of_the_pattern(small_spec):
    """A single strip, one row of three nodes across: the points lie at 0 and ±0.8 of the half format across."""
    spec = small_spec(
        flight={"strips": 1, "images_per_strip": 8},
        tie_points={"distribution": "clusters", "pattern": [1, 3], "cluster_sigma": 0.01, **QUIET},
    )
    block, _ = simulate(spec, 2)
    across = block.image_points.xy[:, 0] / 51.75
    nearest = np.min(np.abs(across[:, None] - np.array([-0.8, 0.0, 0.8])), axis=1)
    assert np.sqrt(np.mean(nearest**2)) == pytest.approx(0.02, rel=0.2)


def test_too_many_rays_are_refused(small_spec):
    with pytest.raises(InputError, match=r"tie_points\.rays_per_point.*at most"):
        simulate(small_spec(tie_points={"rays_per_point": 9.0}), 1)


def test_a_flight_without_overlap_gives_no_points(small_spec):
    spec = small_spec(flight={"end_lap": 0.0, "side_lap": 0.0})
    with pytest.raises(InputError, match="tie_points"):
        simulate(spec, 1)


def test_noise_has_the_stated_sigma(small_spec):
    """χ² of the noise, ties and signalised points apart, at 99.9 %; x and y independent, normal."""
    change = {"control": {"distance_bases": 1.0, "check_points": 30, "image_sigma_um": 5.0}}
    noisy, _ = simulate(small_spec(tie_points={"per_image": 200.0, "sigma_um": 3.0}, **change), 4)
    change["control"]["image_sigma_um"] = 0.0
    quiet, _ = simulate(small_spec(tie_points={"per_image": 200.0, **QUIET}, **change), 4)
    np.testing.assert_array_equal(noisy.image_points.point, quiet.image_points.point)
    noise = noisy.image_points.xy - quiet.image_points.xy
    signal = np.isin(noisy.image_points.point, noisy.control.point)
    for own, sigma in ((signal, 5e-3), (~signal, 3e-3)):
        v = noise[own] / sigma
        assert (noisy.image_points.sigma[own] == sigma).all()
        low, high = stats.chi2.ppf([0.0005, 0.9995], v.size)
        assert low < np.sum(v**2) < high
        assert abs(np.mean(v)) < 3.3 / np.sqrt(v.size)
        assert abs(np.mean(v[:, 0] * v[:, 1])) < 3.3 / np.sqrt(len(v))
        assert stats.kstest(v.ravel(), "norm").pvalue > 0.001


def test_stated_sigma_stands_where_there_is_no_noise(small_spec):
    block, _ = simulate(small_spec(tie_points=QUIET, control={"distance_bases": 3.0}), 4)
    assert (block.image_points.sigma == 2e-3).all()
    assert block.settings.image_sigma_um == 2.0


def test_gross_errors_are_at_the_rays_recorded(small_spec):
    change = {"control": {"distance_bases": 3.0}}
    clean, _ = simulate(small_spec(**change), 4)
    wrong, truth = simulate(small_spec(gross_errors={"fraction": 0.1, "range_sigma": [10.0, 100.0]}, **change), 4)
    difference = wrong.image_points.xy - clean.image_points.xy
    np.testing.assert_array_equal(np.flatnonzero(difference.any(axis=1)), truth.gross_errors)
    np.testing.assert_allclose(difference[truth.gross_errors], truth.gross_error_mm, atol=1e-12)
    size = np.linalg.norm(truth.gross_error_mm, axis=1) / 2e-3
    assert size.min() >= 10.0
    assert size.max() <= 100.0
    assert stats.kstest(size, stats.uniform(10.0, 90.0).cdf).pvalue > 0.001
    ties = ~np.isin(wrong.image_points.point, wrong.control.point)
    assert ties[truth.gross_errors].all()
    assert len(truth.gross_errors) == round(0.1 * ties.sum())
    assert (np.abs(wrong.image_points.xy) <= wrong.cameras[0].half_format_mm).all()
