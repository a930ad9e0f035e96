"""SIGINT and SIGTERM end the program with one line, at any moment."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path
from types import FrameType
from typing import NoReturn

SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM") if hasattr(signal, name))
MAIN_MODULES = tuple(folder / "__main__.py" for folder in Path(__file__).parents[:2])
"""Of `python -m aerotri.cli` and `python -m aerotri`."""
_state = {"signal": 0, "unwinding": False}


class Interrupted(KeyboardInterrupt):
    """The user, or the system, wants the program to end."""


def is_program() -> bool:
    """Whether this process is the command line program, and not one that imports it."""
    processes = sys.modules.get("multiprocessing.process")
    if "--multiprocessing-fork" in sys.orig_argv or (processes is not None and processes.parent_process() is not None):
        return False  # a process that the program started
    if not sys.argv:
        return False
    name = os.path.basename(sys.argv[0])
    return name == "-m" or name.removesuffix(".exe") == "aerotri" or Path(sys.argv[0]) in MAIN_MODULES


def while_importing() -> None:
    """End at once: nothing has been begun, and an exception within an import may be lost or told as something else."""
    for number in SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _end_now)


def while_running() -> None:
    """Unwind, so that what is unfinished is removed; a second signal ends at once."""
    for number in SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _unwind)


def afterwards() -> None:
    """Everything is done and said: a late signal changes nothing."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def was_interrupted() -> bool:
    """Whether a signal came, also where an exception of its own was made of it on the way up."""
    return bool(_state["signal"])


def message() -> str:
    """The line for the user: what was brought to its place before, if anything was."""
    places = getattr(sys.modules.get("aerotri.formats.files.work_place"), "written", [])
    # files of a folder that did not become whole are gone with it
    places = [place for place in places if place.exists()]
    if not places:
        return "aerotri: interrupted, nothing was written"
    return f"aerotri: interrupted, after {places[0]} was written" + (f" and {len(places) - 1} more" * (len(places) > 1))


def exit_code() -> int:
    """130 for SIGINT, 143 for SIGTERM."""
    return 128 + (_state["signal"] or signal.SIGINT)


def _unwind(number: int, frame: FrameType | None) -> None:
    if _state["unwinding"]:
        _end_now(number, frame)
    _state.update(signal=number, unwinding=True)
    raise Interrupted


def _end_now(number: int, frame: FrameType | None) -> NoReturn:
    _state["signal"] = number
    work_place = sys.modules.get("aerotri.formats.files.work_place")
    if work_place is not None and hasattr(work_place, "abandon"):
        work_place.abandon()
    try:
        os.write(2, (message() + "\n").encode("utf-8", "replace"))
    finally:
        os._exit(exit_code())
