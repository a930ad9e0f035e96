"""Tasks on workers of Dask, which nothing else in the program knows."""

from __future__ import annotations

import logging
import os
import queue
import signal
import time
import uuid
from collections.abc import Callable
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from contextlib import ExitStack, suppress
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import dask
from distributed import Client, LocalCluster, WorkerPlugin
from distributed.scheduler import KilledWorker

from aerotri.conventions import InputError
from aerotri.execution.beginning import method, prepare_copies
from aerotri.execution.choice import fewer_than
from aerotri.execution.elsewhere import WORKER_VARIABLES, outcome_in, parcels, perform
from aerotri.execution.work import MOST_TRIES, Ledger, Outcome, R, Report, S, Say, T, Work
from aerotri.memory import SHARE, available_bytes, refuse_beyond_memory, two_sizes

MEMORY = "MEMORY"
"""Name of the resource, in bytes, that workers offer (`dask worker --resources MEMORY=8e9`) and tasks take."""
OWN_CLUSTER: dict[str, Any] = {
    "distributed.scheduler.allowed-failures": MOST_TRIES - 1,
    # memory given back to the system at once costs a third of the time of a tile
    "distributed.nanny.pre-spawn-environ": {},
    "distributed.admin.tick.interval": "500 ms",
    "distributed.worker.multiprocessing-method": method(),
    # on a busy machine a worker takes longer than Dask's 15 s to begin again after it was killed
    "distributed.deploy.lost-worker-timeout": "60 s",
}
"""Settings of Dask for workers that are started here."""
UNWATCHED = {
    "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False",
    "DASK_DISTRIBUTED__ADMIN__TICK__INTERVAL": "500 ms",
}
"""Environment of such workers: they do not look fifty times a second how fast and where in the program they are."""
CONNECT_S, LOOK_S = "20s", 5.0
"""For the scheduler to answer; between two looks whether there are workers."""
AWAY_S = 30.0
"""Without one of the workers that were started here, after which another takes its place [C]: several times what one
needs to begin again on a busy machine."""
GONE_S = 120.0
"""Without any worker of those that were started here, after which none is expected to come back [C]."""


