"""Tiles whose worker is killed, found by other processes by the name of this module."""

import os
import signal

from aerotri.terrain.dense.measure import do_window


def killed_once(shared, window):
    """The first tile of all kills its process when it is begun for the first time, half of its file written."""
    begun = shared.files.folder.parent / "killed"
    try:
        begun.touch(exist_ok=False)
    except FileExistsError:
        return do_window(shared, window)
    shared.files.path(window).with_suffix(".half.part").write_bytes(b"half")
    os.kill(os.getpid(), signal.SIGKILL)
    return 0


def never(shared, window):
    """The tile in the corner fails whenever it is begun."""
    if (window.row, window.column) == (0, 0) and shared.options.level == 0:
        raise RuntimeError("no luck")
    return do_window(shared, window)
