"""Which mark next: what is foretold of a measurement is what comes when it is made."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import aerotri
from aerotri.bench.next_mark import next_marks
from aerotri.bench.prediction import Prediction
from aerotri.observations import ImagePoints
from small_blocks import small_block


def without(block, rows: np.ndarray):
    keep = np.ones(len(block.image_points), bool)
    keep[rows] = False
    r = block.image_points
    return replace(block, image_points=ImagePoints(r.image[keep], r.point[keep], r.xy[keep], r.sigma[keep]))


def rms_cofactor(result) -> float:
    """Root mean square σ of a coordinate over σ0."""
    variance = np.trace(result.record.local.points.covariance, axis1=1, axis2=2)
    return float(np.sqrt(np.nanmean(variance) / 3.0)) / result.sigma0


@pytest.fixture(scope="module", params=["known", "calibrated"])
def thinned(request):
    """A block whose control points are measured in two photographs each, and the whole one.

    With a camera that is known, and with one whose principal distance, principal point and lens are not.
    """
    block, _ = small_block(seed=6, parameters="none" if request.param == "known" else "brown:K1+P1")
    if request.param == "calibrated":
        camera = block.cameras[0]
        free = {name: replace(prior, fixed=False, sigma=None) for name, prior in camera.interior.items()}
        block = replace(block, cameras=(replace(camera, interior=free),))
    rays, control = block.image_points, block.control.point[~block.control.is_check]
    rows = [np.flatnonzero(rays.point == p)[2:] for p in control.tolist()]
    return block, without(block, np.concatenate(rows))


def test_first_mark_does_what_is_foretold_and_more_than_the_last(thinned):
    block, thin = thinned
    result = aerotri.adjust(thin, model_part="off")
    marks = next_marks(result.record, Prediction(result.record))
    assert len(marks) > 5
    assert marks[0].after < marks[-1].after < marks[0].before * (1.0 + 1e-12)
    before, rays = rms_cofactor(result), block.image_points
    assert marks[0].before == pytest.approx(before * result.sigma0, rel=1e-6)
    gained = []
    for one in (next(m for m in marks if m.is_control), marks[-1]):
        row = np.flatnonzero((rays.image == one.image) & (rays.point == one.point))
        r = thin.image_points
        if len(row):
            xy = rays.xy[row]
        else:
            camera = block.cameras[0]
            xy = (np.array([one.place]) - np.array(camera.size_px) / 2) * [camera.pixel_mm, -camera.pixel_mm]
        more = ImagePoints(
            np.append(r.image, one.image), np.append(r.point, one.point), np.vstack([r.xy, xy]),
            np.vstack([r.sigma, np.median(r.sigma, axis=0)]),
        )  # fmt: skip
        after = rms_cofactor(aerotri.adjust(replace(thin, image_points=more), model_part="off"))
        foretold = one.after / result.sigma0
        gained.append((before - after, before - foretold))
    assert gained[0][0] > 2.0 * abs(gained[1][0])
    assert gained[0][1] == pytest.approx(gained[0][0], rel=0.25)


def test_places_are_where_the_points_are_measured_in_the_whole_block(thinned):
    block, thin = thinned
    result = aerotri.adjust(thin, model_part="off")
    camera, rays, found = block.cameras[0], block.image_points, 0
    for one in next_marks(result.record, Prediction(result.record)):
        row = np.flatnonzero((rays.image == one.image) & (rays.point == one.point))
        assert not ((thin.image_points.image == one.image) & (thin.image_points.point == one.point)).any()
        if len(row):
            found += 1
            px = rays.xy[row[0]] / [camera.pixel_mm, -camera.pixel_mm] + np.array(camera.size_px) / 2
            assert np.abs(px - one.place).max() < 3.0
    assert found >= 3


def test_control_that_nobody_measured_is_named(thinned):
    """Its coordinates are not in the adjustment yet: the first ray brings little, its place is told."""
    block, _ = thinned
    control = int(block.control.point[~block.control.is_check][0])
    thin = without(block, np.flatnonzero(block.image_points.point == control))
    result = aerotri.adjust(thin, model_part="off")
    marks = [one for one in next_marks(result.record, Prediction(result.record)) if one.point == control]
    assert marks
    assert all(one.is_control and one.after < one.before for one in marks)
