"""Start angles that the tie points contradict are replaced by theirs, and said; right ones never are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import aerotri
from aerotri.adjustment import doubtful_starts
from aerotri.diagnosis import diagnose
from aerotri.functional_model.rotation import (
    angles_from_rotation,
    exponential,
    logarithm,
    rotation_from_angles,
)
from aerotri.observations import Block
from aerotri.pipeline import adjust
from aerotri.pipeline.starting import Started, with_start
from aerotri.results.adjusted_block import Outcome
from aerotri.results.failure import AdjustmentFailedError
from aerotri.simulation import parse_spec, simulate
from rig_blocks import rig_block
from small_blocks import small_block, small_spec
from wrong_blocks import DRONE, SPEC, clean, image_points, negated, photograph

ROUGH = {"start_values": {"kind": "perturbed", "position_sigma_m": 2.0, "angle_sigma_deg": 3.0}}
ANGLES_DEG = (30.0, 60.0, 90.0, 120.0, 150.0, 180.0)


def drone() -> Block:
    """Four strips of a drone whose start values err by 2 m at 100 m and by 3°."""
    return simulate(parse_spec(SPEC | DRONE | ROUGH), 3)[0]


def few() -> Block:
    """Three photographs of one strip."""
    flight = {**SPEC["flight"], "strips": 1, "images_per_strip": 3}
    return simulate(parse_spec(SPEC | {"flight": flight, "control": {**SPEC["control"], "distance_bases": 1.0}}), 3)[0]


BLOCKS = {
    "large format": lambda: small_block(1)[0],
    "two strips": lambda: clean("control"),
    "two strips in UTM": lambda: clean("crs"),
    "drone": drone,
    "few": few,
    "rig": lambda: rig_block(3)[0],
}


def turned(block: Block, rows: np.ndarray, axis: np.ndarray, degrees: float) -> Block:
    """Start angles of some photographs turned about an axis of the camera."""
    angles = block.images.angles.copy()
    turn = exponential(np.radians(degrees) * axis / np.linalg.norm(axis))
    angles[rows] = angles_from_rotation(rotation_from_angles(angles[rows], block.rotation) @ turn, block.rotation)
    return replace(block, images=replace(block.images, angles=angles))


def degrees_apart(block: Block, other: Block) -> np.ndarray:
    """(n,) between the start angles of two blocks."""
    first, second = (rotation_from_angles(b.images.angles, b.rotation) for b in (block, other))
    return np.degrees(np.linalg.norm(logarithm(np.swapaxes(first, 1, 2) @ second), axis=1))


@pytest.mark.parametrize("shape", BLOCKS)
def test_right_start_values_stay_as_they_are(shape):
    block = BLOCKS[shape]()
    started = with_start(block)
    assert started.messages == ()
    assert started.block is block


@pytest.mark.parametrize("shape", BLOCKS)
def test_start_of_one_photograph_is_replaced_whatever_the_angle_and_the_axis(shape):
    block, random = BLOCKS[shape](), np.random.default_rng(7)
    measured = np.unique(block.image_points.image)
    for degrees in ANGLES_DEG:
        number, axis = int(random.choice(measured)), random.normal(size=3)
        started = with_start(turned(block, np.array([number]), axis, degrees))
        assert degrees_apart(block, started.block).max() < 15.0, (degrees, axis, number, started.messages)
        assert len(started.messages) == 1
        assert f"start angles of photograph {photograph(block, number)} were not used" in started.messages[0]


def test_photographs_far_from_one_another_are_taken_out_at_once(monkeypatch):
    """Turned by so little that pairs still agree: rounds do not grow with the number of photographs that are wrong."""
    flight = small_spec()["flight"] | {"strips": 1, "images_per_strip": 40, "end_lap": 0.8, "cross_strips": []}
    block = small_block(1, flight=flight, tie_points=small_spec()["tie_points"] | {"per_image": 20})[0]
    wrong = np.arange(5, 40, 10)
    local = turned(block, wrong, np.array([1.0, 0.0, 0.0]), 7.0)
    rounds, miss = [], doubtful_starts.miss_by_photograph
    monkeypatch.setattr(doubtful_starts, "miss_by_photograph", lambda *given: rounds.append(1) or miss(*given))
    found = doubtful_starts.doubtful(local, doubtful_starts.given_orientations(local))
    assert np.flatnonzero(found).tolist() == wrong.tolist()
    assert len(rounds) <= 3 < len(wrong)


TURNS = {
    "180° added to kappa": (np.array([0.0, 0.0, 1.0]), 180.0),
    "90° taken from kappa": (np.array([0.0, 0.0, 1.0]), 90.0),
    "y of the camera taken as pointing down": (np.array([1.0, 0.0, 0.0]), 180.0),
}


@pytest.mark.parametrize("remedy", TURNS)
@pytest.mark.parametrize("shape", ["large format", "two strips in UTM", "drone"])
def test_start_of_a_strip_or_of_all_is_replaced_and_the_convention_said(shape, remedy):
    block, (axis, degrees) = BLOCKS[shape](), TURNS[remedy]
    strip = np.asarray(block.images.strip)
    for rows, words in ((np.flatnonzero(strip == strip[0]), f"strip {strip[0]}"), (np.arange(len(strip)), "all")):
        started = with_start(turned(block, rows, axis, degrees))
        assert degrees_apart(block, started.block).max() < 15.0
        assert f"start angles of {words}" in started.messages[0]
        assert remedy in started.messages[0]


def test_adjustment_is_that_of_right_start_values_and_says_what_was_wrong():
    block = clean("control")
    right = aerotri.adjust(block)
    wrong = aerotri.adjust(turned(block, np.array([3]), np.array([0.0, 1.0, 0.0]), 120.0))
    assert wrong.verdict == right.verdict == "accepted"
    assert wrong.sigma0 == pytest.approx(right.sigma0, rel=1e-6)
    assert any("they are 120° off" in said for said in wrong.adjusted.outcome.warnings)


CAMERA = dict(camera_name="drone", camera_size=(640, 480), pixel_um=7.5, focal_length_mm=4.8, image_sigma_px=0.1,
              flight_axis="+y", free_interior=True)  # fmt: skip


@pytest.mark.parametrize(
    ("orientations", "words"),
    [
        ("eo_bad.txt", "start angles of photograph 1_002 were not used: they are 122° off"),
        ("all_om180.txt", "start angles of all 12 photographs were not used"),
    ],
)
def test_orientations_turned_over_do_no_harm_to_a_block_that_the_rest_determines(orientations, words, shared_data):
    folder = shared_data("doors") / "crash_eigenvalues"
    block = aerotri.read(
        folder / "sim_bingo.txt", orientation=folder / orientations, positions=folder / "sim_geo.txt",
        control=folder / "sim_p4gcp.csv", crs="EPSG:32632", **CAMERA,
    ).block  # fmt: skip
    result = aerotri.adjust(block, explain=False).adjusted
    assert result.outcome.status == "converged"
    assert result.outcome.sigma0 < 2.0
    assert words in " ".join(result.outcome.warnings)


@pytest.mark.parametrize(("folder", "remedy"), [("strip_mirrored", "x negated"), ("rows_flipped", "y negated")])
def test_strip_that_is_mirrored_is_named(folder, remedy, shared_data):
    block = aerotri.read_block(shared_data("doors") / folder)
    said = diagnose(block, adjust)
    assert said[0].startswith("strip 2: the measurements fit")
    assert remedy in said[0]


def test_start_that_does_not_fit_is_blamed_and_not_the_principal_distance():
    runaway = Outcome("not converged", "the principal distance ran away", 3, *[np.nan] * 3, 10, 5, 0, 5)
    failed = AdjustmentFailedError(replace(runaway, reasons=(runaway.message,)))
    block = clean("control")
    assert Started(block).blamed(failed) is failed
    blamed = Started(block, ("strip 2 misses",), ("strip 2 misses",)).blamed(failed).outcome
    assert blamed.reasons == (blamed.message,)
    assert "strip 2 misses" in blamed.message
    assert "principal distance" not in blamed.message


def test_measurements_that_are_wrong_are_not_taken_for_start_angles():
    block = image_points(negated(0), 3)(clean("control"))
    assert not any("were not used" in said for said in with_start(block).messages)
