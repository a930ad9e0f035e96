"""Comparison of surfaces: statistics of known differences, recovery of known motions, the command."""

import json
from importlib import import_module

import numpy as np
import pytest

from aerotri.commands.compare import run_compare
from aerotri.conventions import InputError
from aerotri.formats.results.point_cloud import read_point_cloud, write_point_cloud
from aerotri.rasters.grids import Grid, RasterReader, write_raster
from aerotri.rasters.surface_files import write_surface
from aerotri.terrain.compare import PointHeights, RasterHeights, compare, same_cells, statistics_of

GRID = Grid(120, 150, 0.0, 240.0, 2.0, 2.0)


def hills(x, y):
    return 8.0 * np.sin(x / 23.0) * np.cos(y / 31.0) + 0.05 * x + 5.0 * np.cos((x + y) / 40.0)


def on_grid(function, grid=GRID):
    x, y = np.meshgrid(grid.x(np.arange(grid.columns)), grid.y(np.arange(grid.rows)))
    return function(x, y)


def test_statistics_by_hand():
    s = statistics_of(np.array([1.0, 2.0, 3.0, 4.0, np.nan, 10.0]))
    assert (s.count, s.bias, s.median, s.max) == (5, 4.0, 3.0, 10.0)
    assert s.rmse == pytest.approx(np.sqrt(130.0 / 5.0))
    assert s.nmad == pytest.approx(1.4826)
    assert s.le90 == pytest.approx(7.6)
    with pytest.raises(InputError, match="no place in common"):
        statistics_of(np.full(3, np.nan))


@pytest.mark.parametrize("method", ["linear", "spline"])
def test_the_same_surface_as_raster_and_as_points(method):
    control = RasterHeights(GRID, on_grid(hills))
    rng = np.random.default_rng(4)
    plan = rng.uniform([0.0, 0.0], [300.0, 240.0], (6000, 2))
    test = PointHeights.of(np.column_stack([plan, hills(*plan.T)]))
    found = compare(test, control, GRID, method)
    assert found.coverage > 0.97
    assert found.statistics.nmad < 0.05
    assert abs(found.statistics.bias) < 0.02
    # a single value at a place of its own
    np.testing.assert_allclose(control.at(np.array([[101.0, 57.0]]), method), hills(101.0, 57.0), atol=1e-6)


def test_holes_are_no_differences():
    z = on_grid(hills)
    z[30:50, 40:70] = np.nan
    found = compare(RasterHeights(GRID, z), RasterHeights(GRID, on_grid(hills)), GRID)
    assert np.isnan(found.difference[35, 50])
    assert found.coverage == pytest.approx(1.0 - 20 * 30 / (120 * 150), abs=0.01)
    assert found.statistics.max < 1e-9


def test_a_shift_is_found():
    """Nuth and Kääb's case: a surface displaced by parts of a cell and a height, with gross errors here and there."""
    moved = on_grid(lambda x, y: hills(x - 1.3, y + 0.7) + 2.5)
    moved[::17, ::13] += 30.0
    found = compare(RasterHeights(GRID, moved), RasterHeights(GRID, on_grid(hills)), GRID, "spline", "shift")
    np.testing.assert_allclose(found.alignment.shift, [-1.3, 0.7, -2.5], atol=0.02)
    assert found.statistics.nmad < 0.02


def test_a_rigid_motion_is_found():
    from scipy.spatial.transform import Rotation

    turn, shift = np.array([4e-3, -3e-3, 5e-3]), np.array([1.5, -0.8, 0.6])
    rng = np.random.default_rng(6)
    plan = rng.uniform([0.0, 0.0], [300.0, 240.0], (9000, 2))
    xyz = np.column_stack([plan, hills(*plan.T)])
    middle = xyz.mean(axis=0)
    away = (xyz - middle) @ Rotation.from_rotvec(turn).as_matrix().T + middle + shift
    found = compare(PointHeights.of(away), RasterHeights(GRID, on_grid(hills)), GRID, "linear", "rigid")
    np.testing.assert_allclose(found.alignment.rotation, -turn, atol=3e-4)
    assert found.statistics.nmad < 0.05
    assert abs(found.statistics.median) < 0.02


