"""Flights with rigs: every exposure has all cameras, mounted as stated, moved by their play."""

from __future__ import annotations

import numpy as np
import pytest

from aerotri.conventions import InputError
from aerotri.functional_model.rotation import logarithm, rotation_from_angles
from aerotri.simulation import parse_spec, simulate
from rig_blocks import MOUNTINGS, rig_block, rig_spec


def relative(block, truth, camera):
    """Arms (k, 3) m and turns (k, 3, 3) of a camera in the frame of the nadir camera, from the true orientations."""
    station = block.images.columns["station"]
    names = np.array([c.name for c in block.cameras])[block.images.camera]
    lead = {station[k]: k for k in np.flatnonzero(names == "nadir")}
    rows = np.flatnonzero(names == camera)
    at = np.array([lead[station[k]] for k in rows])
    rotation = rotation_from_angles(truth.angles)
    arm = np.einsum("nji,nj->ni", rotation[at], truth.centre[rows] - truth.centre[at])
    return arm, np.swapaxes(rotation[at], 1, 2) @ rotation[rows]


def test_every_exposure_has_all_cameras():
    block, truth = rig_block(2)
    stations, counts = np.unique(block.images.columns["station"], return_counts=True)
    assert len(stations) == 13
    assert (counts == 5).all()
    assert len(set(block.images.names.tolist())) == 65
    assert set(truth.mountings) == set(MOUNTINGS)


@pytest.mark.parametrize("camera", MOUNTINGS)
def test_without_play_the_mounting_is_the_same_everywhere(camera):
    arm, turn = relative(*rig_block(2), camera)
    np.testing.assert_allclose(arm, np.tile(MOUNTINGS[camera]["position_m"], (13, 1)), atol=1e-9)
    expected = rotation_from_angles(np.radians(MOUNTINGS[camera]["rotation_deg"]))
    np.testing.assert_allclose(turn, np.tile(expected, (13, 1, 1)), atol=1e-12)


def test_play_moves_and_turns_by_its_sigma():
    play = {"play_position_m": 0.002, "play_rotation_deg": 0.003}
    moved, turned = [], []
    for seed in range(6):
        block, truth = rig_block(seed, rig=play)
        for camera in MOUNTINGS:
            arm, turn = relative(block, truth, camera)
            at = rotation_from_angles(np.radians(MOUNTINGS[camera]["rotation_deg"]))
            moved.append(arm - MOUNTINGS[camera]["position_m"])
            turned.append(np.degrees(logarithm(turn @ at.T)))
    # 13 stations, 4 cameras, 3 elements, 6 seeds: 936 numbers, σ of their RMS 2.3 %
    assert np.sqrt(np.mean(np.square(moved))) == pytest.approx(0.002, rel=0.1)
    assert np.sqrt(np.mean(np.square(turned))) == pytest.approx(0.003, rel=0.1)


def test_positions_are_observed_once_a_station():
    block, _ = rig_block(2, gnss={"sigma_m": [0.05, 0.05, 0.08]})
    assert block.gnss_ins is not None
    assert (block.images.camera[block.gnss_ins.image] == 0).all()
    assert len(block.gnss_ins) == 13


def test_navigation_is_that_of_a_tilted_reference_camera():
    """Lever arm and attitude in the frame of the camera, however it is tilted on the frame."""
    spec = rig_spec(gnss={"sigma_m": [1e-6] * 3, "lever_arm_m": [0.2, -0.3, 1.1]}, ins={"sigma_deg": [1e-7] * 3})
    del spec["camera"]
    block, truth = simulate(parse_spec(spec | {"rig": {"frame": {"preset": "two_head"}}}), 1)
    observed = block.gnss_ins
    rotation = rotation_from_angles(truth.angles[observed.image])
    np.testing.assert_allclose(observed.xyz, truth.centre[observed.image] + rotation @ [0.2, -0.3, 1.1], atol=1e-4)
    gap = logarithm(rotation_from_angles(observed.angles) @ np.swapaxes(rotation, 1, 2))
    np.testing.assert_allclose(gap, 0.0, atol=1e-7)


def test_what_is_stated_errs_by_its_sigma():
    errors = []
    for seed in range(40):
        block, _ = rig_block(seed, mounting={"position_sigma_m": [0.01, 0.01, 0.01]})
        for camera, mounting in block.rigs[0].cameras.items():
            stated = np.array([prior.value for prior in mounting.position])
            errors.append(stated - MOUNTINGS[camera]["position_m"])
            assert all(p.sigma == 0.01 for p in mounting.position)
    # 480 numbers: σ of their RMS 3.2 %
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(0.01, rel=0.12)


@pytest.mark.parametrize(("rig", "says"), [
    ({"reference": "zenith"}, "names the camera 'zenith'"),
    ({"reference": "left"}, "stands on a rig twice"),
])  # fmt: skip
def test_wrong_rigs_are_refused(rig, says):
    with pytest.raises(InputError, match=says):
        simulate(parse_spec(rig_spec(rig=rig)), 1)


@pytest.mark.parametrize(("preset", "cameras", "tilts"), [
    ("oblique_5", 5, [0.0, 45.0, 45.0, 45.0, 45.0]),
    ("two_head", 2, [14.0, 14.0]),
    ("large_format_4", 4, [19.34, 19.34, 19.34, 19.34]),
])  # fmt: skip
def test_presets_fly(preset, cameras, tilts):
    """Every head looks where the preset says, seen from a level frame, and sees points."""
    spec = rig_spec()
    del spec["camera"]
    spec |= {"rig": {"frame": {"preset": preset, "play_rotation_deg": 0.0}}, "tie_points": {
        "per_image": 12, "probability": 0.9, "sigma_um": 2.0}}  # fmt: skip
    spec["flight"] = spec["flight"] | {"attitude_sigma_deg": [0.0, 0.0, 0.0], "cross_strips": []}
    # oblique cameras look beyond a small block
    spec["flight"] |= {"strips": 5, "images_per_strip": 12} if preset == "oblique_5" else {}
    block, truth = simulate(parse_spec(spec), 1)
    assert len(block.cameras) == cameras
    axis = -rotation_from_angles(truth.angles)[:, :, 2]
    for k, tilt in enumerate(tilts):
        own = block.images.camera == k
        np.testing.assert_allclose(np.degrees(np.arccos(-axis[own, 2])), tilt, atol=0.01)
    assert len(np.unique(np.round(axis[:cameras], 6), axis=0)) == cameras
    assert np.bincount(block.images.camera[block.image_points.image], minlength=cameras).min() > 20
    # the heads of a rig look to all sides alike
    assert np.abs(axis[:cameras, :2].mean(axis=0)).max() < 1e-9


def test_keys_beside_a_preset_count():
    spec = rig_spec()
    spec["camera"] = {"nadir": {"focal_length_mm": 70.0}}
    spec["rig"] = {"frame": {"preset": "oblique_5", "camera": {"fore": {"play_rotation_deg": 0.002}}}}
    parsed = parse_spec(spec)
    assert parsed.camera["nadir"].focal_length_mm == 70.0
    assert parsed.camera["nadir"].size_px == (14204, 10652)
    assert parsed.rig["frame"].camera["fore"].play_rotation_deg == 0.002
    assert parsed.rig["frame"].camera["fore"].rotation_deg == (45.0, 0.0, 0.0)


def test_an_unknown_preset_is_refused():
    spec = rig_spec()
    spec["rig"] = {"frame": {"preset": "nine_head"}}
    with pytest.raises(InputError, match="nine_head"):
        parse_spec(spec)
