"""Averaged residuals: every cell by itself, so that a shifted index cannot hide in a mean."""

from dataclasses import replace

import numpy as np
import pytest

from aerotri.image_errors import averaged_residuals
from aerotri.observations import ImagePoints
from synthetic import make_adjusted_block, ultracam


def adjusted_with(xy, v, weight=None, status=None, image=None):
    """A block whose rays have these positions and residuals, mm."""
    adjusted = make_adjusted_block(2, 4, 60)
    xy, v = np.array(xy, float), np.array(v, float)
    n = len(xy)
    image = np.zeros(n, np.int64) if image is None else np.array(image)
    points = ImagePoints(image, np.zeros(n, np.int64), xy, np.full((n, 2), 1e-3))
    rays = replace(
        adjusted.rays, v=v, r=np.full((n, 2), 0.6), w=v,
        weight=np.ones(n) if weight is None else np.array(weight, float),
        status=np.zeros(n, np.int64) if status is None else np.array(status),
    )  # fmt: skip
    return replace(adjusted, block=replace(adjusted.block, image_points=points), rays=rays)


HALF_X, HALF_Y = ultracam().half_format_mm


def test_single_cells():
    """10 × 7 cells: three rays in (row 1, column 7), one in (row 6, column 0), everything else empty."""
    cell_x, cell_y = 2 * HALF_X / 10, 2 * HALF_Y / 7
    at = np.array([-HALF_X + 7.5 * cell_x, -HALF_Y + 1.5 * cell_y])
    corner = np.array([-HALF_X + 0.01, HALF_Y - 0.01])
    adjusted = adjusted_with(
        [at, at + [0.4 * cell_x, -0.4 * cell_y], at - [0.4 * cell_x, -0.4 * cell_y], corner],
        [[0.001, 0.002], [0.002, 0.002], [0.003, -0.001], [-0.004, 0.005]],
    )
    averaged = averaged_residuals(adjusted, "ucd2", nx=10, n_min=1)
    assert averaged.count.shape == (7, 10)
    expected = np.zeros((7, 10), int)
    expected[1, 7], expected[6, 0] = 3, 1
    np.testing.assert_array_equal(averaged.count, expected)
    # measured − adjusted: the sign of the residual turned
    np.testing.assert_allclose(averaged.mean[1, 7], [-0.002, -0.001])
    np.testing.assert_allclose(averaged.mean[6, 0], [0.004, -0.005])
    assert np.isnan(averaged.mean[averaged.count == 0]).all()
    np.testing.assert_allclose([averaged.x[1, 7], averaged.y[1, 7]], at)
    # pooled about the cell means: 4 rays, 2 cells
    pooled = np.sqrt([(0.001**2 + 0 + 0.001**2) / 2, (0.001**2 + 0.001**2 + 0.002**2) / 2])
    np.testing.assert_allclose(averaged.sigma_residual, pooled)
    np.testing.assert_allclose(averaged.sigma[1, 7], pooled / np.sqrt(3))
    np.testing.assert_allclose(averaged.sigma[6, 0], pooled)


def test_every_cell_gets_its_own_rays():
    """A ray in the middle of each cell carries the number of the cell."""
    nx, ny = 10, 7
    x = -HALF_X + (np.arange(nx) + 0.5) * 2 * HALF_X / nx
    y = -HALF_Y + (np.arange(ny) + 0.5) * 2 * HALF_Y / ny
    grid_x, grid_y = np.meshgrid(x, y)
    number = np.arange(nx * ny, dtype=float)
    order = np.random.default_rng(2).permutation(nx * ny)
    xy = np.stack([grid_x.ravel(), grid_y.ravel()], axis=-1)[order]
    averaged = averaged_residuals(adjusted_with(xy, -np.stack([number, 2 * number], -1)[order]), "ucd2", nx=nx, n_min=1)
    np.testing.assert_array_equal(averaged.mean[..., 0], number.reshape(ny, nx))
    np.testing.assert_array_equal(averaged.mean[..., 1], 2 * number.reshape(ny, nx))


