"""A block in parts against the same block in one piece: largest differences over σ, time and memory.

The block is simulated (UltraCamD, 80/40 %, control at the edge), with a lens that errs in every strip by other terms of
second and third order, so that σ has a model part. It is written, and adjusted by two programs started anew: one in one
piece, one in parts by a number of processes. Memory is the peak of the largest process. Both end where a
step changes nothing that matters, and not at the same place: the numbers are compared once more where both go on until
only rounding is left. Prints Markdown.

Measures where an adjustment ends with another stopping rule, which no command has: it looks within the package on
purpose.

    python tools/prove/parts.py FOLDER --photographs 2282 --parts 4 --processes 2 > tools/results/parts.md
"""

from __future__ import annotations

import argparse
import csv
import json
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import aerotri

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmark"))
from adjusting.blocks import plan_of

PARAMETERS = "bluh:1-12,ultracam_d:42-73"

TIGHT = """
from aerotri.adjustment import adjusted_positions, stopping
stopping.STEP_TOLERANCE, stopping.ROUNDING = 1e-7, 0.0
adjusted_positions.MOST_ROUNDS, adjusted_positions.STANDING = 20, 1e-10
adjusted_positions.MOST_STEPS, adjusted_positions.SETTLED = 30, 1e-12
"""
"""Goes before a program, and is run in its processes too: ends where only rounding is left."""
OWN_MEMORY = """
def own_memory_mb():
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) / 1024 for line in file if line.startswith("VmHWM"))

def processor_s():
    import resource
    of = [resource.getrusage(one) for one in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in of)
"""
"""Peak of a program, and its time of the processor. What getrusage says of memory begins with that of the script that
started it."""
ONE = (
    OWN_MEMORY
    + """
import sys, json, time, aerotri
begun = time.perf_counter()
block = aerotri.read_block(sys.argv[1])
start = time.perf_counter()
found = aerotri.adjust(block, model_part=sys.argv[3], explain=False)
seconds = time.perf_counter() - start
found.save(sys.argv[2], plots=False)
print(json.dumps([seconds, time.perf_counter() - begun, processor_s(), own_memory_mb()]))
"""
)
PARTS = (
    OWN_MEMORY
    + """
import sys, json, resource, time, aerotri
if __name__ == "__main__":
    start = time.perf_counter()
    found = aerotri.adjust_parts(sys.argv[1], sys.argv[2], plots=False, executor=sys.argv[3])
    seconds = time.perf_counter() - start
    of_children = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    print(json.dumps([seconds, processor_s(), own_memory_mb(), of_children]))
"""
)
"""Programs that print their time in s and their memory in MB."""


def run(folder: Path, text: str, *arguments: object) -> list[float]:
    """What a program says, run anew from a file."""
    program = folder / "program.py"
    program.write_text(text)
    done = subprocess.run([sys.executable, program, *map(str, arguments)], check=True, capture_output=True, text=True)
    return json.loads(done.stdout.strip().split("\n")[-1])


