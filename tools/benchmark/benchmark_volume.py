"""How long σ of a volume takes: the response of a functional of a million cells, and one solution with the factor.

Example: python tools/benchmark/benchmark_volume.py --out results

Measures the response of a functional and a solution with the factor: imports inside on purpose. Medians of five, wall
and processor time; the last answer stands in tools/results/benchmark_volume.md.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

import numpy as np

import aerotri
from aerotri.volume.pickets import pickets_where_seen
from aerotri.volume.response import respond

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "prove"))

from volume_proof.simulated import SPEC

CELLS = (10_000, 100_000, 1_000_000)
FLIGHTS = {"18 photographs": (3, 6), "144 photographs": (8, 18)}
PARAMETERS = "bluh:1-12,ultracam_d:42-73"
REPEATS = 5


def adjusted(strips: int, images: int):
    """A simulated UltraCamD block with 44 additional parameters."""
    spec = SPEC | {"flight": SPEC["flight"] | {"strips": strips, "images_per_strip": images}}
    return aerotri.adjust(aerotri.simulate(spec, 1).block, parameters=PARAMETERS, explain=False).record


def timed(work) -> tuple[object, float, float]:
    """Result, median wall and processor seconds."""
    walls, used = [], []
    result = work()
    for _ in range(REPEATS):
        begun, cpu = time.perf_counter(), time.process_time()
        result = work()
        walls.append(time.perf_counter() - begun)
        used.append(time.process_time() - cpu)
    return result, float(np.median(walls)), float(np.median(used))


def lines_of(name: str, calibration) -> list[str]:
    """A line for every number of cells."""
    lines = []
    known = calibration.result.points.xyz
    middle = np.nanmedian(known, axis=0)
    for cells in CELLS:
        side = int(np.sqrt(cells))
        x, y = np.meshgrid(np.linspace(-100.0, 100.0, side), np.linspace(100.0, -100.0, side))
        xyz = middle + np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
        (pickets, seen), found, found_cpu = timed(lambda xyz=xyz: pickets_where_seen(calibration, xyz, 0.003))
        assert seen.all()
        gradient = np.zeros_like(xyz)
        gradient[:, 2] = 4e4 / len(xyz)
        response, wall, cpu = timed(lambda p=pickets, g=gradient: respond(calibration, p, g))
        # anew: that of the response has taken the place of an older one
        factor = calibration.system.factorise(calibration.solution.equations)
        _, solve, _ = timed(lambda r=response, f=factor: f.solve(r.unknowns))
        lines.append(f"| {name} | {len(xyz)} | {found:.2f} ({found_cpu:.2f}) | {wall:.2f} ({cpu:.2f}) | "
                     f"{1e3 * solve:.2f} |")  # fmt: skip
        print(lines[-1], flush=True)
    return lines


def main() -> None:
    """Run, print, write where asked."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    lines = [
        "# Time of σ of a volume", "",
        f"Seconds, wall (processors), medians of {REPEATS}, {os.cpu_count()} cores. Choosing photographs: which two "
        "photographs are nearest to every cell. Response: all partials, the factor of the normal equations and the "
        "solution with it; of that the solution alone, ms.", "",
        "| block, 44 additional parameters | cells | choosing photographs | response and σ | solution alone, ms |",
        "|---|---|---|---|---|",
    ]  # fmt: skip
    print("\n".join(lines), flush=True)
    for name, (strips, images) in FLIGHTS.items():
        lines += lines_of(name, adjusted(strips, images))
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "benchmark_volume.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