class Dask:
    """The workers of a scheduler that runs already, or of one that is started here.

    Parameters
    ----------
    address : of the scheduler, or its JSON file; '' to start one. workers : to start, each with one thread.
    say : takes a sentence for the user.
    """

    def __init__(self, address: str, workers: int, say: Say):
        self._address, self._count, self._say = address, workers, say
        self._stack = ExitStack()
        self._client: Any = None
        self._starting: Future[tuple[LocalCluster, Client]] | None = None
        self._told_waiting = False
        self._away_since: float | None = None

    def __enter__(self) -> Self:
        if self._address:
            self._client = self._stack.enter_context(_connected(self._address))
            self._say_dashboard()
        else:
            # workers take seconds to begin: meanwhile the command reads its files
            self._stack.enter_context(dask.config.set(OWN_CLUSTER))
            self._starting = self._stack.enter_context(ThreadPoolExecutor(1)).submit(self._started)
            self._stack.callback(self._end)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.close()

    def run(self, work: Work[S, T, R], report: Report | None = None) -> list[R]:
        """See `work.Executor`."""
        if not self._address:
            count = min(self._count, len(work.tasks))
            refuse_beyond_memory(
                count * work.bytes_each, f"{count} {work.what} at once", fewer_than(count, work.bytes_each, "workers")
            )
            if self._client is None and self._starting is not None:
                _, self._client = self._starting.result()
                self._say_dashboard()
        options = {"pure": False, **self._resources(work)}
        ledger: Ledger[R] = Ledger(work, report)
        with parcels(work) as waiting:
            lost = self._do(waiting, work, options, ledger)
            # one after the other, so that none pays for what another did to their worker
            for number in lost:
                alone = {number: waiting[number]}
                self._do(alone, work, options, ledger, is_last=True)
        return ledger.values()

    def _do(
        self, waiting: list[bytes] | dict[int, bytes], work: Work[Any, Any, Any], options: dict[str, Any],
        ledger: Ledger[Any], is_last: bool = False,
    ) -> list[int]:  # fmt: skip
        """Submit tasks and take what comes of them; numbers of those whose workers were lost too often."""
        numbered = dict(enumerate(waiting)) if isinstance(waiting, list) else waiting
        mark, done = uuid.uuid4().hex[:8], queue.Queue[Any]()
        futures = {
            self._client.submit(perform, parcel, key=f"{work.names[k]} {mark}-{k}", **options): k
            for k, parcel in numbered.items()
        }
        lost: list[int] = []
        try:
            for future in futures:
                future.add_done_callback(done.put)
            for _ in range(len(futures)):
                future = self._patiently(partial(done.get, timeout=LOOK_S))
                number = futures[future]
                content = self._content(future)
                if content is not None:
                    ledger.take(number, outcome_in(content))
                elif is_last:
                    ledger.take(number, Outcome(failed=_reason(future)))
                else:
                    # whatever became of it, its worker did: a result that was lost with the worker counts alike
                    lost.append(number)
        finally:
            self._client.cancel([future for future in futures if not future.done()])
        return sorted(lost)

    def _content(self, future: Any) -> bytes | None:
        """What a task gave; None where its worker was lost, with the result that it still had too."""
        if future.status != "finished":
            return None
        try:
            return self._patiently(partial(future.result, timeout=LOOK_S))
        except (KilledWorker, CancelledError):
            return None

    def _patiently(self, asked: Callable[[], Any]) -> Any:
        """What is asked for, asked again as long as it is not there; says so where nobody works.

        Raises
        ------
        InputError
            When the workers that were started here have ended, and none comes back.
        """
        alone_since = time.monotonic()
        while True:
            try:
                return asked()
            except (queue.Empty, TimeoutError):
                self._replace_lost()
                if self._workers():
                    alone_since = time.monotonic()
                    continue
                if not self._address and time.monotonic() - alone_since > GONE_S:
                    raise _none_came_back() from None
                if not self._told_waiting:
                    self._say(f"Dask scheduler {self._client.scheduler.address}: no worker at the moment, waiting")
                    self._told_waiting = True

    def _replace_lost(self) -> None:
        """Begin others for those started here that are long away: Dask gives up one that is killed as it begins."""
        if self._starting is None:
            return
        there, now = len(self._workers()), time.monotonic()
        if there >= self._count:
            self._away_since = None
        elif self._away_since is None:
            self._away_since = now
        elif now - self._away_since > AWAY_S:
            # one that failed to begin keeps its place as long as its place is wanted
            cluster = self._starting.result()[0]
            cluster.scale(there)
            cluster.scale(self._count)
            self._away_since = now

    def _started(self) -> tuple[LocalCluster, Client]:
        """Workers that begin, and who speaks with them."""
        prepare_copies({**WORKER_VARIABLES, **UNWATCHED}, ("distributed",))
        cluster = self._local_cluster()
        client = Client(cluster)
        client.register_plugin(_NotInterrupted())
        return cluster, client

    def _local_cluster(self) -> LocalCluster:
        """Workers on this machine; begun again where one was killed as it began.

        Raises
        ------
        InputError
            When they cannot be started.
        """
        there = available_bytes()
        memory: dict[str, Any] = {} if there is None else {"resources": {MEMORY: SHARE * there / self._count}}
        for left in reversed(range(MOST_TRIES)):
            try:
                return LocalCluster(
                    n_workers=self._count, threads_per_worker=1, processes=True, dashboard_address="127.0.0.1:0",
                    silence_logs=logging.CRITICAL, env={**os.environ, **WORKER_VARIABLES, **UNWATCHED}, **memory,
                )  # fmt: skip
            except (RuntimeError, OSError) as error:
                if not left:
                    said = " ".join(str(error).split())[:300]
                    raise InputError(
                        f"no Dask workers could be started ({type(error).__name__}: {said})",
                        "give --executor processes:N",
                    ) from error
        raise AssertionError

    def _end(self) -> None:
        """End the workers; what kept them from beginning was told where they were asked for."""
        if self._starting is not None and self._starting.exception() is None:
            cluster, client = self._starting.result()
            client.close()
            cluster.close()

    def _say_dashboard(self) -> None:
        if find_spec("bokeh") is not None or self._address:
            self._say(f"Dask dashboard: {self._client.dashboard_link}")
        else:
            self._say("Dask dashboard: needs bokeh, pip install bokeh")

    def _workers(self) -> dict[str, Any]:
        # asked anew: what the client keeps loses its workers whenever it looks at the scheduler by itself
        return self._client.sync(self._client.scheduler.identity, n_workers=-1)["workers"]

    def _resources(self, work: Work[Any, Any, Any]) -> dict[str, Any]:
        """What a task takes of a worker.

        Raises
        ------
        InputError
            When no worker has so much, or none of those that were started here is there.
        """
        if not self._workers():
            self._say(f"Dask scheduler {self._client.scheduler.address}: no worker yet, waiting")
            try:
                self._client.wait_for_workers(1, timeout=None if self._address else GONE_S)
            except TimeoutError:
                raise _none_came_back() from None
        workers = list(self._workers().values())
        offered = [worker["resources"][MEMORY] for worker in workers if MEMORY in worker.get("resources", {})]
        free = offered or [_memory_of_thread(worker) for worker in workers]
        if max(free) < work.bytes_each:
            wanted, there = two_sizes(work.bytes_each, max(free))
            raise InputError(
                f"a task takes {wanted} of memory, no worker has more than {there} for one",
                "start workers with fewer threads (--nthreads 1) and more memory (--memory-limit, --resources MEMORY=…)"
                if self._address
                else "give fewer workers",
            )
        return {"resources": {MEMORY: work.bytes_each}} if offered else {}


