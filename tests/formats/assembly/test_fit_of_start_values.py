"""How image points fit given orientations, stated from a sample of the points of a large block."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
from oriented_sample import oriented_sample

from aerotri.formats.assembly import project, reprojection
from aerotri.formats.assembly.project import fit_of_start_values
from aerotri.formats.assembly.reprojection import residuals_at_start, sample_of_points


def noisy():
    """The sample block, its image points moved by half a pixel."""
    block = oriented_sample().block
    rays = block.image_points
    off = np.random.default_rng(4).normal(0.0, 0.5, rays.xy.shape) * block.cameras[0].pixel_mm
    return replace(block, crs="local", image_points=replace(rays, xy=rays.xy + off))


def test_a_sample_has_whole_points_of_every_photograph():
    block = noisy()
    rays, count = block.image_points, len(block.points)
    chosen = sample_of_points(block, most=count // 4)
    points = np.unique(rays.point[chosen])
    assert len(points) <= count // 4 + len(block.images) < count
    np.testing.assert_array_equal(np.flatnonzero(np.isin(rays.point, points)), chosen)
    np.testing.assert_array_equal(np.unique(rays.image[chosen]), np.unique(rays.image))


def test_all_points_of_a_small_block():
    block = noisy()
    np.testing.assert_array_equal(sample_of_points(block), np.arange(len(block.image_points)))


def test_the_sample_is_said_and_fits_as_the_whole(monkeypatch):
    block = noisy()
    whole = residuals_at_start(block).median_px
    monkeypatch.setattr(project, "sample_of_points", lambda b: reprojection.sample_of_points(b, len(b.points) // 3))
    said = fit_of_start_values(block)[0]
    found = re.search(r"to ([\d.]+) px \(median of (\d+) rays of (\d+) points, a sample of (\d+)\)", said)
    assert found is not None
    median, rays, points, of = (float(text) for text in found.groups())
    assert of == len(block.points)
    assert points < of / 2 + len(block.images)
    assert rays < len(block.image_points)
    # the median of n residuals is known to about their size / √n
    assert abs(median - whole) < 4.0 * whole / np.sqrt(rays)
