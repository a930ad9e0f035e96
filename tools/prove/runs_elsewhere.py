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
from typing import Any

from aerotri.execution.choice import THREADS
from aerotri.execution.opening import opened
from aerotri.execution.work import Executor, Work

BYTES_OF_RUN = 500_000_000
"""Memory of a process with its libraries and a block of some hundred photographs; chosen [C]."""
Runs = Callable[[Callable[[Any, int], Any], Any, Iterable[int]], list[Any]]
"""Takes a function of a module, what all runs share, and the seeds; gives what the function gave for each."""


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
    with (
        opened(options.executor, partial(print, file=sys.stderr)) as executor,
        tempfile.TemporaryDirectory(prefix="runs_", dir=options.scratch) as folder,
    ):
        yield partial(_computed, executor, Path(folder))


def _computed(
    executor: Executor, folder: Path, function: Callable[[Any, int], Any], shared: Any, seeds: Iterable[int]
) -> list[Any]:
    tasks: Sequence[int] = list(seeds)
    names = [f"the run with seed {seed}" for seed in tasks]
    return executor.run(Work(function, shared, tasks, names, "runs", folder, BYTES_OF_RUN, at_once=1))
