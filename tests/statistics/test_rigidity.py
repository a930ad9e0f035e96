"""Tests whether cameras keep their places on a rig: against adjustments that allow it, by chance, and in words."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from aerotri.diagnosis.rigidity import camera_verdicts, rigidity_in_words
from aerotri.formats.results.rigs import rigidity_json, station_columns
from aerotri.pipeline import adjust
from aerotri.report.plots.rigs import plot_rig, rig_footprints
from aerotri.report.tables.rigs import photographs_table, rigidity_table, rigs_table, stations_table, verdicts
from aerotri.results.rigidity import POSITION, ROTATION
from aerotri.statistics import rigidity
from aerotri.statistics.rigidity_tests import holm
from rig_blocks import EXACT, rig_block

TWO = ("left", "fore")
MOVING = {"play_rotation_deg": 0.004}
ARC = np.radians(1.0 / 3600.0)


@pytest.fixture(scope="module")
def rigid():
    return rig_block(3, cameras=TWO, mounting=EXACT)[0]


@pytest.fixture(scope="module")
def quiet(rigid):
    return adjust(rigid)


@pytest.fixture(scope="module")
def moving():
    """One camera turns by 14″ between exposures."""
    spec = {"left": EXACT | MOVING, "fore": EXACT}
    return adjust(_flown(3, spec)[0])


def _flown(seed, cameras):
    from rig_blocks import MOUNTINGS

    rig = {"camera": {name: MOUNTINGS[name] | more for name, more in cameras.items()}}
    return rig_block(seed, cameras=tuple(cameras), rig=rig)


def test_a_photograph_as_where_it_is_free(rigid, quiet):
    """The test of one photograph is what vᵀPv loses when it leaves the rig, and its rotation what it then does."""
    block, s = rigid, quiet.rigidity.stations
    k = int(np.flatnonzero(s.camera == "fore")[4])
    station = np.asarray(block.images.columns["station"], dtype=object).copy()
    station[s.image[k]] = ""
    free = adjust(replace(block, images=replace(block.images, columns={"station": station})))
    gain = quiet.outcome.vtpv - free.outcome.vtpv
    rest = free.outcome.vtpv / free.outcome.redundancy
    assert s.freedom[k] == 6
    assert quiet.outcome.redundancy - free.outcome.redundancy == 6
    assert s.f[k] == pytest.approx(gain / 6 / rest, rel=1e-3)


def test_a_station_as_where_its_photographs_are_free(rigid, quiet):
    """The test of an exposure is what vᵀPv loses when its photographs leave the rig, all of them."""
    whole = quiet.rigidity.whole
    k = whole.station.tolist().index("1_003")
    station = np.asarray(rigid.images.columns["station"], dtype=object).copy()
    station[station == "1_003"] = ""
    free = adjust(replace(rigid, images=replace(rigid.images, columns={"station": station})))
    gain = quiet.outcome.vtpv - free.outcome.vtpv
    rest = free.outcome.vtpv / free.outcome.redundancy
    assert (whole.photographs[k], whole.freedom[k]) == (3, 12)
    assert quiet.outcome.redundancy - free.outcome.redundancy == 12
    assert whole.f[k] == pytest.approx(gain / 12 / rest, rel=1e-3)
    assert not whole.found.any()
    assert len(set(whole.station.tolist())) == len(whole) > 8


def test_stations_in_batches_are_tested_as_together(rigid, quiet, monkeypatch):
    monkeypatch.setattr(rigidity, "AT_A_TIME", 5)
    again, whole = adjust(rigid).rigidity.whole, quiet.rigidity.whole
    assert again.station.tolist() == whole.station.tolist()
    np.testing.assert_allclose(again.f, whole.f, rtol=1e-6)


def test_movements_beside_a_sum_over_the_photographs(quiet):
    """Seen from outside: without movements nothing is found, in any camera, and tests are numbers."""
    tests = quiet.rigidity
    assert {(one.camera, one.what) for one in tests.heads} == {
        (camera, what) for camera in (*TWO, "nadir") for what in (ROTATION, POSITION)
    }
    for one in tests.heads:
        assert not one.movement_found
        assert not one.drift_found
        assert 0.0 < one.movement_detectable < np.inf
        assert one.stations > 5
    assert not tests.stations.found.any()
    assert rigidity_in_words(tests) == ()
    assert all(one.keeps for one in camera_verdicts(tests))


def test_a_camera_that_moves_is_found_and_measured(moving):
    tests = moving.rigidity
    left = tests.head("frame", "left")
    assert left.movement_found
    assert left.movement == pytest.approx(14.4 * ARC, abs=3.5 * left.movement_sigma)
    assert 1.0 * ARC < left.movement_sigma < 5.0 * ARC
    said = {one.camera: one for one in camera_verdicts(tests)}
    assert not said["left"].keeps
    assert "camera left does not keep its place on the rig frame: it turns by σ" in said["left"].says
    assert min(tests.heads, key=lambda one: one.movement_p) is left
    assert said["left"].says in moving.outcome.warnings
    assert "fore seems to move on the rig frame as well" in said["fore"].says
    assert "This may come from camera left, whose movement is clearer" in said["fore"].says


@pytest.mark.parametrize(("factor", "alike"), [(1.0, True), (1.4, True), (3.0, False)])
def test_movements_of_all_cameras_alike(quiet, factor, alike):
    """In the image: errors that are not modelled look so. One much larger: the others follow from it."""
    focal = quiet.rigidity.focal_mm
    heads = tuple(
        replace(one, movement=1e-3 / focal[one.camera] * (factor if one.camera == "left" else 1.0),
                movement_p=1e-20 if one.camera == "left" else 1e-9, movement_found=one.what == ROTATION)
        for one in quiet.rigidity.heads
    )  # fmt: skip
    said = {one.camera: one.says for one in camera_verdicts(replace(quiet.rigidity, heads=heads))}
    for text in said.values():
        assert ("image errors that are not modelled look the same" in text) == alike
    assert ("seems to move on the rig frame as well" in said["nadir"]) != alike
    assert "camera left does not keep its place" in said["left"]


def test_a_camera_that_shifts_is_found_and_measured(quiet):
    """Of the size stated as detectable and a half more: what turns explain of it does not pass for noise."""
    size = 1.5 * quiet.rigidity.head("frame", "left", POSITION).movement_detectable
    found = adjust(_flown(3, {"left": EXACT | {"play_position_m": size}, "fore": EXACT})[0]).rigidity
    left = found.head("frame", "left", POSITION)
    assert left.movement_found
    assert left.movement == pytest.approx(size, abs=3.5 * left.movement_sigma)


def test_a_drift_is_found_and_measured():
    drift = {"drift_rotation_deg": [0.0, 0.03, 0.0]}
    tests = adjust(_flown(5, {"left": EXACT | drift, "fore": EXACT})[0]).rigidity
    left = tests.head("frame", "left")
    assert left.drift_found
    gap = (left.drift - np.radians([0.0, 0.03, 0.0])) / left.drift_sigma
    assert (np.abs(gap) < 4.0).all()
    text = next(one.says for one in camera_verdicts(tests) if one.camera == "left")
    assert "from the first to the last exposure" in text


def test_a_single_photograph_out_of_its_place(rigid):
    """Turned by 0.05°: found at its station, by about that much, and named."""
    block, truth = rig_block(3, cameras=TWO, mounting=EXACT)
    names = block.images.names.tolist()
    row = names.index("1_003_fore")
    own = block.image_points.image == row
    xy = block.image_points.xy.copy()
    # about the axis of the camera: x' = x + y·κ
    xy[own] += np.radians(0.05) * np.column_stack([xy[own, 1], -xy[own, 0]])
    tests = adjust(replace(block, image_points=replace(block.image_points, xy=xy))).rigidity
    s = tests.stations
    worst = int(np.argmin(s.p))
    assert (s.image[worst], bool(s.found[worst])) == (row, True)
    turned = np.linalg.norm(s.turned[worst])
    assert turned == pytest.approx(np.radians(0.05), abs=4.0 * np.max(s.sigma[worst]))
    said = " ".join(rigidity_in_words(tests))
    assert "1 photograph is out of place, most of all at station 1_003" in said
    assert len(truth.mountings) == 2


def test_two_cameras_are_not_told_apart():
    """Of two cameras only the mounted one is tested: its movement is that of the other seen from there."""
    tests = adjust(rig_block(4, cameras=("fore",), mounting=EXACT)[0]).rigidity
    assert {one.camera for one in tests.heads} == {"fore"}


def test_no_tests_without_a_rigid_rig(rigid):
    rig = replace(rigid.rigs[0], constraint="off")
    assert adjust(replace(rigid, rigs=(rig,))).rigidity is None


def test_holm():
    p = np.array([0.02, 0.001, 0.6, 0.012])
    assert holm(p, 0.05).tolist() == [True, True, False, True]
    assert holm(p, 0.03).tolist() == [False, True, False, False]
    assert holm(np.zeros(0), 0.05).tolist() == []


def test_written_and_in_the_report(moving):
    block, tests = moving.block, moving.rigidity
    content = json.loads(json.dumps(rigidity_json(tests), allow_nan=False))
    left = next(one for one in content["cameras"] if one["camera"] == "left")
    assert left["keeps_place"] is False
    assert left["tests"][0]["movement"] == pytest.approx(np.degrees(tests.head("frame", "left").movement))
    columns = station_columns(tests, block.images.names)
    assert {len(values) for values in columns.values()} == {len(tests.stations)}
    assert set(columns["camera"]) == {"nadir", *TWO}
    assert len(rigidity_table(moving)) == 6
    assert len(rigs_table(moving)) == 2
    strongest = rigs_table(moving).rows[0][-2]
    first, second = (("x", "y", "z", "ω", "φ", "κ").index(word) for word in strongest.split(":")[0].split(", "))
    assert float(strongest.split(":")[1]) == pytest.approx(moving.rigs[0].correlations[first, second], abs=0.006)
    assert len(photographs_table(moving)) == 15
    assert len(stations_table(moving)) == len(tests.whole) == 13
    assert content["stations_found"] == tests.whole.found.sum() > 0
    own = columns["station"] == tests.whole.station[0]
    np.testing.assert_array_equal(columns["station_p"][own], np.full(own.sum(), tests.whole.p[0]))
    assert [one["level"] for one in verdicts(moving)].count("attention") >= 1
    prints = rig_footprints(moving, "frame")
    assert list(prints) == ["nadir", *TWO]
    assert prints["nadir"][1] == 0.0
    assert prints["left"][1] == pytest.approx(40.5, abs=1.0)
    # it looks to the right of the reference camera
    assert prints["left"][0][:, 0].min() > 0.0
    plot_rig(moving, "frame").canvas.draw()


@pytest.mark.slow
def test_false_alarms_and_power_over_seeds():
    """p of faultless rigs is uniform; movements of the size said to be detectable are found as often as said."""
    p, sizes = [], {ROTATION: [], POSITION: []}
    for seed in range(2000, 2060):
        tests = adjust(_flown(seed, {"left": EXACT, "fore": EXACT})[0]).rigidity
        p.append([one.movement_p for one in tests.heads] + [one.drift_p for one in tests.heads])
        for what, of in sizes.items():
            of.append(tests.head("frame", "left", what).movement_detectable)
    p = np.array(p)
    # 60 uniform numbers: their mean has σ 0.037
    assert (np.abs(p.mean(axis=0) - 0.5) < 3.5 * 0.0373).all()
    keys = {ROTATION: ("play_rotation_deg", np.degrees(1.0)), POSITION: ("play_position_m", 1.0)}
    for what, (key, unit) in keys.items():
        plays, found = EXACT | {key: float(unit * np.median(sizes[what]))}, []
        for seed in range(3000, 3060):
            block, _ = _flown(seed, {"left": plays, "fore": EXACT})
            found.append(adjust(block).rigidity.head("frame", "left", what).movement_p < 0.001 / 12)
        # 60 times 0.8: σ of the share 5.2 %
        assert abs(np.mean(found) - 0.8) < 3.5 * 0.052, what
