"""How kernels are compiled: cached on disk where that is possible, releasing the interpreter lock, always serial.

Kernels run in threads over chunks (see `adjustment.parallel`); numba's own parallel loops are not used, which keeps
compilation short and sums reproducible.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import njit
from numba.core.cpu import CPUTargetOptions

from aerotri.kernel_cache import SharedCache

OPTIONS: dict[str, Any] = {
    "nogil": True, "error_model": "numpy", "fastmath": {"contract"},
    # nothing here is handed to C: the entry for it would be compiled for nothing
    "no_cfunc_wrapper": True,
}  # fmt: skip

_state: dict[str, Any] = {"cached": True, "folders": set(), "said": False, "ahead": False}


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function on first use. Without a writable place for the cache it is compiled anew in every run."""
    return _compiled(function, OPTIONS)


def leaf_kernel(function: Callable[..., Any]) -> Any:
    """As `kernel`, for a function that makes no array and is called for every point or ray: put into its callers.

    Numba hands an array over as seven numbers or more, and counts who holds it: at every call some hundreds of numbers
    and sixty counts, half of the time of the assembly. A function that makes no array has nothing to count. A numba
    that does not know the option counts on.
    """
    options = {**OPTIONS, "forceinline": True}
    return _compiled(function, {**options, "_nrt": False} if hasattr(CPUTargetOptions, "_nrt") else options)


def _compiled(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    compiled: Any = njit(**options)(function)
    if compiled is function:  # NUMBA_DISABLE_JIT
        return compiled
    try:
        # where numba puts its own cache for cache=True
        compiled._cache = SharedCache(function)
    except RuntimeError:  # numba found no writable place
        _state["cached"] = False
        return compiled
    _state["folders"].add(Path(compiled.stats.cache_path))
    return compiled


def inlined(function: Callable[..., Any]) -> Any:
    """A small kernel put into its callers."""
    return njit(**OPTIONS, inline="always")(function)


def compiled_ahead() -> None:
    """Say that other processes compile for this one; what they have kept already makes it no later run."""
    _state["ahead"] = True


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
    elif _state["ahead"] or _keep_nothing(_state["folders"]):
        notice = "compiling kernels, in this first run only (10 to 30 s)"
    _state["said"] = bool(notice)
    return notice


def _keep_nothing(folders: set[Path]) -> bool:
    """Whether nothing is kept of any kernel: many folders stay empty, as their kernels are part of others or not called
    by every command."""
    return bool(folders) and not any(any(folder.glob("*.nbi")) for folder in folders)
