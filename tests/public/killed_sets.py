"""Sets of parameters whose worker is killed, found by other processes by the name of this module."""

import os
import signal
from pathlib import Path

from aerotri.strategies.compared_sets import adjust_set
from aerotri.strategies.parameter_comparison import set_name


def killed_once(comparer, choice):
    """The first set kills its process when it is begun for the first time."""
    try:
        Path(os.environ["AEROTRI_TEST_KILLED"]).touch(exist_ok=False)
    except FileExistsError:
        return adjust_set(comparer, choice)
    os.kill(os.getpid(), signal.SIGKILL)
    return None


def never(comparer, choice):
    """Ebner's set fails whenever it is begun."""
    if set_name(choice).startswith("ebner"):
        raise RuntimeError("no luck")
    return adjust_set(comparer, choice)
