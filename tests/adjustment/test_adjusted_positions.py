"""Parameters evaluated at the adjusted image points: without the bias that the noise brings at the measured ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aerotri.adjustment.adjusted_positions import acts_by_position, at_adjusted_positions
from aerotri.adjustment.prepare import prepare
from aerotri.formats.block.folder import read_block, write_block
from aerotri.formats.results.solution import read_solution, write_solution
from aerotri.functional_model.additional_parameters import brown
from aerotri.observations import Prior
from aerotri.pipeline import adjust, adjust_keeping_system, reopen
from aerotri.pipeline.local import DETERMINED_BY_NOISE
from small_blocks import LONG_FLIGHT, small_block, with_adjustment, with_gross_errors

SETS = ["brown:K1+P1", "bluh:1-12", "legendre:3x3", "lens:k1+k2"]
FLAT = {"terrain": {"kind": "undulating", "height_m": 100.0, "relief_rms_m": 3.0, "wavelength_m": 900.0}}


@pytest.mark.parametrize("parameters", SETS)
def test_positions_are_those_of_the_adjusted_image_points(parameters):
    found = adjust_keeping_system(small_block(2, parameters)[0])
    rays = found.system.unknowns.rays
    if parameters.startswith("lens"):
        assert not acts_by_position(found.system)
        np.testing.assert_array_equal(rays.at, rays.xy)
        return
    adjusted = rays.xy - found.solution.equations.residual
    assert np.abs(rays.at - rays.xy).max() > 1e-3
    np.testing.assert_allclose(rays.at, adjusted, atol=1e-6)
    again = at_adjusted_positions(found.system, found.solution.state, found.solution.estimator)
    np.testing.assert_array_equal(again.unknowns.rays.at, rays.at)


def test_without_noise_both_are_the_same():
    spec = {"tie_points": {"per_image": 60, "probability": 0.9, "sigma_um": 0.001}}
    block = small_block(3, "brown:K1+P1", **spec)[0]
    adjusted, measured = adjust(block), adjust(with_adjustment(block, parameter_position="measured"))
    difference = (adjusted.parameters.value - measured.parameters.value) / adjusted.parameters.sigma
    assert np.abs(difference).max() < 0.02


def noisy(seed: int, position: str):
    """A camera without distortion, its principal distance free over nearly flat ground, noise of 60 µm."""
    noise = {"tie_points": {"per_image": 60, "probability": 0.9, "sigma_um": 60.0}}
    block = small_block(seed, "brown:K1+K2+K3", **noise, **FLAT)[0]
    camera = block.cameras[0]
    interior = {**camera.interior, "focal_length_mm": Prior(camera.focal_length_mm)}
    block = replace(block, cameras=(replace(camera, interior=interior),))
    return adjust(with_adjustment(block, parameter_position=position, model_part="off"))


def predicted_bias(result) -> np.ndarray:
    """[D] Q·Σ B′·r of the shared parameters: a residual holds the share r of its own error, the pattern B′ of it."""
    p, rays, used = result.parameters, result.block.image_points, np.isfinite(result.rays.r).all(axis=1)
    h, x, y = 1e-4, *(rays.xy[used] - result.block.cameras[0].principal_point_mm).T
    by_x = (brown.basis(x + h, y) - brown.basis(x - h, y))[:, 0] / (2.0 * h)
    by_y = (brown.basis(x, y + h) - brown.basis(x, y - h))[:, 1] / (2.0 * h)
    r = result.rays.r[used]
    divergence = r[:, 0] @ by_x + r[:, 1] @ by_y
    gradient = np.zeros(len(p))
    for item, value in zip(brown.ITEMS, divergence, strict=True):
        gradient[p.names == f"brown.{item}"] = value
    return p.covariance / result.outcome.sigma0**2 @ gradient


def test_the_bias_of_parameters_at_the_measured_points_is_the_one_predicted():
    """And there is none at the adjusted ones: the difference of the two is all of it."""
    found, expected = [], []
    for seed in range(1, 6):
        adjusted, measured = noisy(seed, "adjusted"), noisy(seed, "measured")
        found.append((measured.parameters.value - adjusted.parameters.value) / adjusted.parameters.sigma)
        expected.append(predicted_bias(adjusted) / adjusted.parameters.sigma)
    bias, theory = np.mean(found, axis=0), np.mean(expected, axis=0)
    own = np.char.startswith(adjusted.parameters.names.astype(str), "brown.")
    assert np.abs(theory[own]).min() > 0.3
    np.testing.assert_allclose(bias[own], theory[own], rtol=0.25)


def test_the_setting_measured_leaves_them_there():
    block = with_adjustment(small_block(4, "brown:K1+P1")[0], parameter_position="measured")
    rays = adjust_keeping_system(block).system.unknowns.rays
    np.testing.assert_array_equal(rays.at, rays.xy)
    assert not acts_by_position(prepare(block).system)


def test_parameters_determined_by_noise_alone_stay_there_and_are_named():
    """Free nodes of a grid can turn and shift the photograph, which the orientation does as well."""
    result = adjust(small_block(6, "grid:5x4")[0])
    assert DETERMINED_BY_NOISE in result.outcome.warnings
    assert result.block.settings.adjustment.parameter_position == "measured"


def test_a_result_reopens_at_the_same_positions(tmp_path):
    found = adjust_keeping_system(small_block(5, "brown:K1+K2+P1,legendre:2x2")[0])
    write_block(found.result.block, tmp_path / "block")
    write_solution(tmp_path / "solution.npz", found.system, found.solution, found.local)
    again = reopen(read_block(tmp_path / "block"), read_solution(tmp_path / "solution.npz"))
    np.testing.assert_allclose(again.system.unknowns.rays.at, found.system.unknowns.rays.at, atol=1e-9)
    assert again.result.outcome.sigma0 == pytest.approx(found.result.outcome.sigma0, rel=1e-9)


@pytest.mark.parametrize(("robust", "more"), [("huber", 2), ("adaptive", 5)])
def test_a_robust_adjustment_converges_once(robust, more):
    """The positions move its minimum: before they are known it only has to come near, and goes on from there."""
    block = with_gross_errors(small_block(5, "brown:K1+P1", flight=LONG_FLIGHT)[0], 200)
    adjusted, measured = (
        adjust(with_adjustment(block, robust=robust, parameter_position=position, model_part="off")).outcome
        for position in ("adjusted", "measured")
    )
    assert adjusted.status == measured.status == "converged"
    assert adjusted.iterations <= measured.iterations + more
