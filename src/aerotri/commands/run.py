"""`aerotri run`: every step there is, from photographs or a block to one report."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerotri.commands.console import Console, is_terminal
from aerotri.conventions import InputError
from aerotri.formats.results.json_text import json_text

MOST_NAMED = 10

if TYPE_CHECKING:
    from aerotri.public.adjustment import Adjustment
    from aerotri.public.run_project import Project
    from aerotri.public.run_steps import Step


def run_all(source: Path, out: Path, settings: Mapping[str, Any], as_json: bool) -> int:
    """Exit code: 0 when every step that there is was done, 1 when one failed.

    Parameters
    ----------
    settings : as of `aerotri.run`.

    Raises
    ------
    InputError
        When there is nothing to begin with, or the first step refuses its input.
    """
    from aerotri.execution.first_run import compile_ahead
    from aerotri.public.running import run

    console = Console()
    compile_ahead()
    project = run(source, out, **settings, on_step=_Told(console, out, as_json), progress=console.stage)
    if as_json:
        print(json_text(project.summary, None))
    else:
        console.lines(_lines(project))
    return 0 if project.complete and not project.unmarked else 1


def stop_or_continue(stated: str) -> str:
    """What to do where control points are marked nowhere: as stated, else stop where somebody sits before a terminal.

    Raises
    ------
    InputError
    """
    if stated not in ("", "stop", "continue"):
        raise InputError(f"--unmarked {stated} is not possible", "use stop or continue")
    return stated or ("stop" if is_terminal() and sys.stdin is not None and sys.stdin.isatty() else "continue")


class _Told:
    """Prints every step as its own command does.

    Parameters
    ----------
    out : folder of the run. quiet : what goes to stderr alone.
    """

    def __init__(self, console: Console, out: Path, quiet: bool):
        self._console, self._out, self._quiet = console, out, quiet
        self._doubt = ""

    def __call__(self, step: Step, outcome: Any) -> None:
        """The beginning of a step, or its end with what it gave or why it failed."""
        if outcome is None:
            self._print([f"── {step.what}: {step.command}"])
            if step.name == "dtm" and self._doubt:
                self._console.failure(self._doubt)
        elif isinstance(outcome, Exception):
            self._failed(outcome)
        else:
            getattr(self, f"_{step.name}")(outcome, self._out / step.folder)

    def _failed(self, error: Exception) -> None:
        """Bad input stands in the summary; why an adjustment has no result is told here."""
        from aerotri.commands.adjust import failure_text
        from aerotri.deformation.absorbed import AbsorptionFailedError
        from aerotri.execution.work import TasksFailedError
        from aerotri.results.failure import AdjustmentFailedError

        if isinstance(error, AdjustmentFailedError):
            self._console.failure(failure_text(error))
        elif isinstance(error, AbsorptionFailedError | TasksFailedError):
            self._console.failure(str(error))

    def _print(self, lines: list[str]) -> None:
        if not self._quiet:
            self._console.lines(lines)

    def _tiepoints(self, tied: Any, folder: Path) -> None:
        from aerotri.commands.tiepoints import outcome_lines

        self._print(outcome_lines(tied.summary(folder), folder, tied.imported))

    def _adjust(self, found: Adjustment, folder: Path) -> None:
        from aerotri.commands.adjust import outcome_lines
        from aerotri.commands.results import doubt

        for note in found.notes:
            self._console.note(note)
        self._doubt = doubt(folder, found)
        self._print(outcome_lines(found.adjusted, folder))

    def _accuracy(self, found: Any, folder: Path) -> None:
        self._print([found.summary(), f"Written to {folder}"])

    def _dtm(self, surface: Any, folder: Path) -> None:
        from aerotri.commands.dtm import outcome_lines

        self._print(outcome_lines(surface, folder))

    def _volume(self, volume: Any, folder: Path) -> None:
        from aerotri.commands.volume import outcome_lines

        for note in volume.notes:
            self._console.note(note)
        self._print(outcome_lines(volume.summary, folder))

    def _dsm(self, surface: Any, folder: Path) -> None:
        from aerotri.commands.dsm import outcome_lines

        self._print(outcome_lines(surface, folder))

    def _ortho(self, found: Any, folder: Path) -> None:
        from aerotri.commands.ortho import outcome_lines

        self._print(outcome_lines(found))


def _lines(project: Project) -> list[str]:
    lines = ["──"]
    for step in project.steps:
        ending = f": {step.reason}" if step.reason else f", {step.seconds:.0f} s, {project.folder / step.folder}"
        lines.append(f"{step.what} {step.status}{ending}")
    return [*lines, f"Report: {project.report}", *_how_to_go_on(project)]


def _how_to_go_on(project: Project) -> list[str]:
    """What to do where the run stopped for control that nobody marked."""
    from aerotri.public.run_steps import BLOCK
    from aerotri.report.quality import printable

    if not project.unmarked:
        return []
    names = ", ".join(printable(name) for name in project.unmarked[:MOST_NAMED])
    more = f" and {len(project.unmarked) - MOST_NAMED} more" if len(project.unmarked) > MOST_NAMED else ""
    block, photographs = shlex.quote(str(project.folder / BLOCK)), shlex.quote(str(project.source))
    return [
        f"Stopped: marked in no photograph: {names}{more}.",
        f"Mark them:    aerotri view {block} --photos {photographs}",
        "Then go on:   the same command with --unmarked continue",
    ]
