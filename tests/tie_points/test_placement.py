"""A first orientation on control points or positions, some of them wrong by any amount: those that agree decide."""

from __future__ import annotations

import numpy as np
import pytest

from aerotri.conventions import InputError
from aerotri.functional_model.rotation import exponential
from aerotri.tie_points.georeferencing import AGREES, place


def points_of(rng, count, flat=0.1, width=1.0):
    """Points in a frame of their own, and where they truly are; the mean view, which is down there."""
    target = rng.uniform(-1.0, 1.0, (count, 3)) * [100.0, 100.0 * width, 100.0 * flat]
    turn = exponential(rng.normal(0.0, 1.5, 3))
    scale = float(np.exp(rng.uniform(-6.0, 6.0)))
    shift = rng.normal(0.0, 5e3, 3)
    source = (target - shift) @ turn / scale
    tilt = exponential(rng.normal(0.0, 0.2, 3))
    return source, target, turn.T @ tilt @ [0.0, 0.0, -1.0], (scale, turn)


SIZES = (10.0, 50.0, 1e3, 1e6)
"""m, by which coordinates are wrong, beside a σ of 2 cm; less than some metres may be a bent first orientation."""


@pytest.mark.parametrize("seed", range(20))
def test_the_wrong_ones_are_named_whatever_their_size(seed):
    """Fewer than half are wrong: they alone are not used, and scale and rotation are those without them."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(4, 12))
    source, target, looking, (scale, turn) = points_of(rng, count)
    sigma = np.full((count, 3), [0.02, 0.02, 0.03])
    noisy = target + rng.normal(0.0, 1.0, target.shape) * sigma
    wrong = rng.choice(count, int(rng.integers(1, (count - 2) // 2 + 1)), replace=False)
    away = rng.normal(0.0, 1.0, (len(wrong), 3))
    noisy[wrong] += away / np.linalg.norm(away, axis=1)[:, None] * rng.choice(SIZES, len(wrong))[:, None]
    found = place(source, noisy, sigma, looking)
    assert found.fits
    assert np.flatnonzero(~found.used).tolist() == sorted(wrong.tolist())
    assert found.scale == pytest.approx(scale, rel=2e-3)
    assert np.abs(found.rotation - turn).max() < 5e-3


@pytest.mark.parametrize("share", [0.2, 0.45, 0.6])
def test_hundreds_of_positions(share):
    """GNSS of metres: wrong ones, also more than half where they are wrong each in another way."""
    rng = np.random.default_rng(4)
    source, target, looking, (scale, turn) = points_of(rng, 300, flat=0.02)
    noisy = target + rng.normal(0.0, 1.0, target.shape) * [2.0, 2.0, 4.0]
    wrong = rng.random(300) < share
    noisy[wrong] += rng.normal(0.0, 200.0, (int(wrong.sum()), 3))
    found = place(source, noisy, np.full((300, 3), [2.0, 2.0, 4.0]), looking)
    assert found.scale == pytest.approx(scale, rel=2e-2)
    assert np.abs(found.rotation - turn).max() < 3e-2
    assert found.used[~wrong].mean() > 0.97
    assert found.used[wrong].mean() < 0.1


@pytest.mark.parametrize("factor", [0.1, 0.3, 1.0, 3.0, 10.0])
def test_a_sigma_that_is_not_right(factor):
    """Stated ten times too small or too large: the point that is 60 m off stays out and moves nothing."""
    rng = np.random.default_rng(8)
    source, target, looking, (scale, turn) = points_of(rng, 6)
    noisy = target + rng.normal(0.0, 0.3, target.shape)
    noisy[2] += [0.0, 60.0, 0.0]
    found = place(source, noisy, np.full(6, 0.3 * factor), looking)
    assert found.fits
    assert np.flatnonzero(~found.used).tolist() == [2]
    assert found.scale == pytest.approx(scale, rel=2e-2)
    assert np.abs(found.rotation - turn).max() < 3e-2


def test_a_bent_orientation_is_no_wrong_point():
    """Two per cent of bowl against control of 2 cm: all of it is used, and the bend is said."""
    rng = np.random.default_rng(2)
    source, target, looking, _ = points_of(rng, 9)
    bowl = 2.0 * np.square(target[:, :2] / 100.0).sum(axis=1)
    found = place(source, target + np.outer(bowl, [0.0, 0.0, 1.0]), np.full(9, 0.02), looking)
    assert found.fits
    assert found.used.all()
    assert 1e-3 < found.bend < 0.032


@pytest.mark.parametrize("count", [3, 4, 6])
def test_points_that_do_not_belong_do_not_fit(count):
    """A list of another place or in another order: nothing agrees, and that is said, not averaged."""
    rng = np.random.default_rng(count)
    source, target, looking, _ = points_of(rng, count)
    other = rng.permutation(target) if count > 3 else rng.uniform(-100.0, 100.0, (3, 3)) * [1.0, 1.0, 0.1]
    found = place(source, other, np.full(count, 0.1), looking)
    assert not found.fits


@pytest.mark.parametrize("seed", range(6))
def test_points_nearly_on_a_line_do_not_turn_the_block_over(seed):
    """As wide as their σ: either side of the line may be up for them, and the view decides."""
    rng = np.random.default_rng(seed)
    source, target, looking, (_, turn) = points_of(rng, 6, flat=0.002, width=0.01)
    found = place(source, target + rng.normal(0.0, 1.0, target.shape), np.full(6, 1.0), looking)
    assert (found.rotation @ looking)[2] < -0.85
    assert np.degrees(np.arccos((np.trace(found.rotation.T @ turn) - 1.0) / 2.0)) < 35.0


def test_a_strip_with_wrong_positions():
    """Points on a line of which two are wrong beside it: the line of the others, the roll by the view."""
    rng = np.random.default_rng(3)
    source, target, looking, (scale, _) = points_of(rng, 10, flat=1e-5, width=1e-5)
    noisy = target + rng.normal(0.0, 0.05, target.shape)
    noisy[[2, 7]] += [[3.0, 40.0, 5.0], [0.0, -25.0, 60.0]]
    found = place(source, noisy, np.full(10, 0.05), looking)
    assert np.flatnonzero(~found.used).tolist() == [2, 7]
    assert found.scale == pytest.approx(scale, rel=1e-2)
    assert (found.rotation @ looking)[2] < -0.95


@pytest.mark.parametrize("seed", range(5))
def test_it_ends_no_worse_than_the_best_triple(seed):
    """Least squares of all that agree may not leave them: as many as the best three had, or more."""
    rng = np.random.default_rng(seed)
    source, target, looking, _ = points_of(rng, 8)
    noisy = target + rng.normal(0.0, 30.0, target.shape)
    right = rng.choice(8, 4, replace=False)
    noisy[right] = target[right] + rng.normal(0.0, 0.02, (4, 3))
    found = place(source, noisy, np.full(8, 0.05), looking)
    assert found.used[right].all()
    assert not found.agreed
    assert (found.relative < AGREES).sum() == found.used.sum()


def test_sigma_of_each_axis_counts():
    """Heights ten times worse than the plan: the plan decides where heights contradict it."""
    rng = np.random.default_rng(1)
    source, target, looking, (scale, _) = points_of(rng, 5)
    noisy = target + rng.normal(0.0, 1.0, target.shape) * [0.02, 0.02, 5.0]
    found = place(source, noisy, np.full((5, 3), [0.02, 0.02, 5.0]), looking)
    assert found.used.all()
    assert found.scale == pytest.approx(scale, rel=3e-3)


def test_all_at_one_place():
    with pytest.raises(InputError, match="at one place"):
        place(
            np.random.default_rng(1).normal(0.0, 1.0, (4, 3)), np.zeros((4, 3)), np.full(4, 0.1), np.array([0, 0, -1.0])
        )
