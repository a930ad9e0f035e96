"""Control without error (σ = 0): held, as the limit of ever smaller σ and as the dense algebra has it."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from aerotri.adjustment.robust import LEAST_SQUARES
from aerotri.commands.adjust import run_adjust
from aerotri.commands.console import Console
from aerotri.commands.results import reopened
from aerotri.conventions import InputError
from aerotri.formats.block.folder import read_block, write_block
from aerotri.pipeline import adjust_keeping_system
from dense_algebra import TINY, dense_design
from small_blocks import small_block

KINDS = {"all": [0, 1, 2], "plan": [0, 1], "height": [2]}


def block_with(sigma, axes=(0, 1, 2), **settings):
    """A small block whose control has another σ in some coordinates."""
    block = small_block(2, settings.pop("parameters", "none"), **TINY)[0]
    control = block.control
    chosen = control.sigma.copy()
    chosen[np.ix_(~control.is_check, list(axes))] = sigma
    return replace(block, control=replace(control, sigma=chosen))


@pytest.mark.parametrize("axes", KINDS.values(), ids=KINDS)
def test_held_is_the_limit_of_small_sigmas(axes):
    held, weighted = (adjust_keeping_system(block_with(s, axes, parameters="bluh:1-4")) for s in (0.0, 1e-9))
    one, other = held.result, weighted.result
    for name in ("status", "redundancy"):
        assert getattr(one.outcome, name) == getattr(other.outcome, name)
    assert one.outcome.sigma0 == pytest.approx(other.outcome.sigma0, rel=1e-7)
    np.testing.assert_allclose(one.images.centre, other.images.centre, atol=1e-6)
    np.testing.assert_allclose(one.images.sigma, other.images.sigma, rtol=1e-6)
    np.testing.assert_allclose(one.parameters.value, other.parameters.value, rtol=1e-5)
    np.testing.assert_allclose(one.points.sigma, other.points.sigma, rtol=1e-5, atol=2e-9)
    np.testing.assert_allclose(one.rays.r, other.rays.r, rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(one.control.difference[:, axes], 0.0, atol=1e-12)
    assert np.all(one.control.sigma[:, axes] == 0.0)
    assert np.all(one.control.r[:, axes] == 0.0)
    rest = [axis for axis in range(3) if axis not in axes]
    np.testing.assert_allclose(one.control.w[:, rest], other.control.w[:, rest], rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize("axes", KINDS.values(), ids=KINDS)
def test_the_test_of_a_held_coordinate_is_that_of_a_small_sigma(axes):
    """w = −v/(σ√r) of the same coordinate alone weighted, with a σ that still leaves it a residual."""
    block = block_with(0.0, axes, parameters="bluh:1-4")
    held = adjust_keeping_system(block).result.control
    for k, axis in ((0, axes[0]), (1, axes[-1])):
        row = np.flatnonzero(block.control.point == held.point[k])[0]
        sigma = block.control.sigma.copy()
        sigma[row, axis] = 0.02 * held.lone_sigma[k, axis]
        other = adjust_keeping_system(replace(block, control=replace(block.control, sigma=sigma))).result.control
        assert 0.0 < other.r[k, axis] < 1e-3
        assert held.w[k, axis] == pytest.approx(other.w[k, axis], rel=2e-3, abs=2e-4)


def test_held_coordinates_against_dense_algebra():
    """Cofactors and redundancy numbers of the design without what is held; w by Lagrange's multiplier."""
    adjustment = adjust_keeping_system(block_with(0.0, parameters="bluh:1-4"))
    system, u = adjustment.system, adjustment.system.unknowns
    design = dense_design(adjustment)
    used = np.flatnonzero(np.abs(design).sum(axis=0) > 0.0)
    assert design.shape[1] - len(used) == u.control_held.sum()
    q = np.linalg.inv(design[:, used].T @ design[:, used])
    full = np.zeros((design.shape[1], design.shape[1]))
    full[np.ix_(used, used)] = q
    n, s = len(u.images), len(u.shared)
    s0 = adjustment.result.outcome.sigma0
    covariance = adjustment.local.points.covariance[u.points]
    for p in range(0, len(u.points), 7):
        at = 6 * n + s + 3 * p + np.arange(3)
        np.testing.assert_allclose(covariance[p], s0**2 * full[np.ix_(at, at)], rtol=1e-6, atol=1e-12)
    r = 1.0 - np.einsum("ij,jk,ik->i", design[:, used], q, design[:, used])
    np.testing.assert_allclose(adjustment.local.rays.r[u.rays.source], r[: 2 * len(u.rays.image)].reshape(-1, 2),
                               rtol=1e-6, atol=1e-9)  # fmt: skip
    assert adjustment.result.outcome.redundancy == len(design) - len(used)
    # all columns there: Lagrange's multiplier λ = aᵀPv over the root of the normal equation reduced to it
    free = replace(u, point_free=np.ones_like(u.point_free))
    whole = dense_design(replace(adjustment, system=_with(system, free)))
    e = (adjustment.solution.equations.residual * u.rays.inv_sigma).ravel()
    control = adjustment.result.control
    for k in range(3):
        row = int(np.flatnonzero(u.points == control.point[k])[0])
        a = whole[: len(e), 6 * n + s + 3 * row + 2]
        reduced = a @ a - (a @ design[: len(e), used]) @ q @ (design[: len(e), used].T @ a)
        assert control.w[k, 2] == pytest.approx(-(a @ e) / np.sqrt(reduced), rel=1e-4, abs=1e-6)
        assert control.lone_sigma[k, 2] == pytest.approx(reduced**-0.5, rel=1e-6)


