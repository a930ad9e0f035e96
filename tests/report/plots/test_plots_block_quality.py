"""Overlap, ellipses, residuals by column, row and photograph, trajectory: their numbers, and blocks of every kind."""

import time
import warnings
from dataclasses import replace

import matplotlib
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import EllipseCollection

from aerotri.image_errors.residual_profiles import residual_profiles
from aerotri.observations.block import GnssIns
from aerotri.report.plots.ellipses import error_ellipses, one_a_cell, plot_error_ellipses
from aerotri.report.plots.overlap import area_text, plot_overlap
from aerotri.report.plots.residual_profiles import plot_photograph_residuals, plot_residual_profiles
from aerotri.report.plots.trajectory import MOST_DOTS, plot_trajectory
from aerotri.statistics.photograph_residuals import photograph_residuals
from aerotri.statistics.position_differences import PositionDifferences, position_differences
from synthetic import make_adjusted_block


@pytest.fixture(autouse=True)
def _no_warnings():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def words(figure):
    FigureCanvasAgg(figure).draw()
    return " ".join(t.get_text() for t in figure.findobj(matplotlib.text.Text))


def with_positions(adjusted, time_s):
    n = len(adjusted.block.images)
    none = np.full((n, 3), np.nan)
    given = adjusted.images.centre + np.random.default_rng(2).normal(0, 0.03, (n, 3))
    gnss = GnssIns(np.arange(n), given, np.full((n, 3), 0.05), none, none, time_s)
    return replace(adjusted, block=replace(adjusted.block, gnss_ins=gnss))


@pytest.mark.parametrize(("strips", "per_strip"), [(4, 10), (1, 12), (12, 2), (1, 3)])
@pytest.mark.parametrize("crs", ["local", "EPSG:25832"])
def test_blocks_of_every_shape(strips, per_strip, crs):
    adjusted = make_adjusted_block(strips, per_strip, 150)
    adjusted = replace(adjusted, block=replace(adjusted.block, crs=crs))
    assert words(plot_error_ellipses(adjusted))
    text = words(plot_overlap(adjusted))
    assert "seen: " in text
    assert ("E [m]" in text) == (crs != "local")
    assert words(plot_photograph_residuals(photograph_residuals(adjusted), adjusted))
    curves = plot_residual_profiles(residual_profiles(adjusted), "b")
    assert (curves is None) == (strips * per_strip < 8)


def test_ellipses_are_those_of_the_covariance():
    adjusted = make_adjusted_block(3, 8, 200)
    covariance = adjusted.points.covariance.copy()
    covariance[:, :2, :2] *= 0.0
    covariance[:, :2, :2] += [[0.0025, 0.0015], [0.0015, 0.0025]]
    adjusted = replace(adjusted, points=replace(adjusted.points, covariance=covariance))
    found = error_ellipses(adjusted)
    # eigenvalues 0.004 and 0.001 m², 95 % of χ² with two degrees of freedom: 5.991
    assert found.major == pytest.approx(np.full(len(found.point), np.sqrt(0.004 * 5.9915)), rel=1e-4)
    assert found.minor == pytest.approx(np.full(len(found.point), np.sqrt(0.001 * 5.9915)), rel=1e-4)
    assert found.angle % 180.0 == pytest.approx(np.full(len(found.point), 45.0))
    figure = plot_error_ellipses(adjusted)
    drawn = figure.findobj(EllipseCollection)[0]
    assert len(drawn.get_offsets()) <= len(found.point)
    text = words(figure)
    assert "95 % ellipses, " in text
    assert " times larger than the plan" in text
    assert "largest 0.155 m" in text


def test_one_point_a_cell_of_median_size():
    xy = np.array([[0.0, 0.0], [0.1, 0.1], [0.2, 0.0], [5.0, 5.0]])
    assert sorted(one_a_cell(xy, np.array([3.0, 1.0, 2.0, 9.0]), 1.0).tolist()) == [2, 3]


def test_no_points_no_ellipses():
    adjusted = make_adjusted_block(2, 5, 80)
    nothing = replace(adjusted.points, covariance=np.full_like(adjusted.points.covariance, np.nan))
    assert plot_error_ellipses(replace(adjusted, points=nothing)) is None
    sky = replace(adjusted.images, angles=adjusted.images.angles + [np.pi, 0.0, 0.0])
    assert plot_overlap(replace(adjusted, images=sky)) is None


@pytest.mark.parametrize("timed", [True, False])
def test_trajectory(timed):
    adjusted = make_adjusted_block(3, 8, 100)
    n = len(adjusted.block.images)
    adjusted = with_positions(adjusted, 3.0 * np.arange(n) if timed else np.full(n, np.nan))
    found = position_differences(adjusted)
    text = words(plot_trajectory(found, adjusted.block.name))
    assert ("mm/min" in text) == timed
    assert ("[min]" in text) == timed
    mean = f"{found.offset[0, 0]:+.3f}".replace("-", "−")
    assert f"X {mean if float(f'{found.offset[0, 0]:.3f}') else '0.000'}" in text


def test_sixty_thousand_photographs_are_thinned():
    n = 60_000
    random = np.random.default_rng(1)
    strip = np.repeat(np.arange(300), 200).astype(str)
    found = PositionDifferences(
        np.arange(n), random.normal(0, 0.02, (n, 3)), np.full((n, 3), 0.02), 2.0 * np.arange(n), strip
    )
    begun = time.process_time()
    figure = plot_trajectory(found, "large")
    text = words(figure)
    assert time.process_time() - begun < 60.0
    dots = sum(len(line.get_xdata()) for axes in figure.axes[:1] for line in axes.lines if line.get_marker() == "o")
    assert dots <= MOST_DOTS
    assert f"of {n} photographs drawn" in text


def test_areas_in_words():
    assert [area_text(a) for a in (3.5, 5270.4, 13_100.0, 3.88e6)] == ["3.5 m²", "5270 m²", "1.31 ha", "3.88 km²"]


def test_ellipses_larger_than_the_block_are_drawn_smaller():
    """σ of many metres, of a block without control: drawn small, and the text says so."""
    adjusted = make_adjusted_block(3, 8, 200)
    covariance = np.tile(np.diag([1e6, 1e6, 1e6]), (len(adjusted.block.points), 1, 1))
    figure = plot_error_ellipses(replace(adjusted, points=replace(adjusted.points, covariance=covariance)))
    factor, smaller = words(figure).split("ellipses, ")[1].split(" times ")
    assert smaller.startswith("smaller than the plan")
    assert float(factor) > 10.0
