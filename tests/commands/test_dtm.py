"""`aerotri dtm`: from a result folder and photographs to files that later commands read."""

import contextlib
import json
import sqlite3
import struct
from itertools import pairwise

import killed_windows
import numpy as np
import pytest
from typer.testing import CliRunner

from aerotri.cli import app
from aerotri.conventions import InputError
from aerotri.formats.results.pickets import read_pickets
from aerotri.formats.results.point_cloud import read_point_cloud
from aerotri.rasters.grids import RasterReader
from aerotri.terrain import tiles

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
    """The folder with block, result and terrain model, made by commands."""
    here = tmp_path_factory.mktemp("dtm")
    (here / "plan.toml").write_text(PLAN, encoding="utf-8")
    run("simulate", here / "plan.toml", "--out", here / "block", "--seed", 3, "--render")
    run("adjust", here / "block", "--out", here / "result", "--no-plots")
    dtm = ("dtm", here / "result", here / "block" / "photographs", "--interval", 20, "--pairs")
    printed = run(*dtm, "--out", here / "dtm", "--json")
    return here, json.loads(printed), dtm


def test_files_hold_the_same_surface(made):
    here, content, _ = made
    table = read_pickets(here / "dtm" / "pickets.parquet")
    assert content == json.loads((here / "dtm" / "dtm.json").read_text(encoding="utf-8"))
    assert content["pickets"]["accepted"] == table.accepted.sum() > 150
    assert content["interval_m"] == 20.0
    read = read_point_cloud(here / "dtm" / "pickets.laz")
    xyz, classes = read.xyz, read.classes
    np.testing.assert_allclose(xyz, table.xyz[table.accepted], atol=6e-4)
    assert (classes == 2).mean() > 0.9
    with (
        RasterReader(here / "dtm" / "dsm.tif") as dsm,
        RasterReader(here / "dtm" / "dsm.tif", band=2) as sigma,
        RasterReader(here / "dtm" / "model.tif") as model,
    ):
        z = dsm.read(0, 0, dsm.grid.rows, dsm.grid.columns)
        of_z = sigma.read(0, 0, dsm.grid.rows, dsm.grid.columns)
        number = model.read(0, 0, dsm.grid.rows, dsm.grid.columns)
        node = table.xyz[table.accepted]
        at = dsm.sample(node[:, 0], node[:, 1])
    np.testing.assert_array_equal(np.isfinite(z), np.isfinite(of_z))
    assert set(np.unique(number[np.isfinite(z)])) <= {0, 1}
    known = np.isfinite(at)
    assert np.median(np.abs(at[known] - node[known, 2])) < 0.05
    assert (table.sigma[table.accepted, 2] > table.sigma_matching[table.accepted, 2]).all()
    assert {len(names) for names, own in zip(table.photographs, table.accepted, strict=True) if own} == {2}
    for name in ("surface", "pickets"):
        assert (here / "dtm" / "plots" / f"{name}.png").stat().st_size > 10_000


def test_demcor_takes_the_models(made):
    here, _, _ = made
    run("adjust", here / "block", "--parameters", "bluh:1-2", "--out", here / "calibrated", "--no-plots")
    out = here / "corrected.tif"
    printed = json.loads(run("demcor", here / "calibrated", here / "dtm" / "dsm.tif", "--models",
                             here / "dtm" / "model.tif", "--out", out, "--json"))  # fmt: skip
    assert printed["corrected"] > 100
    assert 0.0 < printed["dZ"]["rms"] < 0.5


WALL = np.array([[-57.0, -44.0, 150.0], [-7.0, 6.0, 152.0], [48.0, 30.0, 155.0]])


def write_dxf(path):
    import ezdxf

    drawing = ezdxf.new("R2010")
    drawing.modelspace().add_polyline3d(WALL.tolist())
    drawing.saveas(path)


def write_geopackage(path):
    blob = b"GP\x00\x01" + struct.pack("<i", -1) + struct.pack("<BII", 1, 1002, len(WALL)) + WALL.tobytes()
    with contextlib.closing(sqlite3.connect(path)) as package:
        package.execute("CREATE TABLE gpkg_geometry_columns (table_name, column_name, srs_id INTEGER)")
        package.execute("INSERT INTO gpkg_geometry_columns VALUES ('walls', 'geom', -1)")
        package.execute("CREATE TABLE walls (geom BLOB)")
        package.execute("INSERT INTO walls VALUES (?)", (blob,))
        package.commit()


