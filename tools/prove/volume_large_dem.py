"""A volume of a DEM of 20 000 × 20 000 cells in bounded memory: time, peak memory, and the number itself.

The DEM is a cone on a plane, written window by window (1.6 GB beside it); every method must give its volume. Prints one
line for each size.

Last answer (two shared cores under load): see tools/results/volume_large_dem.md.

Example: python tools/prove/volume_large_dem.py --cells 5000 20000 --out results
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from aerotri.rasters.grids import Grid, RasterReader, RasterWriter, cache_limited
from aerotri.volume.bases import level
from aerotri.volume.boundary import boundary_of_grid
from aerotri.volume.compute import compute_volumes

PIECE = 2000
HEIGHT = 300.0


def write_cone(path: Path, cells: int) -> float:
    """A cone whose foot is 0.4 of the side, on a plane of 100 m; returns its volume, m³."""
    grid = Grid(cells, cells, 0.0, float(cells), 1.0, 1.0)
    radius = 0.4 * cells
    with cache_limited(), RasterWriter(path, grid) as writer:
        for row in range(0, cells, PIECE):
            for column in range(0, cells, PIECE):
                part = grid.window(row, column, min(PIECE, cells - row), min(PIECE, cells - column))
                x, y = part.x(np.arange(part.columns)) - cells / 2.0, part.y(np.arange(part.rows)) - cells / 2.0
                away = np.hypot(x[None, :], y[:, None])
                z = 100.0 + HEIGHT * np.maximum(1.0 - away / radius, 0.0)
                writer.write(row, column, z.astype(np.float32))
    return float(np.pi * radius**2 * HEIGHT / 3.0)


def measure(path: Path, truth: float) -> str:
    """A line of the table."""
    begun = time.perf_counter()
    with cache_limited(), RasterReader(path) as reader:
        volumes = compute_volumes(reader, level(100.0), boundary_of_grid(reader.grid))
    seconds = time.perf_counter() - begun
    off = ", ".join(f"{one.method} {one.net / truth - 1.0:+.1e}" for one in volumes.by_method)
    status = Path("/proc/self/status").read_text(encoding="ascii")  # ru_maxrss would begin with the parent's
    peak = int(status.partition("VmHWM:")[2].split()[0]) / 2**20
    return f"| {volumes.chosen.area:.4g} m² | {seconds:.1f} s | {peak:.2f} GiB | {off} |"


def main() -> None:
    """Write, measure in a process of its own, print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--cells", type=int, nargs="+", default=[5000, 20000])
    parser.add_argument("--out", type=Path)
    parser.add_argument("--measure", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.measure:
        print(measure(Path(options.measure[0]), float(options.measure[1])))
        return
    lines = ["| cells | area | time | peak memory | error of the volume |", "|---|---|---|---|---|"]
    for cells in options.cells:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "cone.tif"
            truth = write_cone(path, cells)
            command = [sys.executable, __file__, "--measure", str(path), repr(truth)]
            done = subprocess.run(command, capture_output=True, text=True, check=True)
            lines.append(f"| {cells} × {cells} {done.stdout.strip()}")
            print(lines[-1], flush=True)
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "volume_large_dem.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
