"""Data snooping by the bounds of targets.md 2: power, false alarms, gross errors in bulk, wrong control.

At most 30 photographs and some seeds here; the full counts run in tools/prove/recovery_blunders.py.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom, poisson

from aerotri.adjustment.prepare import prepare
from aerotri.adjustment.ray_status import RayStatus
from aerotri.adjustment.solve import SolveOptions, minimise
from aerotri.formats.block.folder import read_block, write_block
from aerotri.formats.results.solution import read_solution, write_solution
from aerotri.observations.block import Constraints, Edits
from aerotri.pipeline import adjust, adjust_keeping_system, reopen
from aerotri.simulation import read_spec, simulate
from aerotri.statistics.reliability import noncentrality, ray_reliability
from aerotri.statistics.summarise import count_observations
from aerotri.strategies.snooping import snoop
from places import PROJECT
from small_blocks import small_block, with_adjustment

DENSE = {
    "flight": {
        "gsd_m": 0.1, "strips": 3, "images_per_strip": 8, "end_lap": 0.8, "side_lap": 0.6, "heading_deg": 30.0,
        "cross_strips": [{"position": 0.5, "images": 5}], "attitude_sigma_deg": [1.0, 1.0, 2.0],
        "position_sigma_m": [5.0, 5.0, 3.0],
    },
    "tie_points": {"per_image": 100, "probability": 0.9, "sigma_um": 2.0},
}  # fmt: skip
BULK = {"gross_errors": {"fraction": 0.10, "range_sigma": [10.0, 100.0]}}
CONTROL = {"distance_bases": 3.0, "sigma_m": [0.03, 0.03, 0.05], "check_points": 5}
SINGLE_SEEDS, BULK_SEEDS = range(300, 320), range(1, 9)
BLUNDERS_A_BLOCK = 8
ALPHA = 0.001


def snooped(block):
    return adjust(with_adjustment(block, robust="data-snooping"))


def removed(result):
    return result.rays.status == RayStatus.REMOVED


def orientation(result):
    return np.concatenate([result.images.centre, result.images.angles], axis=1)


def with_blunders(block, reference, rng):
    """Errors of the size ∇0 in coordinates far apart: each in a point and a photograph of its own."""
    rays = block.image_points
    often = np.bincount(rays.point)[rays.point] >= 5
    rows, points, images = [], set(), set()
    for k in rng.permutation(np.flatnonzero(often)):
        if rays.point[k] not in points and rays.image[k] not in images and len(rows) < BLUNDERS_A_BLOCK:
            rows.append(int(k))
            points.add(rays.point[k])
            images.add(rays.image[k])
    axes, xy = rng.integers(0, 2, len(rows)), rays.xy.copy()
    size = ray_reliability(reference).detectable
    xy[rows, axes] += rng.choice([-1.0, 1.0], len(rows)) * size[rows, axes]
    return replace(block, image_points=replace(rays, xy=xy)), np.array(rows), axes


@pytest.fixture(scope="module")
def single_blunders():
    """Counts over the seeds: tested, alarms without error; blunders, beyond the limit, removed; rays, removed clean."""
    counts = np.zeros(7, dtype=int)
    rng = np.random.default_rng(1)
    for seed in SINGLE_SEEDS:
        block, _ = small_block(seed, **DENSE)
        clean = adjust(block)
        w = clean.rays.w[clean.rays.r > 1e-3]
        foul, rows, axes = with_blunders(block, clean, rng)
        plain, result = adjust(foul), snooped(foul)
        beyond = np.abs(plain.rays.w[rows, axes]) > 3.2905
        counts += [
            w.size, int(np.sum(np.abs(w) > 3.2905)), len(rows), int(beyond.sum()), int(removed(result)[rows].sum()),
            len(block.image_points), int(removed(snooped(block)).sum()),
        ]  # fmt: skip
    return counts


def test_power(single_blunders):
    """Errors of ∇0 are beyond the limit with the probability stated, and removed with hardly less."""
    _, _, blunders, beyond, found, _, _ = single_blunders
    low, high = binom.ppf([0.0005, 0.9995], blunders, 0.80)
    assert low <= beyond <= high
    assert low <= found <= high


def test_false_alarms(single_blunders):
    """At the level α; the two tests of a point of two rays are one, which doubles the variance."""
    tested, alarms, _, _, _, rays, lost = single_blunders
    expected = ALPHA * tested
    assert abs(alarms - expected) < 3.3 * np.sqrt(2.0 * expected)
    assert lost < poisson.ppf(0.9995, 2.0 * ALPHA * rays)


@pytest.fixture(scope="module")
def bulk():
    """Per seed: above ∇0 and of these removed; good rays that can be kept and of these removed; orientation in σ."""
    rows = []
    for seed in BULK_SEEDS:
        clean, (foul, truth) = adjust(small_block(seed, **DENSE)[0]), small_block(seed, **DENSE, **BULK)
        rows.append(bulk_counts(foul, truth, clean, snooped(foul)))
    return np.array(rows)


def bulk_counts(foul, truth, clean, result):
    rays = foul.image_points
    wrong = np.zeros(len(rays), dtype=bool)
    wrong[truth.gross_errors] = True
    size = np.zeros((len(rays), 2))
    size[truth.gross_errors] = np.abs(truth.gross_error_mm)
    above = (size > noncentrality(ALPHA, 0.80) * rays.sigma / np.sqrt(clean.rays.r)).any(axis=1)
    # of a point with a single good ray nothing can be kept, whatever the method
    keepable = ~wrong & (np.bincount(rays.point[~wrong], minlength=len(foul.points))[rays.point] >= 2)
    gone = removed(result)
    off = np.abs(orientation(result) - orientation(clean)) / clean.images.sigma
    return above.sum(), (above & gone).sum(), keepable.sum(), (keepable & gone).sum(), off.max()


def test_gross_errors_in_bulk(bulk):
    """10 % of the rays off by 10–100 σ: 99 % of those above ∇0 found, 0.5 % of the good ones lost, 3 σ at most."""
    above, found, keepable, lost, off = bulk.T
    assert found.sum() >= 0.99 * above.sum()
    assert lost.sum() <= 0.005 * keepable.sum()
    assert off.max() < 3.0


def test_estimated_sizes():
    foul, truth = small_block(2, **DENSE, **BULK)
    result = snooped(foul)
    error = {}
    for k, size in zip(truth.gross_errors, truth.gross_error_mm, strict=True):
        ray = foul.image_points
        error[str(foul.images.names[ray.image[k]]), str(foul.points[ray.point[k]])] = size
    gaps = []
    for blunder in result.blunders:
        if blunder.action == "removed" and (blunder.image, blunder.point) in error:
            components = error[blunder.image, blunder.point]
            gaps.append(np.abs(components - blunder.estimated_mm).min() / 0.002)
    assert len(gaps) > 0.9 * len(error)
    assert np.median(gaps) < 2.0
    sizes = [abs(b.w) for b in result.blunders if b.action == "removed"]
    assert sizes == sorted(sizes, reverse=True)


def test_batches_do_what_one_at_a_time_does():
    foul, _ = small_block(1, **DENSE, gross_errors={"fraction": 0.03, "range_sigma": [5.0, 100.0]})
    prepared = prepare(foul)
    first = minimise(prepared.system, prepared.state, count_observations(prepared.system).redundancy, SolveOptions())
    found = [
        {(b.image, b.point) for b in snoop(prepared, first, SolveOptions(), one_at_a_time=single).blunders}
        for single in (False, True)
    ]
    assert len(found[1]) > 60
    assert len(found[0] ^ found[1]) <= 0.03 * len(found[1])


@pytest.mark.parametrize("point", ["C01", "C03"])
def test_a_wrong_control_point_is_told_from_wrong_rays(point):
    """10 m off in height, and gross errors in bulk: named, a check point now, its good rays kept."""
    error = [0.0, 0.0, 10.0]
    foul, truth = small_block(7, **DENSE, **BULK, control=CONTROL | {"blunders": [{"point": point, "error_m": error}]})
    clean = small_block(7, **DENSE, control=CONTROL)[0]
    row = int(truth.control_blunders[0])
    is_check = clean.control.is_check.copy()
    is_check[row] = True
    reference = adjust(replace(clean, control=replace(clean.control, is_check=is_check)))
    result = snooped(foul)
    listed = [b for b in result.blunders if b.action == "control removed"]
    assert [(b.image, b.point) for b in listed] == [("", point)]
    assert listed[0].estimated_mm == pytest.approx(10e3, rel=0.1)
    assert any(point in warning for warning in result.outcome.warnings)
    assert foul.control.point[row] in result.check.point
    _, _, keepable, lost, off = bulk_counts(foul, truth, reference, result)
    assert off < 3.0
    assert lost <= 0.01 * keepable
    rays = np.setdiff1d(np.flatnonzero(foul.image_points.point == foul.control.point[row]), truth.gross_errors)
    assert not removed(result)[rays].any()


def test_demo_block():
    """The sample block, whose camera leaves systematic errors of a µm, by the same bounds, a control point 10 m off."""
    folder = PROJECT / "blocks" / "frederiksstad_ultracam"
    spec = read_spec(folder / "simulation.toml")
    gross = spec.model_validate(
        spec.model_dump()
        | BULK
        | {"control": spec.control.model_dump() | {"blunders": [{"point": "C05", "error_m": [0.0, 0.0, 10.0]}]}}
    )
    clean, (foul, truth) = simulate(spec, 1)[0], simulate(gross, 1)
    is_check = clean.control.is_check.copy()
    is_check[truth.control_blunders] = True
    reference = adjust(replace(clean, control=replace(clean.control, is_check=is_check)))
    result = snooped(foul)
    assert [b.point for b in result.blunders if b.action == "control removed"] == ["C05"]
    above, found, keepable, lost, off = bulk_counts(foul, truth, reference, result)
    assert found >= 0.99 * above
    assert lost <= 0.005 * keepable
    assert off < 3.0


def test_nothing_is_removed_from_what_agrees():
    """Noise of a quarter of the σ stated: the result is that without data snooping, bit for bit."""
    ties = DENSE["tie_points"] | {"sigma_um": 0.5, "stated_sigma_um": 2.0}
    block, _ = small_block(3, flight=DENSE["flight"], tie_points=ties)
    plain, result = adjust(block), snooped(block)
    assert not removed(result).any()
    np.testing.assert_array_equal(result.points.xyz, plain.points.xyz)
    assert not [b for b in result.blunders if "removed" in b.action]


def test_a_sigma_given_too_small_accuses_no_good_rays():
    """Noise three times the σ stated: the limits follow the spread, and it is said."""
    ties = DENSE["tie_points"] | {"sigma_um": 6.0, "stated_sigma_um": 2.0}
    block, _ = small_block(3, flight=DENSE["flight"], tie_points=ties)
    result = snooped(block)
    assert removed(result).sum() < poisson.ppf(0.9995, 2.0 * ALPHA * len(block.image_points))
    assert any("times as large as the a-priori σ" in warning for warning in result.outcome.warnings)


def test_two_rays_that_contradict_go_together():
    block, _ = small_block(4, **DENSE)
    rays = block.image_points
    reference = adjust(block)
    two = np.bincount(rays.point)[rays.point] == 2
    k = int(np.argmax(np.where(two[:, None], reference.rays.r, 0.0).max(axis=1)))
    axis = int(np.argmax(reference.rays.r[k]))
    xy = rays.xy.copy()
    xy[k, axis] += 0.2
    result = snooped(replace(block, image_points=replace(rays, xy=xy)))
    assert removed(result)[rays.point == rays.point[k]].all()
    assert np.isnan(result.points.xyz[rays.point[k]]).all()


def test_wrong_position_and_attitude_are_taken_out():
    gnss = {"sigma_m": [0.05, 0.05, 0.08], "shift_sigma_m": [0.3, 0.3, 0.3]}
    block, _ = small_block(5, **DENSE, gnss=gnss, ins={"sigma_deg": [0.005, 0.005, 0.01], "boresight_deg": [0.1] * 3})
    observed = block.gnss_ins
    xyz, angles = observed.xyz.copy(), observed.angles.copy()
    xyz[7] += [0.0, 2.0, 1.0]
    angles[9, 0] += np.radians(0.3)
    result = snooped(replace(block, gnss_ins=replace(observed, xyz=xyz, angles=angles)))
    names = block.images.names[observed.image[[7, 9]]]
    listed = {(b.image, b.action) for b in result.blunders if not b.point}
    assert listed == {(names[0], "position removed"), (names[1], "attitude removed")}
    assert removed(result).sum() < 20


def test_errors_far_beyond_what_is_linear():
    """Up to 10 mm in the image, a tenth of the format: a robust adjustment goes first."""
    foul, truth = small_block(8, **DENSE, gross_errors={"fraction": 0.05, "range_sigma": [10.0, 5000.0]})
    clean = adjust(small_block(8, **DENSE)[0])
    result = snooped(foul)
    assert result.outcome.status == "converged"
    assert bulk_counts(foul, truth, clean, result)[-1] < 3.0


def test_conditions_keep_their_points():
    block, truth = small_block(10, **DENSE, **BULK)
    often = np.setdiff1d(np.argsort(-np.bincount(block.image_points.point)), block.control.point, assume_unique=True)
    length = float(np.linalg.norm(np.diff(truth.points[often[:2]], axis=0)))
    given = Constraints(np.array(["distance"], object), (often[:2],), np.array([length]), np.array([0.02]))
    result = snooped(replace(block, constraints=given))
    assert result.outcome.status == "converged"
    assert np.isfinite(result.points.xyz[often[:2]]).all()


@pytest.mark.parametrize("datum", ["control", "inner", "minimal"])
def test_reopened(datum, tmp_path):
    """What was removed stays removed, in whatever role the operator had put the control point."""
    control = CONTROL | {"blunders": [{"point": "C02", "error_m": [0.0, 8.0, 0.0]}]}
    block, truth = small_block(7, "bluh:1-2", **DENSE, **BULK, control=control)
    row = int(truth.control_blunders[0])
    edits = Edits(np.array([-1]), block.control.point[[row]], np.array(["control"], object), np.array([""], object))
    block = with_adjustment(replace(block, edits=edits), robust="data-snooping", datum=datum)
    kept = adjust_keeping_system(block)
    write_block(kept.result.block, tmp_path / "block")
    write_solution(tmp_path / "solution.npz", kept.system, kept.solution, kept.result)
    again = reopen(read_block(tmp_path / "block"), read_solution(tmp_path / "solution.npz")).result
    assert (("C02" in block.points[again.check.point]) is (datum == "control")) or datum != "control"
    np.testing.assert_array_equal(again.rays.status, kept.result.rays.status)
    np.testing.assert_array_equal(again.points.xyz, kept.result.points.xyz)
    assert again.outcome.sigma0 == pytest.approx(kept.result.outcome.sigma0, rel=1e-10)
    assert removed(again).sum() > 200
