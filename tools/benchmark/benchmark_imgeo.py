"""How fast photographs are resampled, beside cv2.remap of the same image in the same run.

In memory: ours against cv2.remap (bicubic) with its maps ready made, in turn; the making of our map stands apart, since
it is made once for all photographs of a camera. With files: reading, resampling and writing as `aerotri imgeo` does,
against reading, one cv2.remap and writing with the same library. Peak memory is that of a process of its own.

Measures the map and the resampling alone: imports inside on purpose.

Example
-------
    python tools/benchmark/benchmark_imgeo.py
    python tools/benchmark/benchmark_imgeo.py --scale 4 --repeats 3

Last result (two cores, medians of 3; 11500 × 7500 in 16 bit, bicubic): in memory 0.175 s against 0.170 s of cv2.remap,
1.03 times as long, 1.50 with the making of our map; file to file 0.483 s against 0.558 s, 0.87; peak memory 287 MiB
against 1361 MiB.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

SIZE = (11500, 7500)
PIXEL_UM = 9.0


def main() -> None:
    """Measure and print the table."""
    arguments = _arguments()
    os.environ["AEROTRI_THREADS"] = str(arguments.threads)
    if arguments.peak:
        _peak(arguments)
        return
    with tempfile.TemporaryDirectory(prefix="aerotri_imgeo_") as folder:
        photograph = Path(folder) / "photograph.tif"
        _make_photograph(photograph, arguments.scale)
        rows = _in_memory(photograph, arguments) + _with_files(photograph, arguments)
        print(_table(rows, arguments))
        print(_peaks(photograph, arguments))


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scale", type=int, default=1, help="1: 11500 × 7500; 4: a quarter of that in both axes")
    parser.add_argument("--repeats", type=int, default=5, help="runs of either, of which the median counts")
    parser.add_argument("--threads", type=int, default=2, help="of either (default 2)")
    parser.add_argument("--method", choices=("bicubic", "lanczos"), default="bicubic", help="of both")
    parser.add_argument("--peak", nargs=3, metavar=("WHO", "IN", "OUT"), help=argparse.SUPPRESS)
    return parser.parse_args()


def _errors(scale: int):
    """Image errors of an UltraCamD, BLUH 1–12 and 42–73, some µm each: up to a pixel and a half."""
    from aerotri.functional_model.additional_parameters import parameter_set
    from aerotri.image_errors.error_function import ErrorFunction
    from aerotri.observations import Camera, Prior

    interior = {name: Prior(value, fixed=True) for name, value in
                (("focal_length_mm", 101.4), ("x0_mm", 0.0), ("y0_mm", 0.0))}  # fmt: skip
    size = SIZE[0] // scale, SIZE[1] // scale
    camera = Camera("ucd", "ultracam_d", size, PIXEL_UM * scale, interior, flight_axis="+y")
    rng = np.random.default_rng(1)
    x, y = (g.ravel() for g in np.meshgrid(*(np.linspace(-h, h, 41) for h in camera.half_format_mm)))
    linear = []
    for family, items in (("bluh", range(1, 13)), ("ultracam_d", range(42, 74))):
        chosen = parameter_set(family, [str(i) for i in items], camera)
        largest = np.abs(chosen.basis(x, y)).max(axis=(0, 1))
        linear.append((chosen, rng.normal(size=len(largest)) * 0.3 * camera.pixel_mm / largest))
    return ErrorFunction(camera, "ucd", np.array([101.4, 0.0, 0.0]), tuple(linear), np.zeros(7), np.zeros(14))


def _make_photograph(path: Path, scale: int) -> None:
    from aerotri.rasters.images import create_image

    columns, rows = SIZE[0] // scale, SIZE[1] // scale
    rng = np.random.default_rng(2)
    with create_image(path, columns, rows, 1, "uint16") as writer:
        for first in range(0, rows, 512):
            writer.write(first, rng.integers(0, 65535, (1, min(512, rows - first), columns), np.uint16))


def _remap_maps(scale: int) -> tuple[np.ndarray, np.ndarray]:
    """The same displacements, a float32 for every pixel: what cv2.remap is given."""
    from aerotri.image_errors.ideal_map import ideal_map

    ideal = ideal_map(_errors(scale))
    rows, columns = ideal.size
    map_x, map_y = np.empty((rows, columns), np.float32), np.empty((rows, columns), np.float32)
    column = np.arange(columns, dtype=float)
    for row in range(rows):
        i = int(np.sum(ideal.rows[1:-1, 0] <= row))
        j = np.searchsorted(ideal.columns[1:-1, row], column, side="right")
        for k, grid in enumerate(ideal.tiles[i]):
            own = j == k
            moved = grid.at(np.full(int(own.sum()), row), column[own])
            map_x[row, own], map_y[row, own] = column[own] + moved[:, 0], row + moved[:, 1]
    return map_x, map_y


def _remap(pixels: np.ndarray, maps: tuple[np.ndarray, np.ndarray], arguments: argparse.Namespace) -> np.ndarray:
    import cv2

    cv2.setNumThreads(arguments.threads)
    kind = cv2.INTER_CUBIC if arguments.method == "bicubic" else cv2.INTER_LANCZOS4
    return cv2.remap(pixels, *maps, kind, borderMode=cv2.BORDER_CONSTANT)


def _seconds(work: Callable[[], object]) -> tuple[float, float]:
    """Time on the clock, and of processors in all threads: the latter hardly depends on what else the machine does."""
    begun, before = time.perf_counter(), time.process_time()
    work()
    return time.perf_counter() - begun, time.process_time() - before


def _in_turn(name: str, works: tuple[Callable[[], object], Callable[[], object]], repeats: int):
    """Name, and seconds (2, 2, repeats): clock and processors, ours and theirs; one run before counts for nothing."""
    for work in works:
        work()
    return name, np.array([[_seconds(work) for work in works] for _ in range(repeats)]).T


def _in_memory(photograph: Path, arguments: argparse.Namespace) -> list:
    from aerotri.image_errors.ideal_map import ideal_map
    from aerotri.image_errors.ideal_photographs import PixelType, resample
    from aerotri.rasters.images import open_photograph

    with open_photograph(photograph) as opened:
        pixels = opened.read(0, opened.rows)
    errors = _errors(arguments.scale)
    ideal, maps = ideal_map(errors), _remap_maps(arguments.scale)
    kind, rows = PixelType(0.0, 65535.0, 0.0), (0, ideal.size[0])
    with ThreadPoolExecutor(arguments.threads) as pool:

        def ours() -> object:
            return resample(pixels, 0, rows, ideal, kind, arguments.method, pool)

        def with_map() -> object:
            return resample(pixels, 0, rows, ideal_map(errors), kind, arguments.method, pool)

        def theirs() -> object:
            return _remap(pixels[0], maps, arguments)

        return [
            _in_turn("in memory, map ready", (ours, theirs), arguments.repeats),
            _in_turn("in memory, with the making of our map", (with_map, theirs), arguments.repeats),
        ]


def _ours_with_files(photograph: Path, target: Path, arguments: argparse.Namespace) -> None:
    from aerotri.image_errors.ideal_map import ideal_map
    from aerotri.image_errors.ideal_photographs import ideal_photograph

    ideal_photograph(photograph, target, ideal_map(_errors(arguments.scale)), arguments.method)


def _theirs_with_files(photograph: Path, target: Path, arguments: argparse.Namespace, maps) -> None:
    import rasterio
    from rasterio.errors import NotGeoreferencedWarning

    warnings.simplefilter("ignore", NotGeoreferencedWarning)
    with rasterio.open(photograph) as source:
        pixels, profile = source.read(1), source.profile
    with rasterio.open(target, "w", **profile) as written:
        written.write(_remap(pixels, maps, arguments), 1)


def _with_files(photograph: Path, arguments: argparse.Namespace) -> list:
    maps, target = _remap_maps(arguments.scale), photograph.with_name("out.tif")
    works = (
        lambda: _ours_with_files(photograph, target, arguments),
        lambda: _theirs_with_files(photograph, target, arguments, maps),
    )
    return [_in_turn("file to file", works, arguments.repeats)]


def _table(rows: list, arguments: argparse.Namespace) -> str:
    import cv2

    columns, lines = SIZE[0] // arguments.scale, SIZE[1] // arguments.scale
    out = [
        f"{columns} × {lines} px, 16 bit, {arguments.method}, {arguments.threads} threads, OpenCV {cv2.__version__}, "
        f"medians of {arguments.repeats}",
        "| work | ours, s | cv2.remap, s | ratio | smallest and largest ratio of a pair | ratio of processor time |",
        "|---|---|---|---|---|---|",
    ]
    for name, ((ours, theirs), work) in rows:
        ratio, pairs, of_work = np.median(ours) / np.median(theirs), ours / theirs, np.median(work, axis=1)
        out.append(
            f"| {name} | {np.median(ours):.3f} | {np.median(theirs):.3f} | {ratio:.2f} | "
            f"{pairs.min():.2f} – {pairs.max():.2f} | {of_work[0] / of_work[1]:.2f} |"
        )
    return "\n".join(out)


def _peak(arguments: argparse.Namespace) -> None:
    """The child: one of the two, file to file, and the most memory it took, MiB."""
    who, photograph, target = arguments.peak
    if who == "ours":
        _ours_with_files(Path(photograph), Path(target), arguments)
    else:
        _theirs_with_files(Path(photograph), Path(target), arguments, _remap_maps(arguments.scale))
    # of this program alone; what getrusage says begins with that of the process it was started from
    status = Path("/proc/self/status").read_text(encoding="ascii")
    print(float(status.split("VmHWM:")[1].split()[0]) / 1024.0)


def _peaks(photograph: Path, arguments: argparse.Namespace) -> str:
    found = []
    for who in ("ours", "theirs"):
        command = [
            sys.executable, __file__, "--scale", str(arguments.scale), "--threads", str(arguments.threads), "--method",
            arguments.method, "--peak", who, str(photograph), str(photograph.with_name("out.tif")),
        ]  # fmt: skip
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        found.append(float(done.stdout.split()[-1]))
    return f"peak memory, file to file: {found[0]:.0f} MiB, with cv2.remap {found[1]:.0f} MiB"


if __name__ == "__main__":
    main()
