"""External reliability of the sparse adjustment against dense algebra, unknown by unknown."""

from dataclasses import replace

import numpy as np
from test_against_dense import TINY, dense_cofactors

from aerotri.formats.results.reliability_columns import effect_names
from aerotri.functional_model.rotation import small_rotation_per_angle
from aerotri.observations import Prior
from aerotri.observations.block import Constraints
from aerotri.pipeline import adjust_keeping_system
from aerotri.statistics.reliability import noncentrality, ray_reliability
from small_blocks import small_block, with_adjustment

DELTA = noncentrality(0.001, 0.80)


def dense_changes(adjustment, inner):
    """∇x = Q·aᵀ for an error of one σ of every image coordinate, over σ of the unknown, with the angles ω, φ, κ."""
    design, q = dense_cofactors(adjustment, inner=inner)
    u = adjustment.system.unknowns
    n, m = len(u.images), len(u.rays.image)
    to_angles = np.eye(len(q))
    per_angle = small_rotation_per_angle(adjustment.result.images.angles[u.images], u.block.rotation)
    turn = u.turn(adjustment.solution.state)
    for i in range(n):
        at = slice(6 * i + 3, 6 * i + 6)
        to_angles[at, at] = np.linalg.solve(per_angle[i], turn[i])
    covariance = to_angles @ q @ to_angles.T
    changes = to_angles @ q @ design[: 2 * m].T
    sigma = np.sqrt(np.maximum(np.diagonal(covariance), 0.0))
    return np.where(sigma[:, None] > 1e-12, changes / np.maximum(sigma, 1e-12)[:, None], 0.0), changes


def compare(adjustment, inner=False):
    u, effects = adjustment.system.unknowns, adjustment.result.effects
    ratios, changes = dense_changes(adjustment, inner)
    n, s = len(u.images), len(u.shared)
    ray_point = np.repeat(np.arange(len(u.points)), np.diff(u.rays.start))
    share = DELTA / np.sqrt(adjustment.result.rays.r[u.rays.source])
    tested = np.isfinite(effects.size[u.rays.source])
    assert tested.mean() > 0.8
    compared = 0
    for k, axis in zip(*np.nonzero(tested), strict=True):
        row, point = 2 * k + axis, 6 * n + s + 3 * ray_point[k]
        image = 6 * u.rays.image[k]
        shared = 6 * n + np.flatnonzero(np.abs(ratios[6 * n : 6 * n + s, row]) > 0)
        own = np.concatenate([np.arange(point, point + 3), np.arange(image, image + 6)])
        source = u.rays.source[k]
        code = effects.unknown[source, axis]
        expected = np.abs(ratios[own, row]).max()
        if code < 9:
            got = np.abs(ratios[own[code], row])
        else:
            got = np.abs(ratios[6 * n + code - 9, row])
            assert 6 * n + code - 9 in shared
        assert got >= expected - 1e-9
        np.testing.assert_allclose(effects.size[source, axis], got * share[k, axis], rtol=1e-9, atol=1e-9)
        kept = u.kept[ray_point[k]]
        up = point + 2 if kept < 0 else 6 * n + kept + 2
        height = abs(changes[up, row]) * share[k, axis]
        np.testing.assert_allclose(effects.height[source, axis], height, rtol=1e-9, atol=1e-9)
        compared += 1
    assert compared > 100
    external = ray_reliability(adjustment.result).external
    assert (effects.size[np.isfinite(effects.size)] <= external[np.isfinite(effects.size)] * (1 + 1e-9) + 1e-9).all()


def test_control_datum_with_all_kinds_of_shared_parameters():
    block, _ = small_block(
        4, "bluh:1-2+9", **TINY,
        gnss={"sigma_m": [0.05, 0.05, 0.08], "shift_sigma_m": [0.2, 0.2, 0.2], "lever_arm_m": [0.2, -0.3, 1.1]},
    )  # fmt: skip
    camera = block.cameras[0]
    priors = {name: Prior(prior.value, 0.02) for name, prior in camera.interior.items()}
    compare(adjust_keeping_system(replace(block, cameras=(replace(camera, interior=priors),))))


def test_minimal_datum():
    block = with_adjustment(small_block(5, "bluh:1-2", **TINY)[0], datum="minimal")
    compare(adjust_keeping_system(block))


def test_points_that_conditions_tie_together():
    """They are shared parameters: their coordinates are found there, by name."""
    block, truth = small_block(10, "bluh:1-2", **TINY)
    often = np.setdiff1d(np.argsort(-np.bincount(block.image_points.point)), block.control.point, assume_unique=True)
    members = (often[:5], np.array([often[7], block.control.point[0]]))
    length = np.linalg.norm(np.diff(truth.points[members[1]], axis=0))
    given = Constraints(
        np.array(["plane", "distance"], object), members, np.array([np.nan, length]), np.array([40.0, 0.05])
    )
    adjustment = adjust_keeping_system(replace(block, constraints=given))
    compare(adjustment)
    names = [effect_names(adjustment.result, adjustment.result.effects, axis).to_pylist() for axis in (0, 1)]
    tied = np.flatnonzero(block.image_points.point == often[0])
    assert all(f"of point {block.points[often[0]]}" in names[0][k] or "photo" in names[0][k] for k in tied)


def test_inner_datum():
    block = small_block(6, "bluh:1-2", **TINY)[0]
    chosen = tuple(block.points[:12].tolist())
    adjustment = adjust_keeping_system(with_adjustment(block, datum="inner", datum_points=chosen))
    u = adjustment.system.unknowns
    adjustment.system.unknowns = replace(u, point_free=np.ones_like(u.point_free))
    compare(adjustment, inner=True)
