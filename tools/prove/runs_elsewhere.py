"""The runs of a Monte Carlo in this process, in others, or on many machines: `--executor` of the tools that have it.

A run depends on its seed alone, so that the numbers are the same wherever it is computed. A run without a result is
named, after all the others, and the tool ends with exit code 1: a statistic over the rest would be another one.
Measures nothing itself: it uses the executors within the package on purpose, so that tools and commands have the same.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from aerotri.execution.choice import THREADS
from aerotri.execution.opening import opened
from aerotri.execution.work import Executor, Work

BYTES_OF_RUN = 500_000_000
"""Memory of a process with its libraries and a block of some hundred photographs; chosen [C]."""
LONGEST_NAME = 60
"""Letters of what is not a seed, where a message names a run."""


class Runs(Protocol):
    """Computes runs."""

    def __call__(
        self, function: Callable[[Any, Any], Any], shared: Any, jobs: Iterable[Any], bytes_each: int = BYTES_OF_RUN
    ) -> list[Any]:
        """What the function gives for each job, in their order.

        Parameters
        ----------
        function : of a module, takes what all runs share and a job. jobs : seeds, or records that say what to run.
        bytes_each : memory of a run.
        """
        ...


def add_executor(parser: argparse.ArgumentParser) -> None:
    """Add `--executor` to the options of a tool."""
    parser.add_argument(
        "--executor",
        default=THREADS,
        help="where runs are computed: threads (one after the other), processes:N, dask:ADDRESS or dask:local:N",
    )
    parser.add_argument(
        "--scratch", type=Path, help="folder that all machines have under the same name; a temporary one by default"
    )


@contextmanager
def runs_of(options: argparse.Namespace) -> Generator[Runs]:
    """What computes runs, as the options of the tool say."""
    if options.scratch is not None:
        options.scratch.mkdir(parents=True, exist_ok=True)
    with (
        opened(options.executor, partial(print, file=sys.stderr)) as executor,
        tempfile.TemporaryDirectory(prefix="runs_", dir=options.scratch) as folder,
    ):
        yield partial(_computed, executor, Path(folder))


def folder_of(given: Path | None, options: argparse.Namespace) -> Path:
    """The folder to work in: the given one, or a new one that all machines see; absolute."""
    if given is None:
        return Path(tempfile.mkdtemp(dir=options.scratch)).resolve()
    given.mkdir(parents=True, exist_ok=True)
    return given.resolve()


def _computed(
    executor: Executor, folder: Path, function: Callable[[Any, Any], Any], shared: Any, jobs: Iterable[Any],
    bytes_each: int = BYTES_OF_RUN,
) -> list[Any]:  # fmt: skip
    tasks: Sequence[Any] = list(jobs)
    names = [_name(task) for task in tasks]
    return executor.run(Work(function, shared, tasks, names, "runs", folder, bytes_each, at_once=1), _told)


def _name(task: Any) -> str:
    if isinstance(task, int):
        return f"the run with seed {task}"
    text = str(task)
    return f"the run {text[:LONGEST_NAME]}{'…' if len(text) > LONGEST_NAME else ''}"


def _told(share: float) -> None:
    """The share that is done, on a terminal."""
    if sys.stderr.isatty():
        print(f"\rruns: {100.0 * share:.0f} %", end="\n" if share >= 1.0 else "", file=sys.stderr, flush=True)
