"""Photographs whose worker is killed, found by other processes by the name of this module."""

import os
import signal

from aerotri.public.resampling import resample_photograph


def killed_once(shared, one):
    """The second photograph kills its process when it is begun for the first time."""
    begun = shared.folder.parent / "killed"
    if one.name.startswith("1_002") and not begun.exists():
        begun.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return resample_photograph(shared, one)
