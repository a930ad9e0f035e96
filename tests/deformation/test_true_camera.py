"""The correction against a camera whose errors no parameter set knows: points as it really shows them."""

from __future__ import annotations

import numpy as np
import pytest

from aerotri.deformation import dem_models, restitution_of
from aerotri.deformation.orientation import Orientation, calibrated_orientation
from aerotri.deformation.stereo_model import intersect, project
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.pipeline import adjust_keeping_system
from aerotri.simulation import parse_spec, simulate
from aerotri.simulation.projection import measured_positions
from aerotri.simulation.rendering import make_scene
from small_blocks import ERRING, small_spec, with_adjustment


@pytest.fixture(scope="module")
def heights(calibration):
    """(n, 2, 2) m, errors of heights: in two models that share a photograph, before and after the correction.

    As in Spreckels et al., section 2: oriented by an adjustment without parameters, photographs used as they are.
    """
    spec = parse_spec(small_spec(**ERRING))
    block, truth = simulate(spec, 3)
    scene = make_scene(spec, 3, block, truth)
    true = Orientation(truth.centre, rotation_from_angles(truth.angles), truth.interior[block.images.camera])
    plain = adjust_keeping_system(with_adjustment(block, additional_parameters=()))
    used = calibrated_orientation(plain)
    names = [str(name) for name in block.images.names]
    triples = [[names.index(f"{strip}_{k + j:03d}") for j in range(3)] for strip in (1, 2, 3) for k in range(1, 5)]
    pairs = tuple((names[three[j]], names[three[j + 1]]) for three in triples for j in range(2))
    models = dem_models(calibration, restitution_of(calibration, used=used), pairs)
    found = []
    for k, three in enumerate(triples):
        x, y = np.meshgrid(np.linspace(-300, 300, 31), np.linspace(-300, 300, 31))
        centre = truth.centre[three[1]]
        points = np.column_stack([centre[0] + x.ravel(), centre[1] + y.ravel(), np.full(x.size, 100.0)])
        shown = [measured_positions(project(true, row, points), scene.fields[row]) for row in three]
        seen = np.all([ok & (np.abs(xy) < block.cameras[0].half_format_mm).all(axis=1) for xy, ok in shown], axis=0)
        off = []
        for j in range(2):
            xy = np.stack([shown[j][0][seen], shown[j + 1][0][seen]])
            wrong = intersect(used.take(three[j : j + 2]), xy, points[seen])[0]
            back = wrong - models.deformation_at(np.full(len(wrong), 2 * k + j, np.int32), wrong)
            off.append(np.column_stack([wrong[:, 2], back[:, 2]]) - 100.0)
        found.append(np.stack(off, axis=1))
    found = np.concatenate(found)
    return found[np.isfinite(found).all(axis=(1, 2))]


def test_heights_come_nearer_to_the_truth(heights):
    """What is left is the small block's own error of heights, with noise and few control points."""
    assert len(heights) > 500
    before, after = np.sqrt(np.mean(heights**2, axis=(0, 1)))
    assert before > 0.25
    assert after < 0.7 * before


def test_neighbouring_models_come_nearer_to_one_another(heights):
    before, after = np.sqrt(np.mean((heights[:, 0] - heights[:, 1]) ** 2, axis=0))
    assert before > 0.15
    assert after < before / 3.0
