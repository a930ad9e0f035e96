"""Towers and the regular pattern of pass points."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from aerotri.conventions import InputError
from aerotri.formats.block.folder import read_block, write_block
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.simulation import simulate

TOWERS = {"height_m": 15.0, "per_image": 2, "sigma_m": 0.02}


def test_every_photograph_has_its_towers_measured_wherever_seen(small_spec):
    block, truth = simulate(small_spec(towers=TOWERS), 1)
    conditions = block.constraints
    assert conditions is not None
    assert len(conditions) == 2 * len(block.images)
    assert set(conditions.kind) == {"vertical"}
    assert (conditions.sigma == 0.02).all()
    half = np.array(block.cameras[0].half_format_mm) - 20 * 0.009
    rotation = rotation_from_angles(truth.angles)
    for pair in conditions.points:
        assert [str(name)[-4:] for name in block.points[pair]] == ["foot", "_top"]
        for point in pair:
            u = np.einsum("nji,nj->ni", rotation, truth.points[point] - truth.centre)
            sees = np.flatnonzero((np.abs(101.4 * u[:, :2] / u[:, 2:]) <= half).all(axis=1))
            measured = block.image_points.image[block.image_points.point == point]
            np.testing.assert_array_equal(np.sort(measured), sees)
            assert len(sees) >= 2


def test_tops_stand_over_their_feet_within_sigma(small_spec):
    block, truth = simulate(small_spec(towers=TOWERS), 2)
    assert block.constraints is not None
    foot, top = np.array(block.constraints.points).T
    apart = truth.points[top] - truth.points[foot]
    np.testing.assert_allclose(apart[:, 2], 15.0, rtol=1e-12)
    low, high = chi2.ppf([0.0005, 0.9995], 2 * len(foot))
    assert low < np.sum((apart[:, :2] / 0.02) ** 2) < high


def test_towers_leave_control_and_flight_alone_and_are_read_back(small_spec, tmp_path):
    plain, _ = simulate(small_spec(control={"distance_bases": 3.0}), 3)
    block, _ = simulate(small_spec(control={"distance_bases": 3.0}, towers=TOWERS), 3)
    np.testing.assert_array_equal(plain.control.xyz, block.control.xyz)
    write_block(block, tmp_path / "block")
    again = read_block(tmp_path / "block")
    np.testing.assert_array_equal(again.points, block.points)
    assert again.constraints is not None
    assert block.constraints is not None
    np.testing.assert_array_equal(np.array(again.constraints.points), np.array(block.constraints.points))


def test_a_tower_in_one_photograph_is_refused(small_spec):
    with pytest.raises(InputError, match=r"tower \d+ is in fewer than two photographs"):
        simulate(small_spec(flight={"strips": 1, "images_per_strip": 2, "end_lap": 0.2}, towers=TOWERS), 1)


def test_nodes_are_occupied_evenly(small_spec):
    ties = {"per_image": 15.0, "distribution": "nodes", "pattern": [1, 5], "cluster_sigma": 0.02}
    flight = {"strips": 1, "images_per_strip": 12, "end_lap": 0.6}
    block, _ = simulate(small_spec(flight=flight, tie_points=ties), 1)
    per_image = np.bincount(block.image_points.image)
    assert (per_image[1:-1] >= 14).all()
    assert (per_image[1:-1] <= 19).all()
    rays = block.image_points
    half = np.array(block.cameras[0].half_format_mm)
    # UltraCamD flies along its y: five rows across, three columns along
    node = np.round(rays.xy / half / np.array([0.4, 0.8])).astype(int)
    inner = (rays.image > 0) & (rays.image < 11)
    for image in range(1, 11):
        own = {tuple(cell) for cell in node[inner & (rays.image == image)]}
        assert len(own) == 15, own
