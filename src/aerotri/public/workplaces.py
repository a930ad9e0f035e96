"""The other processes that a user wants tasks to be done in."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager

from aerotri.conventions import FilePath
from aerotri.execution.choice import chosen
from aerotri.execution.opening import opened
from aerotri.execution.work import Say, Workplace


@contextmanager
def workplace(executor: str, scratch: FilePath | None, say: Say) -> Generator[Workplace | None]:
    """Where tasks are done; None for the threads of this process.

    Parameters
    ----------
    executor : 'threads', 'processes:N', 'dask:ADDRESS' or 'dask:local:N'.
    scratch : folder for what other processes read; a temporary one of the system where None.
    say : takes a sentence for the user.

    Raises
    ------
    InputError
        When it is not an executor, or cannot be reached.
    """
    from aerotri.formats.files.spool import Spool

    if chosen(executor).kind == "threads":
        yield None
        return
    spool = Spool(scratch)
    with opened(executor, say) as workers:
        yield Workplace(workers, spool.folder)
