"""Peak memory of `aerotri dsm`, `dtm` and `ortho` with photographs of 11500 × 7500 pixels, each in its own process.

A strip over hilly ground is rendered, 8 bits in three colours, and adjusted. `dsm` and `dtm` measure a square about its
middle, or all of it, `ortho` makes the whole of the strip at the GSD, over waves of 10 m that it reads from a file.
Peak memory is the largest resident set that the system states for the process, the program and the pages of mapped
files included.

Measures the commands from within their processes: imports aerotri.cli on purpose, and writes the surface as dsm does.

Example
-------
    python tools/benchmark/benchmark_memory.py --photographs 3 --side 200 > tools/results/benchmark_memory.md
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import rasterio

from aerotri.rasters.grids import Grid
from aerotri.rasters.surface_files import write_surface

GSD_M = 0.1
LAP = 0.65
SIZE = (11500, 7500)
TINTS = (0.9, 1.0, 0.8)
BLOCK = 256
HEAD = "| command | cells, millions | photographs | time s | of the processor s | peak memory GB |"
HEAD += "\n|---|---|---|---|---|---|"
CODE = """
import atexit
from pathlib import Path
atexit.register(lambda: Path("status.txt").write_text(Path("/proc/self/status").read_text()))
from aerotri.cli import main
main()
"""
"""The command, and what the system says of its process at the end; what `wait4` says has the peak of this one in it."""


def main() -> None:
    """Render, measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--photographs", type=int, default=4, help="of a strip")
    parser.add_argument("--strips", type=int, default=1)
    parser.add_argument("--size", type=int, nargs=2, default=SIZE, help="columns and rows of a photograph")
    parser.add_argument("--commands", nargs="+", choices=("dsm", "dtm", "ortho"), default=("dsm", "ortho"))
    parser.add_argument("--folder", type=Path, help="to keep the block in, and to take it from where it is there")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--side", type=float, default=300.0, help="of the square that dsm and dtm measure, m; 0: all")
    arguments = parser.parse_args()
    os.environ["AEROTRI_THREADS"] = str(arguments.threads)
    if arguments.folder is not None:
        _measure(arguments.folder, arguments)
        return
    with tempfile.TemporaryDirectory(prefix="aerotri_memory_") as folder:
        _measure(Path(folder), arguments)


def _measure(folder: Path, arguments: argparse.Namespace) -> None:
    if not (folder / "surface.tif").exists():
        _make_block(folder, arguments)
    photographs = sorted((folder / "block" / "photographs").glob("*.tif"))
    middle, _, _ = _extent(folder)
    half = arguments.side / 2.0
    square = ["--area", *(f"{value:.1f}" for value in (*(middle[:2] - half), *(middle[:2] + half)))] if half else []
    columns, rows = arguments.size
    print(f"\n{len(photographs)} photographs of {columns} × {rows} pixels, 3 × 8 bits, {arguments.threads} thread(s)\n")
    print(HEAD, flush=True)
    commands = {
        "dsm": ["--out", "dsm", "--no-plots", *square],
        "dtm": ["--out", "dtm", "--no-plots", *square],
        "ortho": ["surface.tif", "--out", "ortho", "--no-plots", "--cell", str(GSD_M)],
    }
    for name in arguments.commands:
        rest = commands[name]
        seconds, processor, peak = _run(folder, name, "result", "block/photographs", *rest)
        with rasterio.open(folder / name / f"{name}.tif") as file:
            cells = file.width * file.height / 1e6
        row = name, cells, len(photographs), seconds, processor, peak / 1e9
        print("| `{}` | {:.0f} | {} | {:.0f} | {:.0f} | {:.2f} |".format(*row), flush=True)


def _make_block(folder: Path, arguments: argparse.Namespace) -> None:
    """Photographs, their adjustment and a surface."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "plan.toml").write_text(_plan(arguments), encoding="utf-8")
    _run(folder, "simulate", "plan.toml", "--out", "block", "--seed", "1", "--render")
    for path in sorted((folder / "block" / "photographs").glob("*.tif")):
        _in_colour(path)
    _run(folder, "adjust", "block", "--out", "result", "--no-plots")
    middle, low, high = _extent(folder)
    _write_surface(folder / "surface.tif", middle[2], low, high)


def _plan(arguments: argparse.Namespace) -> str:
    columns, rows = arguments.size
    strips, photographs = arguments.strips, arguments.photographs
    return f"""
name = "large"
camera.cam = {{ preset = "ultracam_d", size_px = [{columns}, {rows}], pixel_um = {9.0 * SIZE[0] / columns} }}
flight = {{ gsd_m = {GSD_M}, strips = {strips}, images_per_strip = {photographs}, end_lap = {LAP}, side_lap = 0.3 }}
terrain = {{ kind = "undulating", height_m = 100.0, relief_rms_m = 5.0, wavelength_m = 400.0 }}
tie_points = {{ per_image = 60, sigma_um = 2.0 }}
control = {{ distance_bases = 1.0, sigma_m = [0.02, 0.02, 0.02] }}
"""


def _run(folder: Path, *words: str) -> tuple[float, float, float]:
    """Time and time of the processor, s, and peak memory, bytes, of a command.

    Raises
    ------
    RuntimeError
        When it fails.
    """
    begun, before = time.perf_counter(), os.times()
    with (folder / "said.txt").open("w", encoding="utf-8") as said:
        done = subprocess.run([sys.executable, "-c", CODE, *words], cwd=folder, stdout=said, stderr=said, check=False)
    if done.returncode:
        raise RuntimeError((folder / "said.txt").read_text(encoding="utf-8"))
    seconds, after = time.perf_counter() - begun, os.times()
    processor = after.children_user + after.children_system - before.children_user - before.children_system
    status = (folder / "status.txt").read_text(encoding="utf-8")
    return seconds, processor, 1024.0 * int(status.split("VmHWM:")[1].split()[0])


def _in_colour(path: Path) -> None:
    """Three bands of 8 bits instead of one of 16, in tiles."""
    with rasterio.open(path) as file:
        grey = file.read(1).astype(np.float32) / 257.0
    part = path.with_suffix(".part")
    with rasterio.open(
        part, "w", driver="GTiff", width=grey.shape[1], height=grey.shape[0], count=len(TINTS), dtype="uint8",
        tiled=True, blockxsize=BLOCK, blockysize=BLOCK, interleave="pixel", photometric="rgb",
    ) as target:  # fmt: skip
        for band, tint in enumerate(TINTS, start=1):
            target.write((grey * np.float32(tint)).astype(np.uint8), band)
    part.replace(path)


def _extent(folder: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Median, least and largest coordinates of the points, m."""
    import aerotri

    points = aerotri.open_result(folder / "result").points
    xyz = np.column_stack([points[name] for name in "XYZ"])
    return np.nanmedian(xyz, axis=0), np.nanmin(xyz, axis=0), np.nanmax(xyz, axis=0)


def _write_surface(path: Path, height: float, low: np.ndarray, high: np.ndarray) -> None:
    """Waves in cells of two GSD, with a σ."""
    cell = 2.0 * GSD_M
    columns, rows = (int(n) for n in (high - low)[:2] / cell)
    x = low[0] + cell * np.arange(columns, dtype=np.float32)
    y = high[1] - cell * np.arange(rows, dtype=np.float32)
    z = height + 10.0 * np.sin(x[None] / 50.0) * np.cos(y[:, None] / 60.0)
    write_surface(path, z, np.full_like(z, 0.1), Grid(rows, columns, low[0], high[1], cell, cell), None, "Z, m")


if __name__ == "__main__":
    main()
