"""`aerotri demcor --executor`: the same files by threads, processes and Dask, also where a worker is killed."""

from __future__ import annotations

import json

import killed_windows
import numpy as np
import pytest

from aerotri.cli.app import invoke
from aerotri.commands.deform import DeformOptions, run_deform
from aerotri.conventions import InputError
from aerotri.deformation import dem_correction, restitution_of
from aerotri.deformation.block_models import block_models, strip_pairs
from aerotri.deformation.model_grid import mean_ground
from aerotri.execution.work import TasksFailedError
from wrong_dems import Terrain, cells, square_grid, write_dem


@pytest.fixture(scope="module")
def rough(erring_result, erring, tmp_path_factory):
    """A DEM over several models, and the map of them."""
    folder = tmp_path_factory.mktemp("rough")
    models = block_models(erring, restitution_of(erring, "free"), strip_pairs(erring, restitution_of(erring, "free")))
    middle = np.mean([m.middle for m in models if m.model.names[0].startswith("2_")], axis=0)
    grid = square_grid(middle, 150, 4.0)
    z = Terrain(middle, mean_ground(erring))(cells(grid)).reshape(150, 150)
    write_dem(folder / "dem.tif", grid, z + np.random.default_rng(2).normal(size=z.shape))
    assert run_deform(erring_result, DeformOptions(spacing=8.0), folder / "map", False, True) == 0
    return folder


@pytest.fixture
def made(rough, erring_result, tmp_path, monkeypatch):
    """The files that a run leaves, by name; small windows that overlap too little at first."""
    monkeypatch.setattr(dem_correction, "WINDOW", 64)
    monkeypatch.setattr(dem_correction, "halo_for", lambda *_: 1)

    def of(executor, name):
        folder = tmp_path / name
        folder.mkdir()
        given = ("demcor", erring_result, rough / "dem.tif", "--models", rough / "map" / "model.tif")
        assert invoke([str(a) for a in (*given, "--out", folder / "out.tif", "--executor", executor)]) == 0
        assert not [path for path in folder.iterdir() if path.name.startswith(".")]
        found = {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}
        content = json.loads(found["out_demcor.json"])
        content.pop("timings_s", None)
        return found | {"out_demcor.json": content}

    return of


def test_files_are_the_same_wherever_windows_are_corrected(made):
    pytest.importorskip("distributed")
    by_threads = made("threads", "threads")
    assert sorted(by_threads) == ["out.tif", "out_dZ.tif", "out_demcor.json", "out_sigma_dZ.tif"]
    assert by_threads["out_demcor.json"]["seams"]["count"] > 2
    assert made("processes:2", "processes") == by_threads
    assert made("dask:local:2", "dask") == by_threads


@pytest.mark.parametrize("executor", ["processes:2", "dask:local:2"])
def test_a_worker_killed_in_mid_run_changes_nothing(executor, made, tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    expected = made("threads", "threads")
    monkeypatch.setattr(dem_correction, "correct_one", killed_windows.killed_once)
    monkeypatch.setattr(dem_correction, "DemTasks", _marked(dem_correction.DemTasks, tmp_path))
    assert made(executor, "killed") == expected
    assert (tmp_path / "marks" / "killed").exists()


def _marked(kind, folder):
    """Tasks whose files lie where their parent folder is not removed."""
    place = folder / "marks" / "windows"
    place.mkdir(parents=True)
    return lambda *given: kind(*given[:-1], place)


def test_a_window_that_always_fails_is_named(made, tmp_path, monkeypatch):
    monkeypatch.setattr(dem_correction, "correct_one", killed_windows.failing)
    message = r"1 of 9 windows could not be computed: window at row 0, column 64 \(RuntimeError: no luck\)"
    with pytest.raises(TasksFailedError, match=message):
        made("processes:2", "failing")
    assert not [path for path in (tmp_path / "failing").iterdir() if path.suffix == ".tif"]


def test_what_is_no_executor_is_refused(made):
    with pytest.raises(InputError, match="'thread' is not an executor"):
        made("thread", "none")
