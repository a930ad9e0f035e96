"""Groups of photographs predicted by the rest: against dense algebra, independence, true and false parameters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aerotri.functional_model.additional_parameters import parse_parameters
from aerotri.pipeline import adjust_keeping_system
from aerotri.strategies.field_estimation import border_marginal
from aerotri.strategies.group_prediction import areas, predict_groups
from dense_algebra import TINY, dense_design
from small_blocks import small_block, with_adjustment

CONTROL = {"distance_bases": 2.5, "sigma_m": [0.03, 0.03, 0.05]}


def status_of(found) -> np.ndarray:
    return found.local.rays.status


def reduced_densely(found, images):
    """What the rays among some photographs say of the shared parameters: contrasts (k, s) and (k,), written out."""
    u = found.system.unknowns
    n, s = len(u.images), len(u.shared)
    point = np.repeat(np.arange(len(u.points)), np.diff(u.rays.start))
    own = np.isin(u.images[u.rays.image], images)
    own &= np.bincount(point[own], minlength=len(u.points))[point] >= 2
    rows = np.flatnonzero(np.repeat(own, 2))
    design = dense_design(found)[rows]
    y = (found.solution.equations.residual * u.rays.inv_sigma).ravel()[rows]
    p, others = design[:, 6 * n : 6 * n + s], np.delete(design, np.arange(6 * n, 6 * n + s), axis=1)
    others = others[:, (others != 0.0).any(axis=0)]
    u_, values, _ = np.linalg.svd(others / np.linalg.norm(others, axis=0), full_matrices=True)
    left = u_[:, int((values > 1e-9 * values[0]).sum()) :]
    return left.T @ p, left.T @ y, rows, left


@pytest.mark.parametrize("parameters", ["bluh:9+3", "bluh:1-3,collocation:3x3"])
def test_density_against_dense_algebra(parameters):
    """−2 ln L from the contrasts of the group that know neither orientations nor points."""
    block = with_adjustment(
        small_block(3, **(TINY | {"control": CONTROL}))[0], additional_parameters=parse_parameters(parameters)
    )
    found = adjust_keeping_system(block)
    u = found.system.unknowns
    group, variance = u.images[:4], 1.7
    factor = found.system.factorise(found.solution.equations)
    columns = np.arange(len(u.shared))
    whole = border_marginal(factor, columns)
    a, y, _, _ = reduced_densely(found, group)
    rest = np.linalg.inv(whole - a.T @ a)
    # the residuals at the estimate without the group
    predicted = y + a @ rest @ (a.T @ y)
    covariance = variance * (np.eye(len(y)) + a @ rest @ a.T)
    dense = np.linalg.slogdet(covariance)[1] + predicted @ np.linalg.solve(covariance, predicted)
    said = predict_groups(found.system, found.solution, factor, status_of(found), [group], variance)
    assert said.redundancy[0] == len(y)
    assert said.deviance[0] == pytest.approx(dense, rel=1e-6)


def test_what_predicts_a_group_is_independent_of_it():
    """The estimate without the group's contrasts does not correlate with them, though their rays tie the rest too."""
    block = with_adjustment(
        small_block(3, **(TINY | {"control": CONTROL}))[0], additional_parameters=parse_parameters("bluh:9+3")
    )
    found = adjust_keeping_system(block)
    u = found.system.unknowns
    n, s = len(u.images), len(u.shared)
    design = dense_design(found)
    p, others = design[:, 6 * n : 6 * n + s], np.delete(design, np.arange(6 * n, 6 * n + s), axis=1)
    others = others[:, (others != 0.0).any(axis=0)]
    reduced = p - others @ np.linalg.lstsq(others, p, rcond=None)[0]
    a, _, rows, left = reduced_densely(found, u.images[:4])
    # h − h_g as a function of all observations
    rest = reduced.copy()
    rest[rows] -= left @ a
    assert np.abs(rest[rows].T @ left).max() < 1e-8 * np.abs(reduced[rows].T @ left).max()


def test_true_parameters_predict_better():
    """A camera that errs by BLUH 9 and 3: without them, and with six that it does not have."""
    camera = {"ucd": {"preset": "ultracam_d", "errors": {"parameters": {"bluh.9": -2e-8, "bluh.3": 1e-4}}}}
    block = small_block(5, camera=camera, control=CONTROL)[0]
    totals = {}
    for spec in ("none", "bluh:9+3", "bluh:1-12"):
        found = adjust_keeping_system(with_adjustment(block, additional_parameters=parse_parameters(spec)))
        u = found.system.unknowns
        groups = areas(block, u.images, found.solution.state.centre, 3)
        factor = found.system.factorise(found.solution.equations)
        variance = found.local.outcome.sigma0**2
        said = predict_groups(found.system, found.solution, factor, status_of(found), groups, variance)
        totals[spec] = said.deviance.sum()
    assert totals["bluh:9+3"] < totals["none"] - 50.0
    assert totals["bluh:9+3"] < totals["bluh:1-12"]


def test_areas_divide_all_photographs_in_any_order():
    block = small_block(6)[0]
    centre = np.nan_to_num(block.images.centre)
    images = np.arange(len(centre))
    found = areas(block, images, centre, 4)
    assert sorted(np.concatenate(found).tolist()) == images.tolist()
    assert max(map(len, found)) - min(map(len, found)) <= 1
    turned = replace(block, images=replace(block.images, centre=block.images.centre))
    again = areas(turned, images[::-1], centre[::-1], 4)
    assert {frozenset(a.tolist()) for a in found} == {frozenset(a.tolist()) for a in again}


def test_a_group_without_a_common_point_says_nothing():
    block = with_adjustment(
        small_block(3, **(TINY | {"control": CONTROL}))[0], additional_parameters=parse_parameters("bluh:9+3")
    )
    found = adjust_keeping_system(block)
    u = found.system.unknowns
    factor = found.system.factorise(found.solution.equations)
    said = predict_groups(found.system, found.solution, factor, status_of(found), [u.images[:1], u.images[:4]], 1.0)
    assert np.isnan(said.deviance[0])
    assert np.isfinite(said.deviance[1])
