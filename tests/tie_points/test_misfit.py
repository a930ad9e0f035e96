"""σ of tie points from their misfit, whatever a first orientation that is not exact adds to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aerotri.conventions import InputError
from aerotri.formats.assembly.reprojection import reproject
from aerotri.tie_points import misfit
from aerotri.tie_points.misfit import FEWEST, adjusted_offsets, with_sigma_of_ties, without_smooth_part
from aerotri.tie_points.orientation import in_frame
from rig_blocks import NADIR, rig_block
from small_blocks import small_block


@pytest.mark.parametrize("bent_px", [0.0, 3.0])
def test_smooth_offsets_are_taken_off(bent_px):
    """A turn, a shift and a lens of some pixels, of two photographs; their noise stays, less what ten unknowns take."""
    rng = np.random.default_rng(2)
    xy, image = rng.uniform(-6.0, 6.0, (800, 2)), np.repeat([0, 3], 400)
    noise = rng.normal(0.0, 0.2, (800, 2))
    x, y = (xy / 6.0).T
    smooth = bent_px * np.column_stack([0.3 + y + x * (x**2 + y**2), -x * (1.0 - 2.0 * (image == 3)) + 0.4 * y**2])
    rest = without_smooth_part(smooth + noise, xy, image)
    np.testing.assert_allclose(rest, without_smooth_part(noise, xy, image), atol=1e-10)
    assert np.std(rest) / np.std(noise) == pytest.approx(np.sqrt(1.0 - 10.0 / 400.0), abs=0.01)


def test_of_few_rays_nothing_is_taken_off():
    rng = np.random.default_rng(2)
    offset, xy = rng.normal(0.0, 1.0, (FEWEST - 1, 2)), rng.normal(0.0, 1.0, (FEWEST - 1, 2))
    np.testing.assert_array_equal(without_smooth_part(offset, xy, np.zeros(FEWEST - 1, int)), offset)


@pytest.mark.parametrize("fewer", [0, 1])
def test_sigma_in_pixels_is_that_of_cameras_with_other_pixels_too(fewer):
    """A second head with pixels twice as large, σ of half a pixel each: whichever camera has fewer image points."""
    oblique = NADIR | {"pixel_um": 2.0 * NADIR["pixel_um"], "size_px": [3000, 2000]}
    block, _ = rig_block(1, cameras=("fore",), camera={"nadir": NADIR, "fore": oblique})
    rays = block.image_points
    kept = (block.images.camera[rays.image] != fewer) | (np.arange(len(rays)) % 3 == 0)
    kept &= np.bincount(rays.point[kept], minlength=len(block.points))[rays.point] >= 2
    rays = replace(rays, **{name: values[kept] for name, values in vars(rays).items()})
    pixel = np.array([camera.pixel_mm for camera in block.cameras])[block.images.camera[rays.image]][:, None]
    assert np.ptp(pixel) > 0.0
    given = replace(block, image_points=replace(rays, sigma=0.5 * pixel + np.zeros((len(rays), 2))))
    offset = np.random.default_rng(3).normal(0.0, 0.3, (len(rays), 2))
    found, sigma_px = with_sigma_of_ties(given, offset, len(block.points))
    np.testing.assert_allclose(found.image_points.sigma / pixel, sigma_px, rtol=1e-9)


@pytest.mark.parametrize(
    ("error", "why"),
    [(InputError("no point is measured twice", "measure"), "no point is measured twice"),
     (np.linalg.LinAlgError("singular"), "the equations cannot be solved")],
)  # fmt: skip
def test_an_orientation_that_cannot_be_adjusted_is_said(monkeypatch, error, why):
    """The offsets are those of the start values, and whoever reads σ is told."""
    block, _ = small_block(1)
    found = reproject(*in_frame(block, None))
    after, said = adjusted_offsets(block, found.points, found.offset_px)
    assert said == ""
    assert np.std(after) < 0.5 * np.std(found.offset_px)

    def failing(*_):
        raise error

    monkeypatch.setattr(misfit, "minimise", failing)
    same, said = adjusted_offsets(block, found.points, found.offset_px)
    assert same is found.offset_px
    assert said.startswith("the standard deviation of tie points contains errors of the first orientation")
    assert said.endswith(why)
