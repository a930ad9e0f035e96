"""How kernels are compiled: cached on disk where that is possible, releasing the interpreter lock, always serial.

Kernels run in threads over chunks (see `adjustment.parallel`); numba's own parallel loops are not used, which keeps
compilation short and sums reproducible.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import njit

_state: dict[str, Any] = {"cached": True, "example": None, "said": False}


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function on first use. Without a writable place for the cache it is compiled anew in every run."""
    try:
        compiled = njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})(function)
    except RuntimeError:  # numba found no writable place
        _state["cached"] = False
        return njit(nogil=True, error_model="numpy", fastmath={"contract"})(function)
    _state["example"] = compiled
    return compiled


def inlined(function: Callable[..., Any]) -> Any:
    """A small kernel put into its callers."""
    return njit(nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")(function)


def compilation_notice() -> str:
    """A sentence for the user when kernels have to be compiled in this run; '' when they come from the cache.

    It is given once: a command of several steps asks at each of them.
    """
    if _state["said"]:
        return ""
    notice = ""
    if not _state["cached"]:
        notice = (
            "compiling kernels; there is no writable place to keep them (set NUMBA_CACHE_DIR), so every run does this"
        )
    elif _state["example"] is not None and not any(Path(_state["example"].stats.cache_path).glob("*.nbi")):
        notice = "compiling kernels, in this first run only (about 20 s)"
    _state["said"] = bool(notice)
    return notice
