"""How long a dense surface takes, beside OpenCV's StereoSGBM alone on the same epipolar images in the same run.

Vertical photographs over flat ground, 8 bits: every photograph is a part of one random texture. With `--relief` they
are rendered over hills instead, 16 bits, which takes some time. The surface is measured with `aerotri.dense_surface`;
the time spent in StereoSGBM, of all levels, is taken in the same run. One ratio is of processor times; OpenCV has one
thread meanwhile. The other is of times by the clock: the surface is measured once more, ours in one thread and OpenCV
with as many as ours had before, each matching in its turn; the sum of their times is what StereoSGBM alone takes. A
small surface is made before, so that nothing is compiled in
the time that counts. Peak memory is that of the whole process; another one makes the photographs. Measures times inside
the package, so it looks there on purpose.

Example
-------
    python tools/benchmark/benchmark_dense.py --size 4000 3000 --photographs 4
    python tools/benchmark/benchmark_dense.py --photographs 10 --strips 2 --relief 5 --threads 2
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np

import aerotri
from aerotri.public.dense import DenseSurface
from aerotri.terrain.dense import parallaxes

GSD_M, PIXEL_UM, END_LAP, SIDE_LAP, WAVE_M = 0.1, 6.0, 0.7, 0.4, 100.0
HEAD = (
    "| photographs | cells | threads | processor s | StereoSGBM, processor s | ratio | elapsed s |"
    " StereoSGBM, elapsed s | ratio | peak memory MB | median error px |\n|---|---|---|---|---|---|---|---|---|---|---|"
)


def main() -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=int, nargs=2, default=(4000, 3000), metavar=("COLUMNS", "ROWS"))
    parser.add_argument("--photographs", type=int, default=3, help="of a strip")
    parser.add_argument("--strips", type=int, default=1)
    parser.add_argument("--relief", type=float, default=0.0, help="root mean square of the hills' heights, m")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--area", type=float, nargs=4, help="X Y X Y, m; all where not given")
    parser.add_argument("--only-photographs", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    os.environ["AEROTRI_THREADS"] = str(arguments.threads)
    cv2.setNumThreads(1)
    if arguments.only_photographs is not None:
        _write(arguments.only_photographs, arguments)
        return
    with tempfile.TemporaryDirectory(prefix="aerotri_dense_") as folder:
        subprocess.run([sys.executable, *sys.argv, "--only-photographs", folder], check=True)
        print(HEAD)
        print(_measured(Path(folder), arguments))


def _flight(arguments: argparse.Namespace):
    size = arguments.size
    plan = {
        "name": "dense",
        "camera": {"cam": {"size_px": list(size), "pixel_um": PIXEL_UM, "focal_length_mm": PIXEL_UM * size[0] / 1e3}},
        "flight": {"gsd_m": GSD_M, "strips": arguments.strips, "images_per_strip": arguments.photographs,
                   "end_lap": END_LAP, "side_lap": SIDE_LAP, "heading_deg": 0.0, "alternating": False},
        "terrain": {"height_m": 50.0} | (
            {"kind": "undulating", "relief_rms_m": arguments.relief, "wavelength_m": WAVE_M}
            if arguments.relief else {"kind": "flat"}
        ),
        "tie_points": {"per_image": 80, "probability": 0.9, "sigma_um": 0.0, "stated_sigma_um": 0.1, "margin_px": 5.0},
        "control": {"distance_bases": 1.0, "sigma_m": [0.0, 0.0, 0.0], "stated_sigma_m": [0.001, 0.001, 0.001]},
    }  # fmt: skip
    return aerotri.simulate(plan, seed=1)


def _write(folder: Path, arguments: argparse.Namespace) -> None:
    """Every photograph is the part of the ground that it shows, from its simulated projection centre."""
    flight = _flight(arguments)
    if arguments.relief:
        flight.save(folder / "flown", photographs=True)
        return
    columns, rows = arguments.size
    centre = np.array(aerotri.adjust(flight.block, explain=False).record.result.images.centre)
    first = (centre - centre.min(axis=0)) / GSD_M
    ground = _texture(rows + int(np.ceil(first[:, 1].max())) + 2, columns + int(np.ceil(first[:, 0].max())) + 2)
    for name, (x, y, _) in zip(flight.block.images.names, first, strict=True):
        top = first[:, 1].max() - y
        shift = np.array([[1.0, 0.0, -x], [0.0, 1.0, -top]])
        cv2.imwrite(str(folder / f"{name}.tif"), cv2.warpAffine(ground, shift, (columns, rows), flags=cv2.INTER_CUBIC))


def _texture(rows: int, columns: int) -> np.ndarray:
    rng = np.random.default_rng(3)
    out = np.zeros((rows, columns), np.float32)
    for level in range(7):
        part = rng.normal(size=((rows >> level) + 2, (columns >> level) + 2)).astype(np.float32)
        out += cv2.resize(part, (columns, rows), interpolation=cv2.INTER_CUBIC)
    return np.clip(128.0 + 15.0 * cv2.GaussianBlur(out, (0, 0), 0.8), 0.0, 255.0).astype(np.uint8)


def _measured(folder: Path, arguments: argparse.Namespace) -> str:
    flight = _flight(arguments)
    result = aerotri.adjust(flight.block, explain=False)
    folder = folder / "flown" / "photographs" if arguments.relief else folder
    middle = np.array(result.record.result.images.centre).mean(axis=0)
    aerotri.dense_surface(result, folder, area=(middle[0], middle[1], middle[0] + 15.0, middle[1] + 15.0))
    area = None if arguments.area is None else tuple(arguments.area)
    start, of_processor = time.perf_counter(), time.process_time()
    with _timed(time.thread_time) as alone:
        found = aerotri.dense_surface(result, folder, area=area)
    whole, of_processor = time.perf_counter() - start, time.process_time() - of_processor
    error = float(np.median(_errors(found, flight)))
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    os.environ["AEROTRI_THREADS"] = "1"
    cv2.setNumThreads(arguments.threads)
    with _timed(time.perf_counter) as by_clock:
        aerotri.dense_surface(result, folder, area=area)
    columns, rows = arguments.size
    photographs = arguments.strips * arguments.photographs
    return (
        f"| {photographs} of {columns} × {rows} | {found.record.cells} | {arguments.threads} | {of_processor:.1f} | "
        f"{sum(alone):.1f} | {of_processor / sum(alone):.2f} | {whole:.1f} | {sum(by_clock):.1f} | "
        f"{whole / sum(by_clock):.2f} | {memory:.0f} | {error / GSD_M:+.3f} |"
    )


@contextmanager
def _timed(clock: Callable[[], float]) -> Iterator[list[float]]:
    """s, of every matching by StereoSGBM meanwhile."""
    spent: list[float] = []
    ours = parallaxes.semi_global

    def timed(images):
        start = clock()
        found = ours(images)
        spent.append(clock() - start)
        return found

    parallaxes.semi_global = timed
    yield spent
    parallaxes.semi_global = ours


def _errors(found: DenseSurface, flight: aerotri.SimulatedBlock) -> np.ndarray:
    """m, of some thousand cells of every tile."""
    o, errors = found.record, []
    for window, tile in o.files.read_all(list(o.windows)):
        rows, columns = np.nonzero(np.isfinite(tile.z))
        rows, columns = (at[:: len(rows) // 5000 + 1] for at in (rows, columns))
        xy = np.column_stack([o.grid.x(window.column + columns), o.grid.y(window.row + rows)])
        errors.append(tile.z[rows, columns] - flight.true_heights(xy))
    return np.concatenate(errors)


if __name__ == "__main__":
    main()
