"""The equations of a result, set up behind the page: what needs them says so until they are there."""

from __future__ import annotations

import threading
from pathlib import Path

from aerotri.bench.prediction import Prediction
from aerotri.conventions import InputError
from aerotri.coordinates import LocalFrame
from aerotri.results.adjustment import Adjustment

BEING_SET_UP, READY = "being set up", "ready"
_one_at_a_time = threading.Lock()
"""Kernels of two results at once take more than twice the time."""


class Equations:
    """Of one result.

    Parameters
    ----------
    result : its folder, None where there is none.
    """

    def __init__(self, result: Path | None):
        self._found: Adjustment | None = None
        self._prediction: Prediction | None = None
        self._state = "the block is not adjusted" if result is None else BEING_SET_UP
        self._thread = None
        if result is not None:
            self._thread = threading.Thread(target=self._open, args=(result,), daemon=True)
            self._thread.start()

    def _open(self, result: Path) -> None:
        from aerotri.opening import open_result

        with _one_at_a_time:
            try:
                found = open_result(result)
                self._found, self._prediction = found, Prediction(found)
                self._state = READY
            except InputError as error:
                self._state = str(error)

    def state(self) -> str:
        """'ready', 'being set up', or why there are none."""
        return self._state

    def wait(self) -> None:
        """Wait until they are there, or cannot be had."""
        if self._thread is not None:
            self._thread.join()

    def get(self) -> Adjustment:
        """The adjustment with its equations.

        Raises
        ------
        InputError
            When they are not there.
        """
        if self._found is None:
            raise InputError(f"the equations are not there: {self._state}", "wait a moment, or adjust again")
        return self._found

    def prediction(self) -> Prediction | None:
        """Where points appear; None where that is not known yet."""
        return self._prediction

    def frame(self) -> LocalFrame | None:
        """The local frame of a block with a CRS, once it is known."""
        return None if self._found is None else self._found.frame
