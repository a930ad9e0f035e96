"""Control, check points, GNSS, INS, start values, terrain."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from aerotri.conventions import InputError
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.simulation import simulate
from aerotri.simulation.navigation import _errors_that_stay
from aerotri.simulation.spec import GnssSpec, TerrainSpec
from aerotri.simulation.terrain import make_terrain

DENSE = {"distance_bases": 1.0, "check_points": 60, "sigma_m": [0.02, 0.03, 0.05]}
MANY = {"strips": 6, "images_per_strip": 12}


def inside(value, count):
    """χ² of `count` squared standard normals at 99.9 %."""
    low, high = stats.chi2.ppf([0.0005, 0.9995], count)
    return low < value < high


def test_control_lies_on_a_grid_of_the_distance_asked_for(small_spec):
    spec = small_spec(flight={**MANY, "heading_deg": 90.0}, control={"distance_bases": 4.0})
    block, truth = simulate(spec, 1)
    xy = truth.points[block.control.point][:, :2]
    base = 0.4 * 750.0
    # eleven bases along and 5 · 805 m + 0.7 · 1150 m across, in meshes of about four bases
    columns, counts = np.unique(np.round(xy[:, 0] / (11 * base / 3) + 0.5), return_counts=True)
    assert counts.tolist() == [5, 5, 5, 5]
    assert len(columns) == 4
    assert len(xy) == 4 * 5
    assert np.ptp(xy[:, 0]) == pytest.approx(11 * base, rel=0.03)
    assert np.ptp(xy[:, 1]) == pytest.approx(5 * 805.0 + 805.0, rel=0.05)
    assert not block.control.is_check.any()


def test_perimeter_alone_and_given_positions(small_spec):
    around, _ = simulate(small_spec(flight=MANY, control={"distance_bases": 4.0, "interior": False}), 1)
    assert len(around.control) == 20 - 6
    corner, truth = simulate(small_spec(control={"positions": [[0.1, 0.1], [0.2, 0.1], [0.1, 0.3]]}), 1)
    xy = truth.points[corner.control.point][:, :2]
    assert (xy[:, 0] < 0).all()
    assert len(xy) == 3


def test_a_signalised_point_is_measured_in_every_image_that_sees_it(small_spec):
    spec = small_spec(
        flight={"end_lap": 0.8},
        tie_points={"rays_per_point": 3.0},
        control={"distance_bases": 3.0, "check_points": 30, "image_sigma_um": 0.0},
    )
    block, truth = simulate(spec, 1)
    half = np.array(block.cameras[0].half_format_mm) - 20 * 0.009
    rotation = rotation_from_angles(truth.angles)
    for point in block.control.point:
        u = np.einsum("nji,nj->ni", rotation, truth.points[point] - truth.centre)
        sees = np.flatnonzero((np.abs(101.4 * u[:, :2] / u[:, 2:]) <= half).all(axis=1))
        measured = np.sort(block.image_points.image[block.image_points.point == point])
        np.testing.assert_array_equal(measured, sees)
    assert block.control.is_check.sum() == 30


def test_control_errors_have_their_sigma(small_spec):
    block, truth = simulate(small_spec(flight=MANY, control={**DENSE, "check_sigma_m": [0.01, 0.01, 0.02]}), 5)
    control = block.control
    assert (control.sigma[control.is_check] == [0.01, 0.01, 0.02]).all()
    assert (control.sigma[~control.is_check] == [0.02, 0.03, 0.05]).all()
    v = (control.xyz - truth.points[control.point]) / control.sigma
    for own in (control.is_check, ~control.is_check):
        assert inside(np.sum(v[own] ** 2), v[own].size)
    names = block.points[control.point]
    assert names[0] == "C01"
    assert set(names[control.is_check]) == {f"K{i + 1:02d}" for i in range(60)}


def test_error_free_control_states_a_sigma(small_spec):
    spec = small_spec(control={"distance_bases": 3.0, "sigma_m": [0.0, 0.0, 0.0], "stated_sigma_m": [0.03, 0.03, 0.03]})
    block, truth = simulate(spec, 5)
    np.testing.assert_array_equal(block.control.xyz, truth.points[block.control.point])
    assert (block.control.sigma == 0.03).all()


def test_control_blunders_are_recorded(small_spec):
    control = {"distance_bases": 3.0}
    clean, _ = simulate(small_spec(control=control), 1)
    wrong, truth = simulate(
        small_spec(control={**control, "blunders": [{"point": "C03", "error_m": [0.0, 0.0, 10.0]}]}), 1
    )
    difference = wrong.control.xyz - clean.control.xyz
    assert list(np.flatnonzero(difference.any(axis=1))) == truth.control_blunders.tolist() == [2]
    assert difference[2] == pytest.approx([0.0, 0.0, 10.0])
    with pytest.raises(InputError, match=r"control\.blunders\.0\.point.*C99"):
        simulate(small_spec(control={**control, "blunders": [{"point": "C99", "error_m": [0.0, 0.0, 1.0]}]}), 1)


def test_control_that_no_image_sees_is_named(small_spec):
    with pytest.raises(InputError, match="C01"):
        simulate(small_spec(control={"positions": [[3.0, 0.5]]}), 1)


def test_gnss_with_lever_arm_shift_and_drift(small_spec):
    gnss = {
        "sigma_m": [1e-6, 1e-6, 1e-6],
        "shift_sigma_m": [0.3, 0.3, 0.3],
        "drift_sigma_m_s": [0.01, 0.01, 0.01],
        "lever_arm_m": [0.2, -0.4, 1.1],
    }
    block, truth = simulate(small_spec(flight={"attitude_sigma_deg": [2.0, 2.0, 2.0]}, gnss=gnss), 1)
    observed = block.gnss_ins
    assert observed is not None
    arm = rotation_from_angles(truth.angles) @ np.array([0.2, -0.4, 1.1])
    rest = observed.xyz - truth.centre - arm
    for strip in ("1", "2", "3"):
        own = block.images.strip == strip
        t = observed.time[own] - observed.time[own].mean()
        line = np.stack([np.ones_like(t), t], axis=1)
        fit, _, _, _ = np.linalg.lstsq(line, rest[own], rcond=None)
        assert np.abs(rest[own] - line @ fit).max() < 1e-5
        assert np.abs(fit[0]).max() > 0.03
        assert np.abs(fit[1]).max() > 1e-3
    settings = block.settings.gnss
    assert (settings.shift, settings.drift, settings.lever_arm_m) == ("strip", "strip", (0.2, -0.4, 1.1))
    assert np.isnan(observed.angles).all()


def test_gnss_and_ins_noise(small_spec):
    spec = small_spec(
        flight={**MANY, "attitude_sigma_deg": [2.0, 2.0, 2.0]},
        gnss={"sigma_m": [0.05, 0.05, 0.1]},
        ins={"sigma_deg": [0.005, 0.005, 0.01]},
    )
    block, truth = simulate(spec, 1)
    observed = block.gnss_ins
    assert observed is not None
    v = (observed.xyz - truth.centre) / [0.05, 0.05, 0.1]
    assert inside(np.sum(v**2), v.size)
    turned = (observed.angles - truth.angles + np.pi) % (2 * np.pi) - np.pi
    w = turned / np.radians([0.005, 0.005, 0.01])
    assert inside(np.sum(w**2), w.size)
    assert block.settings.gnss.shift == "off"
    assert block.settings.ins.boresight == "off"


def test_ins_is_turned_by_the_boresight(small_spec):
    spec = small_spec(ins={"sigma_deg": [1e-7, 1e-7, 1e-7], "boresight_deg": [0.1, -0.2, 0.3]})
    block, truth = simulate(spec, 1)
    assert block.gnss_ins is not None
    found = np.swapaxes(rotation_from_angles(truth.angles), 1, 2) @ rotation_from_angles(block.gnss_ins.angles)
    expected = rotation_from_angles(np.radians([0.1, -0.2, 0.3]))
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), atol=1e-7)
    assert block.settings.ins.boresight == "camera"
    assert np.isnan(block.gnss_ins.xyz).all()


def test_start_values(small_spec):
    none, _ = simulate(small_spec(), 1)
    assert np.isnan(none.images.centre).all()
    assert np.isnan(none.images.angles).all()
    near, truth = simulate(
        small_spec(flight=MANY, start_values={"kind": "perturbed", "position_sigma_m": 2.0, "angle_sigma_deg": 0.1}), 1
    )
    v = (near.images.centre - truth.centre) / 2.0
    w = (near.images.angles - truth.angles) / np.radians(0.1)
    assert inside(np.sum(v**2), v.size)
    assert inside(np.sum(w**2), w.size)


def test_undulating_ground_has_its_relief_and_wavelength():
    spec = TerrainSpec(kind="undulating", height_m=100.0, relief_rms_m=20.0, wavelength_m=500.0)
    terrain = make_terrain(spec, (0.0, 0.0), np.random.default_rng(1))
    xy = np.random.default_rng(2).uniform(-5000, 5000, (20000, 2))
    z = terrain.height(xy)
    assert z.mean() == pytest.approx(100.0, abs=2.0)
    assert z.std() == pytest.approx(20.0, rel=0.1)
    slope = (terrain.height(xy + [1.0, 0.0]) - z).std()
    assert slope == pytest.approx(20.0 * 2 * np.pi / 500.0 / np.sqrt(2.0), rel=0.3)


def test_a_hill_holds_its_volume():
    spec = TerrainSpec(kind="hill", hill_height_m=30.0, hill_radius_m=50.0, hill_centre_m=(20.0, -10.0))
    terrain = make_terrain(spec, (1000.0, 2000.0), np.random.default_rng(1))
    x, y = np.meshgrid(np.arange(600.0, 1440.0, 4.0), np.arange(1590.0, 2390.0, 4.0))
    z = terrain.height(np.stack([x.ravel(), y.ravel()], axis=1))
    assert z.sum() * 16.0 == pytest.approx(2.0 * np.pi * 50.0**2 * 30.0, rel=1e-6)
    assert terrain.height(np.array([[1020.0, 1990.0]])) == pytest.approx(30.0)


def test_hills_stand_on_any_ground_and_lie_within_its_reach():
    hills = ((20.0, -10.0, 30.0, 50.0), (-100.0, 40.0, -8.0, 30.0))
    spec = TerrainSpec(kind="flat", height_m=5.0, hills=hills)
    terrain = make_terrain(spec, (1000.0, 2000.0), np.random.default_rng(1))
    x, y = np.meshgrid(np.arange(600.0, 1440.0, 4.0), np.arange(1590.0, 2390.0, 4.0))
    z = terrain.height(np.stack([x.ravel(), y.ravel()], axis=1)) - 5.0
    assert z.sum() * 16.0 == pytest.approx(2.0 * np.pi * (50.0**2 * 30.0 - 30.0**2 * 8.0), rel=1e-6)
    low, high = terrain.reach
    assert low <= 5.0 + z.min() < 5.0 + z.max() <= high
    assert terrain.height(np.array([[900.0, 2040.0]]))[0] < 5.0


def test_errors_that_stay_have_their_size_and_time():
    """Correlation ρ = exp(−Δt/τ) from exposure to exposure, σ throughout, and a new beginning every day."""
    n = 4000
    flown = SimpleNamespace(time=2.0 * np.arange(n), day=np.repeat(["1", "2"], n // 2))
    flown = type("Flown", (SimpleNamespace,), {"__len__": lambda self: n})(**vars(flown))
    spec = GnssSpec(sigma_m=(0.01, 0.01, 0.01), correlated_sigma_m=(0.1, 0.2, 0.3), correlation_time_s=10.0)
    errors = _errors_that_stay(spec, flown, np.random.default_rng(1))
    np.testing.assert_allclose(errors.std(axis=0), [0.1, 0.2, 0.3], rtol=0.15)
    scaled = errors / [0.1, 0.2, 0.3]
    neighbours = np.mean(scaled[1:] * scaled[:-1]) / np.mean(scaled**2)
    assert abs(neighbours - np.exp(-0.2)) < 0.05
    flown.day = np.arange(n).astype(str)
    alone = _errors_that_stay(spec, flown, np.random.default_rng(1)) / [0.1, 0.2, 0.3]
    assert abs(np.mean(alone[1:] * alone[:-1])) < 0.03


def test_errors_that_stay_leave_the_other_random_numbers_alone(small_spec):
    gnss = {"sigma_m": [0.02, 0.02, 0.03]}
    plain, other = (
        simulate(small_spec(gnss=given), 3)[0]
        for given in (gnss, gnss | {"correlated_sigma_m": [0.0, 0.0, 0.5], "correlation_time_s": 20.0})
    )
    np.testing.assert_array_equal(plain.gnss_ins.xyz[:, :2], other.gnss_ins.xyz[:, :2])
    np.testing.assert_array_equal(plain.image_points.xy, other.image_points.xy)
    assert np.std(other.gnss_ins.xyz[:, 2] - plain.gnss_ins.xyz[:, 2]) > 0.05


def test_errors_that_stay_need_a_time(small_spec):
    with pytest.raises(InputError, match="correlation_time_s"):
        small_spec(gnss={"sigma_m": [0.02, 0.02, 0.03], "correlated_sigma_m": [0.1, 0.1, 0.1]})
