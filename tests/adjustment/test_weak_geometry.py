"""Points that their rays do not fix and photographs too weakly tied: set aside with a reason, the rest untouched."""

from dataclasses import replace

import numpy as np
import pytest

from aerotri.adjustment.prepare import prepare
from aerotri.adjustment.ray_status import RayStatus
from aerotri.adjustment.robust import LEAST_SQUARES
from aerotri.adjustment.weak_geometry import loose_in_block
from aerotri.formats.results.adjustment import image_columns, point_columns
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations import ImagePoints
from aerotri.pipeline import adjust, local
from aerotri.statistics.summarise import summarise
from small_blocks import small_block, with_adjustment


def with_rays(block, keep):
    """The block with these rays only."""
    rays = block.image_points
    kept = ImagePoints(rays.image[keep], rays.point[keep], rays.xy[keep], rays.sigma[keep])
    return replace(block, image_points=kept)


def with_few_rays(block, image, count):
    """The block with the first rays alone of a photograph, none of them to control."""
    rays = block.image_points
    own = np.flatnonzero((rays.image == image) & ~np.isin(rays.point, block.control.point))
    keep = rays.image != image
    keep[own[:count]] = True
    return with_rays(block, keep)


def without_photograph(block, image):
    return with_rays(block, block.image_points.image != image)


@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize("robust", ["off", "huber"])
def test_photograph_with_few_rays(count, robust):
    """One or two rays leave six unknowns free: the photograph goes, and the rest is as if it had not been there."""
    block = with_adjustment(small_block(21)[0], robust=robust)
    weak = with_few_rays(block, 4, count)
    result, without = adjust(weak), adjust(without_photograph(block, 4))
    assert result.outcome.status == "converged"
    assert any("1 photograph" in said and "too weakly tied" in said for said in result.outcome.warnings)
    columns = image_columns(result)
    assert columns["status"][4] == "set aside"
    assert columns["reason"][4] == "too weakly tied to the others"
    assert (np.delete(columns["status"], 4) == "used").all()
    assert (result.rays.status[weak.image_points.image == 4] == RayStatus.WEAK_PHOTOGRAPH).all()
    others = np.arange(len(block.images)) != 4
    np.testing.assert_allclose(result.images.centre[others], without.images.centre[others], atol=1e-5)
    assert result.outcome.redundancy == without.outcome.redundancy
    assert result.outcome.iterations <= without.outcome.iterations + 1


def test_photographs_that_hold_each_other_alone():
    """Two photographs that have points in common with each other only: each is tied, and both are free."""
    block = small_block(22)[0]
    rays = block.image_points
    seen = np.zeros((len(block.images), len(block.points)), dtype=bool)
    seen[rays.image, rays.point] = True
    control = np.isin(np.arange(len(block.points)), block.control.point)
    common = np.flatnonzero(seen[0] & seen[1] & ~control)[:30]
    only_own = np.isin(rays.point, common) & np.isin(rays.image, [0, 1])
    others = ~np.isin(rays.image, [0, 1]) & ~np.isin(rays.point, common)
    result = adjust(with_rays(block, only_own | others))
    assert result.outcome.status == "converged"
    assert image_columns(result)["reason"][:2].tolist() == ["too weakly tied to the others"] * 2
    assert image_columns(result)["status"][2:].tolist() == ["used"] * (len(block.images) - 2)


