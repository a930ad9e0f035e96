"""The whole surface by dense matching: geometry of epipolar images, parallaxes with σ, fusion, tiles."""

import tracemalloc
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from rendered_blocks import rendered_block, write_photograph
from scipy.ndimage import gaussian_filter

from aerotri.conventions import InputError
from aerotri.formats.results import dense as dense_file
from aerotri.rasters.grids import Grid
from aerotri.rasters.images import create_image
from aerotri.terrain.adjustment_part import covariances_at
from aerotri.terrain.dense import _mesh_kernels as kernels
from aerotri.terrain.dense import epipolar, parallaxes, spline
from aerotri.terrain.dense._refinement_kernels import shift_windows
from aerotri.terrain.dense._resampling_kernels import align, move_rows, resample
from aerotri.terrain.dense.cell_scale import CellScale
from aerotri.terrain.dense.cell_sigma import EDGE_PX, at_edge, cell_sigma, roughness
from aerotri.terrain.dense.colours import Colours
from aerotri.terrain.dense.epipolar import EpipolarGeometry, EpipolarImages, epipolar_geometry
from aerotri.terrain.dense.grey_store import GreyStore
from aerotri.terrain.dense.height_range import range_of_surface
from aerotri.terrain.dense.measure import DensePlan, measure_surface
from aerotri.terrain.dense.pairs import Candidate, Pair, chosen_pairs, noise_correlation, pair_for_holes, possible_pairs
from aerotri.terrain.dense.parallaxes import parallaxes_of
from aerotri.terrain.dense.place import place_at
from aerotri.terrain.dense.points import normals
from aerotri.terrain.dense.shared_part import SharedPart, shared_part
from aerotri.terrain.dense.steps import (
    BETWEEN_SHARE,
    STEP_SHARE,
    STRAIGHT_COUNTS,
    others_seen,
    step_sigma,
    straightness,
)
from aerotri.terrain.dense.tile_files import TileFiles, TileWindow
from aerotri.terrain.dense.tile_surface import TileSurface, rim_of
from aerotri.terrain.pickets import Area


@pytest.fixture(scope="module")
def hill(tmp_path_factory):
    """A hill, and houses with flat roofs beside it."""
    houses = [[-150.0, -60.0, 60.0, 40.0, 20.0], [120.0, 40.0, 50.0, 50.0, 15.0]]
    ground = {"hill_height_m": 60.0, "hill_radius_m": 150.0, "kind": "hill", "houses": houses}
    return rendered_block(tmp_path_factory.mktemp("dense"), **ground)


@pytest.fixture(scope="module")
def surface(hill, tmp_path_factory):
    """The surface of its middle."""
    area = Area(np.array([-220.0, -220.0]), np.array([220.0, 220.0]))
    plan = DensePlan(np.arange(4), hill.paths, tmp_path_factory.mktemp("tiles"), area=area)
    return measure_surface(hill.calibration, plan), plan


def cells(outcome, rendered):
    """Errors and σ of the cells that have a height, and whether each lies off the walls of houses."""
    errors, sigmas, off_walls = [], [], []
    for window, part in outcome.files.read_all(list(outcome.windows)):
        grid = outcome.grid.window(window.row, window.column, window.rows, window.columns)
        x, y = np.meshgrid(grid.x(np.arange(grid.columns)), grid.y(np.arange(grid.rows)))
        truth = rendered.truth(np.column_stack([x.ravel(), y.ravel(), 0.0 * x.ravel()])).reshape(x.shape)
        wall = np.maximum(*(np.abs(slope) for slope in np.gradient(truth))) > 3.0
        near = cv2.dilate(wall.astype(np.uint8), np.ones((9, 9), np.uint8)) > 0
        known = np.isfinite(part.z)
        errors.append((part.z - truth)[known])
        sigmas.append(part.sigma[known])
        off_walls.append(~near[known])
    return np.concatenate(errors), np.concatenate(sigmas), np.concatenate(off_walls)


def test_heights_are_those_of_the_ground_within_their_sigma(surface, hill):
    outcome, _ = surface
    error, sigma, off = cells(outcome, hill)
    z = error[off] / sigma[off]
    assert outcome.cells > 0.5 * outcome.grid.rows * outcome.grid.columns
    assert abs(np.median(error[off])) < 0.1  # of a pixel of 1 m
    assert 0.75 < z.std() < 1.25
    assert (np.abs(z) > 4.0).mean() < 0.005
    assert np.median(sigma) < 0.4


