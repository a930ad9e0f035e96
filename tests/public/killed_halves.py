"""Divisions whose worker is killed, found by other processes by the name of this module."""

import os
import signal
from pathlib import Path

from aerotri.pipeline.halves import compare_division


def killed_once(shared, task):
    """The first division kills its process when it is begun for the first time."""
    try:
        Path(os.environ["AEROTRI_TEST_KILLED"]).touch(exist_ok=False)
    except FileExistsError:
        return compare_division(shared, task)
    os.kill(os.getpid(), signal.SIGKILL)
    return None


def never(shared, task):
    """Alternate strips fail whenever they are begun."""
    if task[0] == "strips":
        raise RuntimeError("no luck")
    return compare_division(shared, task)
