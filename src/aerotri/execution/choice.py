"""Where tasks are to run, as a user states it."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from typing import Literal

from aerotri.conventions import InputError, whole_number
from aerotri.memory import fitting

THREADS = "threads"
"""Where nothing is stated."""
FORMS = "threads, processes:N, dask:ADDRESS or dask:local:N"
Kind = Literal["threads", "processes", "dask"]


@dataclass(frozen=True)
class Choice:
    """Where tasks run.

    Parameters
    ----------
    kind : 'threads', 'processes' or 'dask'.
    workers : processes of this machine; 0 where others decide.
    address : of a Dask scheduler, or the JSON file in which it wrote it; '' where there is none yet.
    """

    kind: Kind
    workers: int = 0
    address: str = ""


def chosen(text: str) -> Choice:
    """What a user states, understood.

    Parameters
    ----------
    text : 'threads', 'processes:N', 'dask:ADDRESS' or 'dask:local:N'.

    Raises
    ------
    InputError
        When it is none of these, N is less than 1, or Dask is not installed.
    """
    word, _, rest = text.strip().partition(":")
    if word == "threads" and not rest:
        return Choice("threads")
    if word == "processes":
        return Choice("processes", _count(text, rest, "processes:4"))
    if word == "dask" and rest:
        _refuse_without_dask()
        local, _, number = rest.partition(":")
        is_local = local == "local"
        return Choice("dask", _count(text, number, "dask:local:4")) if is_local else Choice("dask", 0, rest)
    raise InputError(f"'{text}' is not an executor", f"give {FORMS}")


def fewer_than(count: int, bytes_each: float, what: str) -> str:
    """The remedy where so many tasks do not fit into memory together: how many do."""
    most = int(min(fitting(bytes_each), count - 1))
    return f"give at most {most} {what}" if most > 0 else "free memory, or take another machine"


def _count(text: str, number: str, example: str) -> int:
    count = whole_number(number)
    if not count:
        raise InputError(
            f"executor '{text[:60]}': '{number[:60]}' is not a number of processes",
            f"give a whole number of 1 or more, such as {example}",
        )
    return count


def _refuse_without_dask() -> None:
    if find_spec("distributed") is None:
        raise InputError("Dask is not installed", "pip install 'aerotri[cluster]'")
