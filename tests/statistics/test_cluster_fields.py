"""Random fields of few clusters: against dense algebra, and on simulated blocks of one to three strips."""

from dataclasses import replace

import numpy as np
import pytest

from aerotri.diagnosis.moving_errors import model_part_in_words
from aerotri.pipeline.chain import adjust_keeping_system
from aerotri.results.model_part import FIELD, GROUPS
from aerotri.statistics.cluster_fields import field_equations, fit_field, fitted_field, root_of_field
from aerotri.statistics.cluster_test import untestable
from aerotri.statistics.clusters import Clusters
from dense_algebra import dense_design
from rig_blocks import rig_block
from small_blocks import small_block
from statistics_blocks import few_strips, with_changing_strips

GNSS = {"sigma_m": [0.05, 0.05, 0.08], "shift_sigma_m": [0.2, 0.2, 0.2]}


@pytest.fixture(scope="module")
def small():
    """A small adjusted block, its dense equations, and the whitened nodes of three clusters."""
    found = adjust_keeping_system(small_block(5, "bluh:1-2", gnss=GNSS)[0])
    label = np.arange(len(found.system.unknowns.images)) % 3
    clusters = Clusters("another", label, ("1", "2", "3"), 3)
    equations = field_equations(found.system, found.solution, _factor(found), clusters)
    u, nodes = found.system.unknowns, equations.nodes
    design = dense_design(found)
    weight = u.rays.inv_sigma * np.sqrt(found.solution.equations.weight)[:, None]
    basis = np.zeros((len(design), 2 * 3 * nodes.count))
    for ray in range(len(u.rays.image)):
        for row in range(2):
            first = (2 * label[u.rays.image[ray]] + row) * nodes.count
            basis[2 * ray + row, first + nodes.node[ray]] = nodes.weight[ray] * weight[ray, row]
    gap = (found.solution.equations.residual * weight).ravel()
    return found, clusters, equations, design, basis, gap


def _factor(found):
    return found.system.factorise(found.solution.equations)


def test_equations_of_the_nodes_are_those_of_dense_algebra(small):
    """h = BᵀPv and K = BᵀPB − BᵀPA·Q·AᵀPB."""
    _, _, equations, design, basis, gap = small
    scale = 1.0 / np.linalg.norm(design, axis=0)
    mixed = basis.T @ (design * scale)
    expected = basis.T @ basis - mixed @ np.linalg.solve((design * scale).T @ (design * scale), mixed.T)
    assert equations.scores == pytest.approx(basis[: len(gap)].T @ gap, rel=1e-9, abs=1e-6)
    assert equations.normals == pytest.approx(expected, rel=1e-5, abs=1e-6 * np.abs(expected).max())


def test_columns_of_the_unknowns_are_those_of_dense_algebra(small):
    """F = Q·AᵀPB·R of photographs, shared parameters and points."""
    found, clusters, equations, design, basis, _ = small
    field = fitted_field(found.system, found.solution, _factor(found), 1.0, clusters)
    root = np.random.default_rng(1).normal(size=(1, equations.nodes.count, 2))
    made, squares = root_of_field(found.system, found.solution, _factor(found), clusters, replace(field, root=root))
    scale = 1.0 / np.linalg.norm(design, axis=0)
    right = (design * scale).T @ basis @ np.kron(np.eye(6), root[0])
    expected = np.linalg.solve((design * scale).T @ (design * scale), right) * scale[:, None]
    u = found.system.unknowns
    n, s = 6 * len(u.images), len(u.shared)
    for part, of_dense in (
        (made.images.reshape(n, -1), expected[:n]),
        (made.shared, expected[n : n + s]),
        (made.points.reshape(-1, 12), expected[n + s :]),
    ):
        assert part == pytest.approx(of_dense, abs=1e-5 * np.abs(of_dense).max())
    own = expected[n + s :].reshape(-1, 3, 12)
    assert squares == pytest.approx(own @ np.swapaxes(own, 1, 2), abs=1e-5 * np.max(own**2))


def test_white_noise_is_no_field():
    for seed in (1, 2, 3):
        found = adjust_keeping_system(few_strips(seed)[0])
        part = found.result.model_part
        strips = next(test for test in part.tests if test.scheme == "strip")
        assert strips.clusters == 3
        assert strips.freedom > 50
        assert not strips.counts
        assert found.model is None


def test_moving_errors_of_three_strips_are_found_and_their_size_is_right():
    """2 µm from strip to strip: errors of the orientation over σ fall from about three to about one."""
    before, after = [], []
    for seed in (1, 2, 3):
        block, truth = few_strips(seed, 2.0)
        found = adjust_keeping_system(block)
        part, images = found.result.model_part, found.result.images
        assert (part.scheme, part.clusters, part.method) == ("strip", 3, FIELD)
        assert found.model.noise == 0.0
        error = images.centre - truth.centre
        before.append(np.mean((error / images.sigma[:, :3]) ** 2))
        after.append(np.mean((error / images.total_sigma[:, :3]) ** 2))
    assert np.sqrt(np.mean(before)) > 1.4
    assert 0.5 < np.sqrt(np.mean(after)) < 1.5
    said = model_part_in_words(part)
    assert "3 strips are too few for a comparison" in said
    assert said.endswith("µm in every strip")


