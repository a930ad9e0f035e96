"""Rank defects: found whatever the rounding, the order of rows and the units; a block with just enough is none."""

from dataclasses import replace

import numpy as np
import pytest

from aerotri.adjustment.defects import checked_factor, point_without_rays_enough
from aerotri.adjustment.null_space import NOT_DETERMINED, products, smallest_eigenvalue
from aerotri.adjustment.prepare import prepare
from aerotri.adjustment.robust import LEAST_SQUARES
from aerotri.functional_model.additional_parameters import parse_parameters
from aerotri.observations import Control, ImagePoints, Images
from dense_algebra import TINY
from small_blocks import small_block, with_adjustment

EPSILON = np.finfo(float).eps


def with_control(block, full, heights=()):
    """The block with some of its control points in full, others in height only, given by their places in the table."""
    control, rows = block.control, [*full, *heights]
    xyz = control.xyz[rows].copy()
    xyz[len(full) :, :2] = np.nan
    return replace(block, control=Control(control.point[rows], xyz, control.sigma[rows], np.zeros(len(rows), bool)))


def on_a_line(block, off_m=0.0):
    """Three control points, the third of them between the others but for `off_m`."""
    xyz = block.control.xyz.copy()
    xyz[2] = 0.5 * (xyz[0] + xyz[1])
    xyz[2, 2] += off_m
    return with_control(replace(block, control=replace(block.control, xyz=xyz)), [0, 1, 2])


def permuted(block):
    """Photographs, points, rays and control in another order."""
    rng = np.random.default_rng(5)
    i, rays, control = block.images, block.image_points, block.control
    image, point = rng.permutation(len(i)), rng.permutation(len(block.points))
    new_image, new_point = np.argsort(image), np.argsort(point)
    ray, row = rng.permutation(len(rays)), rng.permutation(len(control))
    return replace(
        block,
        images=Images(i.names[image], i.camera[image], i.strip[image], i.centre[image], i.angles[image]),
        points=block.points[point],
        image_points=ImagePoints(new_image[rays.image[ray]], new_point[rays.point[ray]], rays.xy[ray], rays.sigma[ray]),
        control=Control(new_point[control.point[row]], control.xyz[row], control.sigma[row], control.is_check[row]),
    )


def scaled(block, factor, shift=0.0):
    """Coordinates in another unit or at another place."""
    control = replace(block.control, xyz=factor * block.control.xyz + shift, sigma=factor * block.control.sigma)
    return replace(block, images=replace(block.images, centre=factor * block.images.centre + shift), control=control)


WRITTEN = {
    "as it is": lambda block: block,
    "permuted": permuted,
    "km": lambda block: scaled(block, 1e-3),
    "mm": lambda block: scaled(block, 1e3),
    "far away": lambda block: scaled(block, 1.0, 5e6),
}


def with_rounding(equations, seed):
    """The equations as another processor might have added them up."""
    rng, matrix = np.random.default_rng(seed), equations.matrix
    n = matrix.border.shape[0]
    blocks = matrix.blocks * (1.0 + EPSILON * rng.normal(size=matrix.blocks.shape))
    blocks[:n] = 0.5 * (blocks[:n] + np.swapaxes(blocks[:n], 1, 2))
    own = np.arange(6)
    blocks[:n, own, own] += 4.0 * EPSILON * rng.normal(size=(n, 6)) * equations.diagonal[: 6 * n].reshape(n, 6)
    border = matrix.border * (1.0 + EPSILON * rng.normal(size=matrix.border.shape))
    return replace(equations, matrix=replace(matrix, blocks=blocks, border=border))


def said_of(block, seed=None):
    prepared = prepare(block)
    system, state = prepared.system, prepared.state
    # control stands where it is given, whatever its rays say
    observed = system.unknowns.prior_weight > 0.0
    state = replace(state, points=np.where(observed, system.unknowns.prior_xyz, state.points))
    equations = system.assemble(state, 0.0, LEAST_SQUARES)
    if seed is not None:
        equations = with_rounding(equations, seed)
    factor, said = checked_factor(system, state, equations, LEAST_SQUARES)
    assert (factor is None) == bool(said)
    return "; ".join(said)


def tiny(parameters="none"):
    return with_adjustment(small_block(14, **TINY)[0], additional_parameters=parse_parameters(parameters))


