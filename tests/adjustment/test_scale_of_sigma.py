"""When an adjustment has converged does not depend on the σ that are stated, and not on whether there are residuals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import aerotri
from aerotri.observations import Block
from aerotri.pipeline import adjust
from odd_blocks import drawn, odd_block
from small_blocks import small_block, with_adjustment

PARAMETERS = "bluh:1-12"


def with_sigma(block: Block, factor: float) -> Block:
    """The block with every σ of an observation multiplied by a factor."""
    rays, control, gnss = block.image_points, block.control, block.gnss_ins
    if gnss is not None:
        gnss = replace(gnss, sigma=factor * gnss.sigma, angles_sigma=factor * gnss.angles_sigma)
    return replace(
        block,
        image_points=replace(rays, sigma=factor * rays.sigma),
        control=replace(control, sigma=factor * control.sigma),
        gnss_ins=gnss,
        settings=replace(block.settings, image_sigma_um=factor * block.settings.image_sigma_um),
    )


@pytest.fixture(scope="module")
def usual():
    block = small_block(3, PARAMETERS)[0]
    return block, aerotri.adjust(block)


@pytest.mark.parametrize("factor", [1e-6, 1e-3, 1e3, 1e6])
def test_all_sigma_far_too_small_or_large(usual, factor):
    block, plain = usual
    found = aerotri.adjust(with_sigma(block, factor))
    assert found.status == "converged"
    assert found.adjusted.outcome.iterations == plain.adjusted.outcome.iterations
    assert found.sigma0 == pytest.approx(plain.sigma0 / factor, rel=1e-6)
    # within a thousandth of their σ, which hang on the residuals alone
    change = found.adjusted.points.xyz - plain.adjusted.points.xyz
    assert np.nanmax(np.abs(change) / plain.adjusted.points.sigma) < 1e-3


def without_errors(found: aerotri.Adjustment, noise_mm: float) -> Block:
    """The block of an adjustment with its image points and control where the adjustment puts them."""
    block, adjusted = found.block, found.adjusted
    rng, control = np.random.default_rng(0), block.control
    xy = block.image_points.xy + adjusted.rays.v
    xy = np.where(np.isfinite(xy), xy, block.image_points.xy) + noise_mm * rng.normal(size=xy.shape)
    xyz = adjusted.points.xyz[control.point]
    return replace(
        block,
        image_points=replace(block.image_points, xy=xy),
        control=replace(control, xyz=np.where(np.isfinite(xyz), xyz, control.xyz)),
    )


@pytest.mark.parametrize("robust", ["off", "huber", "adaptive"])
@pytest.mark.parametrize("noise_mm", [0.0, 1e-13, 1e-10])
def test_image_points_without_errors(usual, noise_mm, robust):
    found = aerotri.adjust(without_errors(usual[1], noise_mm), robust=robust)
    assert found.status == "converged"
    assert found.adjusted.outcome.iterations <= 20
    assert any("no residuals" in sentence for sentence in found.warnings)
    assert np.nanmax(np.abs(found.adjusted.points.xyz - usual[1].adjusted.points.xyz)) < 1e-4


@pytest.mark.parametrize("robust", ["off", "huber"])
def test_steps_that_promise_no_more_than_rounding_are_the_end(robust):
    """Such a step leads uphill as often as down: no damping helps."""
    found = adjust(with_adjustment(odd_block(drawn(40)), robust=robust))
    assert found.outcome.status == "converged"
    assert found.outcome.iterations <= 15


def test_sigma_far_too_large_are_said(usual):
    found = aerotri.adjust(with_sigma(usual[0], 1e3))
    assert any("far too large" in sentence for sentence in found.warnings)
    assert not any("no residuals" in sentence for sentence in found.warnings)


def test_nothing_is_said_of_usual_sigma(usual):
    assert not any("too large" in sentence or "no residuals" in sentence for sentence in usual[1].warnings)
