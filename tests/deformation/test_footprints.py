"""Footprints: what lies in them is what the photographs show, by projecting points of the ground the other way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

import aerotri
from aerotri.deformation.footprints import FARTHEST, footprints
from aerotri.deformation.point_ground import ground_of_points
from aerotri.functional_model.rotation import angles_from_rotation, rotation_from_angles
from aerotri.image_errors import image_groups
from aerotri.image_errors.error_function import error_function
from gis_blocks import in_crs, plain_block

GROUND, EDGE = 100.0, 0.005
"""Height of the flat ground, m; points so near to an edge, in heights above ground, are left out."""


@pytest.fixture(scope="module")
def flown():
    return aerotri.adjust(plain_block(), explain=False)


def turned(record, tilt_deg, azimuth_deg, **camera):
    """The adjustment as if its ground were flat and all photographs looked that way; its camera with other values."""
    block = record.local.block
    t, a = np.radians([tilt_deg, azimuth_deg])
    # the axis −z of the camera falls by the tilt towards the azimuth; y up in the photograph
    axis = np.array([np.sin(t) * np.sin(a), np.sin(t) * np.cos(a), -np.cos(t)])
    x = np.array([np.cos(a), -np.sin(a), 0.0])
    rotation = np.column_stack([x, np.cross(-axis, x), -axis])
    angles = np.tile(angles_from_rotation(rotation[None], block.rotation), (len(block.images), 1))
    xyz = record.local.points.xyz.copy()
    xyz[:, 2] = GROUND
    block = replace(block, cameras=tuple(replace(one, **camera) for one in block.cameras))
    local = replace(
        record.local, block=block, images=replace(record.local.images, angles=angles),
        points=replace(record.local.points, xyz=xyz),
    )  # fmt: skip
    return replace(record, local=local, result=local)


def seen(record, photograph, xyz):
    """(n,) bool: points that lie on the format, by collinearity, and are not farther than a footprint reaches."""
    local, images = record.local, record.local.images
    group = next(one for one in image_groups(local.block) if one.images[photograph])
    errors, centre = error_function(local, group), images.centre[photograph]
    u = (xyz - centre) @ rotation_from_angles(images.angles[photograph][None], local.block.rotation)[0]
    front = u[:, 2] < 0.0
    c, x0, y0 = errors.interior
    ideal = np.column_stack([x0 - c * u[:, 0] / u[:, 2], y0 - c * u[:, 1] / u[:, 2]])
    on = np.zeros(len(xyz), bool)
    near = front & (np.abs(ideal) < 2.0 * np.array(group.camera.half_format_mm)).all(axis=1)
    on[near] = (np.abs(errors.measured(ideal[near])) <= np.array(group.camera.half_format_mm)).all(axis=1)
    return on & (np.hypot(*(xyz - centre)[:, :2].T) <= FARTHEST * (centre[2] - xyz[:, 2]))


@pytest.mark.parametrize(
    ("tilt", "azimuth", "cut"), [(0, 0, False), (30, 100, False), (64, 200, True), (85, -50, True)]
)
def test_points_on_the_format_are_in_the_footprint(flown, tilt, azimuth, cut):
    record = turned(flown.record, tilt, azimuth)
    found, photograph = footprints(record), 3
    polygon, centre = found.polygons[photograph], record.local.images.centre[photograph]
    height = centre[2] - GROUND
    assert found.is_cut[photograph] == cut
    assert polygon.is_valid
    rng = np.random.default_rng(1)
    xy = centre[:2] + height * rng.uniform(-1.0, 1.0, (20000, 2)) * (7.0 if cut else 2.0)
    inside = shapely.contains_xy(polygon, xy)
    sure = shapely.distance(shapely.boundary(polygon), shapely.points(xy)) > EDGE * height * (1.0 + 6.0 * cut)
    expected = seen(record, photograph, np.column_stack([xy, np.full(len(xy), GROUND)]))
    assert (inside == expected)[sure].all()
    assert expected[sure].sum() > 100
    assert np.degrees(found.tilt[photograph]) == pytest.approx(tilt, abs=1e-9)
    assert found.height[photograph] == pytest.approx(height)


def test_size_of_a_pixel(flown):
    """Across the ray: height over c below the camera, and slant distance over c where it looks aside."""
    camera = flown.block.cameras[0]
    for tilt in (0.0, 40.0):
        record = turned(flown.record, tilt, 10.0)
        found = footprints(record)
        c = error_function(record.local, image_groups(record.local.block)[0]).interior[0]
        slant = (record.local.images.centre[:, 2] - GROUND) / np.cos(np.radians(tilt))
        np.testing.assert_allclose(found.gsd, slant * camera.pixel_mm / c, rtol=2e-3)


def test_photographs_of_the_sky_have_none(flown):
    found = footprints(turned(flown.record, 170.0, 0.0))
    assert all(one is None for one in found.polygons)
    assert np.isnan(found.gsd).all()


def test_fisheye_that_sees_all_around_shows_a_circle(flown):
    """An equidistant fisheye with 100° at the edge of its format sees the horizon on every side."""
    camera = flown.block.cameras[0]
    c = replace(camera.interior["focal_length_mm"], value=min(camera.half_format_mm) / np.radians(100.0))
    interior = {**camera.interior, "focal_length_mm": c}
    record = turned(flown.record, 0.0, 0.0, projection="fisheye", interior=interior, brown={}, lens={})
    p = record.local.parameters
    names = ("names", "groups", "kinds", "marks", "value", "status", "reason")
    local = replace(record.local, parameters=replace(p, **{name: getattr(p, name)[:0] for name in names}))
    found = footprints(replace(record, local=local, result=local))
    radius = FARTHEST * (record.local.images.centre[:, 2] - GROUND)
    assert found.is_cut.all()
    np.testing.assert_allclose(shapely.area(found.polygons), np.pi * radius**2, rtol=2e-3)


def test_relief_is_followed_in_a_crs():
    """Corners lie on the edge of the format when they are projected through the local frame, earth curved."""
    result = aerotri.adjust(in_crs(plain_block()), explain=False)
    record, found = result.record, footprints(result.record)
    ground = ground_of_points(record.result.points.xyz)
    for photograph in (0, 9):
        xy = shapely.get_coordinates(found.polygons[photograph])
        xyz = record.frame.to_local(np.column_stack([xy, ground.heights(*xy.T)]))
        group = next(one for one in image_groups(record.local.block) if one.images[photograph])
        errors, images = error_function(record.local, group), record.local.images
        rotation = rotation_from_angles(images.angles[photograph][None], record.local.block.rotation)[0]
        u = (xyz - images.centre[photograph]) @ rotation
        ideal = errors.interior[1:] - errors.interior[0] * u[:, :2] / u[:, 2:]
        share = np.abs(errors.measured(ideal)) / np.array(group.camera.half_format_mm)
        np.testing.assert_allclose(share.max(axis=1), 1.0, atol=1e-4)


def test_ground_of_few_points():
    """No point, one, and points on a line: a height wherever it is asked for."""
    assert ground_of_points(np.full((3, 3), np.nan)) is None
    one = ground_of_points(np.array([[1.0, 2.0, 30.0]]))
    assert one.heights(np.array([-5.0, 1.0]), np.array([9.0, 2.0])).tolist() == [30.0, 30.0]
    line = ground_of_points(np.column_stack([np.arange(50.0), np.zeros(50), np.arange(50.0)]))
    assert line.heights(np.array([25.0]), np.array([3.0]))[0] == pytest.approx(25.0, abs=1.0)


def test_ground_follows_a_slope_and_forgets_single_wrong_points():
    rng = np.random.default_rng(2)
    xy = rng.uniform(0.0, 1000.0, (2000, 2))
    xyz = np.column_stack([xy, 50.0 + 0.1 * xy[:, 0] - 0.05 * xy[:, 1]])
    wrong = xyz.copy()
    wrong[::100, 2] += 500.0
    x, y = rng.uniform(50.0, 950.0, (2, 500))
    heights = ground_of_points(wrong).heights(x, y)
    np.testing.assert_allclose(heights, 50.0 + 0.1 * x - 0.05 * y, atol=4.0)
