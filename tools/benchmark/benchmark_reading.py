"""How long a block takes to read, beside the bare parser, and what starting and compiling cost.

Example
-------
    python tools/benchmark/benchmark_reading.py --photographs 60000
    python tools/benchmark/benchmark_reading.py --photographs 2282 --repeats 5

A simulated block of that many photographs (130 image points each) is written once as CSV and once as Parquet. The peer
is pyarrow reading the table of image points alone: no names looked up, nothing checked.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

from pyarrow import csv, parquet

import aerotri
from adjusting.blocks import plan_of


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--photographs", type=int, default=10_000)
    parser.add_argument("--repeats", type=int, default=3, help="of which the median counts")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="aerotri_reading_") as place:
        _reading(Path(place), arguments.photographs, arguments.repeats)
        _starting(Path(place), arguments.repeats)


def _reading(place: Path, photographs: int, repeats: int) -> None:
    block = aerotri.simulate(plan_of(photographs), 1).block
    print(f"{len(block.images)} photographs, {len(block.image_points)} image points, {len(block.points)} object points")
    aerotri.convert(block, place / "csv")
    aerotri.convert(block, place / "parquet", tables="parquet")
    del block
    works = {
        "CSV, the block": lambda: aerotri.read_block(place / "csv"),
        "CSV, image points by pyarrow alone": lambda: csv.read_csv(place / "csv" / "image_points.csv"),
        "Parquet, the block": lambda: aerotri.read_block(place / "parquet"),
        "Parquet, image points by pyarrow alone": lambda: parquet.read_table(
            place / "parquet" / "image_points.parquet"
        ),
    }
    for name, work in works.items():
        print(f"{name}: {_median(work, repeats):.2f} s")


def _starting(place: Path, repeats: int) -> None:
    started = [sys.executable, "-m", "aerotri.cli", "--help"]
    print(f"aerotri --help: {_median(lambda: _run(started), repeats):.2f} s")
    aerotri.simulate(plan_of(30), 1).save(place / "small")
    adjusted = [sys.executable, "-m", "aerotri.cli", "adjust", str(place / "small"), "--no-plots"]
    adjusted += ["--out", str(place / "result")]
    cache = {"NUMBA_CACHE_DIR": str(place / "numba")}
    first = _median(lambda: _run(adjusted, cache), 1)
    print(f"30 photographs: the first run, which compiles, {first:.1f} s", end="; ")
    print(f"every other {_median(lambda: _run(adjusted, cache), repeats):.1f} s")


def _run(command: list[str], more: dict[str, str] | None = None) -> None:
    subprocess.run(command, check=True, capture_output=True, env={**os.environ, **(more or {})})


def _median(work: Callable[[], object], repeats: int) -> float:
    taken = []
    for _ in range(repeats):
        begin = time.perf_counter()
        work()
        taken.append(time.perf_counter() - begin)
    return median(taken)


if __name__ == "__main__":
    main()
