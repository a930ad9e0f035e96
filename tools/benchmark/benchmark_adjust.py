"""How fast the adjustment is, with its peers in the same run.

Example
-------
    python tools/benchmark/benchmark_adjust.py --out build/benchmark
    python tools/benchmark/benchmark_adjust.py --sizes 132 581 --repeats 1
    python tools/benchmark/benchmark_adjust.py --sizes 60000 --programs aerotri aerotri-44 --repeats 1

Needs pyceres beside the package (pip install 'aerotri[ceres]'). CHOLMOD and Pardiso are measured where cvxopt and
pypardiso are found; they need not be installed with the package:

    python -m venv peers && peers/bin/pip install cvxopt pypardiso
    python tools/benchmark/benchmark_adjust.py --peers-path peers/lib/python3.11/site-packages
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path

from adjusting.blocks import make_block
from adjusting.measure import FACTORS, PROGRAMS, Program, Run, Settings, programs_for, run_child
from adjusting.plot import plot_times
from adjusting.summary import rows_of
from adjusting.table import markdown


def main() -> None:
    """Measure, print the table, write table, raw numbers and plot."""
    arguments = _arguments()
    settings = Settings(arguments.threads, arguments.limit, tuple(arguments.peers_path))
    runs: list[Run] = []
    try:
        with tempfile.TemporaryDirectory(prefix="aerotri_benchmark_") as folder:
            for size in arguments.sizes:
                runs += _measure(size, Path(folder), arguments, settings)
    except KeyboardInterrupt:
        print("\ninterrupted: what was measured until now", file=sys.stderr)
    if not runs:
        raise SystemExit(1)
    table = markdown(runs, arguments.threads)
    print(table)
    if arguments.out:
        _write(arguments.out, runs, table, arguments.threads)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=int, nargs="+", default=[132, 581, 2282, 10_000], help="photographs")
    parser.add_argument("--repeats", type=int, default=5, help="runs of every program, of which the median counts")
    parser.add_argument("--programs", nargs="+", choices=sorted(PROGRAMS), default=list(PROGRAMS), help="default: all")
    parser.add_argument("--no-factors", action="store_true", help="leave out CHOLMOD and Pardiso")
    parser.add_argument("--threads", type=int, default=2, help="of every program (default 2)")
    parser.add_argument("--limit", type=float, default=1800.0, help="seconds after which a measurement is given up")
    parser.add_argument("--peers-path", nargs="*", default=[], help="folders with cvxopt and pypardiso")
    parser.add_argument("--out", type=Path, help="folder for benchmark.md, benchmark.json and the plot")
    return parser.parse_args()


def _measure(size: int, folder: Path, arguments: argparse.Namespace, settings: Settings) -> list[Run]:
    """All programs on one block, in turn, and again from the first as often as asked for."""
    _say(f"{size} photographs: simulating")
    block = make_block(size, folder)
    programs = programs_for(size, arguments.programs) + ([] if arguments.no_factors else list(FACTORS))
    runs: list[Run] = []
    given_up: set[str] = set()
    for repeat in range(arguments.repeats):
        for program in programs:
            if program.name in given_up:
                continue
            run = run_child(program, size, block, repeat, settings)
            _report(run, program, arguments.repeats)
            runs.append(run)
            if run.failure:
                given_up.add(program.name)
    return runs


def _report(run: Run, program: Program, repeats: int) -> None:
    times = run.outcome.get("seconds", {})
    text = run.failure or ", ".join(f"{phase} {value:.3f} s" for phase, value in times.items()) or "done"
    _say(f"{run.photographs} photographs, {program.name}, run {run.repeat + 1} of {repeats}: {text}")


def _say(text: str) -> None:
    print(f"{time.strftime('%H:%M:%S')}  {text}", file=sys.stderr, flush=True)


def _write(folder: Path, runs: list[Run], table: str, threads: int) -> None:
    from aerotri import drawing

    folder.mkdir(parents=True, exist_ok=True)
    (folder / "benchmark.md").write_text(table, encoding="utf-8")
    (folder / "benchmark.json").write_text(json.dumps([run.as_dict() for run in runs], indent=1), encoding="utf-8")
    drawing.save_plots({"benchmark_adjust": plot_times(rows_of(runs), threads)}, folder)
    _say(f"written to {folder}")


if __name__ == "__main__":
    main()
