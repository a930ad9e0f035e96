"""Halves of simulated blocks: do they differ by what σ says, and are errors that change from strip to strip found?

For blocks whose model is right, sparse and dense control: the mean square of difference over σ of points, of means by
cell and of parameters (1 is right; the band is three times its scatter over the blocks), and the share of probabilities
below 5 % (the band is that of the binomial distribution, 99.9 %; uniform p: Kolmogorov's, the smallest of
the tests times their number). For blocks with 2 µm of radial distortion that changes its sign from strip to strip: how
often each division finds it. Prints Markdown.

Example: python tools/prove/halves.py --blocks 200 > tools/results/halves.md
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.stats import binom, kstest

import aerotri
from runs_elsewhere import Runs, add_executor, runs_of

CONTROL = {"sparse": 6.0, "dense": 1.0}
"""Distance of control points in bases."""
DIVISIONS = ("photographs", "strips", "time")
ERROR_MM = 2e-3


def flight(distance: float) -> dict:
    """Four strips and a cross strip of an UltraCamD at 80/60 %, image points of 2 µm."""
    return {
        "name": "halves",
        "camera": {"ucd": {"preset": "ultracam_d"}},
        "flight": {"gsd_m": 0.1, "strips": 4, "images_per_strip": 8, "end_lap": 0.8, "side_lap": 0.6,
                   "cross_strips": [{"position": 0.5, "images": 6}], "attitude_sigma_deg": [1.0, 1.0, 2.0]},
        "terrain": {"kind": "undulating", "height_m": 100.0, "relief_rms_m": 30.0, "wavelength_m": 900.0},
        "tie_points": {"per_image": 60, "probability": 0.9, "sigma_um": 2.0},
        "control": {"distance_bases": distance, "sigma_m": [0.03, 0.03, 0.05], "check_points": 2},
        "start_values": {"kind": "perturbed", "position_sigma_m": 1.0, "angle_sigma_deg": 0.05},
    }  # fmt: skip


def with_changing_errors(block: aerotri.Block) -> aerotri.Block:
    """The block with radial distortion, outwards in one strip and inwards in the next."""
    strip = np.unique(block.images.strip.astype(str), return_inverse=True)[1]
    sign = np.where(strip % 2 == 0, 1.0, -1.0)[block.image_points.image]
    at = block.image_points.xy / block.cameras[0].r_max_mm
    error = at * (np.linalg.norm(at, axis=1) ** 2 - 0.4)[:, None]
    error *= ERROR_MM * sign[:, None] / np.sqrt(np.mean(np.sum(error**2, axis=1)))
    return replace(block, image_points=replace(block.image_points, xy=block.image_points.xy + error))


def compared(shared: tuple[float, bool], seed: int) -> Any:
    """The comparisons of one block simulated, adjusted and divided, as `aerotri.halves` gives them."""
    distance, changing = shared
    block = aerotri.simulate(flight(distance), seed=seed).block
    result = aerotri.adjust(with_changing_errors(block) if changing else block, parameters="brown:K1+K2", explain=False)
    return aerotri.halves(result, DIVISIONS).record.comparisons


def calibration(name: str, distance: float, blocks: int, runs: Runs) -> list[str]:
    """Rows of the first table."""
    squares, p = defaultdict(list), defaultdict(lambda: defaultdict(list))
    for comparisons in runs(compared, (distance, False), range(1, blocks + 1)):
        for one in comparisons:
            if one.points is None:
                squares[one.division, "not possible"].append(np.nan)
                continue
            values = {"points": one.points.d / one.points.sigma, "cells": one.points.z, "parameters": one.parameters.z}
            for what, z in values.items():
                squares[one.division, what].append(float(np.nanmean(z**2)))
            for of, test in one.tests:
                p[one.division][of].append((test.p_statistic, test.p_rms))
    rows = []
    for (division, what), means in squares.items():
        band = 3.0 * np.std(means) / np.sqrt(len(means))
        rows.append(f"| {name} | {division} | {what} | {len(means)} | {np.mean(means):.3f} | 1 ± {band:.3f} |")
    for division, pairs in p.items():
        for k, what in enumerate(("p of the quadratic form", "p of the RMS")):
            each = [np.array(values)[:, k] for values in pairs.values()]
            own = np.concatenate(each)
            high = binom.ppf(0.999, len(each[0]), 0.05) / len(each[0])
            uniform = min(1.0, len(each) * min(kstest(values, "uniform").pvalue for values in each))
            worst = max(float(np.mean(values < 0.05)) for values in each)
            rows.append(
                f"| {name} | {division} | {what}: share below 5 %, of {len(each)} tests the largest | {len(own)} "
                f"| {worst:.3f} | below {high:.3f}; uniform p {uniform:.2f} |"
            )
    return rows


def detection(name: str, distance: float, blocks: int, runs: Runs) -> list[str]:
    """Rows of the second table."""
    found = defaultdict(list)
    for comparisons in runs(compared, (distance, True), range(10_001, 10_001 + blocks)):
        for one in comparisons:
            if not one.reason and not one.same_as:
                found[one.division].append(one.differs)
    return [f"| {name} | {division} | {sum(own)} of {len(own)} |" for division, own in found.items()]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--blocks", type=int, default=200)
    add_executor(parser)
    options = parser.parse_args()
    with runs_of(options) as runs:
        _print_tables(options.blocks, runs)


def _print_tables(blocks: int, runs: Runs) -> None:
    print(f"# Halves adjusted apart, {blocks} simulated blocks of each kind (tools/prove/halves.py)\n")
    print(
        "| control | division | mean square of difference/σ of | number | found | expected |\n|---|---|---|---|---|---|"
    )
    for name, distance in CONTROL.items():
        print("\n".join(calibration(name, distance, blocks, runs)))
    print("\nErrors of 2 µm RMS that change sign from strip to strip, tests at 0.1 %:\n")
    print("| control | division | found |\n|---|---|---|")
    for name, distance in CONTROL.items():
        print("\n".join(detection(name, distance, max(blocks // 10, 1), runs)))


if __name__ == "__main__":
    main()
