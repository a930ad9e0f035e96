"""Photographs resampled in threads, processes and workers of Dask: the same files, also where a worker is killed."""

from __future__ import annotations

import json

import killed_photographs
import pytest

import aerotri
from aerotri.public import resampling

pytestmark = pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")


def files_in(folder):
    """Contents by name, without the seconds that the record has."""
    found = {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    for path in list(found):
        if path.name == "imgeo.json":
            record = json.loads(found[path])
            assert all(one.pop("seconds") > 0.0 for one in record["photographs"])
            found[path] = record
    return found


@pytest.fixture
def made(measured, tmp_path):
    photographs, result, _, _ = measured

    def of(executor, name):
        out, shares = tmp_path / name / "ideal", []
        aerotri.ideal_photographs(result, photographs, out, executor=executor,
                                  progress=lambda stage, share: shares.append((stage, share)))  # fmt: skip
        assert [share for stage, share in shares if stage == "correcting"][-1] == 1.0
        assert [path.name for path in out.parent.iterdir() if path.name != "killed"] == ["ideal"]
        return files_in(out)

    return of


def test_photographs_are_the_same_wherever_they_are_resampled(made):
    pytest.importorskip("distributed")
    by_threads = made("threads", "threads")
    assert len([path for path in by_threads if path.suffix == ".tif"]) > 2
    assert made("processes:2", "processes") == by_threads
    assert made("dask:local:2", "dask") == by_threads


@pytest.mark.parametrize("executor", ["processes:2", "dask:local:2"])
def test_a_worker_killed_in_mid_run_changes_nothing(executor, made, tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    expected = made("threads", "threads")
    monkeypatch.setattr(resampling, "resample_photograph", killed_photographs.killed_once)
    assert made(executor, "killed") == expected
    assert (tmp_path / "killed" / "killed").exists()
