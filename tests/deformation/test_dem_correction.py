"""A DEM made with wrong models comes back to the truth, cell by cell."""

import tracemalloc

import numpy as np
import pytest

from aerotri.deformation import dem_correction
from aerotri.deformation.block_models import block_models, nearest_models, strip_pairs
from aerotri.deformation.dem_correction import correct_dem, windows_of
from aerotri.deformation.dem_window import dem_models
from aerotri.deformation.model_grid import mean_ground, pair_of
from aerotri.deformation.model_map import NumberMap, OneModel
from aerotri.deformation.restitution import restitution_of
from aerotri.deformation.stereo_model import deform_points, seen_by_both
from aerotri.rasters.grids import Grid, RasterReader, RasterWriter
from wrong_dems import SLOPE, Terrain, beside, cells, middle_of, square_grid, write_dem, wrong_heights

TOLERANCE_M = 1e-3


@pytest.fixture(scope="module")
def variants(calibration):
    return {variant: restitution_of(calibration, variant) for variant in ("free", "absorbed")}


def corrected(models, numbers, folder, name="dem.tif"):
    """The outcome, and corrected heights and dZ as arrays."""
    with RasterReader(folder / name) as reader:
        grid = reader.grid
        with (
            RasterWriter(folder / "out.tif", grid, reader.dtype) as writer,
            RasterWriter(folder / "dz.tif", grid) as dz_writer,
        ):
            outcome = correct_dem(models, numbers, reader, writer, dz_writer)
    arrays = []
    for file in ("out.tif", "dz.tif"):
        with RasterReader(folder / file) as reader:
            arrays.append(reader.read(0, 0, grid.rows, grid.columns))
    return outcome, *arrays


@pytest.mark.parametrize("variant", ["free", "absorbed"])
@pytest.mark.parametrize(("cell", "waves"), [(0.5, 0.0), (3.0, 0.0), (1.0, 8.0)])
def test_truth_is_restored(calibration, variants, pair, variant, cell, waves, tmp_path):
    """Every cell within 1 mm, seams of the tiles included; the planimetric shift on the slope is honoured."""
    restitution = variants[variant]
    model = pair_of(restitution, calibration, *pair)
    grid = square_grid(middle_of(model), 110, cell)
    terrain = Terrain(middle_of(model), mean_ground(calibration), waves)
    xy = cells(grid)
    z, true, good = wrong_heights(model, terrain, xy)
    good = ~beside(~good.reshape(110, 110))
    assert good.mean() > 0.5
    write_dem(tmp_path / "dem.tif", grid, z.reshape(110, 110))
    outcome, found, dz = corrected(dem_models(calibration, restitution, (pair,)), OneModel(*pair), tmp_path)
    truth = terrain(xy).reshape(110, 110)
    # bilinear between cells cannot follow hills: f(1 − f)/2·cell² of their curvature, f the shift in cells
    shift = np.abs(xy - true[:, :2]).max()
    curved = waves / 40.0**2 * min(shift / cell, 0.5) * cell**2
    off = np.abs(found - truth)
    assert np.nanmax(off[good]) < TOLERANCE_M + curved
    assert np.abs(z.reshape(110, 110) - truth)[good].max() > 0.1
    # without the shift the slope alone would leave more than is allowed
    assert np.abs((true[:, :2] - xy) @ SLOPE).reshape(110, 110)[good].max() > 5.0 * TOLERANCE_M
    np.testing.assert_allclose(dz[good], (z.reshape(110, 110) - truth)[good], atol=0.1)
    assert outcome.sums[0] == np.isfinite(found).sum()


