"""Orthophotos by the command and from Python: files, words, and what is refused."""

from __future__ import annotations

import importlib
import inspect
import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import rasterio
from matplotlib.figure import Figure
from photographed import PLAN
from typer.testing import CliRunner

import aerotri
from aerotri import InputError
from aerotri.cli import app
from aerotri.rasters.grids import Grid, write_raster
from aerotri.rasters.surface_files import write_surface
from aerotri.vectors.geopackage import read_geopackage


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Photographs, result, and a flat surface at the height of the ground."""
    here = tmp_path_factory.mktemp("ortho")
    flight = aerotri.simulate(PLAN, seed=3)
    flight.save(here / "block", photographs=True)
    result = aerotri.adjust(flight.block)
    grid = Grid(100, 100, -150.0, 150.0, 3.0, 3.0)
    write_surface(here / "surface.tif", np.full((100, 100), 100.0), np.full((100, 100), 0.2), grid, None, "Z, m")
    found = aerotri.orthophoto(result, here / "block" / "photographs", here / "surface.tif", here / "out", cell=2.0)
    return here, result, found


def test_a_photograph_behind_clouds_is_named(tmp_path):
    """Nothing is said of one that is only darker."""
    plan = PLAN | {"flight": PLAN["flight"] | {"images_per_strip": 6, "end_lap": 0.8}}
    flight = aerotri.simulate(plan, seed=3)
    flight.save(tmp_path / "block", photographs=True)
    result, folder = aerotri.adjust(flight.block), tmp_path / "block" / "photographs"
    grid = Grid(200, 200, -300.0, 300.0, 3.0, 3.0)
    write_surface(tmp_path / "surface.tif", np.full((200, 200), 100.0), np.full((200, 200), 0.2), grid, None, "Z, m")
    paths = sorted(path for path in folder.iterdir() if path.suffix in (".tif", ".jpg"))

    def notes(out, change):
        with rasterio.open(paths[3]) as photograph:
            profile, pixels = photograph.profile, photograph.read()
        with rasterio.open(paths[3], "w", **profile) as photograph:
            photograph.write(change(pixels.astype(float)).astype(pixels.dtype))
        found = aerotri.orthophoto(result, folder, tmp_path / "surface.tif", tmp_path / out, cell=4.0, plots=False)
        difference = [one["difference"] for one in found.summary["photographs"]]
        return [note for note in found.summary["notes"] if "colour" in note], difference

    said, even = notes("darker", lambda pixels: 0.7 * pixels)
    assert said == []
    stripes = np.sin(np.arange(575) / 20.0) > 0.0
    said, clouded = notes("clouded", lambda pixels: np.where(stripes, 1.3 * pixels.max() - pixels, pixels))
    assert len(said) == 1
    assert said[0].startswith("1 photograph differs in colour")
    assert f"{paths[3].name} ({100.0 * clouded[3]:.0f} %)" in said[0]
    assert clouded[3] > 3.0 * max(even)


def test_files(made):
    here, _, found = made
    assert json.loads((here / "out" / "ortho.json").read_text(encoding="utf-8")) == found.summary
    used = {one["key"]: one for one in found.summary["settings"]}
    assert used["cell"] == {"key": "cell", "value": 2.0, "unit": "m", "origin": "given"}
    assert {one["origin"] for name, one in used.items() if name != "cell"} == {"default"}
    left = inspect.signature(aerotri.orthophoto).parameters.keys() - used.keys()
    assert left == {"result", "photographs", "surface", "out", "layer", "plots", "tiles", "executor", "progress"}
    with rasterio.open(found.path) as image, rasterio.open(here / "out" / "photographs.tif") as numbers:
        assert image.count == 2
        assert image.colorinterp[-1].name == "alpha"
        assert image.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
        mask, number = image.read(2), numbers.read(1)
        np.testing.assert_array_equal(mask > 0, number >= 0)
        assert image.transform == numbers.transform
    cells = np.bincount(number[number >= 0], minlength=3) * 4.0
    np.testing.assert_allclose([one["area_m2"] for one in found.summary["photographs"]], cells)
    layers = {name: list(rows) for name, _, rows in read_geopackage(here / "out" / "seams.gpkg")}
    # coarse cells of 16 m: those at the edge are whole or missing
    whole = sum(one.properties["area_m2"] for one in layers["photographs"])
    assert whole == pytest.approx(cells.sum(), rel=0.07)
    names = {one["photograph"] for one in found.summary["photographs"]}
    for one in layers["seams"]:
        assert one.kind == "MultiLineString"
        assert {one.properties["photograph_1"], one.properties["photograph_2"]} <= names
    assert all(isinstance(figure, Figure) for figure in found.plot.all().values())
    assert {path.stem for path in (here / "out" / "plots").glob("*.png")} == {"orthophoto", "sigma", "seams", "points"}
    assert (here / "out" / "plots" / "points.png").stat().st_size > 10_000
    page = (here / "out" / "ortho.html").read_text(encoding="utf-8")
    assert page.count("<figure") == 4
    assert set(re.findall(r"<td><code>([^<]+)</code></td>", page)) == {
        path.name for path in (here / "out").iterdir()
    } - {".aerotri-files"}
    assert "cells of 2 m" in repr(found)
    marks = found.plot.orthophoto().axes[0].collections
    drawn = np.concatenate([np.asarray(one.get_offsets()) for one in marks])
    assert sorted(map(tuple, drawn.tolist())) == sorted((p["X"], p["Y"]) for p in found.summary["points"])


def test_accuracy_has_its_parts(made):
    _, _, found = made
    sigma = found.summary["sigma_m"]
    parts = [sigma[name]["median"] for name in ("surface", "orientation", "image")]
    assert all(part > 0.0 for part in parts)
    assert max(parts) < sigma["total"]["median"] < 1.5 * np.hypot.reduce(parts)
    # the angle of a ray and σ of the heights, 0.2 m, in two coordinates
    accuracy = found.record.accuracy
    assert accuracy.surface is not None
    there = np.isfinite(accuracy.total)
    np.testing.assert_allclose(accuracy.surface[there], 0.2 * accuracy.tangent[there] / np.sqrt(2.0), rtol=1e-6)
    for point in found.summary["points"]:
        assert 0.0 <= point["column"] < found.summary["columns"]
        assert point["sigma"] is None or point["sigma"] > 0.0


def test_a_run_that_was_ended_goes_on(made, tmp_path, monkeypatch):
    """Tiles of 64 cells: ended after three of them, one cut off; the files are those of a run in one go."""
    here, result, _ = made
    make = importlib.import_module("aerotri.terrain.ortho.make")
    monkeypatch.setattr(make, "TILE", 64)
    given = result, here / "block" / "photographs", here / "surface.tif"
    work = importlib.import_module("aerotri.terrain.ortho.tile_work")
    tiles, whole = tmp_path / "tiles", work.make_tile
    wanted = aerotri.orthophoto(*given, tmp_path / "one", cell=0.5, plots=False)
    done = []

    def ending(*arguments):
        if len(done) == 5:
            raise KeyboardInterrupt
        done.append(arguments)
        return whole(*arguments)

    monkeypatch.setattr(work, "make_tile", ending)
    with pytest.raises(KeyboardInterrupt):
        aerotri.orthophoto(*given, tmp_path / "two", cell=0.5, plots=False, tiles=tiles)
    assert not (tmp_path / "two").exists()
    monkeypatch.setattr(work, "make_tile", whole)
    kept = sorted(tiles.glob("ortho_*.npz"))
    assert 3 <= len(kept) <= 5
    kept[0].write_bytes(kept[0].read_bytes()[:100])
    found = aerotri.orthophoto(*given, tmp_path / "two", cell=0.5, plots=False, tiles=tiles)
    assert found.summary["tiles_resumed"] == len(kept) - 1
    for name in ("ortho.tif", "photographs.tif", "sigma.tif"):
        with rasterio.open(tmp_path / "one" / name) as one, rasterio.open(tmp_path / "two" / name) as two:
            np.testing.assert_array_equal(one.read(), two.read())
    assert found.summary | {"tiles_resumed": 0} == wanted.summary
    # other settings do not take them up
    again = aerotri.orthophoto(*given, tmp_path / "two", cell=0.5, plots=False, tiles=tiles, seams=False)
    assert again.summary["tiles_resumed"] == 0
    (tiles / "notes.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match="other files than tiles"):
        aerotri.orthophoto(*given, tmp_path / "two", cell=0.5, plots=False, tiles=tiles)


KILLED = """
import importlib, os, signal
make = importlib.import_module("aerotri.terrain.ortho.make")
work = importlib.import_module("aerotri.terrain.ortho.tile_work")
make.TILE, whole, done = 64, work.make_tile, []

