"""Errors of positions that stay for a while: nodes, their covariance, and the adjustment against a dense one."""

from dataclasses import replace

import numpy as np
import pytest

from aerotri.adjustment import position_errors
from aerotri.adjustment.exposures import EXPOSURES, SECONDS, Exposures, exposures_of
from aerotri.adjustment.position_errors import error_nodes
from aerotri.functional_model.observed_unknowns import CentreObservations
from aerotri.pipeline import adjust_keeping_system
from dense_algebra import TINY, dense_design
from small_blocks import small_block

GNSS = {"sigma_m": [0.05, 0.05, 0.08], "correlated_sigma_m": [0.1, 0.1, 0.2], "correlation_time_s": 10.0}
KNOWN = {"correlated": "on", "correlation_time_s": 10.0, "correlated_sigma_m": (0.1, 0.12, 0.2)}


def with_gnss(block, **settings):
    return replace(block, settings=replace(block.settings, gnss=replace(block.settings.gnss, **settings)))


def two_flights(count=9, seed=3):
    rng = np.random.default_rng(seed)
    time = np.concatenate([np.cumsum(rng.uniform(1.0, 3.0, count)), np.cumsum(rng.uniform(1.0, 3.0, count))])
    order = rng.permutation(2 * count)
    return Exposures(np.repeat([0, 1], count)[order], time[order], SECONDS)


def test_precision_is_the_inverse_of_the_correlation():
    exposures = two_flights()
    nodes = error_nodes(exposures, 5.0)
    assert len(nodes.rows) == len(exposures)
    np.testing.assert_allclose(
        nodes.precision(5.0) @ nodes.exposures.correlation(5.0), np.eye(len(exposures)), atol=1e-12
    )
    assert not nodes.left.any()
    np.testing.assert_array_equal(nodes.rows[nodes.before], np.arange(len(exposures)))


def test_thinned_nodes_keep_every_variance(monkeypatch):
    """Between nodes the conditional mean, what it leaves goes to the white part."""
    monkeypatch.setattr(position_errors, "MOST_EXACT", 0)
    exposures, tau = two_flights(40), 20.0
    nodes = error_nodes(exposures, tau)
    assert len(nodes.rows) < 0.7 * len(exposures)
    correlation = exposures.correlation(tau)
    at_nodes = correlation[np.ix_(nodes.rows, nodes.rows)]
    by_nodes = np.zeros((len(exposures), len(nodes.rows)))
    k = np.arange(len(exposures))
    by_nodes[k, nodes.before] += nodes.by_before
    by_nodes[k, nodes.after] += nodes.by_after
    np.testing.assert_allclose(by_nodes, correlation[:, nodes.rows] @ np.linalg.inv(at_nodes), atol=1e-10)
    carried = by_nodes @ at_nodes @ by_nodes.T
    np.testing.assert_allclose(np.diagonal(carried) + nodes.left, 1.0, atol=1e-12)
    assert nodes.left.max() < 0.13
    assert np.abs(carried - correlation)[~np.eye(len(k), dtype=bool)].max() < 0.13


def test_photographs_of_one_moment_have_one_node():
    exposures = Exposures(np.zeros(4, dtype=int), np.array([0.0, 1.0, 1.0, 2.0]), SECONDS)
    nodes = error_nodes(exposures, 3.0)
    assert len(nodes.rows) == 3
    np.testing.assert_array_equal(nodes.before, [0, 1, 1, 2])
    assert np.isfinite(nodes.precision(3.0)).all()


def test_flights_and_times_of_a_block():
    days = TINY["flight"] | {"days": 2}
    block = small_block(2, **TINY | {"flight": days}, gnss=GNSS)[0]
    rows, centre = np.arange(len(block.images)), block.gnss_ins.xyz
    found = exposures_of(block, rows, centre)
    assert found.unit == SECONDS
    assert len(np.unique(found.flight)) == 2
    np.testing.assert_allclose(found.time, block.gnss_ins.time)
    without = replace(block, gnss_ins=replace(block.gnss_ins, time=np.full(len(rows), np.nan)))
    columns = {name: values for name, values in block.images.columns.items() if name == "day"}
    counted = exposures_of(replace(without, images=replace(block.images, columns=columns)), rows, centre)
    assert counted.unit == EXPOSURES
    assert len(np.unique(counted.flight)) == 2
    assert sorted(counted.time[counted.flight == 0].tolist()) == [0.0, 1.0, 2.0, 3.0]


def test_strips_that_overlap_in_time_have_clocks_of_their_own():
    block = small_block(2, **TINY, gnss=GNSS)[0]
    rows, strips = np.arange(len(block.images)), block.images.strip.astype(str)
    assert len(np.unique(exposures_of(block, rows, block.gnss_ins.xyz).flight)) == 1
    time = block.gnss_ins.time.copy()
    time[strips == "2"] -= time[strips == "2"].min()
    other = replace(block, gnss_ins=replace(block.gnss_ins, time=time))
    assert len(np.unique(exposures_of(other, rows, block.gnss_ins.xyz).flight)) == 2


