"""Parts whose worker is killed, found by other processes by the name of this module."""

import os
import signal

from aerotri.partition.part_tasks import move_part


def killed_once(move, task):
    """The first part of all kills its process when it follows a solution for the first time, a file half written."""
    begun = task.work.parent.parent.parent / "killed"
    try:
        begun.touch(exist_ok=False)
    except FileExistsError:
        return move_part(move, task)
    (task.work / "state_1.half.part").write_bytes(b"half")
    os.kill(os.getpid(), signal.SIGKILL)
    return None


def never(move, task):
    """The second part fails whenever it follows a solution."""
    if task.name == "0001":
        raise RuntimeError("no luck")
    return move_part(move, task)