def with_parallel_rays(block, truth, twist=0.0):
    """The block with one point more, in one direction from two neighbours (`twist` rad apart), and its place."""
    rotation = rotation_from_angles(truth.angles, block.rotation)
    camera = block.cameras[0]
    c = camera.interior["focal_length_mm"].value
    first, second = 1, 2
    base = truth.centre[second] - truth.centre[first]
    direction = np.array([0.05, 0.02, -1.0]) / np.linalg.norm([0.05, 0.02, -1.0])
    away = direction + twist * base / np.linalg.norm(base)
    xy = []
    for image, d in ((first, direction), (second, away)):
        u = rotation[image].T @ d
        xy.append(-c * u[:2] / u[2])
    rays = block.image_points
    more = ImagePoints(
        np.append(rays.image, [first, second]), np.append(rays.point, [len(block.points)] * 2),
        np.vstack([rays.xy, xy]), np.vstack([rays.sigma, rays.sigma[:2]]),
    )  # fmt: skip
    place = truth.centre[first] + direction * (truth.centre[first, 2] - 100.0)
    return replace(block, image_points=more, points=np.append(block.points, "far")), place


def test_point_that_runs_away():
    """A point whose rays part by a thousandth runs to infinity from any start; it goes and the rest goes on."""
    block, truth = small_block(23)
    block = with_adjustment(block, robust="huber")
    far, place = with_parallel_rays(block, truth, 1e-4)
    start = np.full((len(far.points), 3), np.nan)
    start[-1] = place
    result, without = adjust(far, given_points=start), adjust(block)
    assert result.outcome.status == "converged"
    columns = point_columns(result)
    assert columns["status"][-1] == "set aside"
    assert columns["reason"][-1] == "its rays do not fix it in distance"
    assert (columns["status"] == "set aside").sum() == 1 + (point_columns(without)["status"] == "set aside").sum()
    assert any("1 point (far) not fixed in distance" in said for said in result.outcome.warnings)
    np.testing.assert_allclose(result.images.centre, without.images.centre, atol=1e-3)
    assert np.isnan(result.points.xyz[-1]).all()


def with_point_of_a_weak_photograph(robust):
    """A block whose photograph 2 has 6 rays, the same with a point 520 km away that 2 and 1 see, and its start.

    Its own rays fix the point to a twentieth of the distance, the direction of the photograph to two fifths.
    """
    block, truth = small_block(23)
    block = with_few_rays(with_adjustment(block, robust=robust), 2, 6)
    twist = -4e-4
    far, place = with_parallel_rays(block, truth, twist)
    ray = (place - truth.centre[1]) / np.linalg.norm(place - truth.centre[1])
    start = np.full((len(far.points), 3), np.nan)
    start[-1] = truth.centre[1] + ray * np.linalg.norm(truth.centre[2] - truth.centre[1]) / abs(twist)
    return block, far, start


def counted(monkeypatch):
    """The calls of `summarise`, each of which forms a covariance."""
    calls = []
    monkeypatch.setattr(local, "summarise", lambda *a: calls.append(1) or summarise(*a))
    return calls


def test_point_as_loose_as_its_photograph(monkeypatch):
    """Fixed by its rays, were the photographs known, and not within the block: it goes once all has converged."""
    block, far, start = with_point_of_a_weak_photograph("huber")
    calls = counted(monkeypatch)
    without = adjust(block)
    assert len(calls) == 1
    result = adjust(far, given_points=start)
    assert len(calls) == 3
    assert result.outcome.status == "converged"
    columns = point_columns(result)
    assert columns["status"][-1] == "set aside"
    assert columns["reason"][-1] == "its rays do not fix it in distance"
    assert (columns["status"] == "set aside").sum() == 1 + (point_columns(without)["status"] == "set aside").sum()
    assert (image_columns(result)["status"] == "used").all()
    assert any("1 point (far) not fixed in distance" in said for said in result.outcome.warnings)
    assert result.outcome.redundancy == without.outcome.redundancy
    shift = np.abs(result.images.centre - without.images.centre)
    assert (shift < 0.05 * without.images.sigma[:, :3]).all()
    assert result.outcome.iterations <= without.outcome.iterations + 6


def test_least_squares_keeps_a_loose_point_and_says_so(monkeypatch):
    """Least squares of all that was given is what was asked for: the point stays, nothing is adjusted twice."""
    _, far, start = with_point_of_a_weak_photograph("off")
    calls = counted(monkeypatch)
    result = adjust(far, given_points=start)
    assert len(calls) == 1
    assert point_columns(result)["status"][-1] == "used"
    assert any("1 point (far) hardly fixed in distance" in said for said in result.outcome.warnings)