def _with(system, unknowns):
    from copy import copy

    other = copy(system)
    other.unknowns = unknowns
    return other


def test_a_wrong_held_coordinate_is_found():
    block = block_with(0.0)
    xyz = block.control.xyz.copy()
    row = int(np.flatnonzero(~block.control.is_check)[0])
    xyz[row, 2] += 3.0
    found = adjust_keeping_system(replace(block, control=replace(block.control, xyz=xyz))).result
    largest = np.unravel_index(np.nanargmax(np.abs(found.control.w)), found.control.w.shape)
    assert int(found.control.point[largest[0]]) == int(block.control.point[row])
    assert largest[1] == 2
    name = str(block.points[block.control.point[row]])
    listed = [b for b in found.blunders if b.point == name and not b.image]
    assert listed
    # (given − predicted): three metres, as far as the rest tells
    assert listed[0].estimated_mm == pytest.approx(3000.0, rel=0.2)


def test_check_points_without_error():
    block = block_with(0.03)
    sigma = np.where(block.control.is_check[:, None], 0.0, block.control.sigma)
    found = adjust_keeping_system(replace(block, control=replace(block.control, sigma=sigma))).result
    np.testing.assert_allclose(found.check.w, found.check.difference / found.check.sigma, rtol=1e-12)


@pytest.mark.parametrize("axes", KINDS.values(), ids=KINDS)
def test_command_files_and_reopening(tmp_path, axes):
    write_block(block_with(0.0, axes, parameters="bluh:1-4"), tmp_path / "block")
    again = read_block(tmp_path / "block")
    assert (again.control.sigma[~again.control.is_check][:, axes] == 0.0).all()
    assert run_adjust(tmp_path / "block", tmp_path / "result", None, None, None, True, True, True) == 0
    content = json.loads((tmp_path / "result" / "adjustment.json").read_text())
    assert any("σ = 0" in text for text in content["warnings"])
    opened = reopened(tmp_path / "result", Console(quiet=True))
    adjusted = adjust_keeping_system(again)
    for name in ("xyz", "covariance"):
        there, here = getattr(opened.result.points, name), getattr(adjusted.result.points, name)
        np.testing.assert_allclose(there, here, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(opened.result.control.w, adjusted.result.control.w, rtol=1e-5, atol=1e-7)


def test_in_a_crs_the_given_coordinates_come_back():
    block = block_with(0.0)
    control = block.control
    shift = np.array([500000.0, 5400000.0, 0.0])
    images = replace(block.images, centre=block.images.centre + shift)
    block = replace(block, crs="EPSG:32632", images=images, control=replace(control, xyz=control.xyz + shift))
    found = adjust_keeping_system(block).result
    assert found.outcome.status == "converged"
    np.testing.assert_allclose(found.control.difference, 0.0, atol=1e-6)
    np.testing.assert_allclose(found.control.r, 0.0, atol=0.0)
    assert np.isfinite(found.control.w).all()


@pytest.mark.parametrize("robust", ["huber", "data-snooping"])
def test_with_robust_estimation(robust):
    block = block_with(0.0)
    adjustment = replace(block.settings.adjustment, robust=robust)
    found = adjust_keeping_system(replace(block, settings=replace(block.settings, adjustment=adjustment))).result
    assert found.outcome.status == "converged"
    np.testing.assert_allclose(found.control.difference, 0.0, atol=1e-12)


def test_a_negative_sigma_is_refused(tmp_path):
    write_block(block_with(0.03), tmp_path / "block")
    path = tmp_path / "block" / "control.csv"
    lines = path.read_text().splitlines()
    column = lines[0].split(",").index("sZ")
    cells = lines[1].split(",")
    cells[column] = "-0.1"
    path.write_text("\n".join([lines[0], ",".join(cells), *lines[2:]]) + "\n")
    with pytest.raises(InputError, match="not a standard deviation"):
        read_block(tmp_path / "block")


def test_settled_by_least_squares():
    """The state of a held block is a minimum of vᵀPv over what is free."""
    adjustment = adjust_keeping_system(block_with(0.0))
    side = adjustment.system.assemble(adjustment.solution.state, 0.0, LEAST_SQUARES)
    x = adjustment.system.factorise(side).solve(side.right)
    assert float(x @ side.right) < 1e-6
