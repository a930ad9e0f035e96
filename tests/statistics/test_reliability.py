"""Reliability by experiment: observations get an error of their own ∇0, the block is adjusted anew."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from aerotri.formats.results.reliability_columns import effect_names
from aerotri.pipeline import adjust
from aerotri.statistics.reliability import (
    control_reliability,
    critical_value,
    noncentrality,
    observation_reliability,
    ray_reliability,
    suspected_blunders,
)
from small_blocks import small_block

GNSS = {"sigma_m": [0.05, 0.05, 0.08], "shift_sigma_m": [0.2, 0.2, 0.2], "lever_arm_m": [0.2, -0.3, 1.1]}


@pytest.fixture(scope="module")
def block():
    return small_block(31, "bluh:1-2", gnss=GNSS)[0]


@pytest.fixture(scope="module")
def adjusted(block):
    return adjust(block)


def test_noncentrality():
    """Baarda's 4.13; the 4.0 of paper 002 has a power of 76 % at α = 0.1 %, not 93 %."""
    assert noncentrality(0.001, 0.80) == pytest.approx(4.132, abs=5e-4)
    assert critical_value(0.001) == pytest.approx(3.2905, abs=5e-5)
    assert norm.cdf(4.0 - critical_value(0.001)) == pytest.approx(0.76, abs=5e-3)


def test_numbers_follow_from_the_redundancy(adjusted):
    numbers, rays = ray_reliability(adjusted), adjusted.rays
    k = np.flatnonzero(rays.r[:, 0] > 0.1)[7]
    r, sigma = rays.r[k, 0], adjusted.block.image_points.sigma[k, 0]
    assert numbers.detectable[k, 0] == pytest.approx(4.132 * sigma / np.sqrt(r), rel=1e-4)
    assert numbers.external[k, 0] == pytest.approx(4.132 * np.sqrt((1.0 - r) / r), rel=1e-4)
    assert numbers.tau[k, 0] == pytest.approx(rays.w[k, 0] / adjusted.outcome.sigma0)


def values_by_name(result):
    """Value and a-priori σ of every unknown, by the names that the effects use."""
    s0, block, out = result.outcome.sigma0, result.block, {}
    for k, name in enumerate(block.points):
        for axis, letter in enumerate("XYZ"):
            out[f"{letter} of point {name}"] = result.points.xyz[k, axis], result.points.sigma[k, axis] / s0
    orientation = np.concatenate([result.images.centre, result.images.angles], axis=1)
    for k, name in enumerate(block.images.names):
        for e, element in enumerate(("X0", "Y0", "Z0", "omega", "phi", "kappa")):
            out[f"{element} of photo {name}"] = orientation[k, e], result.images.sigma[k, e] / s0
    p = result.parameters
    for k, name in enumerate(p.names):
        out[f"{name} ({p.groups[k]})"] = p.value[k], p.sigma[k] / s0
    return out


def effect_of(block, adjusted, changed):
    """Changes over σ of all unknowns between two adjustments."""
    before, after = values_by_name(adjusted), values_by_name(adjust(changed))
    return {name: abs(after[name][0] - value) / sigma for name, (value, sigma) in before.items() if sigma > 0.0}


def test_effect_of_an_undetected_error_in_a_ray(block, adjusted):
    """The unknown named changes by the effect stated, and no other that the ray depends on by more."""
    rays, mde = block.image_points, ray_reliability(adjusted).detectable
    names = [effect_names(adjusted, adjusted.effects, axis).to_pylist() for axis in (0, 1)]
    size = adjusted.effects.size
    chosen = [int(np.nanargmax(np.where(mde[:, axis] < 0.03, size[:, axis], np.nan))) for axis in (0, 1)]
    for axis, k in enumerate(chosen):
        xy = rays.xy.copy()
        xy[k, axis] += mde[k, axis]
        effects = effect_of(block, adjusted, replace(block, image_points=replace(rays, xy=xy)))
        size, name = adjusted.effects.size[k, axis], names[axis][k]
        assert effects[name] == pytest.approx(size, rel=0.02)
        point, photo = block.points[rays.point[k]], block.images.names[rays.image[k]]
        own = [e for n, e in effects.items() if n.endswith((f"point {point}", f"photo {photo}")) or "bluh" in n]
        assert max(own) < 1.02 * size
        assert size <= ray_reliability(adjusted).external[k, axis]


def test_effect_of_an_undetected_error_in_control(block, adjusted):
    """The given coordinate itself suffers most, by δ̄0."""
    numbers = control_reliability(adjusted)
    given = {int(point): row for row, point in enumerate(block.control.point)}
    point = int(adjusted.control.point[2])
    xyz = block.control.xyz.copy()
    xyz[given[point], 2] += numbers.detectable[2, 2]
    changed = replace(block, control=replace(block.control, xyz=xyz))
    effects = effect_of(block, adjusted, changed)
    assert effects[f"Z of point {block.points[point]}"] == pytest.approx(numbers.external[2, 2], rel=0.01)


def test_effect_of_an_undetected_error_in_a_position(block, adjusted):
    observations, numbers = adjusted.observations, observation_reliability(adjusted)
    row = int(np.flatnonzero((observations.label == block.images.names[4]) & (observations.component == "Y"))[0])
    xyz = block.gnss_ins.xyz.copy()
    xyz[4, 1] += numbers.detectable[row]
    effects = effect_of(block, adjusted, replace(block, gnss_ins=replace(block.gnss_ins, xyz=xyz)))
    assert effects[observations.effect_on[row]] == pytest.approx(observations.effect[row], rel=0.01)
    assert observations.effect[row] <= numbers.external[row]


def test_suspects_are_listed_with_their_estimated_error(block, adjusted):
    """A ray and a control point, 60 σ off each: both lead the list, each with its size."""
    rays, xy, xyz = block.image_points, block.image_points.xy.copy(), block.control.xyz.copy()
    often = np.bincount(rays.point)[rays.point]
    k = int(np.argmax(np.where(np.isin(rays.point, block.control.point), 0, often)))
    row = int(np.flatnonzero(~block.control.is_check)[0])
    xy[k, 1] -= 60.0 * rays.sigma[k, 1]
    xyz[row, 0] += 60.0 * block.control.sigma[row, 0]
    foul = replace(block, image_points=replace(rays, xy=xy), control=replace(block.control, xyz=xyz))
    result = adjust(foul)
    found = suspected_blunders(result.block, result.rays, result.control)
    of_ray = next(b for b in found if b.image == block.images.names[rays.image[k]])
    assert of_ray.point == block.points[rays.point[k]]
    assert of_ray.estimated_mm == pytest.approx(-60.0 * rays.sigma[k, 1], rel=0.1)
    of_control = next(b for b in found if b.image == "")
    assert of_control.point == block.points[block.control.point[row]]
    assert of_control.estimated_mm == pytest.approx(60e3 * block.control.sigma[row, 0], rel=0.15)
    assert {b.action for b in found} == {"kept"}