def test_least_squares_says_what_ran_to_infinity():
    """The covariance of a point at infinity drowns in rounding; its own rays tell."""
    block, truth = small_block(23)
    far, place = with_parallel_rays(block, truth, 1e-4)
    start = np.full((len(far.points), 3), np.nan)
    start[-1] = place
    result = adjust(far, given_points=start)
    assert any("1 point (far) hardly fixed in distance" in said for said in result.outcome.warnings)


def test_what_photographs_share_makes_no_point_loose():
    """σ of a vague datum or of a drifting strip is in points and photographs; what a point has beyond it is its own."""
    centre = np.array([[0.0, 0.0, 1000.0], [600.0, 0.0, 1000.0]])
    xyz = np.array([[0.0, 0.0, 0.0], [300.0, 0.0, 0.0], [600.0, 0.0, 0.0], [600.0, 900.0, 0.0]])
    point, image = np.repeat(np.arange(4), 2), np.tile([0, 1], 4)
    shared = 500.0**2 * np.eye(3)
    own = np.zeros((4, 3, 3))
    own[:3, 2, 2] = [100.0**2, 600.0**2, 700.0**2]
    own[3] = 700.0**2 * np.outer([0.0, 0.8, 0.6], [0.0, 0.8, 0.6])
    vague = loose_in_block(point, image, xyz, centre, shared + own, np.stack([shared, shared]))
    # √(500² + 700²) − 500 = 360: beyond 1000 / 3, and below the third of the way from the second photograph
    np.testing.assert_array_equal(vague, [2])
    sharp = loose_in_block(point, image, xyz, centre, own, np.zeros((2, 3, 3)))
    np.testing.assert_array_equal(sharp, [1, 2, 3])


def test_looseness_is_sigma_over_distance():
    """Two rays of σ tangent s that meet under a small angle: σ along them is √2·s/angle of the distance."""
    block, _ = small_block(24)
    prepared = prepare(block)
    u, state = prepared.system.unknowns, prepared.state
    loose = prepared.system.looseness(state, LEAST_SQUARES)
    c = block.cameras[0].interior["focal_length_mm"].value
    for p in np.flatnonzero((np.diff(u.rays.start) == 2) & (u.prior_weight[:, 0] == 0.0))[:5]:
        normal, reach = np.zeros((3, 3)), []
        for ray in range(u.rays.start[p], u.rays.start[p + 1]):
            way = state.points[p] - state.centre[u.rays.image[ray]]
            reach.append(np.linalg.norm(way))
            in_camera = state.rotation[u.rays.image[ray]].T @ way
            partial = -c * np.array(
                [[1 / in_camera[2], 0, -in_camera[0] / in_camera[2] ** 2],
                 [0, 1 / in_camera[2], -in_camera[1] / in_camera[2] ** 2]]
            ) @ state.rotation[u.rays.image[ray]].T  # fmt: skip
            partial *= u.rays.inv_sigma[ray][:, None]
            normal += partial.T @ partial
        expected = np.sqrt(np.linalg.inv(normal).max(initial=0.0, where=np.eye(3, dtype=bool)))
        sigma = np.sqrt(np.linalg.eigvalsh(np.linalg.inv(normal))[-1])
        assert expected <= sigma
        np.testing.assert_allclose(loose[p], sigma / min(reach), rtol=1e-6)


def test_a_free_datum_is_no_weak_photograph():
    """What all photographs lack is the datum: none is set aside for it."""
    from aerotri.pipeline import AdjustmentFailedError

    block = small_block(25)[0]
    control = block.control
    one = replace(control, is_check=np.arange(len(control.point)) > 0)
    with pytest.raises(AdjustmentFailedError, match=r"datum is free|too little control"):
        adjust(replace(block, control=one))