def test_edges_and_outside():
    """The edges of the format belong to it; beyond them a ray is counted apart."""
    at = [[-HALF_X, -HALF_Y], [HALF_X, HALF_Y], [HALF_X + 1e-6, 0.0], [0.0, -HALF_Y - 1.0]]
    averaged = averaged_residuals(adjusted_with(at, np.zeros((4, 2))), "ucd2", nx=4, n_min=1)
    assert averaged.count[0, 0] == 1
    assert averaged.count[-1, -1] == 1
    assert averaged.count.sum() == 2
    assert averaged.outside == 2


def test_unused_and_rejected_rays_do_not_count():
    at = np.tile([[1.0, 1.0]], (4, 1))
    adjusted = adjusted_with(
        at, [[0.001, 0], [0.003, 0], [0.5, 0], [np.nan, np.nan]], weight=[1, 1, 0, 1], status=[0, 0, 0, 1]
    )
    averaged = averaged_residuals(adjusted, "ucd2", nx=1, n_min=1)
    assert averaged.count.tolist() == [[2]]
    np.testing.assert_allclose(averaged.mean[0, 0], [-0.002, 0])


def test_weights_weigh():
    adjusted = adjusted_with(np.ones((2, 2)), [[0.004, 0], [0.001, 0]], weight=[1.0, 0.5])
    averaged = averaged_residuals(adjusted, "ucd2", nx=1, n_min=1)
    assert averaged.mean[0, 0, 0] == pytest.approx(-0.003)
    assert averaged.sigma[0, 0, 0] == pytest.approx(averaged.sigma_residual[0] * np.sqrt(1.25) / 1.5)


def test_groups_are_kept_apart():
    adjusted = adjusted_with([[1.0, 1.0], [1.0, 1.0]], [[0.001, 0], [0.009, 0]], image=[0, 4])
    settings = adjusted.block.settings
    by_day = replace(settings, adjustment=replace(settings.adjustment, parameter_groups="day"))
    adjusted = replace(adjusted, block=replace(adjusted.block, settings=by_day))
    for day, expected in (("day 1", -0.001), ("day 2", -0.009)):
        averaged = averaged_residuals(adjusted, day, nx=1, n_min=1)
        assert averaged.count.tolist() == [[1]]
        assert averaged.mean[0, 0, 0] == pytest.approx(expected)


def test_what_is_shown():
    averaged = averaged_residuals(adjusted_with(np.ones((3, 2)), np.ones((3, 2))), "ucd2", nx=3, n_min=4)
    assert not averaged.shown.any()
    assert np.isnan(averaged.rms)
    assert np.isnan(averaged.max)
    assert not averaged.significant.any()


def test_noise_is_noise_and_a_pattern_is_not():
    """Pure noise: some 5 % of the cells significant and the RMS that the σ predict. A pattern of tiles: far beyond."""
    noise = averaged_residuals(make_adjusted_block(6, 12, 900, seed=4), "ucd2")
    cells = noise.shown.sum()
    assert noise.significant.sum() < 0.05 * cells + 4 * np.sqrt(0.05 * 0.95 * cells)
    assert noise.rms == pytest.approx(noise.rms_of_noise, rel=0.15)
    pattern = averaged_residuals(make_adjusted_block(6, 12, 900, seed=4, leftover=True), "ucd2")
    assert pattern.rms > 2 * pattern.rms_of_noise
    # pooled about the means the pattern drops out, but for the cells that a seam of the pattern cuts
    np.testing.assert_allclose(pattern.sigma_residual, noise.sigma_residual, rtol=0.05)


def test_fewer_cells_for_fewer_rays():
    """By default a cell holds 2·n_min rays on average, between 6 and 20 cells on the longer side."""
    assert averaged_residuals(make_adjusted_block(6, 12, 900), "ucd2").count.shape == (13, 20)
    small = averaged_residuals(make_adjusted_block(2, 4, 60), "ucd2")
    assert small.count.shape[1] < 12
    assert small.count.sum() == make_adjusted_block(2, 4, 60).images.rays.sum()
