"""What a command costs the very first time: kernels compiled, for which types, and how long each takes.

Example
-------
    python tools/benchmark/benchmark_first_run.py adjust blocks/frederiksstad_ultracam
    python tools/benchmark/benchmark_first_run.py --repeats 3 --out build/first_run adjust blocks/frederiksstad_ultracam

Measures a command in a process of its own with an empty folder for compiled kernels, and again with the filled one:
seconds of the clock, and of the processor in the command itself. Processes that compile ahead for it are not counted
(AEROTRI_THREADS=1 starts none). It listens to the compiler within the process on purpose.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from typing import Any


@dataclass(frozen=True)
class Run:
    """One run of the command: seconds of the clock, of the processor, and what was compiled, in its own process.

    Parameters
    ----------
    kernels : name, count of signatures and own seconds of the processor, those of kernels called in it left out.
    """

    clock: float
    processor: float
    kernels: tuple[tuple[str, int, float], ...]


def main() -> None:
    """Run the command with an empty and with a filled folder, print both and what was compiled."""
    arguments = _arguments()
    if arguments.child:
        raise SystemExit(_child(arguments.child, arguments.record, arguments.command))
    first, second = [], []
    for _ in range(arguments.repeats):
        with tempfile.TemporaryDirectory(prefix="aerotri_first_run_") as folder:
            first.append(_measured(Path(folder), arguments.command, arguments.record))
            second.append(_measured(Path(folder), arguments.command))
    text = _table(arguments.command, first, second, arguments.most)
    print(text)
    if arguments.out:
        arguments.out.mkdir(parents=True, exist_ok=True)
        (arguments.out / "first_run.md").write_text(text, encoding="utf-8")
        runs = {"first": [asdict(one) for one in first], "second": [asdict(one) for one in second]}
        (arguments.out / "first_run.json").write_text(json.dumps(runs, indent=1), encoding="utf-8")


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=1, help="pairs of runs, of which the median counts")
    parser.add_argument("--most", type=int, default=30, help="kernels that the table names (default 30)")
    parser.add_argument("--out", type=Path, help="folder for first_run.md and first_run.json")
    parser.add_argument("--record", type=Path, help="file to write with the kernels that the command calls, in order")
    parser.add_argument("--child", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("command", nargs=argparse.REMAINDER, help="of aerotri, with its arguments")
    arguments = parser.parse_args()
    if not arguments.command:
        parser.error("give a command of aerotri, such as: adjust blocks/frederiksstad_ultracam")
    return arguments


def _measured(folder: Path, command: list[str], record: Path | None = None) -> Run:
    """The command in a process of its own; `folder` keeps the compiled kernels."""
    told, results = folder / "told.json", folder / "results"
    shutil.rmtree(results, ignore_errors=True)
    out = ["--out", str(results)] if command[0] == "adjust" and "--out" not in command else []
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(folder / "kernels")}
    recorded = ["--record", str(record)] if record else []
    line = [sys.executable, __file__, "--child", str(told), *recorded, *command, *out]
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    done = subprocess.run(line, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    clock, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        raise SystemExit(done.stderr)
    kernels = tuple((name, count, seconds) for name, count, seconds in json.loads(told.read_text()))
    return Run(clock, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, kernels)


def _child(told: Path, record: Path | None, command: list[str]) -> int:
    """The command itself, with every compilation written down."""
    from numba.core import event

    listener = _listener(event, told, record)
    told.write_text("[]")
    event.register("numba:compile", listener)
    from aerotri.cli import main as aerotri

    sys.argv = ["aerotri", *command]
    aerotri()
    return 0


def _listener(event: Any, told: Path, record: Path | None) -> Any:
    from aerotri.execution.first_run import as_listed

    class Listener(event.Listener):
        """Own seconds of every kernel; compilation of what it calls happens within its own."""

        def __init__(self) -> None:
            self._open: list[list[float]] = []
            self._own: dict[str, list[float]] = {}
            self._called: list[tuple[str, tuple[Any, ...]]] = []

        def on_start(self, event: Any) -> None:
            self._open.append([time.thread_time(), 0.0])

        def on_end(self, event: Any) -> None:
            start, within = self._open.pop()
            whole = time.thread_time() - start
            if self._open:
                self._open[-1][1] += whole
            function = event.data["dispatcher"].py_func
            if function.__module__.startswith("aerotri."):
                self._called.append((f"{function.__module__}:{function.__name__}", event.data["args"]))
            name = f"{function.__module__.removeprefix('aerotri.')}.{function.__name__}"
            self._own.setdefault(name, []).append(whole - within)
            if not self._open:
                # now, for a command may end its process without a word
                rows = [(name, len(times), sum(times)) for name, times in self._own.items()]
                told.write_text(json.dumps(sorted(rows, key=lambda row: -row[2])))
                if record:
                    record.write_text(as_listed(self._called), encoding="utf-8")

    return Listener()


def _table(command: list[str], first: list[Run], second: list[Run], most: int) -> str:
    run = sorted(first, key=lambda one: one.processor)[len(first) // 2]
    lines = [
        f"# First run of `aerotri {' '.join(command)}`",
        "",
        "| | clock [s] | processor [s] | kernels compiled | signatures |",
        "| --- | --- | --- | --- | --- |",
        _row("first run", first),
        _row("second run", second),
        "",
        f"Compiled in the process itself: {sum(row[2] for row in run.kernels):.1f} s of the processor.",
        "",
        "| kernel | signatures | own time [s] |",
        "| --- | --- | --- |",
        *(f"| {name} | {count} | {seconds:.2f} |" for name, count, seconds in run.kernels[:most]),
        "",
    ]
    return "\n".join(lines)


def _row(name: str, runs: list[Run]) -> str:
    clock, processor = median(run.clock for run in runs), median(run.processor for run in runs)
    kernels = median(len(run.kernels) for run in runs)
    signatures = median(sum(row[1] for row in run.kernels) for run in runs)
    return f"| {name} | {clock:.1f} | {processor:.1f} | {kernels:.0f} | {signatures:.0f} |"


if __name__ == "__main__":
    main()
