"""What follows an adjustment with a rolling shutter: model deformation, corrected DEMs and photographs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aerotri.adjustment.unknowns import Step
from aerotri.deformation.dem_window import dem_models
from aerotri.deformation.error_parameters import error_rows, shared_columns
from aerotri.deformation.model_grid import places_of
from aerotri.deformation.moving_photographs import ground_plane, moving_errors, relief_left
from aerotri.deformation.orientation import calibrated_orientation
from aerotri.deformation.restitution import restitution_of
from aerotri.deformation.stereo_model import deform_points, intersect, measured, pair_model, partials_by_parameters
from aerotri.functional_model.rotation import exponential
from aerotri.image_errors import image_groups
from aerotri.image_errors.error_function import error_function
from aerotri.image_errors.ideal_map import ideal_map
from aerotri.observations import Prior
from aerotri.pipeline import adjust_keeping_system
from rolling_blocks import rolling_block

PAIR = (1, 2)


def adjusted(readout: Prior | None = None, parameters=(("brown", ("K1", "P1")),), **shutter):
    block, truth = rolling_block(3)
    settings = replace(block.settings.adjustment, additional_parameters=parameters, model_part="off")
    camera = block.cameras[0]
    stated = replace(camera.rolling_shutter, test="off", **shutter)
    stated = stated if readout is None else replace(stated, readout_ms=readout)
    cameras = (replace(camera, rolling_shutter=stated),)
    return adjust_keeping_system(
        replace(block, cameras=cameras, settings=replace(block.settings, adjustment=settings))
    ), truth


@pytest.fixture(scope="module")
def moving():
    return adjusted(Prior(30.0, 0.5), motion="photograph", motion_sigma_m_s=0.2, rotation="photograph")[0]


def ground(found, count=40):
    """Places on and about the ground that a pair of photographs sees."""
    rng = np.random.default_rng(2)
    model = pair_model(restitution_of(found), ("1", "2"), PAIR)
    middle = model.true.centre.mean(axis=0)
    low = np.nanmedian(found.local.points.xyz[:, 2])
    around = rng.uniform(-0.3, 0.3, (count, 2)) * (middle[2] - low)
    return model, np.column_stack([middle[:2] + around, low + rng.uniform(-8.0, 8.0, count)])


def at_exposure(orientation, k, point, errors):
    """Where photograph k measures a point, by bisection of the time at which its row is exposed."""
    s, (c, x0, y0) = orientation.scans, orientation.interior[k]

    def seen(tau):
        rotation = orientation.rotation[k] @ exponential(s.spin[k] * tau)
        u = rotation.T @ (point - orientation.centre[k] - orientation.rotation[k] @ s.velocity[k] * tau)
        return errors.measured(np.array([[x0 - c * u[0] / u[2], y0 - c * u[1] / u[2]]]))[0]

    low, high = -0.1, 0.1
    for _ in range(60):
        middle = 0.5 * (low + high)
        late = seen(middle) @ s.rate[k] * s.readout[k] > middle
        low, high = (middle, high) if late else (low, middle)
    return seen(low)


def test_measured_positions_are_those_of_the_row_that_is_exposed(moving):
    model, points = ground(moving, 12)
    found = measured(model, points)
    for k in range(2):
        expected = [at_exposure(model.true, k, point, model.errors[k]) for point in points]
        np.testing.assert_allclose(found[k], expected, rtol=0.0, atol=1e-7)
    # tens of centimetres on the ground are some pixels
    still = measured(replace(model, true=model.true.standing_still), points)
    assert np.abs(found - still).max() > 4.0 * model.errors[0].camera.pixel_mm


def test_held_at_zero_is_no_rolling_shutter():
    """A readout time held at 0 leaves the deformation that image errors alone cause."""
    zero, plain = adjusted(Prior(0.0, fixed=True))[0], None
    block = zero.result.block
    plain = adjust_keeping_system(replace(block, cameras=(replace(block.cameras[0], rolling_shutter=None),)))
    assert restitution_of(zero).true.scans is None
    model, points = ground(zero, 20)
    other, _ = ground(plain, 20)
    np.testing.assert_array_equal(deform_points(model, points).d, deform_points(other, points).d)


def test_deformation_without_readout_is_that_of_the_image_errors(moving):
    model, points = ground(moving)
    scans = model.true.scans
    still = replace(model, true=replace(model.true, scans=scans._replace(readout=np.zeros(2))))
    image_errors = replace(model, true=model.true.standing_still)
    np.testing.assert_allclose(
        deform_points(still, points).d, deform_points(image_errors, points).d, rtol=0.0, atol=1e-9
    )
    assert np.nanmax(np.abs(deform_points(model, points).d - deform_points(still, points).d)) > 0.05


@pytest.mark.parametrize("variant", ["free", "absorbed"])
def test_partials_by_every_parameter_are_the_numeric_ones(moving, variant):
    """Readout time, velocities and rates of rotation beside additional parameters, in the measured positions."""
    restitution = restitution_of(moving, variant)
    model = pair_model(restitution, ("1", "2"), PAIR)
    _, points = ground(moving, 8)
    ((_, found),) = partials_by_parameters(model, points)
    system, state = moving.system, moving.solution.state
    columns, kinds = shared_columns(moving), moving.local.parameters.kinds[error_rows(moving)]
    used = np.flatnonzero((kinds == "rolling_shutter") & np.abs(found).any(axis=(0, 1)))
    own = restitution.true.scans.columns[list(PAIR)]
    assert {int(own[0, 0]), int(own[0, 1]), int(own[1, 2])} <= set(used.tolist())
    for p in [int(own[0, 0]), int(own[0, 1]), int(own[1, 1]) + 1, int(own[0, 2]) + 1, int(own[1, 2])]:
        step = 1e-3 * (10.0 if p == own[0, 0] else 1.0)
        ends = []
        for sign in (1.0, -1.0):
            shared = np.zeros(len(state.shared))
            shared[columns[p]] = sign * step
            other = system.unknowns.advance(
                state, Step(np.zeros((len(system.unknowns.images), 6)), shared, np.zeros_like(state.points))
            )
            moved = replace(moving, solution=replace(moving.solution, state=other))
            true = replace(calibrated_orientation(moved)).take(list(PAIR))
            xy = measured(replace(model, true=true), points)
            used_at = _moved_by(model.used, model.follows[:, :, p] * sign * step)
            ends.append(intersect(used_at, xy, points)[0])
        numeric = (ends[0] - ends[1]) / (2.0 * step)
        # to first order of the image errors over the principal distance, as documented
        np.testing.assert_allclose(found[:, :, p], numeric, rtol=0.0, atol=0.03 * np.abs(numeric).max())


def _moved_by(orientation, change):
    return replace(
        orientation, centre=orientation.centre + change[:, :3],
        rotation=exponential(change[:, 3:6]) @ orientation.rotation, interior=orientation.interior + change[:, 6:],
    )  # fmt: skip


def test_dem_is_brought_back_to_the_truth(moving):
    """A point restituted without the motion is corrected to where it is."""
    restitution = restitution_of(moving)
    model, points = ground(moving, 30)
    d = deform_points(model, points).d
    seen = np.isfinite(d).all(axis=1)
    assert seen.sum() > 20
    models = dem_models(moving, restitution, [tuple(str(n) for n in moving.local.block.images.names[list(PAIR)])])
    places = places_of(moving)
    wrong, true = places.from_local(points[seen] + d[seen]), places.from_local(points[seen])
    back = wrong - models.deformation_at(np.zeros(int(seen.sum()), np.int32), wrong)
    assert np.abs(wrong - true).max() > 0.05
    # rays that hardly meet come back within what their y-parallax does
    np.testing.assert_allclose(back, true, rtol=0.0, atol=0.02 * np.abs(wrong - true).max())


def test_ideal_photograph_is_that_of_one_moment(moving):
    """A place on the ground lies in the ideal photograph where a camera sees it that exposes all rows at once."""
    orientation = calibrated_orientation(moving)
    function = error_function(moving.local, image_groups(moving.local.block)[0])
    row = PAIR[0]
    errors = moving_errors(moving, orientation, row, function)
    model = pair_model(restitution_of(moving), ("1", "2"), PAIR)
    rng = np.random.default_rng(1)
    ideal = rng.uniform(-0.8, 0.8, (12, 2)) * function.camera.half_format_mm
    u = errors._on_ground(ideal)
    np.testing.assert_allclose(u @ errors.plane, 1.0)
    points = u @ orientation.rotation[row].T + orientation.centre[row]
    np.testing.assert_allclose(errors.measured(ideal), measured(model, points)[0], rtol=0.0, atol=1e-7)
    # undulating ground of 2 m below 70 m: some hundredths of the ten pixels of the motion are left
    assert 0.01 < relief_left(moving, orientation, row, errors) < 1.0
    moved = errors.measured(ideal) - function.measured(ideal)
    assert np.abs(moved).max() > 4.0 * function.camera.pixel_mm
    camera = function.camera
    column_row = (ideal / camera.pixel_mm) * [1.0, -1.0] + np.array(camera.size_px) / 2.0 - 0.5
    mapped = ideal_map(errors).tiles[0][0]
    at = np.array([mapped.at(np.array([r]), np.array([c]))[0] for c, r in column_row])
    expected = (errors.measured(ideal) - ideal) / camera.pixel_mm * [1.0, -1.0]
    np.testing.assert_allclose(at, expected, rtol=0.0, atol=0.05)
    still = replace(errors, readout_ms=0.0)
    np.testing.assert_array_equal(still.measured(ideal), function.measured(still.ideal_of(u)))


def test_plane_through_points():
    rng = np.random.default_rng(0)
    xy = rng.uniform(-30.0, 30.0, (40, 2))
    u = np.column_stack([xy, -80.0 + 0.1 * xy[:, 0] - 0.05 * xy[:, 1]])
    np.testing.assert_allclose(u @ ground_plane(np.vstack([u, [[3.0, 2.0, -20.0]]])), 1.0, atol=1e-9)
    np.testing.assert_allclose(ground_plane(u[:2])[2], -1.0 / np.median(-u[:2, 2]), rtol=1e-2)


def test_readout_recovered_and_heights_freed_of_it():
    """Simulated truth: what models show with the rolling shutter left alone, from the adjusted readout."""
    found, truth = adjusted()
    model, points = ground(found, 30)
    scans = model.true.scans
    true_readout = truth.readout_ms["cam"]
    sigma = found.local.parameters.sigma[found.local.parameters.names == "rolling_shutter.readout_ms"][0]
    assert abs(scans.readout[0] - true_readout) < 4.0 * sigma
    exact = replace(model, true=replace(model.true, scans=scans._replace(readout=np.full(2, true_readout))))
    d, expected = deform_points(model, points).d, deform_points(exact, points).d
    seen = np.isfinite(d).all(axis=1) & np.isfinite(expected).all(axis=1)
    assert np.abs(expected[seen, 2]).max() > 0.05
    np.testing.assert_allclose(d[seen], expected[seen], atol=0.05 * np.abs(expected[seen]).max() + 0.01)
