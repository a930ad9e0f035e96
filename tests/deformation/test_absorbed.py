"""The orientation that an adjustment without parameters finds, and the σ of the deformation."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from aerotri.adjustment.ray_status import RayStatus
from aerotri.deformation.absorbed import absorbed_orientation, absorbed_partials
from aerotri.deformation.error_parameters import error_rows
from aerotri.deformation.model_geometry import normal_model
from aerotri.deformation.model_grid import mean_ground, pair_of
from aerotri.deformation.orientation import calibrated_orientation
from aerotri.deformation.restitution import restitution_of
from aerotri.deformation.stereo_model import covariance_of, deform_points, intersect, measured
from aerotri.functional_model.rotation import logarithm
from aerotri.pipeline import adjust_keeping_system
from small_blocks import small_block, with_adjustment

DRAWS = {"free": 200, "absorbed": 30}


def with_values(calibration, value):
    """State and result with other values of the additional parameters, everything else as adjusted."""
    rows = error_rows(calibration)
    p = calibration.local.parameters
    changed = p.value.copy()
    changed[rows] = value
    place = {key: k for k, key in enumerate(zip(p.names, p.groups, strict=True))}
    shared, state = calibration.system.unknowns.shared, calibration.solution.state
    columns = [k for k, kind in enumerate(shared.kinds) if kind == "additional"]
    values = state.shared.copy()
    values[columns] = [changed[place[shared.names[k], shared.groups[k]]] for k in columns]
    other = replace(calibration, local=replace(calibration.local, parameters=replace(p, value=changed)))
    return other, replace(state, shared=values)


def noise_free(calibration):
    """The block as its own adjustment has it: every observation l + v; taken off without additional parameters."""
    adjusted = calibration.local
    block, used = adjusted.block, adjusted.rays.status == RayStatus.USED
    xy = block.image_points.xy + np.where(used[:, None], adjusted.rays.v, 0.0)
    control = np.where(np.isfinite(block.control.xyz), adjusted.points.xyz[block.control.point], np.nan)
    images = replace(block.images, centre=adjusted.images.centre, angles=adjusted.images.angles)
    return replace(
        with_adjustment(block, additional_parameters=()),
        image_points=replace(block.image_points, xy=xy),
        control=replace(block.control, xyz=control),
        images=images,
    )


def test_is_the_adjustment_of_the_noise_free_block(calibration):
    """The same found by the ordinary way through the pipeline, from a block with l + v in its tables."""
    expected = adjust_keeping_system(noise_free(calibration)).local.images
    found = absorbed_orientation(calibration).orientation
    np.testing.assert_allclose(found.centre, expected.centre, rtol=0.0, atol=2e-5)
    true = calibrated_orientation(calibration)
    assert np.abs(found.centre - true.centre).max() > 0.1


@pytest.mark.parametrize("datum", ["control", "minimal", "inner"])
def test_without_image_errors_nothing_moves(datum):
    """Parameters of zero: what noise and datum do is not in l + v; GNSS, INS, shifts, lever arm and all."""
    gnss = {"sigma_m": [0.05, 0.05, 0.08], "shift_sigma_m": [0.3, 0.3, 0.3], "lever_arm_m": [0.1, 0.0, 1.0]}
    ins = {"sigma_deg": [0.005, 0.005, 0.008], "boresight_deg": [0.2, -0.1, 0.3]}
    navigated = {"gnss": gnss, "ins": ins} if datum == "control" else {}
    block, _ = small_block(5, "bluh:1-12", **navigated)
    a = adjust_keeping_system(with_adjustment(block, datum=datum))
    rows = error_rows(a)
    assert len(rows) == 12
    _, state = with_values(a, np.zeros(12))
    found, true = absorbed_orientation(a, state).orientation, calibrated_orientation(a)
    np.testing.assert_allclose(found.centre, true.centre, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(found.rotation, true.rotation, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("datum", ["control", "inner"])
def test_partials_are_those_of_the_adjustment(calibration, datum):
    """−Q_xp·Q_pp⁻¹ against small changes of the parameters, in two datums and with a free principal distance."""
    block = with_adjustment(calibration.result.block, datum=datum)
    if datum == "control":
        camera = block.cameras[0]
        focal = replace(camera.interior["focal_length_mm"], fixed=False, sigma=0.02)
        free = replace(camera, interior={**camera.interior, "focal_length_mm": focal})
        block = replace(block, cameras=(free,))
    a = adjust_keeping_system(block)
    rows, partials = error_rows(a), absorbed_partials(a)
    value, sigma = a.local.parameters.value[rows], a.local.parameters.sigma[rows]
    rng = np.random.default_rng(2)
    for _ in range(2):
        step = 0.2 * sigma * rng.normal(size=len(rows))
        ends = [absorbed_orientation(a, with_values(a, value + sign * step)[1]).orientation for sign in (0.5, -0.5)]
        expected = partials @ step
        moved = ends[0].centre - ends[1].centre
        turned = logarithm(ends[0].rotation @ np.swapaxes(ends[1].rotation, 1, 2))
        interior = ends[0].interior - ends[1].interior
        for found, k in ((moved, slice(0, 3)), (turned, slice(3, 6)), (interior, slice(6, 9))):
            # linear theory leaves out what the residuals do to the normal equations
            size = np.abs(expected[:, k]).max()
            np.testing.assert_allclose(found, expected[:, k], rtol=0.0, atol=0.05 * size + 1e-9)


def nodes(calibration, model):
    centre = model.true.centre.mean(axis=0)
    x, y = np.meshgrid([-170.0, 20.0, 150.0], [-300.0, 40.0, 330.0])
    return np.column_stack([centre[0] + x.ravel(), centre[1] + y.ravel(), np.full(9, mean_ground(calibration))])


@pytest.mark.parametrize("variant", ["free", "absorbed"])
def test_sigma_against_monte_carlo(calibration, pair, variant):
    """Parameters drawn from Q_pp; the variance of every coordinate of every node within its χ² bounds."""
    model = pair_of(restitution_of(calibration, variant), calibration, *pair)
    points = nodes(calibration, model)
    seen = np.isfinite(deform_points(model, points).d[:, 2])
    points = points[seen]
    assert len(points) >= 4
    predicted = np.diagonal(covariance_of(model, points), axis1=1, axis2=2)
    rows = error_rows(calibration)
    p = calibration.local.parameters
    scale = p.sigma[rows]
    root = scale[:, None] * np.linalg.cholesky(p.covariance[np.ix_(rows, rows)] / np.outer(scale, scale))
    rng = np.random.default_rng(6)
    count = DRAWS[variant]
    draws = np.empty((count, len(points), 3))
    names = list(calibration.local.block.images.names)
    images = [names.index(name) for name in pair]
    for k in range(count):
        other, state = with_values(calibration, p.value[rows] + root @ rng.normal(size=len(rows)))
        drawn = pair_of(restitution_of(other), other, *pair)
        used = drawn.used if variant == "free" else absorbed_orientation(calibration, state).orientation.take(images)
        draws[k] = intersect(used, measured(drawn, points), points)[0] - points
    ratio = draws.var(axis=0, ddof=1) / predicted
    # 0.1 % of false alarms over all coordinates of all nodes
    share = 1e-3 / ratio.size / 2.0
    low, high = chi2.ppf([share, 1.0 - share], count - 1) / (count - 1)
    assert ((ratio > low) & (ratio < high)).all(), ratio
    assert np.sqrt(predicted[:, 2]).min() > 0.005


def test_sigma_of_the_normal_case_follows_its_parameters(calibration):
    """The mean change of orientation and its partials belong together: a finite change of the parameters."""
    rows = error_rows(calibration)
    value, sigma = calibration.local.parameters.value[rows], calibration.local.parameters.sigma[rows]
    restitution = restitution_of(calibration, "absorbed")
    model, _ = normal_model(calibration, restitution, 0.6)
    step = 0.2 * sigma * np.random.default_rng(8).normal(size=len(rows))
    ends = []
    for sign in (0.5, -0.5):
        _, state = with_values(calibration, value + sign * step)
        used = absorbed_orientation(calibration, state).orientation
        ends.append(normal_model(calibration, replace(restitution, used=used), 0.6)[0].used)
    expected = model.follows[0] @ step
    moved = (ends[0].centre - ends[1].centre)[0]
    turned = logarithm((ends[0].rotation @ np.swapaxes(ends[1].rotation, 1, 2))[:1])[0]
    np.testing.assert_allclose(moved, expected[:3], atol=0.02 * np.abs(expected[:3]).max())
    np.testing.assert_allclose(turned, expected[3:6], atol=0.02 * np.abs(expected[3:6]).max())
