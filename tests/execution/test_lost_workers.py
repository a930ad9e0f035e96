"""Workers started here that have all ended."""

import queue
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


def test_workers_that_dask_has_given_up_are_begun_anew(tmp_path, monkeypatch):
    """Dask gives a worker up that does not come back in time, and starts no other by itself."""
    monkeypatch.setattr(cluster, "LOOK_S", 0.5)
    monkeypatch.setattr(cluster, "AWAY_S", 4.0)
    monkeypatch.setattr(
        cluster, "OWN_CLUSTER", {**cluster.OWN_CLUSTER, "distributed.deploy.lost-worker-timeout": "1 ms"}
    )
    tasks = [0, 1, 2]
    shared = (str(tmp_path), frozenset(tasks), 1)
    work = Work(toy_tasks.written, shared, tasks, [str(task) for task in tasks], "tasks", tmp_path, 0)
    with cluster.Dask("", 1, lambda text: None) as executor:
        assert executor.run(work) == tasks


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
