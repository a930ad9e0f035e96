"""How far long work is: told to a function, or shown as a bar in the terminal or the notebook."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

Progress = Callable[[str, float | None], None]
"""Takes (stage, share): what is being done, and how far it is, 0 … 1, None where that is not known."""
ProgressLike = Progress | bool | None
BAR_WIDTH, BETWEEN_S = 30, 0.2
"""Of the bar in a notebook: characters, and seconds between two states of one stage."""


class StageReport:
    """Brings the reports of every stage to one form.

    Parameters
    ----------
    tell : takes (stage, share).
    """

    def __init__(self, tell: Progress | None):
        self._tell = tell

    def stage(self, name: str, share: float | None) -> None:
        """What is being done, and how far it is."""
        if self._tell is not None:
            self._tell(name, share)

    def said(self, text: str) -> None:
        """A sentence about where the work is done."""
        self.stage(text, None)

    def iteration(self, number: int, sigma0: float, damping: float) -> None:
        """An iteration of the adjustment: how many there will be is not known."""
        damped = ", steps shortened" if damping else ""
        self.stage(f"iteration {number}: σ0 {sigma0:.4g}{damped}", None)

    def counted(self, name: str, done: int, count: int) -> None:
        """A piece of work out of several."""
        self.stage(name, done / count if count else None)

    def set_of(self, number: int, count: int, name: str) -> None:
        """The number-th of several sets begins."""
        self.stage("comparing sets of parameters", (number - 1) / count)


@contextmanager
def stage_report(progress: ProgressLike) -> Generator[StageReport]:
    """The report of what the user gave for `progress`; a bar is taken away at the end.

    Parameters
    ----------
    progress : True for a bar, a function that takes (stage, share), None or False for silence.
    """
    if callable(progress):
        yield StageReport(progress)
    elif progress:
        with _notebook_bar() if _is_notebook() else _bar() as tell:
            yield StageReport(tell)
    else:
        yield StageReport(None)


def _is_notebook() -> bool:
    """Whether this runs in the kernel of a notebook, where a terminal's bar is not seen."""
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    return hasattr(shell, "kernel")


@contextmanager
def _notebook_bar() -> Generator[Progress]:
    """A line that is written anew as the work goes on, and is taken away at the end."""
    display = import_module("IPython.display")
    line, shown, at = display.display(display.Pretty(""), display_id=True), "", 0.0

    def tell(stage: str, share: float | None) -> None:
        nonlocal shown, at
        now = time.monotonic()
        if stage != shown or now - at > BETWEEN_S:
            shown, at = stage, now
            line.update(display.Pretty(stage if share is None else _drawn(stage, share)))

    try:
        yield tell
    finally:
        line.update(display.Pretty(""))


def _drawn(stage: str, share: float) -> str:
    """'rendering ████····  50 %'"""
    full = round(BAR_WIDTH * min(max(share, 0.0), 1.0))
    return f"{stage} {'█' * full}{'·' * (BAR_WIDTH - full)} {100.0 * share:3.0f} %"


@contextmanager
def _bar() -> Generator[Progress]:
    """A bar of rich, which knows terminals and notebooks."""
    from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns: tuple[Any, ...] = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    with Bar(*columns, transient=True) as bar:
        task, shown = bar.add_task("", total=None), ""

        def tell(stage: str, share: float | None) -> None:
            nonlocal shown
            if stage != shown:
                bar.reset(task, description=stage, total=None if share is None else 1.0)
                shown = stage
            bar.update(task, completed=share or 0.0, total=None if share is None else 1.0)

        yield tell
