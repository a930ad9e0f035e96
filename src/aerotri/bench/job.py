"""Work in another process, while the page goes on."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from aerotri.conventions import InputError


class Job:
    """One adjustment, or one plan.

    Parameters
    ----------
    module : that does it, as a program. words : its arguments. out : folder of what it writes.
    done : called with that folder when it is there.
    """

    def __init__(self, module: str, words: Sequence[str], out: Path, done: Callable[[Path], None]):
        self._out, self._done, self._begun = out, done, time.monotonic()
        self._stage, self._share, self._error, self._stopped = "starting", None, "", False
        self._seconds: float | None = None
        # -P: no module from the current folder, where a file json.py of the user's would be run in place of Python's
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", module, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            text=True, encoding="utf-8",
        )  # fmt: skip
        self._thread = threading.Thread(target=self._follow, daemon=True)
        self._thread.start()

    @property
    def is_running(self) -> bool:
        return self._seconds is None

    def state(self) -> dict[str, Any]:
        """What is being done, for how long, and how it ended."""
        seconds = time.monotonic() - self._begun if self._seconds is None else self._seconds
        return {"running": self.is_running, "stage": self._stage, "share": self._share, "seconds": round(seconds, 1),
                "error": self._error}  # fmt: skip

    def stop(self) -> None:
        """End it; nothing of it stays."""
        self._stopped = True
        self._process.terminate()

    def wait(self) -> None:
        """Wait until it has ended and its result was taken up."""
        self._thread.join()

    def _follow(self) -> None:
        process = self._process
        said = _Drained(process.stderr)
        for line in process.stdout or ():
            self._take(line)
        code = process.wait()
        if code and not self._error:
            self._error = "stopped" if self._stopped else said.last() or f"the work ended with {code}"
        if not code:
            self._finish()
        self._seconds = time.monotonic() - self._begun

    def _finish(self) -> None:
        try:
            self._done(self._out)
        except Exception as error:
            # whatever it is, the page has to hear that the work has ended
            self._error = str(error)

    def _take(self, line: str) -> None:
        try:
            content = json.loads(line)
        except ValueError:
            return
        if "error" in content:
            self._error = content["error"]
        else:
            self._stage, self._share = content["stage"], content["share"]


class Jobs:
    """Jobs, of which one runs at a time.

    Parameters
    ----------
    busy : what is said to the second one.
    """

    def __init__(self, busy: str):
        self._busy = busy
        self._last: Job | None = None

    def state(self) -> dict[str, Any] | None:
        """Of the last one; None where there was none."""
        return None if self._last is None else self._last.state()

    def refuse_second(self) -> None:
        """Refuse, where one is running.

        Raises
        ------
        InputError
        """
        if self._last is not None and self._last.is_running:
            raise InputError(self._busy, "wait, or stop it")

    def start(self, module: str, words: Sequence[str], out: Path, done: Callable[[Path], None]) -> None:
        """See `Job`.

        Raises
        ------
        InputError
            When one is running.
        """
        self.refuse_second()
        self._last = Job(module, words, out, done)

    def stop(self) -> None:
        """End the one that is running."""
        if self._last is not None and self._last.is_running:
            self._last.stop()

    def wait(self) -> None:
        """Wait until the last one has ended and its result was taken up."""
        if self._last is not None:
            self._last.wait()


class _Drained:
    """The lines of a stream, read so that their writer never waits."""

    def __init__(self, stream: Any):
        self._lines: list[str] = []
        self._thread = threading.Thread(target=self._read, args=(stream,), daemon=True)
        self._thread.start()

    def _read(self, stream: Any) -> None:
        for line in stream:
            self._lines = [*self._lines[-20:], line.strip()]

    def last(self) -> str:
        self._thread.join(5.0)
        return next((line for line in reversed(self._lines) if line), "")