def test_cells_are_counted_in_the_photographs_that_measured_them(surface, hill):
    """Each shows the cell, and the adjustment's share is that of a point intersected from these alone."""
    outcome, plan = surface
    photographs = outcome.photographs
    places, measured = [], []
    for window, tile in outcome.files.read_all(list(outcome.windows)):
        row, column = np.nonzero(np.isfinite(tile.z))
        assert (tile.count[row, column] >= 2).all()
        assert (tile.count[np.isnan(tile.z)] == 0).all()
        for n in range(0, len(row), max(len(row) // 20, 1)):
            own = tile.measured_by(row[n], column[n])
            assert len(own) == tile.count[row[n], column[n]]
            assert own[0] == tile.shown_by[row[n], column[n]]
            x, y = outcome.grid.x(window.column + column[n]), outcome.grid.y(window.row + row[n])
            places.append([x, y, tile.z[row[n], column[n]]])
            measured.append(own)
    xyz = np.array(places)
    place = place_at(photographs, xyz.mean(axis=0), 300.0, plan.edge)
    shows = np.column_stack([place.seen(k, place.from_crs(xyz)) for k in range(len(photographs))])
    assert all(shows[n, own].all() for n, own in enumerate(measured))
    found = shared_part(hill.calibration, photographs, plan.rows, xyz, measured)
    n = int(np.argmin([len(own) for own in measured]))
    alone = covariances_at(hill.calibration, photographs.restitution, plan.rows, xyz[n : n + 1], measured[n][None])
    few = shared_part(hill.calibration, photographs, plan.rows, xyz[n : n + 1], [measured[n]])
    np.testing.assert_allclose(few.covariance[0, 0, 2], alone[0, 2, 2])
    assert np.isfinite(found.covariance).all()


def test_medians_keep_few_cells_in_memory(monkeypatch):
    """Of a large surface, of tiles that are made as they are asked for, the record needs a share of the cells."""
    side, count = 500, 60
    shape = side, side
    grid = Grid(side, side * count, 0.0, 0.0, 1.0, 1.0)

    def tiles(windows):
        for n, window in enumerate(windows):
            z, members = np.full(shape, 100.0), np.full(shape, 3, np.uint8)
            sigma = np.full(shape, 0.1 if n % 3 else 0.2)
            pairs = np.array([[0, 1]])
            yield window, TileSurface(z, sigma, members, pairs[0], 1.0, pairs, np.zeros(1), 2.0, 3.0, rim_of(z, 0))

    nodes = np.zeros((2, 2, 6))
    nodes[:, :, 2] = 0.05**2
    o = SimpleNamespace(
        files=SimpleNamespace(read_all=tiles), windows=[TileWindow(0, side * n, side, side) for n in range(count)],
        grid=grid, shared=SharedPart(np.array([0.0, 1e6]), np.array([0.0, -1e6]), nodes, nodes[:, :, 2]),
        photographs=SimpleNamespace(gsd=np.array([0.5])), cells=side * side * count, shared_cells=2.0,
        across_px=np.zeros(1), pairs=np.array([[0, 1]]), resumed=0, pixel=3.0, level=0,
    )  # fmt: skip
    monkeypatch.setattr(dense_file, "MOST_SAMPLES", 20_000)
    tracemalloc.start()
    samples = dense_file._samples(o)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    sigma, matching, shared, relative, photographs = (np.concatenate(part) for part in zip(*samples, strict=True))
    assert 10_000 < len(sigma) <= 20_000 + count
    assert peak < 100.0 * side * side  # of one tile; all of them are sixty times as much
    assert np.median(matching) == 0.1
    np.testing.assert_allclose(shared, 0.05)
    np.testing.assert_allclose(sigma, np.hypot(matching, shared))
    np.testing.assert_allclose(relative, shared)
    assert (photographs == 2).all()


def test_nothing_hangs_between_roof_and_ground(surface, hill):
    error, _, off = cells(surface[0], hill)
    assert (np.abs(error[off]) > 3.0).mean() < 1e-3
    assert (np.abs(error) > 8.0).mean() < 5e-3


def test_tiles_of_an_earlier_run_are_used_and_damaged_ones_measured_again(surface, hill):
    first, plan = surface
    again = measure_surface(hill.calibration, plan)
    assert again.resumed == len(again.windows) > 0
    path = first.files.path(first.windows[0])
    whole = path.read_bytes()
    held = first.files.read(first.windows[0])
    path.write_bytes(whole[: len(whole) // 2])
    assert first.files.read(first.windows[0]) is None
    last = measure_surface(hill.calibration, plan)
    assert last.resumed == len(last.windows) - 1
    np.testing.assert_array_equal(last.files.read(first.windows[0]).z, held.z)


def test_no_damage_of_a_kept_tile_outlives_the_next_run(tmp_path):
    """Whatever byte is wrong, the tile counts as not there, or is what it was."""
    rng = np.random.default_rng(2)
    z, count = rng.normal(100.0, 1.0, (3, 4)), rng.integers(0, 5, (3, 4))
    rim = rim_of(rng.normal(100.0, 1.0, (5, 6)), 1)
    tile = TileSurface(z, z / 1e3, count, count[0], 1.5, count[:, :2], z[0], 2.5, 0.7, rim)
    files, window = TileFiles(tmp_path, 0, 3), TileWindow(0, 0, 3, 4)
    files.write(window, tile)
    whole = files.path(window).read_bytes()
    refused = 0
    for place in range(len(whole)):
        files.path(window).write_bytes(whole[:place] + bytes([whole[place] ^ 0x11]) + whole[place + 1 :])
        read = files.read(window)
        refused += read is None
        if read is not None:
            np.testing.assert_array_equal(read.z, tile.z)
            np.testing.assert_array_equal(read.pairs, tile.pairs)
            np.testing.assert_array_equal(read.rim.below, rim.below)
            assert (read.factor, read.shared_cells, read.pixel) == (1.5, 2.5, 0.7)
    assert refused > 0.5 * len(whole)


def test_a_place_has_one_row_in_both_epipolar_images(hill):
    place = place_at(hill.photographs(), np.array([0.0, 0.0, 100.0]), 300.0, 0.02)
    rng = np.random.default_rng(1)
    q = np.column_stack([rng.uniform(-60.0, 60.0, (200, 2)), rng.uniform(-20.0, 40.0, 200)])
    pair = chosen_pairs(possible_pairs(place, q), 1)[0]
    spare = np.array([0.0, 0.0, 10.0])
    g = epipolar_geometry(place, pair.left, pair.right, 0, q, q - spare, q + spare)
    left, right = ((q - place.centres[k]) @ g.rotation for k in (pair.left, pair.right))
    in_left, in_right = (-g.f * u[:, :2] / u[:, 2:] for u in (left, right))
    np.testing.assert_allclose(in_left[:, 1], in_right[:, 1], atol=1e-9)
    np.testing.assert_allclose(in_left[:, 0] - in_right[:, 0], -g.f * g.base / left[:, 2], rtol=1e-12)
    assert (in_left[:, 0] - in_right[:, 0] > 0.0).all()


def test_pixels_with_their_parallax_lie_where_they_were_projected_from(hill):
    """The identity of `place_of_pixels`: projected, then back by the parallax, bent image included."""
    place = place_at(hill.photographs(), np.array([0.0, 0.0, 100.0]), 300.0, 0.02)
    rng = np.random.default_rng(2)
    ground = np.column_stack([rng.uniform(-60.0, 60.0, (400, 2)), rng.uniform(-20.0, 40.0, 400)])
    pair = chosen_pairs(possible_pairs(place, ground), 1)[0]
    spare = np.array([0.0, 0.0, 10.0])
    g = epipolar_geometry(place, pair.left, pair.right, 0, ground, ground - spare, ground + spare)
    rows, columns = g.shape
    i, j = rows // 2, columns // 2
    depth = np.linspace(0.97, 1.03, 5) * np.median(-((ground - g.centre) @ g.rotation)[:, 2])
    u = np.column_stack([(g.first[0] + j) * depth / g.f, -(g.first[1] + i) * depth / g.f, -depth])
    q = g.centre + u @ g.rotation.T
    parallax = g.f * g.base / depth
    value = np.full((5, rows, columns), np.nan, np.float32)
    for k in range(5):
        delta = parallax[k] - g.known[i, j]
        for _ in range(50):
            delta = parallax[k] - np.interp(j - delta, np.arange(columns), g.known[i])
        value[k, i, j] = delta
        xyz, per_pixel = np.empty((3, rows, columns)), np.empty((rows, columns))
        rays = kernels.Rays(
            g.f, g.base, g.first, g.known, g.centre, np.ascontiguousarray(g.rotation), place.to_crs, place.reach
        )
        kernels.place_of_pixels(rays, value[k], xyz, per_pixel)
        np.testing.assert_allclose(xyz[:, i, j], q[k], atol=2e-2)
        assert np.isnan(xyz[:, 0, 0]).all()


def test_what_is_bent_out_is_what_is_added_again(hill):
    """The columns at which the bent image was taken are those that the parallaxes taken out say, between nodes too."""
    place = place_at(hill.photographs(), np.array([0.0, 0.0, 100.0]), 300.0, 0.02)
    x, y = np.meshgrid(np.linspace(-60.0, 60.0, 50), np.linspace(-60.0, 60.0, 50))
    ground = np.column_stack([x.ravel(), y.ravel(), 20.0 * np.exp(-(x**2 + y**2) / 1500.0).ravel()])
    pair = chosen_pairs(possible_pairs(place, ground), 1)[0]
    g = epipolar_geometry(place, pair.left, pair.right, 0, ground, ground - 1.0, ground + 1.0)
    assert np.ptp(g.known) > 5.0
    column, _ = np.meshgrid(*epipolar._lattice(g.first, g.shape))
    taken = epipolar._between_nodes((column - g.bend).astype(np.float32), g.shape)
    of_pixels = g.first[0] + np.arange(g.shape[1])
    np.testing.assert_allclose(taken, of_pixels - g.known, atol=1e-3)


def textured_pair(shift: float, across: float | np.ndarray, noise: float, seed: int) -> EpipolarImages:
    """Two images of one texture, the right one moved by so many pixels along and across the base."""
    rng = np.random.default_rng(seed)
    row, column = np.mgrid[:240, :320].astype(float)
    waves = rng.normal(scale=0.45, size=(300, 2)), rng.uniform(0.0, 2.0 * np.pi, 300)
    images = []
    for du, dv in ((0.0, 0.0), (shift, -across)):
        grey = np.zeros((240, 320))
        for (fx, fy), phase in zip(*waves, strict=True):
            grey += np.cos(fx * (column + du) + fy * (row + dv) + phase)
        images.append((128.0 + 2.5 * grey + rng.normal(scale=noise, size=grey.shape)).astype(np.float32))
    whole = np.ones((240, 320), np.bool_)
    known = np.zeros((240, 320), np.float32)
    g = EpipolarGeometry(0, 1, 0, 1e3, 100.0, np.eye(3), np.zeros(3), (0, 0), known.shape, known, -8, 16, known[:1, :1])
    return EpipolarImages(g, images[0], images[1], whole, whole)


@pytest.mark.parametrize("across", [0.0, 0.3])
@pytest.mark.parametrize("shift", [0.0, 0.25, 0.5, -1.37])
def test_parallaxes_are_recovered_whatever_the_shift_across_the_base(shift, across):
    found = parallaxes_of(textured_pair(shift, across, 3.0, 3))
    known = np.isfinite(found.value)
    error, sigma = found.value[known] - shift, found.sigma[known]
    assert known.mean() > 0.85
    assert abs(np.median(error)) < 0.02
    assert abs(found.across - across) < 0.02
    assert 0.7 < (error / sigma).std() < 1.3


def test_what_was_found_outlives_the_next_pair():
    """Arrays are filled again from pair to pair, smaller ones too: none of them is given away."""
    first = parallaxes_of(textured_pair(0.25, 0.0, 3.0, 3))
    value, sigma = first.value.copy(), first.sigma.copy()
    other = textured_pair(0.4, 0.0, 6.0, 4)
    parts = (a[:120, :160].copy() for a in (other.left, other.right, other.left_known, other.right_known))
    parallaxes_of(EpipolarImages(other.geometry, *parts))
    np.testing.assert_array_equal(first.value, value)
    np.testing.assert_array_equal(first.sigma, sigma)
    again = parallaxes_of(textured_pair(0.25, 0.0, 3.0, 3))
    np.testing.assert_array_equal(again.value, value)
    np.testing.assert_array_equal(again.sigma, sigma)


def test_shifts_across_the_base_that_change_over_an_image_are_no_noise():
    y, x = np.meshgrid(np.linspace(-1.0, 1.0, 240), np.linspace(-1.0, 1.0, 320), indexing="ij")
    level = parallaxes_of(textured_pair(0.25, 0.0, 3.0, 3))
    bent = parallaxes_of(textured_pair(0.25, 0.2 + 0.4 * x - 0.3 * y + 0.2 * x * x - 0.1 * x * y + 0.1 * y * y, 3.0, 3))
    known = np.isfinite(bent.value)
    assert known.mean() > 0.85
    assert bent.factor < 1.1 * level.factor
    assert np.median(bent.sigma[known]) < 1.1 * np.nanmedian(level.sigma)
    assert 0.7 < ((bent.value[known] - 0.25) / bent.sigma[known]).std() < 1.3


def test_sigma_grows_where_only_a_part_of_the_window_matches():
    images = textured_pair(0.25, 0.0, 3.0, 3)
    images.left_known[:, 160:] = False
    found = parallaxes_of(images)
    inside, rim = np.nanmedian(found.sigma[:, 60:140]), np.nanmedian(found.sigma[:, 159])
    assert rim > 2.0 * inside  # (7 / 4)² times, less the noise that the other three columns hide


def test_resampling_keeps_straight_lines_and_parabolas():
    row, column = np.mgrid[:40, :50].astype(float)
    x, y = np.random.default_rng(6).uniform(8.0, 31.0, (2, 30, 30)).astype(np.float32)
    out = np.empty((30, 30), np.float32)
    for grey in (3.0 * column - 2.0 * row, 0.1 * column**2 - 0.3 * row**2 + row * column):
        window = spline.of_surface(grey[1:, 2:].astype(np.float32))  # of a photograph, from its column 2 and row 1 on
        resample(window, np.array([2, 1]), x, y, np.ones((30, 30), np.bool_), out)
        true = 3.0 * x - 2.0 * y if grey[0, 1] == 3.0 else 0.1 * x**2 - 0.3 * y**2 + x * y
        np.testing.assert_allclose(out, true, rtol=1e-6, atol=1e-4)


@pytest.mark.parametrize("wave", [0.5, 0.9, 1.3])
def test_splines_leave_waves_where_they_are_and_keys_kernel_moves_them(wave):
    column, between = np.arange(400.0), np.full((1, 400), 0.8, np.float32)
    image = np.sin(wave * column)[None].astype(np.float32)

    def moved(right):
        """px, by which the wave lies off its place when the image is taken between its pixels."""
        out = np.empty((1, 400), np.float32)
        align(right, between, np.ones((1, 400), np.bool_), np.zeros((1, 400), np.float32), out)
        inside, at = out[0, 20:380], wave * (column - 0.8)[20:380]
        basis = np.column_stack([np.sin(at), np.cos(at)])
        sine, cosine = np.linalg.lstsq(basis, inside, rcond=None)[0]
        return np.arctan2(cosine, sine) / wave

    # the place is a fifth of a pixel beyond the pixel before it
    of_keys = wave**2 * 0.2 * 0.8 * 0.6 / 6.0
    assert abs(moved(spline.along_rows(image))) < 0.25 * of_keys


def test_a_spline_goes_through_the_pixels():
    image = np.random.default_rng(8).normal(size=(60, 70)).astype(np.float32)
    row, column = (np.ascontiguousarray(a, np.float32) for a in np.mgrid[10:50, 10:60])
    out = np.empty((40, 50), np.float32)
    resample(spline.of_surface(image), np.array([0, 0]), column, row, np.ones((40, 50), np.bool_), out)
    np.testing.assert_allclose(out, image[10:50, 10:60], atol=0.01)


def test_places_between_nodes_are_right_on_average():
    shape = 64, 96
    column, row = np.meshgrid(*epipolar._lattice((-50, 30), shape))
    x, y = np.meshgrid(-50.0 + np.arange(shape[1]), 30.0 + np.arange(shape[0]))

    def curved(x, y):
        return 0.001 * x * x - 0.0005 * y * y + 0.0008 * x * y + 2.0 * x - y

    found = epipolar._between_nodes(curved(column, row), shape)
    error = (found - curved(x, y))[16:-16, 16:-16]
    assert abs(error.mean()) < 1e-6
    # straight lines are off a parabola by an eighth of what it bends over a node at most, here half above, half below
    assert 0.003 < np.abs(error).max() < 0.01


@pytest.mark.parametrize("shift", [0.1, 0.2, 0.35, 0.65, 0.8, 0.9])
def test_parallaxes_do_not_lean_towards_pixels_nor_away(shift):
    found = parallaxes_of(textured_pair(shift, 0.0, 1.0, 4))
    assert abs(np.nanmean(found.value) - shift) < 0.004


def test_rows_are_moved_by_what_changes_over_the_image():
    # across the base: 1.3 − .8x + .6y + .4x² + .3xy − .7y², in rows, which no constant follows
    across, parallax = np.array([1.3, -0.8, 0.6, 0.4, 0.3, -0.7]), 6.5
    row, column = np.mgrid[:50, :70].astype(float)
    out = np.empty((50, 70), np.float32)
    move_rows((0.2 * row**2 - 3.0 * row).astype(np.float32), across, parallax, out)
    x, y = 2.0 * (column + parallax) / 69.0 - 1.0, 2.0 * row / 49.0 - 1.0
    at = row + np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1) @ across
    inside = (at >= 1.0) & (at < 47.0)
    assert inside.mean() > 0.8
    assert len(np.unique(np.floor(at - row))) > 2
    np.testing.assert_allclose(out[inside], (0.2 * at**2 - 3.0 * at)[inside], rtol=1e-5, atol=1e-3)


def test_pixels_are_aligned_by_their_parallaxes():
    column = np.arange(60.0)
    # as long as the image goes on beyond its edge, splines know parabolas there as well
    beyond = np.arange(-9.0, 69.0)
    right = spline.along_rows(np.tile(0.1 * beyond**2 - beyond, (4, 1)).astype(np.float32))[:, 9:-9]
    value = np.random.default_rng(2).uniform(-9.0, 9.0, (4, 60)).astype(np.float32)
    value[:, 20], value[:, 21] = 5.0, -10_000.0
    known = value > -1000.0
    left, out = np.full((4, 60), 7.0, np.float32), np.empty((4, 60), np.float32)
    align(right, value, known, left, out)
    at = column - value
    inside = known & (at >= 1.0) & (at < 58.0)
    np.testing.assert_allclose(out[inside], (0.1 * at**2 - at)[inside], rtol=1e-5, atol=1e-4)
    assert (out[~inside] == 7.0).all()
    assert not inside[:, 21].any()


def test_windows_are_solved_wherever_a_pixel_is_known():
    rng = np.random.default_rng(9)
    left, right = (cv2.GaussianBlur(rng.normal(size=(40, 330)).astype(np.float32), (0, 0), 1.5) * 99 for _ in range(2))
    whole, part = (np.empty((5, 40, 330), np.float32) for _ in range(2))
    known = np.ones((40, 330), np.bool_)
    shift_windows(left, right, np.float32(right.mean()), known, *whole)
    known[:11], known[33:], known[:, :8], known[:, 300:] = False, False, False, False
    shift_windows(left, right, np.float32(right.mean()), known, *part)
    assert np.isfinite(whole).mean() > 0.7
    np.testing.assert_allclose(part[:, known], whole[:, known], rtol=1e-4, atol=1e-4)
    assert np.isnan(part[:, ~known]).all()
    known[:] = False
    shift_windows(left, right, np.float32(0.0), known, *part)
    assert np.isnan(part).all()


def test_sigma_follows_the_noise():
    quiet, loud = (parallaxes_of(textured_pair(0.4, 0.0, noise, 4)) for noise in (1.5, 12.0))
    assert np.nanmedian(loud.sigma) > 3.0 * np.nanmedian(quiet.sigma)


def fused(heights: np.ndarray, sigmas: np.ndarray, correlation: np.ndarray):
    shape = heights.shape[1:]
    z, sigma, misfit = (np.empty(shape) for _ in range(3))
    members = np.zeros(shape, np.int64)
    used = np.array([0b00011, 0b00110, 0b11000][: len(heights)], np.int64)
    kernels.fuse(heights, sigmas, correlation, used, 4.0, 0.1, z, sigma, members, misfit)
    return z[0, 0], sigma[0, 0], int(members[0, 0]).bit_count(), misfit[0, 0]


def test_the_pairs_that_agree_make_the_height():
    heights = np.array([10.0, 10.2, 30.0]).reshape(3, 1, 1)
    z, sigma, count, misfit = fused(heights, np.full((3, 1, 1), 0.2), np.eye(3))
    assert z == pytest.approx(10.1)
    assert misfit == pytest.approx(0.5)
    assert sigma == pytest.approx(0.2 / np.sqrt(2.0))
    assert count == 3
    z, _, count, misfit = fused(np.array([np.nan, np.nan, 30.0]).reshape(3, 1, 1), np.full((3, 1, 1), 0.2), np.eye(3))
    assert (z, count) == (30.0, 2)
    assert np.isnan(misfit)
    z, sigma, count, _ = fused(np.full((3, 1, 1), np.nan), np.full((3, 1, 1), 0.2), np.eye(3))
    assert np.isnan(z)
    assert np.isnan(sigma)
    assert count == 0


def test_fused_heights_have_weights_and_correlations():
    sigmas = np.array([0.2, 0.5, 0.2]).reshape(3, 1, 1)
    correlation = np.eye(3) + np.diag([-0.5], 2) + np.diag([-0.5], -2)
    z, sigma, count, _ = fused(np.array([10.0, np.nan, 10.2]).reshape(3, 1, 1), sigmas, correlation)
    assert z == pytest.approx(10.1)
    assert sigma == pytest.approx(0.1)  # 0.2 · √((1 − 0.5) / 2)
    assert count == 4
    # of groups that weigh the same the higher one; otherwise the one that weighs more
    z, _, _, _ = fused(np.array([10.0, np.nan, 30.0]).reshape(3, 1, 1), sigmas, correlation)
    assert z == 30.0
    z, _, _, _ = fused(np.array([10.0, 30.0, np.nan]).reshape(3, 1, 1), sigmas, correlation)
    assert z == 10.0
    z, sigma, _, _ = fused(np.array([10.0, 10.3, np.nan]).reshape(3, 1, 1), sigmas, np.eye(3))
    assert z == pytest.approx((10.0 / 0.04 + 10.3 / 0.25) / (1.0 / 0.04 + 1.0 / 0.25))
    assert sigma == pytest.approx((1.0 / 0.04 + 1.0 / 0.25) ** -0.5)


@pytest.mark.parametrize("missing", [(0, 0), (0, 1), (1, 0), (1, 1)])
def test_three_known_pixels_of_four_are_a_triangle(missing):
    """Whichever is not known, or lies on another surface: cells on the side of the three have a height, no others."""
    at = 8.0 * np.arange(2)
    place = np.stack([*np.meshgrid(at, at), np.full((2, 2), 50.0)])
    away = np.abs(np.indices((9, 9)) - 8 * np.array(missing)[:, None, None]).sum(axis=0)
    for other in (np.nan, 5.0):
        value = np.zeros((2, 2), np.float32)
        value[missing] = other
        place[2][missing] = 90.0
        z, sigma = np.full((2, 9, 9), np.nan)
        kernels.lay_mesh(place, np.full((2, 2), 0.1, np.float32), np.ones((2, 2)), value, 1.5, z, sigma)
        np.testing.assert_array_equal(np.isfinite(z), away >= 8)
        assert z[away >= 8] == pytest.approx(50.0)
        assert sigma[away >= 8] == pytest.approx(0.1)


SCALE = CellScale(2, 1.0)


def by_step(z, noise, scale=SCALE, heights=None):
    """σ beside steps of a surface, by itself or with heights of pairs."""
    pairs = z[None] if heights is None else heights
    return step_sigma(z, noise, others_seen(z, pairs, np.full(pairs.shape, 0.05), scale), scale)


def test_sigma_beside_a_step_is_a_share_of_it():
    z = np.full((20, 30), 100.0) + 0.3 * np.arange(30)  # a slope is no step
    z[:, 15:] += 8.0
    noise = np.full(z.shape, 0.05)
    found = by_step(z, noise)
    assert (found[:, [14, 15]] > 6.0 * STEP_SHARE).all()
    assert found[:, [13, 16]] == pytest.approx(np.repeat(found[:, [14]], 2, axis=1), rel=0.1)
    assert (found[:, [*range(6, 10), *range(20, 24)]] == 0.0).all()
    assert (found[:, [*range(10, 13), *range(17, 20)]] < found[:, [14]] / 4.0).all()
    # down where the slope goes up, where heights by themselves differ by less than the step
    against = np.arange(30) + np.where(np.arange(30) < 15, 2.0, 0.0) + np.zeros((20, 1))
    assert (by_step(against, noise)[:, [14, 15]] > 1.2 * STEP_SHARE).all()
    assert (by_step(z, noise, CellScale(2, 20.0)) == 0.0).all()
    assert (by_step(z, np.full(z.shape, 3.0)) == 0.0).all()
    # several pairs do not all miss a long edge
    three = by_step(z, noise, heights=np.repeat(z[None], 3, axis=0))
    assert (three[4:-4] < 0.2 * found[4:-4].max()).all()


@pytest.mark.parametrize("pairs", [1, 3])
@pytest.mark.parametrize("height", [0.0, 0.3, 1.0, 4.0, 7.0, 7.8, 8.0])
def test_sigma_of_a_height_between_both_sides_is_its_distance_from_the_nearer(pairs, height):
    """Of cells along a straight step, up to a share of it; several pairs see them alike."""
    z = np.full((20, 30), 100.0) + np.where(np.arange(30) < 15, 0.0, 8.0)
    z[:, 15] = 100.0 + height
    found = by_step(z, np.full(z.shape, 0.02), heights=np.repeat(z[None], pairs, axis=0))[4:-4, 15]
    step, between = STEP_SHARE * 8.0 * (1.0 if pairs == 1 else STRAIGHT_COUNTS), min(height, 8.0 - height)
    # the mean of 9 cells is taken off: it changes by a ninth of the step from cell to cell
    least, most = (min(max(nearer, 0.0), 8.0 * BETWEEN_SHARE) for nearer in (between - 8.0 / 9.0, between))
    assert (found <= np.hypot(step, most) + 1e-3).all()
    assert (found >= 0.7 * np.hypot(step, least)).all()


@pytest.mark.parametrize("turned", [False, True])
def test_a_crooked_step_counts_where_several_pairs_agree(turned):
    rows, columns = np.mgrid[0:60, 0:60]
    noise = np.full(rows.shape, 0.05)
    straight = 100.0 + 4.0 * (columns > 30)
    round_about = 100.0 + 4.0 * (np.hypot(rows - 30, columns - 30) < 4.0)
    for z, least, most in ((straight, 0.0, 1.1 * STRAIGHT_COUNTS), (round_about, 0.8, 1.2)):
        z = z.T if turned else z
        found = by_step(z, noise, heights=np.repeat(z[None], 3, axis=0))[10:50, 10:50]
        beside = found[found > 0.1] if least else found
        assert least * 4.0 * STEP_SHARE <= np.median(beside) <= most * 4.0 * STEP_SHARE


def test_straightness_tells_one_direction_from_many():
    rows, columns = np.mgrid[0:80, 0:80]
    known = np.ones(rows.shape, bool)
    slope = (0.2 * rows + 0.1 * columns).astype(np.float32)
    assert straightness(slope, known, SCALE)[8:-8, 8:-8] == pytest.approx(0.0, abs=1e-3)
    step = slope + 5.0 * (columns > 40).astype(np.float32)
    assert (straightness(step, known, SCALE)[10:-10, 36:46] > 0.95).all()
    noise = np.random.default_rng(3).normal(size=rows.shape).astype(np.float32)
    assert np.median(straightness(noise, known, SCALE)) < 0.35
    assert (straightness(0.0 * slope, known, SCALE) == 0.0).all()
    # what is not known says nothing, however high it stands
    known[:, 20:23] = False
    step[:, 20:23] = 500.0
    assert straightness(step, known, SCALE)[10:-10, 10:30] == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize(("radius", "low", "high"), [(3.0, 0.8, 1.1), (7.0, 0.4, 0.9), (60.0, 0.0, 0.4)])
def test_the_share_of_a_step_falls_as_it_gets_straighter(radius, low, high):
    """Beside round objects that several pairs see: 1 is the share of a step in all directions."""
    rows, columns = np.mgrid[0:160, 0:160]
    far = np.hypot(rows - 80, columns - 80)
    z = 100.0 + 4.0 * (far < radius)
    found = by_step(z, np.full(z.shape, 0.05), heights=np.repeat(z[None], 3, axis=0)) / (4.0 * STEP_SHARE)
    assert low <= np.median(found[np.abs(far - radius) < 1.0]) <= high


def test_a_slope_beside_a_hole_is_no_straight_step():
    rows, columns = np.mgrid[0:60, 0:60]
    far = np.hypot(rows - 30, columns - 30)
    shares = []
    for slope in (0.0, 0.4):
        z = 100.0 + slope * columns + np.where(far < 5.0, 8.0, 0.0)
        z[(far >= 5.0) & (far < 8.0)] = np.nan
        found = by_step(z, np.full(z.shape, 0.05), heights=np.repeat(z[None], 2, axis=0))
        shares.append(float(np.median(found[(far > 8.0) & (far < 10.0) & (found > 0.0)])))
    # the slope over two windows, 3.2 m, is taken off what the hole may hide
    assert 0.6 * shares[0] < shares[1] < 1.05 * shares[0]


def test_a_hole_may_hide_a_step():
    z = np.full((20, 30), 100.0) + np.where(np.arange(30) < 15, 0.0, 8.0)
    z[:, 13:15] = np.nan
    noise = np.full(z.shape, 0.05)
    # few pairs: all that differs over two windows counts, of several no more than what need be there
    for pairs in (1, 2):
        few = by_step(z, noise, heights=np.repeat(z[None], pairs, axis=0))
        assert few[:, [11, 12, 15, 16]] == pytest.approx(8.0 * STEP_SHARE)
    three = by_step(z, noise, heights=np.repeat(z[None], 3, axis=0))
    assert three[4:-4, [11, 12, 15, 16]] == pytest.approx(0.5 * STEP_SHARE)
    # for a cell that one pair alone saw holes are looked for over two windows as well
    alone, both = (by_step(z, noise, heights=np.repeat(z[None], pairs, axis=0))[:, [9, 18]] for pairs in (1, 2))
    assert (alone > 0.0).all()
    assert (both == 0.0).all()
    # what one pair saw in the hole is a step as well
    pair = np.full(z.shape, np.nan)
    pair[:, 13:15] = 130.0
    assert (by_step(z, noise, heights=pair[None])[:, 12] > 29.0 * STEP_SHARE).all()


@pytest.mark.parametrize("pairs", [1, 2])
def test_noise_beside_a_hole_is_no_step(pairs):
    """It is in σ of the matching already."""
    z = 100.0 + np.random.default_rng(2).normal(scale=0.3, size=(40, 60))
    z[:, 30] = np.nan
    found = by_step(z, np.full(z.shape, 0.3), heights=np.repeat(z[None], pairs, axis=0))
    assert (found == 0.0).mean() > 0.99


@pytest.mark.parametrize("shape", [(1, 9), (9, 1), (1, 1), (9, 9)])
@pytest.mark.parametrize("height", [100.0, np.nan])
def test_few_cells_have_no_step(shape, height):
    assert (by_step(np.full(shape, height), np.full(shape, 0.05)) == 0.0).all()


@pytest.mark.parametrize("pairs", [1, 2, 3, 5])
def test_what_few_pairs_saw_may_lie_on_the_other_side(pairs):
    for step in (1.2, 8.0):
        z = np.full((20, 30), 100.0) + np.where(np.arange(30) < 15, 0.0, step)
        found = by_step(z, np.full(z.shape, 0.05), heights=np.repeat(z[None], pairs, axis=0))[4:-4, [14, 15]]
        share = STEP_SHARE * (1.0 if pairs < 3 else STRAIGHT_COUNTS)
        assert ((found >= 0.7 * share * step) & (found <= share * step + 1e-3)).all()  # their mean takes a part of it


def test_cells_at_the_edge_of_a_hole_have_a_larger_sigma():
    z = np.full((30, 40), 100.0)
    z[10:14, 20:25] = np.nan
    edge = at_edge(z)
    assert edge[9:15, 19:26].all()
    assert edge.sum() == 6 * 7
    noise = np.full(z.shape, 0.02)
    pairs = np.repeat(z[None], 3, axis=0)
    sigma = cell_sigma(z, noise, pairs, np.full(pairs.shape, 0.02), SCALE)
    more = np.sqrt(sigma**2 - sigma[0, 0] ** 2)
    assert more[edge & np.isfinite(z)] == pytest.approx(EDGE_PX * SCALE.pixel)
    assert more[~edge] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("lag", [1, 2, 4])
def test_roughness_is_the_noise_of_heights_on_a_plane(lag):
    rows, columns = np.mgrid[0:200, 0:200]
    z = 50.0 + 0.4 * columns - 0.2 * rows + np.random.default_rng(1).normal(scale=0.3, size=rows.shape)
    z[50:60, 20:90] = np.nan
    z[:, 100:] += 30.0  # a step is no roughness
    found = roughness(z, CellScale(lag, 1.0), np.full(z.shape, 5.0))
    assert np.sqrt(np.mean(found[70:190, 10:190] ** 2)) == pytest.approx(0.3, rel=0.05)
    assert np.isfinite(found).all()


def test_ground_that_is_evenly_curved_is_not_rough():
    rows, columns = np.mgrid[0:120, 0:120]
    bowl = 100.0 + 0.03 * (columns - 60.0) ** 2 - 0.02 * (rows - 60.0) ** 2
    step = np.full(bowl.shape, 5.0)
    noise = np.random.default_rng(1).normal(scale=0.02, size=bowl.shape)
    level, curved = (roughness(z + noise, SCALE, step) for z in (100.0, bowl))
    np.testing.assert_allclose(curved, level, atol=2e-5)
    assert np.sqrt(np.mean(roughness(bowl, SCALE, step) ** 2)) < 1e-4
    # across a step nothing is taken off: windows on both sides bend the heights
    stepped = bowl + np.where(columns < 60, 0.0, 12.0)
    by_curvature = np.sqrt(0.24**2 / 6.0 / 2.0)
    assert roughness(stepped, SCALE, step)[20:100, 56] == pytest.approx(by_curvature, rel=1e-3)
    assert (roughness(stepped, SCALE, step)[20:100, :50] < 1e-4).all()


def test_a_pair_far_from_the_surface_contradicts_it():
    z, one, other = (np.repeat([values], 6, axis=0).repeat(6, axis=1) for values in (
        [10.0, 10.0, np.nan], [10.1, 10.0, np.nan], [9.9, 18.0, 12.0]))  # fmt: skip
    heights = np.stack([one, other])
    sigmas = np.full(heights.shape, 0.1)
    seen = others_seen(z, heights, sigmas, SCALE)
    np.testing.assert_allclose(seen.highest[:, [2, 8, 14]], np.tile([10.0, 18.0, 12.0], (6, 1)))
    np.testing.assert_allclose(seen.lowest[:, [2, 8, 14]], np.tile([10.0, 10.0, 12.0], (6, 1)))
    np.testing.assert_array_equal(seen.agreeing[:, [2, 8, 14]], np.tile([2, 1, 0], (6, 1)))
    far = np.repeat(np.repeat(z, 4, axis=1), 4, axis=0)
    pairs = np.repeat(np.repeat(heights, 4, axis=2), 4, axis=1)
    sigma = cell_sigma(far, np.full(far.shape, 0.07), pairs, np.full(pairs.shape, 0.1), SCALE)
    assert (sigma[:, 30:40] > 1.0).all()
    assert (sigma[:, :15] < 0.1).all()


@pytest.mark.parametrize("cells", [1, 6, 9, 25])
def test_a_few_cells_that_a_pair_has_elsewhere_are_chance(cells):
    """Six cells of a window at most: what is larger is a surface that others do not see."""
    z = np.full((30, 30), 100.0)
    heights = np.stack([z, z])
    side = int(np.ceil(np.sqrt(cells)))
    for n in range(cells):
        heights[1, 14 + n // side, 14 + n % side] = 140.0
    found = by_step(z, np.full(z.shape, 0.05), heights=heights)
    assert (found > 5.0).any() == (cells > 6)


def test_a_slope_at_the_edge_is_no_step():
    """Where the surface ends one pair alone sees the cells: a slope there hides nothing."""
    rows, columns = np.mgrid[0:40, 0:40]
    z = 100.0 + 0.5 * columns + 0.3 * rows
    z[:, 25:] = np.nan
    assert by_step(z, np.full(z.shape, 0.05)).max() < 0.35 * STEP_SHARE * 6.4  # m over two windows


def test_pairs_that_share_a_photograph_share_its_noise(hill):
    place = place_at(hill.photographs(), np.array([0.0, 0.0, 100.0]), 300.0, 0.02)
    same_side, other_side = [Pair(0, 1, 9.0), Pair(0, 2, 18.0)], [Pair(0, 1, 9.0), Pair(1, 2, 9.0)]
    assert noise_correlation(place, same_side)[0, 1] == pytest.approx(0.5, abs=0.02)
    assert noise_correlation(place, other_side)[0, 1] == pytest.approx(-0.5, abs=0.02)
    apart = [Pair(0, 1, 9.0), Pair(2, 3, 9.0)]
    np.testing.assert_array_equal(noise_correlation(place, apart), np.eye(2))


def test_a_colour_is_that_of_the_place_in_its_photograph(hill, tmp_path):
    rows, columns = np.mgrid[:375, :575]
    tell = np.stack([100 * columns, 100 * rows, 0 * rows + 7]).astype(np.uint16)
    paths = []
    for path in hill.paths:
        paths.append(tmp_path / path.name)
        with create_image(paths[-1], 575, 375, 3, "uint16") as writer:
            writer.write(0, tell)
    photographs = hill.photographs()
    rng = np.random.default_rng(2)
    xyz = np.column_stack([rng.uniform(-40.0, 40.0, (50, 2)), rng.uniform(95.0, 105.0, 50)])
    shown_by = rng.integers(1, 3, 50)
    shown_by[0] = -1
    for cell, tolerance in ((1.0, 2.0), (4.0, 60.0)):  # the mean of four pixels lies half a pixel beside the middle one
        found = Colours(photographs, paths, cell).of(xyz, shown_by)
        for k in (1, 2):
            place = place_at(photographs, xyz.mean(axis=0), 100.0, 0.0)
            true = 100.0 * (place.project(k, place.from_crs(xyz)) - 0.5)
            np.testing.assert_allclose(found[shown_by == k, :2], true[shown_by == k], atol=tolerance)
            assert (found[shown_by == k, 2] == 7).all()
        assert (found[0] == 0).all()


def test_normals_of_a_plane_with_holes():
    grid = Grid(6, 7, 0.0, 12.0, 2.0, 2.0)
    x, y = np.meshgrid(grid.x(np.arange(7)), grid.y(np.arange(6)))
    z = 0.3 * x - 0.2 * y
    z[2, 3] = np.nan
    found = normals(z, grid)
    true = np.array([-0.3, 0.2, 1.0]) / np.linalg.norm([-0.3, 0.2, 1.0])
    assert np.isnan(found[2, 3]).all()
    np.testing.assert_allclose(found[np.isfinite(z)], np.tile(true, (41, 1)), atol=1e-12)
    alone = np.full((3, 3), np.nan)
    alone[1, 1] = 5.0
    np.testing.assert_array_equal(normals(alone, Grid(3, 3, 0.0, 3.0, 1.0, 1.0))[1, 1], [0.0, 0.0, 1.0])


def test_photographs_beyond_the_memory_allowed_are_read_again(tmp_path):
    rng = np.random.default_rng(5)
    pixels = [rng.integers(0, 255, (64, 96)).astype(np.uint8) for _ in range(3)]
    paths = [write_photograph(tmp_path / f"{k}.tif", p) for k, p in enumerate(pixels)]
    store = GreyStore(paths, [(96, 64)] * 3, most_bytes=2 * 64 * 96)
    for k in (0, 1, 0, 2, 1):
        np.testing.assert_array_equal(store.level(k, 0), pixels[k])
    assert store.reads == 4
    quarter = store.level(0, 1)
    np.testing.assert_allclose(quarter, pixels[0].reshape(32, 2, 48, 2).mean(axis=(1, 3)), atol=1.0)


def test_sixteen_bits_are_stretched_and_other_sizes_refused(tmp_path):
    grey = np.linspace(3000.0, 5000.0, 64 * 96).reshape(64, 96).astype(np.uint16)
    path = write_photograph(tmp_path / "a.tif", grey)
    found = GreyStore([path], [(96, 64)]).level(0, 0)
    assert found.min() == 0
    assert found.max() == 255
    with pytest.raises(InputError, match="its camera has 95"):
        GreyStore([path], [(95, 64)]).level(0, 0)


def test_holes_are_looked_for_between_the_heights_around_them():
    z = np.full((40, 40), 100.0)
    z[:, 20:] = 120.0
    z[15:25, 15:25] = np.nan
    grid = Grid(40, 40, 0.0, 40.0, 1.0, 1.0)
    found = range_of_surface(grid, z, 1.0)
    assert found.low[20, 20] <= 98.0
    assert found.high[20, 20] >= 122.0
    assert (found.low[5, 5], found.high[5, 5]) == (98.0, 102.0)


def test_photographs_that_show_nothing_alike_are_refused(hill, tmp_path):
    blank = [write_photograph(tmp_path / path.name, np.full((375, 575), 9000, np.uint16)) for path in hill.paths]
    with pytest.raises(InputError, match="no two photographs could be matched"):
        measure_surface(hill.calibration, DensePlan(np.arange(4), tuple(blank), tmp_path))


def test_one_more_pair_is_the_one_that_shows_the_holes():
    shows = np.zeros((3, 100))
    shows[0], shows[1, :60], shows[2, 50:] = 1.0, 0.9, 0.8
    candidates = [Candidate(Pair(0, n + 1, 12.0), row) for n, row in enumerate(shows)]
    holes = np.zeros(100)
    holes[55:75] = 0.5
    tried = [candidates[0].pair]
    found = pair_for_holes(candidates, tried, holes)
    assert found is not None
    assert found[0] == candidates[2].pair
    assert found[1] == pytest.approx(0.5 * 20 / 100)
    assert pair_for_holes(candidates, [c.pair for c in candidates], holes) is None
    assert pair_for_holes(candidates, tried, np.full(100, 0.001)) is None


@pytest.mark.parametrize("parallaxes_tried", [16, 64])
@pytest.mark.parametrize("blur", [0.0, 0.7])
def test_noise_that_matches_noise_does_not_count(monkeypatch, parallaxes_tried, blur):
    """Semi-global matching and least squares find matches in images of noise; the mean about them tells."""
    rng = np.random.default_rng(3)
    noise = rng.normal(0.0, 8.0, (2, 300, 400)).astype(np.float32)
    left, right = (100.0 + (gaussian_filter(n, blur) if blur else n) for n in noise)
    known = np.ones(left.shape, bool)
    images: Any = SimpleNamespace(
        left=left, right=right, left_known=known, right_known=known,
        geometry=SimpleNamespace(lowest=0, count=parallaxes_tried),
    )  # fmt: skip
    kept = np.isfinite(parallaxes_of(images).value).mean()
    monkeypatch.setattr(parallaxes, "LEAST_ALIKE", 0.0)
    without = np.isfinite(parallaxes_of(images).value).mean()
    assert kept < 0.001
    assert without > 0.03