def rows(path: Path, key: str, columns: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Columns of a table by the name of the row; rows without values are left out."""
    with open(path, encoding="utf-8") as file:
        return {
            line[key]: np.array([float(line[c]) for c in columns]) for line in csv.DictReader(file) if line[columns[0]]
        }


def differences(one: Path, parts: Path, table: str, key: str, values: tuple[str, ...]) -> tuple[list[float], int]:
    """Largest difference of values over σ, largest relative differences of σ and total σ; how many rows were compared.

    The last is NaN where there is no total σ.
    """
    k = len(values)
    with open(one / table, encoding="utf-8") as file:
        kinds = "st" if f"t{values[0]}" in next(csv.reader(file)) else "s"
    columns = (*values, *(f"{kind}{name}" for kind in kinds for name in values))
    whole = rows(one / table, key, columns)
    count, worst = 0, [0.0, 0.0, 0.0 if kinds == "st" else float("nan")]
    for part in sorted((parts / "parts").iterdir()):
        for name, found in rows(part / table, key, columns).items():
            expected = whole[name]
            worst[0] = max(worst[0], float(np.abs((found - expected)[:k] / expected[k : 2 * k]).max()))
            for j in range(1, len(kinds) + 1):
                own = slice(j * k, (j + 1) * k)
                worst[j] = max(worst[j], float(np.abs(found[own] / expected[own] - 1.0).max()))
            count += 1
    return worst, count


def with_erring_strips(block: aerotri.Block, micrometres: float) -> aerotri.Block:
    """The block with other errors of second and third order in every strip, so many µm RMS."""
    rays, rng = block.image_points, np.random.default_rng(1)
    xy, strip = rays.xy.copy(), block.images.strip[rays.image].astype(str)
    x, y = (rays.xy / np.abs(rays.xy).max(axis=0)).T
    terms = np.stack([x * y, x * x, y * y, x * x * y, x * y * y, x**3], axis=1)
    for name in np.unique(strip):
        error = terms[strip == name] @ rng.normal(size=(6, 2))
        xy[strip == name] += error * micrometres * 1e-3 / np.sqrt(np.mean(error**2))
    return replace(block, image_points=replace(rays, xy=xy))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--photographs", type=int, default=2282)
    parser.add_argument("--parts", type=int, default=4)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--parameters", default=PARAMETERS)
    parser.add_argument(
        "--erring-um", type=float, default=1.0, help="errors of the lens that change from strip to strip"
    )
    parser.add_argument("--model-part", choices=["on", "off"], default="on")
    options = parser.parse_args()
    folder = options.folder
    folder.mkdir(parents=True, exist_ok=True)
    block = aerotri.with_settings(
        with_erring_strips(aerotri.simulate(plan_of(options.photographs), seed=1).block, options.erring_um),
        parameters=options.parameters,
        model_part=options.model_part,
    )
    print(
        f"# {len(block.images)} photographs, {len(block.image_points)} rays in one piece and in {options.parts} parts"
        " (tools/prove/parts.py)\n"
    )
    aerotri.convert(block, folder / "block", tables="parquet")
    start = time.perf_counter()
    aerotri.divide(block, folder / "in_parts", parts=options.parts)
    divided = time.perf_counter() - start
    del block
    how = f"processes:{options.processes}"
    whole = run(folder, ONE, folder / "block", folder / "one", options.model_part)
    parts = run(folder, PARTS, folder / "in_parts", folder / "parts", how)
    print("| adjusted | s | with reading and writing | of the processor | peak memory MB | of a process |")
    print("|---|---|---|---|---|---|")
    print(f"| in one piece, every σ | {whole[0]:.1f} | {whole[1]:.1f} | {whole[2]:.1f} | {whole[3]:.0f} | |")
    how_many = f"in {options.parts} parts, {options.processes} processes"
    print(f"| {how_many} | | {parts[0]:.1f} | {parts[1]:.1f} | {parts[2]:.0f} | {parts[3]:.0f} |")
    print(f"\nDividing took {divided:.1f} s. Tables are read and written, nothing is drawn.\n")
    print("| ends | | compared | largest difference over σ | largest relative difference of σ | of total σ |")
    print("|---|---|---|---|---|---|", flush=True)
    say(folder, "as always", "")
    run(folder, TIGHT + ONE, folder / "block", folder / "one_tight", options.model_part)
    run(folder, TIGHT + PARTS, folder / "in_parts", folder / "parts_tight", how)
    say(folder, "where only rounding is left", "_tight")


def say(folder: Path, ends: str, suffix: str) -> None:
    """Rows of the comparison of two results."""
    tables = {
        "projection centres": ("images.csv", "image", ("X0", "Y0", "Z0")),
        "points": ("points.csv", "point", ("X", "Y", "Z")),
    }
    for what, (table, key, values) in tables.items():
        one, parts = folder / f"one{suffix}", folder / f"parts{suffix}"
        (apart, of_sigma, of_total), count = differences(one, parts, table, key, values)
        print(f"| {ends} | {what} | {count} | {apart:.1e} | {of_sigma:.1e} | {of_total:.1e} |", flush=True)


if __name__ == "__main__":
    main()
