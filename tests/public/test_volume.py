"""Volumes from Python: against a known body, and the same numbers from memory as from files."""

from __future__ import annotations

import inspect
import json
from dataclasses import replace
from importlib.resources import files

import jsonschema
import numpy as np
import pytest
import shapely
from matplotlib.figure import Figure

import aerotri
from aerotri import InputError

RADIUS, HEIGHT = 40.0, 10.0
PILE = shapely.Point(0.0, 0.0).buffer(60.0, quad_segs=64)


@pytest.fixture(scope="module")
def cone():
    """A cone of 40 m radius and 10 m height on a level of 100 m."""
    at = np.arange(-79.5, 80.0)
    z = 100.0 + HEIGHT * np.maximum(1.0 - np.hypot(at[None, :], at[::-1, None]) / RADIUS, 0.0)
    return aerotri.Surface.of_array(z, left=-80.0, top=80.0, cell=1.0, name="cone")


def test_a_cone(cone):
    found = aerotri.volume(cone, PILE, base=100.0)
    true = np.pi * RADIUS**2 * HEIGHT / 3.0
    assert found.net == pytest.approx(true, rel=2e-3)
    assert found.net == pytest.approx(found.cut - found.fill)
    assert found.area == pytest.approx(PILE.area)
    np.testing.assert_allclose(found.methods["net_m3"], true, rtol=5e-3)
    assert np.nanmax(found.thickness.z) == pytest.approx(HEIGHT, abs=0.3)
    # areas of the sections times their distance are the volume: the trapezoidal rule
    areas, stations = found.sections["cut_area_m2"], found.sections["station_m"]
    assert np.trapezoid(areas, stations) == pytest.approx(true, rel=5e-3)
    assert found.sigma is None
    for missing in (lambda: found.parts, found.plot.budget):
        with pytest.raises(InputError, match="has no σ"):
            missing()


@pytest.mark.parametrize("base", ["level:100", "plane:0,0,100;9,0,100;0,9,100", "lowest", "plane", "boundary", 100])
def test_bases_of_a_level(cone, base):
    assert aerotri.volume(cone, PILE, base=base).net == pytest.approx(np.pi * RADIUS**2 * HEIGHT / 3.0, rel=3e-3)


def test_the_folder_of_a_terrain_model(measured):
    """With its pickets, as the model in memory; with objects, or the ground alone where that is asked for."""
    _, result, model, folder = measured
    grid = model.dsm.grid
    left, bottom, right, top = grid.bounds
    middle = shapely.box(left, bottom, right, top).centroid.buffer(0.2 * min(right - left, top - bottom))
    held = aerotri.volume(model, middle, base="lowest", adjustment=result)
    read = aerotri.volume(folder, middle, base="lowest", adjustment=result)
    assert read.net == pytest.approx(held.net, rel=1e-6)
    assert read.sigma == pytest.approx(held.sigma, rel=1e-3)
    assert read.summary["sigma"]["pickets"] == held.summary["sigma"]["pickets"] > 0
    for layer in ("dsm", "dtm"):
        alone = aerotri.volume(folder / f"{layer}.tif", middle, base="lowest")
        assert aerotri.volume(folder, middle, base="lowest", layer=layer).net == alone.net
    with pytest.raises(InputError, match="no layer 'ground'"):
        aerotri.volume(folder, middle, layer="ground")


def test_from_memory_as_from_files(cone, tmp_path):
    path = cone.save(tmp_path / "cone.tif")
    flat = aerotri.Surface.of_array(np.full((160, 160), 99.5), left=-80.0, top=80.0, cell=1.0, name="flat")
    flat.save(tmp_path / "flat.tif")
    held = aerotri.volume(cone, PILE, base=flat)
    read = aerotri.volume(path, PILE.wkt, base=tmp_path / "flat.tif")
    text = aerotri.volume(str(path), PILE.wkt, base=str(tmp_path / "flat.tif"))
    assert held.net == read.net == text.net
    assert (held.summary["dtm"], read.summary["dtm"]) == ("cone", "cone.tif")
    np.testing.assert_array_equal(held.thickness.z, read.thickness.z)


def test_terrain_model_and_its_adjustment(measured, tmp_path):
    """The chain in memory is that of the files; pickets of a terrain model need not be named."""
    _, result, model, folder = measured
    result.save(tmp_path / "result", plots=False)
    area = shapely.box(-60.0, -50.0, 60.0, 50.0)
    held = aerotri.volume(model, area, base="lowest", adjustment=result)
    read = aerotri.volume(folder / "dsm.tif", area, base="lowest", adjustment=tmp_path / "result",
                          pickets=folder / "pickets.parquet")  # fmt: skip
    assert held.net == read.net
    assert held.sigma == pytest.approx(read.sigma, rel=1e-6)
    np.testing.assert_allclose(held.parts["sigma_m3"], read.parts["sigma_m3"], rtol=1e-6, atol=1e-9)
    assert read.summary["sigma"]["picket_file"] == "pickets.parquet"
    cells = aerotri.volume(model.dsm, area, base="lowest", adjustment=result)
    assert cells.net == held.net
    assert cells.sigma != held.sigma


