"""Photographs whose worker is killed, found by other processes by the name of this module."""

import os
import signal
from pathlib import Path

from aerotri.tie_points.tasks import find_features_of, match_with_others


def _first_time(what):
    """The first task of all begins a file, and its process is killed; later ones go on."""
    mark = Path(os.environ["AEROTRI_TEST_KILLED"]) / what
    try:
        mark.touch(exist_ok=False)
    except FileExistsError:
        return
    os.kill(os.getpid(), signal.SIGKILL)


def features_killed_once(shared, path):
    _first_time("features")
    return find_features_of(shared, path)


def matches_killed_once(shared, task):
    _first_time("matches")
    return match_with_others(shared, task)


def no_features(shared, path):
    """The third photograph fails whenever it is begun."""
    if path.name == sorted(other.name for other in path.parent.iterdir())[2]:
        raise RuntimeError("no luck")
    return find_features_of(shared, path)


def no_matches(shared, task):
    """The first of all photographs fails whenever it is begun."""
    if task[0] == 0:
        raise RuntimeError("no luck")
    return match_with_others(shared, task)
