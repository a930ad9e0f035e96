"""Workers started here that have all ended."""

import queue
from types import SimpleNamespace

import pytest

pytest.importorskip("distributed")

from aerotri.conventions import InputError
from aerotri.execution import cluster


@pytest.mark.parametrize("address", ["", "tcp://elsewhere:1"])
def test_a_command_does_not_wait_for_its_own_workers_for_ever(address, monkeypatch):
    """Those of another scheduler may come yet: a result is waited for."""
    monkeypatch.setattr(cluster, "LOOK_S", 0.01)
    monkeypatch.setattr(cluster, "GONE_S", 0.1)
    said, looks, done = [], [], queue.Queue()
    executor = cluster.Dask(address, 1, said.append)
    executor._client = SimpleNamespace(scheduler=SimpleNamespace(address=address))

    def workers():
        looks.append(1)
        if len(looks) == 30:
            done.put("late")
        return {}

    monkeypatch.setattr(executor, "_workers", workers)
    if address:
        assert executor._next(done) == "late"
    else:
        with pytest.raises(InputError, match="have ended, and none came back"):
            executor._next(done)
    assert len(said) == 1
