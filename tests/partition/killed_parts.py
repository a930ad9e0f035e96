"""Parts whose worker is killed, found by other processes by the name of this module."""

import os
import signal
from functools import partial
from pathlib import Path

from aerotri.partition.joint_tasks import follow, invert, join
from aerotri.partition.model_endings import (
    group_part,
    held_part,
    hold_part,
    pattern_part,
    patterned_part,
    pull_part,
    turn_part,
)
from aerotri.partition.model_tasks import (
    compare_part,
    describe_part,
    field_part,
    probe_part,
    probed_part,
    score_part,
)
from aerotri.partition.part_results import measure_part, write_part
from aerotri.partition.part_tasks import evaluate_part, move_part, prepare_part, reduce_part
from aerotri.partition.side_tasks import follow_sides, join_sides

MARKS = "AEROTRI_TEST_KILLED"
"""Names the folder in which a task that kills its process leaves its name, for all processes."""


def killed_once(function, shared, task):
    """The first task of all kills its process the first time, a file half written."""
    begun = Path(os.environ[MARKS]) / function.__name__
    try:
        begun.touch(exist_ok=False)
    except FileExistsError:
        return function(shared, task)
    task.work.mkdir(exist_ok=True)
    (task.work / "state_1.half.part").write_bytes(b"half")
    os.kill(os.getpid(), signal.SIGKILL)
    return None


OF_PARTS = (prepare_part, reduce_part, move_part, evaluate_part, measure_part, write_part)


def _killed(*functions):
    return {function.__name__: partial(killed_once, function) for function in functions}


KILLED = _killed(*OF_PARTS, join, follow, invert)
OF_TESTS = _killed(describe_part, probe_part, probed_part, score_part, compare_part, join_sides, follow_sides)
OF_GROUPS = _killed(hold_part, held_part, pull_part, turn_part, group_part)
OF_FIELDS = _killed(field_part, pattern_part, patterned_part)


def never(move, task):
    """The second part fails whenever it follows a solution."""
    if task.name == "0001":
        raise RuntimeError("no luck")
    return move_part(move, task)
