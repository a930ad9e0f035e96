"""σ̂0 in the image, where the image points do not have the σ that the block states for them in common."""

from dataclasses import replace

import numpy as np
import pytest

import aerotri
from aerotri.functional_model.additional_parameters import parse_parameters
from aerotri.report.tables.adjustment import summary_lines
from dense_algebra import TINY
from small_blocks import small_block, with_adjustment


def with_sigma(factors):
    """A block whose image points have σ of their own, the usual ones times `factors` in turn; its measurements too."""
    block = small_block(14, **TINY)[0]
    block = with_adjustment(block, additional_parameters=parse_parameters("none"))
    rays = block.image_points
    by = np.resize(np.asarray(factors, float), len(rays))[:, None]
    return replace(block, image_points=replace(rays, sigma=rays.sigma * by))


def lines_of(result):
    return [line for line in summary_lines(result.adjusted) if "µm" in line]


def test_own_sigma_of_all_rays():
    """All σ twice the common one: σ0 halves, and in µm it is what it was."""
    common, own = aerotri.adjust(with_sigma([1.0])), aerotri.adjust(with_sigma([2.0]))
    assert own.sigma0 == pytest.approx(0.5 * common.sigma0, rel=0.05)
    assert own.sigma0_um == pytest.approx(common.sigma0_um, rel=0.05)
    assert len(lines_of(own)) == 1


def test_two_groups_have_a_line_each():
    result = aerotri.adjust(with_sigma([1.0, 1.0, 1.0, 4.0]))
    usual = result.block.settings.image_sigma_um
    assert result.sigma0_um == pytest.approx(result.sigma0 * usual)
    first, most, few = lines_of(result)
    assert "in the median" in first
    assert f"{usual:.3g} µm: {result.sigma0 * usual:.2f} µm" in most
    assert f"{4 * usual:.3g} µm: {result.sigma0 * 4 * usual:.2f} µm" in few


def test_many_groups_have_their_range():
    result = aerotri.adjust(with_sigma(np.linspace(1.0, 3.0, 9)))
    assert len(lines_of(result)) == 2
    assert " to " in lines_of(result)[1]
