"""Rasters without georeference are opened without a warning, from any number of threads at a time.

Filters of `warnings` are those of the whole process. A library that brings them back in one thread, as numba does when
it has compiled, takes them from the others too: they cannot silence what one thread opens. What rasterio's modules call
`warnings` is therefore told apart by thread. Warnings that others cause stay as they are.
"""

from __future__ import annotations

import threading
import warnings
from collections.abc import Generator
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from typing import Any

MODULES = ("rasterio._base", "rasterio._io", "rasterio._transform")
"""That warn of rasters without georeference."""


class _OfThread(threading.local):
    """How often a thread is inside `quietly`; a list, so that it may be left from another one."""

    def __init__(self):
        self.inside = [0]


_THREAD = _OfThread()


class _Warnings:
    """The module `warnings`, less what is not to be told in a thread that is inside `quietly`."""

    def __init__(self, silent: type[Warning]):
        self._silent = silent

    def __getattr__(self, name: str) -> Any:
        return getattr(warnings, name)

    def warn(
        self, message: Warning | str, category: type[Warning] | None = None, stacklevel: int = 1, *further: Any,
        **named: Any,
    ) -> None:  # fmt: skip
        """As `warnings.warn`."""
        if _THREAD.inside[0] and category is not None and issubclass(category, self._silent):
            return
        warnings.warn(message, category, stacklevel + 1, *further, **named)


@cache
def _listen() -> None:
    """Stand between rasterio and `warnings`, once a process."""
    from rasterio.errors import NotGeoreferencedWarning

    between = _Warnings(NotGeoreferencedWarning)
    for name in MODULES:
        module = import_module(name)
        if getattr(module, "warnings", None) is warnings:
            module.warnings = between  # pyright: ignore[reportAttributeAccessIssue]


@contextmanager
def quietly() -> Generator[None]:
    """Without a warning for rasters of local blocks and photographs, which have no CRS, and for those that are refused
    anyway."""
    _listen()
    inside = _THREAD.inside
    inside[0] += 1
    try:
        yield
    finally:
        inside[0] -= 1
