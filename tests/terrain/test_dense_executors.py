"""The tiles of a surface in threads, processes and workers of Dask: the same files, also where a worker is killed."""

import killed_tiles
import numpy as np
import pytest
from rendered_blocks import rendered_block

from aerotri.execution.opening import opened
from aerotri.execution.work import TasksFailedError
from aerotri.terrain.dense import measure
from aerotri.terrain.pickets import Area


@pytest.fixture(scope="module")
def hill(tmp_path_factory):
    return rendered_block(tmp_path_factory.mktemp("dense"), kind="hill", hill_height_m=60.0, hill_radius_m=150.0)


@pytest.fixture
def tiles(hill, tmp_path, monkeypatch):
    """Makes the tiles of a small area by an executor; their contents by name."""
    monkeypatch.setattr(measure, "TILE_PX", 60)
    area = Area(np.array([-100.0, -100.0]), np.array([100.0, 100.0]))

    def of(text, name):
        folder = tmp_path / name / "tiles"
        folder.mkdir(parents=True, exist_ok=True)
        plan = measure.DensePlan(np.arange(4), hill.paths, folder, area=area)
        shares = []
        with opened(text) as workers:
            measure.measure_surface(hill.calibration, plan, lambda stage, share: shares.append(share), workers)
        assert shares[-1] == 1.0
        return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}

    return of


def test_tiles_are_the_same_wherever_they_are_measured(tiles):
    pytest.importorskip("distributed")
    by_threads = tiles("threads", "threads")
    assert len(by_threads) > 6
    assert all(name.endswith(".npz") for name in by_threads)
    assert tiles("processes:2", "processes") == by_threads
    assert tiles("dask:local:2", "dask") == by_threads


@pytest.mark.parametrize("text", ["processes:2", "dask:local:2"])
def test_a_worker_killed_in_mid_run_changes_nothing(text, tiles, tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    expected = tiles("threads", "threads")
    monkeypatch.setattr(measure, "do_window", killed_tiles.killed_once)
    assert tiles(text, "killed") == expected
    assert (tmp_path / "killed" / "killed").exists()


@pytest.mark.parametrize("text", ["threads", "processes:2"])
def test_a_tile_that_always_fails_is_named_and_the_others_are_kept(text, tiles, tmp_path, monkeypatch):
    expected = tiles("threads", "whole")
    with monkeypatch.context() as patched:
        patched.setattr(measure, "do_window", killed_tiles.never)
        message = r"1 of \d+ tiles could not .*: tile at row 0, column 0 of level 0 \(RuntimeError: no luck\) — run"
        with pytest.raises(TasksFailedError, match=message):
            tiles(text, "failing")
    kept = {path.name: path.read_bytes() for path in (tmp_path / "failing" / "tiles").iterdir()}
    assert kept == {name: content for name, content in expected.items() if name != "level0_0_0.npz"}
    assert tiles(text, "failing") == expected
