"""True orthophotos of rendered photographs against the ground that was rendered."""

import itertools
from dataclasses import replace

import cv2
import numpy as np
import pytest
from rendered_blocks import CAMERA, Rendered, rendered_block, write_photograph

from aerotri.conventions import px_from_mm
from aerotri.deformation.restitution import FREE, restitution_of
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.pipeline import adjust_keeping_system
from aerotri.rasters.bridging import BridgedReader
from aerotri.rasters.grids import Grid, RasterReader
from aerotri.rasters.held import HeldRaster
from aerotri.rasters.images import open_photograph
from aerotri.rasters.mosaics import read_mosaic
from aerotri.rasters.surface_files import write_surface
from aerotri.simulation import _rendering_kernels as rendering
from aerotri.simulation import parse_spec, simulate
from aerotri.simulation.projection import Rays, measured_rays, project
from aerotri.simulation.rendering import RenderOptions
from aerotri.terrain.adjustment_part import plan_covariances
from aerotri.terrain.ortho import _seam_kernels as kernels
from aerotri.terrain.ortho._sight_kernels import centres_for, is_hidden, look, place_of
from aerotri.terrain.ortho.accuracy import HeightSigma
from aerotri.terrain.ortho.candidates import Candidates
from aerotri.terrain.ortho.ground import ground_surface, tile_ground
from aerotri.terrain.ortho.make import make_orthophoto
from aerotri.terrain.ortho.settings import OrthoSettings
from aerotri.terrain.ortho.sharpness import blur_of, sharper_first
from aerotri.terrain.ortho.tile_files import OrthoTiles
from aerotri.terrain.ortho.tiles import Tile
from small_blocks import small_spec, with_adjustment

HOUSES = ((-30.0, -20.0, 24.0, 28.0, 25.0), (40.0, 15.0, 30.0, 20.0, 40.0))
QUIET = RenderOptions(noise=0.0, blur_px=0.0, detail_px=6.0)
LEVEL = {"attitude_sigma_deg": [0.0] * 3, "position_sigma_m": [0.0] * 3}


def nothing(stage: str, share: float) -> None:
    pass


def true_surface(made: Rendered, path, cell: float, half: float, sigma: float = 0.05):
    """The ground that was rendered, houses and all, as a raster about the origin."""
    count = int(2 * half / cell)
    grid = Grid(count, count, -half, half, cell, cell)
    x, y = np.meshgrid(grid.x(np.arange(count)), grid.y(np.arange(count)))
    z = made.scene.terrain.height(np.column_stack([x.ravel(), y.ravel()])).reshape(count, count)
    write_surface(path, z, np.full_like(z, sigma), grid, None, "Z, m")
    return path


def make(made: Rendered, surface, folder, rows=None, **settings):
    """Orthophoto of a rendered block; the outcome and its bands."""
    folder.mkdir()
    rows = np.arange(len(made.paths)) if rows is None else np.array(rows)
    with RasterReader(surface) as heights, RasterReader(surface, band=2) as sigma:
        chosen = rows, tuple(made.paths[k] for k in rows)
        found = make_orthophoto(
            made.calibration, chosen, heights, HeightSigma(sigma), OrthoSettings(**settings), folder, nothing
        )  # fmt: skip
    return found, read_mosaic(folder / "ortho.tif")


def truth(made: Rendered, grid: Grid) -> np.ndarray:
    """(rows, columns) grey values of the ground at the centres of cells."""
    x, y = np.meshgrid(grid.x(np.arange(grid.columns)), grid.y(np.arange(grid.rows)))
    places = np.stack([x, y], axis=-1)
    lattice = made.scene.texture.lattice(places.min(axis=(0, 1)), places.max(axis=(0, 1)))
    out = np.empty(x.shape, np.float32)
    rendering.texture_of_pixels(
        rendering.LatticeArrays(lattice.values, lattice.row, lattice.column, lattice.spacing),
        rendering.PixelPlaces(places, np.array([0, 0]), 1), (0, 0), out,
    )  # fmt: skip
    return made.scene.options.mean * (1.0 + made.scene.options.contrast * out)


