"""Ideal photographs: pixels against exact positions, seams, files, and the proof on rendered photographs."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
import rasterio
from rasterio.control import GroundControlPoint
from rasterio.enums import ColorInterp
from rasterio.rpc import RPC
from rasterio.transform import from_origin
from scipy.spatial import KDTree

from aerotri.conventions import InputError, mm_from_px, px_from_mm
from aerotri.functional_model.additional_parameters import parameter_set, parse_parameters
from aerotri.image_errors import image_groups, systematic_errors
from aerotri.image_errors.error_exports import (
    correction_nodes,
    correction_raster,
    ideal_camera,
    nearest_brown,
    nearest_opencv,
)
from aerotri.image_errors.error_function import ErrorFunction, error_function
from aerotri.image_errors.ideal_map import ideal_map
from aerotri.image_errors.ideal_photographs import PixelType, ideal_photograph, resample
from aerotri.image_errors.tile_grid import sample, seams_px, tiles_of
from aerotri.observations import Camera, Prior
from aerotri.pipeline import adjust
from aerotri.simulation import parse_spec, simulate
from aerotri.simulation.camera_errors import ImageError
from aerotri.simulation.projection import project
from aerotri.simulation.rendering import RenderOptions, make_scene, render
from small_blocks import small_spec, with_adjustment
from synthetic import make_adjusted_block

pytestmark = pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
SIZES = {"ultracam_d": (460, 300), "dmc": (432, 240), "frame": (360, 280)}
WIDTH_MM = 103.5


def camera_of(model, flight_axis="+y", size=None):
    held = {name: Prior(value, fixed=True) for name, value in
            (("focal_length_mm", 101.4), ("x0_mm", 0.05), ("y0_mm", -0.03))}  # fmt: skip
    across, along = SIZES[model] if size is None else size
    pixel_um = WIDTH_MM * 1e3 / across
    size = (across, along) if flight_axis.endswith("y") else (along, across)
    return Camera("cam", model, size, pixel_um, held, flight_axis=flight_axis)


def errors_of(camera, linear=(), brown=(), lens=()):
    """An error function of values by parameter name."""
    families = {}
    for name, value in dict(linear).items():
        family, item = name.split(".")
        families.setdefault(family, {})[item] = value
    sets = []
    for family, values in families.items():
        chosen = parameter_set(family, values, camera)
        sets.append((chosen, np.array([values[item] for item in chosen.items])))
    return ErrorFunction(
        camera, "cam", np.array([101.4, 0.05, -0.03]), tuple(sets),
        np.array([*brown, *np.zeros(7 - len(brown))]), np.array([*lens, *np.zeros(14 - len(lens))]),
    )  # fmt: skip


def values_for(camera, families, px=0.4, seed=5):
    """Parameters that displace by some tenths of a pixel each."""
    rng = np.random.default_rng(seed)
    x, y = (g.ravel() for g in np.meshgrid(*(np.linspace(-h, h, 41) for h in camera.half_format_mm)))
    out = {}
    for family, items in families.items():
        chosen = parameter_set(family, items, camera)
        largest = np.abs(chosen.basis(x, y)).max(axis=(0, 1))
        out |= dict(zip(chosen.names, (rng.normal(size=len(largest)) * px * camera.pixel_mm / largest), strict=True))
    return out


BLUH, TILES = [str(i) for i in range(1, 13)], [str(i) for i in range(42, 74)]
FAMILIES = {
    "ultracam_d": {"bluh": BLUH, "ultracam_d": TILES},
    "dmc": {"bluh": BLUH, "dmc": [str(i) for i in (*range(30, 42), *range(74, 78))]},
    "frame": {"bluh": BLUH, "ebner": [str(i) for i in range(1, 13)]},
}


def pattern(x, y):
    """A smooth image, defined everywhere."""
    return 20000 + 8000 * np.sin(x / 7 + 0.3) * np.cos(y / 9) + 3000 * np.sin((x + y) / 5)


def exact_positions(errors):
    """Source (n, 2) px of every pixel centre, NaN where no tile records it, by the definition."""
    camera = errors.camera
    columns, rows = camera.size_px
    px = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2) + 0.5
    seams = seams_px(camera)
    own_column, own_row = (np.searchsorted(s, px[:, k], side="right") for k, s in enumerate(seams))
    source = np.full(px.shape, np.nan)
    ideal = mm_from_px(px, camera.size_px, camera.pixel_mm)
    for i, line in enumerate(tiles_of(camera)):
        for j, tile in enumerate(line):
            m = px_from_mm(errors.measured(ideal, tile.bounds_mm(camera)), camera.size_px, camera.pixel_mm)
            inside = (m[:, 0] >= tile.columns[0]) & (m[:, 0] < tile.columns[1])
            inside &= (m[:, 1] >= tile.rows[0]) & (m[:, 1] < tile.rows[1])
            own = (own_row == i) & (own_column == j)
            take = inside & (own | np.isnan(source[:, 0]))
            source[take] = m[take]
    return source.reshape(rows, columns, 2)


@pytest.mark.parametrize(
    ("model", "axis"), [("ultracam_d", "+y"), ("ultracam_d", "-x"), ("dmc", "+y"), ("dmc", "+x"), ("frame", "+y")]
)
def test_every_pixel_is_fetched_where_it_was_measured(model, axis):
    camera = camera_of(model, axis)
    errors = errors_of(camera, values_for(camera, FAMILIES[model]))
    ideal, (rows, columns) = ideal_map(errors), camera.size_px[::-1]
    source = exact_positions(errors)
    image = pattern(*np.meshgrid(np.arange(columns) + 0.5, np.arange(rows) + 0.5))[None]
    out = resample(image, 0, (0, rows), ideal, PixelType(-np.inf, np.inf, -1.0))[0]
    x, y = np.moveaxis(source, -1, 0)
    known = np.isfinite(x)
    well_inside = known & (x > 3) & (y > 3) & (x < columns - 3) & (y < rows - 3)
    outside = known & ((x < -0.01) | (y < -0.01) | (x > columns + 0.01) | (y > rows + 0.01))
    off = np.abs(out - pattern(x, y))
    moved = np.hypot(x - np.arange(columns) - 0.5, (y.T - np.arange(rows) - 0.5).T)
    assert np.nanmax(moved) > 1.0
    # cubic interpolation of this pattern itself leaves 3 units, a hundredth of a pixel is 14
    near_seams = np.zeros_like(known)
    for k, seams in enumerate(seams_px(camera)):
        for seam in seams:
            place = slice(max(int(seam) - 4, 0), int(seam) + 5)
            near_seams[(slice(None), place) if k == 0 else (place, slice(None))] = True
    assert off[well_inside & ~near_seams].max() < 8.0
    assert np.quantile(off[well_inside & near_seams], 0.99) < 8.0 if near_seams.any() else True
    assert (off[well_inside & near_seams] > 50.0).sum() <= 4  # where the corners of four tiles meet
    assert (out[outside] == -1.0).all()
    assert (out[well_inside] != -1.0).all()


@pytest.mark.parametrize(
    ("dtype", "method"),
    [("uint8", "bicubic"), ("int8", "bicubic"), ("uint16", "bicubic"), ("int16", "bicubic"), ("uint32", "bicubic"),
     ("int32", "lanczos"), ("float32", "bicubic"), ("float64", "lanczos"), ("uint16", "lanczos")],
)  # fmt: skip
def test_every_type_of_pixel(dtype, method):
    camera = camera_of("frame", size=(180, 140))
    errors = errors_of(camera, values_for(camera, {"ebner": BLUH}))
    image = pattern(*np.meshgrid(np.arange(180) + 0.5, np.arange(140) + 0.5))
    scale, offset = {"uint8": (250.0, 0.0), "int8": (250.0, 80.0)}.get(
        dtype, (1.0, 25000.0 if dtype[0] == "i" else 0.0)
    )
    info = np.iinfo(dtype) if dtype[0] != "f" else np.finfo(dtype)
    kind = PixelType(float(info.min), float(info.max), 0.0)
    grey = (image / scale - offset).round() if dtype[0] != "f" else image
    ideal = ideal_map(errors)
    exact = resample(grey[None].astype(np.float64), 0, (0, 140), ideal, PixelType(-np.inf, np.inf, 0.0), method)
    out = resample(grey[None].astype(dtype), 0, (0, 140), ideal, kind, method)
    assert out.dtype == np.dtype(dtype)
    tolerance = 0.51 if dtype[0] != "f" else 0.01
    np.testing.assert_allclose(out.astype(float), np.clip(exact, info.min, info.max), atol=tolerance)
    far = slice(6, -6)
    source = exact_positions(errors)[far, far]
    truth = pattern(source[..., 0], source[..., 1]) / scale - (offset if dtype[0] != "f" else 0.0)
    # Lanczos ripples by half a per cent of the contrast; whole numbers are rounded before and after
    assert np.abs(out[0, far, far] - truth).max() < (60.0 if method == "lanczos" else 8.0) / scale + 1.3


def test_values_stay_within_the_type():
    """Beside a sharp edge the kernels overshoot."""
    camera = camera_of("frame", size=(60, 40))
    image = np.zeros((1, 40, 60), np.uint8)
    image[:, :, 30:] = 255
    ideal = ideal_map(errors_of(camera, {"bluh.2": 0.002}))
    for method in ("bicubic", "lanczos"):
        out = resample(image, 0, (0, 40), ideal, PixelType(0.0, 255.0, 0.0), method)
        assert out[0, 5:-5, 5:20].max() <= 5
        assert out[0, 5:-5, 40:55].min() >= 250
    low = resample(np.full((1, 40, 60), 200, np.uint8), 0, (0, 40), ideal, PixelType(0.0, 127.0, 0.0))
    assert low.max() == 127


@pytest.mark.parametrize("shift_px", [1.5, -1.5])
def test_seam_in_gap_and_overlap(shift_px):
    """A tile shifted away from its neighbour: no tile records the gap; shifted over it, the own tile records it."""
    camera = camera_of("ultracam_d")
    ideal = ideal_map(errors_of(camera, {"ultracam_d.50": shift_px * camera.pixel_mm}))
    seam = seams_px(camera)[0][0]
    first_of_right = ideal.columns[1, 40]
    if shift_px > 0:  # m = ideal + shift: from seam − shift on the left tile has nothing, the right one begins at seam
        assert abs(first_of_right - (seam - 0.5 - shift_px / 2)) <= 1.0
    else:
        assert first_of_right == int(np.ceil(seam - 0.5))
    assert (ideal.columns[1, 120:180] == int(np.ceil(seam - 0.5))).all()
    upper = ideal.tiles[0][0].nodes
    np.testing.assert_allclose(upper[..., 0], shift_px, atol=1e-9)
    assert np.abs(ideal.tiles[0][1].nodes).max() < 1e-9


def test_rows_at_a_time_and_threads_give_the_same_pixels():
    camera = camera_of("ultracam_d")
    ideal = ideal_map(errors_of(camera, values_for(camera, FAMILIES["ultracam_d"], px=1.5)))
    image = np.random.default_rng(1).integers(0, 65535, (2, 300, 460), np.uint16)
    kind = PixelType(0.0, 65535.0, 0.0)
    with ThreadPoolExecutor(3) as pool:
        whole = resample(image, 0, (0, 300), ideal, kind, "bicubic", pool)
    parts = []
    for first in range(0, 300, 37):
        rows = first, min(first + 37, 300)
        low, high = (int(np.clip(r, 0, 300)) for r in ideal.source_rows(*rows))
        parts.append(resample(image[:, low:high], low, rows, ideal, kind))
    np.testing.assert_array_equal(np.concatenate(parts, axis=1), whole)


@pytest.mark.parametrize("nodata", [0.0, np.nan])
def test_nothing_is_made_of_nodata(nodata):
    camera = camera_of("frame", size=(60, 40))
    ideal = ideal_map(errors_of(camera, {"bluh.2": 0.002, "bluh.1": 0.001}))
    image = np.full((1, 40, 60), 5000.0, np.float32)
    image[0, 10:20, 10:20] = nodata
    out = resample(image, 0, (0, 40), ideal, PixelType(-np.inf, np.inf, nodata, nodata))[0]
    empty = np.isnan(out) if np.isnan(nodata) else out == nodata
    assert empty[11:19, 11:19].all()
    assert 80 < empty[5:-5, 5:-5].sum() < 250
    np.testing.assert_allclose(out[~empty], 5000.0, rtol=1e-6)


def test_strong_lens_moves_by_many_pixels():
    """Radial distortion of tens of pixels: the source rows of a band lie far away, some outside the photograph."""
    camera = camera_of("frame")
    for change in ({"brown": [3e-5]}, {"lens": [0.3, 0.0, 1e-3, -1e-3]}, {"brown": [-1e-5]}):
        errors = errors_of(camera, **change)
        ideal, (rows, columns) = ideal_map(errors), camera.size_px[::-1]
        x, y = np.moveaxis(exact_positions(errors), -1, 0)
        image = pattern(*np.meshgrid(np.arange(columns) + 0.5, np.arange(rows) + 0.5))[None].astype(np.float32)
        out = resample(image, 0, (0, rows), ideal, PixelType(-np.inf, np.inf, -1.0))[0]
        inside = (x > 3) & (y > 3) & (x < columns - 3) & (y < rows - 3)
        assert np.hypot(x - np.arange(columns), (y.T - np.arange(rows)).T).max() > 10.0
        assert np.abs(out - pattern(x, y))[inside].max() < 10.0
        outside = (x < -0.1) | (y < -0.1) | (x > columns + 0.1) | (y > rows + 0.1)
        assert (out[outside] == -1.0).all()


def test_errors_that_fold_the_image_are_refused():
    camera = camera_of("frame")
    with pytest.raises(InputError, match="change places"):
        ideal_map(errors_of(camera, brown=[5e-3]))


def test_error_function_is_the_field():
    """The same d as `systematic_errors`, every family at once, and its inverse."""
    adjusted = make_adjusted_block(2, 4, 60)
    group = image_groups(adjusted.block)[0]
    errors = error_function(adjusted, group)
    rng = np.random.default_rng(2)
    xy = (rng.random((500, 2)) * 2 - 1) * group.camera.half_format_mm
    d, _ = systematic_errors(adjusted, group.name, *xy.T)
    assert np.abs(d).max() > 1e-3
    np.testing.assert_allclose(errors.of_measured(xy), d, atol=1e-12)


def test_both_directions_with_a_lens():
    camera = camera_of("frame")
    errors = errors_of(
        camera, {"bluh.9": 1e-7, "bluh.1": 1e-4}, brown=[1e-6, 0, 0, 1e-6], lens=[-0.05, 0.02, 1e-4, 2e-4]
    )
    ideal = (np.random.default_rng(3).random((400, 2)) * 2 - 1) * camera.half_format_mm
    measured = errors.measured(ideal)
    np.testing.assert_allclose(measured - errors.of_measured(measured), ideal, atol=1e-7)


def test_grid_is_as_fine_as_it_has_to_be():
    def smooth(px):
        return np.sin(px / 300.0)

    grid = sample(smooth, (0, 2000), (0, 3000))
    assert 8 <= grid.step <= 64
    row, column = np.random.default_rng(4).random((2, 1000)) * [[2000], [3000]]
    off = grid.at(row, column) - smooth(np.column_stack([column, row]) + 0.5)
    assert np.abs(off).max() < 0.004
    low, high = grid.bounds((100, 200), (500, 600))
    inside = grid.at(*np.random.default_rng(5).uniform([[100], [500]], [[200], [600]], (2, 500)))
    assert (inside >= low).all()
    assert (inside <= high).all()


# exports


def test_nearest_cameras_recover_their_own_kind():
    camera = camera_of("frame")
    errors = errors_of(camera, lens=[-0.05, 0.02, 1e-3, -5e-4])
    nearest = nearest_opencv(errors)
    assert nearest.max_mm < 1e-7
    np.testing.assert_allclose([p.value for p in nearest.camera.lens.values()], [-0.05, 0.02, 1e-3, -5e-4], atol=1e-8)
    np.testing.assert_allclose(
        [p.value for p in nearest.camera.interior.values()], [101.4, 0.05, -0.03], atol=1e-6
    )  # fmt: skip
    errors = errors_of(camera, brown=[1e-6, -2e-10, 3e-14, 1e-6, -2e-6, 1e-4, 3e-4])
    nearest = nearest_brown(errors)
    assert nearest.max_mm < 1e-9
    np.testing.assert_allclose([p.value for p in nearest.camera.brown.values()], errors.brown, rtol=1e-5)


def test_nearest_camera_leaves_the_tiles():
    camera = camera_of("ultracam_d")
    shift = 0.5 * camera.pixel_mm
    nearest = nearest_opencv(errors_of(camera, {"ultracam_d.50": shift, "ultracam_d.57": -shift}))
    assert 0.2 * shift < nearest.rms_mm < shift
    assert nearest.max_mm < 1.2 * shift


def test_correction_nodes_stand_on_both_sides_of_a_seam():
    camera = camera_of("ultracam_d")
    errors = errors_of(camera, {"ultracam_d.50": 0.1})
    nodes = correction_nodes(camera)
    assert set(nodes.tile) == set(range(9))
    d = errors.of_measured(nodes.xy)
    np.testing.assert_allclose(d[nodes.tile == 0], [[0.1, 0.0]] * int((nodes.tile == 0).sum()), atol=1e-12)
    assert np.abs(d[nodes.tile != 0]).max() < 1e-12
    seam = seams_px(camera)[0][0]
    assert np.abs(nodes.column_row[nodes.tile == 0, 0].max() - seam) < 1e-5
    assert np.abs(nodes.column_row[nodes.tile == 1, 0].min() - seam) < 1e-5
    values, cell = correction_raster(errors)
    assert values.shape == (2, -(-300 // cell), -(-460 // cell))
    assert values[0, 0, 0] == pytest.approx(0.1)
    assert values[0, -1, -1] == 0.0
    assert ideal_camera(errors).focal_length_mm == 101.4


# files


@pytest.fixture(scope="module")
def small_map():
    camera = camera_of("frame", size=(700, 560))
    return ideal_map(errors_of(camera, {"bluh.1": 2e-4, "bluh.9": 1e-7}))


@pytest.fixture(scope="module")
def nothing():
    return ideal_map(errors_of(camera_of("frame", size=(700, 560))))


def grey(bands=1, dtype: type = np.uint16, top=4000):
    return np.random.default_rng(7).integers(0, top, (bands, 560, 700)).astype(dtype)


def write(path, pixels, **options):
    tags = options.pop("tags", {})
    with rasterio.open(
        path, "w", driver=options.pop("driver", "GTiff"), width=700, height=560, count=len(pixels),
        dtype=pixels.dtype.name, **options,
    ) as file:  # fmt: skip
        file.write(pixels)
        file.update_tags(**tags)
    return path


def test_metadata_and_georeference_are_kept(tmp_path, small_map):
    pixels = grey(3, np.uint8, 255)
    source = write(
        tmp_path / "a.tif", pixels, compress="lzw", photometric="rgb", crs="EPSG:25832", nodata=0,
        transform=from_origin(5e5, 5.5e6, 0.1, 0.1), tags={"TIFFTAG_SOFTWARE": "scanner", "CAMERA": "UCD 7"},
    )  # fmt: skip
    with rasterio.open(source, "r+") as file:
        file.descriptions = ("r", "g", "b")
        file.update_tags(2, FILTER="green")
        file.update_tags(ns="FLIGHT", STRIP="4")
    assert ideal_photograph(source, tmp_path / "b.tif", small_map) == ()
    with rasterio.open(tmp_path / "b.tif") as made, rasterio.open(source) as old:
        for name in ("crs", "transform", "nodata", "descriptions", "colorinterp", "dtypes", "count", "shape"):
            assert getattr(made, name) == getattr(old, name)
        for key in ("TIFFTAG_SOFTWARE", "CAMERA"):
            assert made.tags()[key] == old.tags()[key]
        assert made.tags(2)["FILTER"] == "green"
        assert made.tags(ns="FLIGHT") == {"STRIP": "4"}
        assert made.profile["tiled"]
        assert made.tags(ns="IMAGE_STRUCTURE")["COMPRESSION"] == "LZW"
        assert (made.read() != old.read()).mean() > 0.3
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.tif", "b.tif"]


def test_control_points_and_rational_functions_are_kept(tmp_path, small_map):
    points = [GroundControlPoint(r, c, x, y, 5.0, str(k)) for k, (r, c, x, y) in
              enumerate([(0, 0, 1, 2), (0, 700, 71, 2), (560, 0, 1, -54), (560, 700, 71, -54.5)])]  # fmt: skip
    source = write(tmp_path / "gcps.tif", grey(), gcps=points, crs="EPSG:25832")
    ideal_photograph(source, tmp_path / "out.tif", small_map)
    with rasterio.open(tmp_path / "out.tif") as made:
        assert [(p.row, p.col, p.x, p.y, p.z) for p in made.gcps[0]] == [(p.row, p.col, p.x, p.y, p.z) for p in points]
        assert made.gcps[1].to_epsg() == 25832
    coefficients = [1.0, *([0.1] * 19)]
    values = (10, 5, 50, 2, coefficients, coefficients, 280, 200, 8, 2, coefficients, coefficients, 350, 300)
    rpc = RPC(*values)  # pyright: ignore[reportCallIssue]
    source = write(tmp_path / "rpc.tif", grey(), rpcs=rpc)
    ideal_photograph(source, tmp_path / "out2.tif", small_map)
    with rasterio.open(tmp_path / "out2.tif") as made:
        kept, given = (r.to_gdal() for r in (made.rpcs, rpc))
        for key, text in given.items():
            assert [float(v) for v in kept[key].split()] == [float(v) for v in text.split()]


def test_bits_bands_and_alpha(tmp_path, small_map):
    source = write(tmp_path / "twelve.tif", grey(top=4096), nbits=12)
    ideal_photograph(source, tmp_path / "out.tif", small_map)
    with rasterio.open(tmp_path / "out.tif") as made:
        assert made.tags(1, ns="IMAGE_STRUCTURE")["NBITS"] == "12"
        assert 4000 < made.read().max() <= 4095
    pixels = grey(5, np.float32, 1000) / 7
    source = write(tmp_path / "five.tif", pixels, interleave="band")
    ideal_photograph(source, tmp_path / "five_out.tif", small_map, compression="zstd")
    with rasterio.open(tmp_path / "five_out.tif") as made:
        assert (made.count, made.dtypes[0]) == (5, "float32")
        assert made.tags(ns="IMAGE_STRUCTURE")["INTERLEAVE"] == "BAND"
        assert made.tags(ns="IMAGE_STRUCTURE")["COMPRESSION"] == "ZSTD"
    source = write(tmp_path / "alpha.tif", grey(4, np.uint8, 255), photometric="rgb", alpha="yes")
    ideal_photograph(source, tmp_path / "alpha_out.tif", small_map)
    with rasterio.open(tmp_path / "alpha_out.tif") as made:
        assert made.colorinterp[3] == ColorInterp.alpha


def test_without_parameters_the_pixels_are_the_same(tmp_path, nothing):
    for name, pixels in (("a.tif", grey(3)), ("b.tif", grey(1, np.float64) * np.nan)):
        source = write(tmp_path / name, pixels)
        ideal_photograph(source, tmp_path / f"out_{name}", nothing)
        with rasterio.open(tmp_path / f"out_{name}") as made:
            np.testing.assert_array_equal(made.read(), pixels)
    # the resampling itself changes nothing either where nothing moves
    out = resample(grey(), 0, (0, 560), replace(nothing, is_identity=False), PixelType(0.0, 65535.0, 0.0))
    np.testing.assert_array_equal(out, grey())


def test_jpeg(tmp_path, small_map, nothing):
    pixels = np.repeat(np.repeat(grey(3, np.uint8, 255)[:, :70, :100], 8, axis=1), 7, axis=2)
    source = write(tmp_path / "photo.jpg", pixels, driver="JPEG", quality=90)
    ideal_photograph(source, tmp_path / "same.tif", nothing)
    with rasterio.open(source) as old, rasterio.open(tmp_path / "same.tif") as made:
        np.testing.assert_array_equal(made.read(), old.read())
        assert made.colorinterp == old.colorinterp
        assert made.tags(ns="IMAGE_STRUCTURE")["COMPRESSION"] == "DEFLATE"
    ideal_photograph(source, tmp_path / "moved.tif", small_map)


def _truncated(path, share):
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    return path


def test_damaged_and_hostile_files_are_named(tmp_path, small_map):
    noise = grey(3, np.uint8, 255)
    files = {
        "short.tif": _truncated(write(tmp_path / "short.tif", grey()), 0.6),
        "packed.tif": _truncated(write(tmp_path / "packed.tif", grey(), compress="deflate"), 0.6),
        "short.jpg": _truncated(write(tmp_path / "short.jpg", noise, driver="JPEG"), 0.6),
        "palette.tif": write(tmp_path / "palette.tif", grey(1, np.uint8, 255), photometric="palette"),
        "complex.tif": write(tmp_path / "complex.tif", grey(1, np.complex64)),
        "bilevel.tif": write(tmp_path / "bilevel.tif", grey(1, np.uint8, 2), nbits=1),
        "missing.tif": tmp_path / "missing.tif",
    }
    with rasterio.open(files["palette.tif"], "r+") as file:
        file.write_colormap(1, {k: (k, 0, 0, 255) for k in range(256)})
    for name, content in (
        ("empty.tif", b""), ("text.tif", b"photographs"), ("head.tif", b"II*\0\x08\0\0\0"),
        ("vrt.tif", b'<VRTDataset rasterXSize="700" rasterYSize="560"/>'), ("odd.jpg", b"\xff\xd8\xff" + b"\0" * 99),
    ):  # fmt: skip
        files[name] = tmp_path / name
        files[name].write_bytes(content)
    files["wide.tif"] = tmp_path / "wide.tif"
    with rasterio.open(files["wide.tif"], "w", driver="GTiff", width=560, height=700, count=1, dtype="uint8"):
        pass
    for path in files.values():
        with pytest.raises(InputError) as caught:
            ideal_photograph(path, tmp_path / "out.tif", small_map)
        assert str(caught.value).startswith(f"{path}: ")
        assert "\n" not in str(caught.value)


def test_unknown_resampling_and_folder(tmp_path, small_map):
    with pytest.raises(InputError, match="nearest"):
        ideal_photograph(tmp_path / "a.tif", tmp_path / "b.tif", small_map, "nearest")
    with pytest.raises(InputError, match="no such file"):
        ideal_photograph(tmp_path, tmp_path / "b.tif", small_map)


# the proof: rendered photographs


def offset(reference, image):
    """Shift (column, row) of an image patch against a reference, least squares with gain and offset."""
    from scipy.ndimage import shift

    reference, image, found = reference.astype(float), image.astype(float), np.zeros(2)
    down, right = (g[3:-3, 3:-3].ravel() for g in np.gradient(reference))
    design = np.column_stack([-right, -down, reference[3:-3, 3:-3].ravel(), np.ones(len(right))])
    for _ in range(8):
        moved = shift(image, -found[::-1], order=5, mode="nearest")[3:-3, 3:-3].ravel()
        solved = np.linalg.lstsq(design, moved, rcond=None)[0]
        step = solved[:2] / solved[2]
        found = found + step
        if np.abs(step).max() < 1e-4:
            break
    return found


def rendered_spec(errors, size, **changes):
    camera = {"preset": "ultracam_d", "size_px": list(size), "pixel_um": 9.0 * 11500 / size[0], "errors": errors}
    tables = small_spec(camera={"ucd": camera}, **changes)
    tables["flight"] = tables["flight"] | {"gsd_m": 0.1 * 11500 / size[0]}
    tables["tie_points"] = {"per_image": 60, "probability": 0.9, "sigma_um": 0.5, "stated_sigma_um": 0.5}
    return parse_spec(tables)


def test_offsets_in_the_ideal_photograph():
    """Against the photograph an ideal camera would have taken: below 0.05 px RMS, in each tile and on each seam."""
    camera = camera_of("ultracam_d", size=(1150, 750))
    values = values_for(camera, FAMILIES["ultracam_d"])
    spec = rendered_spec({"parameters": values}, (1150, 750))
    block, truth = simulate(spec, 1)
    adjusted = adjust(
        with_adjustment(block, additional_parameters=parse_parameters("bluh:1-12,ultracam_d:42-73"))
    )  # fmt: skip
    errors = error_function(adjusted, image_groups(adjusted.block)[0])
    scene = make_scene(spec, 1, block, truth, RenderOptions(noise=30.0))
    perfect = replace(scene, fields=tuple(ImageError(()) for _ in scene.fields))
    image, half = 4, 16
    taken, reference = render(scene, image), render(perfect, image)
    made = resample(taken[None], 0, (0, 750), ideal_map(errors), PixelType(0.0, 65535.0, 0.0))[0]
    seam_columns, seam_rows = (np.round(s).astype(int) for s in seams_px(camera))
    columns = sorted({*range(30, 1121, 60), *seam_columns})
    rows = sorted({*range(30, 721, 60), *seam_rows})
    at = np.array([(c, r) for r in rows for c in columns])
    patches = [(slice(r - half, r + half + 1), slice(c - half, c + half + 1)) for c, r in at]
    before = np.array([offset(reference[p], taken[p]) for p in patches[::7]])
    after = np.array([offset(reference[p], made[p]) for p in patches])
    assert np.sqrt(np.mean(before**2)) > 0.3
    to_seam = np.minimum(
        np.abs(at[:, :1] - seam_columns).min(axis=1), np.abs(at[:, 1:] - seam_rows).min(axis=1)
    )  # fmt: skip
    tile = 3 * np.searchsorted(seam_rows, at[:, 1]) + np.searchsorted(seam_columns, at[:, 0])
    for number in range(9):
        inside = after[(tile == number) & (to_seam > half)]
        assert np.sqrt(np.mean(np.sum(inside**2, axis=1))) < 0.025
    for axis, seams in ((0, seam_columns), (1, seam_rows)):
        for seam in seams:
            across = after[at[:, axis] == seam]
            assert len(across) > 10
            assert np.sqrt(np.mean(np.sum(across**2, axis=1))) < 0.05
    assert np.abs(after).max() < 0.1


def centroids(image, places, level, reach=7):
    """Centres of gravity of discs over an even ground, NaN next to the border."""
    found = np.full(places.shape, np.nan)
    for k, place in enumerate(places):
        c, r = np.floor(place).astype(int)
        window = image[max(r - reach, 0) : r + reach + 1, max(c - reach, 0) : c + reach + 1].astype(float) - level
        if window.shape == (2 * reach + 1, 2 * reach + 1):
            y, x = np.indices(window.shape)
            found[k] = [np.sum(window * x), np.sum(window * y)] / window.sum() + np.array([c, r]) - reach + 0.5
    return found


def test_new_adjustment_finds_no_parameters():
    """Measured in the photographs and adjusted; made ideal, measured again and adjusted: every parameter is 0 within
    2·√(σ_old² + σ_new²), and so it is with the image points corrected by d.
    """
    size = (575, 375)
    spec = rendered_spec({"physical": {"rms_um": 90.0}}, size)
    block, truth = simulate(spec, 1)
    block = with_adjustment(block, additional_parameters=parse_parameters("bluh:1-12,ultracam_d:42-73"))
    rays, camera = block.image_points, block.cameras[0]
    scene = make_scene(spec, 1, block, truth, RenderOptions(contrast=0.0, noise=100.0))
    scene = replace(scene, targets=truth.points)
    places = px_from_mm(rays.xy, camera.size_px, camera.pixel_mm)
    # discs that touch others or lie on a seam are not measured
    clear = np.zeros(len(rays), bool)
    everything = np.arange(len(truth.points))
    for k in range(len(block.images)):
        own, drawn = rays.image == k, project(scene.photographs, truth.points, np.full_like(everything, k), everything)
        drawn = px_from_mm(drawn[np.isfinite(drawn).all(axis=1)], camera.size_px, camera.pixel_mm)
        clear[own] = KDTree(drawn).query(places[own], k=2)[0][:, 1] > 22
    for k, seams in enumerate(seams_px(camera)):
        clear &= np.abs(places[:, k, None] - seams).min(axis=1) > 8
    images = [render(scene, k) for k in range(len(block.images))]
    first = _measured(images, places, rays, scene.options.mean)
    use = clear & np.isfinite(first).all(axis=1)
    old = adjust(_with_points(block, first, use))
    errors = error_function(old, image_groups(old.block)[0])
    ideal, kind = ideal_map(errors), PixelType(0.0, 65535.0, 0.0)
    made = [resample(image[None], 0, (0, size[1]), ideal, kind)[0] for image in images]
    xy = mm_from_px(np.nan_to_num(first), camera.size_px, camera.pixel_mm)
    corrected = px_from_mm(xy - errors.of_measured(xy), camera.size_px, camera.pixel_mm)
    second = _measured(made, corrected, rays, scene.options.mean)
    use &= np.isfinite(second).all(axis=1)
    assert use.sum() > 700
    assert np.sqrt(np.mean((first - places)[use] ** 2)) < 0.03
    assert np.sqrt(np.mean((second - corrected)[use] ** 2)) < 0.02
    assert np.abs(old.parameters.t).max() > 10.0
    for points in (second, corrected):
        new = adjust(_with_points(block, points, use)).parameters
        assert (np.abs(new.value) < 2.0 * np.sqrt(old.parameters.sigma**2 + new.sigma**2)).all()


def _measured(images, places, rays, level):
    found = np.full(places.shape, np.nan)
    for k, image in enumerate(images):
        own = rays.image == k
        found[own] = centroids(image, places[own], level)
    return found


def _with_points(block, px, use):
    camera, rays = block.cameras[0], block.image_points
    xy = mm_from_px(px[use], camera.size_px, camera.pixel_mm)
    sigma = np.full(xy.shape, 0.02 * camera.pixel_mm)
    return replace(block, image_points=replace(rays, image=rays.image[use], point=rays.point[use], xy=xy, sigma=sigma))
