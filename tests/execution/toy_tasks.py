"""Tasks that workers of every kind find by the name of this module."""

import os
import signal
import time
from pathlib import Path

from aerotri.conventions import InputError


def squared(shared, task):
    """shared + task²; the last tasks are the quickest."""
    time.sleep(0.02 * max(3 - task, 0))
    return shared + task * task


def written(shared, task):
    """Write a file; a process that begins a task for the first time is killed."""
    folder, deadly, times = shared
    begun = Path(folder) / f"begun_{task}_{time.time_ns()}"
    begun.touch()
    if task in deadly and len(list(Path(folder).glob(f"begun_{task}_*"))) <= times:
        os.kill(os.getpid(), signal.SIGKILL)
    (Path(folder) / f"{task}.txt").write_text(str(task), encoding="utf-8")
    return task


def failing(shared, task):
    """Odd tasks fail, each time."""
    if task % 2:
        raise ValueError(f"{task} is odd")
    return task


def refusing(shared, task):
    """The third task finds bad input."""
    if task == 2:
        raise InputError("is damaged", "give another one", "photo.tif")
    return task


def environment(shared, task):
    """What a worker knows of its threads."""
    return os.environ.get("AEROTRI_THREADS"), os.getpid(), os.environ.get("AEROTRI_OF_TEST")
