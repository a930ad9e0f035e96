"""The executor that a user states, ready to work."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager

from aerotri.execution.choice import chosen
from aerotri.execution.work import Executor, Say


@contextmanager
def opened(text: str, say: Say | None = None) -> Generator[Executor]:
    """What does the work, until the end of the context.

    Parameters
    ----------
    text : 'threads', 'processes:N', 'dask:ADDRESS' or 'dask:local:N'.
    say : takes a sentence for the user: where the dashboard is, that no worker is there.

    Raises
    ------
    InputError
        When it is none of these, Dask is not installed, or no scheduler answers.
    """
    choice = chosen(text)
    if choice.kind == "threads":
        from aerotri.execution.threads import Threads

        yield Threads()
    elif choice.kind == "processes":
        from aerotri.execution.processes import Processes

        with Processes(choice.workers) as processes:
            yield processes
    else:
        from aerotri.execution.cluster import Dask

        with Dask(choice.address, choice.workers, say or (lambda text: None)) as cluster:
            yield cluster
