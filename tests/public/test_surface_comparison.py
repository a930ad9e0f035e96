"""Surfaces compared from Python: known differences, the same from memory as from files, one CRS."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from pyproj import Transformer

import aerotri
from aerotri import InputError
from aerotri.formats.results.point_cloud import write_point_cloud

LEFT, TOP, CELL = 499_999.0, 5_450_001.0, 2.0
"""m; centres of cells are multiples of the cell, as those of the differences."""


def hills(x, y):
    return 100.0 + 8.0 * np.sin(x / 23.0) * np.cos(y / 31.0) + 5.0 * np.cos((x + y) / 40.0)


@pytest.fixture(scope="module")
def control():
    x, y = np.meshgrid(LEFT + CELL * (np.arange(120) + 0.5), TOP - CELL * (np.arange(100) + 0.5))
    return aerotri.Surface.of_array(hills(x, y), left=LEFT, top=TOP, cell=CELL, crs="EPSG:32632", name="hills")


def raised(surface, by):
    return replace(surface, source=replace(surface.source, z=surface.z + by), name="raised")


def test_sigma_of_the_bias_knows_what_neighbours_share(control):
    """Means of noise with and without correlation scatter as stated; Σz² of 30 in the 99.9 % band."""
    from scipy.ndimage import uniform_filter
    from scipy.stats import chi2

    for window in (1, 5):
        z = []
        for seed in range(30):
            white = np.random.default_rng([seed, window]).normal(0.0, 0.2, control.z.shape)
            noise = window * uniform_filter(white, window, mode="wrap")
            found = aerotri.compare(raised(control, noise), control)
            assert found.bias_sigma is not None
            z.append(found.bias / found.bias_sigma)
            assert found.noise_length == pytest.approx(window * CELL, rel=0.35)
        low, high = chi2.ppf([0.0005, 0.9995], 30)
        assert low < np.sum(np.square(z)) < high


def test_errors_that_do_not_average_out_count_in_the_bias(tmp_path, control):
    """Surfaces with errors that fall to 1/e over 12 cells: stated in their file they are in σ of the bias."""
    from scipy.stats import chi2

    from aerotri.rasters.surface_files import write_surface_parts

    sigma, length = 0.05, 12.0 * CELL
    x, y = np.meshgrid(control.grid.x(np.arange(120)), control.grid.y(np.arange(100)))
    some = np.random.default_rng(4).choice(120 * 100, 400, replace=False)
    place = np.column_stack([x.ravel(), y.ravel()])
    apart = np.linalg.norm(place[:, None] - place[some], axis=2)
    known = np.exp(-apart[some] / length)
    root = np.linalg.cholesky(known + 1e-9 * np.eye(len(some)))
    by_cell = np.exp(-apart / length) @ np.linalg.inv(known)
    z = []
    for seed in range(30):
        rng = np.random.default_rng([seed, 9])
        error = sigma * (by_cell @ (root @ rng.normal(size=len(some)))).reshape(x.shape)
        higher = control.z + error + rng.normal(0.0, 0.02, x.shape)
        stated = {"SHARED_SIGMA_M": f"{sigma}", "SHARED_LENGTH_M": f"{length}"}
        parts = iter([(0, 0, higher, np.full_like(higher, 0.06))])
        write_surface_parts(tmp_path / "dsm.tif", parts, control.grid, "EPSG:32632", "DSM Z, m", stated)
        found = aerotri.compare(tmp_path / "dsm.tif", control)
        z.append(found.bias / found.matching_shared)
        assert found.bias_sigma > found.matching_shared > 0.0
        assert found.summary["matching_shared_m"] == found.matching_shared
    low, high = chi2.ppf([0.0005, 0.9995], 30)
    assert low < np.sum(np.square(z)) < high
    assert aerotri.compare(raised(control, 0.1), control).matching_shared == 0.0
    assert aerotri.compare(tmp_path / "dsm.tif", control, align="shift").matching_shared == 0.0
    # the folder stands for the surface in it
    assert aerotri.compare(tmp_path, control).matching_shared == found.matching_shared


def test_a_known_difference(control):
    noise = np.random.default_rng(3).normal(0.3, 0.2, control.z.shape)
    found = aerotri.compare(raised(control, noise), control)
    # heights have 32 bit
    assert found.bias == pytest.approx(noise.mean(), abs=1e-4)
    assert found.rmse == pytest.approx(np.sqrt(np.mean(noise**2)), abs=1e-4)
    assert found.nmad == pytest.approx(0.2, rel=0.05)
    assert found.coverage == 1.0
    assert found.statistics["count"][0] == np.isfinite(found.difference.z).sum()
    assert (found.test, found.control) == ("raised", "hills")


def test_from_memory_as_from_files(control, tmp_path):
    test = raised(control, 0.5)
    one, other = test.save(tmp_path / "one.tif"), control.save(tmp_path / "other.tif")
    held, read = aerotri.compare(test, control), aerotri.compare(one, str(other))
    mixed = aerotri.compare(aerotri.Surface(one), control)
    for found in (read, mixed):
        np.testing.assert_array_equal(found.difference.z, held.difference.z)
        assert found.crs == "EPSG:32632"
    folder = held.save(tmp_path / "out")
    assert json.loads((folder / "compare.json").read_text(encoding="utf-8")) == held.summary
    saved = aerotri.Surface(folder / "difference.tif").z
    np.testing.assert_array_equal(saved.astype(np.float32), held.difference.z.astype(np.float32))
    assert isinstance(held.plot(), Figure)
    assert "RMSE" in repr(held)
    assert "covered" in held._repr_html_()


def test_a_shift_is_found(control):
    x, y = np.meshgrid(LEFT + CELL * (np.arange(120) + 0.5), TOP - CELL * (np.arange(100) + 0.5))
    moved = aerotri.Surface.of_array(hills(x + 1.5, y) + 0.7, left=LEFT, top=TOP, cell=CELL, crs="EPSG:32632")
    found = aerotri.compare(moved, control, align="shift")
    np.testing.assert_allclose(found.summary["alignment"]["shift_m"], [1.5, 0.0, -0.7], atol=0.02)
    assert found.rmse < 0.05 < 0.5 < aerotri.compare(moved, control).rmse


def test_a_raster_in_degrees_is_brought_to_the_surface_in_memory(control, tmp_path):
    """Also where its own UTM zone is another one."""
    to_utm = Transformer.from_crs("EPSG:4326", "EPSG:32632", always_xy=True)
    lon, lat = to_utm.transform(LEFT + 20.0, TOP - 20.0, direction="INVERSE")
    step = 2e-5
    x, y = to_utm.transform(*np.meshgrid(lon + step * (np.arange(70) + 0.5), lat - step * (np.arange(60) + 0.5)))
    degrees = aerotri.Surface.of_array(hills(x, y), left=lon, top=lat, cell=step, crs="EPSG:4326", name="degrees")
    path = degrees.save(tmp_path / "degrees.tif")
    for pair in ((path, control), (control, path)):
        found = aerotri.compare(*pair)
        assert found.rmse < 0.05
        assert any("brought from EPSG:4326" in note for note in found.notes)


def test_surfaces_of_a_terrain_model(measured):
    _, _, model, folder = measured
    found = aerotri.compare(model, folder)
    assert found.rmse == 0.0
    assert aerotri.compare(model.dtm, folder / "pickets.parquet", cell=10.0).nmad < 0.2


def test_what_makes_no_sense(control, tmp_path):
    far = replace(control, source=replace(control.source, grid=replace(control.grid, left=0.0)))
    for match, pair, options in (
        ("no method 'cubic'", (control, control), {"method": "cubic"}),
        ("no alignment 'turn'", (control, control), {"align": "turn"}),
        ("no place in common", (control, far), {}),
        ("no such file", (tmp_path / "nowhere.tif", control), {}),
        ("raised: is in EPSG:32633", (replace(raised(control, 1.0), crs="EPSG:32633"), control), {}),
    ):
        with pytest.raises(InputError, match=match):
            aerotri.compare(*pair, **options)


@pytest.mark.parametrize("offset", [0.0, CELL / 2.0, 0.3])
def test_rasters_of_the_same_cells_are_compared_cell_by_cell(control, offset):
    """Wherever their edges lie, and beside holes too: nothing is a mean of neighbours."""
    grid = replace(control.grid, left=control.grid.left + offset, top=control.grid.top - offset)
    noise = np.random.default_rng(5).normal(0.0, 0.2, control.z.shape)
    noise[20:23, 30:40] = np.nan
    own = replace(control, source=replace(control.source, grid=grid))
    found = aerotri.compare(raised(own, noise), own)
    assert found.record.grid == grid
    np.testing.assert_allclose(found.difference.z, noise, atol=2e-5)
    assert found.statistics["count"][0] == np.isfinite(noise).sum()


def test_of_two_rasters_the_part_in_common_is_compared(control):
    """The test surface begins some cells further in, its edges off by a rounding of the file."""
    z = control.z[7:60, 11:90] + np.arange(79) * 0.01
    grid = control.grid.window(7, 11, 53, 79)
    part = replace(control, source=replace(control.source, grid=replace(grid, left=grid.left + 1e-4), z=z,
                                           sigma=np.full_like(z, np.nan)))  # fmt: skip
    found = aerotri.compare(part, control)
    assert found.record.grid == grid
    np.testing.assert_allclose(found.difference.z, np.tile(np.arange(79) * 0.01, (53, 1)), atol=2e-5)
    # a cell that is asked for, or an offset by a part of a cell, still needs interpolation
    off = replace(part, source=replace(part.source, grid=replace(grid, left=grid.left + 0.7)))
    for other, cell in ((part, 3.0), (off, None)):
        assert aerotri.compare(other, control, cell=cell).record.grid != grid


def cloud(path, crs):
    x, y = np.meshgrid(LEFT + 4.0 * np.arange(40), TOP - 4.0 * np.arange(40))
    xyz = np.column_stack([x.ravel(), y.ravel(), hills(x, y).ravel()])
    sigma = np.full(len(xyz), 0.02)
    write_point_cloud(path, xyz, sigma, np.ones(len(xyz), bool), crs)
    return path


def test_systems_of_clouds_are_compared(tmp_path, control):
    here, there = cloud(tmp_path / "here.laz", "EPSG:25832"), cloud(tmp_path / "there.laz", "EPSG:25833")
    with pytest.raises(InputError, match=r"here\.laz: is in EPSG:25832, the control in EPSG:25833"):
        aerotri.compare(here, there)
    old, new = (cloud(tmp_path / f"{code}.laz", f"EPSG:25832+{code}") for code in (5783, 7837))
    said = aerotri.compare(old, new).notes[0]
    assert "in EPSG:5783 (DHHN92 height), of the control in EPSG:7837 (DHHN2016 height)" in said
    assert aerotri.compare(new, new).notes == ()
    assert any("here.laz does not say in which system its heights" in note for note in aerotri.compare(here, new).notes)


@pytest.mark.parametrize("silent", [0, 1])
def test_a_surface_without_a_system_is_told(tmp_path, control, silent):
    plain = replace(control, crs=None, name="plain")
    said = aerotri.compare(*((plain, control) if silent == 0 else (control, plain))).notes
    assert said[0] == "plain does not say its coordinate system; taken for EPSG:32632"
    assert not any("coordinate system" in note for note in aerotri.compare(plain, plain).notes)
    bare = cloud(tmp_path / "bare.laz", None)
    assert any("bare.laz does not say its coordinate system" in note for note in aerotri.compare(bare, control).notes)


def test_cells_that_are_compared_as_they_are_are_told(control):
    alike = aerotri.compare(raised(control, 0.1), control).notes
    assert alike == ("both surfaces have the same cells, which are compared as they are",)
    spline = aerotri.compare(raised(control, 0.1), control, method="spline").notes
    assert "method 'spline' is not used" in spline[0]
    assert aerotri.compare(raised(control, 0.1), control, cell=3.0).notes == ()