def test_single_cells_against_the_definition(calibration, variants, pair, tmp_path):
    """P = I(EO_cal; m − d(m)) at the place the fixed point finds: a shifted index would be caught."""
    restitution = variants["absorbed"]
    model = pair_of(restitution, calibration, *pair)
    grid = square_grid(middle_of(model) + (0.3, 0.8), 90, 1.5)
    rng = np.random.default_rng(5)
    z = mean_ground(calibration) + rng.normal(scale=3.0, size=(90, 90))
    z[:, 40:60] += 60.0
    write_dem(tmp_path / "dem.tif", grid, z)
    models = dem_models(calibration, restitution, (pair,))
    _, found, dz = corrected(models, OneModel(*pair), tmp_path)
    xyz = np.column_stack([cells(grid), z.ravel()])
    exact = models.deformation_at(np.zeros(len(xyz), np.int32), xyz).reshape(90, 90, 3)
    true_xy = cells(grid).reshape(90, 90, 2) - exact[..., :2]
    true_z = z - exact[..., 2]
    for i, j in rng.integers(5, 85, (25, 2)):
        # the cell whose true place is nearest, and the plane of the bilinear patch towards this cell
        expected, expected_dz = patch_height(grid, true_xy, true_z, exact[..., 2], i, j)
        assert found[i, j] == pytest.approx(expected, abs=TOLERANCE_M)
        assert dz[i, j] == pytest.approx(expected_dz, abs=TOLERANCE_M)


def patch_height(grid, true_xy, true_z, dz, i, j):
    """Height and dZ of the surface of bilinear patches at a cell, by search through the patches around it."""
    target = np.array([grid.x(j), grid.y(i)])
    for row in range(i - 2, i + 2):
        for column in range(j - 2, j + 2):
            corners = true_xy[row : row + 2, column : column + 2].reshape(4, 2)
            s, t = inverse_bilinear(corners, target)
            if -1e-9 <= s <= 1 + 1e-9 and -1e-9 <= t <= 1 + 1e-9:
                w = np.array([(1 - t) * (1 - s), (1 - t) * s, t * (1 - s), t * s])
                patch = np.s_[row : row + 2, column : column + 2]
                return w @ true_z[patch].ravel(), w @ dz[patch].ravel()
    raise AssertionError("no patch holds the cell")


def inverse_bilinear(corners, target):
    s = t = 0.5
    for _ in range(50):
        w = np.array([(1 - t) * (1 - s), (1 - t) * s, t * (1 - s), t * s])
        by_s = (1 - t) * (corners[1] - corners[0]) + t * (corners[3] - corners[2])
        by_t = (1 - s) * (corners[2] - corners[0]) + s * (corners[3] - corners[1])
        step = np.linalg.solve(np.column_stack([by_s, by_t]), target - w @ corners)
        s, t = s + step[0], t + step[1]
    return s, t


def test_missing_data_is_kept(calibration, variants, pair, tmp_path):
    """Holes stay holes, cells beside them stay cells, and on a plane are as right as the others."""
    restitution = variants["free"]
    model = pair_of(restitution, calibration, *pair)
    grid = square_grid(middle_of(model) + (40.0, 60.0), 60, 0.5)
    terrain = Terrain(middle_of(model), mean_ground(calibration))
    xy = cells(grid)
    z, _, good = wrong_heights(model, terrain, xy)
    assert good.all()
    z = z.reshape(60, 60)
    holes = np.zeros((60, 60), bool)
    holes[20:30, 10:12] = holes[0, :5] = holes[45, 45] = holes[59, 59] = True
    z[holes] = np.nan
    for no_data in (-9999.0, np.nan):
        write_dem(tmp_path / "dem.tif", grid, z.copy(), no_data=no_data)
        outcome, found, dz = corrected(dem_models(calibration, restitution, (pair,)), OneModel(*pair), tmp_path)
        np.testing.assert_array_equal(np.isnan(found), holes)
        np.testing.assert_array_equal(np.isnan(dz), holes)
        assert np.abs(found - terrain(xy).reshape(60, 60))[~holes].max() < TOLERANCE_M
        assert outcome.sums[1] == holes.sum()
        assert outcome.sums[2] == 0


