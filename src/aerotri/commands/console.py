"""What the user sees while a command runs: one line that moves on a terminal, now and then a line elsewhere."""

from __future__ import annotations

import contextlib
import re
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from aerotri.conventions import InputError

QUICK_S, BETWEEN_LINES_S = 2.0, 5.0
"""Off a terminal nothing is said of the first seconds, and lines about one stage are so far apart at least."""
FEWEST_S, FEWEST_SHARE = 3.0, 0.03
"""Before so much is done the time left is not told: a first piece may be of any size."""


def written(target: Path, page: str) -> str:
    """The line that says where a result is, and its page where one was written."""
    place = target / page
    return f"Written to {target}" + (f", page: {place}" if place.exists() else "")


class TimeLeft:
    """The time left of a piece of work, by the pace of the later half of what is done.

    Pieces at the beginning may be far smaller or larger than the rest, and compiling falls into the first one.
    """

    def __init__(self, now: float | None = None):
        self._seen = [(time.monotonic() if now is None else now, 0.0)]

    def after(self, share: float, now: float | None = None) -> float | None:
        """s, when the share (0 to 1) is done; None where too little is done to tell."""
        now = time.monotonic() if now is None else now
        if share > self._seen[-1][1]:
            self._seen.append((now, share))
        while len(self._seen) > 2 and self._seen[1][1] <= share / 2.0:
            self._seen.pop(0)
        begun, before = self._seen[0]
        if share < FEWEST_SHARE or now - begun < FEWEST_S or share <= before:
            return None
        # the piece that is going on counts as far as it is longer than those before
        last, done = self._seen[-1]
        pace = (done - before) / max(last - begun, 1e-9)
        return max((1.0 - done) / pace - (now - last), 0.0)


class Console:
    """Writes progress to stderr, the outcome to stdout."""

    def __init__(self, quiet: bool = False):
        self._quiet = quiet
        self._moving = is_terminal() and not quiet
        self._shown = False
        self._begun = self._said = time.monotonic()
        self._stage, self._tenth, self._left = "", 0, TimeLeft()

    def progress(self, text: str) -> None:
        """Replace the moving line; off a terminal a line when a stage begins, and now and then within it."""
        if not text:
            return
        if text.startswith("Dask "):
            # an address that the user may want later
            self.note(text)
            return
        stage = re.split(r"[0-9]", text, maxsplit=1)[0].strip()
        is_new, self._stage = stage != self._stage, stage
        if self._moving:
            self._move(text)
        elif self._is_due(is_new) or text.startswith("compiling"):
            self._line(text)

    def work(self, stage: str, share: float, detail: str = "") -> None:
        """Progress of work whose share (0 to 1) is known, with the time left; off a terminal a line every tenth."""
        is_new = stage != self._stage
        if is_new:
            self._stage, self._tenth, self._left = stage, 0, TimeLeft()
        left = self._left.after(share)
        text = f"{stage}: {detail or f'{100.0 * share:.0f} %'}" + ("" if left is None else f", {_duration(left)} left")
        if self._moving:
            self._move(text)
        elif (is_new and self._is_due(True)) or (int(10.0 * share + 1e-9) > self._tenth and self._is_due(False)):
            self._tenth = int(10.0 * share + 1e-9)
            self._line(text)

    def stage(self, name: str, share: float | None) -> None:
        """Progress as the Python package tells it: what is being done, and how far it is, where that is known."""
        if share is None:
            self.progress(name)
        else:
            self.work(name, share)

    def step(self, number: int, count: int, name: str) -> None:
        """Progress of a piece of work out of several, which begins now."""
        self.work("comparing", (number - 1) / count, f"{number} of {count}, {name}")

    def lines(self, lines: Iterable[str]) -> None:
        """Print the outcome; at once, also where stdout is no terminal."""
        self._clear()
        for line in lines:
            print(line)
        sys.stdout.flush()

    def note(self, text: str) -> None:
        """Print a sentence on what was done with the input; to stderr, so that JSON stays whole."""
        self._clear()
        print(f"aerotri: {text}", file=sys.stderr)

    def failure(self, text: str) -> None:
        """Print why there is no result."""
        self._clear()
        print(f"aerotri: {text}", file=sys.stderr)

    def _is_due(self, is_new: bool) -> bool:
        """Whether a line may be said off a terminal."""
        now = time.monotonic()
        return not self._quiet and now - (self._begun if is_new else self._said) >= (
            QUICK_S if is_new else BETWEEN_LINES_S
        )

    def _line(self, text: str) -> None:
        if self._quiet:
            return
        self._said = time.monotonic()
        # nobody may read it any longer, and the work goes on
        with contextlib.suppress(OSError):
            print(f"aerotri: {text}", file=sys.stderr, flush=True)

    def _move(self, text: str) -> None:
        with contextlib.suppress(OSError):
            sys.stderr.write(f"\r\x1b[K{text} …")
            sys.stderr.flush()
            self._shown = True

    def _clear(self) -> None:
        if self._shown:
            with contextlib.suppress(OSError):
                sys.stderr.write("\r\x1b[K")
                sys.stderr.flush()
            self._shown = False


@dataclass(frozen=True)
class OldForm:
    """A target that may be given in the form of today or in an older one, which still works.

    Parameters
    ----------
    out : as it is given today. old : in the older form. said, today : both forms in words.
    """

    out: Path | None
    old: Path | None
    said: str
    today: str

    @property
    def target(self) -> Path | None:
        """The target in either form.

        Raises
        ------
        InputError
            When both are given.
        """
        if self.out is not None and self.old is not None:
            raise InputError(f"--out and {self.said} are both given", f"give {self.today} alone")
        return self.out if self.old is None else self.old

    def needed(self) -> Path:
        """The same, where there has to be one.

        Raises
        ------
        InputError
            When there is none.
        """
        target = self.target
        if target is None:
            raise InputError("--out is missing", f"say what to write: {self.today}")
        return target

    def tell(self) -> None:
        """Say the form of today to who has used the older one."""
        if self.old is not None:
            Console().note(f"{self.said} is the old form; write {self.today}")


def is_terminal() -> bool:
    """Whether somebody reads along."""
    return sys.stderr is not None and sys.stderr.isatty()


def _duration(seconds: float) -> str:
    """'45 s', '12 min', '3.5 h'."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"
