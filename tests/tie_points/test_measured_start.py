"""Blocks of any geometry started from their measured points alone: the result is that from the true orientations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aerotri.adjustment.prepare import NoStartValuesError
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations import Prior
from aerotri.pipeline import AdjustmentFailedError, adjust
from aerotri.pipeline.starting import with_start
from aerotri.tie_points.measured_start import misses, start_from_points
from free_geometry import (
    FOCAL_MM,
    block_of,
    circle,
    cross_strips,
    facade,
    facade_east,
    oblique,
    rotations,
    with_orientations,
)
from small_blocks import small_block, with_adjustment

SCENES = {scene.__name__: scene for scene in (circle, facade, facade_east, oblique, cross_strips)}
SAME = 1e-6
"""Share of σ within which two results are the same."""


def simulated(scene, seed=1, **known):
    """The block without orientations, and the same block with the true ones."""
    rng = np.random.default_rng(seed)
    block, centre, angles = block_of(scene(rng), rng, **known)
    return block, with_adjustment(with_orientations(block, centre, angles), start="auto")


def assert_same_result(found, expected):
    """Centres, attitudes and points, each by its own σ."""
    assert found.outcome.status == expected.outcome.status == "converged"
    assert np.isfinite(expected.images.sigma[:, :3]).all()
    assert (np.abs(found.images.centre - expected.images.centre) <= SAME * expected.images.sigma[:, :3]).all()
    same = [rotation_from_angles(result.images.angles, result.block.rotation) for result in (found, expected)]
    assert np.abs(same[0] - same[1]).max() <= SAME * expected.images.sigma[:, 3:].max()
    there = np.isfinite(expected.points.xyz)
    assert (there == np.isfinite(found.points.xyz)).all()
    off = np.abs(found.points.xyz - expected.points.xyz)[there]
    assert (off <= SAME * expected.points.sigma[there]).all()


@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_result_is_that_from_the_truth(scene):
    block, oriented = simulated(scene, start="points")
    found = adjust(block)
    assert_same_result(found, adjust(oriented))
    assert any("start values from the tie points alone" in said for said in found.outcome.warnings)
    assert found.outcome.verdict == "accepted"


@pytest.mark.parametrize("scene", [circle, facade], ids=["circle", "facade"])
def test_auto_sees_that_strips_do_not_hold(scene):
    block, oriented = simulated(scene)
    assert_same_result(adjust(block), adjust(oriented))
    with pytest.raises((NoStartValuesError, AssertionError, AdjustmentFailedError)):
        assert_same_result(adjust(with_adjustment(block, start="strips")), adjust(oriented))


def test_auto_keeps_strips_where_they_hold():
    """Vertical strips with positions: the quick way, and nothing is said."""
    block, _ = small_block(3, gnss={"sigma_m": [0.05, 0.05, 0.08]}, start_values={"kind": "none"})
    started = with_start(block)
    assert not started.messages
    assert np.isfinite(started.block.images.angles).all()


def test_given_orientations_are_left_alone_unless_points_are_asked_for():
    _, oriented = simulated(circle)
    assert with_start(oriented).block is oriented
    wrong = replace(oriented.images, angles=oriented.images.angles + 0.3)
    started = with_start(with_adjustment(replace(oriented, images=wrong), start="points"))
    np.testing.assert_allclose(started.block.images.centre, oriented.images.centre, atol=0.1)
    assert started.block.settings.adjustment.start == "auto"
    assert with_start(started.block).block is started.block


@pytest.mark.parametrize("factor", [0.6, 1.6])
@pytest.mark.parametrize("scene", [circle, facade], ids=["circle", "facade"])
def test_unknown_principal_distance(scene, factor):
    """Stated 40 % too short and 60 % too long."""
    block, oriented = simulated(scene, stated=Prior(factor * FOCAL_MM))
    started = with_start(block).block
    assert started.cameras[0].focal_length_mm == pytest.approx(FOCAL_MM, rel=0.02)
    found = adjust(block)
    true = replace(oriented, cameras=started.cameras)
    assert_same_result(found, adjust(true))
    assert any("principal distance of cam" in said for said in found.outcome.warnings)


def test_stated_principal_distance_that_is_observed_is_kept():
    """What is observed is an observation, whatever the photographs alone give."""
    observed = Prior(1.02 * FOCAL_MM, 0.5)
    block, _ = simulated(circle, stated=observed)
    assert with_start(block).block.cameras[0].interior["focal_length_mm"] == observed


def test_unknown_lens():
    """K1 moves the corners by 30 pixels."""
    brown = (("brown", ("K1", "K2")),)
    block, oriented = simulated(circle, k1=-0.08, additional_parameters=brown)
    assert_same_result(adjust(block), adjust(oriented))


def test_control_alone():
    block, oriented = simulated(facade, gnss_m=None, control=6)
    assert_same_result(adjust(block), adjust(oriented))


def test_neither_positions_nor_control():
    """A free network in a frame of its own: shape and fit are those from the truth; without a datum it is refused."""
    block, oriented = simulated(circle, gnss_m=None, datum="inner")
    found, expected = adjust(block), adjust(oriented)
    assert found.outcome.vtpv == pytest.approx(expected.outcome.vtpv, rel=1e-9)
    apart = [np.linalg.norm(r.images.centre - r.images.centre[0], axis=1) for r in (found, expected)]
    ratio = apart[0][1:] / apart[1][1:]
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-6)
    with pytest.raises(AdjustmentFailedError, match='datum = "minimal" or "inner"'):
        adjust(with_adjustment(block, datum="control"))


def test_two_groups_without_a_common_point():
    """Each is placed by its own positions; one that has none is left out and counted, not put beside the other."""
    block, oriented = simulated(facade, seed=4)
    rays, gnss, true = block.image_points, block.gnss_ins, oriented.images.centre
    second = rays.image >= 9
    names = np.concatenate([block.points, [f"{name}b" for name in block.points]])
    point = np.where(second, rays.point + len(block.points), rays.point)
    apart = replace(block, points=names, image_points=replace(rays, point=point))
    np.testing.assert_allclose(start_from_points(apart).centre, true, atol=0.3)
    first = replace(gnss, **{name: getattr(gnss, name)[:9] for name in gnss.__dataclass_fields__})
    half = start_from_points(replace(apart, gnss_ins=first))
    np.testing.assert_allclose(half.centre[:9], true[:9], atol=0.3)
    assert np.isnan(half.centre[9:]).all()
    assert "9 of 18 photographs" in half.messages[0]


def test_gross_errors_do_not_spoil_it():
    """One ray in twenty is anywhere in the photograph."""
    block, oriented = simulated(circle)
    rays, rng = block.image_points, np.random.default_rng(8)
    wrong = rng.choice(len(rays), len(rays) // 20, replace=False)
    xy = rays.xy.copy()
    xy[wrong] = rng.uniform(-5.0, 5.0, (len(wrong), 2))
    found = start_from_points(replace(block, image_points=replace(rays, xy=xy)))
    np.testing.assert_allclose(found.centre, oriented.images.centre, atol=0.1)
    assert 0.85 < found.fitting[0] / found.fitting[1] < 0.97


def test_shuffled_names_never_look_right():
    """Names of points at random: the photographs do not fit one another, and that is said."""
    block, _ = simulated(circle)
    rays, rng = block.image_points, np.random.default_rng(9)
    point = rays.point.copy()
    for image in range(16):
        own = np.flatnonzero(rays.image == image)
        point[own] = rng.permutation(rays.point[own])
    with pytest.raises(NoStartValuesError, match="tie points alone"):
        adjust(replace(block, image_points=replace(rays, point=point)))


def test_mirrored_image_points_are_named():
    """Vertical photographs with y turned round fit as well as right ones, but look up; control does not fit."""
    block, _ = simulated(cross_strips, start="points")
    xy = block.image_points.xy * [1.0, -1.0]
    mirrored = replace(block, image_points=replace(block.image_points, xy=xy))
    assert "they look up" in start_from_points(mirrored).messages[0]
    assert "they look up" not in start_from_points(block).messages[0]


def test_start_repeats_bit_for_bit():
    block, _ = simulated(circle)
    one, other = start_from_points(block), start_from_points(block)
    np.testing.assert_array_equal(one.centre, other.centre)
    np.testing.assert_array_equal(one.rotation, other.rotation)


def test_misses_at_the_truth_are_the_noise():
    """In tolerances, here pixels: two coordinates of a fifth of a pixel, and ∞ behind the camera."""
    rng = np.random.default_rng(1)
    scene = circle(rng)
    block, centre, _ = block_of(scene, rng)
    miss = misses(block, centre, rotations(scene))
    assert 0.15 < np.median(miss) < 0.3
    assert miss.max() < 1.5
    turned = rotations(scene) @ np.diag([1.0, -1.0, -1.0])
    assert not (misses(block, centre, turned) < 4.0).any()
