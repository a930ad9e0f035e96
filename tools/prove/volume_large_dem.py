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
import rasterio
from rasterio.windows import Window

import aerotri

PIECE = 2000
HEIGHT = 300.0


def write_cone(path: Path, cells: int) -> float:
    """A cone whose foot is 0.4 of the side, on a plane of 100 m; returns its volume, m³."""
    radius, away = 0.4 * cells, np.arange(cells) + 0.5 - cells / 2.0
    profile = {"driver": "GTiff", "width": cells, "height": cells, "count": 1, "dtype": "float32",
               "tiled": True, "blockxsize": 512, "blockysize": 512,
               "BIGTIFF": "IF_SAFER", "transform": rasterio.Affine(1.0, 0.0, 0.0, 0.0, -1.0, cells)}  # fmt: skip
    with rasterio.Env(GDAL_CACHEMAX=64 << 20), rasterio.open(path, "w", **profile) as writer:
        for row in range(0, cells, PIECE):
            for column in range(0, cells, PIECE):
                rows, columns = away[row : row + PIECE], away[column : column + PIECE]
                z = 100.0 + HEIGHT * np.maximum(1.0 - np.hypot(columns[None, :], rows[:, None]) / radius, 0.0)
                writer.write(z.astype(np.float32), 1, window=Window(column, row, len(columns), len(rows)))
    return float(np.pi * radius**2 * HEIGHT / 3.0)


def measure(path: Path, truth: float) -> str:
    """A line of the table."""
    # what has to be imported and compiled stands before the clock
    aerotri.volume(aerotri.Surface.of_array(np.full((20, 20), 101.0), left=0.0, top=20.0, cell=1.0), base=100.0)
    begun = time.perf_counter()
    volumes = aerotri.volume(path, base=100.0).record
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
