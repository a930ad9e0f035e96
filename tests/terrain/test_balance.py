"""Gains and offsets of photographs that were made bright and dark on purpose, without any rendering."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from aerotri.rasters.grids import Grid
from aerotri.terrain.ortho.balance import balance_of, balanced, no_balance
from aerotri.terrain.ortho.candidates import Candidates

STRIPS, IN_STRIP, SIDE, NOISE = 3, 4, 160, 0.01
COUNT = STRIPS * IN_STRIP
ONE, STRIP, HALF = [2], [8, 9, 10, 11], [0, 2, 4, 6, 8, 10]


def seen_by(changed, gain, offset, spoilt=None) -> Candidates:
    """Ground in four of twelve photographs each, the nearest first; some photographs with another exposure.

    Parameters
    ----------
    spoilt : what happens to the colours (n, r, c) of the photographs before.
    """
    rng = np.random.default_rng(7)
    y, x = np.mgrid[:SIDE, :SIDE] / SIDE
    centre_y, centre_x = (v.ravel() for v in np.mgrid[:STRIPS, :IN_STRIP])
    centre_y, centre_x = (centre_y + 0.5) / STRIPS, (centre_x + 0.5) / IN_STRIP
    texture = gaussian_filter(rng.standard_normal((SIDE, SIDE)), 2.0)
    ground = 0.35 + 0.08 * texture / texture.std()
    colours = ground + rng.normal(0.0, NOISE, (COUNT, SIDE, SIDE))
    if spoilt is not None:
        spoilt(colours)
    colours[changed] = colours[changed] * gain + offset
    # photographs share more within a strip than across
    distance = np.hypot(2.0 * (y - centre_y[:, None, None]), x - centre_x[:, None, None])
    found = np.argsort(distance, axis=0)[:4]
    value = np.take_along_axis(colours, found, axis=0).clip(0.0, 1.0).astype(np.float32)
    cost = np.take_along_axis(distance, found, axis=0).astype(np.float32)
    return Candidates(
        Grid(SIDE, SIDE, 0.0, 0.0, 1.0, 1.0), 8, found.astype(np.int32), cost, cost, cost,
        np.repeat(value[:, None], 2, axis=1), np.full_like(cost, np.nan), np.zeros((SIDE, SIDE)),
    )  # fmt: skip


def bright_object(colours):
    """A bright bus in photograph 5 only, over nearly a fifth of what it shares with the next one."""
    colours[5, 60:95, 75:95] += 0.4


@pytest.mark.parametrize("spoilt", [None, bright_object])
@pytest.mark.parametrize("changed", [ONE, STRIP, HALF])
@pytest.mark.parametrize(("gain", "offset"), [(1.25, 0.03), (0.75, -0.02), (1.0, 0.06)])
def test_few_photographs_of_another_exposure_are_brought_to_the_others(changed, gain, offset, spoilt):
    candidates = seen_by(changed, gain, offset, spoilt)
    found = balance_of(COUNT, candidates)
    given, added = np.ones(COUNT), np.zeros(COUNT)
    given[changed], added[changed] = gain, offset
    # c = (c' − o)/g, known up to one gain and one offset for all
    for band in range(2):
        ratio = found.gain[:, band] * given
        np.testing.assert_allclose(ratio / ratio.mean(), 1.0, atol=0.02)
        assert np.ptp(found.offset[:, band] + found.gain[:, band] * added + ratio * 0.35) < 0.005
    assert found.after < 1.3 * np.sqrt(2.0) * NOISE
    assert len(found.off) == 0
    np.testing.assert_allclose(found.left, found.after, rtol=0.2)


def test_photographs_in_balance_stay_as_they_are():
    found = balance_of(COUNT, seen_by([], 1.0, 0.0))
    np.testing.assert_allclose(found.gain, 1.0, atol=0.01)
    np.testing.assert_allclose(found.gain * 0.35 + found.offset, 0.35, atol=0.001)


def test_an_object_counts_as_little_as_if_it_were_not_there():
    with_object, without = (balance_of(COUNT, seen_by(STRIP, 1.25, 0.0, spoilt)) for spoilt in (bright_object, None))
    np.testing.assert_allclose(with_object.gain, without.gain, atol=0.005)
    np.testing.assert_allclose(with_object.offset, without.offset, atol=0.003)


def shaded(colours):
    """Shadows of clouds over half of a photograph, and a cloud over much of the rest."""
    rng = np.random.default_rng(3)
    cloud = gaussian_filter(rng.standard_normal((SIDE, SIDE)), 8.0)
    colours[6] = np.where(cloud > 0.0, 0.4 * colours[6], 0.8 - 0.2 * colours[6])


@pytest.mark.parametrize("changed", [[], STRIP])
def test_a_photograph_that_no_gain_brings_to_the_others_is_named(changed):
    found = balance_of(COUNT, seen_by(changed, 1.25, 0.0, shaded))
    np.testing.assert_array_equal(found.off, [6])
    others = np.delete(found.gain[:, 0] * np.where(np.isin(np.arange(COUNT), changed), 1.25, 1.0), 6)
    np.testing.assert_allclose(others / others.mean(), 1.0, atol=0.03)


def test_without_balance_a_photograph_of_another_exposure_is_named():
    found = no_balance(COUNT, seen_by(ONE, 1.25, 0.03))
    np.testing.assert_array_equal(found.off, ONE)
    assert found.left[ONE[0]] == pytest.approx(1.4826 * (0.25 * 0.35 + 0.03), rel=0.2)


def test_photographs_without_common_ground_have_no_difference():
    alone = seen_by([], 1.0, 0.0)
    alone.found[1:], alone.value[1:] = -1, np.nan
    found = balance_of(COUNT, alone)
    assert np.isnan(found.left).all()
    assert len(found.off) == 0
    np.testing.assert_array_equal(balanced(alone, found), alone.value)
