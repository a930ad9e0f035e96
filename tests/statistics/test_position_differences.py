"""Adjusted against given positions: order, lever arm, offset and drift."""

from dataclasses import replace

import numpy as np
import pytest

from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations.block import GnssIns
from aerotri.report.tables.photographs import positions_table
from aerotri.statistics.position_differences import position_differences
from synthetic import make_adjusted_block


def observed(adjusted, rows, xyz, time, lever=(0.0, 0.0, 0.0)):
    none = np.full((len(rows), 3), np.nan)
    gnss = GnssIns(rows, xyz, np.full((len(rows), 3), 0.05), none, none, time)
    settings = replace(adjusted.block.settings, gnss=replace(adjusted.block.settings.gnss, lever_arm_m=lever))
    return replace(adjusted, block=replace(adjusted.block, gnss_ins=gnss, settings=settings))


@pytest.fixture(scope="module")
def plain():
    return make_adjusted_block(3, 8, 200)


def test_offset_and_drift(plain):
    """A shift, and 6 mm a minute in Z: both found, with the lever arm taken out."""
    n, lever = len(plain.block.images), (0.3, -0.2, 1.5)
    rows = np.random.default_rng(1).permutation(n)
    time = 1000.0 + 4.0 * rows
    antenna = plain.images.centre + rotation_from_angles(plain.images.angles) @ np.array(lever)
    drift = 0.006 / 60.0 * (time - time.mean())
    given = antenna[rows] - np.array([0.10, -0.05, 0.02]) - np.column_stack([0 * drift, 0 * drift, drift])
    adjusted = observed(plain, rows, given, time, lever)
    found = position_differences(adjusted)
    assert found.image.tolist() == list(range(n))
    assert np.all(np.diff(found.time) > 0)
    assert found.offset[0] == pytest.approx([0.10, -0.05, 0.02], abs=1e-9)
    assert found.drift[0] == pytest.approx([0.0, 0.0, 0.006], abs=1e-8)
    table = positions_table(found, adjusted)
    assert table.rows[0][2] == pytest.approx(0.10)
    assert table.rows[2][6] == pytest.approx(6.0, abs=1e-4)
    assert table.rows[1][5] == pytest.approx(0.05)


def test_strip_by_strip_without_times(plain):
    """The second strip first in the table of positions: it stands first, and there is no drift."""
    rows = np.concatenate([np.arange(8, 16), np.arange(8)])
    given = plain.images.centre[rows].copy()
    given[3, 2] = np.nan
    time = np.arange(16.0)
    time[5] = np.nan
    found = position_differences(observed(plain, rows, given, time))
    assert found.time is None
    assert found.image.tolist() == rows.tolist()
    assert found.count.tolist() == [16, 16, 15]
    assert np.isnan(found.drift).all()


def test_without_positions(plain):
    assert position_differences(plain) is None
    assert positions_table(None, plain).rows == ()
    nothing = observed(plain, np.arange(4), np.full((4, 3), np.nan), np.full(4, np.nan))
    assert position_differences(nothing) is None