class _NotInterrupted(WorkerPlugin):
    """An interrupt of the terminal reaches all processes; ours ends the workers, which say nothing."""

    def setup(self, worker: Any) -> None:
        """Called in the main thread of a worker when it begins."""
        with suppress(ValueError):
            signal.signal(signal.SIGINT, signal.SIG_IGN)


def _none_came_back() -> InputError:
    return InputError(
        "all Dask workers that were started here have ended, and none came back",
        "run the command again; with --executor processes:N if it happens again",
    )


def _memory_of_thread(worker: dict[str, Any]) -> float:
    """Bytes that a task has where a worker does as many as it has threads; unlimited where none is stated."""
    return worker["memory_limit"] / worker["nthreads"] if worker.get("memory_limit") else float("inf")


def _connected(address: str) -> Client:
    is_file = address.endswith(".json")
    if is_file and not Path(address).is_file():
        raise InputError("there is no such file of a Dask scheduler", "give its address, tcp://HOST:8786", address)
    try:
        given: dict[str, Any] = {"scheduler_file": address} if is_file else {"address": address}
        return Client(**given, timeout=CONNECT_S)
    except (OSError, ValueError, TypeError) as error:
        said = " ".join(str(error).split())[:200]
        raise InputError(
            f"no Dask scheduler answers at {address} ({type(error).__name__}: {said})",
            "start one (dask scheduler) and give its address, tcp://HOST:8786",
        ) from error


def _reason(future: Any) -> str:
    """Why a task has no outcome."""
    if future.status != "error":
        return "the Dask scheduler was lost"
    error = future.exception()
    if type(error).__name__ == "KilledWorker":
        return "its Dask workers ended whenever they did it; perhaps memory was short"
    return f"{type(error).__name__}: {' '.join(str(error).split())[:300]}"