def killed(*arguments):
    if len(done) == 5:
        os.kill(os.getpid(), signal.SIGKILL)
    done.append(arguments)
    return whole(*arguments)

work.make_tile = killed
from aerotri.cli import main
main()
"""
"""The command in a process that is killed at its sixth tile."""


def test_a_killed_command_goes_on(made, tmp_path, monkeypatch):
    """kill -9, then the same command: the files are those of a run in one go, byte by byte, and no tiles are left."""
    here, result, _ = made
    result.save(tmp_path / "result", plots=False)
    words = ["ortho", tmp_path / "result", here / "block" / "photographs", here / "surface.tif", "--cell", "0.5",
             "--no-plots", "--out"]  # fmt: skip
    words = [str(word) for word in words]
    killed = subprocess.run(
        [sys.executable, "-c", KILLED, *words, str(tmp_path / "two")],
        env=os.environ | {"AEROTRI_THREADS": "1"}, capture_output=True, check=False,
    )  # fmt: skip
    assert killed.returncode == -signal.SIGKILL, killed.stderr
    assert not (tmp_path / "two").exists()
    assert len(list((tmp_path / "two.tiles").glob("ortho_*.npz"))) == 5
    monkeypatch.setattr(importlib.import_module("aerotri.terrain.ortho.make"), "TILE", 64)
    for name, said in (("one", False), ("two", True)):
        done = CliRunner().invoke(app, [*words, str(tmp_path / name)], catch_exceptions=False)
        assert ("tiles made before: 5" in done.output) is said
    for name in ("ortho.tif", "photographs.tif", "sigma.tif"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()
    one, two = (list(_layers(tmp_path / name / "seams.gpkg")) for name in ("one", "two"))
    assert one == two
    assert sorted(path.name for path in tmp_path.iterdir()) == ["one", "result", "two"]


def _layers(path: Path):
    """Name and features of the layers of a GeoPackage."""
    return (
        (name, [(f.kind, f.properties, [[ring.tolist() for ring in part] for part in f.parts]) for f in rows])
        for name, _, rows in read_geopackage(path)
    )


def test_a_surface_in_memory_gives_the_same(made):
    here, result, found = made
    with rasterio.open(here / "surface.tif") as file:
        z = file.read(1).astype(float)
    surface = aerotri.Surface.of_array(z, left=-150.0, top=150.0, cell=3.0)
    other = aerotri.orthophoto(result, here / "block" / "photographs", surface, here / "same", cell=2.0, plots=False)
    assert other.path.read_bytes() == found.path.read_bytes()
    assert other.summary["sigma_m"]["surface"] is None
    assert "has no σ" in other.notes[0]


def test_command(made, tmp_path):
    here, result, _ = made
    result.save(tmp_path / "result", plots=False)
    words = ["ortho", tmp_path / "result", here / "block" / "photographs", here / "surface.tif", "--cell", 4,
             "--out", tmp_path / "out", "--no-plots", "--no-balance", "--no-seams"]  # fmt: skip
    done = CliRunner().invoke(app, [str(word) for word in words], catch_exceptions=False)
    assert done.exit_code == 0
    assert "cells of 4 m" in done.output
    assert "σ of X and Y" in done.output
    assert json.loads((tmp_path / "out" / "ortho.json").read_text(encoding="utf-8"))["cell_m"] == 4.0
    assert not (tmp_path / "out" / "plots").exists()


def surface_at(path: Path, left: float, height: float, crs: str | None = None, cell: float = 3.0) -> Path:
    write_raster(path, np.full((100, 100), height), Grid(100, 100, left, 150.0, cell, cell), crs)
    return path


def test_surfaces_that_do_not_fit_are_refused(made, tmp_path):
    here, result, _ = made
    photographs = here / "block" / "photographs"
    for match, surface in (
        ("the photographs show X", surface_at(tmp_path / "elsewhere.tif", 5e5, 100.0)),
        ("the ground of the block is at", surface_at(tmp_path / "high.tif", -150.0, 9000.0)),
        ("counts in degree", surface_at(tmp_path / "degrees.tif", 9.0, 100.0, "EPSG:4326", 1e-3)),
        ("the block in local", surface_at(tmp_path / "utm.tif", -150.0, 100.0, "EPSG:32632")),
        ("US survey foot", surface_at(tmp_path / "feet.tif", -150.0, 300.0, "EPSG:2264")),
        ("is no raster", photographs.parent / "block.toml"),
        ("is no raster", tmp_path / "missing.tif"),
    ):
        with pytest.raises(InputError, match=match):
            aerotri.orthophoto(result, photographs, surface, tmp_path / "out")
    in_feet = surface_at(tmp_path / "in feet.tif", -150.0, 300.0)
    with rasterio.open(in_feet, "r+") as file:
        file.units = ("ft",)
    with pytest.raises(InputError, match="but in 'ft'") as refused:
        aerotri.orthophoto(result, photographs, in_feet, tmp_path / "out")
    assert "A*0.3048" in str(refused.value)
    empty = write_nothing(tmp_path / "empty.tif")
    with pytest.raises(InputError, match="no heights"):
        aerotri.orthophoto(result, photographs, empty, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def write_nothing(path: Path) -> Path:
    write_raster(path, np.full((100, 100), np.nan), Grid(100, 100, -150.0, 150.0, 3.0, 3.0))
    return path


def test_photographs_that_do_not_fit_are_refused(made, tmp_path):
    here, result, _ = made
    photographs, surface = here / "block" / "photographs", here / "surface.tif"
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="no photograph of the block"):
        aerotri.orthophoto(result, tmp_path / "empty", surface, tmp_path / "out")
    with pytest.raises(InputError, match="is not there"):
        aerotri.orthophoto(result, tmp_path / "nowhere", surface, tmp_path / "out")
    first, second = sorted(photographs.glob("*.tif"))[:2]
    for match, changes in (
        ("pixels large", {"width": 100}), ("has 2 bands", {"count": 2}), ("type float32", {"dtype": "float32"}),
    ):  # fmt: skip
        folder = tmp_path / match.split()[-1]
        folder.mkdir()
        with rasterio.open(first) as file:
            profile = file.profile | {"tiled": False, "blockxsize": None, "blockysize": None}
        (folder / first.name).write_bytes(first.read_bytes())
        with rasterio.open(folder / second.name, "w", **(profile | changes)):
            pass
        with pytest.raises(InputError, match=match):
            aerotri.orthophoto(result, folder, surface, tmp_path / "out")
    (tmp_path / "cut").mkdir()
    (tmp_path / "cut" / first.name).write_bytes(first.read_bytes()[:20_000])
    with pytest.raises(InputError, match=first.name):
        aerotri.orthophoto(result, tmp_path / "cut", surface, tmp_path / "out")


def test_settings_are_refused(made, tmp_path):
    here, result, _ = made
    for match, options in (
        ("no resampling", {"resampling": "best"}), ("the area is empty", {"area": (1, 1, 0, 0)}),
        ("edge 0.5", {"edge": 0.5}), ("cell -1", {"cell": -1.0}), ("no layer", {"layer": "top"}),
        ("the area has no surface", {"area": (1e6, 1e6, 2e6, 2e6)}), ("of memory", {"cell": 1e-6}),
    ):  # fmt: skip
        with pytest.raises(InputError, match=match):
            aerotri.orthophoto(result, here / "block" / "photographs", here / "surface.tif", tmp_path / "o", **options)