LACKING = {
    "two control points": (lambda: with_control(tiny(), [0, 1]), "the datum is free in a combination of"),
    "one control point": (lambda: with_control(tiny(), [0]), "and scale"),
    "control on a line": (lambda: on_a_line(tiny()), "the datum is free in a combination of"),
    "no plan": (lambda: with_control(tiny(), [], [0, 1, 2, 3]), "the datum is free in X, Y, κ"),
    "the same said twice": (lambda: tiny("ebner:1-4,gruen:all"), "not determined: "),
}
ENOUGH = {
    "two control points and a height": lambda: with_control(tiny(), [0, 1], [2]),
    "control 10 m off a line": lambda: on_a_line(tiny(), 10.0),
    "said once": lambda: tiny("bluh:1-2"),
}


@pytest.mark.parametrize("written", WRITTEN)
@pytest.mark.parametrize("case", LACKING)
def test_what_lacks_is_named_however_it_is_written(case, written):
    make, words = LACKING[case]
    assert words in said_of(WRITTEN[written](make()))


@pytest.mark.parametrize("written", WRITTEN)
@pytest.mark.parametrize("case", ENOUGH)
def test_just_enough_is_enough_however_it_is_written(case, written):
    assert said_of(WRITTEN[written](ENOUGH[case]())) == ""


@pytest.mark.parametrize("case", [*LACKING, *ENOUGH])
def test_rounding_changes_no_verdict(case):
    block = LACKING[case][0]() if case in LACKING else ENOUGH[case]()
    for seed in range(5):
        assert (said_of(block, seed) != "") == (case in LACKING)


def test_the_measure_is_far_below_rounding_of_the_normal_matrix():
    """A motion that two control points leave free: 1e-16 in the normal matrix, 1e-28 by the design matrix."""
    prepared = prepare(with_control(tiny(), [0, 1]))
    system, state = prepared.system, prepared.state
    equations = system.assemble(state, 0.0, LEAST_SQUARES)
    row = [int(np.flatnonzero(system.unknowns.points == p)[0]) for p in system.unknowns.block.control.point[:2]]
    axis = state.points[row[1]] - state.points[row[0]]
    axis /= np.linalg.norm(axis)
    turn = np.concatenate(
        [np.cross(axis, state.centre - state.points[row[0]]), np.tile(axis, (len(state.centre), 1))], 1
    )
    effect, size = products(system, state, equations, LEAST_SQUARES, turn.reshape(-1, 1))
    assert 0.0 <= effect[0, 0] / size[0, 0] < 1e-24 < NOT_DETERMINED


def test_estimate_of_the_smallest_eigenvalue():
    prepared = prepare(with_control(tiny("bluh:1-4"), [0, 1, 2, 3]))
    system, state = prepared.system, prepared.state
    equations = system.assemble(state, 0.0, LEAST_SQUARES)
    factor = system.factorise(equations)
    inverse = factor.columns(np.arange(len(equations.diagonal))) * np.sqrt(
        np.outer(equations.diagonal, equations.diagonal)
    )
    smallest = 1.0 / np.linalg.eigvalsh(0.5 * (inverse + inverse.T))[-1]
    assert 0.99 * smallest <= smallest_eigenvalue(factor, equations.diagonal) < 10.0 * smallest


def test_a_point_that_its_rays_do_not_fix_is_named():
    """The same photograph twice at one place: the rays of a point in these two are parallel."""
    block = with_control(tiny(), [0, 1, 2, 3])
    rays, i = block.image_points, block.images
    point = int(np.setdiff1d(rays.point, block.control.point)[0])
    own = np.flatnonzero(rays.point == point)
    first, second = own[:2]
    centre, angles, xy = i.centre.copy(), i.angles.copy(), rays.xy.copy()
    centre[rays.image[second]], angles[rays.image[second]] = centre[rays.image[first]], angles[rays.image[first]]
    xy[second] = xy[first]
    keep = np.setdiff1d(np.arange(len(rays)), own[2:])
    given = np.full((len(block.points), 3), np.nan)
    given[point] = centre[rays.image[first]] - [10.0, 20.0, 900.0]
    block = replace(
        block,
        images=replace(i, centre=centre, angles=angles),
        image_points=ImagePoints(rays.image[keep], rays.point[keep], xy[keep], rays.sigma[keep]),
    )
    prepared = prepare(block, given)
    equations = prepared.system.assemble(prepared.state, 0.0, LEAST_SQUARES)
    sentence = f"not determined: point {block.points[point]}, which has only one ray, or rays that are parallel"
    assert point_without_rays_enough(prepared.system, prepared.state, equations) == [sentence]
