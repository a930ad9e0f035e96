"""How processes begin: as copies of one that has imported the libraries, where the system can do that well.

A process that begins empty imports for seconds what this one has imported already. Under Linux one process, which
has no threads yet, imports it once; every worker is a copy of it.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from multiprocessing import get_context
from multiprocessing.context import SpawnContext
from typing import Literal, cast

PACKAGE = __name__.partition(".")[0]
Method = Literal["forkserver", "spawn"]


def method() -> Method:
    """How multiprocessing is to begin processes here."""
    return "forkserver" if sys.platform == "linux" else "spawn"


def context() -> SpawnContext:
    """What begins them so; all contexts have the same functions."""
    return cast(SpawnContext, get_context(method()))


def prepare_copies(environment: Mapping[str, str], also: tuple[str, ...] = ()) -> None:
    """Begin the process whose copies the workers will be; returns at once. One that runs already stays as it is.

    Parameters
    ----------
    environment : variables that the copies have beside those of this process.
    also : modules to import beside those of this package that are imported here.
    """
    if method() != "forkserver":
        return
    from multiprocessing import forkserver

    own = [name for name in sys.modules if name.startswith(f"{PACKAGE}.")]
    forkserver.set_forkserver_preload([*also, *own])
    with environment_of(environment):
        forkserver.ensure_running()


@contextmanager
def environment_of(values: Mapping[str, str]) -> Generator[None]:
    """The variables set while a process is started, which takes them over."""
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