def shift(shown: np.ndarray, true: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """(2,) cells to the right and down by which an image lies off the truth, by least squares on the slopes."""
    down, right = np.gradient(true)
    design = np.column_stack([right[inside], down[inside]])
    return -np.linalg.lstsq(design, (shown - true)[inside], rcond=None)[0]


def to_wall(grid: Grid) -> np.ndarray:
    """(rows, columns) m to the nearest wall, about."""
    x, y = np.meshgrid(grid.x(np.arange(grid.columns)), grid.y(np.arange(grid.rows)))
    return np.min([np.abs(np.maximum(abs(x - h[0]) - h[2] / 2, abs(y - h[1]) - h[3] / 2)) for h in HOUSES], axis=0)


@pytest.fixture(scope="module")
def town(tmp_path_factory):
    """Two high houses on flat ground, four photographs."""
    folder = tmp_path_factory.mktemp("town")
    made = rendered_block(folder / "photographs", None, QUIET, {"end_lap": 0.75}, kind="flat", houses=HOUSES)
    return made, true_surface(made, folder / "surface.tif", 1.0, 120.0), folder


@pytest.fixture(scope="module")
def hills(tmp_path_factory):
    """Hilly ground through a lens with errors."""
    folder = tmp_path_factory.mktemp("hills")
    made = rendered_block(folder / "photographs", {"brown": {"K1": -1.5e-6, "P1": 2e-6}}, QUIET)
    found = adjust_keeping_system(with_adjustment(made.block, additional_parameters=(("brown", ("K1", "P1")),)))
    made = replace(made, calibration=found)
    return made, true_surface(made, folder / "surface.tif", 2.0, 200.0), folder


def test_a_blurred_photograph_is_left_where_others_are_sharp(hills, tmp_path):
    made, surface, _ = hills
    blurred = list(made.paths)
    with open_photograph(made.paths[1]) as photograph:
        pixels = photograph.read(0, photograph.rows)[0]
    blurred[1] = write_photograph(tmp_path / made.paths[1].name, cv2.GaussianBlur(pixels, (0, 0), 3.0))
    sharp, _ = make(made, surface, tmp_path / "sharp")
    other, _ = make(replace(made, paths=tuple(blurred)), surface, tmp_path / "blurred")
    np.testing.assert_array_equal(sharp.blur, 1.0)
    assert other.blur[1] > 1.5
    np.testing.assert_array_equal(np.delete(other.blur, 1), 1.0)
    alone = (other.candidates.found == 1).any(axis=0) & ((other.candidates.found >= 0).sum(axis=0) == 1)
    assert other.choice.number[alone].size == 0 or (other.choice.number[alone] == 1).all()
    assert sharp.cells[1] > 0.15 * sharp.cells.sum()
    assert other.cells[1] < 0.2 * sharp.cells[1]
    assert other.cells.sum() == pytest.approx(sharp.cells.sum(), rel=0.01)


def test_detail_is_compared_where_two_show_the_same_ground(hills):
    """Of three photographs one shows half of the detail; ground with little detail does not make one blurred."""
    made, _, _ = hills
    photographs, shape = made.photographs(), (3, 20, 30)
    rng = np.random.default_rng(1)
    ground = np.where(np.arange(30) < 15, 1.0, 0.05) * np.exp(0.2 * rng.normal(size=(20, 30)))
    found = np.stack(
        [np.where(np.arange(30) < 15, 0, 2) + np.zeros((20, 1)), np.full((20, 30), 1), np.full((20, 30), 3)]
    )
    of = np.array([1.0, 1.0, 1.0, 0.5])
    none, found = np.zeros(shape, np.float32), found.astype(np.int32)
    detail = (ground * of[found]).astype(np.float32)
    c = Candidates(Grid(20, 30, 0.0, 20.0, 1.0, 1.0), 8, found, none, none, none, none[:, None], detail, none[0])
    np.testing.assert_array_equal(blur_of(photographs, c, 1.0 / of), 1.0)  # of half the exposure
    blur = blur_of(photographs, c, np.ones(4))
    np.testing.assert_array_equal(blur[:3], 1.0)
    assert blur[3] == pytest.approx(2.0, rel=0.05)
    better = sharper_first(replace(c, cost=np.arange(3.0)[::-1, None, None] * 0.1 + none), photographs, 1.0, blur)
    assert (better.found[2] == 3).all()  # it was the best one
    assert (np.diff(better.cost, axis=0) >= 0.0).all()


@pytest.mark.parametrize("cell", [3.0, 0.7])
def test_places_in_photographs_are_exact(hills, cell):
    """Of cells larger than those of the surface, and of smaller ones, which are bilinear between its centres."""
    made, surface, _ = hills
    photographs = made.photographs()
    with RasterReader(surface) as reader:
        ground = tile_ground(photographs, ground_surface(reader), Grid(40, 40, -60.0, 60.0, cell, cell), 0.01)
    assert ground is not None
    z = ground.cells.z + ground.site.place[2]
    x, y = np.meshgrid(ground.grid.x(np.arange(40)), ground.grid.y(np.arange(40)))
    xyz = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    looked = 0
    for k in ground.numbers.tolist():
        column, row = np.empty(z.shape, np.float32), np.empty(z.shape, np.float32)
        centres = centres_for(ground.obstacles)
        look(ground.view, k, ground.cells, ground.obstacles, np.ones(z.shape, bool), centres, column, row)
        index = np.arange(len(xyz))
        scene = made.scene
        ideal = project(scene.photographs, xyz, np.full(len(xyz), k), index)
        measured, _ = measured_rays(
            scene.photographs, xyz, Rays(np.full(len(xyz), k), index, ideal), scene.fields[k]
        )  # fmt: skip
        camera = scene.camera(k).nominal
        true = px_from_mm(measured, camera.size_px, camera.pixel_mm)
        seen = ~np.isnan(column).ravel()
        assert np.abs(np.column_stack([column.ravel(), row.ravel()]) - true)[seen].max(initial=0.0) < 0.02
        looked += int(seen.sum())
    assert looked > 1000


def test_what_is_seen_is_what_the_centres_around_see(town):
    """Cells between centres of the surface that agree have their answer; at the edges each is looked at by itself."""
    made, surface, _ = town
    photographs = made.photographs()
    with RasterReader(surface) as reader:
        ground = tile_ground(photographs, ground_surface(reader), Grid(300, 300, -60.0, 60.0, 0.4, 0.4), 0.01)
    assert ground is not None
    z = ground.cells.z
    for k in ground.numbers.tolist():
        column, row = np.empty(z.shape, np.float32), np.empty(z.shape, np.float32)
        look(ground.view, k, ground.cells, ground.obstacles, np.ones(z.shape, bool), centres_for(ground.obstacles),
             column, row)  # fmt: skip
        cx, cy, cz = ground.view.centres[k]
        seen, wrong, off = 0, 0, 0.0
        for i, j in np.ndindex(*z.shape):
            x, y = ground.cells.origin + 0.4 * np.array([j, -i])
            a, b = place_of(ground.view, k, x, y, float(z[i, j]))
            hidden = np.isnan(a) or is_hidden(ground.obstacles, x, y, float(z[i, j]), cx, cy, cz)
            seen += not hidden
            wrong += bool(hidden) != bool(np.isnan(column[i, j]))
            if not hidden and not np.isnan(column[i, j]):
                off = max(off, abs(column[i, j] - a), abs(row[i, j] - b))
        assert off < 0.02
        # slivers of shadow between centres that see, and of light between those that do not
        assert wrong < 2e-3 * max(seen, 1)


def test_a_level_photograph_of_flat_ground_is_its_orthophoto(tmp_path):
    made = rendered_block(tmp_path / "photographs", None, QUIET, LEVEL, kind="flat")
    surface = true_surface(made, tmp_path / "surface.tif", 2.0, 300.0)
    found, bands = make(made, surface, tmp_path / "ortho", rows=[1], cell=1.0, edge=0.0, resampling="bilinear")
    pixels = read_mosaic(made.paths[1])[0].astype(float)
    grey = truth(made, found.grid)
    inside = bands[1] > 0
    assert inside.sum() > 0.9 * pixels.size * (found.gsd / 1.0) ** 2
    # bilinear between pixels of a texture whose finest detail has six of them
    assert np.abs(shift(bands[0].astype(float), grey, inside)).max() < 0.02
    assert np.abs(bands[0].astype(float) - grey)[inside].max() < 0.04 * made.scene.options.mean


def test_every_cell_shows_its_own_ground(hills, tmp_path):
    made, surface, _ = hills
    found, bands = make(made, surface, tmp_path / "ortho", cell=1.0, balance=False)
    grey, inside = truth(made, found.grid), bands[1] > 0
    difference = bands[0].astype(float) - grey
    for k in np.flatnonzero(found.cells > 1000):
        own = read_mosaic(tmp_path / "ortho" / "photographs.tif")[0] == k
        assert np.abs(shift(bands[0].astype(float), grey, own)).max() < 0.05
    spread = made.scene.options.mean * made.scene.options.contrast
    assert np.sqrt(np.mean(difference[inside] ** 2)) < 0.05 * spread
    assert set(np.unique(read_mosaic(tmp_path / "ortho" / "photographs.tif")[0][inside])) == set(
        np.flatnonzero(found.cells)
    )
    assert found.cells.sum() == inside.sum()


def test_hidden_ground_is_taken_from_another_photograph(town, tmp_path):
    made, surface, _ = town
    found, bands = make(made, surface, tmp_path / "ortho", cell=1.0, balance=False)
    grid, inside = found.grid, bands[1] > 0
    difference = np.abs(bands[0].astype(float) - truth(made, grid))
    clear = inside & (to_wall(grid) > 2.5)
    spread = made.scene.options.mean * made.scene.options.contrast
    assert found.hidden > 20
    # a roof that is mapped twice differs by the contrast of the texture
    assert np.quantile(difference[clear], 0.999) < 0.35 * spread
    number = read_mosaic(tmp_path / "ortho" / "photographs.tif")[0]
    assert (number[~inside] == -1).all()
    # with one photograph alone, what houses hide stays empty
    alone, mask = make(made, surface, tmp_path / "alone", rows=[1], cell=1.0)
    assert alone.heights - alone.cells.sum() > 100
    shown = np.abs(mask[0].astype(float) - truth(made, alone.grid))
    assert np.quantile(shown[(mask[1] > 0) & (to_wall(alone.grid) > 2.5)], 0.999) < 0.35 * spread


def test_gains_and_offsets_are_found(town, tmp_path):
    made, surface, _ = town
    gain, offset = np.array([0.8, 1.1, 1.25, 0.95]), np.array([900.0, -400.0, 0.0, 600.0])
    (tmp_path / "changed").mkdir()
    changed = tuple(
        write_photograph(tmp_path / "changed" / path.name, np.round(read_mosaic(path)[0] * g + o).astype(np.uint16))
        for path, g, o in zip(made.paths, gain, offset, strict=True)
    )
    found, _ = make(replace(made, paths=changed), surface, tmp_path / "ortho", cell=1.0)
    # c = (c' − o)/g, known up to one gain and one offset for all
    ratio = found.balance.gain[:, 0] * gain
    np.testing.assert_allclose(ratio / ratio.mean(), 1.0, atol=0.02)
    shifted = found.balance.offset[:, 0] * 65535.0 + found.balance.gain[:, 0] * offset
    assert np.ptp(shifted) < 0.02 * made.scene.options.mean
    assert found.balance.after < 0.2 * found.balance.before
    np.testing.assert_array_equal(found.blur, 1.0)


def test_narrow_holes_are_bridged_for_the_picture(hills, tmp_path):
    """A hole of 12 m is shown where 15 m may be bridged, and marked; one of 40 m stays, and so does the border."""
    made = hills[0]
    surface = true_surface(made, tmp_path / "surface.tif", 2.0, 90.0)
    with RasterReader(surface) as heights, RasterReader(surface, band=2) as sigma:
        grid = heights.grid
        z, s = heights.read(0, 0, 90, 90), sigma.read(0, 0, 90, 90)
    narrow, wide = np.s_[30:36, 60:66], np.s_[50:70, 15:35]
    z[narrow] = z[wide] = z[:5] = np.nan
    write_surface(tmp_path / "holes.tif", z, np.where(np.isnan(z), np.nan, s), grid, None, "Z, m")
    without, _ = make(made, tmp_path / "holes.tif", tmp_path / "without", cell=2.0)
    found, bands = make(made, tmp_path / "holes.tif", tmp_path / "with", cell=2.0, fill=15.0)
    assert without.bridged == 0
    # the 36 cells of the hole, and corners of the wide one and of the border that the disc does not reach
    assert 36 <= found.bridged <= 60
    assert found.heights >= without.heights + found.bridged
    numbers = read_mosaic(tmp_path / "with" / "photographs.tif")
    assert int(numbers[1].sum()) == found.bridged
    at_narrow, at_wide = ((int(found.grid.row(y)), int(found.grid.column(x))) for x, y in
                          ((grid.x(62.5), grid.y(32.5)), (grid.x(25), grid.y(60))))  # fmt: skip
    assert (bands[-1][at_narrow] > 0, numbers[1][at_narrow]) == (True, 1)
    assert (bands[-1][at_wide] > 0, numbers[1][at_wide]) == (False, 0)
    assert read_mosaic(tmp_path / "without" / "photographs.tif").shape[0] == 1


def test_bridges_are_the_same_in_every_window():
    """Read as a whole or in parts; heights between those around; nothing beyond the border of what was measured."""
    rng = np.random.default_rng(4)
    z = rng.normal(1000.0, 3.0, (80, 90)).astype(np.float32)
    z[rng.random(z.shape) < 0.3] = np.nan
    z[20:60, 30:70] = np.nan
    z[:, :6] = np.nan
    reader = BridgedReader(HeldRaster(z, Grid(80, 90, 0.0, 80.0, 1.0, 1.0), None, "z"), 6.0)
    whole = reader.read(0, 0, 80, 90)
    for row, column in ((0, 0), (13, 27), (40, 50)):
        np.testing.assert_allclose(
            reader.read(row, column, 30, 40), whole[row : row + 30, column : column + 40], rtol=0.0, atol=1e-3
        )
    np.testing.assert_array_equal(whole[np.isfinite(z)], z[np.isfinite(z)])
    made = np.isfinite(whole) & np.isnan(z)
    assert made.sum() > 1000
    assert np.isnan(whole[30:50, 40:60]).all()
    assert np.isnan(whole[:, :3]).all()
    assert np.nanmin(z) <= whole[made].min() < whole[made].max() <= np.nanmax(z)


@pytest.mark.parametrize("bridged", [None, np.eye(3, 4, dtype=bool)])
def test_no_damage_of_a_kept_tile_outlives_the_next_run(tmp_path, bridged):
    """Whatever byte is wrong, the tile counts as not there, or is what it was; one with nothing in it, too."""
    rng, files = np.random.default_rng(2), OrthoTiles(tmp_path)
    tile = Tile(0, 4, rng.integers(0, 255, (2, 3, 4)).astype(np.uint8), np.eye(3, 4, dtype=np.int32), 7, 1, bridged)
    files.write(0, 4, tile)
    files.write(3, 4, None)
    for row, wanted in ((0, tile), (3, None)):
        whole = files.path(row, 4).read_bytes()
        refused = 0
        for place in range(len(whole)):
            files.path(row, 4).write_bytes(whole[:place] + bytes([whole[place] ^ 0x11]) + whole[place + 1 :])
            there, read = files.read(row, 4, (3, 4))
            refused += not there
            assert not there or (read is None) == (wanted is None)
            if read is not None:
                np.testing.assert_array_equal(read.colours, tile.colours)
                np.testing.assert_array_equal(read.number, tile.number)
                np.testing.assert_array_equal(read.bridged, bridged)
                assert (read.heights, read.hidden) == (7, 1)
        assert refused > 0.5 * len(whole)


def test_seams_have_nearly_the_smallest_energy():
    rng = np.random.default_rng(4)
    gaps = []
    for _ in range(20):
        found = np.broadcast_to(np.arange(2, dtype=np.int32)[:, None, None], (2, 3, 4)).copy()
        value = rng.uniform(0.0, 3.0, (2, 1, 3, 4)).astype(np.float32)
        unary = np.ascontiguousarray(rng.uniform(0.0, 1.0, (3, 4, 2)).astype(np.float32))
        right, below = np.empty((3, 4, 2, 2), np.float32), np.empty((3, 4, 2, 2), np.float32)
        difference = np.empty((3, 4, 2, 2), np.float32)
        kernels.differences(found, value, np.float32(5.0), difference)
        kernels.seam_costs(
            np.ascontiguousarray(np.moveaxis(found, 0, -1)), difference, np.float32(5.0), np.float32(0.05), right, below
        )
        messages, label = np.zeros((4, 3, 4, 2), np.float32), np.zeros((3, 4), np.int32)
        for _ in range(12):
            for backwards in (False, True):
                kernels.pass_messages(unary, right, below, messages, backwards)
        kernels.decide(unary, right, below, messages, label)
        everything = (np.array(bits, np.int32).reshape(3, 4) for bits in itertools.product((0, 1), repeat=12))
        least = min(sum(kernels.energy(unary, right, below, one)) for one in everything)
        gaps.append(sum(kernels.energy(unary, right, below, label)) / least - 1.0)
    assert min(gaps) > -1e-6
    assert np.mean(np.array(gaps) < 1e-5) >= 0.9
    assert max(gaps) < 0.1


def test_costs_of_seams_are_differences_of_the_two_photographs():
    """Against the definition, with lists of photographs that differ from cell to cell and end early."""
    rng = np.random.default_rng(7)
    count, rows, columns, most, least = 3, 4, 5, np.float32(0.8), np.float32(0.05)
    found = np.argsort(rng.random((5, rows, columns)), axis=0)[:count].astype(np.int32)
    found[1:, 0, 1], found[2, 2, 2], found[:, 3, 3] = -1, -1, -1
    value = rng.uniform(0.0, 1.0, (count, 2, rows, columns)).astype(np.float32)
    difference = np.empty((rows, columns, count, count), np.float32)
    kernels.differences(found, value, most, difference)
    right, below = (np.empty((rows, columns, count, count), np.float32) for _ in range(2))
    kernels.seam_costs(np.ascontiguousarray(np.moveaxis(found, 0, -1)), difference, most, least, right, below)

    def at(i, j, one, other):
        lists = found[:, i, j].tolist()
        if one not in lists or other not in lists:
            return most
        return min(np.abs(value[lists.index(one), :, i, j] - value[lists.index(other), :, i, j]).mean(), most)

    for i, j in itertools.product(range(rows), range(columns)):
        for (k, m), cost in (((i, j + 1), right), ((i + 1, j), below)):
            if k == rows or m == columns:
                continue
            for a, b in itertools.product(range(count), repeat=2):
                one, other = int(found[a, i, j]), int(found[b, k, m])
                none = one == other or one < 0 or other < 0
                wanted = 0.0 if none else least + 0.5 * (at(i, j, one, other) + at(k, m, one, other))
                assert cost[i, j, a, b] == pytest.approx(wanted, abs=1e-6)


def test_seams_go_around_what_differs(town, tmp_path):
    made, surface, _ = town
    found, _ = make(made, surface, tmp_path / "seams", cell=1.0, balance=False)
    assert found.choice.seam <= found.choice.seam_of_best
    plain, _ = make(made, surface, tmp_path / "plain", cell=1.0, balance=False, seams=False)
    assert plain.choice.seam == plain.choice.seam_of_best
    np.testing.assert_array_equal(plain.choice.number, plain.candidates.found[0])


def test_plan_position_is_as_good_as_stated():
    """Errors of places that one photograph and a known height give, over their σ, in six adjustments."""
    normalised = []
    for seed in range(6):
        tables = small_spec(camera={"cam": CAMERA})
        tables["flight"] = tables["flight"] | {"gsd_m": 1.0, "strips": 2, "images_per_strip": 4, "cross_strips": []}
        tables["tie_points"] = {"per_image": 60, "probability": 0.9, "sigma_um": 90.0}
        tables["control"] = {"distance_bases": 2.0, "sigma_m": [0.1] * 3}
        block, made = simulate(parse_spec(tables), seed)
        calibration = adjust_keeping_system(block)
        restitution = restitution_of(calibration, FREE)
        for image in range(0, len(block.images), 3):
            # the true ray through the middle of the photograph, met at the true height
            true, used = _ray(made.centre[image], _rotation(block, made.angles[image])), restitution.true
            place = true(20.0)
            found = _ray(used.centre[image], used.rotation[image])(20.0)
            covariance = plan_covariances(
                calibration, restitution, np.arange(len(block.images)), place[None], np.array([image])
            )[0]  # fmt: skip
            normalised.append((found - place)[:2] / np.sqrt(np.diagonal(covariance)))
    assert 0.6 < np.sqrt(np.mean(np.square(normalised))) < 1.5


def _rotation(block, angles):
    return rotation_from_angles(angles[None], block.rotation)[0]


def _ray(centre, rotation):
    direction = -rotation[:, 2]
    return lambda height: centre + direction * (height - centre[2]) / direction[2]
