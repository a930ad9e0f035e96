"""What the user sees while a command runs: one line that moves on a terminal, nothing but the outcome elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable


class Console:
    """Writes progress to stderr when it is a terminal, the outcome to stdout."""

    def __init__(self, quiet: bool = False):
        self._quiet = quiet
        self._moving = sys.stderr.isatty() and not quiet
        self._shown = False
        self._begun = 0.0

    def progress(self, text: str) -> None:
        """Replace the moving line; off a terminal only what the user has to wait for is printed, as a line."""
        if not text:
            return
        if self._moving:
            sys.stderr.write(f"\r\x1b[K{text} …")
            sys.stderr.flush()
            self._shown = True
        elif text.startswith("compiling") and not self._quiet:
            print(f"aerotri: {text}", file=sys.stderr)

    def iteration(self, number: int, cost: float, damping: float) -> None:
        """Progress of the adjustment."""
        damped = f", damped {damping:.0e}" if damping else ""
        self.progress(f"iteration {number}: vᵀPv {cost:.6g}{damped}")

    def step(self, number: int, count: int, name: str) -> None:
        """Progress of a piece of work out of several: how far, and the time left as those done let expect."""
        if number == 1:
            self._begun = time.monotonic()
        left = (time.monotonic() - self._begun) / max(number - 1, 1) * (count - number + 1)
        self.progress(f"{number} of {count}: {name}" + (f", {left:.0f} s left" if number > 1 else ""))

    def lines(self, lines: Iterable[str]) -> None:
        """Print the outcome."""
        self._clear()
        for line in lines:
            print(line)

    def failure(self, text: str) -> None:
        """Print why there is no result, or why not to trust the one there is."""
        self._clear()
        print(f"aerotri: {text}", file=sys.stderr)

    def _clear(self) -> None:
        if self._shown:
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()
            self._shown = False
