"""The deformation of a whole block, and the same in a CRS."""

from dataclasses import replace

import numpy as np
import pytest

from aerotri.conventions import InputError
from aerotri.coordinates import local_frame
from aerotri.deformation.block_models import block_models, deform_block, strip_pairs
from aerotri.deformation.dem_window import dem_models
from aerotri.deformation.model_grid import (
    FlatGround,
    deform_pair,
    deform_places,
    mean_ground,
    nodes_between,
    pair_of,
    places_of,
)
from aerotri.deformation.restitution import restitution_of
from aerotri.deformation.stereo_model import deform_points, seen_by_both
from aerotri.functional_model.rotation import angles_from_rotation, rotation_from_angles
from aerotri.pipeline import adjust_keeping_system

EDGE_OF_THE_ZONE = np.array([[850_000.0, 5_456_000.0, 280.0]])


@pytest.fixture(scope="module")
def whole(calibration):
    restitution = restitution_of(calibration, "absorbed")
    return restitution, deform_block(calibration, restitution, FlatGround(mean_ground(calibration)), 40.0)


def test_models_follow_the_strips(calibration):
    """Photographs in shuffled order still pair with their neighbours; a step of two leaves every second one out."""
    restitution = restitution_of(calibration)
    names = calibration.local.block.images.names

    def named(pairs):
        return {frozenset((str(names[a]), str(names[b]))) for a, b in pairs}

    found = named(strip_pairs(calibration, restitution))
    assert frozenset(("2_003", "2_004")) in found
    assert frozenset(("2_003", "2_005")) not in found
    assert all(len({name[:2] for name in pair}) == 1 for pair in found)
    assert len(found) == 3 * 5 + 4
    # 60 % photographs two apart overlap by a fifth at most
    assert len(strip_pairs(calibration, restitution, 2)) < len(found)
    with pytest.raises(InputError, match="step"):
        strip_pairs(calibration, restitution, 0)


def test_every_node_is_that_of_the_nearest_model(calibration, whole):
    restitution, d = whole
    models = block_models(calibration, restitution, strip_pairs(calibration, restitution))
    rows, columns = np.nonzero(d.number >= 0)
    for k in np.random.default_rng(7).choice(len(rows), 15, replace=False):
        i, j = rows[k], columns[k]
        point = np.array([[d.x[j], d.y[i], d.z[i, j]]])
        distance = [np.hypot(*(point[0, :2] - m.middle)) for m in models]
        seeing = [n for n, m in enumerate(models) if seen_by_both(m.model, point)[0]]
        nearest = min(seeing, key=lambda n: distance[n])
        assert d.number[i, j] == nearest
        np.testing.assert_allclose(d.d[i, j], deform_points(models[nearest].model, point).d[0], atol=1e-9)
    np.testing.assert_array_equal(np.isfinite(d.d[..., 2]), d.number >= 0)
    np.testing.assert_array_equal(np.isfinite(d.sigma[..., 2]), d.number >= 0)


def test_seams_are_steps_between_two_models(whole):
    """One seam recomputed node by node."""
    _, d = whole
    seam = max(d.seams, key=lambda s: s.count)
    first, second = (d.models[k].model for k in (seam.first, seam.second))
    steps = []
    for i, j in np.argwhere((d.number == seam.first) | (d.number == seam.second)):
        around = [(i + di, j + dj) for di, dj in ((0, 1), (1, 0), (0, -1), (-1, 0))]
        other = seam.second if d.number[i, j] == seam.first else seam.first
        if any(0 <= a < len(d.y) and 0 <= b < len(d.x) and d.number[a, b] == other for a, b in around):
            point = np.array([[d.x[j], d.y[i], d.z[i, j]]])
            steps.append((deform_points(first, point).d - deform_points(second, point).d)[0, 2])
    steps = np.array(steps)[np.isfinite(steps)]
    assert len(steps) == seam.count
    assert seam.mean == pytest.approx(steps.mean(), abs=1e-9)
    assert seam.rms == pytest.approx(np.sqrt(np.mean(steps**2)))
    assert seam.max == pytest.approx(np.abs(steps).max())
    assert [s.rms for s in d.seams] == sorted((s.rms for s in d.seams), reverse=True)
    assert d.step_rms > 0.05


