"""Threads and memory, in one place.

Kernels run over a fixed number of chunks, whatever the machine, so that sums repeat. BLAS gets one thread where more
would gain little: its threads wait for one another at every call, on a busy machine for a long time.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from functools import cache
from itertools import pairwise
from typing import TypeVar

import numpy as np
from threadpoolctl import ThreadpoolController

from aerotri.conventions import InputError
from aerotri.execution.threads import thread_count
from aerotri.memory import available_bytes, two_sizes

__all__ = ["blas_threads", "chunk_bounds", "refuse_more_than_there_is", "run_chunks", "thread_count"]

T = TypeVar("T")

CHUNKS = 4
"""Pieces of every parallel sum. A constant of the program, never the number of threads: it decides the rounding."""

SMALL_WORK = 5e9
"""Multiplications of a factorisation below which two threads of BLAS gain less than a fifth: a tenth of a second."""


@cache
def _blas() -> tuple[ThreadpoolController, int]:
    """BLAS, and the threads that it takes by itself."""
    controller = ThreadpoolController().select(user_api="blas")
    return controller, max((library["num_threads"] for library in controller.info()), default=1)


def blas_threads(multiplications: float) -> AbstractContextManager[object]:
    """A context in which BLAS takes one thread for fewer than SMALL_WORK multiplications, for more all it had."""
    controller, most = _blas()
    return controller.limit(limits=most if multiplications >= SMALL_WORK else 1, user_api="blas")


def chunk_bounds(work: np.ndarray, chunks: int = CHUNKS) -> list[tuple[int, int]]:
    """Ranges of items with about equal work.

    Parameters
    ----------
    work : (P,) cost of each item.
    """
    total = np.concatenate([[0.0], np.cumsum(work)])
    cuts = np.searchsorted(total, np.linspace(0.0, total[-1], chunks + 1)[1:-1])
    edges = [0, *(int(c) for c in cuts), len(work)]
    return [(a, b) for a, b in pairwise(edges) if b > a]


FEW_RAYS = 4000
"""Rays below which kernels run in the calling thread: beginning threads takes as long as their work, some
milliseconds."""


def run_chunks(function: Callable[[int], T], count: int, rays: float = np.inf) -> list[T]:
    """function(0), …, function(count − 1) in threads; results in order.

    Parameters
    ----------
    rays : in all chunks; of few no threads are begun.
    """
    threads = min(thread_count(), count) if rays >= FEW_RAYS else 1
    if threads <= 1:
        return [function(k) for k in range(count)]
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(function, range(count)))


def refuse_more_than_there_is(needed: int, what: str) -> None:
    """Say before taking it that the memory will not do.

    Raises
    ------
    InputError
    """
    there = available_bytes()
    if there is not None and needed > there:
        wanted, free = two_sizes(needed, there)
        raise InputError(
            f"{what} need {wanted} of memory, {free} are free",
            "use a larger machine, fewer additional parameters or conditions, or divide the block",
        )
