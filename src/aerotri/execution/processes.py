"""Tasks in processes of this machine. A process that is killed takes its task only, and that is begun again."""

from __future__ import annotations

import os
import signal
from collections import deque
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from types import TracebackType
from typing import Any, Self

from aerotri.conventions import InputError
from aerotri.execution.beginning import context, environment_of, prepare_copies
from aerotri.execution.choice import fewer_than
from aerotri.execution.elsewhere import WORKER_VARIABLES, outcome_in, parcels, perform
from aerotri.execution.work import MOST_TRIES, Ledger, Outcome, R, Report, S, T, Work
from aerotri.memory import refuse_beyond_memory

READY = b"ready"
PATIENCE_S = 5.0
"""For a process to end by itself before it is ended."""


class Processes:
    """Processes that live from the first work to the end of the context.

    Parameters
    ----------
    count : of processes, each with one thread.
    """

    def __init__(self, count: int):
        self._count = count
        self._workers: list[_Worker] = []

    def __enter__(self) -> Self:
        # importing takes seconds: meanwhile the command reads its files
        prepare_copies(WORKER_VARIABLES)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for worker in self._workers:
            worker.end(at_once=kind is not None)
        self._workers.clear()

    def run(self, work: Work[S, T, R], report: Report | None = None) -> list[R]:
        """See `work.Executor`."""
        count = min(self._count, len(work.tasks))
        refuse_beyond_memory(
            count * work.bytes_each, f"{count} {work.what} at once", fewer_than(count, work.bytes_each, "processes")
        )
        with parcels(work) as waiting:
            return _Run(work, waiting, self._workers, count, report).values()


class _Run:
    """One work: which process does which task, and how often a task was begun."""

    def __init__(
        self, work: Work[Any, Any, Any], parcels: list[bytes], workers: list[_Worker], count: int, report: Report | None
    ):
        self._parcels, self._workers, self._count = parcels, workers, count
        self._ledger: Ledger[Any] = Ledger(work, report)
        self._left = deque(range(len(parcels)))
        self._begun = [0] * len(parcels)
        self._never_ready = 0

    def values(self) -> list[Any]:
        """Results in the order of the tasks."""
        while self._left or any(worker.task is not None for worker in self._workers):
            self._start_missing()
            self._hand_out()
            for worker in wait_for(self._workers):
                self._hear(worker)
        return self._ledger.values()

    def _start_missing(self) -> None:
        busy = sum(worker.task is not None for worker in self._workers)
        while len(self._workers) < min(self._count, len(self._left) + busy):
            self._workers.append(_Worker())

    def _hand_out(self) -> None:
        for worker in self._workers:
            if worker.is_ready and worker.task is None and self._left:
                worker.task = self._left.popleft()
                self._begun[worker.task] += 1
                # a process that has just been killed is heard of by `_hear`
                with suppress(OSError):
                    worker.connection.send_bytes(self._parcels[worker.task])

    def _hear(self, worker: _Worker) -> None:
        try:
            content = worker.connection.recv_bytes()
        except (EOFError, OSError):
            self._lost(worker)
            return
        if content == READY:
            worker.is_ready, self._never_ready = True, 0
            return
        task, worker.task = worker.task, None
        assert task is not None
        self._ledger.take(task, outcome_in(content))

    def _lost(self, worker: _Worker) -> None:
        """Its task is begun again in another process, unless it was so often."""
        self._workers.remove(worker)
        ending = worker.end(at_once=False)
        if not worker.is_ready:
            self._never_ready += 1
        if self._never_ready >= MOST_TRIES:
            raise InputError(
                f"a process could not be started ({ending})",
                "see the lines above; a script begins its work under: if __name__ == '__main__':",
            )
        if worker.task is None:
            return
        if self._begun[worker.task] < MOST_TRIES:
            self._left.appendleft(worker.task)
        else:
            text = f"its process ended {MOST_TRIES} times, {ending}; perhaps memory was short"
            self._ledger.take(worker.task, Outcome(failed=text))


class _Worker:
    """A process, the line to it, and the number of the task that it does; None where it has none."""

    def __init__(self) -> None:
        begin = context()
        self.connection, other = begin.Pipe()
        self.task: int | None = None
        self.is_ready = False
        environment = {**os.environ, **WORKER_VARIABLES}
        self._process: BaseProcess = begin.Process(target=_serve, args=(other, environment), daemon=True)
        with environment_of(WORKER_VARIABLES):
            self._process.start()
        other.close()

    def end(self, at_once: bool) -> str:
        """End the process; how it ended, in words."""
        self.connection.close()
        if at_once:
            self._process.terminate()
        self._process.join(PATIENCE_S)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
        code = self._process.exitcode or 0
        return f"by signal {-code}" if code < 0 else f"with exit code {code}"


def wait_for(workers: list[_Worker]) -> list[_Worker]:
    """Those that have something to say, or have ended."""
    if not workers:
        return []
    heard = wait([worker.connection for worker in workers])
    return [worker for worker in workers if worker.connection in heard]


def _serve(connection: Connection, environment: dict[str, str]) -> None:
    """What a process does: task after task, until the line is closed."""
    # the process that this is a copy of may have been begun in another environment
    os.environ.clear()
    os.environ.update(environment)
    # an interrupt of the terminal reaches all processes; ours ends the others
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    with suppress(EOFError, OSError):
        connection.send_bytes(READY)
        while True:
            connection.send_bytes(perform(connection.recv_bytes()))
