"""σ of an orthophoto over a surface of the same adjustment, against simulated truth."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from rendered_blocks import CAMERA

from aerotri.adjustment.datum import motions_of_points
from aerotri.deformation.restitution import FREE, restitution_of
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.pipeline import adjust_keeping_system
from aerotri.rasters.grids import Grid
from aerotri.simulation import parse_spec, simulate
from aerotri.terrain.adjustment_part import (
    both_covariances_at,
    covariances_at,
    plan_covariances,
    shown_covariances,
    solved_partials,
)
from aerotri.terrain.ortho.accuracy import HeightSigma, ShownCells, plan_accuracy, shown_variances, slopes
from small_blocks import small_spec

SLOPE = np.array([0.3, -0.2])
CORNERS = np.array([[1.0, 1.0], [-1.0, 0.5]])
"""Where in a photograph a place is looked at, in tangents of 15°."""


def adjusted(seed, **control):
    tables = small_spec(camera={"cam": CAMERA})
    tables["flight"] = tables["flight"] | {"gsd_m": 1.0, "strips": 2, "images_per_strip": 4, "cross_strips": []}
    tables["tie_points"] = {"per_image": 60, "probability": 0.9, "sigma_um": 90.0}
    tables["control"] = {"distance_bases": 2.0, "sigma_m": [0.1] * 3} | control
    block, made = simulate(parse_spec(tables), seed)
    calibration = adjust_keeping_system(block)
    return block, made, calibration, restitution_of(calibration, FREE)


def rays_of(truth, used, place, images):
    """Of true rays to a place (3,): (k, 3) centres and directions as the adjusted orientation has them."""
    centre, angles, block = truth
    found = []
    for k in images:
        seen = rotation_from_angles(angles[k][None], block.rotation)[0].T @ (place - centre[k])
        found.append((used.centre[k], used.rotation[k] @ (seen / -seen[2])))
    return np.array(found).transpose(1, 0, 2)


def intersected(centre, direction, start):
    """The place (3,) whose rays fit best in the image: distances off them, by their lengths."""
    normal, right = np.zeros((3, 3)), np.zeros(3)
    for c, d in zip(centre, direction / np.linalg.norm(direction, axis=1)[:, None], strict=True):
        off = (np.eye(3) - np.outer(d, d)) / np.sum((start - c) ** 2)
        normal, right = normal + off, right + off @ c
    return np.linalg.solve(normal, right)


def seen_by(made, place):
    """The four nearest photographs of those whose format holds a place, about."""
    away = np.hypot(*(made.centre[:, :2] - place[:2]).T)
    return np.argsort(away, kind="stable")[:4]


@pytest.mark.parametrize("slope", [np.zeros(2), SLOPE])
def test_details_lie_as_the_joint_covariance_says(slope):
    """Places on a plane that moves as the surface does, met by the ray of one photograph, in 20 adjustments."""
    normalised, apart = [], []
    for seed in range(20):
        block, made, calibration, restitution = adjusted(seed)
        rows, truth = np.arange(len(block.images)), (made.centre, made.angles, block)
        for image in (1, 6):
            for tangent in CORNERS:
                height = made.centre[image, 2] - 20.0
                place = made.centre[image] + np.append(np.tan(np.radians(15.0)) * tangent * height, -height)
                images = seen_by(made, place)
                centre, direction = rays_of(truth, restitution.true, place, images)
                surface = intersected(centre, direction, place) - place
                own = rays_of(truth, restitution.true, place, [image])
                shown = met(own[0][0], own[1][0], place + surface, slope)
                along = (place - made.centre[image])[None]
                cells = ShownCells(
                    place[None], np.array([image]), along[:, :2] / along[:, 2:], slope[None], images[None]
                )
                given = calibration, restitution, rows, place[None], np.array([image])
                variance = shown_variances(cells, shown_covariances(*given, images[None])[0])[0]
                normalised.append((shown - place)[:2] / np.sqrt(variance))
                of_height = covariances_at(*given[:4], images[None])[0, 2, 2] * cells.along[0] ** 2
                apart.append(np.sqrt((np.diagonal(plan_covariances(*given)[0]) + of_height) / variance))
    assert 0.85 < np.sqrt(np.mean(np.square(normalised))) < 1.15
    # σ that takes height and plan for independent is another one
    assert np.abs(np.log(np.array(apart))).max() > 0.2


def met(centre, direction, place, slope):
    """(3,) where a ray meets the plane through a place with a slope (2,)."""
    normal = np.append(-slope, 1.0)
    return centre + direction * (normal @ (place - centre)) / (normal @ direction)


def test_what_a_similarity_of_all_places_leaves():
    """The blocks of S·C·Sᵀ, C the joint covariance of the places of a surface written out."""
    block, made, calibration, restitution = adjusted(3, distance_bases=100.0, sigma_m=[5.0, 5.0, 5.0])
    rows, points = np.arange(len(block.images)), calibration.local.points.xyz
    xyz = points[np.flatnonzero(calibration.local.points.rays >= 4)][:30]
    photographs = np.array([seen_by(made, place)[:3] for place in xyz])
    absolute, relative = both_covariances_at(calibration, restitution, rows, xyz, photographs)
    solved = solved_partials(calibration, restitution, rows, xyz, photographs)
    by_unknowns = solved.reshape(len(solved), -1)
    joint = calibration.local.outcome.sigma0**2 * (by_unknowns.T @ np.linalg.solve(dense_q(calibration), by_unknowns))
    each = np.arange(len(xyz))
    blocks = joint.reshape(len(xyz), 3, len(xyz), 3)[each, :, each]
    assert blocks == pytest.approx(absolute, rel=1e-5, abs=1e-9)
    g = motions_of_points(xyz - xyz.mean(axis=0)).reshape(-1, 7)
    left = np.eye(len(g)) - g @ np.linalg.solve(g.T @ g, g.T)
    blocks = (left @ joint @ left.T).reshape(len(xyz), 3, len(xyz), 3)[each, :, each]
    assert blocks == pytest.approx(relative, rel=1e-4, abs=1e-6 * np.abs(relative).max())
    # metres of control lift and tilt the whole
    assert np.median(relative[:, 2, 2]) < 0.1 * np.median(absolute[:, 2, 2])


def dense_q(calibration):
    """Q of photographs and shared parameters, column by column."""
    system = calibration.system
    factor = system.factorise(calibration.solution.equations)
    return factor.solve(np.eye(6 * len(system.unknowns.images) + len(system.unknowns.shared)))


def test_a_shift_of_the_block_moves_details_as_it_does_the_surface():
    """With points nearly free of error and poor control, a detail is as uncertain as the surface in X and Y."""
    block, made, calibration, restitution = adjusted(
        3, distance_bases=100.0, sigma_m=[5.0, 5.0, 5.0]
    )  # fmt: skip
    place = made.centre[1] + np.array([150.0, 100.0, 100.0 - made.centre[1, 2]])
    images, rows = seen_by(made, place)[None], np.arange(len(block.images))
    along = (place - made.centre[1])[None]
    cells = ShownCells(place[None], np.array([1]), along[:, :2] / along[:, 2:], SLOPE[None], images)
    both = shown_covariances(calibration, restitution, rows, place[None], np.array([1]), images)[0]
    np.testing.assert_allclose(shown_variances(cells, both)[0], np.diagonal(both[0, 3:5, 3:5]), rtol=0.1)
    # and not as the height of the surface and the ray apart would make it
    alone = plan_covariances(calibration, restitution, rows, place[None], np.array([1]))[0]
    apart = np.diagonal(alone) + cells.along[0] ** 2 * both[0, 5, 5]
    assert (apart > 1.1 * shown_variances(cells, both)[0]).all()


def test_slopes_are_those_of_a_plane_and_none_at_steps():
    grid = Grid(6, 8, 10.0, 30.0, 2.0, 2.0)
    x, y = np.meshgrid(grid.x(np.arange(8)), grid.y(np.arange(6)))
    z = 0.3 * x - 0.2 * y
    np.testing.assert_allclose(slopes(z, grid)[1:-1, 1:-1], np.broadcast_to([0.3, -0.2], (4, 6, 2)))
    step = np.where(np.arange(8) < 4, 0.0, 10.0) + np.zeros((6, 1))
    np.testing.assert_array_equal(slopes(step, grid), 0.0)
    z[2, 3] = np.nan
    assert np.isfinite(slopes(z, grid)).all()


def looking(down, north):
    """(3, 3) of a camera that looks along a direction which leans by (down) degrees from the vertical to the north."""
    c, s = np.cos(np.radians(down)), np.sin(np.radians(down))
    turned = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    a, b = np.cos(np.radians(north)), np.sin(np.radians(north))
    return np.array([[a, -b, 0.0], [b, a, 0.0], [0.0, 0.0, 1.0]]) @ turned


@pytest.mark.parametrize("slope", [np.zeros(2), SLOPE])
@pytest.mark.parametrize("tilt", [0.0, 20.0, 45.0])
def test_image_part_is_what_a_moved_image_position_does_on_the_ground(tilt, slope):
    """Rays of image positions moved by σ along x and along y meet the ground off the place; RMS of X and Y of both."""
    block, made, calibration, restitution = adjusted(1)
    rotation = restitution.true.rotation.copy()
    rotation[1] = looking(tilt, 30.0)
    restitution = replace(restitution, true=replace(restitution.true, rotation=rotation))
    centre, interior = restitution.true.centre[1], restitution.true.interior[1]
    sigma_mm = 1e-3 * calibration.local.outcome.sigma0_um
    on_image = np.array([[4.0, -7.0], [4.0 + 1e-3, -7.0], [4.0, -7.0 + 1e-3]])
    rays = np.column_stack([(on_image - interior[1:]) / interior[0], np.full(3, -1.0)]) @ rotation[1].T
    place = centre - rays[0] / rays[0, 2] * 600.0
    moved = np.array([met(centre, ray, place, slope)[:2] - place[:2] for ray in rays[1:]]) / 1e-3
    expected = sigma_mm * np.sqrt(0.5 * np.sum(moved**2))
    # three by three coarse cells of a plane around the place
    grid = Grid(3, 3, place[0] - 15.0, place[1] + 15.0, 10.0, 10.0)
    x, y = np.meshgrid(grid.x(np.arange(3)), grid.y(np.arange(3)))
    z = place[2] + slope[0] * (x - place[0]) + slope[1] * (y - place[1])
    number = np.full((3, 3), -1)
    number[1, 1] = 1
    photographs = SimpleNamespace(rows=np.arange(len(block.images)), centres=made.centre, restitution=restitution)
    candidates = SimpleNamespace(grid=grid, z=z, found=np.full((1, 3, 3), 1))
    found = plan_accuracy(calibration, photographs, candidates, SimpleNamespace(number=number), HeightSigma())
    assert found.image[1, 1] == pytest.approx(expected, rel=1e-3)
    assert found.surface is None
    assert found.total[1, 1] == pytest.approx(np.hypot(found.image[1, 1], found.orientation[1, 1]))
    assert np.isnan(found.total).sum() == 8


@pytest.mark.parametrize("apart", [0.0, 0.05])
def test_heads_of_one_station_say_nothing_of_the_surface(apart):
    """A cell that only two heads of one station see beside one with a base: σ of both is about the same."""
    block, _, calibration, restitution = adjusted(1)
    centre, rotation = restitution.true.centre.copy(), restitution.true.rotation.copy()
    centre[2] = centre[1] + (apart, 0.0, 0.0)
    rotation[2] = rotation[1] @ looking(5.0, 20.0)
    restitution = replace(restitution, true=replace(restitution.true, centre=centre, rotation=rotation))
    place = centre[1] + (60.0, 40.0, 100.0 - centre[1, 2])
    grid = Grid(1, 2, place[0] - 5.0, place[1] + 5.0, 10.0, 10.0)
    photographs = SimpleNamespace(rows=np.arange(len(block.images)), centres=centre, restitution=restitution)
    # photographs 1 and 0 of the first cell, 1 and 2 of the second
    candidates = SimpleNamespace(grid=grid, z=np.full((1, 2), 100.0), found=np.array([[[1, 1]], [[0, 2]]]))
    choice = SimpleNamespace(number=np.full((1, 2), 1))
    found = plan_accuracy(calibration, photographs, candidates, choice, HeightSigma(same=True))
    assert found.same
    assert found.orientation[0, 1] == pytest.approx(found.orientation[0, 0], rel=0.1)
    # where no cell has a base, the surface counts as one from elsewhere
    candidates.found[1] = 2
    alone = plan_accuracy(calibration, photographs, candidates, choice, HeightSigma(same=True))
    assert not alone.same
    assert np.isfinite(alone.total).all()
