"""Triangulated surfaces: exact on planes, σ by the weights of the corners, edges along breaklines."""

import json
import sqlite3
import struct
from itertools import pairwise

import numpy as np
import pytest

from aerotri.conventions import InputError
from aerotri.formats.foreign.breaklines import read_breaklines
from aerotri.rasters.grids import Grid
from aerotri.terrain.surface import (
    errors_by_interval,
    grid_over,
    ground_cells,
    interpolation_error,
    surface_of,
)
from aerotri.terrain.tin import triangulate


def lattice(n=21, step=5.0):
    at = step * np.arange(n)
    return np.stack(np.meshgrid(at, at), axis=-1).reshape(-1, 2)


def test_a_plane_comes_back_exactly_with_the_sigma_of_its_corners():
    rng = np.random.default_rng(1)
    plan = rng.uniform(0.0, 100.0, (300, 2)) + [4.5e5, 5.4e6]
    z = 0.3 * (plan[:, 0] - 4.5e5) - 0.2 * (plan[:, 1] - 5.4e6) + 7.0
    tin = triangulate(np.column_stack([plan, z]), np.full(300, 0.04), common=np.full(300, 0.01))
    at = rng.uniform(20.0, 80.0, (50, 2)) + [4.5e5, 5.4e6]
    found, variance, away = tin.interpolate(at)
    np.testing.assert_allclose(found, 0.3 * (at[:, 0] - 4.5e5) - 0.2 * (at[:, 1] - 5.4e6) + 7.0, atol=1e-6)
    # Σλ² = 1 − away/2
    np.testing.assert_allclose(variance, 0.04 * (1.0 - away / 2.0) + 0.01, atol=1e-9)
    corner = tin.interpolate(plan[:5])
    np.testing.assert_allclose(corner[1], 0.05, atol=1e-4)
    np.testing.assert_allclose(corner[2], 0.0, atol=1e-3)


def test_long_triangles_are_holes():
    plan = lattice()
    kept = np.hypot(*(plan - 50.0).T) > 18.0
    tin = triangulate(np.column_stack([plan[kept], np.ones(kept.sum())]), longest=2.6 * 5.0)
    z = tin.interpolate(np.array([[50.0, 50.0], [10.0, 52.0], [-1.0, 3.0]]))[0]
    assert np.isnan(z[[0, 2]]).all()
    assert z[1] == pytest.approx(1.0)


def test_breaklines_are_edges():
    """A dam across a plain: along its crest and its feet heights are those of the lines, which no triangle crosses."""
    rng = np.random.default_rng(2)
    plan = rng.uniform(0.0, 100.0, (400, 2))
    plan = plan[np.abs(plan[:, 0] - plan[:, 1]) > 6.0]
    crest = np.array([[10.0, 10.0, 5.0], [60.0, 60.0, 5.0], [90.0, 90.0, 2.0]])
    shift = np.array([3.0, -3.0, 0.0])
    feet = [crest * [1, 1, 0] + shift, crest * [1, 1, 0] - shift]
    cross = np.array([[10.0, 80.0, 0.0], [38.0, 52.0, 0.0]])
    tin = triangulate(np.column_stack([plan, np.zeros(len(plan))]), breaklines=[crest, *feet, cross])
    s = np.linspace(0.0, 1.0, 201)[:, None]
    for line in [crest, *feet]:
        for a, b in pairwise(line):
            places = a + s[1:-1] * (b - a)
            np.testing.assert_allclose(tin.interpolate(places[:, :2])[0], places[:, 2], atol=1e-6)
    # half way down the slope
    assert tin.interpolate(np.array([[31.5, 28.5]]))[0][0] == pytest.approx(2.5, abs=1e-6)
    assert tin.source.max() == len(plan) - 1
    assert (tin.source < 0).sum() >= 8


def test_crossing_breaklines_meet():
    plan = lattice(11, 10.0) + 0.3
    lines = [np.array([[5.0, 50.0, 1.0], [95.0, 50.0, 1.0]]), np.array([[50.0, 5.0, 3.0], [50.0, 95.0, 3.0]])]
    tin = triangulate(np.column_stack([plan, np.zeros(len(plan))]), breaklines=lines)
    assert tin.interpolate(np.array([[50.0, 50.0]]))[0][0] == pytest.approx(2.0)


def test_interpolation_error_of_waves():
    """Ground of one wavelength: between nodes it is wrong by what linear interpolation of a wave is."""
    step, n = 4.0, 61
    plan = lattice(n, step)
    k = 2.0 * np.pi / 80.0
    noise = np.random.default_rng(3).normal(0.0, 0.05, len(plan))
    z = 3.0 * np.cos(k * plan[:, 0]) * np.cos(k * plan[:, 1])
    xyz = np.column_stack([plan, z + noise])
    found = interpolation_error(xyz, plan, step, np.full(len(plan), 0.05**2))
    grid = grid_over(plan, 0.5)
    surface = surface_of(np.column_stack([plan, z]), np.zeros(len(z)), step, grid)
    x, y = np.meshgrid(grid.x(np.arange(grid.columns)), grid.y(np.arange(grid.rows)))
    true = np.sqrt(np.nanmean((surface.z - 3.0 * np.cos(k * x) * np.cos(k * y)) ** 2))
    assert found == pytest.approx(true, rel=0.5)
    by_interval = errors_by_interval(np.column_stack([plan, z]), plan, step, (2, 3, 4))
    assert (np.diff(by_interval) > 0.0).all()


