"""Volumes and changes of the ground of a dense surface: measured cells as in the surface, bridges err as a whole."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import shapely

import aerotri
from aerotri.public.cell_noise import noise_of_dense
from aerotri.rasters.grids import RasterReader
from aerotri.rasters.surface_files import write_raster_parts, write_surface_parts
from aerotri.terrain.dense.bare_ground import BRIDGED, MEASURED
from aerotri.terrain.dense.tile_files import TileWindow
from small_blocks import adjusted_place

CELL, COUNT, NOISE, LENGTH, ADJUSTMENT, BRIDGE = 2.0, 120, 0.04, 7.0, 0.2, 0.3
HOUSES = ((20, 30, 40, 60), (20, 90, 30, 100), (80, 30, 100, 50))
"""First row and column, last row and column of the objects."""


def write_dense(folder, grid, surface, ground, houses):
    """As `aerotri dsm --ground` writes them."""
    folder.mkdir(parents=True)
    tags = {"NOISE_LENGTH_M": f"{LENGTH}"}
    source = np.full(surface.shape, MEASURED, np.uint8)
    own = np.full(surface.shape, NOISE)
    for top, left, bottom, right in houses:
        source[top:bottom, left:right] = BRIDGED
        own[top:bottom, left:right] = BRIDGE
    total = np.full(surface.shape, np.hypot(NOISE, ADJUSTMENT))
    write_surface_parts(folder / "dsm.tif", [(0, 0, surface, total)], grid, None, "DSM Z, m", tags)
    parts = [(0, 0, ground, np.hypot(own, ADJUSTMENT))]
    write_surface_parts(folder / "dtm.tif", parts, grid, None, "DTM Z, m", tags)
    for name, values, kind, hole in (
        ("matching.tif", np.full(surface.shape, NOISE), np.dtype("f4"), -9999.0),
        ("ground.tif", source, np.dtype("u1"), 0.0),
    ):
        write_raster_parts(folder / name, [(0, 0, values)], grid, None, name, kind, hole)


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """Houses on rolling ground, the same without any, and the result they were measured in."""
    folder = tmp_path_factory.mktemp("ground")
    grid, _, x, y = adjusted_place(folder, CELL, COUNT)
    ground = 100.0 + 0.02 * x + np.sin(x / 20.0) * np.cos(y / 20.0)
    surface = ground.copy()
    for top, left, bottom, right in HOUSES:
        surface[top:bottom, left:right] += 8.0
    write_dense(folder / "houses", grid, surface, ground, HOUSES)
    write_dense(folder / "bare", grid, ground, ground, ())
    return SimpleNamespace(folder=folder, grid=grid, whole=shapely.box(*grid.between_centres().bounds))


def rows(grid, top, left, bottom, right):
    """The polygon of cells."""
    west, north = grid.left + left * grid.cell_x, grid.top - top * grid.cell_y
    return shapely.box(west, grid.top - bottom * grid.cell_y, grid.left + right * grid.cell_x, north)


def parts(place, name, boundary, **settings):
    found = aerotri.volume(
        place.folder / name, boundary, adjustment=place.folder / "result", **({"base": "level:90"} | settings)
    )
    return found.summary["sigma"]["parts_m3"], found


def test_measured_ground_has_the_noise_of_the_surface(place):
    """Where nothing stands, ground and surface are the same cells."""
    of_surface, one = parts(place, "bare", place.whole)
    of_ground, other = parts(place, "bare", place.whole, layer="dtm")
    assert one.net == other.net
    assert "bridged" not in of_surface
    assert of_ground.pop("bridged") == 0.0
    assert of_ground == of_surface
    # σ·length·√area, as for cells of one σ that share it over a length
    assert of_ground["matching"] == pytest.approx(NOISE * LENGTH * np.sqrt(place.whole.area), rel=0.02)


def test_a_bridge_errs_as_a_whole_and_bridges_apart_from_one_another(place):
    areas = np.array([(bottom - top) * (right - left) * CELL**2 for top, left, bottom, right in HOUSES])
    bare = parts(place, "bare", place.whole, layer="dtm")[0]
    found = parts(place, "houses", place.whole, layer="dtm")[0]
    # without what the adjustment adds, which is a part of its own
    assert found["bridged"] == pytest.approx(BRIDGE * np.linalg.norm(areas), rel=1e-4)
    assert found["adjustment"] == pytest.approx(bare["adjustment"], rel=0.02)
    measured = 1.0 - areas.sum() / place.whole.area
    assert found["matching"] / bare["matching"] == pytest.approx(np.sqrt(measured), rel=0.01)
    # on a house alone nothing was measured
    inside = rows(place.grid, 22, 32, 38, 58)
    alone = parts(place, "houses", inside, layer="dtm")[0]
    assert alone["matching"] == 0.0
    assert alone["bridged"] == pytest.approx(BRIDGE * inside.area, rel=1e-4)
    # a stated σ of matching says nothing of bridges
    assert parts(place, "houses", inside, layer="dtm", matching_sigma_um=5.0)[0]["bridged"] == alone["bridged"]


def test_a_patch_that_reaches_into_two_piles_errs_in_both(place):
    west, east = rows(place.grid, 22, 32, 38, 45), rows(place.grid, 22, 47, 38, 58)
    other = rows(place.grid, 22, 92, 28, 98)
    one = parts(place, "houses", {"west": west, "east": east}, layer="dtm")[1]
    each = [pile["parts_m3"]["bridged"] for pile in one.summary["piles"]]
    assert one.summary["sigma"]["parts_m3"]["bridged"] == pytest.approx(sum(each), rel=1e-9)
    apart = parts(place, "houses", {"west": west, "other": other}, layer="dtm")[1]
    each = [pile["parts_m3"]["bridged"] for pile in apart.summary["piles"]]
    assert apart.summary["sigma"]["parts_m3"]["bridged"] == pytest.approx(np.linalg.norm(each), rel=1e-9)


def test_houses_over_their_own_ground_are_as_sure_as_its_bridges(place):
    """The surface less its ground: measured cells are the same in both, what is bridged is not."""
    result = place.folder / "result"
    measured = {"adjustment": result, "base": place.folder / "houses" / "dtm.tif", "base_adjustment": result}
    found = aerotri.volume(place.folder / "houses", place.whole, **measured)
    areas = np.array([(bottom - top) * (right - left) * CELL**2 for top, left, bottom, right in HOUSES])
    assert found.net == pytest.approx(8.0 * areas.sum(), rel=0.1)
    assert found.summary["sigma"]["parts_m3"]["bridged"] == pytest.approx(BRIDGE * np.linalg.norm(areas), rel=1e-4)
    same = aerotri.volume(place.folder / "houses", place.whole, layer="dtm", **measured)
    assert same.summary["sigma"]["parts_m3"]["bridged"] == 0.0


def test_cut_and_fill_of_bridged_ground_are_no_surer_than_its_bridges(place):
    """Over a level through the ground of a bridge an error moves the line between cut and fill, too."""
    inside = rows(place.grid, 22, 32, 38, 58)
    found = parts(place, "houses", inside, layer="dtm", base="level:100.05")[1]
    cut, fill = (found.summary["sigma"][side]["parts_m3"] for side in ("cut", "fill"))
    net = found.summary["sigma"]["parts_m3"]
    assert min(found.cut, found.fill) > 0.0
    # each cell lies on either side by its probability
    assert cut["bridged"] + fill["bridged"] == pytest.approx(net["bridged"], rel=0.02)
    assert cut["zero_line"] > 0.05 * net["bridged"]


def test_a_change_of_ground_sums_bridges_as_a_whole(place):
    """Two epochs of one kind: noise of measured cells averages out, what is bridged does not."""
    first, second = place.folder / "bare" / "dtm.tif", place.folder / "houses" / "dtm.tif"
    found = aerotri.change(first, second)
    areas = np.array([(bottom - top) * (right - left) * CELL**2 for top, left, bottom, right in HOUSES])
    net = found.summary["volumes"][-1]["parts_net_m3"]
    assert net["bridged"] == pytest.approx(BRIDGE * np.linalg.norm(areas), rel=1e-4)
    measured = place.grid.rows * place.grid.columns * CELL**2
    both = NOISE**2 * (2.0 * measured - areas.sum())
    assert net["noise"] == pytest.approx(np.sqrt(both) * LENGTH, rel=0.05)
    # and in single cells it is in the level of detection
    with RasterReader(first) as reader:
        assert reader.grid == place.grid
    sigma = found.record.sigma[30, 40]
    assert sigma == pytest.approx(np.sqrt(BRIDGE**2 + NOISE**2 + 2.0 * ADJUSTMENT**2), rel=0.01)


def test_ground_in_memory_is_that_of_its_files(place):
    """The tiles of a surface in memory say the same of their cells."""
    bridged = np.zeros((COUNT, COUNT), bool)
    for top, left, bottom, right in HOUSES:
        bridged[top:bottom, left:right] = True
    window = TileWindow(0, 0, COUNT, COUNT)
    surface = SimpleNamespace(sigma=np.full(bridged.shape, NOISE), count=np.full(bridged.shape, 3.0))
    ground = SimpleNamespace(
        sigma=np.where(bridged, BRIDGE, NOISE), source=np.where(bridged, BRIDGED, MEASURED).astype(np.uint8)
    )
    dense = SimpleNamespace(
        record=SimpleNamespace(grid=place.grid, windows=(window,),
                               files=SimpleNamespace(read_all=lambda _: iter([(window, surface)]))),
        summary={"noise_length_m": LENGTH, "matching_shared": {"sigma_Z_m": 0.0, "length_m": 0.0}},
        ground=SimpleNamespace(tiles=lambda: iter([(window, ground)])),
    )  # fmt: skip
    everything = (0, 0, COUNT, COUNT)
    plain = noise_of_dense(dense)
    assert plain.bridges is None
    assert (plain.sigma.read(*everything) == np.float32(NOISE)).all()
    found = noise_of_dense(dense, "dtm")
    np.testing.assert_array_equal(found.sigma.read(*everything), np.where(bridged, 0.0, NOISE).astype(np.float32))
    assert found.bridges.patches.max() == len(HOUSES)
    np.testing.assert_array_equal(found.bridges.patches > 0, bridged)
    weight = np.full(bridged.shape, CELL**2)
    areas = np.array([(bottom - top) * (right - left) * CELL**2 for top, left, bottom, right in HOUSES])
    errors = found.bridges.errors(everything, weight)
    assert errors[0] == 0.0
    np.testing.assert_allclose(np.sort(errors[1:]), np.sort(BRIDGE * areas), rtol=1e-6)
