"""σ after a similarity of the whole block: against dense algebra, and errors of simulated blocks over it."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

from aerotri.adjustment.datum import motions_of_images, motions_of_points
from aerotri.pipeline.chain import adjust_keeping_system
from aerotri.pipeline.relative import with_relative
from aerotri.results.model_part import ModelRoot
from aerotri.statistics.relative import local_cofactors, neighbouring_pairs, relative_covariances, shape_of
from aerotri.statistics.similarity import fit_similarity
from dense_algebra import TINY, dense_design
from rig_blocks import rig_block
from small_blocks import small_block, with_adjustment

GNSS = {"sigma_m": [2.0, 2.0, 4.0]}
WITHOUT_CONTROL = {"gnss": GNSS, "control": {"positions": [], "check_points": 0}}


def adjusted(seed=3, parameters="none", settings=None, **changes):
    block = small_block(seed, parameters, **TINY, **changes)[0]
    return adjust_keeping_system(with_adjustment(block, **(settings or {})))


def dense_left(found):
    """S·Q·Sᵀ of all unknowns and A·Q·Aᵀ, with Q and S written out in full."""
    q, left, onto = dense_parts(found)
    return left @ q @ left.T, onto @ q @ onto.T


def dense_parts(found):
    """Q, S and A of all unknowns."""
    u, state, design = found.system.unknowns, found.solution.state, dense_design(found)
    factor = found.system.factorise(found.solution.equations)
    shape = shape_of(found.system, found.solution, factor, local_cofactors(found)[0])
    free = np.flatnonzero(design.any(axis=0))
    scale = 1.0 / np.linalg.norm(design[:, free], axis=0)
    scaled = design[:, free] * scale
    q = np.zeros((design.shape[1],) * 2)
    q[np.ix_(free, free)] = np.linalg.inv(scaled.T @ scaled) * scale * scale[:, None]
    n, s = 6 * len(u.images), len(u.shared)
    images, points = motions_of_images(state.centre - shape.middle), motions_of_points(state.points - shape.middle)
    images[:, 3:] = np.linalg.solve(u.turn(state), images[:, 3:])
    g = np.concatenate([images.reshape(-1, 7), np.zeros((s, 7)), points.reshape(-1, 7)])
    rows = n + s + (3 * shape.rows[:, None] + np.arange(3)).ravel()
    onto = np.zeros((7, len(g)))
    onto[:, rows] = np.linalg.solve(g[rows].T @ g[rows], g[rows].T)
    return q, np.eye(len(g)) - g @ onto, onto


@pytest.mark.parametrize("changes", [{}, WITHOUT_CONTROL], ids=["control", "positions"])
def test_against_dense_algebra(changes):
    """S·Q·Sᵀ of every point and centre, and A·Q·Aᵀ of the similarity, from the whole inverse."""
    found = adjusted(parameters="bluh:1-2", **changes)
    left, similarity = dense_left(found)
    relative, u, sigma0 = found.local.relative, found.system.unknowns, found.local.outcome.sigma0
    expected, n = sigma0 * np.sqrt(np.diagonal(left)), 6 * len(u.images)
    points, centres = expected[n + len(u.shared) :].reshape(-1, 3), expected[:n].reshape(-1, 6)[:, :3]
    assert relative.points[u.points] == pytest.approx(points, rel=1e-6)
    assert relative.centres[u.images] == pytest.approx(centres, rel=1e-6)
    of_it = [*relative.position, *relative.rotation, relative.scale]
    assert of_it == pytest.approx(sigma0 * np.sqrt(np.diagonal(similarity)), rel=1e-6)
    # what the block as a whole does is most of σ where nothing but positions of metres holds it
    share = relative.medians / np.median(found.local.points.total_sigma[u.points], axis=0)
    assert (share < (1.0 if "gnss" not in changes else 0.1)).all()


@pytest.mark.parametrize("photographs", [2, 3])
def test_blocks_of_two_rays_have_a_shape(photographs):
    """Two photographs, and three in a line with few points of three rays, all control held: σ and no warning."""
    flight = TINY["flight"] | {"strips": 1, "images_per_strip": photographs}
    block = small_block(1, flight=flight, tie_points=TINY["tie_points"] | {"per_image": 9})[0]
    held = replace(block, control=replace(block.control, sigma=np.zeros_like(block.control.sigma)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = adjust_keeping_system(held).local
    sigma = found.relative.points[np.isfinite(found.points.sigma).all(axis=1)]
    assert (sigma > 0.0).all()
    assert (found.relative.medians < 1.0).all()


@pytest.mark.parametrize("noise", [0.0, 1.0], ids=["field", "groups"])
def test_the_model_part_goes_the_same_way(noise):
    """S·F·(S·F)ᵀ less what noise explains, S·(Q − Q·N_0·Q)·Sᵀ, of columns F that are far larger than the noise."""
    found = adjusted()
    u, sigma0 = found.system.unknowns, found.local.outcome.sigma0
    q, left, onto = dense_parts(found)
    n, s = 6 * len(u.images), len(u.shared)
    columns = 30.0 * np.linalg.cholesky(q[n + s :, n + s :] + 1e-9 * np.eye(len(q) - n - s))
    columns = np.vstack([np.zeros((n + s, columns.shape[1])), columns])
    root = ModelRoot(columns[:n].reshape(-1, 6, columns.shape[1]), columns[n : n + s],
                     columns[n + s :].reshape(-1, 3, columns.shape[1]), noise * sigma0**2)  # fmt: skip
    factor = found.system.factorise(found.solution.equations)
    got = relative_covariances(found.system, found.solution, factor, sigma0, local_cofactors(found), root)
    control = dense_design(found)[2 * len(u.rays.image) :]
    known = q @ control.T @ control @ q
    rest = columns @ columns.T - noise * sigma0**2 * (q - known)
    total = left @ (sigma0**2 * q + rest) @ left.T
    each = np.arange(len(u.points))
    points = total[n + s :, n + s :].reshape(len(each), 3, len(each), 3)[each, :, each]
    assert got.points == pytest.approx(points, rel=1e-5, abs=1e-6 * np.abs(points).max())
    similarity = onto @ (sigma0**2 * q + rest) @ onto.T
    assert np.diagonal(got.similarity) == pytest.approx(np.diagonal(similarity), rel=1e-5)


def test_neighbours_are_functions_of_the_whole_covariance():
    """The median over the same pairs, from the whole inverse."""
    found = adjusted(**WITHOUT_CONTROL)
    u, near, sigma0 = found.system.unknowns, found.local.relative.neighbours, found.local.outcome.sigma0
    factor = found.system.factorise(found.solution.equations)
    shape = shape_of(found.system, found.solution, factor, local_cofactors(found)[0])
    first, second = neighbouring_pairs(u, found.solution.state, shape.rows)
    assert near.pairs == len(first) > 20
    of_heights = 6 * len(u.images) + len(u.shared) + 2
    left = dense_left(found)[0][of_heights::3, of_heights::3]
    variance = left[first, first] + left[second, second] - 2.0 * left[first, second]
    assert near.relative == pytest.approx(sigma0 * np.median(np.sqrt(variance)), rel=1e-6)
    # the tilt of the block is in the difference as the block stands
    assert near.sigma > 1.2 * near.relative


def test_a_free_block_has_one_shape_in_any_datum():
    """Minimal and inner: the same shape but for its size, which each takes from elsewhere; nothing known of place."""
    minimal, inner = (adjusted(settings={"datum": datum}).local for datum in ("minimal", "inner"))
    sizes = [np.linalg.norm(one.points.xyz - one.points.xyz.mean(axis=0)) for one in (minimal, inner)]
    scale = sizes[0] / sizes[1]
    assert minimal.relative.points == pytest.approx(scale * inner.relative.points, rel=1e-2)
    assert minimal.relative.centres == pytest.approx(scale * inner.relative.centres, rel=1e-2)
    assert minimal.relative.neighbours.relative == pytest.approx(scale * inner.relative.neighbours.relative, rel=1e-3)
    for one in (minimal, inner):
        assert np.isnan([*one.relative.position, *one.relative.rotation, one.relative.scale]).all()
        assert np.isnan(one.relative.neighbours.sigma)


@pytest.mark.parametrize("changes", [{}, WITHOUT_CONTROL], ids=["control", "positions"])
def test_errors_after_a_similarity_are_as_large_as_they_should_be(changes):
    """Errors of ten simulated blocks over their relative σ, after a similarity by least squares: near N(0, 1)."""
    squares = []
    for seed in range(1, 11):
        block, truth = small_block(seed, **TINY, **changes)
        found = adjust_keeping_system(with_adjustment(block, model_part="off")).local
        points = np.flatnonzero(np.isfinite(found.relative.points).all(axis=1))
        moved = fit_similarity(found.points.xyz[points], truth.points[points], np.ones((len(points), 3)))
        squares.append(np.mean((moved.residual / found.relative.points[points]) ** 2, axis=0))
    # ninety points of a block have some dozen modes in common: their mean square is known to a seventh from ten blocks
    assert np.sqrt(np.mean(squares, axis=0)) == pytest.approx(np.ones(3), abs=0.2)


def with_unknown_points(found, rows):
    """As `with_relative` gets it, with covariances of some points (P,) that are not known."""
    covariance = found.local.points.covariance.copy()
    covariance[found.system.unknowns.points[rows]] = np.nan
    local = replace(found.local, points=replace(found.local.points, covariance=covariance), relative=None)
    return replace(found, local=local, result=local)


def test_a_point_without_cofactors_takes_nothing_from_the_others():
    found = adjusted(**WITHOUT_CONTROL)
    u, before = found.system.unknowns, found.local.relative
    factor = found.system.factorise(found.solution.equations)
    lost = shape_of(found.system, found.solution, factor, local_cofactors(found)[0]).rows[0]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        after = with_relative(with_unknown_points(found, [lost])).local.relative
    assert np.isnan(after.points[u.points[lost]]).all()
    others = np.delete(u.points, lost)
    # the datum has one point less
    assert after.points[others] == pytest.approx(before.points[others], rel=0.1)
    assert after.scale == pytest.approx(before.scale, rel=0.05)
    assert with_relative(with_unknown_points(found, np.arange(len(u.points)))).local.relative is None


@pytest.mark.parametrize("movement", [None, 0.01], ids=["rigid", "weighted"])
def test_a_base_is_between_stations_and_not_between_cameras_of_a_rig(movement):
    """Cameras of a rig 5 cm apart: neighbours lie half of the way between stations apart, as without the rig."""
    block = rig_block(3, cameras=("left",))[0]
    if movement is not None:
        cameras = {
            name: replace(one, movement_m=movement, movement_rad=1e-4) for name, one in block.rigs[0].cameras.items()
        }
        block = replace(block, rigs=(replace(block.rigs[0], constraint="weighted", cameras=cameras),))
    found = adjust_keeping_system(block)
    assert (found.system.unknowns.rigging is None) == (movement is not None)
    near = found.local.relative.neighbours
    centre = found.local.images.centre[block.images.camera == 0, :2]
    apart = np.linalg.norm(centre[:, None] - centre, axis=2) + np.diag(np.full(len(centre), np.inf))
    assert near.distance == pytest.approx(0.5 * np.median(apart.min(axis=1)), rel=0.5)
    assert near.pairs > 10


def test_photographs_taken_twice_at_a_place_make_no_base():
    found = adjusted()
    u, state = found.system.unknowns, found.solution.state
    rows = np.arange(len(u.points))
    twice = replace(state, centre=np.concatenate([state.centre, state.centre + [0.3, 0.0, 0.0]]))
    once = neighbouring_pairs(u, state, rows)
    assert len(once[0]) > 20
    assert np.array_equal(neighbouring_pairs(u, twice, rows), once)
