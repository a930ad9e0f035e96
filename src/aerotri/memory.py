"""Memory predicted before it is taken, so that what cannot fit is refused with what would."""

from __future__ import annotations

import math
from pathlib import Path

from aerotri.conventions import InputError

FAR_MORE = 1e15
"""Bytes that no machine has."""
SHARE = 0.8
"""Of the memory that is free: the rest is for what is not predicted, and for others."""
NAMES_OF_LIMITS = (
    ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory.current"),
    ("/sys/fs/cgroup/memory/memory.limit_in_bytes", "/sys/fs/cgroup/memory/memory.usage_in_bytes"),
)
"""Limit and use of a container, of its two kinds."""


def available_bytes() -> int | None:
    """Memory that may still be taken; None where the system does not tell."""
    told = (_of_machine(), *map(_of_container, NAMES_OF_LIMITS), _of_process())
    known = [value for value in told if value is not None]
    return max(min(known), 0) if known else None


def refuse_beyond_memory(needed: float, what: str, remedy: str) -> None:
    """Say before taking it that the memory will not do.

    Parameters
    ----------
    needed : bytes. what : a subject in the plural. remedy : what would fit; '{share}' in it becomes the share of
        `needed` that does.

    Raises
    ------
    InputError
    """
    there = available_bytes()
    if there is not None and not needed <= SHARE * there:
        share = SHARE * there / needed if needed < float("inf") else 0.0
        wanted, allowed = two_sizes(needed, SHARE * there)
        raise InputError(
            f"{what} need {wanted} of memory; {allowed} may be used, {100.0 * SHARE:.0f} % of what is free",
            remedy.format(share=f"{share:.2g}"),
        )


def fitting(bytes_each: float) -> float:
    """How many things of a size fit into the memory that is free."""
    there = available_bytes()
    return float("inf") if there is None or not bytes_each > 0.0 else SHARE * there / bytes_each


def two_sizes(needed: float, there: float) -> tuple[str, str]:
    """Bytes that are needed and fewer that there are, in words: rounded apart, so that they never seem to be enough."""
    unit, name = (2**30, "GiB") if there >= 2**30 else (2**20, "MiB")
    wanted = f"{math.ceil(10 * needed / unit) / 10:.1f} {name}" if needed < FAR_MORE else "far more than a machine has"
    return wanted, f"{math.floor(10 * there / unit) / 10:.1f} {name}"


def _of_machine() -> int | None:
    try:
        with open("/proc/meminfo", encoding="ascii") as file:
            fields = dict(line.split(":", 1) for line in file)
        return 1024 * int(fields["MemAvailable"].split()[0])
    except (OSError, KeyError, ValueError):
        return None


def _of_container(names: tuple[str, str]) -> int | None:
    try:
        limit, used = (int(Path(name).read_text(encoding="ascii")) for name in names)
        return limit - used
    except (OSError, ValueError):
        return None  # no container, or 'max'


def _of_process() -> int | None:
    """What a limit of the address space (ulimit -v) leaves."""
    try:
        import resource

        limit = resource.getrlimit(resource.RLIMIT_AS)[0]
        if limit == resource.RLIM_INFINITY:
            return None
        with open("/proc/self/statm", encoding="ascii") as file:
            return limit - int(file.read().split()[0]) * resource.getpagesize()
    except (ImportError, OSError, ValueError):
        return None
