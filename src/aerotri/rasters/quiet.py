"""Rasters without georeference are opened without a warning, from any number of threads at a time."""

from __future__ import annotations

import warnings
from collections.abc import Generator
from contextlib import contextmanager
from threading import Lock


class _Quiet:
    """`warnings.catch_warnings` changes what the whole process does: of several threads the first one that comes in
    changes it, and the last one that leaves brings it back. Each for itself would bring back what another had changed.
    """

    def __init__(self):
        self._lock = Lock()
        self._inside = 0
        self._caught = warnings.catch_warnings()

    def enter(self) -> None:
        from rasterio.errors import NotGeoreferencedWarning

        with self._lock:
            if not self._inside:
                self._caught = warnings.catch_warnings()
                self._caught.__enter__()
                warnings.simplefilter("ignore", NotGeoreferencedWarning)
            self._inside += 1

    def leave(self) -> None:
        with self._lock:
            self._inside -= 1
            if not self._inside:
                self._caught.__exit__(None, None, None)


_QUIET = _Quiet()
MESSAGE = "Dataset has no geotransform"
"""With which rasterio's warning begins."""


def never_told() -> None:
    """No warning for rasters without georeference in this process, for a program that has said so before its threads.

    `warnings.catch_warnings` of another library, left in one thread, brings back the filters as they were before a
    thread beside it came into `quietly`: numba does so where it compiles.
    """
    warnings.filterwarnings("ignore", message=MESSAGE)


@contextmanager
def quietly() -> Generator[None]:
    """Without a warning for rasters of local blocks and photographs, which have no CRS, and for those that are refused
    anyway."""
    _QUIET.enter()
    try:
        yield
    finally:
        _QUIET.leave()