def test_heights_of_double_precision_stay_that(calibration, variants, pair, tmp_path):
    """A DEM of eight bytes, far above the sea of its numbers: no rounding to four."""
    restitution = variants["free"]
    model = pair_of(restitution, calibration, *pair)
    grid = square_grid(middle_of(model) + (40.0, 60.0), 40, 0.5)
    z = mean_ground(calibration) + np.random.default_rng(9).normal(size=(40, 40))
    for dtype in (np.float32, np.float64):
        write_dem(tmp_path / "dem.tif", grid, z, dtype)
        _, found, dz = corrected(dem_models(calibration, restitution, (pair,)), OneModel(*pair), tmp_path)
        assert found.dtype == dtype
        assert dz.dtype == np.float32
        if dtype == np.float32:
            single = found
    np.testing.assert_allclose(found, single, rtol=0.0, atol=1e-4)
    assert np.abs(found - single).max() > 0.0


def test_off_the_model_nothing_is_made_up(calibration, variants, pair, tmp_path):
    restitution = variants["free"]
    model = pair_of(restitution, calibration, *pair)
    grid = square_grid(middle_of(model), 100, 20.0)
    height = mean_ground(calibration)
    write_dem(tmp_path / "dem.tif", grid, np.full((100, 100), height))
    outcome, found, _ = corrected(dem_models(calibration, restitution, (pair,)), OneModel(*pair), tmp_path)
    # the DEM's own heights are the wrong ones; used = true in the free variant
    seen = seen_by_both(model, np.column_stack([cells(grid), np.full(10000, height)])).reshape(100, 100)
    np.testing.assert_array_equal(np.isfinite(found), seen)
    assert outcome.sums[2] == (~seen).sum()
    assert np.isnan(outcome.sigma[~seen]).all()
    assert np.isfinite(outcome.sigma[seen]).all()


def test_windows_and_threads_do_not_matter(calibration, variants, pair, tmp_path, monkeypatch):
    """Cut into small windows, with too narrow a halo to begin with, by one thread or two."""
    restitution = variants["absorbed"]
    model = pair_of(restitution, calibration, *pair)
    grid = square_grid(middle_of(model), 150, 0.004)
    z = mean_ground(calibration) + 0.01 * np.random.default_rng(3).normal(size=(150, 150))
    write_dem(tmp_path / "dem.tif", grid, z)
    models = dem_models(calibration, restitution, (pair,))
    whole, expected, expected_dz = corrected(models, OneModel(*pair), tmp_path)
    assert whole.halo > 4
    monkeypatch.setattr(dem_correction, "WINDOW", 64)
    monkeypatch.setattr(dem_correction, "halo_for", lambda *_: 2)
    runs = []
    for threads in ("1", "2"):
        monkeypatch.setenv("AEROTRI_THREADS", threads)
        outcome, found, dz = corrected(models, OneModel(*pair), tmp_path)
        assert outcome.halo > 2
        assert outcome.sums[3] == 0
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=TOLERANCE_M)
        np.testing.assert_allclose(dz, expected_dz, rtol=0.0, atol=TOLERANCE_M)
        assert outcome.sums[0] == 150 * 150
        runs.append(found)
    np.testing.assert_array_equal(runs[0], runs[1])


def test_windows_cover_every_cell_once():
    grid = Grid(2500, 1700, 0.0, 0.0, 1.0, 1.0)
    for in_crs in (False, True):
        seen = np.zeros((2500, 1700), int)
        for row, column, rows, columns in windows_of(grid, in_crs):
            seen[row : row + rows, column : column + columns] += 1
        assert (seen == 1).all()
    assert max(w[2] for w in windows_of(Grid(2500, 1700, 0.0, 0.0, 10.0, 10.0), True)) <= 200


