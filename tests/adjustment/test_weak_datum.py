"""Observations of large σ alone hold a block in place: weak is not free, and the σ are as large as they are."""

from dataclasses import replace

import numpy as np
import pytest

import aerotri
from aerotri.adjustment.defects import checked_factor
from aerotri.adjustment.prepare import prepare
from aerotri.adjustment.robust import LEAST_SQUARES
from aerotri.adjustment.weak_datum import WeakFactor
from aerotri.functional_model.additional_parameters import parse_parameters
from aerotri.observations import Control
from aerotri.pipeline import adjust_keeping_system
from dense_algebra import TINY, dense_design
from small_blocks import small_block, with_adjustment


def tiny(sigma, rows=None):
    """A block held by control alone, of these σ (m, of all axes or of each)."""
    block = with_adjustment(small_block(14, **TINY)[0], additional_parameters=parse_parameters("none"))
    control = block.control
    rows = np.flatnonzero(~control.is_check) if rows is None else np.array(rows)
    given = np.broadcast_to(np.asarray(sigma, float), (len(rows), 3)).copy()
    none = np.zeros(len(rows), bool)
    return replace(block, control=Control(control.point[rows], control.xyz[rows], given, none))


def look(block):
    prepared = prepare(block)
    system, state = prepared.system, prepared.state
    equations = system.assemble(state, 0.0, LEAST_SQUARES)
    return system, equations, *checked_factor(system, state, equations, LEAST_SQUARES)


DETERMINED = [1e-4, 1e-2, 1.0, 1e2, 1e4, 1e6, (1e-4, 1.0, 1e4), (1e4, 1e4, 1e-3), (1e4, 1e-3, 1e2)]


@pytest.mark.parametrize("sigma", DETERMINED)
def test_no_sigma_makes_a_defect(sigma):
    *_, factor, said = look(tiny(sigma))
    assert factor is not None
    assert not said


@pytest.mark.parametrize("by", [1e-3, 1.0, 1e3, 1e6])
@pytest.mark.parametrize(("rows", "words"), [([0, 1], "a combination of"), ([0], "and scale")])
def test_what_is_free_is_named_at_any_sigma(rows, words, by):
    *_, factor, said = look(tiny(0.02 * by, rows))
    assert factor is None
    assert "the datum is free in" in said[0]
    assert words in said[0]


def test_sigma_grow_with_those_of_control():
    """Held by control alone and weakly: the σ of a photograph are those of control, however large."""
    weak, weaker = (look(tiny(sigma)) for sigma in (1e3, 1e6))
    assert isinstance(weak[2], WeakFactor)
    assert isinstance(weaker[2], WeakFactor)
    near, far = (
        np.sqrt(np.diagonal(factor.inverse_on_pattern().blocks[:8], axis1=1, axis2=2))
        for _, _, factor, _ in (weak, weaker)
    )
    np.testing.assert_allclose(far[:, :3], 1e3 * near[:, :3], rtol=1e-5)


@pytest.mark.parametrize("sigma", [1e3, 1e4, (1e-3, 1.0, 1e4)])
def test_against_dense_algebra(sigma):
    """σ and redundancy numbers by the orthogonal decomposition of the whole design matrix, which squares nothing."""
    adjustment = adjust_keeping_system(tiny(sigma))
    result, u = adjustment.result, adjustment.system.unknowns
    design = dense_design(adjustment)
    norm = np.linalg.norm(design, axis=0)
    q, r = np.linalg.qr(design[:, norm > 0] / norm[norm > 0])
    root = np.linalg.inv(r) / norm[norm > 0][:, None]
    sigma_dense = np.full(design.shape[1], np.nan)
    sigma_dense[norm > 0] = np.sqrt(np.sum(root**2, axis=1))
    n, s = len(u.images), len(u.shared)
    points = sigma_dense[6 * n + s :].reshape(-1, 3) * result.outcome.sigma0
    ours = np.sqrt(np.diagonal(result.points.covariance[u.points], axis1=1, axis2=2))
    np.testing.assert_allclose(ours, points, rtol=1e-5)
    of_rays = 1.0 - np.sum(q[: 2 * len(u.rays.image)] ** 2, axis=1).reshape(-1, 2)
    np.testing.assert_allclose(result.rays.r[u.rays.source], of_rays, atol=1e-3)


def test_the_whole_way():
    """By `adjust`: the same block with control of 2 cm and of 2 km has the same shape, and no defect."""
    good, weak = aerotri.adjust(tiny(0.02)), aerotri.adjust(tiny(2e3))
    assert weak.status == "converged"
    apart = [
        np.linalg.norm(found.adjusted.points.xyz[:, None] - found.adjusted.points.xyz[None], axis=2)
        for found in (good, weak)
    ]
    np.testing.assert_allclose(apart[1], apart[0], rtol=2e-3)
    assert np.nanmin(weak.adjusted.points.sigma) > 100.0