def test_a_terrain_model_over_itself_is_known(measured):
    """Surface and base of one adjustment: what both share cancels, and the ground below objects is lower."""
    _, result, model, _ = measured
    area = shapely.box(-60.0, -50.0, 60.0, 50.0)
    itself = aerotri.volume(model, area, base=model, adjustment=result)
    assert (itself.net, itself.sigma) == (0.0, pytest.approx(0.0, abs=1e-9))
    assert aerotri.volume(model, area, base=50.0, adjustment=result).sigma > 1.0
    twin = replace(model, record=replace(model.record, dsm=replace(model.record.dsm)))
    known = aerotri.volume(model, area, base=twin, adjustment=result)
    assert known.sigma == pytest.approx(0.0, abs=1e-9)
    assert any("with the same adjustment" in text for text in known.warnings)
    unknown = aerotri.volume(model, area, base=replace(twin, adjustment="0"), adjustment=result)
    assert unknown.sigma > 1.0
    assert any("with another adjustment" in text for text in unknown.warnings)
    plain = aerotri.adjust(result.block, parameters="none")
    assert any("than the one stated" in text for text in aerotri.volume(model, area, adjustment=plain).warnings)


def test_save_twice_and_the_folder_of_the_thickness(cone, tmp_path):
    found = aerotri.volume(cone, PILE, base=100.0)
    for name in ("one", "two"):
        folder = found.save(tmp_path / name)
        assert json.loads((folder / "volume.json").read_text(encoding="utf-8")) == found.summary
        assert {p.name for p in folder.iterdir() if p.name[0] != "."} == {
            "volume.json", "thickness.tif", "sections.csv", "plots", "volume.html",
        }  # fmt: skip
    place = found.spool.folder
    assert place.is_dir()
    (tmp_path / "one" / "thickness.tif").write_bytes(b"")
    assert found.thickness.z.size > 0
    del found
    assert not place.exists()
    kept = aerotri.volume(cone, PILE, base=100.0, scratch=tmp_path)
    assert kept.thickness.path == tmp_path / "thickness.tif"


def test_shown_and_drawn(cone, measured):
    _, result, model, _ = measured
    plain = aerotri.volume(cone, PILE, base=100.0)
    sure = aerotri.volume(model, adjustment=result, boundary=shapely.box(-60.0, -50.0, 60.0, 50.0))
    assert set(sure.plot.all()) - set(plain.plot.all()) == {"budget"}
    assert all(isinstance(figure, Figure) for figure in sure.plot.all().values())
    assert "±" in sure._repr_html_()
    assert "±" not in plain._repr_html_()
    assert "net" in repr(plain)


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"base": "level:x"}, "is not understood"),
        ({"base": "nowhere.tif"}, "is no raster"),
        ({"method": "guess"}, "no method 'guess'"),
        ({"pickets": "p.parquet"}, "belong to an adjustment"),
        ({"base": 100.0, "adjustment": "result", "base_adjustment": "result"}, "need a surface as base"),
        ({"boundary": shapely.box(1e6, 1e6, 2e6, 2e6)}, "does not meet|not known"),
        ({"boundary": "POLYGON ((0 0, 1 1, 1 0, 0 1, 0 0))"}, "not valid"),
        ({"adjustment": "nowhere"}, "holds no adjustment"),
    ],
)
def test_what_makes_no_sense(cone, options, match):
    with pytest.raises(InputError, match=match):
        aerotri.volume(cone, **({"boundary": PILE} | options))


def test_file_of_piles_with_sigma_is_that_of_the_schema(measured):
    _, result, model, _ = measured
    left, bottom, right, top = model.dsm.grid.bounds
    x, y, size = 0.5 * (left + right), 0.5 * (bottom + top), 0.15 * min(right - left, top - bottom)
    piles = {"west": shapely.box(x - 2 * size, y, x - size, y + size), "east": shapely.box(x, y, x + size, y + size)}
    content = aerotri.volume(model, piles, base="lowest", adjustment=result).summary
    assert all(one["parts_m3"]["base"] >= 0.0 for one in content["piles"])
    schema = json.loads(files("aerotri.reference").joinpath("schema_files/volume.schema.json").read_text("utf-8"))
    jsonschema.validate(json.loads(json.dumps(content)), schema)


@pytest.mark.parametrize(("below", "both"), [(0.0, False), (0.01, False), (0.9, True), (4.0, True), (400.0, False)])
def test_scale_of_the_map_shows_the_sides_that_count(below, both):
    """A step of 2 m up and of `below` down; a hundredth of the larger one is no side of its own."""
    z = np.full((40, 40), 100.0)
    z[:20], z[20:30] = 102.0, 100.0 - below
    surface = aerotri.Surface.of_array(z, left=0.0, top=40.0, cell=1.0)
    figure = aerotri.volume(surface, base=100.0).plot.thickness()
    low, high = figure.axes[1].get_ylim()
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert ("surface on the base" in legend) is both
    assert bool(low < 0.0 < high) is both
    assert bool(high > 0.0) is (below < 400.0)


def test_every_argument_stands_in_the_file_and_on_the_page(cone, tmp_path):
    found = aerotri.volume(cone, PILE, base=100.0, boundary_sigma=0.05, density=1.8)
    used = {one["key"]: one for one in found.summary["settings"]}
    assert used["boundary_sigma"] == {"key": "boundary_sigma", "value": 0.05, "unit": "m", "origin": "given"}
    assert (used["base"]["value"], used["density"]["value"]) == (100.0, 1.8)
    left = inspect.signature(aerotri.volume).parameters.keys() - used.keys()
    assert left == {"surface", "boundary", "adjustment", "pickets", "base_adjustment", "base_pickets", "project",
                    "scratch", "progress"}  # fmt: skip
    others = [one for name, one in used.items() if name not in ("base", "boundary_sigma", "density")]
    assert {one["origin"] for one in others} == {"default"}
    page = (found.save(tmp_path / "volume") / "volume.html").read_text(encoding="utf-8")
    assert "<td>boundary_sigma</td><td>0.05 m</td><td>given</td>" in page
    assert "<td>matching_window</td><td>–</td><td>default</td>" in page
