"""What is to be done, task by task; what came of a task; and the failure that names those without a result."""

from __future__ import annotations

import errno
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

from aerotri.conventions import InputError

S = TypeVar("S")
T = TypeVar("T")
R = TypeVar("R")
Report = Callable[[float], None]
Say = Callable[[str], None]
MOST_TRIES = 3
"""Times that a task is begun whose worker is lost; chosen [C]: once may be chance, three times is the task itself."""
MOST_NAMED = 5
"""Failed tasks that a message names; the others are counted."""
NO_SPACE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


@dataclass(frozen=True, eq=False)
class Work(Generic[S, T, R]):
    """Tasks that do not depend on one another.

    Parameters
    ----------
    function : takes (shared, task) and gives something small; a function of a module, so that others find it. It may
        be called twice for a task, at the same time too: files that it writes appear whole.
    shared : what all tasks need; can be pickled, with absolute paths.
    tasks : one record each. names : of the tasks, as a message names them.
    what : tasks in words, plural.
    folder : into which what is shared is written for other processes; every worker has it under this name.
    bytes_each : memory that a task takes at most.
    again : what the user can do where tasks failed.
    at_once : tasks that run at the same time in threads; None: as many as threads. 1 where a task has its own threads.
    """

    function: Callable[[S, T], R]
    shared: S
    tasks: Sequence[T]
    names: Sequence[str]
    what: str
    folder: Path
    bytes_each: int
    again: str = "run the command again"
    at_once: int | None = None


class Executor(Protocol):
    """Does work somewhere."""

    def run(self, work: Work[S, T, R], report: Report | None = None) -> list[R]:
        """The results in the order of the tasks.

        Parameters
        ----------
        report : called with the share that is done.

        Raises
        ------
        InputError
            That a task raised; the others are given up.
        TasksFailedError
            When tasks have no result, after all others were done.
        """
        ...


@dataclass(frozen=True)
class Workplace:
    """Who does tasks, and the folder into which what they share is written for other processes."""

    executor: Executor
    folder: Path


class TasksFailedError(Exception):
    """Some tasks have no result; the message names them.

    Parameters
    ----------
    failures : (name, reason) of each. count : tasks there were. what : tasks in words, plural. again : remedy.
    """

    def __init__(self, failures: Sequence[tuple[str, str]], count: int, what: str, again: str):
        self.failures = tuple(failures)
        named = "; ".join(f"{name} ({reason})" for name, reason in self.failures[:MOST_NAMED])
        rest = len(self.failures) - MOST_NAMED
        more = f"; and {rest} more" if rest > 0 else ""
        super().__init__(f"{len(failures)} of {count} {what} could not be computed: {named}{more} — {again}")

    def __reduce__(self) -> Any:
        return _same_error, (str(self), self.failures)


def _same_error(text: str, failures: tuple[tuple[str, str], ...]) -> TasksFailedError:
    error = TasksFailedError.__new__(TasksFailedError)
    Exception.__init__(error, text)
    error.failures = failures
    return error


@dataclass(frozen=True)
class Outcome:
    """What came of a task.

    Parameters
    ----------
    value : its result. stop : an error that ends the work. failed : why it has no result, '' where it has one.
    trace : where it failed, for developers. cause : the exception itself, in this process.
    """

    value: Any = None
    stop: Exception | None = None
    failed: str = ""
    trace: str = ""
    cause: Exception | None = field(default=None, compare=False)

    def __getstate__(self) -> dict[str, Any]:
        # an exception of any kind may not be made again elsewhere
        return {**self.__dict__, "cause": None}


def outcome_of(function: Callable[..., Any], *arguments: Any) -> Outcome:
    """The outcome of a call, whatever it raises.

    Bad input, too little memory and a full disk end the work: other tasks would meet the same.
    """
    try:
        return Outcome(function(*arguments))
    except (InputError, MemoryError) as error:
        return Outcome(stop=error)
    except Exception as error:
        if isinstance(error, OSError) and error.errno in NO_SPACE:
            return Outcome(stop=error)
        said = " ".join(str(error).split())[:300]
        text = f"{type(error).__name__}: {said}" if said else type(error).__name__
        return Outcome(failed=text, trace=traceback.format_exc(), cause=error)


class Ledger(Generic[R]):
    """Outcomes as they come in.

    Parameters
    ----------
    work : whose tasks they belong to. report : called with the share that is done.
    """

    def __init__(self, work: Work[Any, Any, R], report: Report | None):
        self._work, self._report = work, report
        self._outcomes: dict[int, Outcome] = {}

    def take(self, number: int, outcome: Outcome) -> None:
        """Keep the outcome of a task.

        Raises
        ------
        InputError, MemoryError, OSError
            That ends the work.
        """
        if outcome.stop is not None:
            raise outcome.stop
        self._outcomes[number] = outcome
        if self._report is not None:
            self._report(len(self._outcomes) / len(self._work.tasks))

    def values(self) -> list[R]:
        """Results in the order of the tasks.

        Raises
        ------
        TasksFailedError
        """
        work = self._work
        none = Outcome(failed="it was not begun")
        outcomes = [self._outcomes.get(k, none) for k in range(len(work.tasks))]
        failed = [(name, one) for name, one in zip(work.names, outcomes, strict=True) if one.failed]
        if not failed:
            return [one.value for one in outcomes]
        error = TasksFailedError([(name, one.failed) for name, one in failed], len(outcomes), work.what, work.again)
        error.add_note(failed[0][1].trace)
        raise error from failed[0][1].cause