def test_nodes_are_multiples_of_the_spacing():
    x, y = nodes_between(np.array([12.0, -7.0]), np.array([101.0, 33.0]), 10.0)
    np.testing.assert_array_equal(x, np.arange(10.0, 111.0, 10.0))
    np.testing.assert_array_equal(y, np.arange(40.0, -11.0, -10.0))
    for wrong, message in ((0.0, "not possible"), (1e-3, "nodes"), (np.nan, "not possible")):
        with pytest.raises(InputError, match=message):
            nodes_between(np.zeros(2), np.full(2, 1e4), wrong)


@pytest.fixture(scope="module")
def in_crs(calibration):
    """The block given in UTM at the edge of a zone, where grid north and scale are off most, and its first frame."""
    frame = local_frame("EPSG:25832", EDGE_OF_THE_ZONE)
    block = calibration.result.block
    centre = frame.from_local(block.images.centre)
    rotation = np.swapaxes(frame.axes_at(centre), 1, 2) @ rotation_from_angles(block.images.angles)
    images = replace(block.images, centre=centre, angles=angles_from_rotation(rotation))
    control = replace(block.control, xyz=frame.from_local(block.control.xyz))
    return frame, adjust_keeping_system(replace(block, crs="EPSG:25832", images=images, control=control))


@pytest.mark.parametrize("variant", ["free", "absorbed"])
def test_a_block_in_a_crs_suffers_the_same(calibration, in_crs, pair, variant):
    """At the same places, the deformation turned and scaled into the CRS; σ of the height alike."""
    frame, georeferenced = in_crs
    here, there = restitution_of(calibration, variant), restitution_of(georeferenced, variant)
    model = pair_of(here, calibration, *pair)
    x, y = np.meshgrid(np.linspace(-300, 300, 7), np.linspace(-300, 300, 7))
    middle = model.true.centre.mean(axis=0)
    xyz = np.column_stack([middle[0] + x.ravel(), middle[1] + y.ravel(), np.full(49, mean_ground(calibration))])
    d, sigma, _ = deform_places(model, places_of(calibration), xyz)
    at = frame.from_local(xyz)
    found, found_sigma, _ = deform_places(pair_of(there, georeferenced, *pair), places_of(georeferenced), at)
    seen = np.isfinite(d[:, 2]) & np.isfinite(found[:, 2])
    assert seen.sum() > 15
    expected = np.einsum("nij,nj->ni", frame.crs_per_local(xyz), d)
    # the frame has the axes of the grid: what the CRS changes is its scale, 1.1 ‰ here, a tenth of a millimetre in plan
    np.testing.assert_allclose(found[seen, :2], expected[seen, :2], rtol=0.0, atol=2e-5)
    np.testing.assert_allclose(found[seen, 2], expected[seen, 2], rtol=0.0, atol=2e-4)
    assert np.abs(found[seen, :2] - d[seen, :2]).max() > 1e-4
    np.testing.assert_allclose(found_sigma[seen, 2], sigma[seen, 2], rtol=1e-3)
    # demcor's kernels in the CRS: from the wrong place back to the true one
    models = dem_models(georeferenced, there, (pair,))
    back = models.deformation_at(np.zeros(seen.sum(), np.int32), at[seen] + found[seen])
    # a y-parallax is not in a DEM: see models.md 7
    np.testing.assert_allclose(back, found[seen], atol=5e-4)


def test_grid_of_a_pair_in_a_crs(in_crs, pair):
    _, georeferenced = in_crs
    level = mean_ground(georeferenced)
    d = deform_pair(georeferenced, restitution_of(georeferenced), pair, FlatGround(level), 50.0)
    assert d.crs == "EPSG:25832"
    assert abs(d.x.mean() - 850_000.0) < 2_000.0
    assert np.isfinite(d.d[..., 2]).sum() > 50
    assert 0.5 < d.geometry.end_lap < 0.7
    names = georeferenced.local.block.images.names
    restitution, apart = restitution_of(georeferenced), (str(names[0]), str(names[5]))
    with pytest.raises(InputError, match="do not overlap"):
        deform_pair(georeferenced, restitution, apart, FlatGround(level))


def test_pairs_that_are_refused(calibration):
    restitution = restitution_of(calibration)
    for left, right, message in (("2_003", "9_999", "9_999"), ("2_003", "2_003", "twice")):
        with pytest.raises(InputError, match=message):
            pair_of(restitution, calibration, left, right)