@pytest.mark.parametrize("shift", ["off", "strip"])
def test_adjustment_equals_generalised_least_squares(shift):
    """σ and estimates against a dense adjustment in which positions have their full covariance and no nodes."""
    block = with_gnss(small_block(4, "bluh:1-2", **TINY, gnss=GNSS)[0], shift=shift, **KNOWN)
    adjustment = adjust_keeping_system(block)
    assert adjustment.result.outcome.status == "converged"
    system, state = adjustment.system, adjustment.solution.state
    u = system.unknowns
    n, first = 6 * len(u.images), len(u.shared) - u.shared.kinds.count(position_errors.KIND)
    observed = next(extra for extra in system.extras if isinstance(extra, CentreObservations))
    design = dense_design(adjustment)
    nodes = np.arange(n + first, n + len(u.shared))
    of_prior = np.flatnonzero(np.abs(design[:, nodes]).sum(axis=1) * (np.abs(design).sum(axis=1) > 0))
    touches_nodes = np.abs(design[:, nodes]).sum(axis=1) > 0.0
    only_nodes = touches_nodes & (np.abs(np.delete(design, nodes, axis=1)).sum(axis=1) == 0.0)
    assert len(of_prior) == touches_nodes.sum()
    # without the nodes' own rows and columns; positions then have covariance I + K, whitened
    rows = np.delete(design, nodes, axis=1)[~only_nodes]
    to_nodes = design[:, nodes][~only_nodes]
    e = exposures_of(u.block, u.images[observed.image], state.centre[observed.image])
    node_exposures = e.taken(error_nodes(e, 10.0).rows)
    prior = np.kron(np.diag(np.square(KNOWN["correlated_sigma_m"])), node_exposures.correlation(10.0))
    covariance = np.eye(len(rows)) + to_nodes @ prior @ to_nodes.T
    normals = rows.T @ np.linalg.solve(covariance, rows)
    active = np.abs(rows).sum(axis=0) > 0.0
    q = np.zeros_like(normals)
    q[np.ix_(active, active)] = np.linalg.inv(normals[np.ix_(active, active)])
    s0 = adjustment.result.outcome.sigma0
    for i in range(len(u.images)):
        at = slice(6 * i, 6 * i + 3)
        np.testing.assert_allclose(adjustment.result.images.covariance[u.images[i]][:3, :3] / s0**2, q[at, at],
                                   rtol=1e-6, atol=1e-10)  # fmt: skip
    start = n + first
    for p in range(0, len(u.points), 7):
        at = slice(start + 3 * p, start + 3 * p + 3)
        np.testing.assert_allclose(
            adjustment.result.points.covariance[u.points[p]] / s0**2, q[at, at], rtol=1e-6, atol=1e-10
        )
    # at the solution the generalised normal equations hold: Aᵀ·C⁻¹·(gap without the process) = 0
    gaps = np.concatenate([np.zeros(0), *(r.gap[r.inv_sigma > 0.0] for r in system.whitened_rows(state))])
    share = to_nodes[-len(gaps) :] @ state.shared[first:]
    blup = prior @ to_nodes[-len(gaps) :].T @ np.linalg.solve(covariance[-len(gaps) :, -len(gaps) :], gaps + share)
    np.testing.assert_allclose(state.shared[first:], blup, atol=1e-7)
    redundancy = sum(group.redundancy for group in adjustment.result.groups)
    assert abs(redundancy - adjustment.result.outcome.redundancy) < 1e-6


def test_thinned_nodes_change_little(monkeypatch):
    """A quarter of the correlation time between nodes: σ of photographs and points within 2 %."""
    flight = TINY["flight"] | {"images_per_strip": 12, "speed_m_s": 60.0}
    changes = TINY | {"flight": flight}
    block = small_block(4, **changes, gnss=GNSS)[0]
    time = 8.0 * float(np.median(np.diff(block.gnss_ins.time)))
    block = with_gnss(block, **(KNOWN | {"correlation_time_s": time}))
    exact = adjust_keeping_system(block)
    monkeypatch.setattr(position_errors, "MOST_EXACT", 0)
    thin = adjust_keeping_system(block)
    assert len(thin.system.unknowns.shared) < 0.75 * len(exact.system.unknowns.shared)
    np.testing.assert_allclose(thin.result.images.sigma, exact.result.images.sigma, rtol=0.02)
    np.testing.assert_allclose(thin.result.points.sigma, exact.result.points.sigma, rtol=0.02)


def test_no_unknowns_where_such_errors_have_no_size():
    block = with_gnss(small_block(4, **TINY, gnss=GNSS)[0], **(KNOWN | {"correlated_sigma_m": (0.0, 0.0, 0.0)}))
    assert position_errors.KIND not in adjust_keeping_system(block).system.unknowns.shared.kinds
    heights = with_gnss(block, correlated_sigma_m=(0.0, 0.0, 0.1))
    shared = adjust_keeping_system(heights).system.unknowns.shared
    assert shared.kinds.count(position_errors.KIND) == len(block.images)
    assert {name for name in shared.names if name.startswith("gnss")} == {"gnss.error_Z"}