def test_cells_of_a_grid_have_round_centres():
    grid = grid_over(np.array([[3.2, 7.1], [14.9, 22.0]]), 2.0)
    assert grid == Grid(9, 8, 1.0, 23.0, 2.0, 2.0)


def test_objects_are_no_ground():
    """Houses and trees on a slope of 10 % go, a step of the ground and a knoll stay."""
    cell = 1.0
    y, x = np.mgrid[0:120, 0:120].astype(float)
    z = 0.1 * x + 1.5 * np.exp(-((x - 90.0) ** 2 + (y - 30.0) ** 2) / 400.0)
    objects = np.zeros(z.shape, bool)
    for r, c, h, size in ((20, 20, 6.0, 10), (60, 70, 9.0, 14), (90, 40, 3.0, 6)):
        objects[r : r + size, c : c + size] = True
        z[r : r + size, c : c + size] += h
    z[100:104, 100:104] = np.nan
    ground = ground_cells(z, cell)
    assert not ground[objects].any()
    assert not ground[100:104, 100:104].any()
    assert ground[~objects & np.isfinite(z)].mean() > 0.97


def test_a_stockpile_within_its_outline_is_ground():
    """A cone as steep as heaped sand goes as an object, and stays within an outline; the tree beside it goes anyway."""
    y, x = np.mgrid[0:80, 0:80].astype(float)
    pile = np.hypot(x - 40.0, y - 40.0) <= 10.0
    z = 0.02 * x + 0.7 * np.maximum(10.0 - np.hypot(x - 40.0, y - 40.0), 0.0)
    tree = np.hypot(x - 60.0, y - 40.0) <= 2.0
    z[tree] += 6.0
    assert not ground_cells(z, 1.0)[pile].all()
    ground = ground_cells(z, 1.0, stated=pile)
    assert ground[pile].all()
    assert not ground[tree].any()
    assert ground[~tree & ~pile].mean() > 0.97


def test_breaklines_from_files(tmp_path):
    line = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 9.0, 8.0]]
    geojson = tmp_path / "lines.geojson"
    features = [{"type": "Feature", "properties": {}, "geometry": {"type": "LineString", "coordinates": line}}]
    geojson.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    np.testing.assert_array_equal(read_breaklines(geojson)[0], line)

    import ezdxf

    drawing = ezdxf.new("R2010")
    drawing.modelspace().add_polyline3d(line)
    drawing.modelspace().add_line(line[0], line[1])
    drawing.saveas(tmp_path / "lines.dxf")
    found = sorted(read_breaklines(tmp_path / "lines.dxf"), key=len)
    np.testing.assert_array_equal(found[0], line[:2])
    np.testing.assert_array_equal(found[1], line)

    blob = b"GP\x00\x01" + struct.pack("<i", 25832) + struct.pack("<BII", 1, 1002, 3) + np.array(line).tobytes()
    package = sqlite3.connect(tmp_path / "lines.gpkg")
    package.execute("CREATE TABLE gpkg_geometry_columns (table_name, column_name, srs_id INTEGER)")
    package.execute("INSERT INTO gpkg_geometry_columns VALUES ('kanten', 'geom', 25832)")
    package.execute("CREATE TABLE kanten (geom BLOB)")
    package.execute("INSERT INTO kanten VALUES (?)", (blob,))
    package.commit()
    package.close()
    np.testing.assert_array_equal(read_breaklines(tmp_path / "lines.gpkg", "EPSG:25832")[0], line)
    from pyproj import Transformer

    moved = read_breaklines(tmp_path / "lines.gpkg", "EPSG:25833")[0]
    there = Transformer.from_crs("EPSG:25832", "EPSG:25833", always_xy=True)
    np.testing.assert_allclose(moved[:, :2], np.column_stack(there.transform(*np.array(line)[:, :2].T)), atol=1e-6)
    np.testing.assert_array_equal(moved[:, 2], np.array(line)[:, 2])


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.tab", b"", "no known kind"),
        ("a.gpkg", b"nonsense", "no GeoPackage that can be read"),
        ("a.geojson", b"{", "is not JSON"),
        ("a.geojson", b'{"features": []}', "no lines"),
        ("a.dxf", b"nonsense", "cannot be read"),
        (
            "a.geojson",
            b'{"features": [{"geometry": {"type": "LineString", "coordinates": [[1, 2], [3, 4]]}}]}',
            "no heights",
        ),
    ],
)
def test_bad_breaklines_are_named(tmp_path, name, content, said):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=said):
        read_breaklines(tmp_path / name)
