"""Kill workers in mid-run: does every kind of task end with the files that it writes otherwise?

Every command that has `--executor` is run in threads, then with processes and with Dask, while its workers are killed
(SIGKILL) at random moments, one after the other: any process that the program has started and that does tasks. No more
are killed than a task is begun again. The files are compared with those of threads one by one; tables in Parquet and
GeoPackages by content, JSON without what says when and how long. `tests/` kill one of every kind of task by name; here
it is chance. Prints Markdown.

Example
-------
    python tools/prove/kill_workers.py PHOTOGRAPHS FOLDER --runs 3 > tools/results/kill_workers.md
"""

from __future__ import annotations

import argparse
import os
import random
import shlex
import shutil
import signal
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmark"))

from benchmark_executors import commands, content, prepare, run, target

KILLING = ("processes:2", "dask:local:2")
MOST_KILLS = 2
"""Of one run: a task that was begun three times is given up."""
COPIED = b"multiprocessing.forkserver"
"""In the command line of the process that workers are copies of, and in theirs."""
WORKER_MARKS = (b"spawn_main", b"multiprocessing-fork", COPIED)
"""In the command line of a process that multiprocessing has started."""
LEAST_S = 0.5
"""A worker that has been there for less is beginning, and does nothing yet."""


@dataclass(frozen=True)
class Ended:
    """A run: exit code, workers that were killed, what it said."""

    code: int
    killed: int
    said: str


def workers_of(program: int) -> list[int]:
    """Processes that a program, or one of its processes, has started to do tasks."""
    parents: dict[int, int] = {}
    for place in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            parents[int(place.name)] = int((place / "stat").read_text().rpartition(")")[2].split()[1])
    own, found = {program}, []
    while more := {child for child, parent in parents.items() if parent in own} - own:
        own |= more
    for process in own - {program}:
        with suppress(OSError):
            line = line_of(process)
            is_worker = any(mark in line for mark in WORKER_MARKS)
            is_original = COPIED in line and COPIED not in line_of(parents[process])
            if is_worker and not is_original and age_of(process) > LEAST_S:
                found.append(process)
    return found


def line_of(process: int) -> bytes:
    """Command line of a process."""
    return Path(f"/proc/{process}/cmdline").read_bytes()


def age_of(process: int) -> float:
    """Seconds since a process was started."""
    begun = int(Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[19]) / os.sysconf("SC_CLK_TCK")
    return float(Path("/proc/uptime").read_text().split()[0]) - begun


def killed(words: list[str], seconds: float, chance: random.Random) -> Ended:
    """Run a command that takes so long; kill workers of it, at moments counted from when there are any."""
    line = [sys.executable, "-m", "aerotri", *words]
    program = subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    count, wait_s, since = 0, chance.uniform(0.0, 0.4) * seconds, None
    while program.poll() is None:
        there = workers_of(program.pid) if count < MOST_KILLS else []
        if there and since is None:
            since = time.monotonic()
        if there and since is not None and time.monotonic() - since > wait_s:
            with suppress(ProcessLookupError):
                os.kill(chance.choice(there), signal.SIGKILL)
                count, wait_s, since = count + 1, chance.uniform(0.0, 0.4) * seconds, None
        time.sleep(0.05)
    assert program.stderr is not None
    return Ended(program.returncode, count, program.stderr.read()[-300:])


def row(name: str, words: tuple[str, ...], folder: Path, runs: int, chance: random.Random) -> tuple[str, list[str]]:
    """A row of the table, and what went wrong."""
    whole = folder / f"threads_{name.replace(' ', '_')}"
    shutil.rmtree(whole, ignore_errors=True)
    seconds = run([*words, "--out", target(name, whole), "--executor", "threads"])
    expected, cells, wrong = content(whole), [], []
    for executor in KILLING:
        count = same = 0
        for k in range(runs):
            out = folder / "killed"
            shutil.rmtree(out, ignore_errors=True)
            ended = killed([*words, "--out", target(name, out), "--executor", executor], seconds, chance)
            count += ended.killed
            found = content(out) if ended.code in (0, 1) and out.exists() else {}
            differ = sorted(file for file in expected.keys() | found.keys() if expected.get(file) != found.get(file))
            same += not differ
            if differ:
                wrong.append(f"- {name}, {executor}, run {k + 1}: exit {ended.code}, {', '.join(differ)}: {ended.said}")
        cells += [f"{count}", f"{same} of {runs}"]
    return f"| {name} | {len(expected)} | {' | '.join(cells)} |", wrong


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("photographs", type=Path)
    parser.add_argument("folder", type=Path, help="to work in")
    parser.add_argument("--runs", type=int, default=3, help="of every command with each executor")
    parser.add_argument("--commands", nargs="+", help="all where not given")
    parser.add_argument("--tying", default="", help="further words of tiepoints, such as '--focal-length-mm 8.8'")
    parser.add_argument("--seed", type=int, default=1, help="of the moments")
    options = parser.parse_args()
    tying = shlex.split(options.tying)
    prepare(options.photographs, options.folder, tying)
    print(f"# Workers killed in mid-run (tools/prove/kill_workers.py), {options.runs} runs of every command\n")
    print("| command | files compared | " + " | ".join(f"{one}: killed | the same files" for one in KILLING) + " |")
    print("|" + "---|" * 6, flush=True)
    chance, failures = random.Random(options.seed), []
    for name, words in commands(options.photographs, options.folder, "", tying).items():
        if not options.commands or name in options.commands:
            line, wrong = row(name, words, options.folder, options.runs, chance)
            failures += wrong
            print(line, flush=True)
    print("\n" + ("\n".join(["Not the same:", *failures]) if failures else "Every run ended with the same files."))
    return 1 if failures else 0


if __name__ == "__main__":
    raise SystemExit(main())