def test_command(tmp_path, capsys):
    z = on_grid(hills)
    sigma = np.full(z.shape, 0.1)
    write_surface(tmp_path / "test.tif", z + 0.25, sigma, GRID, "EPSG:25832", "DSM Z, m")
    write_raster(tmp_path / "control.tif", z, GRID, "EPSG:25832")
    run_compare(
        tmp_path / "test.tif", tmp_path / "control.tif", tmp_path / "out", "linear", "none", None, None, True, True
    )
    printed = json.loads(capsys.readouterr().out)
    assert printed["difference_m"]["bias"] == pytest.approx(0.25, abs=1e-4)
    assert printed["difference_m"]["std"] < 1e-3
    assert (tmp_path / "out" / "plots" / "difference.png").stat().st_size > 10_000
    with RasterReader(tmp_path / "out" / "difference.tif") as reader:
        assert reader.read(60, 60, 1, 1)[0, 0] == pytest.approx(0.25, abs=1e-4)
    write_raster(tmp_path / "other.tif", z, GRID, "EPSG:25833")
    with pytest.raises(InputError, match="EPSG:25832, the control in EPSG:25833"):
        run_compare(
            tmp_path / "test.tif", tmp_path / "other.tif", tmp_path / "o", "linear", "none", None, None, False, True
        )
    with pytest.raises(InputError, match="holds other files"):
        run_compare(
            tmp_path / "test.tif", tmp_path / "control.tif", tmp_path, "linear", "none", None, None, False, True
        )


def test_surface_and_sigma_in_one_file(tmp_path):
    z, sigma = on_grid(hills), on_grid(lambda x, y: 0.01 * x)
    z[3, 4] = np.nan
    write_surface(tmp_path / "dsm.tif", z, sigma, GRID, None, "DSM Z, m")
    with RasterReader(tmp_path / "dsm.tif") as heights, RasterReader(tmp_path / "dsm.tif", band=2) as of_sigma:
        assert heights.grid == GRID
        np.testing.assert_allclose(heights.read(0, 0, 120, 150), z, atol=1e-5)
        assert of_sigma.read(7, 11, 1, 1)[0, 0] == pytest.approx(sigma[7, 11])
        assert np.isnan(of_sigma.read(3, 4, 1, 1)[0, 0])
    write_raster(tmp_path / "plain.tif", z, GRID)
    with pytest.raises(InputError, match="has no σ"):
        RasterReader(tmp_path / "plain.tif", band=2)


def test_point_clouds(tmp_path):
    rng = np.random.default_rng(1)
    xyz = rng.uniform(0.0, 50.0, (100, 3)) + [4e5, 5e6, 100.0]
    ground = rng.random(100) < 0.5
    write_point_cloud(tmp_path / "a.laz", xyz, np.full(100, 0.02), ground, "EPSG:25832")
    read = read_point_cloud(tmp_path / "a.laz")
    found, classes = read.xyz, read.classes
    np.testing.assert_allclose(found, xyz, atol=6e-4)
    np.testing.assert_array_equal(classes == 2, ground)
    (tmp_path / "b.laz").write_bytes(b"no cloud")
    with pytest.raises(InputError, match="is no LAS or LAZ file"):
        read_point_cloud(tmp_path / "b.laz")


def test_a_long_side_takes_every_second_cell(monkeypatch):
    monkeypatch.setattr(import_module("aerotri.terrain.compare"), "MOST_CELLS", 100)
    z, rng = on_grid(hills), np.random.default_rng(2)
    test, control = RasterHeights(GRID, z + rng.normal(0.0, 1.0, z.shape)), RasterHeights(GRID, z)
    area = np.array([[1.0, 1.0], [299.0, 239.0]])
    grid = same_cells(test, control, (area, area), None)
    found = compare(test, control, grid)
    assert (grid.rows, grid.columns, grid.cell_x) == (60, 75, 4.0)
    np.testing.assert_allclose(found.difference, (test.z - z)[::2, ::2])
