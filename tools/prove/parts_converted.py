"""`convert --parts`, which reads image points piece by piece, against `convert` and then `divide`: memory, time, files.

The block is simulated (UltraCamD, 60/30 %) and written as a COLMAP model, binary and text, and as PAT-B. Programs
started anew turn it into parts; the files of both ways are compared. Prints Markdown.

Measures the memory of the program before the work with the modules that it will use: it names them on purpose.

    python tools/prove/parts_converted.py FOLDER --photographs 10000 --parts 20 > tools/results/parts_converted.md
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
from pathlib import Path

import aerotri
from parts_divided import plan_of, same_files

PROGRAM = """
import json, pathlib, sys, time, aerotri
import aerotri.formats.assembly.project_in_pieces, aerotri.partition.dividing_pieces, aerotri.public.converting
import pyarrow.parquet, pycolmap
def peak():
    lines = pathlib.Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) / 1024 for line in lines if line.startswith("VmHWM"))
source, target, way, parts, stated = sys.argv[1:]
stated = {key: tuple(value) if isinstance(value, list) else value for key, value in json.loads(stated).items()}
before, start = peak(), time.perf_counter()
if way == "pieces":
    aerotri.convert_parts(source, target, parts=int(parts), **stated)
else:
    block = pathlib.Path(target).parent / "block" / pathlib.Path(target).name
    aerotri.convert(aerotri.read(source, name=block.name, **stated), block, tables="parquet")
    aerotri.divide(block, target, parts=int(parts))
print(json.dumps([time.perf_counter() - start, time.process_time(), peak(), before]))
"""
"""Prints time and processor time in s, peak memory and that before the work in MiB; of this program alone."""
CAMERA = {"camera_size": [11500, 7500], "pixel_um": 9.0}
SIGMAS = {"control_sigma_m": [0.03, 0.03, 0.05]}


def run(*arguments: object) -> list[float]:
    """What the program says, run anew."""
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *map(str, arguments)], check=True, capture_output=True, text=True
    )
    return json.loads(done.stdout.strip().split("\n")[-1])


def sources(flown: aerotri.SimulatedBlock, folder: Path) -> dict[str, tuple[Path, dict]]:
    """The block in the formats of others, and what is stated of each."""
    block, points = flown.block, flown.truth.points
    control, rows = block.control, ["point,X,Y,Z"]
    for name, (x, y, z) in zip(block.points[control.point].tolist(), control.xyz.tolist(), strict=True):
        rows.append(f"{name},{x!r},{y!r},{z!r}")
    # points of a COLMAP model are numbers: the marks of control come from a list
    for name in ("colmap", "colmap-text", "patb"):
        aerotri.convert(block, folder / name, name, points=points)
    is_control, marks = set(control.point.tolist()), []
    camera = block.cameras[0]
    rays = block.image_points
    for image, point, (x, y) in zip(rays.image.tolist(), rays.point.tolist(), rays.xy.tolist(), strict=True):
        if point in is_control:
            column, row = x / camera.pixel_mm + camera.size_px[0] / 2, camera.size_px[1] / 2 - y / camera.pixel_mm
            marks.append(f"{block.points[point]} {block.images.names[image]} {column!r} {row!r}")
    (folder / "control.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    (folder / "marks.mes").write_text("\n".join(marks) + "\n", encoding="utf-8")
    listed = {"control": str(folder / "control.csv"), "image_points": [str(folder / "marks.mes")]}
    model = SIGMAS | listed | {"pixel_um": 9.0}
    return {
        "COLMAP, binary": (folder / "colmap", model),
        "COLMAP, text": (folder / "colmap-text", model),
        "PAT-B": (folder / "patb", SIGMAS | CAMERA | {"patb_rotation": "camera-to-object"}),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--photographs", type=int, default=10_000)
    parser.add_argument("--points", type=int, default=200, help="image points a photograph")
    parser.add_argument("--parts", type=int, default=20)
    asked = parser.parse_args()
    asked.folder.mkdir(parents=True)
    flown = aerotri.simulate(plan_of(asked.photographs, asked.points), seed=1)
    asked_for = f"--photographs {asked.photographs} --points {asked.points} --parts {asked.parts}"
    print(f"# Converting into parts\n\n`python tools/prove/parts_converted.py FOLDER {asked_for}`\n")
    print(f"{len(flown.block.images)} photographs, {len(flown.block.image_points)} image points, {asked.parts} parts.")
    print("Memory is the peak of the program; before the work it is that of the packages it uses.\n")
    print("| format | MB | way | s | s of the processor | peak MiB | before MiB | files |")
    print("|---|---|---|---|---|---|---|---|")
    given = sources(flown, asked.folder)
    del flown
    for name, (source, stated) in given.items():
        size = sum(path.stat().st_size for path in source.iterdir()) / 1e6
        for way in ("convert, divide", "pieces"):
            key = way.partition(",")[0]
            numbers = run(source, asked.folder / key / "flight", key, asked.parts, json.dumps(stated))
            one, other = asked.folder / "convert" / "flight", asked.folder / key / "flight"
            same = "the same" if same_files(one, other) else "others"
            figures = " | ".join(f"{number:.0f}" for number in numbers)
            print(f"| {name} | {size:.0f} | {way} | {figures} | {same} |", flush=True)
        for left in ("convert", "pieces"):
            shutil.rmtree(asked.folder / left)


if __name__ == "__main__":
    main()
