"""Workers started here that have all ended."""

import queue
from concurrent.futures import Future
from types import SimpleNamespace

import pytest

pytest.importorskip("distributed")

import toy_tasks

from aerotri.conventions import InputError
from aerotri.execution import cluster
from aerotri.execution.work import Work


@pytest.mark.parametrize("address", ["", "tcp://elsewhere:1"])
def test_a_command_does_not_wait_for_its_own_workers_for_ever(address, monkeypatch):
    """Those of another scheduler may come yet: a result is waited for."""
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
        assert executor._patiently(lambda: done.get(timeout=0.01)) == "late"
    else:
        with pytest.raises(InputError, match="have ended, and none came back"):
            executor._patiently(lambda: done.get(timeout=0.01))
    assert len(said) == 1


def test_workers_that_are_long_away_are_replaced(monkeypatch):
    """One that failed to begin gives its place up; one that begins again in time keeps it."""
    monkeypatch.setattr(cluster, "AWAY_S", 10.0)
    now, there, asked = [0.0], [3], []
    monkeypatch.setattr(cluster.time, "monotonic", lambda: now[0])
    executor = cluster.Dask("", 3, lambda text: None)
    executor._starting = Future()
    executor._starting.set_result((SimpleNamespace(scale=asked.append), None))
    monkeypatch.setattr(executor, "_workers", lambda: dict.fromkeys(range(there[0])))
    for second, count in ((0, 3), (5, 2), (14, 3), (15, 2), (24, 2)):
        now[0], there[0] = float(second), count
        executor._replace_lost()
        assert asked == []
    now[0] = 26.0
    executor._replace_lost()
    executor._replace_lost()
    assert asked == [2, 3]


def test_workers_are_there_whenever_they_are_asked_for(tmp_path, monkeypatch):
    """A client looks at its scheduler by itself, too, and then keeps no workers."""
    often = {**cluster.OWN_CLUSTER, "distributed.client.scheduler-info-interval": "1 ms"}
    monkeypatch.setattr(cluster, "OWN_CLUSTER", often)
    work = Work(toy_tasks.squared, 0, [0], ["a"], "tasks", tmp_path, 0)
    with cluster.Dask("", 1, lambda text: None) as executor:
        assert executor.run(work) == [0]
        assert {len(executor._workers()) for _ in range(500)} == {1}


@pytest.mark.parametrize("failures", [2, 3])
def test_workers_killed_as_they_begin_are_begun_again(failures, tmp_path, monkeypatch):
    """As Dask says it of a worker that ended before it had connected; not without end."""
    begun, begin = [], cluster.LocalCluster

    def beginning(**given):
        begun.append(1)
        if len(begun) <= failures:
            raise RuntimeError("Nanny failed to start.")
        return begin(**given)

    monkeypatch.setattr(cluster, "LocalCluster", beginning)
    work = Work(toy_tasks.squared, 0, [0], ["a"], "tasks", tmp_path, 0)
    with cluster.Dask("", 1, lambda text: None) as executor:
        if failures < 3:
            assert executor.run(work) == [0]
        else:
            with pytest.raises(InputError, match="no Dask workers could be started"):
                executor.run(work)
