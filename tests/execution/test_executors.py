"""Tasks in threads, in processes and on workers of Dask: the same results, the same failures, killed workers or not."""

import json
import os
import pickle
import signal
import subprocess
import sys
from contextlib import suppress
from functools import partial

import pytest
import toy_tasks

from aerotri import memory
from aerotri.conventions import InputError
from aerotri.execution import processes
from aerotri.execution.choice import Choice, chosen, fewer_than
from aerotri.execution.opening import opened
from aerotri.execution.work import TasksFailedError, Work

ALL = ("threads", "processes:2", "dask:local:2")
APART = ALL[1:]


@pytest.fixture(scope="module")
def executor():
    """Every executor, opened once."""
    from contextlib import ExitStack

    with ExitStack() as stack:
        held = {}

        def of(text):
            if text.startswith("dask"):
                pytest.importorskip("distributed")
            if text not in held:
                held[text] = stack.enter_context(opened(text))
            return held[text]

        yield of


@pytest.fixture
def work(tmp_path):
    """A work of six tasks."""

    def of(function, shared=10, count=6, **more):
        names = [f"tile {k}" for k in range(count)]
        return Work(function, shared, range(count), names, "tiles", tmp_path, 1000, **more)

    return of


@pytest.mark.parametrize("text", ALL)
def test_results_stand_in_the_order_of_the_tasks(text, executor, work, tmp_path):
    shares = []
    assert executor(text).run(work(toy_tasks.squared), shares.append) == [10, 11, 14, 19, 26, 35]
    assert shares == pytest.approx([k / 6 for k in range(1, 7)])
    assert not list(tmp_path.iterdir())
    assert executor(text).run(work(toy_tasks.squared, shared=0, count=2)) == [0, 1]
    assert executor(text).run(work(toy_tasks.squared, count=0)) == []


@pytest.mark.parametrize("text", ALL)
def test_tasks_without_a_result_are_named_after_all_others_were_done(text, executor, work):
    with pytest.raises(TasksFailedError, match=r"3 of 6 tiles could .* tile 1 .ValueError: 1 is odd.; ") as e:
        executor(text).run(work(toy_tasks.failing))
    assert [name for name, _ in e.value.failures] == ["tile 1", "tile 3", "tile 5"]
    assert str(e.value).endswith(" — run the command again")
    assert "toy_tasks.py" in e.value.__notes__[0]
    again = pickle.loads(pickle.dumps(e.value))
    assert (str(again), again.failures) == (str(e.value), e.value.failures)


@pytest.mark.parametrize("text", ALL)
def test_bad_input_is_told_as_bad_input(text, work):
    if text.startswith("dask"):
        pytest.importorskip("distributed")
    with pytest.raises(InputError, match=r"photo.tif: is damaged — give another one"), opened(text) as own:
        own.run(work(toy_tasks.refusing))


@pytest.mark.parametrize("text", APART)
def test_the_task_of_a_killed_worker_runs_again(text, executor, work, tmp_path):
    done = executor(text).run(work(toy_tasks.written, (str(tmp_path), (1, 4), 1)))
    assert done == list(range(6))
    assert all((tmp_path / f"{k}.txt").read_text(encoding="utf-8") == str(k) for k in range(6))
    # a third time where Dask lost what was done with the worker that the other task killed
    assert len(list(tmp_path.glob("begun_1_*"))) in ((2, 3) if text.startswith("dask") else (2,))


@pytest.mark.parametrize("text", APART)
def test_a_task_that_kills_every_worker_is_named_and_no_other(text, executor, work, tmp_path):
    with pytest.raises(TasksFailedError, match="perhaps memory was short") as e:
        executor(text).run(work(toy_tasks.written, (str(tmp_path), (2,), 99)))
    assert [name for name, _ in e.value.failures] == ["tile 2"]
    assert all((tmp_path / f"{k}.txt").is_file() == (k != 2) for k in range(6))


@pytest.mark.parametrize("text", APART)
def test_a_worker_has_one_thread_and_is_another_process(text, executor, work):
    import os

    found = executor(text).run(work(toy_tasks.environment))
    assert {threads for threads, _, _ in found} == {"1"}
    assert os.getpid() not in {process for _, process, _ in found}


@pytest.mark.parametrize("text", APART)
def test_a_worker_has_the_environment_of_its_beginning(text, work, monkeypatch):
    """Workers are copies of a process that may have been begun before it was changed."""
    if text.startswith("dask"):
        pytest.importorskip("distributed")
    for value in ("first", "second"):
        monkeypatch.setenv("AEROTRI_OF_TEST", value)
        with opened(text) as executor:
            assert {own for _, _, own in executor.run(work(toy_tasks.environment))} == {value}


@pytest.mark.parametrize("text", APART)
def test_more_memory_than_there_is_is_refused(text, executor, tmp_path):
    work = Work(toy_tasks.squared, 0, [1, 2], ["a", "b"], "tiles", tmp_path, 10**15)
    with pytest.raises(InputError, match=r"2 tiles at once need .* free memory, or take another machine"):
        executor(text).run(work)


def test_a_scheduler_that_runs_already_is_used(work, tmp_path):
    distributed = pytest.importorskip("distributed")
    said, file = [], tmp_path / "scheduler.json"
    given = {"n_workers": 1, "threads_per_worker": 1, "dashboard_address": None, "silence_logs": 50}
    with distributed.LocalCluster(**given, resources={"MEMORY": 2000}) as cluster:
        file.write_text(json.dumps({"address": cluster.scheduler_address}), encoding="utf-8")
        with opened(f"dask:{file}") as own:
            assert own.run(work(toy_tasks.squared)) == [10, 11, 14, 19, 26, 35]
        with opened(f"dask:{cluster.scheduler_address}", said.append) as own:
            assert own.run(work(toy_tasks.squared)) == [10, 11, 14, 19, 26, 35]
            large = Work(toy_tasks.squared, 0, [1], ["a"], "tiles", tmp_path, 3000)
            with pytest.raises(InputError, match="no worker has more than"):
                own.run(large)
    assert said[0].startswith("Dask dashboard: ")


