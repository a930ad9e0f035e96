"""One measurement, in a process of its own so that its peak memory is its own: reads a job, prints the outcome."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

STATUS, CLEAR = Path("/proc/self/status"), Path("/proc/self/clear_refs")


class Timer:
    """Seconds by phase."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        begun = time.perf_counter()
        yield
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - begun


class Memory:
    """Peak resident memory above what the process held when this was made, bytes."""

    def __init__(self) -> None:
        # 5 resets the kernel's record of the peak
        with suppress(OSError):
            CLEAR.write_text("5")
        self._before = _resident("VmRSS")

    @property
    def peak(self) -> int:
        return max(0, _resident("VmHWM") - self._before)


def _resident(what: str) -> int:
    if STATUS.exists():
        line = next(line for line in STATUS.read_text().splitlines() if line.startswith(what))
        return 1024 * int(line.split()[1])
    import resource

    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def main() -> None:
    """Run the job given as JSON on the command line."""
    job: dict[str, Any] = json.loads(sys.argv[1])
    sys.path.extend(job.get("peers_path", []))
    from adjusting import factors, ours, peers

    tasks = {
        "ours": ours.measure,
        "ceres": peers.measure_ceres,
        "ceres-undamped": peers.measure_ceres_undamped,
        "pycolmap": peers.measure_pycolmap,
        "scipy": peers.measure_scipy,
        "factors": factors.measure,
    }
    outcome = tasks[job["task"]](Path(job["folder"]), job)
    print("\n" + json.dumps(outcome))


if __name__ == "__main__":
    main()
