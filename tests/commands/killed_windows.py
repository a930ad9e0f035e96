"""Windows of a DEM and tiles of pickets whose worker is killed, found by other processes by the name of this module."""

import os
import signal
from pathlib import Path

from aerotri.deformation.dem_tasks import correct_one
from aerotri.terrain.tiles import do_tile


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


def killed_tile(shared, own):
    """A tile of the finest level kills its process when it is begun for the first time."""
    begun = Path(os.environ["AEROTRI_KILLED"])
    if shared.level == 0 and not begun.exists():
        begun.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return do_tile(shared, own)
