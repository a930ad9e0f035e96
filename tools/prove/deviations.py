"""Parameters that change from strip to strip, of simulated blocks: sizes found again, false alarms, σ of heights.

Ten strips of five photographs, σ of image points 2 µm. The parameter named changes independently or as a random walk; a
second one that is estimated with it does not change. Changes of c, x0 and y0 are simulated with GNSS positions of
2 cm, without which shifts of the photographs would take them up; those of the camera are unknown, too. The first table
has sizes as image error: true, mean of those found and their scatter. The second has the root mean square of true error
over σ, of the values of the strips about their mean and of heights of object points, with [deviations] and with one set
for all photographs. The third counts how often a change is found where there is none.

Measures the sizes of image errors that it simulates, which no command does: it looks within the package on purpose.

Example: python tools/prove/deviations.py --blocks 20 > tools/results/deviations.md
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.adjustment.deviations import size_mm
from aerotri.functional_model.additional_parameters import Parameter, parameter_set, parse_parameters
from aerotri.observations import Block, DeviationSettings
from aerotri.pipeline import adjust
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.deviations import Deviations

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

from runs_elsewhere import Runs, add_executor, runs_of
from small_blocks import small_block, with_adjustment

FLIGHT = {"gsd_m": 0.1, "strips": 10, "images_per_strip": 5, "end_lap": 0.6, "side_lap": 0.4, "heading_deg": 30.0,
          "attitude_sigma_deg": [1.0, 1.0, 2.0], "position_sigma_m": [5.0, 5.0, 3.0]}  # fmt: skip
GNSS = {"gnss": {"sigma_m": [0.02, 0.02, 0.03]}}


@dataclass(frozen=True)
class Case:
    """Estimated parameters, the kind of change, and its σ in µm of image error by parameter."""

    parameters: str
    kind: str
    sizes: Mapping[str, float]
    beside: Mapping[str, Any]


CASES = {
    "bluh.9 independent": Case("bluh:9+3", "independent", {"bluh.9": 2.0}, {}),
    "bluh.9 walk": Case("bluh:9+3", "walk", {"bluh.9": 1.0}, {}),
    "c, x0, y0 independent": Case(
        "bluh:3,interior", "independent", {"interior.c": 2.0, "interior.x0": 8.0, "interior.y0": 8.0}, GNSS
    ),
    "c walk": Case("bluh:3,interior:c", "walk", {"interior.c": 2.0}, GNSS),
}


def with_changes(block: Block, case: Case, seed: int) -> tuple[Block, dict[str, dict[str, float]]]:
    """The block with other values of the parameters in every strip, and these values by parameter and strip."""
    rng, camera, rays = np.random.default_rng(1000 + seed), block.cameras[0], block.image_points
    strips = list(dict.fromkeys(block.images.strip.astype(str).tolist()))
    of_image = np.array([strips.index(name) for name in block.images.strip.astype(str)])
    xy, values = rays.xy.copy(), {}
    for name, size in case.sizes.items():
        change = rng.normal(0.0, 1e-3 * size / size_mm(camera, name), len(strips))
        change = np.cumsum(change) if case.kind == "walk" else change
        parameter = Parameter.of(name)
        pattern = parameter_set(parameter.family, (parameter.item,), camera).basis(*rays.xy.T)[:, :, 0]
        xy += change[of_image[rays.image], None] * pattern
        values[name] = dict(zip(strips, change.tolist(), strict=True))
    return replace(block, image_points=replace(rays, xy=xy)), values


def with_free_interior(block: Block) -> Block:
    """The block with principal distance and principal point of its camera unknown."""
    camera = block.cameras[0]
    interior = {name: replace(prior, fixed=False) for name, prior in camera.interior.items()}
    return replace(block, cameras=(replace(camera, interior=interior),))


def adjusted(block: Block, case: Case) -> tuple[AdjustedBlock, Deviations]:
    """With the deviations of the case, and what was found of them."""
    block = with_adjustment(block, parameter_groups="strip", model_part="off")
    tied = replace(block.settings, deviations=DeviationSettings(case.kind))
    result = adjust(replace(block, settings=tied))
    if result.deviations is None:
        raise SystemExit("a block was not adjusted")
    return result, result.deviations


def one_set(block: Block, case: Case) -> AdjustedBlock:
    """With one set of values for all photographs."""
    constant = ",".join(part for part in case.parameters.split(",") if not part.startswith("interior"))
    return adjust(with_adjustment(block, additional_parameters=parse_parameters(constant), model_part="off"))


def mean_square(error: np.ndarray, sigma: np.ndarray) -> float:
    """Of errors over σ, where there is one."""
    there = sigma > 0.0
    return float(np.mean((error[there] / sigma[there]) ** 2)) if there.any() else float("nan")


def of_values(found: AdjustedBlock, deviations: Deviations, values: Mapping[str, Mapping[str, float]]) -> float:
    """Mean square of error over σ of the values about their mean over the strips, where a change was found."""
    p, total, seen = found.parameters, [], {one.name for one in deviations.found if one.sigma_um > 0.0}
    for name, by_strip in values.items():
        if name not in seen:
            continue
        rows = np.flatnonzero(p.names == name)
        error = p.value[rows] - np.array([by_strip[str(group)] for group in p.groups[rows]])
        total.append(mean_square(error - error.mean(), p.sigma[rows]))
    return float(np.mean(total)) if total else float("nan")


@dataclass(frozen=True)
class Shown:
    """What one block showed: p without changes, whether a change was found, sizes by parameter, mean squares."""

    quiet: float
    needed: bool
    sizes: Mapping[str, float]
    squares: tuple[float, ...]


def of_block(name: str, seed: int) -> Shown:
    """One block of a case."""
    case = CASES[name]
    still, truth = small_block(seed, case.parameters, flight=FLIGHT, **case.beside)
    still = with_free_interior(still) if "interior" in case.parameters else still
    quiet = adjusted(still, case)[1].p
    block, values = with_changes(still, case, seed)
    (found, deviations), other = adjusted(block, case), one_set(block, case)
    sizes = {one.name: one.sigma_um for one in deviations.found}
    heights = [mean_square(r.points.xyz[:, 2] - truth.points[:, 2], r.points.sigma[:, 2]) for r in (found, other)]
    return Shown(quiet, bool(deviations.needed), sizes, (of_values(found, deviations, values), *heights))


def measured(name: str, blocks: int, runs: Runs) -> tuple[list[str], str, tuple[float, ...]]:
    """Rows of sizes, the row of errors over σ, and probabilities of the blocks without changes."""
    case, sizes = CASES[name], dict[str, list[float]]()
    shown: list[Shown] = runs(of_block, name, range(1, blocks + 1))
    for one in shown:
        for parameter, size in one.sizes.items():
            sizes.setdefault(parameter, []).append(size)
    squares, quiet, needed = [one.squares for one in shown], [one.quiet for one in shown], sum(o.needed for o in shown)
    of_sizes = [
        f"| {name} | {parameter} | {case.sizes.get(parameter, 0.0):.1f} | {np.mean(s):.2f} | {np.std(s, ddof=1):.2f} |"
        for parameter, s in sizes.items()
    ]
    about, tied, constant = np.sqrt(np.nanmean(squares, axis=0))
    row = f"| {name} | {needed} of {blocks} | {about:.2f} | {tied:.2f} | {constant:.2f} |"
    return of_sizes, row, tuple(quiet)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--blocks", type=int, default=20)
    parser.add_argument("--cases", nargs="+", choices=list(CASES), default=list(CASES))
    add_executor(parser)
    options = parser.parse_args()
    with runs_of(options) as runs:
        found = {name: measured(name, options.blocks, runs) for name in options.cases}
    print(f"# Parameters that change, {options.blocks} blocks of each case (tools/prove/deviations.py)\n")
    print("| case | parameter | true σ µm | found, mean | scatter |\n|---|---|---|---|---|")
    print("\n".join(line for rows, _, _ in found.values() for line in rows))
    print("\nRMS of true error over σ; 1 is right.\n")
    print("| case | change found | values of the strips | heights | heights, one set for all |\n|---|---|---|---|---|")
    print("\n".join(row for _, row, _ in found.values()))
    print("\nThe same blocks without changes: how often the test says there is one.\n")
    print("| case | p < 0.05 | p < 0.001 |\n|---|---|---|")
    for name, (_, _, quiet) in found.items():
        print(f"| {name} | {sum(p < 0.05 for p in quiet)} of {len(quiet)} | {sum(p < 0.001 for p in quiet)} |")


if __name__ == "__main__":
    main()