def test_what_runs_where_is_understood():
    pytest.importorskip("distributed")
    assert chosen("threads") == Choice("threads")
    assert chosen("processes:3") == Choice("processes", 3)
    assert chosen("dask:local:2") == Choice("dask", 2)
    assert chosen("dask:tcp://10.0.0.1:8786") == Choice("dask", 0, "tcp://10.0.0.1:8786")
    assert chosen("dask:/home/me/scheduler.json") == Choice("dask", 0, "/home/me/scheduler.json")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("thread", "'thread' is not an executor — give threads, processes:N, dask:ADDRESS or dask:local:N"),
        ("dask", "'dask' is not an executor — give threads"),
        ("threads:2", "'threads:2' is not an executor"),
        ("processes", "'' is not a number of processes — give a whole number of 1 or more, such as processes:4"),
        ("processes:0", "'0' is not a number of processes"),
        ("processes:two", "'two' is not a number of processes"),
        ("dask:local:0", "such as dask:local:4"),
        ("dask:local", "such as dask:local:4"),
    ],
)
def test_what_is_no_executor_is_refused_with_the_remedy(text, message):
    with pytest.raises(InputError) as e:
        chosen(text)
    assert message in str(e.value)


def test_without_dask_its_installation_is_named(monkeypatch):
    monkeypatch.setattr("aerotri.execution.choice.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"pip install 'aerotri\[cluster\]'"):
        chosen("dask:local:2")


def test_a_scheduler_that_does_not_answer_is_told(monkeypatch, tmp_path):
    pytest.importorskip("distributed")
    monkeypatch.setattr("aerotri.execution.cluster.CONNECT_S", "1s")
    with (
        pytest.raises(InputError, match=r"no Dask scheduler answers at tcp://127.0.0.1:9"),
        opened("dask:tcp://127.0.0.1:9"),
    ):
        pass
    with pytest.raises(InputError, match="no such file of a Dask scheduler"), opened(f"dask:{tmp_path / 'none.json'}"):
        pass


def test_another_version_and_a_folder_not_seen_are_told(work, tmp_path, monkeypatch):
    from aerotri.execution import elsewhere

    with elsewhere.parcels(work(toy_tasks.squared)) as parcels:
        assert elsewhere.outcome_in(elsewhere.perform(parcels[1])).value == 11
        monkeypatch.setattr(elsewhere, "__version__", "9.9")
        stop = elsewhere.outcome_in(elsewhere.perform(parcels[1])).stop
        assert "has aerotri 9.9" in str(stop)
        monkeypatch.undo()
        elsewhere._kept.clear()
        for path in tmp_path.glob("*.shared"):
            path.unlink()
        stop = elsewhere.outcome_in(elsewhere.perform(parcels[1])).stop
    assert "does not see the folder" in str(stop)


def test_what_cannot_be_sent_back_is_a_failure(work):
    from aerotri.execution import elsewhere

    with elsewhere.parcels(work(partial(_unsendable))) as parcels:
        assert "cannot be sent" in elsewhere.outcome_in(elsewhere.perform(parcels[0])).failed


def _unsendable(shared, task):
    return lambda: None


WAITING = """
import signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)
from aerotri.execution.opening import opened
with opened("dask:local:1") as workers:
    workers._starting.result()
    try:
        print("reading", flush=True)
        time.sleep(60)
    except KeyboardInterrupt:
        sys.exit(130)
"""


@pytest.mark.skipif(os.name != "posix", reason="signals of a system")
def test_an_interruption_before_the_work_begins_is_quiet():
    """The terminal's signal reaches the workers too, which have begun while the command still reads its files."""
    pytest.importorskip("distributed")
    process = subprocess.Popen(
        [sys.executable, "-c", WAITING], stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True
    )
    assert process.stdout is not None
    assert process.stdout.readline().strip() == b"reading"
    try:
        os.killpg(process.pid, signal.SIGINT)
        _, said = process.communicate(timeout=60)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == 130
    assert said.decode() == ""


def test_remedy_says_how_many_tasks_fit(monkeypatch):
    monkeypatch.setattr(memory, "available_bytes", lambda: 10 * 2**30)
    assert fewer_than(8, 3 * 2**30, "processes") == "give at most 2 processes"
    assert fewer_than(2, 20 * 2**30, "workers") == "free memory, or take another machine"


def test_a_process_killed_as_it_begins_is_begun_again(work, monkeypatch):
    """Once; one that never begins ends the work."""
    begun = []

    class Killed(processes._Worker):
        def __init__(self):
            super().__init__()
            begun.append(self)
            if len(begun) <= kills:
                os.kill(self._process.pid, signal.SIGKILL)

    monkeypatch.setattr(processes, "_Worker", Killed)
    kills = 1
    with processes.Processes(1) as executor:
        assert executor.run(work(toy_tasks.squared, shared=0, count=2)) == [0, 1]
    assert len(begun) == 2
    begun.clear()
    kills = 100
    with processes.Processes(1) as executor, pytest.raises(InputError, match="a process could not be started"):
        executor.run(work(toy_tasks.squared, shared=0, count=2))
