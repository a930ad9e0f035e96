"""Two halves of a block adjusted apart and compared."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import f as f_distribution
from scipy.stats import kstest

from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.pipeline import adjust_keeping_system
from aerotri.pipeline.halves import compare_halves
from aerotri.strategies.half_adjustment import Hold, Whole, adjust_half
from aerotri.strategies.half_covariance import HalfPair, shared_rows
from aerotri.strategies.half_points import cells_in_plan
from aerotri.strategies.half_tests import agreement, beyond_weighted_sum
from aerotri.strategies.halves_division import divide, flight_of
from rig_blocks import rig_block
from small_blocks import small_block

WELL_HELD = {"distance_bases": 1.0, "sigma_m": [0.03, 0.03, 0.05]}
SEEDS = 20


def adjusted(seed=1, parameters="brown:K1+K2", **changes):
    """A small block with control everywhere, adjusted."""
    block, _ = small_block(seed, parameters, **({"control": WELL_HELD} | changes))
    return adjust_keeping_system(block)


def whole_of(found):
    u, rays = found.system.unknowns, found.local.rays
    return Whole(u, found.solution.state, rays.status, rays.weight)


def pair_of(found, how="photographs"):
    """The two halves of a division with the points they share."""
    whole = whole_of(found)
    u, state = whole.unknowns, whole.state
    division = divide(u.block, flight_of(u.block, u.images, state.centre, state.rotation), how)
    one, two = (adjust_half(whole, division.half == k, division.half == 1 - k, Hold()) for k in (0, 1))
    _, i, j = np.intersect1d(one.unknowns.points, two.unknowns.points, return_indices=True)
    return HalfPair((one, two), shared_rows(one, two), (i, j))


@pytest.fixture(scope="module")
def found():
    return adjusted()


def test_alternate_photographs(found):
    """Neighbours in a strip are in different halves."""
    whole = whole_of(found)
    u = whole.unknowns
    flight = flight_of(u.block, u.images, whole.state.centre, whole.state.rotation)
    half = divide(u.block, flight, "photographs").half
    for strip in range(flight.strip.max() + 1):
        assert (np.abs(np.diff(half[flight.rows[flight.strip == strip]])) == 1).all()
    by_strip = divide(u.block, flight, "strips").half[flight.rows]
    assert (by_strip == flight.strip % 2).all()
    in_order = divide(u.block, flight, "time").half[flight.rows]
    assert (np.diff(in_order) >= 0).all()


def test_division_that_is_not_possible():
    """One strip has neither alternate strips nor two directions; the reason is said."""
    flight = {"gsd_m": 0.1, "strips": 1, "images_per_strip": 10, "end_lap": 0.8, "side_lap": 0.4}
    block, _ = small_block(1, "brown:K1", flight=flight, control=WELL_HELD)
    record = compare_halves(adjust_keeping_system(block), ("strips", "directions"))
    assert record.compared == ()
    assert "one strip" in record.comparisons[0].reason
    assert "same direction" in record.comparisons[1].reason


def test_strips_of_a_rig_are_those_of_its_exposures():
    """Five cameras on two strips and a cross strip, the rows mixed and no strip named."""
    block, truth = rig_block(3)
    mixed = np.random.default_rng(1).permutation(len(block.images))
    flown = block.images.strip[mixed].astype(str)
    block = replace(block, images=replace(block.images, strip=np.full(len(mixed), "", dtype=object)))
    rotation = rotation_from_angles(truth.angles, block.rotation)
    flight = flight_of(block, mixed, truth.centre[mixed], rotation[mixed])
    strip = dict(zip(flight.rows.tolist(), flight.strip.tolist(), strict=True))
    pairs = {(name, strip[int(row)]) for row, name in zip(mixed, flown, strict=True)}
    assert len(pairs) == len(set(flown.tolist())) == 3
    half = divide(block, flight, "strips").half
    assert min(int((half == k).sum()) for k in (0, 1)) >= 15


def test_noise_free_halves_agree():
    """With image points good to 0.1 nm both halves find the same points to 0.05 mm: nothing else differs."""
    tie_points = {"per_image": 60, "probability": 0.9, "sigma_um": 1e-4}
    exact, truth = small_block(1, "brown:K1+K2", control=WELL_HELD, tie_points=tie_points)
    xyz = truth.points[exact.control.point]
    rays = replace(exact.image_points, sigma=np.full_like(exact.image_points.sigma, 2e-3))
    block = replace(exact, control=replace(exact.control, xyz=xyz), image_points=rays)
    record = compare_halves(adjust_keeping_system(block), ("photographs",))
    compared = [one for one in record.comparisons if one.points is not None]
    assert compared
    for one in compared:
        assert np.abs(one.points.d).max() < 5e-5
        assert max(np.abs(field.d).max() for field in one.fields) < 1e-7


def dense_cofactors(pair, rows):
    """(6·k, 6·k) of K₁, K₂ and Q of some common points, from unit right sides."""
    k = 3 * len(rows)
    sides = np.zeros((pair.n_points, 3, k))
    sides[np.repeat(rows, 3), np.tile([0, 1, 2], len(rows)), np.arange(k)] = 1.0
    parts = [pair.solutions(which, sides) for which in (0, 1)]
    q = [points[rows].reshape(k, k) for points, _ in parts]
    return q[0] + q[1] - parts[0][1].T @ parts[1][1] - parts[1][1].T @ parts[0][1]


def test_covariance_by_changing_the_observations(found):
    """A change of a control coordinate moves both halves; K says by how much each."""
    pair = pair_of(found)
    shared = pair.shared[0]
    k = int(np.argmax(shared.root > 0))
    u = pair.halves[0].unknowns
    row, axis, step = shared.point[k], shared.axis[k], 0.01
    point = int(u.points[row])
    whole = whole_of(found)
    block = whole.unknowns.block
    xyz = block.control.xyz.copy()
    xyz[np.flatnonzero(block.control.point == point)[0], axis] += step
    moved = replace(
        whole, unknowns=replace(whole.unknowns, block=replace(block, control=replace(block.control, xyz=xyz)))
    )
    state = whole.state
    division = divide(block, flight_of(block, whole.unknowns.images, state.centre, state.rotation), "photographs")
    for which in (0, 1):
        again = adjust_half(moved, division.half == which, division.half == 1 - which, Hold())
        shift = (again.solution.state.points - pair.halves[which].solution.state.points)[pair.rows[which]]
        response = next(pair.responses(which))[0][:, :, k] * pair.shared[which].root[k]
        assert np.abs(shift - response * step).max() < 0.02 * np.abs(shift).max()


def test_cofactors_of_means_and_of_points(found):
    """Cofactors point by point, by functions, and from unit right sides are the same."""
    from aerotri.strategies.half_points import compare_points, mean_functions

    pair = pair_of(found)
    compared = compare_points(pair, free=False)
    rows = np.array([0, 5, 11])
    dense = dense_cofactors(pair, rows)
    for k, row in enumerate(rows):
        own = dense[3 * k : 3 * k + 3, 3 * k : 3 * k + 3]
        assert np.allclose(own, compared.cofactors.points[row], rtol=1e-6, atol=1e-9 * np.abs(own).max())
    cell = np.full(pair.n_points, -1)
    cell[rows] = np.arange(3)
    turn = np.broadcast_to(np.eye(3), (pair.n_points, 3, 3))
    functions = mean_functions(compared, cell, turn)
    assert np.allclose(pair.cofactors_of(functions), dense, rtol=1e-6, atol=1e-9 * np.abs(dense).max())


def test_transformed_points_do_not_know_the_datum(found):
    """After the transformation a motion of one half changes nothing, and the cofactors have none of it."""
    from aerotri.strategies.half_points import compare_points

    pair = pair_of(found)
    free = compare_points(pair, free=True)
    assert free.transformed
    assert np.abs(np.einsum("mpi,pi->m", free.solver, free.difference)).max() < 1e-10
    left = free.motions - free.motions @ np.einsum("mpi,pin->mn", free.solver, free.motions)
    assert np.abs(left).max() < 1e-6 * np.abs(free.motions).max()
    smaller = np.einsum("pii->p", free.cofactors.transformed) < np.einsum("pii->p", free.cofactors.points) * 1.5
    assert smaller.mean() > 0.9


def test_p_values_without_model_error():
    """Blocks whose model is right: probabilities are those of a uniform distribution (Kolmogorov, 0.1 %)."""
    p, squares = {}, []
    flight = {"gsd_m": 0.1, "strips": 2, "images_per_strip": 6, "end_lap": 0.8, "side_lap": 0.6}
    tie_points = {"per_image": 40, "probability": 0.9, "sigma_um": 2.0}
    for seed in range(SEEDS):
        found = adjusted(seed + 1, flight=flight, tie_points=tie_points)
        record = compare_halves(found, ("photographs",))
        for name, test in record.comparisons[0].tests:
            p.setdefault(name, []).append(test.p_statistic)
            p.setdefault(f"{name}, RMS", []).append(test.p_rms)
        points = record.comparisons[0].points
        squares.append(np.mean((points.d / points.sigma) ** 2))
    for values in p.values():
        assert len(values) == SEEDS
        assert kstest(values, "uniform").pvalue > 0.001
    # twenty blocks of some 500 coordinates, correlated: their mean square varies by 0.1 from block to block
    assert 0.9 < np.mean(squares) < 1.1


def test_errors_that_change_from_strip_to_strip_are_found():
    """2 µm of radial distortion, out in one strip and in in the next: alternate strips show it, photographs do not."""
    flight = {"gsd_m": 0.1, "strips": 4, "images_per_strip": 8, "end_lap": 0.8, "side_lap": 0.6}
    block, _ = small_block(3, "brown:K1", flight=flight, control=WELL_HELD)
    strips = np.unique(block.images.strip.astype(str), return_inverse=True)[1]
    sign = np.where(strips % 2 == 0, 1.0, -1.0)[block.image_points.image]
    xy = block.image_points.xy / block.cameras[0].r_max_mm
    error = xy * (np.linalg.norm(xy, axis=1) ** 2 - 0.4)[:, None]
    error *= 2e-3 * sign[:, None] / np.sqrt(np.mean(np.sum(error**2, axis=1)))
    xy = block.image_points.xy
    moved = replace(block, image_points=replace(block.image_points, xy=xy + error))
    record = compare_halves(adjust_keeping_system(moved), ("photographs", "strips"))
    photographs, strips_ = record.comparisons
    assert strips_.fields[0].test.p < 0.001
    assert record.found == ("strips",)
    assert not photographs.differs


def test_agreement_of_white_noise():
    """Uncorrelated differences: both tests are the F test of the mean square."""
    rng = np.random.default_rng(5)
    sigma = rng.uniform(0.5, 2.0, 30)
    d = sigma * rng.normal(size=30)
    test = agreement(d, np.diag(sigma**2), 200.0, 0.001)
    expected = f_distribution.sf(np.mean((d / sigma) ** 2), 30, 200)
    assert test.freedom == 30
    assert test.p_statistic == pytest.approx(expected, rel=1e-9)
    assert test.p_rms == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("weight", [(10.0, 1.0, 0.5, 0.1), (1.0,) * 14, (20.0, 0.3)])
@pytest.mark.parametrize("redundancy", [20, 100_000])
def test_weighted_sums_against_random_draws(weight, redundancy):
    rng = np.random.default_rng(1)
    weight = np.array(weight)
    draws = (rng.normal(size=(100_000, len(weight))) ** 2 @ weight) / (rng.chisquare(redundancy, 100_000) / redundancy)
    for value in weight.sum() * np.array([0.3, 1.0, 2.0, 4.0]):
        exact = float((draws > value).mean())
        # the approximation is good to 3 % of the smaller tail and the draws to four of their σ
        band = 0.05 * min(exact, 1.0 - exact) + 4.0 * np.sqrt(exact * (1.0 - exact) / len(draws)) + 1e-4
        assert abs(beyond_weighted_sum(float(value), weight, redundancy) - exact) < band


def test_cells_hold_all_points_once():
    rng = np.random.default_rng(2)
    xy = rng.uniform([0.0, 0.0], [3000.0, 900.0], (2000, 2))
    cell, centre, size = cells_in_plan(xy)
    assert 20 <= len(centre) <= 60
    assert (np.abs(xy - centre[cell]) <= 0.5 * size + 1e-6).all()
