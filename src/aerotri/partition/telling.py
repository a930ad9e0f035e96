"""How far the work on a block in parts is: told task by task, within an iteration as well."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from aerotri.execution.work import Executor, Report, Work

Say = Callable[[str, float | None], None]
"""Takes what is done, and the share of it."""


class Told:
    """An executor that tells how many of its tasks are done.

    Parameters
    ----------
    executor : does the tasks. say : takes what is done and the share of it.

    `stage` is what the tasks belong to, such as 'iteration 3'.
    """

    def __init__(self, executor: Executor, say: Say):
        self._executor, self._say = executor, say
        self.stage = ""

    def run(self, work: Work[Any, Any, Any], report: Report | None = None) -> list[Any]:
        """See `work.Executor`."""
        words = f"{self.stage}, {len(work.tasks)} {work.what if len(work.tasks) != 1 else work.what.removesuffix('s')}"

        def told(share: float) -> None:
            self._say(words, share)
            if report is not None:
                report(share)

        return self._executor.run(work, told)
