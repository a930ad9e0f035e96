"""Orthophotos in threads, processes and workers of Dask: the same files, also where a worker is killed."""

from __future__ import annotations

import importlib
import json

import killed_ortho_tiles
import numpy as np
import pytest
from photographed import PLAN
from typer.testing import CliRunner

import aerotri
from aerotri.cli import app
from aerotri.execution.work import TasksFailedError
from aerotri.rasters.grids import Grid
from aerotri.rasters.surface_files import write_surface
from aerotri.terrain.ortho import tile_work

pytestmark = pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")


@pytest.fixture(scope="module")
def given(tmp_path_factory):
    """Result, photographs, and a surface with a narrow hole."""
    here = tmp_path_factory.mktemp("ortho")
    flight = aerotri.simulate(PLAN, seed=3)
    flight.save(here / "block", photographs=True)
    z = np.full((100, 100), 100.0)
    z[50:52, 40:60] = np.nan
    grid = Grid(100, 100, -150.0, 150.0, 3.0, 3.0)
    write_surface(here / "surface.tif", z, np.full((100, 100), 0.2), grid, None, "Z, m")
    return aerotri.adjust(flight.block), here / "block" / "photographs", here / "surface.tif"


@pytest.fixture
def made(given, tmp_path, monkeypatch):
    """Makes the orthophoto by an executor; contents of its files by name."""
    monkeypatch.setattr(importlib.import_module("aerotri.terrain.ortho.make"), "TILE", 128)

    def of(executor, name, **more):
        out, shares = tmp_path / name / "ortho", []
        out.parent.mkdir(exist_ok=True)
        aerotri.orthophoto(*given, out, cell=0.5, fill=9.0, plots=False, executor=executor,
                           progress=lambda stage, share: shares.append((stage, share)), **more)  # fmt: skip
        cells = [share for stage, share in shares if stage == "cells"]
        assert cells == sorted(cells)
        assert cells[-1] > 0.9
        found = {path.name: path.read_bytes() for path in out.iterdir() if path.suffix == ".tif"}
        return found | {"ortho.json": json.loads((out / "ortho.json").read_text(encoding="utf-8"))}

    return of


def test_orthophotos_are_the_same_wherever_they_are_made(made, tmp_path):
    pytest.importorskip("distributed")
    by_threads = made("threads", "threads")
    assert set(by_threads) == {"ortho.tif", "photographs.tif", "sigma.tif", "ortho.json"}
    assert by_threads["ortho.json"]["area_m2"]["bridged"] > 0.0
    assert made("processes:2", "processes") == by_threads
    assert made("dask:local:2", "dask") == by_threads
    # what lay beside the result is gone
    assert [path.name for path in (tmp_path / "processes").iterdir()] == ["ortho"]


@pytest.mark.parametrize("executor", ["processes:2", "dask:local:2"])
def test_a_worker_killed_in_mid_run_changes_nothing(executor, made, tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    expected = made("threads", "threads")
    monkeypatch.setattr(tile_work, "do_tile", killed_ortho_tiles.killed_once)
    assert made(executor, "killed", tiles=tmp_path / "killed" / "tiles") == expected
    assert (tmp_path / "killed" / "killed").exists()


def test_a_tile_that_always_fails_is_named_and_the_others_are_kept(made, tmp_path, monkeypatch):
    expected, tiles = made("threads", "threads"), tmp_path / "failing" / "tiles"
    with monkeypatch.context() as patched:
        patched.setattr(tile_work, "do_tile", killed_ortho_tiles.never)
        message = r"1 of \d+ tiles could not .*: tile at row 0, column 0 \(RuntimeError: no luck\) — run"
        with pytest.raises(TasksFailedError, match=message):
            made("processes:2", "failing", tiles=tiles)
    assert not (tmp_path / "failing" / "ortho").exists()
    kept = len(list(tiles.glob("*.npz")))
    assert kept > 3
    again = made("processes:2", "failing", tiles=tiles)
    assert again["ortho.json"].pop("tiles_resumed") == kept
    assert expected["ortho.json"].pop("tiles_resumed") == 0
    assert again == expected


def test_the_command_says_which_tile_failed(given, tmp_path, monkeypatch):
    result, photographs, surface = given
    result.save(tmp_path / "result", plots=False)
    monkeypatch.setattr(importlib.import_module("aerotri.terrain.ortho.make"), "TILE", 128)
    words = ["ortho", tmp_path / "result", photographs, surface, "--cell", "0.5", "--no-plots", "--executor",
             "processes:2", "--out", tmp_path / "out"]  # fmt: skip
    with monkeypatch.context() as patched:
        patched.setattr(tile_work, "do_tile", killed_ortho_tiles.never)
        done = CliRunner().invoke(app, [str(word) for word in words])
    assert isinstance(done.exception, TasksFailedError)
    assert "tile at row 0, column 0" in str(done.exception)
    done = CliRunner().invoke(app, [str(word) for word in words], catch_exceptions=False)
    assert done.exit_code == 0
    assert "tiles made before" in done.output


def test_a_wrong_executor_is_refused(given, tmp_path):
    with pytest.raises(aerotri.InputError, match="is not an executor"):
        aerotri.orthophoto(*given, tmp_path / "out", executor="cloud")
