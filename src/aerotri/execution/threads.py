"""Tasks in threads of this process."""

from __future__ import annotations

import os
from concurrent.futures import Future, ThreadPoolExecutor, as_completed

from aerotri.conventions import whole_number
from aerotri.execution.work import Ledger, Outcome, R, Report, S, T, Work, outcome_of


def thread_count() -> int:
    """Threads to work in: AEROTRI_THREADS, or the processors this process may use."""
    asked = whole_number(os.environ.get("AEROTRI_THREADS", ""))
    if asked:
        return asked
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Threads:
    """As many tasks at once as there are threads, or as the work wants."""

    def run(self, work: Work[S, T, R], report: Report | None = None) -> list[R]:
        """See `work.Executor`."""
        from threadpoolctl import threadpool_limits

        ledger, count = Ledger(work, report), work.at_once or thread_count()
        if count == 1:
            # in the calling thread, which an interrupt reaches
            with threadpool_limits(1, "blas"):
                for k, task in enumerate(work.tasks):
                    ledger.take(k, outcome_of(work.function, work.shared, task))
            return ledger.values()
        with threadpool_limits(1, "blas"), ThreadPoolExecutor(count) as pool:
            futures: dict[Future[Outcome], int] = {
                pool.submit(outcome_of, work.function, work.shared, task): k for k, task in enumerate(work.tasks)
            }
            try:
                for future in as_completed(futures):
                    ledger.take(futures[future], future.result())
            except BaseException:
                pool.shutdown(wait=True, cancel_futures=True)
                raise
        return ledger.values()
