"""Handlers of signals that stay ours while a library is imported.

pycolmap and pyceres put handlers in place of ours: SIGTERM then prints the stack of their own code and ends the
process. Nothing unfinished would be removed, and the user would read an abort.
"""

from __future__ import annotations

import ctypes
import os
import signal
from collections.abc import Generator
from contextlib import contextmanager

ROOM_BYTES = 1024
"""For a `struct sigaction`, whose size depends on the system: 152 on Linux, 16 on macOS."""


@contextmanager
def handlers_kept() -> Generator[None]:
    """Put the handlers of SIGINT and SIGTERM back at the end.

    In whichever thread: Python lets only the main one set a handler, the system any of them.
    """
    if os.name == "nt":
        yield
        return
    system = ctypes.CDLL(None)
    ours = {number: ctypes.create_string_buffer(ROOM_BYTES) for number in (signal.SIGINT, signal.SIGTERM)}
    for number, handler in ours.items():
        system.sigaction(int(number), None, handler)
    try:
        yield
    finally:
        for number, handler in ours.items():
            system.sigaction(int(number), handler, None)
