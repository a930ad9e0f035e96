"""What a rig costs in an iteration: the same flight as rigid rig, weighted rig, and independent cameras.

    python tools/benchmark/benchmark_rigs.py --repeats 40

A nadir and four oblique cameras, 87 exposures, with two numbers of rays: what a ray costs and what a photograph costs
are told apart by them. CPU time, the three in turn, the least of all repeats.

Measures parts of an iteration alone: imports inside on purpose.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import aerotri
from aerotri.adjustment import _kernels
from aerotri.adjustment.prepare import Prepared, prepare
from aerotri.adjustment.robust import LEAST_SQUARES

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

from rig_blocks import EXACT, rig_spec

CONSTRAINTS = ("rigid", "weighted", "off")
MOVEMENT = 1e-4
"""rad, σ of the movements on the weighted rig."""
DAMPING = 1e-3
"""At the start, independent cameras with few rays are not determined."""
FLIGHT = {
    "gsd_m": 0.1, "strips": 6, "images_per_strip": 14, "end_lap": 0.7, "side_lap": 0.5,
    "attitude_sigma_deg": [1.0, 1.0, 2.0], "position_sigma_m": [5.0, 5.0, 3.0],
    "cross_strips": [{"position": 0.5, "images": 3}],
}  # fmt: skip
PARTS = ("kernel of the rays", "assembling", "right side", "factorising")


def prepared(per_image: int) -> dict[str, Prepared]:
    """The three adjustments at their start."""
    points = {"per_image": per_image, "probability": 0.9, "sigma_um": 2.0}
    block = aerotri.simulate(rig_spec(mounting=EXACT, flight=FLIGHT, tie_points=points), 1).block
    rig, out = block.rigs[0], {}
    cameras = {name: replace(one, movement_rad=MOVEMENT) for name, one in rig.cameras.items()}
    for constraint in CONSTRAINTS:
        out[constraint] = prepare(replace(block, rigs=(replace(rig, constraint=constraint, cameras=cameras),)))
    return out


def seconds(one: Prepared) -> list[float]:
    """CPU time of every part, s."""
    system, state = one.system, one.state
    problem, work = system.problem(state, LEAST_SQUARES, 0.0), system.work()
    chunks = [(bounds, sums.offsets, sums.cleared()) for bounds, sums in zip(system.chunks, system._sums, strict=True)]
    equations: Any = None

    def kernel() -> None:
        for bounds, offsets, sums in chunks:
            _kernels.assemble(*bounds, problem, offsets, sums, work)

    def assemble() -> None:
        nonlocal equations
        equations = system.assemble(state, DAMPING, LEAST_SQUARES)

    out = []
    for part in (
        kernel,
        assemble,
        lambda: system.right_side(state, LEAST_SQUARES),
        lambda: system.factorise(equations),
    ):
        begun = time.process_time()
        part()
        out.append(time.process_time() - begun)
    return out


def table(per_image: int, repeats: int) -> None:
    """Print what one number of rays takes."""
    adjustments = prepared(per_image)
    measured = {name: [] for name in adjustments}
    for k in range(repeats):
        for name in CONSTRAINTS if k % 2 else reversed(CONSTRAINTS):
            measured[name].append(seconds(adjustments[name]))
    unknowns = adjustments["off"].system.unknowns
    rays = len(unknowns.rays.image)
    print(f"\n{len(unknowns.images)} photographs, {rays} rays\n\n| | " + " | ".join(f"{p}, ms" for p in PARTS)
          + " | kernel, µs a ray | assembling, µs a ray |\n|" + "---|" * 7)  # fmt: skip
    for name in CONSTRAINTS:
        least = np.min(measured[name], axis=0)
        cells = " | ".join(f"{1e3 * s:.1f}" for s in least)
        print(f"| {name} | {cells} | {1e6 * least[0] / rays:.3f} | {1e6 * least[1] / rays:.3f} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=40)
    repeats = parser.parse_args().repeats
    for per_image in (125, 250):
        table(per_image, repeats)


if __name__ == "__main__":
    main()
