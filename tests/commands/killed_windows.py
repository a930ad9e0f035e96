"""Windows of a DEM whose worker is killed, found by other processes by the name of this module."""

import os
import signal

from aerotri.deformation.dem_tasks import correct_one


def killed_once(shared, window):
    """The first window kills its process when it is begun for the first time."""
    begun = shared.folder.parent / "killed"
    if window[:2] == (0, 0) and not begun.exists():
        begun.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return correct_one(shared, window)


def failing(shared, window):
    """The second window of the first row fails whenever it is begun."""
    if window[:2] == (0, 64):
        raise RuntimeError("no luck")
    return correct_one(shared, window)
