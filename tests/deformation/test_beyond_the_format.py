"""Image errors beyond the format are those of its edge, whatever a polynomial does there."""

from dataclasses import replace

import numpy as np
import pytest

from aerotri.deformation.photo_errors import seams_mm
from aerotri.deformation.restitution import restitution_of
from aerotri.pipeline import adjust_keeping_system
from aerotri.terrain.adjustment_part import covariances_at
from small_blocks import small_block


@pytest.fixture(scope="module")
def calibration():
    return adjust_keeping_system(small_block(2, "bluh:1-12")[0])


@pytest.fixture(scope="module")
def folding(calibration):
    """A radial polynomial that turns back at 1.2 times the corner of the format."""
    restitution = restitution_of(calibration)
    one = restitution.errors[0]
    corner = float(np.hypot(*one.camera.half_format_mm))
    brown = np.zeros_like(one.function.brown)
    brown[0] = 1.0 / (3.0 * (1.2 * corner) ** 2)
    return replace(one, function=replace(one.function, linear=(), brown=brown))


def test_positions_far_outside_have_the_errors_of_the_edge(folding):
    half = np.array(folding.camera.half_format_mm)
    far = np.array([[1.5, 1.2], [-4.0, 0.3], [0.1, -8.0]]) * half
    found = folding.measured(far)
    edge = np.clip(found, -half, half)
    np.testing.assert_allclose(found - far, folding.function.of_measured(edge), atol=1e-8)


def test_positions_inside_are_what_they_were(folding):
    half = np.array(folding.camera.half_format_mm)
    measured = np.random.default_rng(1).uniform(-0.99, 0.99, (200, 2)) * half
    ideal = measured - folding.function.of_measured(measured)
    seams = seams_mm(folding.camera)
    tiles = [[np.searchsorted(seam, xy[:, k]) for k, seam in enumerate(seams)] for xy in (measured, ideal)]
    own = np.all(np.equal(*tiles), axis=0)
    assert own.sum() > 50
    np.testing.assert_allclose(folding.measured(ideal[own]), measured[own], atol=1e-6)


def test_places_that_a_photograph_does_not_show_end_no_surface(calibration, folding):
    """Their rays lie far outside of the format, where the polynomial has turned back."""
    restitution = replace(restitution_of(calibration), errors=(folding,))
    points = calibration.result.points.xyz
    far = points[np.isfinite(points).all(axis=1)][:1] + np.array([[600.0, 0.0, 0.0]])
    rows = np.arange(len(calibration.result.block.images))
    assert np.isfinite(covariances_at(calibration, restitution, rows, far, rows[None, :4])).all()
