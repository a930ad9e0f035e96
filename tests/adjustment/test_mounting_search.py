"""How a camera sits on its rig, from tie points alone: simulated rigs, ambiguous flights, and a whole start."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_rigs import true_values, values_of, with_mountings

import aerotri
from aerotri.adjustment.directions import directions_of
from aerotri.adjustment.mounting_search import Stations, ground_of, search_mounting
from aerotri.functional_model.rotation import logarithm, rotation_from_angles
from aerotri.observations.rigs import station_places
from rig_blocks import MOUNTINGS, rig_block

STRAIGHT = {
    "gsd_m": 0.1, "strips": 2, "images_per_strip": 6, "end_lap": 0.8, "side_lap": 0.5, "heading_deg": 30.0,
    "alternating": False, "attitude_sigma_deg": [0.0, 0.0, 0.0], "position_sigma_m": [0.0, 0.0, 0.0],
}  # fmt: skip


def with_rays(block, kept):
    rays = block.image_points
    rays = replace(rays, image=rays.image[kept], point=rays.point[kept], xy=rays.xy[kept], sigma=rays.sigma[kept])
    return replace(block, image_points=rays)


def of_one_camera_each(block):
    """The block without what ties cameras to one another: a ray stays if its point is seen first by its camera."""
    rays, camera = block.image_points, block.images.camera
    own = camera[rays.image]
    first = np.full(len(block.points), len(block.cameras))
    np.minimum.at(first, rays.point, own)
    return with_rays(block, own == first[rays.point])


def searched(block, truth, camera):
    """The rotation found for a camera, with the reference photographs as in truth."""
    places = station_places(block)
    lead = places.mounting < 0
    k = next(k for k, (_, name) in enumerate(places.mountings) if name == camera)
    centre = np.where(lead[:, None], truth.centre, np.nan)
    rotation = np.where(lead[:, None, None], rotation_from_angles(truth.angles, block.rotation), np.nan)
    ground = ground_of(truth.points, centre)
    assert ground is not None
    stations = Stations(np.where(places.mounting == k, places.lead, -1), centre, rotation)
    return search_mounting(block, directions_of(block), stations, ground)


def off_deg(found, truth, camera, order):
    turn = found.T @ rotation_from_angles(np.array(truth.mountings[camera][3:]), order)
    return np.degrees(np.linalg.norm(logarithm(turn)))


@pytest.mark.parametrize("camera", ["left", "aft"])
def test_found_with_few_ties_to_the_reference_camera(camera):
    block, truth = rig_block(5, cameras=(camera,))
    found = searched(block, truth, camera)
    assert found is not None
    assert off_deg(found, truth, camera, block.rotation) < 0.3


def test_a_wrong_point_in_ten_does_no_harm():
    block, truth = rig_block(5, cameras=("left",))
    rng = np.random.default_rng(1)
    rays = block.image_points
    point = rays.point.copy()
    wrong = rng.random(len(point)) < 0.1
    point[wrong] = rng.permutation(point[wrong])
    found = searched(replace(block, image_points=replace(rays, point=point)), truth, "left")
    assert found is not None
    assert off_deg(found, truth, "left", block.rotation) < 0.3


def test_left_or_right_of_one_straight_strip_is_not_told():
    """Without ties to other cameras a mirrored camera sees the same parallaxes, and the same height above ground."""
    block, truth = rig_block(2, cameras=("left",), flight=STRAIGHT)
    places, rays = station_places(block), block.image_points
    seen = np.array([np.sum((places.mounting == 0)[rays.image] & (block.images.strip[rays.image] == s)) for s in "12"])
    strip = "12"[int(np.argmax(seen))]
    block = with_rays(block, (places.mounting < 0)[rays.image] | (block.images.strip[rays.image] == strip))
    tied = searched(block, truth, "left")
    assert tied is not None
    assert off_deg(tied, truth, "left", block.rotation) < 1.0
    assert searched(of_one_camera_each(block), truth, "left") is None


def test_too_few_points():
    block, truth = rig_block(2, cameras=("left",))
    lead = (station_places(block).mounting < 0)[block.image_points.image]
    few = with_rays(block, lead | (block.image_points.point % 150 == 0))
    assert searched(few, truth, "left") is None


def test_a_rig_from_its_measured_points_alone():
    """No orientation, no angles, nothing of the mounting: positions by GNSS and which photographs belong together."""
    block, truth = rig_block(3, cameras=tuple(MOUNTINGS), start_values={"kind": "none"}, gnss={"sigma_m": [1, 1, 1]})
    block = aerotri.with_settings(with_mountings(block, known=False), start="points")
    result = aerotri.adjust(block, explain=False).adjusted
    assert result.outcome.status == "converged"
    assert 0.9 < result.outcome.sigma0 < 1.1
    assert any("follow them on their rigs" in text for text in result.outcome.warnings)
    for key, true in true_values(truth).items():
        value, sigma = values_of(result)[key]
        assert abs((value - true + np.pi) % (2 * np.pi) - np.pi) < 4.5 * sigma, key
