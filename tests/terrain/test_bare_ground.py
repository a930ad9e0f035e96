"""Ground of a dense surface: objects taken off, bridges with a σ that grows across them."""

import tracemalloc
from types import SimpleNamespace

import numpy as np
import pytest
from rendered_blocks import rendered_block
from scipy.ndimage import gaussian_filter

from aerotri.rasters.grids import Grid
from aerotri.terrain.dense import ground_blocks
from aerotri.terrain.dense.bare_ground import BRIDGED, BYTES_OF_BLOCK_CELL, BYTES_OF_CELL, MEASURED, bare_ground
from aerotri.terrain.dense.bridging import MOVED, bridge_law, bridged_heights, disc_errors
from aerotri.terrain.dense.measure import DensePlan, measure_surface
from aerotri.terrain.dense.tile_files import TileFiles, tile_windows
from aerotri.terrain.dense.tile_surface import TileSurface, rim_of
from aerotri.terrain.pickets import Area

SIDE, CELL, NOISE_M = 480, 0.25, 0.05


def outcome_of(folder, z, side=200):
    """What of a measured surface the filter looks at, in tiles."""
    grid = Grid(*z.shape, 500.0, 900.0, CELL, CELL)
    files, windows = TileFiles(folder, 0, side), tile_windows(grid, side)
    for w in windows:
        part = z[w.row : w.row + w.rows, w.column : w.column + w.columns]
        known = np.isfinite(part)
        sigma = np.where(known, NOISE_M, np.nan)
        empty = np.zeros((0, 2), int), np.zeros(0), np.nan, np.nan
        tile = TileSurface(part, sigma, known.astype(np.uint64), np.array([0]), 1.0, *empty, rim_of(part, 0))
        files.write(w, tile)
    return SimpleNamespace(grid=grid, files=files, windows=tuple(windows))


