"""How fast a DEM is corrected, beside reading and writing the same file with rasterio in the same run.

The sample block is adjusted, its map of models made by `aerotri deform`. Then the command as a user calls it
(`aerotri demcor`, program start, reopening of the result, dZ and σ rasters and seams included) is run in turn with a
program that reads the DEM window by window and writes it again with the same options. Peak memory is that of each
process; a DEM a sixteenth of the size shows that it does not grow.

Example
-------
    python tools/benchmark/benchmark_demcor.py
    python tools/benchmark/benchmark_demcor.py --cells 5000 --repeats 3 --compress none

Measured last on two quiet cores (one run), 20 000 × 20 000 cells, deflate: one model 39.5 s, reading and writing
25.7 s, ratio 1.53 (processor time 1.28), peak memory 454 MiB; a map of 118 models 41.8 s, 17.4 s (a DEM that compresses
better), 2.40 (2.07), 449 MiB. Of the time with a map, cells at seams of tiles are computed one by one; 3 s are program
start and reopening of the result, which with 8000 × 8000 cells makes 2.1 and 3.8 of the ratios. Peak memory 451 MiB at
5000 × 5000 too.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

BLOCK = Path(__file__).resolve().parents[2] / "blocks" / "frederiksstad_ultracam"
PAIR = ("3_009", "3_011")
WINDOW = 1024
HEADER = """\
| DEM | demcor, s | of it start and result, s | read and write, s | ratio | smallest and largest ratio of a pair | \
ratio of processor time | peak memory, MiB | theirs |
|---|---|---|---|---|---|---|---|---|"""
COMPRESSION = {"none": {}, "deflate": {"compress": "deflate", "predictor": 3}, "zstd": {"compress": "zstd"}}


@dataclass(frozen=True)
class Case:
    """A DEM and the models it was made of, as arguments of the command."""

    name: str
    dem: Path
    arguments: tuple[str, ...]


@dataclass(frozen=True)
class Run:
    """Seconds of one process, seconds of processors, peak memory in MiB, and what it printed."""

    seconds: float
    processor: float
    peak: float
    printed: str


def main() -> None:
    """Measure and print the tables."""
    arguments = _arguments()
    os.environ["AEROTRI_THREADS"] = str(arguments.threads)
    if arguments.copy:
        _copy(*arguments.copy, arguments)
        return
    with tempfile.TemporaryDirectory(prefix="aerotri_demcor_", dir=arguments.folder) as name:
        folder = Path(name)
        result = _prepared(folder)
        # the small ones first: what has to be compiled is compiled then
        small = _cases(folder, result, arguments.cells // 4, arguments)
        peaks = ", ".join(f"{case.name} {_ours(case, result).peak:.0f} MiB" for case in small)
        print(
            f"{arguments.cells} × {arguments.cells} cells of 4 bytes, compression {arguments.compress}, "
            f"{arguments.threads} threads, medians of {arguments.repeats}\n{HEADER}",
            flush=True,
        )
        for case in _cases(folder, result, arguments.cells, arguments):
            print(_row(case, result, arguments), flush=True)
            case.dem.unlink()
        print(f"peak memory with {arguments.cells // 4} × {arguments.cells // 4} cells: {peaks}")


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, default=20000, help="rows and columns of the DEM")
    parser.add_argument("--repeats", type=int, default=5, help="runs of either, of which the median counts")
    parser.add_argument("--threads", type=int, default=2, help="of either (default 2)")
    parser.add_argument("--compress", choices=tuple(COMPRESSION), default="deflate", help="of the DEM and what is made")
    parser.add_argument("--folder", help="where there is room for four times the DEM; the system's own else")
    parser.add_argument("--copy", nargs=2, metavar=("IN", "OUT"), help=argparse.SUPPRESS)
    return parser.parse_args()


def _prepared(folder: Path) -> Path:
    """The result of the sample block, and the map of its 60 % models in the folder `map` beside it."""
    result = folder / "result"
    _aerotri("adjust", str(BLOCK), "--out", str(result), "--no-plots", "--json")
    _aerotri("deform", str(result), "--step", "2", "--spacing", "20", "--out", str(folder / "map"), "--no-plots")
    return result


def _cases(folder: Path, result: Path, cells: int, arguments: argparse.Namespace) -> tuple[Case, ...]:
    """One model, and the map of the models of the block."""
    with (result / "images.csv").open(newline="", encoding="utf-8") as file:
        centres = [(float(row["X0"]), float(row["Y0"])) for row in csv.DictReader(file) if row["image"] in PAIR]
    middle = np.mean(centres, axis=0)
    one, many = folder / "one.tif", folder / "many.tif"
    for path, centre, width in ((one, middle, 600.0), (many, np.zeros(2), 4600.0)):
        _make_dem(path, centre, width, cells, COMPRESSION[arguments.compress])
    return (
        Case("one model", one, ("--pair", *PAIR)),
        Case("map of 118 models", many, ("--models", str(folder / "map" / "model.tif"))),
    )


def _make_dem(path: Path, middle: np.ndarray, width: float, cells: int, options: dict) -> None:
    """Hills of some ten metres and a roughness of 3 cm, rounded to centimetres."""
    import rasterio
    from rasterio.windows import Window

    cell, left, top = width / cells, float(middle[0]) - width / 2.0, float(middle[1]) + width / 2.0
    profile = {"driver": "GTiff", "width": cells, "height": cells, "count": 1, "dtype": "float32",
               "tiled": True, "blockxsize": 512, "blockysize": 512,
               "nodata": -9999.0, "BIGTIFF": "IF_SAFER", "num_threads": os.cpu_count() or 1,
               "transform": rasterio.Affine(cell, 0.0, left, 0.0, -cell, top), **options}  # fmt: skip
    rng = np.random.default_rng(1)
    x = left + (np.arange(cells) + 0.5) * cell
    with rasterio.Env(GDAL_CACHEMAX=256 << 20), rasterio.open(path, "w", **profile) as writer:
        for first in range(0, cells, WINDOW):
            y = top - (np.arange(first, min(first + WINDOW, cells)) + 0.5)[:, None] * cell
            z = 60.0 + 20.0 * np.sin(x / 300.0) * np.cos(y / 250.0) + 0.03 * rng.standard_normal((len(y), cells))
            rows = Window(0, first, cells, len(y))  # pyright: ignore[reportCallIssue]
            writer.write(np.round(z, 2).astype(np.float32), 1, window=rows)


def _row(case: Case, result: Path, arguments: argparse.Namespace) -> str:
    target = case.dem.with_name("copy.tif")
    command = [sys.executable, __file__, "--copy", str(case.dem), str(target), "--compress", arguments.compress]
    command += ["--threads", str(arguments.threads)]
    ours, theirs = [], []
    for _ in range(arguments.repeats):
        ours.append(_ours(case, result))
        theirs.append(_measured(command))
        target.unlink()
    seconds, processor = (np.array([[getattr(run, restitution) for run in runs] for runs in (ours, theirs)])
                          for restitution in ("seconds", "processor"))  # fmt: skip
    start = np.array([run.seconds - json.loads(run.printed)["timings_s"]["total"] for run in ours])
    median, pairs, work = np.median(seconds, axis=1), seconds[0] / seconds[1], np.median(processor, axis=1)
    peaks = [max(run.peak for run in runs) for runs in (ours, theirs)]
    return (
        f"| {case.name} | {median[0]:.1f} | {np.median(start):.1f} | {median[1]:.1f} | {median[0] / median[1]:.2f} | "
        f"{pairs.min():.2f} – {pairs.max():.2f} | {work[0] / work[1]:.2f} | {peaks[0]:.0f} | {peaks[1]:.0f} |"
    )


def _ours(case: Case, result: Path) -> Run:
    """The command; what it writes is thrown away."""
    target = case.dem.with_name("corrected.tif")
    run = _measured(_command("demcor", str(result), str(case.dem), "--out", str(target), "--json", *case.arguments))
    for path in case.dem.parent.glob("corrected*"):
        path.unlink()
    return run


def _command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "aerotri.cli", *arguments]


def _aerotri(*arguments: str) -> None:
    subprocess.run(_command(*arguments), check=True, stdout=subprocess.DEVNULL)


def _measured(command: list[str]) -> Run:
    """Times of a process and its peak memory, which only grows: the last look before its end is near enough."""
    begun, peak = time.perf_counter(), 0.0
    with tempfile.TemporaryFile("w+", encoding="utf-8") as printed:
        process = subprocess.Popen(command, stdout=printed)
        while True:
            ended, status, usage = os.wait4(process.pid, os.WNOHANG)
            if ended:
                break
            peak = max(peak, _peak(process.pid))
            time.sleep(0.02)
        seconds = time.perf_counter() - begun
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            raise subprocess.CalledProcessError(process.returncode, command)
        printed.seek(0)
        return Run(seconds, usage.ru_utime + usage.ru_stime, peak, printed.read())


def _peak(pid: int) -> float:
    """MiB that a process has held at most since it began; 0 at its end."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    return float(status.split("VmHWM:")[1].split()[0]) / 1024.0 if "VmHWM:" in status else 0.0


def _copy(source: str, target: str, arguments: argparse.Namespace) -> None:
    """The peer: read and written window by window, compressed by as many threads."""
    import rasterio
    from rasterio.windows import Window

    with (
        rasterio.Env(GDAL_CACHEMAX=256 << 20),
        rasterio.open(source) as reader,
        rasterio.open(target, "w", **(reader.profile | {"num_threads": arguments.threads})) as writer,
    ):
        for row in range(0, reader.height, WINDOW):
            for column in range(0, reader.width, WINDOW):
                size = min(WINDOW, reader.width - column), min(WINDOW, reader.height - row)
                window = Window(column, row, *size)  # pyright: ignore[reportCallIssue]
                writer.write(reader.read(1, window=window), 1, window=window)


if __name__ == "__main__":
    main()
