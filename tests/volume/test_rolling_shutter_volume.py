"""σ of a volume from photographs of a rolling shutter: partials, identity, what leaving it alone does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aerotri.adjustment.unknowns import Step
from aerotri.deformation.error_parameters import shared_columns
from aerotri.deformation.orientation import calibrated_orientation
from aerotri.functional_model.rotation import exponential
from aerotri.observations import Prior
from aerotri.pipeline import adjust_keeping_system
from aerotri.volume.pickets import Pickets
from aerotri.volume.response import respond
from rolling_blocks import rolling_block


def adjusted(readout: Prior, **shutter):
    block, _ = rolling_block(3)
    settings = replace(block.settings.adjustment, model_part="off")
    camera = block.cameras[0]
    stated = replace(camera.rolling_shutter, test="off", readout_ms=readout, **shutter)
    cameras = (replace(camera, rolling_shutter=stated),)
    return adjust_keeping_system(replace(block, cameras=cameras, settings=replace(block.settings, adjustment=settings)))


@pytest.fixture(scope="module")
def moving():
    return adjusted(Prior(30.0, 0.5), motion="photograph", motion_sigma_m_s=0.2, rotation="photograph")


def some_pickets(found):
    """Tie points as pickets, and a weight of each: σ of the response is that of a weighted mean of heights."""
    points, rays = found.local.points, found.local.block.image_points
    rows = np.flatnonzero((points.rays >= 4) & np.isfinite(points.xyz).all(axis=1))[:6]
    images = [rays.image[rays.point == row] for row in rows]
    start = np.concatenate([[0], np.cumsum([len(own) for own in images])])
    gradient = np.random.default_rng(0).uniform(-1.0, 1.0, (len(rows), 3))
    sigma = np.full(int(start[-1]), 1e-3)
    return Pickets(points.xyz[rows], start, np.concatenate(images), sigma, np.ones(len(rows))), gradient


def exposed_at(orientation, i, xy):
    """Rotation and projection centre when a ray is exposed, written out."""
    s = orientation.scans
    if s is None:
        return orientation.rotation[i], orientation.centre[i]
    tau = float(xy @ s.rate[i]) * s.readout[i]
    return orientation.rotation[i] @ exponential(s.spin[i] * tau), orientation.centre[i] + (
        orientation.rotation[i] @ s.velocity[i] * tau
    )


def projected(orientation, i, xy, point):
    rotation, centre = exposed_at(orientation, i, xy)
    (c, x0, y0), u = orientation.interior[i], rotation.T @ (point - centre)
    return np.array([x0 - c * u[0] / u[2], y0 - c * u[1] / u[2]])


def measured_now(orientation, pickets):
    out = np.zeros((len(pickets.image), 2))
    for _ in range(5):
        for k, point in enumerate(pickets.xyz):
            for r in range(pickets.start[k], pickets.start[k + 1]):
                out[r] = projected(orientation, pickets.image[r], out[r], point)
    return out


def intersected(orientation, pickets, xy):
    """The pickets from their measured rays: Gauss–Newton with numeric partials."""
    points = pickets.xyz.copy()
    for k in range(len(points)):
        rays = range(pickets.start[k], pickets.start[k + 1])

        def predicted(point, rays=rays):
            return np.concatenate([projected(orientation, pickets.image[r], xy[r], point) for r in rays])

        wanted = np.concatenate([xy[r] for r in rays])
        for _ in range(2):
            a = np.column_stack(
                [(predicted(points[k] + h) - predicted(points[k] - h)) / 2e-3 for h in 1e-3 * np.eye(3)]
            )
            points[k] += np.linalg.lstsq(a, wanted - predicted(points[k]), rcond=None)[0]
    return points


def test_partials_by_motion_and_orientation_are_the_numeric_ones(moving):
    pickets, gradient = some_pickets(moving)
    response = respond(moving, pickets, gradient)
    xy = measured_now(calibrated_orientation(moving), pickets)
    system, state = moving.system, moving.solution.state
    n, columns = len(system.unknowns.images), shared_columns(moving)
    kinds, found = np.array(system.unknowns.shared.kinds), response.unknowns
    rolling = [int(c) for c in columns if kinds[c] == "rolling_shutter"]
    # the readout time, and the unknowns of the photographs that matter most
    chosen = [6 * n + c for c in [rolling[0], *sorted(rolling[1:], key=lambda c: -abs(found[6 * n + c]))[:2]]]
    chosen += np.argsort(-np.abs(found[: 6 * n]))[:2].tolist()
    for place in chosen:
        step = np.zeros(len(found))
        step[place] = 1e-3
        ends = []
        for sign in (1.0, -1.0):
            moved = Step(sign * step[: 6 * n].reshape(n, 6), sign * step[6 * n :], np.zeros_like(state.points))
            other = system.unknowns.advance(state, moved)
            orientation = calibrated_orientation(replace(moving, solution=replace(moving.solution, state=other)))
            centre, rotation = orientation.centre.copy(), orientation.rotation.copy()
            centre[system.unknowns.images], rotation[system.unknowns.images] = (
                other.centre + system.unknowns.origin, other.rotation
            )  # fmt: skip
            orientation = replace(orientation, centre=centre, rotation=rotation)
            ends.append(float(np.sum(gradient * intersected(orientation, pickets, xy))))
        assert (ends[0] - ends[1]) / 2e-3 == pytest.approx(found[place], rel=2e-3)


def test_uncorrected_motion_is_what_intersection_without_it_gives(moving):
    pickets, gradient = some_pickets(moving)
    orientation = calibrated_orientation(moving)
    xy = measured_now(orientation, pickets)
    wrong = intersected(orientation.standing_still, pickets, xy)
    expected = float(np.sum(gradient * (wrong - pickets.xyz)))
    assert abs(expected) > 0.02
    assert respond(moving, pickets, gradient).error == pytest.approx(expected, rel=0.02)


def test_sigma_knows_the_readout_time(moving):
    """A known readout time makes a smaller σ than one that is nearly free."""
    loose, tight = adjusted(Prior(30.0, 3.0)), adjusted(Prior(30.0, 1e-6))
    pickets, gradient = some_pickets(loose)
    gradient[:, :2], gradient[:, 2] = 0.0, 1.0 / len(gradient)
    of_loose, of_tight = (respond(one, pickets, gradient) for one in (loose, tight))
    ratio = [one.variance / case.local.outcome.sigma0**2 for one, case in ((of_loose, loose), (of_tight, tight))]
    assert ratio[0] > ratio[1]
    column = 6 * len(loose.system.unknowns.images) + int(shared_columns(loose)[-1])
    assert of_loose.unknowns[column] != 0.0
    uncorrected = respond(loose, pickets, gradient, corrected=False)
    assert uncorrected.unknowns[column] == 0.0