def test_memory_does_not_grow_with_the_dem(calibration, variants, pair, tmp_path, monkeypatch):
    """Nine times the cells, the same memory: what Python's arrays take at most, windows being small."""
    restitution = variants["free"]
    model = pair_of(restitution, calibration, *pair)
    models = dem_models(calibration, restitution, (pair,))
    monkeypatch.setattr(dem_correction, "WINDOW", 64)
    monkeypatch.setattr(dem_correction, "SIGMA_CELLS", 32)
    peaks = []
    for n in (128, 256, 768):
        grid = square_grid(middle_of(model), n, 384.0 / n)
        write_dem(tmp_path / "dem.tif", grid, np.full((n, n), mean_ground(calibration)))
        with (
            RasterReader(tmp_path / "dem.tif") as reader,
            RasterWriter(tmp_path / "out.tif", grid) as writer,
            RasterWriter(tmp_path / "dz.tif", grid) as dz_writer,
        ):
            tracemalloc.start()
            correct_dem(models, OneModel(*pair), reader, writer, dz_writer)
            peaks.append(tracemalloc.get_traced_memory()[1])
            tracemalloc.stop()
    # the first run compiles what was not compiled before
    assert peaks[2] < 1.15 * peaks[1]


def test_many_models_and_the_steps_between_them(calibration, variants, tmp_path):
    """A DEM pieced together from models: restored everywhere, and the steps at the seams are gone."""
    restitution = variants["absorbed"]
    pairs = strip_pairs(calibration, restitution)
    models = block_models(calibration, restitution, pairs)
    names = tuple(one.model.names for one in models)
    chosen = [k for k, name in enumerate(names) if str(name[0]).startswith("2_")]
    middle = np.mean([models[k].middle for k in chosen], axis=0)
    grid = square_grid(middle, 200, 3.0)
    terrain = Terrain(middle, mean_ground(calibration))
    xy = cells(grid)
    dem = dem_models(calibration, restitution, names)
    number = nearest_models(models, dem.places, np.column_stack([xy, terrain(xy)]))
    z, good = np.full(len(xy), np.nan), np.zeros(len(xy), bool)
    for k in np.unique(number[number >= 0]):
        own = np.flatnonzero(number == k)
        z[own], _, good[own] = wrong_heights(models[k].model, terrain, xy[own])
    assert len(np.unique(number)) > 3
    write_dem(tmp_path / "dem.tif", grid, z.reshape(200, 200))
    with RasterWriter(tmp_path / "numbers.tif", grid, np.int32, no_data=-1) as writer:
        writer.write(0, 0, (number.reshape(200, 200) + 10).astype(np.int32))
    with RasterReader(tmp_path / "numbers.tif") as reader:
        numbers = NumberMap(names, np.arange(len(names)) + 10, reader)
        outcome, found, _ = corrected(dem, numbers, tmp_path)
    good = ~beside(~good.reshape(200, 200))
    assert good.mean() > 0.7
    assert np.abs(found - terrain(xy).reshape(200, 200))[good].max() < TOLERANCE_M
    steps = outcome.steps
    assert len(steps.pair) > 2
    assert steps.rms("before") > 0.05
    assert steps.rms("after") < 0.1 * steps.rms("before")
    # each step is what the two models do to the same place
    k = int(np.argmax(steps.count))
    first, second = steps.pair[k]
    border = np.flatnonzero((number == first) & (np.roll(number.reshape(200, 200), 1, axis=1).ravel() == second))
    if not len(border):
        border = np.flatnonzero((number == second) & (np.roll(number.reshape(200, 200), 1, axis=1).ravel() == first))
    true = np.column_stack([xy[border], terrain(xy[border])])
    dz = [deform_points(models[m].model, true).d for m in (first, second)]
    height = [d[:, 2] - d[:, :2] @ SLOPE for d in dz]
    expected = np.nanmean(height[0] - height[1])
    assert steps.before[k, 0] / steps.count[k] == pytest.approx(expected, abs=0.05 + 0.2 * abs(expected))
