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


@contextmanager
def quietly() -> Generator[None]:
    """Without a warning for rasters of local blocks and photographs, which have no CRS, and for those that are refused
    anyway."""
    _QUIET.enter()
    try:
        yield
    finally:
        _QUIET.leave()
