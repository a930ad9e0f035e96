"""The difference of two surfaces of one adjustment: against dense algebra, and its σ against scatter."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
import shapely
from scipy.stats import chi2

from aerotri.statistics.camera_field import noise_beside_field
from aerotri.volume.accuracy import volume_sigma
from aerotri.volume.bases import level
from aerotri.volume.boundary import boundary_of
from aerotri.volume.functionals import tin_volume, triangulated
from aerotri.volume.parts import Measured, Part, part_of_pickets
from aerotri.volume.pickets import pickets_where_seen
from aerotri.volume.response import respond
from aerotri.volume.roughness import Between
from aerotri.volume.settings import SigmaOptions
from aerotri.volume.shared import adjustment_key, both_between, difference_part, places_apart, same_adjustment
from places import PROJECT

RUNS = 12


@pytest.fixture(scope="module")
def proof():
    """The modules of the tool."""
    import importlib

    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(PROJECT / "tools" / "prove"))
        yield importlib.import_module("volume_proof.simulated")


def part_of(calibration, pickets, boundary):
    """The share of a TIN, the ground between its corners left out."""
    gradient = tin_volume(pickets.xyz, triangulated(pickets.xyz), boundary)[1].gradient
    response = respond(calibration, pickets, gradient)
    return Part(calibration, response, None, len(pickets), len(pickets.image), 0.0, Measured(pickets, gradient))


def test_the_joint_functional_is_the_difference_of_both(calibration, hill):
    """Half of the pickets in common: Var = Var' + Var'' − 2·Cov, the noise of common pickets by their difference."""
    pickets, _, boundary = hill
    one, other = (part_of(calibration, pickets.take(np.arange(a, b)), boundary) for a, b in ((0, 300), (100, 400)))
    joint, common = difference_part(one, other, True)
    first, second = one.response, other.response
    s0 = noise_beside_field(calibration)
    expected = first.variance + second.variance - 2.0 * s0**2 * first.unknowns @ second.solved
    assert joint.response.variance == pytest.approx(expected, rel=1e-6)
    assert joint.response.variance < 0.2 * min(first.variance, second.variance)
    assert len(joint.measured.pickets) == 400
    np.testing.assert_allclose(joint.response.unknowns, first.unknowns - second.unknowns, atol=1e-9)
    # by hand: the gradients side by side over all pickets
    g = np.zeros((400, 3))
    g[:300] += one.measured.gradient
    g[100:] -= other.measured.gradient
    assert joint.response.noise == pytest.approx(respond(calibration, pickets, g).noise, rel=1e-9)
    assert 0.2 < common < 0.9


def test_a_surface_less_itself_is_nothing(calibration, hill):
    pickets, triangles, boundary = hill
    part = part_of_pickets(calibration, pickets, triangles, boundary, None, SigmaOptions())
    shuffled = pickets.take(np.random.default_rng(3).permutation(len(pickets)))
    again = part_of_pickets(calibration, shuffled, triangulated(shuffled.xyz), boundary, None, SigmaOptions())
    assert same_adjustment(part, again)
    surface: object = None
    sigma = volume_sigma(surface, level(0.0), boundary, part, again, SigmaOptions())
    alone = volume_sigma(surface, level(0.0), boundary, part, None, SigmaOptions())
    assert alone.total > 100.0
    assert sigma.total < 1e-6 * alone.total


def test_another_adjustment_has_another_key(calibration):
    moved = replace(calibration.solution.state, points=calibration.solution.state.points + 1e-9)
    other = replace(calibration, solution=replace(calibration.solution, state=moved))
    assert adjustment_key(calibration) == adjustment_key(replace(calibration))
    assert adjustment_key(calibration) != adjustment_key(other)


@pytest.mark.parametrize("noisy", [False, True])
def test_sigma_of_the_difference_is_its_scatter(proof, noisy):
    """Two surfaces measured in one adjustment, at other places; Σz² in the 99.9 % band of χ².

    Without noise of the pickets the adjustment's part stands alone.
    """
    on = frozenset(["adjustment", "matching"] if noisy else ["adjustment"])
    z = []
    for seed in range(1, RUNS + 1):
        rng = np.random.default_rng([seed, 5])
        calibration, truth = adjusted(proof, seed)
        middle = np.median(truth.centre[:, :2], axis=0)
        boundary = boundary_of(shapely.Point(*middle).buffer(60.0), "circle")
        errors, parts = [], []
        for height in (115.0, 100.0):
            true = np.column_stack([middle + rng.uniform(-90.0, 90.0, (300, 2)), np.full(300, height)])
            chosen, seen = pickets_where_seen(calibration, true, 1e-3 * proof.MATCHING_UM)
            assert seen.all()
            found = proof.measured_pickets(calibration, truth, chosen, rng, on)
            parts.append(part_of(calibration, replace(chosen, xyz=found), boundary))
            errors.append(tin_volume(found, triangulated(true), boundary)[0] - height * boundary.area)
        surface: object = None
        sigma = volume_sigma(surface, level(0.0), boundary, *parts, SigmaOptions())
        z.append((errors[0] - errors[1]) / (sigma.total if noisy else sigma.parts["adjustment"]))
        # without the cancelling σ would be that of the datum
        assert sigma.parts["adjustment"] < 0.2 * np.sqrt(parts[0].response.variance)
    low, high = chi2.ppf([0.0005, 0.9995], RUNS)
    assert low < np.sum(np.square(z)) < high


@cache
def adjusted(proof, seed):
    """Once for both tests."""
    return proof.adjusted_block(seed)


def test_ground_of_a_base_is_added_to_a_side_and_taken_off_the_net_volume():
    upper, lower = Between(3.0, 1.0), Between(2.0, 4.0)
    assert both_between([(upper, 1.0), (lower, 1.0)], False) == Between(1.0, 5.0)
    assert both_between([(upper, 1.0), (lower, 1.0)], True) == Between(5.0, 5.0)
    assert both_between([(upper, 1.0), (None, 1.0)], True) == upper
    assert both_between([(None, 1.0), (None, 1.0)], False) is None


def test_how_far_points_of_a_base_lie_apart():
    """Nothing at the same places; about one where they lie independently."""

    def points(xy):
        measured = SimpleNamespace(pickets=SimpleNamespace(xyz=np.column_stack([xy, xy[:, 0]])),
                                   gradient=np.ones((len(xy), 3)))  # fmt: skip
        return SimpleNamespace(measured=measured)

    lattice = np.stack(np.meshgrid(np.arange(40.0), np.arange(40.0)), axis=-1).reshape(-1, 2)
    elsewhere = np.random.default_rng(1).uniform(0.0, 39.0, (2000, 2))
    assert places_apart(points(lattice), points(lattice)) == 0.0
    assert places_apart(points(lattice), points(elsewhere)) == pytest.approx(1.0, abs=0.1)
    assert places_apart(points(lattice), points(lattice + 0.1)) < 0.2
