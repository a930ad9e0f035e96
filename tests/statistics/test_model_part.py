"""The model part of σ: against dense algebra, and on simulated blocks with and without errors of strips."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from aerotri.adjustment.datum import motions_of_points
from aerotri.observations.block import Control
from aerotri.pipeline.chain import adjust_keeping_system
from aerotri.statistics.cluster_influence import influences, known_part
from aerotri.statistics.cluster_test import compare_clusters, sum_of_squares, weakest_modes
from aerotri.statistics.clusters import CAMERA, PHOTOGRAPH, VIEW, Clusters, cluster_schemes, to_test
from aerotri.statistics.covariance import cofactors
from aerotri.statistics.model_part import compare_schemes, excess_of_clusters, positive_part, squares_by
from dense_algebra import dense_design
from rig_blocks import rig_block
from small_blocks import small_block, with_adjustment
from statistics_blocks import drone_block

GNSS = {"sigma_m": [0.05, 0.05, 0.08], "shift_sigma_m": [0.2, 0.2, 0.2]}


@pytest.fixture(scope="module")
def small():
    """A small adjusted block with GNSS, and its dense equations by strip."""
    found = adjust_keeping_system(small_block(5, "bluh:1-2", gnss=GNSS)[0])
    system, design = found.system, dense_design(found)
    u, solution = system.unknowns, found.solution
    weight = u.rays.inv_sigma * np.sqrt(solution.equations.weight)[:, None]
    gap = (solution.equations.residual * weight).ravel()
    image = np.repeat(u.rays.image, 2)
    observed = np.flatnonzero(u.prior_weight.any(axis=1))
    rows, axes = np.nonzero(u.prior_weight)
    gap = np.concatenate([gap, np.sqrt(u.prior_weight[rows, axes]) * (u.prior_xyz - solution.state.points)[rows, axes]])
    image = np.concatenate([image, np.full(len(rows), -1)])
    known = np.isfinite(np.array(u.shared.sigma))
    own = (np.array(u.shared.observed) - solution.state.shared)[known] / np.array(u.shared.sigma)[known]
    gap, image = np.concatenate([gap, own]), np.concatenate([image, np.full(len(own), -1)])
    for rows_beside in system.whitened_rows(solution.state):
        there = rows_beside.inv_sigma > 0.0
        gap = np.concatenate([gap, rows_beside.gap[there]])
        image = np.concatenate([image, np.repeat(rows_beside.image[:, None], there.shape[1], axis=1)[there]])
    assert len(gap) == len(design)
    assert len(observed)
    clusters = cluster_schemes(u.block, u.images, solution.state.centre)[0]
    label = np.where(image >= 0, clusters.label[np.maximum(image, 0)], -1)
    return found, design, gap, label, clusters


def _flat(change):
    return np.concatenate([change.images.ravel(), change.shared, change.points.ravel()])


def _factor(found):
    return found.system.factorise(found.solution.equations)


def test_lowered_weights_are_those_of_dense_algebra(small):
    """(N − t·N_c)⁻¹·g_c of every unknown."""
    found, design, gap, label, clusters = small
    scale = 1.0 / np.linalg.norm(design, axis=0)
    for t in (0.3, 0.9):
        changes = influences(found.system, found.solution, _factor(found), clusters, lowered=t, plain_share=0.0)
        for c, change in enumerate(changes):
            own = design[label == c] * scale
            normal = (design * scale).T @ (design * scale) - t * own.T @ own
            expected = np.linalg.solve(normal, own.T @ gap[label == c]) * scale
            assert np.abs((_flat(change) - expected) / scale).max() < 1e-4 * np.abs(expected / scale).max()


def test_without_lowering_it_is_the_whole_inverse(small):
    found, design, gap, label, clusters = small
    scale = 1.0 / np.linalg.norm(design, axis=0)
    q = np.linalg.inv((design * scale).T @ (design * scale))
    changes = influences(found.system, found.solution, _factor(found), clusters, plain_share=1.0)
    for c, change in enumerate(changes):
        expected = q @ (design[label == c] * scale).T @ gap[label == c]
        assert _flat(change) / scale == pytest.approx(expected, abs=1e-7 * np.abs(expected).max())


def test_near_the_whole_weight_it_is_the_adjustment_without_the_cluster(small):
    """Delete-a-group: the change of points that the other strips determine, from one step of the smaller block."""
    found, design, gap, label, clusters = small
    u = found.system.unknowns
    scale = 1.0 / np.linalg.norm(design, axis=0)
    at = 6 * len(u.images) + len(u.shared)
    changes = influences(found.system, found.solution, _factor(found), clusters, lowered=1.0 - 1e-9, plain_share=0.0)
    first = next(iter(changes))
    rest = design[label != 0] * scale
    step = np.linalg.lstsq(rest, gap[label != 0], rcond=1e-12)[0] * scale
    point = np.repeat(np.arange(len(u.points)), np.diff(u.rays.start))
    outside = clusters.label[u.rays.image] != 0
    seen = np.bincount(point[outside], minlength=len(u.points)) >= 3
    expected = -step[at:].reshape(-1, 3)[seen]
    assert seen.sum() > 10
    assert np.abs(first.points[seen] - expected).max() < 1e-4 * np.abs(expected).max()


def test_power_of_minus_one_half(small):
    """The two weights stand for (I − H)^(−½): the changes are within a tenth of those of the matrix root."""
    found, design, gap, label, clusters = small
    scale = 1.0 / np.linalg.norm(design, axis=0)
    q = np.linalg.inv((design * scale).T @ (design * scale))
    for c, change in enumerate(influences(found.system, found.solution, _factor(found), clusters)):
        own = design[label == c] * scale
        values, vectors = np.linalg.eigh(own @ q @ own.T)
        power = np.where(values < 1.0 - 1e-9, (1.0 - np.minimum(values, 1.0 - 1e-9)) ** -0.5, 0.0)
        expected = q @ own.T @ (vectors @ (power * (vectors.T @ gap[label == c])))
        sigma = np.sqrt(np.diagonal(q))
        error = (_flat(change) / scale - expected) / sigma
        assert np.sqrt(np.mean(error**2)) < 0.1 * np.sqrt(np.mean((expected / sigma) ** 2))


def test_known_part(small):
    """Q·N_0·Q of control and weighted parameters; with fewer columns than there are it is right on average."""
    found, design, _, label, _ = small
    u = found.system.unknowns
    scale = 1.0 / np.linalg.norm(design, axis=0)
    q = np.linalg.inv((design * scale).T @ (design * scale))
    none = design[label < 0] * scale
    expected = (scale[:, None] * (q @ none.T @ none @ q) * scale[None, :])[-3 * len(u.points) :, -3 * len(u.points) :]
    points = known_part(found.system, found.solution, _factor(found), most=10_000)[2]
    for k in range(0, len(u.points), 17):
        own = slice(3 * k, 3 * k + 3)
        assert points[k] == pytest.approx(expected[own, own], rel=1e-6, abs=1e-9)
    few = known_part(found.system, found.solution, _factor(found), most=40)[2]
    assert np.trace(few, axis1=1, axis2=2).sum() == pytest.approx(np.trace(points, axis1=1, axis2=2).sum(), rel=0.5)


def test_sum_of_squares_is_that_of_dense_algebra(small):
    """uᵀK⁺u from the whole covariance of the residuals."""
    found, design, gap, label, clusters = small
    clusters = replace(clusters, label=clusters.label % 4, names=clusters.names[:4])
    modes = weakest_modes(found.system, found.solution, _factor(found))
    y = np.concatenate([part.reshape(-1, modes.scores.shape[1]) for part in modes.y])
    value, rank = sum_of_squares(found.system, found.solution, _factor(found), modes, clusters)
    scale = 1.0 / np.linalg.norm(design, axis=0)
    q = np.linalg.inv((design * scale).T @ (design * scale))
    along = design @ y
    m = len(clusters)
    pick = np.concatenate([along * (label % 4 == c)[:, None] * (label >= 0)[:, None] for c in range(m)], axis=1)
    hat = (design * scale) @ q @ (design * scale).T
    covariance, u = pick.T @ (pick - hat @ pick), pick.T @ gap
    values, vectors = np.linalg.eigh(covariance)
    there = values > 1e-6 * values[-1]
    assert rank == there.sum()
    assert value == pytest.approx(np.sum((vectors[:, there].T @ u) ** 2 / values[there]), rel=1e-3)


def test_positive_part_of_what_is_not_known():
    """One covariance that is not known leaves the others as they are."""
    whole = np.stack([np.diag([4.0, 1.0, 9.0]), np.full((3, 3), np.nan), np.diag([1.0, 2.0, 3.0])])
    found = positive_part(whole, np.broadcast_to(2.0 * np.eye(3), whole.shape))
    assert found[0] == pytest.approx(np.diag([2.0, 0.0, 7.0]))
    assert found[2] == pytest.approx(np.diag([0.0, 0.0, 1.0]))
    assert np.isnan(found[1]).all()


def test_positive_part():
    rng = np.random.default_rng(1)
    root = rng.normal(size=(4, 3, 3))
    whole = root @ np.swapaxes(root, 1, 2)
    nothing = np.zeros_like(whole)
    assert positive_part(whole, nothing) == pytest.approx(whole)
    assert np.linalg.eigvalsh(positive_part(whole, nothing + 2.0 * np.eye(3))).min() > -1e-12
    for left in (1e-3, 1e-6, -1e-6):
        # noise explains nearly all of one variance: the others do not grow with it
        noise = np.diag([0.1, 0.1, whole[0, 2, 2] - left])[None]
        found = positive_part(whole[:1], noise)[0]
        assert (np.diagonal(found) < 2.0 * np.diagonal(whole[0])).all()


def _tested(block):
    found = adjust_keeping_system(block)
    system, solution, centre = found.system, found.solution, found.solution.state.centre
    schemes = cluster_schemes(system.unknowns.block, system.unknowns.images, centre)
    squares = partial(squares_by, system, solution, _factor(found))
    return found, schemes, compare_schemes(schemes, centre, found.local.outcome.sigma0, squares)


def test_white_noise_is_no_error_of_strips():
    """Six simulated blocks: none counts at one in a thousand, and the ratios are about 1."""
    ratios = []
    for seed in range(1, 7):
        _, schemes, tests = _tested(drone_block(seed)[0])
        assert schemes[0].scheme == "strip"
        assert len(schemes[0]) == 8
        assert not any(test.counts for test in tests)
        ratios.append(tests[0].ratio)
    assert 0.85 < np.mean(ratios) < 1.15


def test_moving_errors_are_found_and_their_size_is_right():
    """2 µm from strip to strip: found, and errors over σ fall from about two to about one."""
    before, after = [], []
    for seed in (1, 2, 3):
        block, truth = drone_block(seed, 2.0)
        found, schemes, tests = _tested(block)
        assert tests[0].counts
        assert tests[0].scheme == "strip"
        assert tests[0].ratio > tests[0].ratio_random
        system, solution, u = found.system, found.solution, found.system.unknowns
        q = cofactors(system, solution.state, _factor(found), solution.estimator)
        excess = excess_of_clusters(
            system, solution, _factor(found), schemes[0], found.local.outcome.sigma0, (q.images, q.shared, q.points)
        )
        stated = found.local.points.covariance[u.points]
        error = (found.local.points.xyz - truth.points)[u.points]
        for part, covariance in ((before, stated), (after, stated + excess.points)):
            part.append(np.mean(error**2 / np.diagonal(covariance, axis1=1, axis2=2)))
    assert np.sqrt(np.mean(before)) > 1.6
    assert 0.6 < np.sqrt(np.mean(after)) < 1.5


def test_few_clusters_are_not_tested():
    _found, schemes, tests = _tested(small_block(3)[0])
    assert len(schemes[0]) < 5
    assert "degrees of freedom" in tests[0].reason
    assert schemes[-1].scheme == PHOTOGRAPH
    assert not tests[-1].reason
    assert not any(test.counts for test in tests)


def test_columns_of_single_exposures_make_no_groups():
    """A time or a station differs from photograph to photograph; a day is a group."""
    block = small_block(3)[0]
    number = np.arange(len(block.images))
    columns = {"time": number.astype(str), "station": (number // 2).astype(str), "day": (number % 2).astype(str)}
    found = adjust_keeping_system(replace(block, images=replace(block.images, columns=columns)))
    u = found.system.unknowns
    schemes = {one.scheme for one in cluster_schemes(u.block, u.images, found.solution.state.centre)}
    assert "day" in schemes
    assert not schemes & {"time", "station"}


def test_random_divisions_have_no_excess():
    found, schemes, _ = _tested(drone_block(4)[0])
    system, solution = found.system, found.solution
    label = np.random.default_rng(2).permutation(schemes[0].label)
    clusters = Clusters("another", label, schemes[0].names, 8)
    squares = squares_by(system, solution, _factor(found))
    test = compare_clusters(squares, clusters, solution.state.centre, found.local.outcome.sigma0, 0.001)
    assert not test.counts
    assert 0.7 < test.ratio < 1.4


@pytest.mark.parametrize("strips", [8, 3])
def test_free_network_in_both_datums(strips):
    """Inner: S·(minimal)·Sᵀ over all unknowns, S written out; the test does not depend on the datum."""
    block, _ = drone_block(1, 2.0, strips=strips, images_per_strip=8, end_lap=0.6)
    minimal, inner = (adjust_keeping_system(with_adjustment(block, datum=datum)) for datum in ("minimal", "inner"))
    assert minimal.result.model_part.scheme == inner.result.model_part.scheme == "strip"
    one, other = (next(t for t in found.result.model_part.tests if t.scheme == "strip") for found in (minimal, inner))
    assert one.ratio == pytest.approx(other.ratio, rel=1e-3)
    u, state = inner.system.unknowns, inner.solution.state
    g = (motions_of_points(state.points) @ u.motions.basis).reshape(3 * len(u.points), -1)
    columns = minimal.model.points.reshape(len(g), -1).astype(float)
    expected = columns - g @ (np.linalg.pinv(g) @ columns)
    found = inner.model.points.reshape(len(g), -1).astype(float)
    variance = np.sum(expected**2, axis=1)
    assert np.abs(np.sum(found**2, axis=1) - variance).max() < 0.02 * variance.max()
    assert np.abs(np.linalg.pinv(g) @ found).max() < 1e-3 * np.abs(np.linalg.pinv(g) @ columns).max()
    assert (inner.result.points.total_sigma >= inner.result.points.sigma * (1.0 - 1e-9)).all()
    assert np.isfinite(inner.result.images.total_sigma).all()


@pytest.mark.parametrize("named", [True, False])
def test_heads_of_a_rig_fly_the_strips_of_the_rig(named):
    """Strips and directions are those of the exposures, whatever cameras there are, and the order of their rows."""
    block = rig_block(2)[0]
    if not named:
        block = replace(block, images=replace(block.images, strip=np.full(len(block.images), "", dtype=object)))
    found = adjust_keeping_system(block)
    u = found.system.unknowns
    station = np.asarray(block.images.columns["station"], dtype=object)[u.images]
    schemes = {one.scheme: one for one in cluster_schemes(u.block, u.images, found.solution.state.centre)}
    assert len(schemes["strip"]) == 3
    for scheme in ("strip", "direction of flight"):
        if scheme in schemes:
            for one in set(station.tolist()):
                assert len(set(schemes[scheme].label[station == one].tolist())) == 1


def test_photographs_around_an_object_are_no_strips():
    """Sixteen photographs on a circle, and a facade photographed up and down: divided by their direction of view."""
    block = small_block(3)[0]
    n = len(block.images)
    turn = np.linspace(0.0, 2.0 * np.pi, n, endpoint=False)
    ring = 30.0 * np.column_stack([np.cos(turn), np.sin(turn), np.zeros(n)])
    angles = np.column_stack([np.full(n, np.pi / 2.0), turn + np.pi / 2.0, np.zeros(n)])
    nameless = np.full(n, "", dtype=object)
    images = replace(block.images, centre=ring, angles=angles, strip=nameless)
    around = replace(block, images=images, rotation="omega-phi-kappa")
    schemes = {one.scheme: one for one in cluster_schemes(around, np.arange(n), ring)}
    assert set(schemes) == {VIEW, PHOTOGRAPH}
    assert len(schemes[VIEW]) >= 6
    # flown in two straight strips the same photographs are strips again
    way = np.column_stack([np.arange(n) % (n // 2) * 10.0, np.arange(n) // (n // 2) * 20.0, np.zeros(n)])
    way[n // 2 :, 0] = way[n // 2 :, 0][::-1]
    flown = {one.scheme for one in cluster_schemes(around, np.arange(n), way)}
    assert "strip" in flown
    assert VIEW not in flown


def test_photographs_are_tested_in_more_clusters_than_their_variance_is_taken_from():
    centre = np.random.default_rng(1).uniform(size=(200, 3))
    few = Clusters(PHOTOGRAPH, np.arange(200) % 15, tuple(str(k) for k in range(15)), 200)
    tested = to_test(few, centre)
    assert len(tested) == 60
    assert np.bincount(tested.label).min() >= 3
    strips = replace(few, scheme="strip")
    assert to_test(strips, centre) is strips


def test_errors_of_the_cameras_of_a_rig_are_found_and_their_size_is_right():
    """Every camera bends its photographs by some 6 µm of its own: heights err as much as the total σ say, not σ."""
    before, after = [], []
    for seed in (1, 2, 3):
        block, truth = rig_block(seed)
        rays, camera = block.image_points, block.images.camera[block.image_points.image]
        x, y = (rays.xy / np.array([one.half_format_mm for one in block.cameras])[camera]).T
        size = np.random.default_rng(seed).normal(scale=0.006, size=(len(block.cameras), 2))[camera]
        bent = rays.xy + size * np.stack([x * y, x**2 - 1.0 / 3.0], axis=1)
        found = adjust_keeping_system(replace(block, image_points=replace(rays, xy=bent)))
        assert found.local.model_part.scheme == CAMERA
        used = found.system.unknowns.points
        error = (found.local.points.xyz - truth.points)[used, 2]
        before.append(error / found.local.points.sigma[used, 2])
        after.append(error / found.local.points.total_sigma[used, 2])
    assert np.sqrt(np.mean(np.concatenate(before) ** 2)) > 1.2
    assert 0.6 < np.sqrt(np.mean(np.concatenate(after) ** 2)) < 1.2


def test_good_cameras_of_a_rig_have_no_errors_of_their_own():
    found = adjust_keeping_system(rig_block(2)[0])
    tests = {test.scheme: test for test in found.local.model_part.tests}
    assert tests[CAMERA].clusters == 5
    assert not tests[CAMERA].reason
    assert not found.local.model_part.counts


def test_test_field_of_which_all_points_are_held_has_none():
    """Nothing of the ground can be deformed, so nothing checks strips against one another."""
    block, truth = drone_block(1, strips=3, images_per_strip=6)
    n = len(block.points)
    control = Control(np.arange(n), truth.points, np.zeros((n, 3)), np.zeros(n, bool))
    found = adjust_keeping_system(replace(block, control=control)).result
    assert found.outcome.status == "converged"
    assert "nothing checks the clusters against one another" in {test.reason for test in found.model_part.tests}
