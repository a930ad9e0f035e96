"""A check that cannot fail is worthless: mistakes on either side are found."""

from dataclasses import replace

import numpy as np
import pytest

from aerotri.crosscheck import paper_rays
from aerotri.crosscheck.paper_check import check_with_paper
from aerotri.crosscheck.paper_families import LINEAR
from aerotri.pipeline import adjust
from small_blocks import small_block


@pytest.fixture(scope="module")
def adjusted():
    return adjust(small_block(1, "bluh:1-12,ultracam_d:42-73")[0])


@pytest.fixture
def spoil(monkeypatch):
    """Replace the patterns of a linear family by a function of what they were."""

    def replace_patterns(family, change):
        true = LINEAR[family]
        wrong = replace(true, patterns=lambda camera, x, y, items: change(true.patterns(camera, x, y, items)))
        monkeypatch.setitem(LINEAR, family, wrong)

    return replace_patterns


def with_sign_flipped(column):
    return lambda patterns: patterns * np.where(np.arange(patterns.shape[2]) == column, -1.0, 1.0)


@pytest.mark.parametrize(("family", "column"), [("bluh", 0), ("bluh", 8), ("ultracam_d", 10), ("ultracam_d", 31)])
def test_the_sign_of_one_parameter(adjusted, spoil, family, column):
    spoil(family, with_sign_flipped(column))
    check = check_with_paper(adjusted, adjust)
    assert check.status == "differs"
    assert "additional parameters" in check.reason


def test_a_pattern_in_one_coordinate_only(adjusted, spoil):
    def without_dy_of_p5(patterns):
        patterns = patterns.copy()
        patterns[:, 1, 4] = 0.0
        return patterns

    spoil("bluh", without_dy_of_p5)
    check = check_with_paper(adjusted, adjust)
    assert check.status == "differs"
    assert "vᵀPv" in check.reason


def test_collinearity_off_by_a_third_of_a_micrometre_at_the_edge(adjusted, monkeypatch):
    true = paper_rays.forward_lens

    def stretched(a, b, *values):
        a, b = true(a, b, *values)
        return a, b * (1.0 + 1e-5)

    monkeypatch.setattr(paper_rays, "forward_lens", stretched)
    check = check_with_paper(adjusted, adjust)
    assert check.status == "differs"


def moved_point(result, share):
    """The result with one coordinate of a point off by a share of its σ."""
    row = int(np.flatnonzero(np.isfinite(result.points.xyz[:, 2]))[5])
    xyz = result.points.xyz.copy()
    xyz[row, 2] += share * result.points.sigma[row, 2]
    return replace(result, points=replace(result.points, xyz=xyz)), str(result.block.points[row])


def test_a_point_moved_by_a_tenth_of_its_sigma(adjusted):
    moved, name = moved_point(adjusted, 0.1)
    check = check_with_paper(moved, adjust)
    assert check.status == "differs"
    assert f"object points by up to 0.1 σ (Z {name})" in check.reason


def test_a_value_that_is_missing(adjusted):
    value = adjusted.parameters.value.copy()
    value[3] = np.nan
    check = check_with_paper(replace(adjusted, parameters=replace(adjusted.parameters, value=value)), adjust)
    assert check.status == "differs"
    assert "additional parameters by up to inf σ" in check.reason


def test_observations_that_were_not_used(adjusted):
    """A solution that left control out, presented as one with control."""
    block = adjusted.block
    few = np.arange(len(block.control)) > 0
    control = replace(
        block.control,
        point=block.control.point[few],
        xyz=block.control.xyz[few],
        sigma=block.control.sigma[few],
        is_check=block.control.is_check[few],
    )
    without = adjust(replace(block, control=control))
    check = check_with_paper(replace(without, block=block), adjust)
    assert check.status == "differs"
    assert check.reason.startswith(f"observations: ours {check.observations - 3}, independently {check.observations}")


def test_pycolmap_finds_a_moved_point_and_a_wrong_sigma(adjusted):
    pytest.importorskip("pyceres", reason="pyceres (extra 'ceres') is not installed")
    from aerotri.crosscheck.colmap_check import check_with_colmap

    check = check_with_colmap(adjusted, lambda block: moved_point(adjust(block), 0.1)[0])
    assert check.status == "differs"
    assert "object points by up to 0.1 σ" in check.reason

    def too_certain(block):
        result = adjust(block)
        return replace(result, images=replace(result.images, covariance=0.99 * result.images.covariance))

    check = check_with_colmap(adjusted, too_certain)
    assert check.status == "differs"
    assert "σ of the orientation by up to 0.5 %" in check.reason


def test_pycolmap_finds_image_points_that_were_freed_wrongly(adjusted, monkeypatch):
    """The freed block must give the solution of the self-calibrated one; here one parameter is freed twice."""
    pytest.importorskip("pyceres", reason="pyceres (extra 'ceres') is not installed")
    from aerotri.crosscheck.freed import freed_block

    value = adjusted.parameters.value.copy()
    value[0] *= 2.0
    wrong = replace(adjusted, parameters=replace(adjusted.parameters, value=value))
    right, off = adjust(freed_block(adjusted).block), adjust(freed_block(wrong).block)
    sigma = adjusted.images.sigma
    assert np.abs((right.images.centre - adjusted.images.centre) / sigma[:, :3]).max() < 1e-3
    assert np.abs((off.images.centre - adjusted.images.centre) / sigma[:, :3]).max() > 0.05
