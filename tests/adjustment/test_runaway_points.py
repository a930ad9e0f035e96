"""Points that run through infinity in an adjustment by least squares: brought back, or left out with a word."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

import wrong_blocks
from aerotri.adjustment.prepare import Prepared
from aerotri.adjustment.ray_status import RayStatus
from aerotri.adjustment.runaway_points import _left_out
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.pipeline.chain import adjust
from aerotri.simulation import parse_spec, simulate

SPEC = wrong_blocks.SPEC | wrong_blocks.DRONE | {
    "flight": wrong_blocks.DRONE["flight"] | {"strips": 5, "images_per_strip": 7, "speed_m_s": 10.0},
    "control": {"positions": [[0.05, 0.05], [0.05, 0.95], [0.95, 0.05], [0.95, 0.95], [0.5, 0.5]],
                "sigma_m": [0.02, 0.02, 0.03], "check_points": 8},
    "start_values": {"kind": "perturbed", "position_sigma_m": 2.0, "angle_sigma_deg": 1.0},
}  # fmt: skip


def test_a_faultless_block_is_accepted_although_a_point_started_deep_below_the_ground():
    block, truth = simulate(parse_spec(SPEC), 139)
    result = adjust(block)
    assert result.outcome.verdict == "accepted"
    assert result.outcome.sigma0 < 1.1
    assert (result.rays.status == RayStatus.USED).all()
    off = (result.points.xyz - truth.points) / result.points.sigma
    assert np.abs(off).max() < 5.0


def test_the_words_about_what_was_set_aside_besides_stay():
    block, _ = simulate(parse_spec(SPEC), 139)
    used = np.full(len(block.image_points), RayStatus.USED)
    weak = np.where(block.image_points.image == 0, RayStatus.WEAK_PHOTOGRAPH, used)
    system = SimpleNamespace(unknowns=SimpleNamespace(block=block))
    before, rest = (Prepared(system, None, status, ("first",)) for status in (used, weak))
    left = _left_out(rest, before, np.array([3]))
    assert left.warnings[0] == "first"
    assert left.warnings[1].startswith(f"1 photograph ({block.images.names[0]})")
    assert left.warnings[2] == f"1 point ({block.points[3]}) whose rays do not intersect, left out"


NEAR = {"kind": "perturbed", "position_sigma_m": 0.01, "angle_sigma_deg": 0.001}


def parted(block, truth, point):
    """The first two rays of a point alone, turned apart so that they meet behind the photographs, by a tenth of c."""
    rays = block.image_points
    own = np.flatnonzero(rays.point == point)
    base = truth.centre[rays.image[own[1]]] - truth.centre[rays.image[own[0]]]
    xy = rays.xy.copy()
    for ray, sign in zip(own[:2], (-1.0, 1.0), strict=True):
        in_camera = base @ rotation_from_angles(truth.angles, block.rotation)[rays.image[ray]]
        xy[ray] += sign * 2.0 * in_camera[:2] / np.hypot(*in_camera[:2])
    kept = np.setdiff1d(np.arange(len(rays)), own[2:])
    some = replace(rays, image=rays.image[kept], point=rays.point[kept], xy=xy[kept], sigma=rays.sigma[kept])
    return replace(block, image_points=some)


def test_a_point_whose_rays_part_is_left_out_by_name():
    block, truth = simulate(parse_spec(SPEC | {"start_values": NEAR}), 5)
    rays = block.image_points
    point = next(p for p in np.unique(rays.point) if p not in block.control.point and np.sum(rays.point == p) >= 4)
    result = adjust(parted(block, truth, point), given_points=truth.points)
    left = result.block.image_points.point[result.rays.status != RayStatus.USED]
    assert set(left.tolist()) == {point}
    assert f"1 point ({block.points[point]}) whose rays do not intersect, left out" in result.outcome.warnings
    assert result.outcome.sigma0 < 1.1
    assert result.outcome.verdict == "accepted"