def test_where_the_iterations_ended_is_no_error_of_the_strips():
    """Patterns that the unknowns take up nearly whole keep scores of the last iterations, many times their noise."""
    camera, unit = small_block(seed=1)[0].cameras[0], 0.004
    for seed in (1, 2, 3):
        rng = np.random.default_rng(seed)
        patterns = np.linalg.qr(rng.normal(size=(70, 70)))[0]
        values = 4e8 * np.concatenate([[1.5e-6, 2.5e-6, 3e-6], np.geomspace(1e-3, 1.0, 67)])
        z = np.concatenate([[-27.0, 20.0, 5.0], rng.normal(size=67)])
        normals, scores = (patterns * values) @ patterns.T, patterns @ (np.sqrt(values) * z)
        field = fit_field(normals, scores, np.zeros(1, int), False, [camera], unit, 1.0)
        assert np.exp(-0.5 * field.gain) > 1e-3
        assert field.sigma < unit


def test_no_field_is_far_larger_than_what_the_residuals_allow():
    """Scores five times as large as noise in all patterns alike, as errors of single photographs make them."""
    camera, unit = small_block(seed=1)[0].cameras[0], 0.0007
    for seed in (1, 2, 3):
        rng = np.random.default_rng(seed)
        patterns = np.linalg.qr(rng.normal(size=(70, 70)))[0]
        values = 3e8 * np.geomspace(1e-6, 1.0, 70)
        z = 5.0 * rng.normal(size=70)
        normals, scores = (patterns * values) @ patterns.T, patterns @ (np.sqrt(values) * z)
        field = fit_field(normals, scores, np.zeros(1, int), False, [camera], unit, 1.0)
        # of the residuals alone image errors of half a σ would do
        assert field.sigma < 5.0 * unit


def test_errors_that_all_strips_share_do_not_move():
    """A lens error that the parameters do not describe, the same in three strips."""
    block, _ = few_strips(2)
    rays = block.image_points
    x, y = rays.xy[:, 0] / 18.0, rays.xy[:, 1] / 12.0
    wrong = replace(rays, xy=rays.xy + 4e-3 * np.column_stack([x**3 * y, x * y**3]))
    part = adjust_keeping_system(replace(block, image_points=wrong)).result.model_part
    assert not next(test for test in part.tests if test.scheme == "strip").counts


def test_one_strip_has_the_errors_that_its_photographs_share():
    block, _ = few_strips(2, strips=1)
    assert not adjust_keeping_system(block).result.model_part.counts
    rays = block.image_points
    x, y = rays.xy[:, 0] / 18.0, rays.xy[:, 1] / 12.0
    wrong = replace(rays, xy=rays.xy + 4e-3 * np.column_stack([np.sin(3.0 * x), np.sin(3.0 * y)]))
    found = adjust_keeping_system(replace(block, image_points=wrong)).result
    assert (found.model_part.scheme, found.model_part.clusters) == ("strip", 1)
    said = model_part_in_words(found.model_part)
    assert "change with the position in the image" in said
    assert "One strip cannot be compared with others" in said
    assert (found.points.total_sigma >= found.points.sigma).all()


def test_a_cluster_that_holds_the_block_alone_is_said():
    names = tuple(str(k) for k in range(8))
    label = np.arange(64) % 8
    assert not untestable(Clusters("strip", label, names, 8))
    large = Clusters("strip", np.where(np.arange(64) < 50, 0, label), names, 8)
    assert "of the photographs and holds the block alone" in untestable(large)


def three_cameras(seed: int, strips: int, per_strip: int):
    """Strips flown with a rig of three cameras."""
    flight = {
        "gsd_m": 0.1, "strips": strips, "images_per_strip": per_strip, "end_lap": 0.7, "side_lap": 0.5,
        "heading_deg": 30.0, "attitude_sigma_deg": [1.0, 1.0, 2.0], "position_sigma_m": [5.0, 5.0, 3.0],
    }  # fmt: skip
    return rig_block(seed, cameras=("left", "right"), flight=flight)


def with_errors(block, seed: int, names: np.ndarray):
    """The block with lens errors of 3 µm, others for every name of its photographs."""
    named = replace(block, images=replace(block.images, strip=names))
    return replace(with_changing_strips(named, seed, 3.0), images=block.images)


def test_half_solutions_of_a_rig_are_those_of_the_whole_solution():
    found = adjust_keeping_system(three_cameras(1, 3, 5)[0])
    factor = _factor(found)
    u = found.system.unknowns
    sides = np.random.default_rng(1).normal(size=(6 * len(u.images) + len(u.shared), 4))
    half = factor.half_solve(sides)
    assert half.T @ half == pytest.approx(sides.T @ factor.solve(sides), rel=1e-9)


@pytest.mark.parametrize(("strips", "method"), [(6, GROUPS), (3, FIELD)])
def test_rigs_have_a_model_part_where_their_cameras_change(strips, method):
    """White noise has none; errors of every strip and camera are found, and total σ is about right."""
    before, after = [], []
    for seed in (2, 3):
        block, truth = three_cameras(seed, strips, 6)
        assert not adjust_keeping_system(block).result.model_part.counts
        of_both = np.array([f"{s} {c}" for s, c in zip(block.images.strip, block.images.camera, strict=True)])
        result = adjust_keeping_system(with_errors(block, seed, of_both)).result
        assert (result.model_part.scheme, result.model_part.method) == ("strip", method)
        error = result.points.xyz - truth.points
        there = result.points.sigma > 0.0
        before.append(np.mean((error[there] / result.points.sigma[there]) ** 2))
        after.append(np.mean((error[there] / result.points.total_sigma[there]) ** 2))
    assert np.sqrt(np.mean(before)) > 1.3
    assert 0.4 < np.sqrt(np.mean(after)) < 1.3


def test_errors_that_every_camera_of_a_rig_keeps_do_not_move():
    block, _ = three_cameras(2, 3, 6)
    wrong = with_errors(block, 2, block.images.camera.astype(str))
    part = adjust_keeping_system(wrong).result.model_part
    assert not next(test for test in part.tests if test.scheme == "strip").counts