@pytest.fixture(scope="module")
def village(tmp_path_factory):
    """Rolling ground with houses, trees, cars' shadows as holes; truth, objects, surface and the ground found."""
    rng = np.random.default_rng(4)
    row, column = np.mgrid[:SIDE, :SIDE] * CELL
    ground = 50.0 + 0.05 * column + 40.0 * gaussian_filter(rng.normal(size=(SIDE, SIDE)), 30.0, mode="wrap")
    z, objects = ground.copy(), np.zeros((SIDE, SIDE), bool)
    for n in range(12):
        y, x = 8.0 + 30.0 * (n // 4) + rng.uniform(0, 5), 8.0 + 28.0 * (n % 4) + rng.uniform(0, 5)
        house = (np.abs(row - y) < 5.0) & (np.abs(column - x) < 6.0)
        z[house] = ground[house].max() + 4.0 + 0.4 * (5.0 - np.abs(row - y)[house])
        objects |= house
    for _ in range(25):
        away = np.hypot(row - rng.uniform(0, SIDE * CELL), column - rng.uniform(0, SIDE * CELL))
        tree = away < 2.5
        z[tree] = np.maximum(z, ground + 3.0 + 2.0 * np.sqrt(np.maximum(2.5**2 - away**2, 0.0)))[tree]
        objects |= tree
    z += rng.normal(scale=NOISE_M, size=z.shape)
    z[200:212, 100:130] = np.nan
    z[300, 310] -= 25.0
    found = bare_ground(outcome_of(tmp_path_factory.mktemp("tiles"), z), 18.0)
    parts = [np.zeros(z.shape), np.zeros(z.shape), np.zeros(z.shape, np.uint8)]
    for w, tile in found.tiles():
        for whole, part in zip(parts, (tile.z, tile.sigma, tile.source), strict=True):
            whole[w.row : w.row + w.rows, w.column : w.column + w.columns] = part
    return ground, objects, z, found, *parts


def test_the_ground_below_rendered_houses_is_bridged_within_its_sigma(tmp_path):
    houses = [[-60.0, -40.0, 22.0, 14.0, 8.0], [40.0, 30.0, 16.0, 16.0, 12.0], [-30.0, 50.0, 10.0, 20.0, 7.0]]
    trees = [[60.0 - 18.0 * n, -60.0 + 9.0 * n, 7.0, 7.0, 9.0] for n in range(4)]
    ground = {"kind": "undulating", "relief_rms_m": 2.0, "wavelength_m": 150.0, "houses": houses + trees}
    block = rendered_block(tmp_path / "block", **ground)
    (tmp_path / "tiles").mkdir()
    area = Area(np.array([-100.0, -90.0]), np.array([90.0, 90.0]))
    o = measure_surface(block.calibration, DensePlan(np.arange(4), block.paths, tmp_path / "tiles", area=area))
    found = bare_ground(o, 30.0)
    z, kept, taken = [], 0, 0
    for window, part in found.tiles():
        grid = o.grid.window(window.row, window.column, window.rows, window.columns)
        x, y = np.meshgrid(grid.x(np.arange(grid.columns)), grid.y(np.arange(grid.rows)))
        xy = np.column_stack([x.ravel(), y.ravel()])
        bare, top = (f(xy).reshape(x.shape) for f in (block.scene.terrain.ground, block.scene.terrain.height))
        house = top - bare > 2.0
        bridged = (part.source == BRIDGED) & house
        kept, taken = kept + int((house & (part.source == MEASURED)).sum()), taken + int(bridged.sum())
        z.append(((part.z - bare) / part.sigma)[bridged])
        off = (part.z - bare)[part.source == MEASURED]
        assert abs(np.median(off)) < 0.1
        assert (np.abs(off) > 1.0).mean() < 0.01
    assert kept <= 0.01 * taken
    assert taken > 150
    assert 0.3 < np.sqrt((np.concatenate(z) ** 2).mean()) < 1.6


def test_objects_are_taken_off_and_ground_stays_as_measured(village):
    ground, objects, z, _, height, sigma, source = village
    measured = source == MEASURED
    np.testing.assert_array_equal(height[measured], z[measured])
    np.testing.assert_allclose(sigma[measured], NOISE_M, rtol=1e-6)
    assert not (measured & objects).any()
    assert measured[~objects & np.isfinite(z)].mean() > 0.85
    assert np.abs(height - ground)[measured].max() < 6.0 * NOISE_M


def test_bridges_span_objects_and_holes_within_their_sigma(village):
    ground, objects, _, found, height, sigma, source = village
    bridged = source == BRIDGED
    inner = np.zeros_like(bridged)
    inner[40:-40, 40:-40] = True
    assert (bridged | (source == MEASURED))[inner].all()
    assert bridged[205, 115]
    error = (height - ground)[bridged & objects] / sigma[bridged & objects]
    assert 0.5 < np.sqrt((error**2).mean()) < 1.5
    assert found.law.discs > 30


def test_sigma_grows_across_a_bridge(village):
    _, _, _, found, _, sigma, source = village
    assert found.law.power >= 0.5
    away = found.law.sigma(np.array([1.0, 4.0]))
    assert away[1] > 1.9 * away[0] > 0.0
    assert sigma[source == BRIDGED].min() > NOISE_M
    assert np.quantile(sigma[source == BRIDGED], 0.9) > 1.5 * np.quantile(sigma[source == BRIDGED], 0.1)


def test_a_plane_is_bridged_exactly_and_nothing_beyond_it():
    row, column = np.mgrid[:20, :30].astype(float)
    z = 3.0 + 0.2 * row - 0.1 * column
    z[0] = np.nan
    z[8:14, 10:20] = np.nan
    found = bridged_heights(z)
    np.testing.assert_allclose(found[1:], (3.0 + 0.2 * row - 0.1 * column)[1:], atol=0.3 * MOVED)
    assert np.isnan(found[0]).all()


def law_of(z):
    return bridge_law([disc_errors(z, 1.0, 18.0)])


def test_the_law_follows_how_rough_the_ground_is():
    rng = np.random.default_rng(8)
    rough = gaussian_filter(rng.normal(size=(160, 160)), 1.0)
    smooth = gaussian_filter(rng.normal(size=(160, 160)), 12.0)
    of_rough, of_smooth = law_of(rough), law_of(smooth / smooth.std() * rough.std())
    assert of_smooth.at_1_m < 0.3 * of_rough.at_1_m
    assert of_smooth.power > of_rough.power
    assert law_of(3.0 * rough).at_1_m == pytest.approx(3.0 * of_rough.at_1_m)


def test_little_ground_has_the_slope_of_the_filter():
    z = np.full((12, 12), np.nan)
    z[:3] = 5.0
    law = law_of(z)
    assert (law.at_1_m, law.power) == (0.15, 1.0)


@pytest.fixture(scope="module")
def bay(tmp_path_factory):
    """Even ground with two houses and a hole; without heights a bay of 6 m that lone matches close, and a corner."""
    row, column = np.mgrid[:SIDE, :SIDE] * CELL
    z = 50.0 + 0.02 * column + 0.03 * row
    here = {
        "house": (np.abs(row - 60.0) < 5.0) & (np.abs(column - 70.0) < 6.0),
        "house beside": (np.abs(row - 20.0) < 4.0) & (column > 6.0) & (column < 14.0),
        "hole": np.hypot(row - 90.0, column - 60.0) < 3.0,
        "frame": column < 5.0,
        "bay": (np.abs(row - 60.0) < 3.0) & (column < 25.0),
        "corner": (row < 12.0) & (column > 100.0),
    }
    z[here["house"] | here["house beside"]] += 6.0
    z[here["hole"] | here["frame"] | here["bay"] | here["corner"]] = np.nan
    by_chance = here["bay"] & (np.abs(column - 10.0) < 0.3) & (row % 0.5 == 0.0)
    z[by_chance] = 50.0
    found = bare_ground(outcome_of(tmp_path_factory.mktemp("tiles"), z), 18.0)
    source = np.zeros(z.shape, np.uint8)
    for w, tile in found.tiles():
        source[w.row : w.row + w.rows, w.column : w.column + w.columns] = tile.source
    return z, here, source


def test_objects_and_holes_inside_are_bridged(bay):
    _, here, source = bay
    for name in ("house", "house beside", "hole"):
        assert (source[here[name]] == BRIDGED).mean() > 0.99, name


def test_nothing_is_bridged_beyond_the_outline(bay):
    z, here, source = bay
    for name in ("frame", "bay", "corner"):
        assert not source[here[name] & ~np.isfinite(z)].any(), name
    assert (source[np.isfinite(z)] != 0).mean() > 0.99


def test_a_ring_is_bridged_unless_it_leads_outside(tmp_path):
    """A ring without heights, with heights in it and around it; then a channel from it to the border."""
    z = np.full((160, 160), 50.0)
    row, column = np.mgrid[:160, :160] * CELL
    ring = np.hypot(row - 20.0, column - 20.0)
    z[(ring > 8.0) & (ring < 12.0)] = np.nan
    closed = bare_ground(outcome_of(tmp_path, z), 18.0)
    assert sum(int((tile.source == BRIDGED).sum()) for _, tile in closed.tiles()) > 3000
    z[(np.abs(row - 20.0) < 2.0) & (column > 28.0)] = np.nan
    open_ = bare_ground(outcome_of(tmp_path, z), 18.0)
    assert not sum(int((tile.source == BRIDGED).sum()) for _, tile in open_.tiles())


def strip(rng, shape):
    """Rolling ground with houses, trees and holes everywhere, but for a frame that is whole."""
    z = 50.0 + 40.0 * gaussian_filter(rng.normal(size=shape), 30.0, mode="wrap")
    row, column = np.mgrid[: shape[0], : shape[1]] * CELL
    high, wide = shape[0] * CELL, shape[1] * CELL
    for _ in range(shape[1] // 25):
        y, x = rng.uniform(9.0, high - 9.0), rng.uniform(9.0, wide - 9.0)
        z[(np.abs(row - y) < rng.uniform(2.0, 6.0)) & (np.abs(column - x) < rng.uniform(2.0, 6.0))] += 6.0
        y, x = rng.uniform(9.0, high - 9.0), rng.uniform(9.0, wide - 9.0)
        z[np.hypot(row - y, column - x) < rng.uniform(0.5, 4.0)] = np.nan
    return z + rng.normal(scale=NOISE_M, size=shape)


def test_the_ground_does_not_depend_on_how_it_is_divided(tmp_path, monkeypatch):
    o = outcome_of(tmp_path, strip(np.random.default_rng(12), (220, 1700)))
    whole = bare_ground(o, 18.0)
    assert len(set(whole.blocks.values())) == 1
    monkeypatch.setattr(ground_blocks, "BLOCK_CELLS", 47)
    divided = bare_ground(o, 18.0)
    blocks = set(divided.blocks.values())
    assert len(blocks) > 5
    assert max(block.wide.columns for block in blocks) < 0.6 * divided.grid.columns
    assert divided.law.discs == whole.law.discs > 30
    assert (divided.law.at_1_m, divided.law.power) == pytest.approx((whole.law.at_1_m, whole.law.power), rel=1e-5)
    bridged = 0
    for (window, one), (_, other) in zip(whole.tiles(), divided.tiles(), strict=True):
        np.testing.assert_array_equal(one.source, other.source)
        np.testing.assert_array_equal(whole.measured(window), divided.measured(window))
        np.testing.assert_allclose(one.z, other.z, rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(one.sigma, other.sigma, rtol=1e-5)
        bridged += int((one.source == BRIDGED).sum())
    assert bridged > 20_000


def test_a_way_from_outside_leads_through_all_blocks(tmp_path, monkeypatch):
    """A bay through the whole strip stays open, far from where it leads outside."""
    z = np.full((220, 1700), 50.0)
    z[100:124, 100:] = np.nan
    monkeypatch.setattr(ground_blocks, "BLOCK_CELLS", 100)
    found = bare_ground(outcome_of(tmp_path, z), 18.0)
    assert not any((tile.source == BRIDGED).any() for _, tile in found.tiles())
    z[100:124, 1600:] = 50.0
    closed = bare_ground(outcome_of(tmp_path, z), 18.0)
    bridged = sum(int((tile.source == BRIDGED).sum()) for _, tile in closed.tiles())
    assert bridged == 24 * 1500


def test_memory_is_what_is_foretold(tmp_path, monkeypatch):
    """A large area of coarse cells, of which hardly anything but one block is held."""
    z = np.tile(strip(np.random.default_rng(3), (480, 480))[::4, ::4], (4, 4))
    o = outcome_of(tmp_path, z, 50)
    o.grid = Grid(*z.shape, 0.0, 0.0, 1.0, 1.0)
    monkeypatch.setattr(ground_blocks, "BLOCK_CELLS", 100)
    tracemalloc.start()
    try:
        found = bare_ground(o, 6.0)
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    block = max(b.wide.rows * b.wide.columns for b in found.blocks.values())
    foretold = BYTES_OF_CELL * z.size + BYTES_OF_BLOCK_CELL * block
    assert most < foretold < 0.2 * BYTES_OF_BLOCK_CELL * z.size
