"""How fast orthophotos are made, beside plain reading, remapping and writing with OpenCV and rasterio in the same run.

A strip of drone photographs over hilly ground, 4000 × 3000 pixels in colour, JPEG. The plain way reads every photograph
once, takes every tile of the orthophoto from one photograph by one `cv2.remap` (bicubic) with a map that is ready made,
and writes the same cloud-optimised GeoTIFF. It knows no surface, no hidden ground, no seams and no colours. A small
orthophoto is made before, so that nothing is compiled in the time that counts. Cells a second are of the time of the
processor, which other programs on the machine hardly change. Peak memory is that of all.

Example
-------
    python tools/benchmark/benchmark_ortho.py --photographs 6 --repeats 2 > tools/results/benchmark_ortho.md
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np
import rasterio
import rasterio.shutil
from rasterio.windows import Window

import aerotri

SIZE = (4000, 3000)
GSD_M = 0.05
TILE = 1024
HEAD = "| way | time s | of the processor s | million cells a second |\n|---|---|---|---|"


def main() -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--photographs", type=int, default=8)
    parser.add_argument("--repeats", type=int, default=3, help="runs of either, of which the median counts")
    parser.add_argument("--threads", type=int, default=1)
    arguments = parser.parse_args()
    os.environ["AEROTRI_THREADS"] = str(arguments.threads)
    cv2.setNumThreads(arguments.threads)
    with tempfile.TemporaryDirectory(prefix="aerotri_ortho_") as folder:
        _measure(Path(folder), arguments)


def _measure(folder: Path, arguments: argparse.Namespace) -> None:
    flight = aerotri.simulate(_plan(arguments.photographs), seed=1)
    names = [str(name) for name in flight.block.images.names]
    photographs = folder / "photographs"
    photographs.mkdir()
    for number, name in enumerate(names):
        _write_photograph(photographs / f"{name}.jpg", number)
    result = aerotri.adjust(flight.block)
    surface = _surface(result)
    small = (-5.0, -5.0, 5.0, 5.0)
    aerotri.orthophoto(result, photographs, surface, folder / "warm", area=small, plots=False)
    ours: list[tuple[float, float]] = []
    plain: list[tuple[float, float]] = []
    for number in range(arguments.repeats):
        begun = _clocks()
        aerotri.orthophoto(result, photographs, surface, folder / f"ours{number}", cell=GSD_M, plots=False)
        ours.append(_since(begun))
        places = _tiles(folder / f"ours{number}", [photographs / f"{name}.jpg" for name in names])
        begun = _clocks()
        _plain(folder / f"ours{number}" / "ortho.tif", places, folder / f"plain{number}.tif")
        plain.append(_since(begun))
    record = json.loads((folder / "ours0" / "ortho.json").read_text(encoding="utf-8"))
    cells = record["rows"] * record["columns"]
    (first, first_cpu), (second, second_cpu) = np.median(ours, axis=0).tolist(), np.median(plain, axis=0).tolist()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print("# Orthophotos\n")
    print(
        f"{len(names)} photographs of {SIZE[0]} × {SIZE[1]} pixels, {record['columns']} × {record['rows']} cells, "
        f"{arguments.threads} thread(s), medians of {arguments.repeats} runs in turn\n"
    )
    print(HEAD)
    print(f"| `aerotri.orthophoto` | {first:.2f} | {first_cpu:.2f} | {cells / first_cpu / 1e6:.1f} |")
    print(f"| reading, `cv2.remap`, writing | {second:.2f} | {second_cpu:.2f} | {cells / second_cpu / 1e6:.1f} |")
    print(
        f"\n{first_cpu / second_cpu:.2f} times the time of the processor, {first / second:.2f} times as long; "
        f"peak memory of the whole process {peak:.2f} GiB."
    )


def _clocks() -> tuple[float, float]:
    """Time, and that of the processor in this process, s: what others do at the same time does not count in it."""
    return time.perf_counter(), time.process_time()


def _since(begun: tuple[float, float]) -> tuple[float, float]:
    now = _clocks()
    return now[0] - begun[0], now[1] - begun[1]


def _plan(photographs: int) -> dict[str, object]:
    return {
        "name": "speed",
        "camera": {"cam": {"size_px": list(SIZE), "pixel_um": 2.4, "focal_length_mm": 8.8}},
        "flight": {"gsd_m": GSD_M, "strips": 2, "images_per_strip": photographs // 2, "end_lap": 0.75, "side_lap": 0.5},
        "terrain": {"kind": "undulating", "height_m": 50.0, "relief_rms_m": 3.0, "wavelength_m": 150.0},
        "tie_points": {"per_image": 100, "sigma_um": 1.0},
        "control": {"distance_bases": 2.0, "sigma_m": [0.02] * 3},
    }


def _write_photograph(path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    grain = rng.normal(128.0, 60.0, (SIZE[1] // 4, SIZE[0] // 4, 3)).astype(np.float32)
    pixels = np.clip(cv2.resize(grain, SIZE, interpolation=cv2.INTER_CUBIC), 0, 255).astype(np.uint8)
    cv2.imwrite(str(path), pixels, [cv2.IMWRITE_JPEG_QUALITY, 92])


def _surface(result: aerotri.Adjustment) -> aerotri.Surface:
    """Waves about the mean height of the ground, in cells of 0.25 m, as dense matching gives them."""
    points = result.points
    low, high = ((f(points["X"]), f(points["Y"])) for f in (np.min, np.max))
    x, y = np.arange(low[0], high[0], 0.25), np.arange(high[1], low[1], -0.25)
    z = float(np.median(points["Z"])) + 3.0 * np.sin(x[None] / 20.0) * np.cos(y[:, None] / 25.0)
    return aerotri.Surface.of_array(
        z, left=float(x[0]), top=float(y[0]), cell=0.25, sigma=np.full_like(z, 0.05)
    )  # fmt: skip


def _tiles(folder: Path, files: list[Path]) -> list[tuple[Path, list[tuple[Window, np.ndarray, np.ndarray]]]]:
    """Of every photograph the tiles that are nearest to it, with a map: a turned square of pixels of the same size."""
    with rasterio.open(folder / "photographs.tif") as file:
        number = file.read(1)
    found: list[tuple[Path, list[tuple[Window, np.ndarray, np.ndarray]]]] = [(file, []) for file in files]
    for row in range(0, number.shape[0], TILE):
        for column in range(0, number.shape[1], TILE):
            part = number[row : row + TILE, column : column + TILE]
            if (part < 0).all():
                continue
            owner = int(np.bincount(part[part >= 0]).argmax())
            i, j = np.indices(part.shape, np.float32)
            x, y = 900.0 + j * 0.99 + i * 0.03, 900.0 + i * 0.99 - j * 0.03
            place = Window.from_slices((row, row + part.shape[0]), (column, column + part.shape[1]))
            found[owner][1].append((place, x, y))
    return found


def _plain(like: Path, places: list[tuple[Path, list[tuple[Window, np.ndarray, np.ndarray]]]], out: Path) -> None:
    rough = out.with_suffix(".plain.tif")
    with rasterio.open(like) as file:
        profile = {"height": file.height, "width": file.width, "transform": file.transform, "crs": file.crs}
    with rasterio.open(
        rough, "w", driver="GTiff", count=4, dtype="uint8", tiled=True, blockxsize=512, blockysize=512,
        interleave="pixel", photometric="rgb", alpha="unspecified", SPARSE_OK=True, **profile,
    ) as target:  # fmt: skip
        for path, tiles in places:
            with rasterio.open(path) as file:
                bands = file.read()
            pixels = cv2.merge(list(bands))
            for window, x, y in tiles:
                colours = cv2.remap(pixels, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
                mask = np.full((1, *x.shape), 255, np.uint8)
                target.write(np.concatenate([np.moveaxis(colours, -1, 0), mask]), window=window)
    rasterio.shutil.copy(
        rough, out, driver="COG", compress="DEFLATE", predictor="YES", num_threads="ALL_CPUS",
        overview_resampling="AVERAGE",
    )  # fmt: skip


if __name__ == "__main__":
    main()
