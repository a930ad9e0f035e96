"""`divide` of a block folder, whose image points are read piece by piece, against the block held whole: memory, time.

The block is simulated (UltraCamD, 60/30 %) and written as CSV and as Parquet. Programs started anew divide it, by its
folder and after reading it; the files of both are compared. Prints Markdown.

Measures the memory of the program before the work with the modules that it will use: it names them on purpose.

    python tools/prove/parts_divided.py FOLDER --photographs 10000 --parts 20 > tools/results/parts_divided.md
"""

from __future__ import annotations

import argparse
import filecmp
import json
import shutil
import subprocess
import sys
from pathlib import Path

import aerotri

PROGRAM = """
import json, pathlib, sys, time, aerotri
import aerotri.formats.block.writer, aerotri.partition.dividing_pieces, aerotri.public.blocks, pyarrow.parquet
def peak():
    lines = pathlib.Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) / 1024 for line in lines if line.startswith("VmHWM"))
source, target, whole, parts = sys.argv[1:]
before, start = peak(), time.perf_counter()
block = aerotri.read_block(source) if whole == "whole" else source
aerotri.divide(block, target, parts=int(parts))
print(json.dumps([time.perf_counter() - start, time.process_time(), peak(), before]))
"""
"""Prints time and processor time in s, peak memory and that before the work in MiB; of this program alone: what
`getrusage` says begins at the memory of the program that started it."""


def plan_of(photographs: int, points: int) -> dict:
    """A flight of about so many photographs, as long as wide."""
    strips = max(3, round(0.75 * photographs**0.5))
    return {
        "name": f"block_{photographs}",
        "camera": {"ucd8": {"preset": "ultracam_d"}},
        "flight": {
            "gsd_m": 0.09, "strips": strips, "images_per_strip": round(photographs / strips), "end_lap": 0.6,
            "side_lap": 0.3,
        },
        "terrain": {"kind": "undulating", "height_m": 100.0, "relief_rms_m": 30.0, "wavelength_m": 900.0},
        "tie_points": {"per_image": points, "probability": 0.9, "sigma_um": 2.0},
        "gnss": {"sigma_m": [0.05, 0.05, 0.08]},
        "control": {"distance_bases": 20.0, "sigma_m": [0.03, 0.03, 0.05]},
        "start_values": {"kind": "perturbed", "position_sigma_m": 1.0, "angle_sigma_deg": 0.05},
    }  # fmt: skip


def run(*arguments: object) -> list[float]:
    """What the program says, run anew."""
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *map(str, arguments)], check=True, capture_output=True, text=True
    )
    return json.loads(done.stdout.strip().split("\n")[-1])


def same_files(one: Path, other: Path) -> bool:
    """Whether two folders hold the same files, byte for byte."""
    names = [{str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()} for folder in (one, other)]
    same, *others = filecmp.cmpfiles(one, other, sorted(names[0]), shallow=False)
    return names[0] == names[1] and bool(same) and not any(others)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--photographs", type=int, default=10_000)
    parser.add_argument("--points", type=int, default=200, help="image points a photograph")
    parser.add_argument("--parts", type=int, default=20)
    asked = parser.parse_args()
    flown = aerotri.simulate(plan_of(asked.photographs, asked.points), seed=1)
    asked_for = f"--photographs {asked.photographs} --points {asked.points} --parts {asked.parts}"
    print(f"# Dividing a block folder\n\n`python tools/prove/parts_divided.py FOLDER {asked_for}`\n")
    block = flown.block
    print(f"{len(block.images)} photographs, {len(block.image_points)} image points, {asked.parts} parts.")
    print("Memory is the peak of the program; before the work it is that of the packages it uses.\n")
    print("| tables | table MB | block | s | s of the processor | peak MiB | before MiB | files |")
    print("|---|---|---|---|---|---|---|---|")
    for tables in ("csv", "parquet"):
        source = asked.folder / tables
        aerotri.convert(block, source, tables=tables)
        size = (source / f"image_points.{tables}").stat().st_size / 1e6
        for way in ("whole", "pieces"):
            numbers = run(source, asked.folder / way, way, asked.parts)
            same = "the same" if same_files(asked.folder / "whole", asked.folder / way) else "others"
            figures = " | ".join(f"{number:.0f}" for number in numbers)
            print(f"| {tables} | {size:.0f} | {way} | {figures} | {same} |", flush=True)
        for way in ("whole", "pieces"):
            shutil.rmtree(asked.folder / way)


if __name__ == "__main__":
    main()
