"""First orientation, its place and the rays it refuses: simulated image points in, truth out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aerotri.conventions import InputError, px_from_mm
from aerotri.formats.assembly.parts import PointList, no_sigma
from aerotri.functional_model.rotation import exponential, rotation_from_angles
from aerotri.observations import ImagePoints, Prior
from aerotri.simulation import parse_spec, simulate
from aerotri.tie_points.control_marks import predict_marks
from aerotri.tie_points.first_orientation import map_incrementally
from aerotri.tie_points.georeferencing import place
from aerotri.tie_points.given import Given
from aerotri.tie_points.verification import rays_that_meet

CAMERA = {
    "size_px": [1000, 750],
    "pixel_um": 6.0,
    "focal_length_mm": 6.0,
    "errors": {"lens": {"k1": -0.05, "k2": 0.01}},
}
SPEC = {
    "name": "small",
    "camera": {"cam": CAMERA},
    "flight": {"gsd_m": 0.1, "strips": 2, "images_per_strip": 4, "end_lap": 0.7, "side_lap": 0.4, "heading_deg": 30.0,
               "attitude_sigma_deg": [2.0, 2.0, 3.0], "position_sigma_m": [2.0, 2.0, 2.0]},
    "terrain": {"kind": "undulating", "height_m": 50.0, "relief_rms_m": 6.0, "wavelength_m": 80.0},
    "tie_points": {"per_image": 250, "probability": 0.9, "sigma_um": 0.6},
    "control": {"distance_bases": 1.5, "sigma_m": [0.01, 0.01, 0.02], "check_points": 5},
    "gnss": {"sigma_m": [0.5, 0.5, 0.5]},
}  # fmt: skip


@pytest.fixture(scope="module")
def simulated():
    """A block of eight photographs with an unknown lens, and its truth."""
    block, truth = simulate(parse_spec(SPEC), 2)
    camera = block.cameras[0]
    interior = {**camera.interior, "focal_length_mm": Prior(5.7)}
    lens = {name: Prior() for name in ("k1", "k2")}
    return replace(block, cameras=(replace(camera, interior=interior, lens=lens),)), truth


@pytest.fixture(scope="module")
def mapped(simulated):
    return map_incrementally(simulated[0], seed=5)


def test_orientation_is_that_of_the_truth(simulated, mapped):
    """All photographs; centres to centimetres and attitudes to a milliradian after the similarity; the lens as it is.

    The principal distance began 5 % off.
    """
    block, truth = simulated
    fitted = place(mapped.centre, truth.centre, np.full(8, 0.1))
    assert np.abs(fitted(mapped.centre) - truth.centre).max() < 0.3
    turn = np.swapaxes(rotation_from_angles(truth.angles, block.rotation), 1, 2) @ (fitted.rotation @ mapped.rotation)
    assert np.abs(turn - np.eye(3)).max() < 5e-3
    assert mapped.cameras[0].focal_length_mm == pytest.approx(6.0, rel=0.01)
    assert mapped.cameras[0].lens["k1"].value == pytest.approx(-0.05, abs=0.003)
    assert mapped.cameras[0].lens["k2"].value == pytest.approx(0.01, abs=0.003)


def test_orientation_repeats_bit_for_bit(simulated, mapped):
    again = map_incrementally(simulated[0], seed=5)
    np.testing.assert_array_equal(again.centre, mapped.centre)
    np.testing.assert_array_equal(again.rotation, mapped.rotation)


def test_known_camera_is_left_alone(simulated):
    """Its lens is taken out beforehand; what comes out fits as well."""
    block, truth = simulated
    camera = block.cameras[0]
    interior = {**camera.interior, "focal_length_mm": Prior(6.0, fixed=True)}
    known = replace(camera, interior=interior, lens={"k1": Prior(-0.05, fixed=True), "k2": Prior(0.01, fixed=True)})
    mapped = map_incrementally(replace(block, cameras=(known,)), seed=5)
    assert mapped.cameras == (known,)
    fitted = place(mapped.centre, truth.centre, np.full(8, 0.1))
    assert np.abs(fitted(mapped.centre) - truth.centre).max() < 0.1


def test_nothing_in_common_is_said(simulated):
    block = simulated[0]
    rays = block.image_points
    alone = replace(rays, point=np.arange(len(rays)))
    points = np.arange(len(rays)).astype(str)
    with pytest.raises(InputError, match="overlap"):
        map_incrementally(replace(block, points=points, image_points=alone), seed=1)


def test_wrong_rays_are_found(simulated):
    """Every ray 20 px off is refused, at most one of a thousand others."""
    block, truth = simulated
    rays, rng = block.image_points, np.random.default_rng(4)
    length = np.bincount(rays.point, minlength=len(block.points))[rays.point]
    wrong = rng.choice(np.flatnonzero(length > 3), 60, replace=False)
    wrong = wrong[np.unique(rays.point[wrong], return_index=True)[1]]
    xy = rays.xy.copy()
    angle = rng.uniform(0.0, 2.0 * np.pi, len(wrong))
    xy[wrong] += 20 * 0.006 * np.column_stack([np.cos(angle), np.sin(angle)])
    known = replace(block.cameras[0], interior={**block.cameras[0].interior, "focal_length_mm": Prior(6.0)},
                    lens={"k1": Prior(-0.05), "k2": Prior(0.01)})  # fmt: skip
    changed = replace(block, cameras=(known,), image_points=ImagePoints(rays.image, rays.point, xy, rays.sigma))
    good = rays_that_meet(changed, truth.centre, rotation_from_angles(truth.angles, block.rotation))
    others = np.setdiff1d(np.arange(len(rays)), wrong)
    along = good[wrong].mean()
    assert along <= 0.05, f"{along:.2f} of the wrong rays stayed: more than those that move along their epipolar line"
    assert (~good[others]).mean() < 0.01


def test_control_is_predicted_where_it_is_measured(simulated):
    """Single values, within noise and the σ of control: 1 px; every photograph that sees a point is named."""
    block, truth = simulated
    camera = replace(block.cameras[0], interior={**block.cameras[0].interior, "focal_length_mm": Prior(6.0)},
                     lens={"k1": Prior(-0.05), "k2": Prior(0.01)})  # fmt: skip
    images = replace(block.images, centre=truth.centre, angles=truth.angles)
    oriented, control = replace(block, cameras=(camera,), images=images), block.control
    given = PointList(None, block.points[control.point], control.xyz, control.sigma, control.is_check)
    marks = predict_marks(oriented, given, no_sigma(0).reshape(0, 3))
    found = {
        (str(marks.points[p]), int(i)): xy for p, i, xy in zip(marks.point, marks.image, marks.predicted, strict=True)
    }
    rays = block.image_points
    rows = np.flatnonzero(np.isin(rays.point, control.point))
    px = px_from_mm(rays.xy[rows], camera.size_px, camera.pixel_mm)
    assert len(rows) > 20
    for row, xy in zip(rows, px, strict=True):
        off = found[str(block.points[rays.point[row]]), int(rays.image[row])] - xy
        assert np.abs(off).max() < 1.0


def cloud(count, seed, line=False):
    rng = np.random.default_rng(seed)
    source = rng.normal(0.0, 1.0, (count, 3)) * ([1.0, 1e-3, 1e-3] if line else [1.0, 1.0, 0.2])
    turn, scale, shift = exponential(rng.normal(0.0, 1.5, 3)), 37.0, np.array([400.0, -900.0, 60.0])
    return source, scale * source @ turn.T + shift, turn, scale


def test_similarity_with_a_third_of_blunders():
    source, target, turn, scale = cloud(30, 1)
    target += np.random.default_rng(2).normal(0.0, 0.02, target.shape)
    target[::3] += np.random.default_rng(3).normal(0.0, 20.0, (10, 3))
    found = place(source, target, np.full(30, 0.02))
    assert found.scale == pytest.approx(scale, rel=2e-3)
    assert np.abs(found.rotation - turn).max() < 2e-3
    good = np.setdiff1d(np.arange(30), np.arange(0, 30, 3))
    assert found.misfit[good].max() < 0.2


def test_single_strip_looks_down():
    """Points on a line leave the roll free: the photographs look down on average, and pitch and heading of the line."""
    source, target, turn, scale = cloud(12, 5, line=True)
    looking = np.cross(turn.T @ [0.0, 0.0, -1.0], source[1] - source[0])
    looking = np.cross(source[1] - source[0], looking)
    found = place(source, target, np.full(12, 0.1), looking)
    assert found.scale == pytest.approx(scale, rel=1e-3)
    along = target[1] - target[0]
    down = found.rotation @ looking / np.linalg.norm(looking)
    # as far down as a line with a slope allows
    slope = along[2] / np.linalg.norm(along)
    assert -down[2] == pytest.approx(np.sqrt(1.0 - slope**2), abs=2e-3)
    with pytest.raises(InputError, match="line"):
        place(source, target, np.full(12, 0.1))


def test_two_photographs_are_enough(simulated):
    """A single model: only points with two rays."""
    block, truth = simulated
    rays, keep = block.image_points, np.arange(8) < 2
    own = keep[rays.image]
    images = replace(
        block.images, names=block.images.names[keep], camera=block.images.camera[keep], strip=block.images.strip[keep],
        centre=block.images.centre[keep], angles=block.images.angles[keep],
    )  # fmt: skip
    pair = replace(block, images=images, image_points=ImagePoints(*(a[own] for a in (rays.image, rays.point, rays.xy,
                                                                                    rays.sigma))))  # fmt: skip
    mapped = map_incrementally(pair, seed=5)
    assert np.isfinite(mapped.centre).all()
    turn = mapped.rotation[0].T @ mapped.rotation[1]
    given = rotation_from_angles(truth.angles[:2], block.rotation)
    assert np.abs(turn - given[0].T @ given[1]).max() < 0.02


def test_photographs_that_are_lost_are_tried_again(simulated, mapped, monkeypatch):
    """A principal distance gone astray at the first pair ends the orientation; held, it goes on, and stays free."""
    from aerotri.tie_points import orientation

    block = simulated[0]
    tried = []

    def map_incrementally(given, seed, report=None):
        tried.append(given.cameras[0].interior["focal_length_mm"].kind)
        if tried[-1] == "free":
            centre = mapped.centre.copy()
            centre[2:] = np.nan
            return replace(mapped, centre=centre)
        return mapped

    monkeypatch.setattr(orientation, "map_incrementally", map_incrementally)
    found = orientation.orient(without_control(block), Given(), "local", None, 5, lambda *_: None)
    assert tried == ["free", "fixed"]
    assert np.isfinite(found.centre).all()
    assert found.cameras[0].interior["focal_length_mm"] == block.cameras[0].interior["focal_length_mm"]
    assert found.cameras[0].lens == mapped.cameras[0].lens


def without_control(block):
    nothing = no_sigma(0)
    empty = replace(block.control, point=np.zeros(0, np.int64), xyz=nothing, sigma=nothing, is_check=np.zeros(0, bool))
    return replace(block, control=empty, gnss_ins=None)


@pytest.mark.parametrize("count", [7, 25])
def test_place_of_points_in_any_order(count):
    """All triples of few points, and drawn ones of many, with blunders among them: the same to the last bit."""
    rng = np.random.default_rng(count)
    source = rng.normal(0.0, 50.0, (count, 3))
    turn = exponential(np.array([0.3, -0.2, 1.1]))
    target = 3.0 * source @ turn.T + [100.0, 200.0, 30.0] + rng.normal(0.0, 0.5, (count, 3))
    target[:2] += 300.0
    sigma = rng.uniform(0.3, 0.8, count)
    one, order = place(source, target, sigma), rng.permutation(count)
    other = place(source[order], target[order], sigma[order])
    np.testing.assert_array_equal(other(source), one(source))
    np.testing.assert_array_equal(other.misfit, one.misfit[order])
    assert one.misfit[2:].max() < 3.0 < one.misfit[:2].min()