@pytest.mark.parametrize(("name", "write"), [("walls.dxf", write_dxf), ("walls.gpkg", write_geopackage)])
def test_breaklines_from_a_file_are_edges_of_the_surface(made, tmp_path, name, write):
    """A wall some 50 m over the ground: cells on it have its height, cells an interval away that of the ground."""
    _, _, dtm = made
    write(tmp_path / name)
    area = ("--area", -100, -80, 100, 80)
    run(*dtm, "--out", tmp_path / "dtm", "--breaklines", tmp_path / name, *area, "--cell", 2, "--json")
    run(*dtm, "--out", tmp_path / "without", *area, "--cell", 2, "--json")
    with RasterReader(tmp_path / "dtm" / "dsm.tif") as one, RasterReader(tmp_path / "without" / "dsm.tif") as other:
        for a, b in pairwise(WALL):
            on_it = a + np.linspace(0.05, 0.95, 12)[:, None] * (b - a)
            # between cells of 2 m on a ridge that falls by 50 m within 5 m where it is nearest to a picket
            assert np.abs(one.sample(*on_it[:, :2].T) - on_it[:, 2]).max() < 20.0
            assert (on_it[:, 2] - other.sample(*on_it[:, :2].T)).min() > 25.0
        x, y = (v.ravel() for v in np.meshgrid(np.arange(-80.0, 81.0, 8.0), np.arange(-60.0, 61.0, 8.0)))
        difference = one.sample(x, y) - other.sample(x, y)
    away = np.min([_distance(np.column_stack([x, y]), a[:2], b[:2]) for a, b in pairwise(WALL)], axis=0)
    known = np.isfinite(difference)
    assert np.abs(difference[known & (away > 45.0)]).max() < 0.01
    assert np.median(difference[known & (away < 4.0)]) > 40.0


def _distance(xy: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    share = np.clip((xy - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
    return np.hypot(*(xy - a - share[:, None] * (b - a)).T)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (("--subset", "third"), "there is no subset"),
        (("--window", "16"), "a window of 16 pixels is not possible"),
        (("--interval", "wide"), "--interval .wide. is not a number"),
        (("--breaklines", "lines.tab"), "no known kind"),
    ],
)
def test_bad_options(made, more, said):
    here, _, dtm = made
    with pytest.raises(InputError, match=said):
        run(*dtm, "--out", here / "other", *more)
    assert not (here / "other").exists()


def test_photographs_that_are_not_there(made, tmp_path):
    here, _, _ = made
    with pytest.raises(InputError, match="0 photographs of the block are in"):
        run("dtm", here / "result", tmp_path)
    with pytest.raises(InputError, match="holds other files"):
        run("dtm", here / "result", here / "block" / "photographs", "--out", here)


def test_interval_by_formula():
    printed = json.loads(run("predict", "picket-interval", "--scan-um", 28, "--scale", 7000, "--json"))
    np.testing.assert_allclose(printed["interval_m"]["plain"], [42.06, 46.49], atol=0.01)
    assert "older rule, 30 times the GSD: 5.9 m" in run("predict", "picket-interval", "--gsd", 0.196)
    with pytest.raises(InputError, match="in exactly one way"):
        run("predict", "picket-interval", "--gsd", 0.2, "--scan-um", 28, "--scale", 7000)


def test_interval_by_pilot(made):
    here, _, _ = made
    printed = json.loads(run("predict", "picket-interval", "--pilot", here / "result", "--photographs",
                             here / "block" / "photographs", "--tolerance", 0.5, "--json"))  # fmt: skip
    tried = printed["pilot"]["tried"]
    known = [t["rmse_m"] for t in tried if t["rmse_m"] is not None]
    assert known
    assert known == sorted(known)
    assert printed["pilot"]["interval_m"] > 0.0


def files_of(given, out, executor):
    """Contents of what a run leaves, by name."""
    run(*given, "--out", out, "--no-plots", "--executor", executor)
    assert not [path for path in out.parent.iterdir() if path.name.startswith(".")]
    return {path.name: path.read_bytes() for path in out.iterdir()}


def test_files_are_the_same_wherever_tiles_are_measured(made, tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(tiles, "TILE_NODES", 8)
    by_threads = files_of(made[2], tmp_path / "a" / "dtm", "threads")
    assert {"dtm.json", "pickets.parquet", "pickets.laz", "dsm.tif", "dtm.tif"} <= set(by_threads)
    assert files_of(made[2], tmp_path / "b" / "dtm", "processes:2") == by_threads
    assert files_of(made[2], tmp_path / "c" / "dtm", "dask:local:2") == by_threads


@pytest.mark.parametrize("executor", ["processes:2", "dask:local:2"])
def test_a_worker_killed_in_mid_run_changes_nothing(made, tmp_path, monkeypatch, executor):
    pytest.importorskip("distributed")
    monkeypatch.setattr(tiles, "TILE_NODES", 8)
    expected = files_of(made[2], tmp_path / "a" / "dtm", "threads")
    monkeypatch.setenv("AEROTRI_KILLED", str(tmp_path / "killed"))
    monkeypatch.setattr(tiles, "do_tile", killed_windows.killed_tile)
    assert files_of(made[2], tmp_path / "b" / "dtm", executor) == expected
    assert (tmp_path / "killed").exists()
