"""Dense surfaces where matching is hard: shadow, repeated and weak texture, a wall, tilted photographs."""

from dataclasses import replace

import numpy as np
import pytest
from rendered_blocks import rendered_block

from aerotri.pipeline import adjust_keeping_system
from aerotri.terrain.dense.measure import DensePlan, measure_surface
from aerotri.terrain.pickets import Area

UNDULATING = {"kind": "undulating", "relief_rms_m": 6.0, "wavelength_m": 200.0}
CONTRAST, HALF_M = 0.25, 35.0


def inside(x, y):
    return (np.abs(x) < HALF_M) & (np.abs(y) < HALF_M)


def painted(change):
    """A square in the middle, of whose nodes (values, rows, columns) something else is made."""

    def paint(lattice):
        rows = lattice.row + np.arange(lattice.values.shape[0])
        columns = lattice.column + np.arange(lattice.values.shape[1])
        where = inside(lattice.spacing * columns[None, :], lattice.spacing * rows[:, None])
        values = np.where(where, change(lattice.values, rows, columns), lattice.values)
        return replace(lattice, values=values.astype(np.float32))

    return paint


def shadow(values, rows, columns):
    return (0.12 - 1.0) / CONTRAST + 0.12 * values


def water(values, rows, columns):
    return 0.02 * values


def repeated(values, rows, columns):
    pattern = np.random.default_rng(5).normal(scale=2.0, size=(12, 12))
    return pattern[np.ix_(rows % 12, columns % 12)]


def errors(folder, **block):
    """Errors and σ of matching, m, of the cells of the middle that have a height; their share; heights of houses."""
    found = rendered_block(folder / "block", **block)
    (folder / "tiles").mkdir()
    area = Area(np.array([-60.0, -60.0]), np.array([60.0, 60.0]))
    o = measure_surface(found.calibration, DensePlan(np.arange(4), found.paths, folder / "tiles", area=area))
    error, sigma, high, count = [], [], [], 0
    for window, part in o.files.read_all(list(o.windows)):
        grid = o.grid.window(window.row, window.column, window.rows, window.columns)
        x, y = np.meshgrid(grid.x(np.arange(grid.columns)), grid.y(np.arange(grid.rows)))
        xy = np.column_stack([x.ravel(), y.ravel()])
        truth, ground = (f(xy).reshape(x.shape) for f in (found.scene.terrain.height, found.scene.terrain.ground))
        judged = inside(x, y)
        known = judged & np.isfinite(part.z)
        error.append((part.z - truth)[known])
        sigma.append(part.sigma[known])
        high.append((truth - ground)[known])
        count += int(judged.sum())
    error, sigma, high = (np.concatenate(a) for a in (error, sigma, high))
    return error, sigma, len(error) / count, high


@pytest.mark.parametrize(("change", "least"), [(shadow, 0.95), (water, 0.0), (repeated, 0.9)])
def test_patches_that_are_hard_to_match_have_no_gross_errors(tmp_path, change, least):
    error, sigma, coverage, _ = errors(tmp_path, paint=painted(change), **UNDULATING)
    z = error / sigma
    assert coverage >= least
    if len(z) > 100:
        assert abs(np.median(z)) < 0.5
        assert (np.abs(z) > 4.0).mean() < 0.01
        assert z.std() < 1.5


def test_the_ground_behind_a_wall_is_not_lifted(tmp_path):
    wall = {"houses": [[0.0, 0.0, 60.0, 6.0, 15.0]]}
    error, sigma, coverage, high = errors(tmp_path, **UNDULATING, **wall)
    z = error / sigma
    assert coverage > 0.7
    assert (high > 5.0).sum() > 20  # its crest is found
    assert abs(np.median(z)) < 0.3
    assert abs(np.median(error[high < 1.0])) < 0.1  # of a pixel of 1 m
    assert (np.abs(z) > 4.0).mean() < 0.02
    assert z.std() < 1.5


def test_tilted_photographs_have_no_bias(tmp_path):
    flight = {"attitude_sigma_deg": [10.0, 10.0, 10.0]}
    error, sigma, coverage, _ = errors(tmp_path, flight=flight, **UNDULATING)
    z = error / sigma
    assert coverage > 0.8
    assert abs(np.median(error)) < 0.1  # of a pixel of 1 m
    assert 0.7 < z.std() < 1.3
    assert (np.abs(z) > 4.0).mean() < 0.01


def test_errors_of_the_orientation_are_no_noise_of_the_matching(tmp_path):
    found = rendered_block(tmp_path / "block", **UNDULATING)
    rays = found.block.image_points
    noise = np.random.default_rng(4).normal(scale=0.09, size=rays.xy.shape)  # mm, half a pixel
    noisy = replace(found.block, image_points=replace(rays, xy=rays.xy + noise))
    area = Area(np.array([-60.0, -60.0]), np.array([60.0, 60.0]))
    sigmas, shifts, surfaces = [], [], []
    for name, calibration in (("exact", found.calibration), ("noisy", adjust_keeping_system(noisy))):
        (tmp_path / name).mkdir()
        o = measure_surface(calibration, DensePlan(np.arange(4), found.paths, tmp_path / name, area=area))
        tiles = [part for _, part in o.files.read_all(list(o.windows))]
        sigmas.append(np.nanmedian(np.concatenate([part.sigma.ravel() for part in tiles])))
        shifts.append(np.abs(o.across_px).max())
        surfaces.append(np.vstack([part.z for part in tiles]))
    assert shifts[1] > 0.05  # pairs of the noisy block have y-parallaxes
    assert sigmas[1] < 1.5 * sigmas[0]  # four to six times as much where they count as noise
    # they bend the surface, and do nothing else to it
    apart = surfaces[1] - surfaces[0]
    known = np.isfinite(apart)
    row, column = (at[known] / 60.0 - 1.0 for at in np.indices(apart.shape))
    terms = np.stack([np.ones_like(row), row, column, row * row, row * column, column * column], axis=1)
    left = apart[known] - terms @ np.linalg.lstsq(terms, apart[known], rcond=None)[0]
    assert known.mean() > 0.8
    assert np.median(np.abs(left)) < 1.5 * sigmas[0]
