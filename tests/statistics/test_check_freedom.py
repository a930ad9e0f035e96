"""Check points share errors: their degrees of freedom against chance, over many blocks."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, kstest

from aerotri.pipeline import adjust_keeping_system
from aerotri.statistics.check_freedom import SAMPLE, check_freedom
from ten_photographs import ten_photographs

BLOCKS = 40


def with_few_control(seed):
    block = ten_photographs(seed, navigated=False)
    return replace(block, control=replace(block.control, is_check=np.arange(len(block.control)) >= 3))


def test_degrees_of_freedom_of_check_points_that_share_errors():
    """Σd²/σ² is χ² of so many degrees of freedom, not of as many as there are points; 40 blocks for it take 4 s."""
    shared, alone = [], []
    for seed in range(BLOCKS):
        found = adjust_keeping_system(with_few_control(seed))
        check = found.local.check
        factor = found.system.factorise(found.solution.equations)
        freedom = check_freedom(found.system, found.solution, factor, found.local)
        assert (freedom >= 1.0).all()
        assert (freedom < 0.5 * len(check)).all()
        given = found.local.block.control.sigma[found.local.block.control.is_check]
        ratio = np.sum(check.difference**2, axis=0) / np.sum(check.sigma**2 + given**2, axis=0)
        shared.append(chi2.sf(ratio * freedom, freedom))
        alone.append(chi2.sf(ratio * len(check), len(check)))
    for axis in range(3):
        assert kstest(np.array(shared)[:, axis], "uniform").pvalue > 1e-3
    assert kstest(np.ravel(alone), "uniform").pvalue < 1e-6


@pytest.mark.parametrize("count", [1, 2, SAMPLE + 5])
def test_any_number_of_check_points(count):
    block = ten_photographs(1)
    points = np.flatnonzero(np.bincount(block.image_points.point, minlength=len(block.points)) >= 3)[:count]
    rest = [k for k, point in enumerate(block.control.point) if point not in points and not block.control.is_check[k]]
    control = block.control
    xyz = np.concatenate([control.xyz[rest], np.zeros((count, 3))])
    sigma = np.concatenate([control.sigma[rest], np.full((count, 3), 1e3)])
    is_check = np.arange(len(rest) + count) >= len(rest)
    point = np.concatenate([control.point[rest], points])
    block = replace(block, control=replace(control, point=point, xyz=xyz, sigma=sigma, is_check=is_check))
    found = adjust_keeping_system(block)
    factor = found.system.factorise(found.solution.equations)
    freedom = check_freedom(found.system, found.solution, factor, found.local)
    # given so loosely each errs alone
    assert freedom == pytest.approx([count] * 3, rel=1e-3)
