"""Weighted rigs: partials, the limits rigid and independent, and movements estimated from the block."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aerotri.adjustment.block_motions import unnoticed_motions
from aerotri.adjustment.prepare import prepare
from aerotri.adjustment.unknowns import Step
from aerotri.diagnosis.rigidity import movements_in_words
from aerotri.formats.results.rigs import movement_columns, movements_json
from aerotri.pipeline import adjust
from aerotri.report.tables.rigs import movements_table
from normalised_errors import assert_normal
from rig_blocks import EXACT, MOUNTINGS, rig_block

TWO = ("left", "fore")
TURNS = 0.004
"""Degrees, 14″, by which the camera left turns between exposures."""


def weighted(block, position, rotation, constraint="weighted"):
    """The block with other σ of the movements of all cameras of its rig."""
    rig = block.rigs[0]
    cameras = {
        name: replace(mounting, movement_m=position, movement_rad=rotation) for name, mounting in rig.cameras.items()
    }
    return replace(block, rigs=(replace(rig, constraint=constraint, cameras=cameras),))


def flown(seed, left=None, fore=None, **changes):
    """A block whose cameras move."""
    cameras = {"left": MOUNTINGS["left"] | EXACT | (left or {}), "fore": MOUNTINGS["fore"] | EXACT | (fore or {})}
    return rig_block(seed, cameras=TWO, rig={"camera": cameras}, **changes)


@pytest.fixture(scope="module")
def block():
    return flown(3, {"play_rotation_deg": TURNS})[0]


@pytest.fixture(scope="module")
def estimated(block):
    return adjust(weighted(block, 0.0, None))


def test_partials_of_the_deviations(block):
    """By photograph, reference photograph and mounting, by differences of states that a step leads to."""
    prepared = prepare(weighted(block, 0.01, 1e-4))
    u, state = prepared.system.unknowns, prepared.state
    rng, h = np.random.default_rng(2), 1e-6
    # away from zero, where small rotations add like vectors
    away = Step(rng.normal(size=(len(u.images), 6)) * 0.05, np.zeros(len(state.shared)), np.zeros_like(state.points))
    state = u.advance(state, away)
    step = Step(rng.normal(size=(len(u.images), 6)), rng.normal(size=len(state.shared)), np.zeros_like(state.points))

    def rows(at):
        return u.ties.rows(at.centre, at.rotation, at.shared, u.turn(at), u.eo_free)

    there, back = (rows(u.advance(state, Step(s * h * step.images, s * h * step.shared, step.points))) for s in (1, -1))
    expected = u.ties.along(rows(state), step.images[:, :, None], step.shared[:, None])[:, :, 0]
    assert np.abs(rows(state).deviation[:, 3:]).max() > 0.05
    np.testing.assert_allclose((there.deviation - back.deviation) / (2.0 * h), expected, atol=1e-6)


def test_normal_equations_of_the_ties(block):
    """What ties add to matrix and right side is that of their rows written out."""
    prepared = prepare(weighted(block, 0.01, 1e-4))
    u, state, system = prepared.system.unknowns, prepared.state, prepared.system
    ties, n, s = system.tie_rows(state), len(u.images), len(u.shared)
    design = np.zeros((ties.deviation.size, 6 * n + s))
    for t in range(len(ties.deviation)):
        own = slice(6 * t, 6 * t + 6)
        for image, by in ((u.ties.image[t], ties.by_image[t]), (u.ties.lead[t], ties.by_lead[t])):
            design[own, 6 * image : 6 * image + 6] += by
        for c in range(6):
            if ties.columns[t, c] >= 0:
                design[own, 6 * n + ties.columns[t, c]] += ties.by_shared[t, :, c]
    blocks, border, corner = np.zeros((len(u.block_row), 6, 6)), np.zeros((n, s, 6)), np.zeros((s, s))
    right, right_shared = np.zeros((n, 6)), np.zeros(s)
    u.ties.add_to(ties, blocks, border, corner)
    u.ties.add_gaps(ties, right, right_shared)
    whole = np.zeros((6 * n + s, 6 * n + s))
    for k, (i, j) in enumerate(zip(u.block_row, u.block_col, strict=True)):
        whole[6 * i : 6 * i + 6, 6 * j : 6 * j + 6] = blocks[k]
        whole[6 * j : 6 * j + 6, 6 * i : 6 * i + 6] = blocks[k].T
    whole[: 6 * n, 6 * n :] = border.transpose(0, 2, 1).reshape(6 * n, s)
    whole[6 * n :, : 6 * n] = whole[: 6 * n, 6 * n :].T
    whole[6 * n :, 6 * n :] = corner
    expected = design.T @ design
    size = np.sqrt(np.maximum(np.diagonal(expected), 1e-300))
    np.testing.assert_allclose(whole / np.outer(size, size), expected / np.outer(size, size), atol=1e-12)
    gap = -design.T @ ties.deviation.ravel()
    np.testing.assert_allclose(np.concatenate([right.ravel(), right_shared]) / size, gap / size, atol=1e-9)


def test_without_movements_it_is_the_rigid_rig(block):
    rigid, tied = adjust(weighted(block, 0.0, 0.0, "rigid")), adjust(weighted(block, 0.0, 0.0))
    assert tied.outcome.vtpv == pytest.approx(rigid.outcome.vtpv, rel=1e-5)
    assert tied.outcome.redundancy == rigid.outcome.redundancy
    np.testing.assert_allclose(tied.images.centre, rigid.images.centre, atol=1e-5)
    np.testing.assert_allclose(tied.images.sigma, rigid.images.sigma, rtol=1e-4)
    for one, other in zip(tied.rigs, rigid.rigs, strict=True):
        np.testing.assert_allclose(one.position, other.position, atol=1e-6)
        np.testing.assert_allclose(one.sigma, other.sigma, rtol=1e-4)


def test_with_large_movements_it_is_independent_cameras(block):
    free, tied = adjust(weighted(block, 0.0, 0.0, "off")), adjust(weighted(block, 1e3, 1e1))
    assert tied.outcome.vtpv == pytest.approx(free.outcome.vtpv, rel=1e-5)
    np.testing.assert_allclose(tied.images.centre, free.images.centre, atol=2e-3)
    scale = free.outcome.sigma0 / tied.outcome.sigma0
    np.testing.assert_allclose(scale * tied.images.sigma, free.images.sigma, rtol=1e-4)


def test_movements_are_estimated_and_told_apart(block, estimated):
    """The camera that turns by 14″ is found, the other one left in its place."""
    arc = np.radians(1.0 / 3600.0)
    found = estimated.rig_movements
    assert found.camera.tolist() == list(TWO)
    assert found.estimated.tolist() == [[False, True], [False, True]]
    turns = np.radians(TURNS)
    assert found.sigma[0, 1] == pytest.approx(turns, abs=3.5 * found.sigma_sigma[0, 1])
    assert 1.0 * arc < found.sigma_sigma[0, 1] < 4.0 * arc
    assert found.sigma[1, 1] < 6.0 * arc
    assert 0.93 < estimated.outcome.sigma0 < 1.07
    said = movements_in_words(found)
    assert "camera left of the rig frame turns by σ" in said[0]
    assert said[0] in estimated.outcome.warnings


def test_the_estimate_stays_with_the_block(estimated):
    """Adjusted again it is stated, and leads to the same."""
    stated = estimated.block.rigs[0].cameras["left"].movement_rad
    assert stated == pytest.approx(estimated.rig_movements.sigma[0, 1] / estimated.outcome.sigma0)
    again = adjust(estimated.block)
    assert not again.rig_movements.estimated.any()
    assert again.outcome.vtpv == pytest.approx(estimated.outcome.vtpv, rel=1e-4)
    at_maximum = next(group for group in again.groups if group.name == "rotations on the rig, left")
    # restricted maximum likelihood: their σ is that of the block
    assert at_maximum.sigma_aposteriori == pytest.approx(at_maximum.sigma_apriori * again.outcome.sigma0, rel=0.05)


def test_deviations_of_photographs_within_their_sigma(block, estimated):
    _, truth = flown(3, {"play_rotation_deg": TURNS})
    from aerotri.functional_model.rotation import logarithm, rotation_from_angles

    found, lead = estimated.rig_movements, {}
    station = np.asarray(block.images.columns["station"])
    for k in np.flatnonzero(block.images.camera == 0):
        lead[station[k]] = k
    rotation = rotation_from_angles(truth.angles)
    at = np.array([lead[station[k]] for k in found.image])
    mounted = rotation_from_angles(np.array([truth.mountings[c][3:] for c in found.camera[found.of]]))
    turned = logarithm(np.swapaxes(rotation[at], 1, 2) @ rotation[found.image] @ np.swapaxes(mounted, 1, 2))
    own = (found.of == 0) & (estimated.images.rays[found.image] > 20)
    z = (found.deviation[own, 3:] - turned[own]) / found.deviation_sigma[own, 3:]
    # the common part of all belongs to the mounting, which errs as well
    assert np.sqrt(np.mean(z**2)) < 2.0
    assert np.corrcoef(found.deviation[own, 3:].ravel(), turned[own].ravel())[0, 1] > 0.6


def test_positions_that_move_are_estimated():
    block, _ = flown(4, {"play_position_m": 0.3})
    found = adjust(weighted(block, None, 0.0)).rig_movements
    assert found.sigma[0, 0] == pytest.approx(0.3, abs=4.0 * found.sigma_sigma[0, 0])
    assert found.sigma[1, 0] < 0.15


def test_written(estimated):
    columns = movement_columns(estimated.rig_movements, estimated.block.images.names)
    assert {len(values) for values in columns.values()} == {len(estimated.rig_movements.image)}
    content = movements_json(estimated.rig_movements)
    assert [one["camera"] for one in content] == list(TWO)
    assert content[0]["movement_deg"] == pytest.approx(np.degrees(estimated.rig_movements.sigma[0, 1]))
    assert len(movements_table(estimated)) == 2


def test_a_photograph_with_few_image_points_is_held_by_its_station(block):
    rays = block.image_points
    row = block.images.names.tolist().index("1_003_fore")
    own = np.flatnonzero(rays.image == row)
    kept = np.ones(len(rays.image), dtype=bool)
    kept[own[2:]] = False
    few = replace(rays, image=rays.image[kept], point=rays.point[kept], xy=rays.xy[kept], sigma=rays.sigma[kept])
    result = adjust(weighted(replace(block, image_points=few), 0.001, 5e-5))
    assert result.images.rays[row] == 2
    assert (result.images.sigma[row, :3] < 1.0).all()


@pytest.mark.slow
def test_recovery_with_movements():
    """Mountings, a photograph and a point over σ are N(0, 1) where movements are estimated, and their σ unbiased."""
    runs, ratio = [], []
    for seed in range(4000, 4030):
        play = {"play_rotation_deg": TURNS}
        block, truth = flown(seed, play, play)
        result = adjust(weighted(block, 0.0, None))
        z = {}
        for one in result.rigs:
            for k in range(6):
                value = np.concatenate([one.position, one.angles])[k]
                z[one.camera, k] = (value - truth.mountings[one.camera][k]) / one.sigma[k]
        point = int(np.flatnonzero(result.points.rays == 3)[seed % 5])
        gap = (result.points.xyz[point] - truth.points[point]) / result.points.sigma[point]
        z |= {("point", k): value for k, value in enumerate(gap)}
        runs.append((z, result.outcome.vtpv, result.outcome.redundancy))
        ratio += (result.rig_movements.sigma[:, 1] / np.radians(TURNS)).tolist()
    assert_normal(runs, "movements estimated")
    # 60 estimates of about 15 %
    assert np.sqrt(np.mean(np.square(ratio))) == pytest.approx(1.0, abs=0.08)


def test_tight_ties_do_not_hide_weak_control(block):
    """Ties of σ 0 outweigh all rays: control of 10 m notices every motion all the same."""
    control = replace(block.control, sigma=np.where(np.isfinite(block.control.sigma), 10.0, np.nan))
    weak = replace(weighted(block, 0.0, 0.0), control=control, gnss_ins=None)
    prepared = prepare(weak)
    found = unnoticed_motions(prepared.system, prepared.state)
    assert found.count == 0
    without = replace(control, point=control.point[:0], xyz=control.xyz[:0], sigma=control.sigma[:0],
                      is_check=control.is_check[:0])  # fmt: skip
    free = prepare(replace(weak, control=without))
    assert unnoticed_motions(free.system, free.state).names == ("X", "Y", "Z", "ω", "φ", "κ")
