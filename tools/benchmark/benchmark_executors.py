"""How long commands take with Dask and with processes, over threads, and whether they write the same files.

Begins with photographs: `tiepoints` and `adjust` make what the others need. Every command is a program started anew, so
that beginning workers and compiling nothing twice counts. Two workers have two processors, as two threads have. What
says when and how long is left out of the comparison of files (of GeoPackages the table of contents). Prints Markdown.

Example
-------
    python tools/benchmark/benchmark_executors.py PHOTOGRAPHS FOLDER --repeats 3 > tools/results/executors.md
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import shlex
import shutil
import sqlite3
import statistics
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import closing
from itertools import islice
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

import aerotri

EXECUTORS = ("threads", "processes:2", "dask:local:2")
HEAD = "| command | " + " | ".join(f"{one} s" for one in EXECUTORS) + " | Dask over threads | files |"
CHANGING = ("computed", "seconds", "timings_s", "marking_page", "minutes")
"""Keys of JSON files that say when and how long."""
IN_PARTS = 40
"""Photographs of a strip of the block that is adjusted in parts."""
SETS = ("none", "brown:K1+K2", "brown:K1+K2+K3+P1+P2", "legendre:3x3")
SAME_NAME = (".json", ".csv", ".tif", ".gpkg", ".parquet", ".npz", ".laz", ".geojson")
"""Endings of the files that are compared."""


def commands(photographs: Path, folder: Path, resolution: str, tying: Sequence[str] = ()) -> dict[str, tuple[str, ...]]:
    """The words of every command without its folder and executor; later ones need the folders of earlier ones."""
    cell = ("--resolution", resolution) if resolution else ()
    block, result, dsm = (str(folder / name) for name in ("block", "result", "threads_dsm"))
    return {
        "tiepoints": ("tiepoints", str(photographs), *tying),
        "dtm": ("dtm", result, str(photographs), "--no-plots"),
        "dsm": ("dsm", result, str(photographs), "--no-plots", *cell),
        "ortho": ("ortho", result, str(photographs), dsm, "--no-plots"),
        "imgeo": ("imgeo", result, str(photographs)),
        "halves": ("halves", result),
        "adjust in parts": ("adjust", str(folder / "in_parts"), "--no-plots"),
        "demcor": ("demcor", result, f"{dsm}/dsm.tif", "--pair", *first_two(folder)),
        "compare-parameters": ("compare-parameters", block, *(word for one in SETS for word in ("--set", one))),
    }


def first_two(folder: Path) -> list[str]:
    """Names of the first two photographs: `demcor` takes the DEM for one of their model."""
    with (folder / "result" / "images.csv").open(encoding="utf-8", newline="") as file:
        return [row["image"] for row in islice(csv.DictReader(file), 2)]


def target(name: str, out: Path) -> str:
    """What a command is to write, in a folder of its own."""
    if name != "demcor":
        return str(out)
    out.mkdir(parents=True)
    return str(out / "corrected.tif")


def run(words: Sequence[str]) -> float:
    """Seconds of a command."""
    begun = time.perf_counter()
    done = subprocess.run([sys.executable, "-m", "aerotri.cli", *words], capture_output=True, text=True)
    if done.returncode not in (0, 1):
        raise SystemExit(f"aerotri {' '.join(words)}: {done.stderr or done.stdout}")
    return time.perf_counter() - begun


def content(folder: Path) -> dict[str, Any]:
    """What a folder holds, by name, without what says when and how long."""
    found: dict[str, Any] = {}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.suffix not in SAME_NAME or "cache" in name:
            continue
        if path.suffix == ".json":
            found[name] = without(json.loads(path.read_text(encoding="utf-8")))
        elif path.suffix == ".gpkg":
            with closing(sqlite3.connect(path)) as base:
                found[name] = [line for line in base.iterdump() if '"gpkg_contents"' not in line]
        elif path.suffix == ".parquet":
            found[name] = repr(pq.read_table(path).to_pydict())
        else:
            found[name] = path.read_bytes()
    return found


def without(value: Any) -> Any:
    """JSON without the changing keys."""
    if isinstance(value, dict):
        return {name: without(one) for name, one in value.items() if name not in CHANGING}
    return [without(one) for one in value] if isinstance(value, list) else value


def prepare(photographs: Path, folder: Path, tying: Sequence[str] = ()) -> None:
    """Make what commands need beside photographs: a block, its result, and the block in parts."""
    folder.mkdir(parents=True, exist_ok=True)
    block, result, in_parts = str(folder / "block"), str(folder / "result"), folder / "in_parts"
    if not (folder / "result").is_dir():
        run(["tiepoints", str(photographs), *tying, "--out", block])
        run(["adjust", block, "--parameters", "brown:K1+K2", "--out", result, "--no-plots"])
    if not in_parts.is_dir():
        plan = aerotri.example_flight()
        plan["flight"]["images_per_strip"] = IN_PARTS
        aerotri.divide(aerotri.simulate(plan, seed=1).block, in_parts, parts=3)


def measured(name: str, words: tuple[str, ...], folder: Path, repeats: int) -> str:
    """A row: the median of every executor, and whether the files are the same."""
    times: dict[str, list[float]] = {executor: [] for executor in EXECUTORS}
    for _ in range(repeats):
        for executor in EXECUTORS:
            out = folder / f"{executor.split(':')[0]}_{name.replace(' ', '_')}"
            shutil.rmtree(out, ignore_errors=True)
            times[executor].append(run([*words, "--out", target(name, out), "--executor", executor]))
    one, *others = (content(folder / f"{executor.split(':')[0]}_{name.replace(' ', '_')}") for executor in EXECUTORS)
    differ = sorted(
        {file for other in others for file in one.keys() | other.keys() if one.get(file) != other.get(file)}
    )
    middle = {executor: statistics.median(of_one) for executor, of_one in times.items()}
    said = f"{len(one)} the same" if not differ else f"{', '.join(differ)} differ"
    ratio = middle[EXECUTORS[-1]] / middle[EXECUTORS[0]]
    return f"| {name} | {' | '.join(f'{middle[executor]:.1f}' for executor in EXECUTORS)} | {ratio:.2f} | {said} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("photographs", type=Path)
    parser.add_argument("folder", type=Path, help="to work in")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--commands", nargs="+", help="all where not given")
    parser.add_argument("--tying", default="", help="further words of tiepoints, such as '--focal-length-mm 8.8'")
    parser.add_argument("--resolution", default="", help="cell of dsm, m; two GSD where not given")
    options = parser.parse_args()
    folder = options.folder
    tying = shlex.split(options.tying)
    prepare(options.photographs, folder, tying)
    print(f"# Executors ({os.cpu_count()} processors, runs of every command: {options.repeats}, medians)\n")
    print(HEAD + "\n|" + "---|" * (HEAD.count("|") - 1), flush=True)
    for name, words in commands(options.photographs, folder, options.resolution, tying).items():
        if not options.commands or name in options.commands:
            print(measured(name, words, folder, options.repeats), flush=True)


if __name__ == "__main__":
    main()
