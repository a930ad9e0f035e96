"""pycolmap, without the handlers of signals that it puts in place of ours.

Importing it makes SIGTERM print the stack of its own code and end the process: nothing unfinished would be removed
then, and the user would read an abort.
"""

from __future__ import annotations

import ctypes
import os
import signal
from typing import Any

ROOM_BYTES = 1024
"""For a `struct sigaction`, whose size depends on the system: 152 on Linux, 16 on macOS."""


def _imported() -> Any:
    """Imported in whichever thread: Python lets only the main one set a handler, the system any of them."""
    if os.name == "nt":
        import pycolmap

        return pycolmap
    system = ctypes.CDLL(None)
    ours = {number: ctypes.create_string_buffer(ROOM_BYTES) for number in (signal.SIGINT, signal.SIGTERM)}
    for number, handler in ours.items():
        system.sigaction(int(number), None, handler)
    try:
        import pycolmap
    finally:
        for number, handler in ours.items():
            system.sigaction(int(number), handler, None)
    return pycolmap


pycolmap: Any = _imported()
