"""`aerotri dsm`: from a result folder and photographs to files that later commands read."""

import inspect
import json
import re

import laspy
import numpy as np
import pytest
import shapely
from typer.testing import CliRunner

import aerotri
from aerotri import cli
from aerotri.cli import app
from aerotri.conventions import InputError
from aerotri.formats.results.point_cloud import read_point_cloud
from aerotri.public.results import open_result
from aerotri.public.terrain import rows_and_files
from aerotri.rasters.grids import RasterReader
from aerotri.terrain.dense import measure
from aerotri.terrain.photographs import photographs_of

PLAN = """
name = "tiny"
camera.cam = { preset = "ultracam_d", size_px = [575, 375], pixel_um = 180.0 }
flight = { gsd_m = 1.0, strips = 1, images_per_strip = 3, end_lap = 0.6, heading_deg = 30.0 }
terrain = { kind = "undulating", height_m = 100.0, relief_rms_m = 10.0, wavelength_m = 400.0 }
tie_points = { per_image = 60, probability = 0.9, sigma_um = 9.0 }
control = { distance_bases = 1.0, sigma_m = [0.05, 0.05, 0.05] }
"""


def run(*arguments: object) -> str:
    found = CliRunner().invoke(app, [str(a) for a in arguments])
    if isinstance(found.exception, InputError):
        raise found.exception
    assert found.exit_code == 0, found.output + repr(found.exception)
    return found.output


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The folder with block, result and surface, made by commands, and what the last printed."""
    here = tmp_path_factory.mktemp("dsm")
    (here / "plan.toml").write_text(PLAN, encoding="utf-8")
    run("simulate", here / "plan.toml", "--out", here / "block", "--seed", 3, "--render")
    run("adjust", here / "block", "--out", here / "result", "--no-plots")
    printed = run("dsm", here / "result", here / "block" / "photographs", "--out", here / "dsm", "--json", "--ground")
    return here, json.loads(printed)


def test_files_hold_the_same_surface(made):
    here, content = made
    assert content == json.loads((here / "dsm" / "dsm.json").read_text(encoding="utf-8"))
    files = "dsm.tif", "matching.tif", "photographs.tif"
    with RasterReader(here / "dsm" / files[0]) as reader:
        grid = reader.grid
        z = reader.read(0, 0, grid.rows, grid.columns)
    with RasterReader(here / "dsm" / files[0], band=2) as reader:
        sigma = reader.read(0, 0, grid.rows, grid.columns)
    matching, count = (_whole(here / "dsm" / name) for name in files[1:])
    known = np.isfinite(z)
    assert content["cells"] == {"all": z.size, "measured": int(known.sum())}
    np.testing.assert_array_equal(known, np.isfinite(matching))
    np.testing.assert_array_equal(known, count >= 2)
    assert (sigma[known] >= matching[known]).all()
    assert np.median(sigma[known]) == pytest.approx(content["sigma_Z_m"]["median"], rel=1e-3)
    xyz = read_point_cloud(here / "dsm" / "dsm.laz").xyz
    np.testing.assert_allclose(np.sort(xyz[:, 2]), np.sort(z[known]), atol=6e-4)
    assert {path.stem for path in (here / "dsm" / "plots").glob("*.png")} == {
        "surface", "colours", "sigma", "photographs"
    }  # fmt: skip
    assert not (here / "dsm.tiles").exists()


def test_the_page_has_the_pictures_and_names_the_files(made):
    here, content = made
    page = (here / "dsm" / "dsm.html").read_text(encoding="utf-8")
    assert page.count("<figure") == 4
    written = {path.name for path in (here / "dsm").iterdir()} - {".aerotri-files"}
    assert set(re.findall(r"<td><code>([^<]+)</code></td>", page)) == written
    held = content["adjusted"]
    assert (held["verdict"], held["check_points"], held["rms_check_m"]["Z"]) == ("accepted", 0, None)
    assert held["control_points"] > 0
    assert "There are no check points" in page
    assert page.index("no check points") < page.index("<figure")


def test_coverage_is_of_what_pairs_of_photographs_show(made):
    """Of three photographs in a row: what two neighbours have in common; the ground is nearly level."""
    here, content = made
    record = open_result(here / "result").record
    photographs = photographs_of(record, *rows_and_files(record, [here / "block" / "photographs"], np.arange(3)))
    one, two, three = (box_of(photographs, k) for k in range(3))
    shown = shapely.union(shapely.intersection(one, two), shapely.intersection(two, three)).area
    assert content["shown_area_m2"] == pytest.approx(shown, rel=0.03)
    assert content["coverage"] == pytest.approx(content["area_m2"] / content["shown_area_m2"])
    assert 0.9 < content["coverage"] <= 1.0


def box_of(photographs, k):
    """The usable part of a photograph on the mean height of the ground."""
    half = 0.98 * photographs.sensor[k, :2] / photographs.sensor[k, 2]
    c, x0, y0 = photographs.orientation.interior[k]
    corners = [(sx * half[0] - x0, sy * half[1] - y0, -c) for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    rays = np.array(corners) @ photographs.orientation.rotation[k].T
    centre = photographs.centres[k]
    return shapely.Polygon(centre[:2] + rays[:, :2] * ((photographs.ground - centre[2]) / rays[:, 2:]))


def test_the_cloud_has_colours_normals_and_covariances(made):
    here, _ = made
    cloud = laspy.read(here / "dsm" / "dsm.laz")
    x, y = np.asarray(cloud.x), np.asarray(cloud.y)
    with RasterReader(here / "dsm" / "dsm.tif") as reader:
        grid = reader.grid
        z = reader.read(0, 0, grid.rows, grid.columns)
    with RasterReader(here / "dsm" / "dsm.tif", band=2) as reader:
        sigma = reader.read(0, 0, grid.rows, grid.columns)
    row, column = np.rint(grid.row(y)).astype(int), np.rint(grid.column(x)).astype(int)
    np.testing.assert_allclose(cloud["sigma_z"], sigma[row, column], rtol=1e-4)
    normal = np.column_stack([cloud[f"Normal{axis}"] for axis in "XYZ"])
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, rtol=1e-5)
    inside = (row > 0) & (row < grid.rows - 1) & (column > 0) & (column < grid.columns - 1)
    by_x = (z[row, np.minimum(column + 1, grid.columns - 1)] - z[row, column - 1]) / (2.0 * grid.cell_x)
    by_y = (z[row - 1, column] - z[np.minimum(row + 1, grid.rows - 1), column]) / (2.0 * grid.cell_y)
    slopes = -normal[:, :2] / normal[:, 2:]
    for found, true in ((slopes[:, 0], by_x), (slopes[:, 1], by_y)):
        told = inside & np.isfinite(true)
        # at the edges of tiles the slope is that to one side
        assert np.mean(np.abs(found - true)[told] < 1e-4) > 0.9
    s, c = [np.array(cloud[f"sigma_{a}"]) for a in "xyz"], [np.array(cloud[f"cov_{a}"]) for a in ("xy", "xz", "yz")]
    both = np.array([[s[0] ** 2, c[0], c[1]], [c[0], s[1] ** 2, c[2]], [c[1], c[2], s[2] ** 2]]).transpose(2, 0, 1)
    assert np.linalg.eigvalsh(both.astype(float)).min() > -1e-9
    # with control of 5 cm the plan is as good as control and tie points make it
    assert (s[0] > 0.0).all()
    assert np.median(s[0]) < 1.0


def test_the_ground_is_marked_in_raster_and_cloud(made):
    here, content = made
    z, ground, source = (_whole(here / "dsm" / name) for name in ("dsm.tif", "dtm.tif", "ground.tif"))
    measured, bridged = source == 1, source == 2
    assert content["ground"]["measured"] == measured.sum() > 0.9 * np.isfinite(z).sum()
    assert content["ground"]["bridged"] == bridged.sum()
    np.testing.assert_array_equal(ground[measured], z[measured])
    np.testing.assert_array_equal(np.isfinite(ground), measured | bridged)
    classes = np.asarray(laspy.read(here / "dsm" / "dsm.laz").classification)
    assert (classes == 2).sum() == measured.sum()


def test_colours_are_those_of_the_photographs(made):
    here, _ = made
    cloud = laspy.read(here / "dsm" / "dsm.laz")
    np.testing.assert_array_equal(cloud.red, cloud.blue)  # grey photographs
    assert np.std(cloud.red) > 1000.0


def _whole(path) -> np.ndarray:
    with RasterReader(path) as reader:
        return reader.read(0, 0, reader.grid.rows, reader.grid.columns)


def test_the_surface_is_the_ground_that_was_simulated(made):
    here, content = made
    found = aerotri.compare(here / "dsm" / "dsm.tif", here / "block" / "truth" / "surface.tif")
    assert abs(found.record.statistics.median) < 3.0 * content["sigma_Z_m"]["adjustment"] + 0.05
    assert found.record.statistics.nmad < 2.0 * content["sigma_Z_m"]["matching"]
    assert content["y_parallax_px"]["median"] < 0.1


def test_the_function_gives_what_the_command_writes_and_goes_on_with_its_tiles(made, tmp_path):
    here, content = made
    photographs = here / "block" / "photographs"
    area = (-100.0, -100.0, 100.0, 100.0)
    first = aerotri.dense_surface(here / "result", photographs, area=area, tiles=tmp_path / "tiles")
    again = aerotri.dense_surface(here / "result", photographs, area=area, tiles=tmp_path / "tiles")
    other = aerotri.dense_surface(here / "result", photographs, area=area, most_pairs=1, tiles=tmp_path / "tiles")
    assert first.summary["tiles_resumed"] == other.summary["tiles_resumed"] == 0
    assert again.summary["tiles_resumed"] == again.summary["tiles"]
    used = {one["key"]: one for one in other.summary["settings"]}
    assert used["area"] == {"key": "area", "value": list(area), "unit": "m", "origin": "given"}
    assert {name for name, one in used.items() if one["origin"] == "given"} == {"area", "most_pairs"}
    left = inspect.signature(aerotri.dense_surface).parameters.keys() - used.keys()
    assert left == {"result", "photographs", "tiles", "executor", "progress"}
    np.testing.assert_array_equal(first.surface.z, again.surface.z)
    with RasterReader(here / "dsm" / "dsm.tif") as reader:
        row, column = (
            round(float(reader.grid.row(first.surface.grid.y(0)))),
            reader.grid.column(first.surface.grid.x(0)),
        )
        part = reader.read(row, round(float(column)), 50, 50)
    both = np.isfinite(part) & np.isfinite(first.surface.z[:50, :50])
    assert both.mean() > 0.9
    assert np.median(np.abs(part - first.surface.z[:50, :50])[both]) < content["sigma_Z_m"]["matching"]
    assert "cells of 2" in repr(first)


def test_files_are_the_same_wherever_tiles_are_measured(made, tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(measure, "TILE_PX", 100)
    here, _ = made
    given = ("dsm", here / "result", here / "block" / "photographs", "--area", -150, -150, 150, 150)
    found = {}
    for text in ("threads", "processes:2", "dask:local:2"):
        out = tmp_path / text.replace(":", "_")
        printed = run(*given, "--out", out, "--executor", text)
        assert ("Dask dashboard: " in printed) == text.startswith("dask")
        found[text] = {path.relative_to(out): path.read_bytes() for path in out.rglob("*") if path.is_file()}
    # record, page, three rasters, cloud, four plots as PNG and SVG, and what the folder holds
    assert len(found["threads"]) == 15
    assert found["processes:2"] == found["threads"]
    assert found["dask:local:2"] == found["threads"]


def test_a_tile_that_cannot_be_measured_is_named_and_ends_with_1(made, tmp_path, monkeypatch, capsys):
    """The tiles that were measured stay for the next run."""
    here, _ = made

    def failing(shared, window):
        raise RuntimeError("no luck")

    monkeypatch.setattr(measure, "do_window", failing)
    out = tmp_path / "dsm"
    monkeypatch.setattr("sys.argv", ["aerotri", "dsm", *map(str, (
        here / "result", here / "block" / "photographs", "--out", out, "--area", -50, -50, 50, 50
    ))])  # fmt: skip
    assert cli._ended() == 1
    told = capsys.readouterr().err
    assert "1 of 1 tiles could not be computed: tile at row 0, column 0 of level" in told
    assert "(RuntimeError: no luck) — run the command again" in told
    assert not out.exists()
    assert (tmp_path / "dsm.tiles").is_dir()


@pytest.mark.parametrize("text", ["dusk", "processes:0"])
def test_what_is_no_executor_is_refused_before_anything_is_done(made, tmp_path, text):
    here, _ = made
    with pytest.raises(InputError, match="executor"):
        run("dsm", here / "result", here / "block" / "photographs", "--out", tmp_path / "dsm", "--executor", text)
    assert not list(tmp_path.iterdir())


def test_wrong_settings_and_places_are_refused(made, tmp_path):
    here, _ = made
    photographs = here / "block" / "photographs"
    for given, message in (
        ({"resolution": -1.0}, "resolution -1 is not possible"), ({"area": (1.0, 0.0, 0.0, 1.0)}, "the area is empty"),
        ({"most_pairs": 0}, "most_pairs 0 is not possible"),
        ({"area": (1e5, 1e5, 1.001e5, 1.001e5)}, "the area does not meet the photographs"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=message):
            aerotri.dense_surface(here / "result", photographs, **given)
    with pytest.raises(InputError, match="0 photographs of the block"):
        aerotri.dense_surface(here / "result", tmp_path)
    (tmp_path / "notes.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match="holds other files than tiles"):
        aerotri.dense_surface(here / "result", photographs, tiles=tmp_path)
    assert (tmp_path / "notes.txt").read_text(encoding="utf-8") == "mine"


def test_photographs_of_the_block_that_were_not_given_are_named(made, tmp_path):
    here, _ = made
    names = sorted(path.name for path in (here / "block" / "photographs").iterdir())
    (tmp_path / "some").mkdir()
    for name in names[:2]:
        (tmp_path / "some" / name).symlink_to(here / "block" / "photographs" / name)
    said = f"1 photograph of the block is not in {tmp_path / 'some'}"
    area = ("--area", *map(str, _middle(here)))
    printed = run("dsm", here / "result", tmp_path / "some", "--out", tmp_path / "dsm", "--no-plots", *area)
    assert f"note: {said}" in printed
    content = json.loads((tmp_path / "dsm" / "dsm.json").read_text(encoding="utf-8"))
    missing = content["photographs_missing"]
    assert len(missing) == 1
    assert missing[0] in names[2]
    assert missing[0] in printed
    assert content["notes"][0].startswith(said)
    whole = json.loads((here / "dsm" / "dsm.json").read_text(encoding="utf-8"))
    assert (whole["photographs_missing"], whole["notes"]) == ([], [])
    printed = run("dtm", here / "result", tmp_path / "some", "--out", tmp_path / "dtm", "--no-plots",
                  "--interval", 20)  # fmt: skip
    assert f"note: {said}" in printed
    assert json.loads((tmp_path / "dtm" / "dtm.json").read_text(encoding="utf-8"))["photographs_missing"] == missing
    printed = run("ortho", here / "result", tmp_path / "some", here / "dsm", "--out", tmp_path / "ortho", "--no-plots",
                  "--cell", 4)  # fmt: skip
    assert f"note: {said}" in printed
    assert json.loads((tmp_path / "ortho" / "ortho.json").read_text(encoding="utf-8"))["photographs_missing"] == missing


def _middle(here):
    with RasterReader(here / "dsm" / "dsm.tif") as reader:
        left, bottom, right, top = reader.grid.bounds
    x, y = (left + right) / 2.0, (bottom + top) / 2.0
    return x - 40.0, y - 40.0, x + 40.0, y + 40.0


def test_an_area_beside_the_photographs_and_cells_larger_than_the_ground_are_refused(made, tmp_path):
    here, _ = made
    photographs = here / "block" / "photographs"
    with pytest.raises(InputError, match=r"the area does not meet the photographs: they show X -?[0-9]+ to") as refused:
        aerotri.dense_surface(here / "result", photographs, area=(9e5, 9e5, 9.1e5, 9.1e5))
    assert "coordinates of the block" in refused.value.remedy
    with pytest.raises(InputError, match="a cell of 9000 m is larger than the ground") as refused:
        aerotri.dense_surface(here / "result", photographs, resolution=9000.0)
    assert "--resolution" in refused.value.remedy
    (tmp_path / "one").mkdir()
    first = sorted(photographs.iterdir())[0]
    (tmp_path / "one" / first.name).symlink_to(first)
    with pytest.raises(InputError, match="1 photograph of the block is in"):
        aerotri.dense_surface(here / "result", tmp_path / "one")
