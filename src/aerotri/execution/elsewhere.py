"""A task on its way to another process, and its doing there.

What all tasks share is written once to a file; a process reads it once. A task itself is a few bytes.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import socket
import uuid
from collections import OrderedDict
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from threading import Lock
from typing import Any

from aerotri.conventions import InputError
from aerotri.execution.scripts import Script, script_of, unpickled
from aerotri.execution.work import NO_SPACE, Outcome, Work, outcome_of
from aerotri.version import __version__

SUFFIX = ".shared"
"""Of the files with what tasks share."""
WORKER_VARIABLES = {
    "AEROTRI_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1",
    "OPENCV_FOR_THREADS_NUM": "1", "PYTHONSAFEPATH": "1",
}  # fmt: skip
"""Environment of a process that does one task at a time beside others: one thread, and no module from the current
folder, where a file json.py of the user's would be run in place of Python's."""
KEPT = 2
"""Shared parts that a process keeps."""
_kept: OrderedDict[tuple[str, Script | None], Any] = OrderedDict()
_lock = Lock()


@contextmanager
def parcels(work: Work[Any, Any, Any]) -> Generator[list[bytes]]:
    """Every task as bytes for `perform`; what they share lies in the folder of the work as long as this lasts.

    Raises
    ------
    InputError
        When the folder cannot be written to.
    """
    content = pickle.dumps(work.shared, pickle.HIGHEST_PROTOCOL)
    mark = hashlib.sha256(content).hexdigest()
    path = work.folder.absolute() / f"{uuid.uuid4().hex}{SUFFIX}"
    part = path.with_suffix(".part")
    try:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            part.write_bytes(content)
            os.replace(part, path)
        except OSError as error:
            if error.errno in NO_SPACE:
                raise
            raise InputError(f"cannot be written to: {error}", "choose another place", work.folder) from error
        tasks = [pickle.dumps((work.function, path, mark, task), pickle.HIGHEST_PROTOCOL) for task in work.tasks]
        script = script_of([content, *tasks], work.function)
        del content
        yield [pickle.dumps((__version__, pickle.dumps((script, task)))) for task in tasks]
    finally:
        for one in (path, part):
            one.unlink(missing_ok=True)


def perform(parcel: bytes) -> bytes:
    """Do a task; its outcome as bytes, whatever happens."""
    outcome = outcome_of(_done, parcel)
    try:
        return pickle.dumps(outcome, pickle.HIGHEST_PROTOCOL)
    except Exception as error:
        return pickle.dumps(Outcome(failed=f"its result cannot be sent: {error}"))


def outcome_in(content: bytes) -> Outcome:
    """What `perform` gave."""
    return pickle.loads(content)


def _done(parcel: bytes) -> Any:
    from threadpoolctl import threadpool_limits

    version, content = pickle.loads(parcel)
    if version != __version__:
        raise InputError(
            f"the worker on {socket.gethostname()} has aerotri {__version__}, this is aerotri {version}",
            "install the same version on all machines",
        )
    script, content = pickle.loads(content)
    function, path, mark, task = unpickled(content, script)
    shared = _shared(path, mark, script)
    with threadpool_limits(1, "blas"):
        return function(shared, task)


def _shared(path: Path, mark: str, script: Script | None) -> Any:
    """What the tasks of one work share, read once by a process."""
    key = mark, script
    with _lock:
        if key not in _kept:
            _kept[key] = unpickled(_content(path, mark), script)
        _kept.move_to_end(key)
        while len(_kept) > KEPT:
            _kept.popitem(last=False)
        return _kept[key]


def _content(path: Path, mark: str) -> bytes:
    host = socket.gethostname()
    try:
        content = path.read_bytes()
    except FileNotFoundError as error:
        raise InputError(
            f"the worker on {host} does not see the folder {path.parent}",
            "put target and photographs where all machines have them under the same name",
        ) from error  # fmt: skip
    if hashlib.sha256(content).hexdigest() != mark:
        raise OSError(f"{path} is damaged as the worker on {host} reads it")
    return content
