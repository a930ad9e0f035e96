"""GNSS errors that stay for seconds to minutes: are they found, how large, and what σ are worth with and without them?

Simulated blocks of 84 photographs (six strips, 70/40 %) that GNSS alone holds; white noise of 2 cm in plan and 3 cm in
height, beside it a Gauss-Markov process or none. Every block is adjusted with positions taken for independent, with the
process estimated, and with it as it is. The mean of (error/σ)² of check points and of projection centres is 1 where σ
are right. Prints Markdown.

Example: python tools/prove/gnss_in_time.py --blocks 24 > tools/results/gnss_in_time.md
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import aerotri
from runs_elsewhere import Runs, add_executor, runs_of

CASES: dict[str, tuple[float, float, float]] = {
    "correlation time 30 s": (0.05, 0.075, 30.0),
    "correlation time 8 s": (0.05, 0.075, 8.0),
    "none": (0.0, 0.0, 30.0),
}
"""σ in plan and height (m) and correlation time (s) of the errors that stay."""
MODELS = ("independent", "estimated", "as it is")


def flight(plan: float, height: float, time: float) -> dict[str, Any]:
    """The block."""
    return {
        "name": "gnss",
        "camera": {"ucd": {"preset": "ultracam_d"}},
        "flight": {"gsd_m": 0.05, "strips": 6, "images_per_strip": 14, "end_lap": 0.7, "side_lap": 0.4,
                   "speed_m_s": 50.0, "turn_s": 20.0, "attitude_sigma_deg": [1.0, 1.0, 2.0],
                   "position_sigma_m": [2.0, 2.0, 2.0]},
        "terrain": {"kind": "undulating", "height_m": 100.0, "relief_rms_m": 15.0, "wavelength_m": 400.0},
        "tie_points": {"per_image": 50, "probability": 0.9, "sigma_um": 3.0},
        "control": {"distance_bases": 8.0, "sigma_m": [0.01, 0.01, 0.01], "check_points": 20},
        "gnss": {"sigma_m": [0.02, 0.02, 0.03], "correlated_sigma_m": [plan, plan, height],
                 "correlation_time_s": time},
        "start_values": {"kind": "perturbed", "position_sigma_m": 1.0, "angle_sigma_deg": 0.05},
    }  # fmt: skip


def settings(model: str, case: tuple[float, float, float]) -> dict[str, Any]:
    """[gnss] of a model."""
    if model == "independent":
        return {"correlated": "off"}
    if model == "estimated" or not any(case[:2]):
        return {"correlated": "on"}
    return {"correlated": "on", "correlated_sigma_m": case[:2], "correlation_time_s": case[2]}


@dataclass
class Sums:
    """What the blocks of a case showed of a model: one entry a block."""

    points: list[np.ndarray] = field(default_factory=list)
    centres: list[np.ndarray] = field(default_factory=list)
    found: list[Any] = field(default_factory=list)


def shown(result: aerotri.Adjustment, truth: Any) -> tuple[np.ndarray, np.ndarray, Any]:
    """Mean of (error/σ)² of check points and of projection centres of one block, and the errors that were found."""
    adjusted = result.adjusted
    check = adjusted.check
    given = {int(point): k for k, point in enumerate(adjusted.block.control.point)}
    sigma = adjusted.block.control.sigma[[given[int(point)] for point in check.point]]
    of_points = np.mean(check.difference**2 / (check.sigma**2 + sigma**2), axis=0)
    error = adjusted.images.centre - truth.centre
    of_centres = np.nanmean((error / adjusted.images.sigma[:, :3]) ** 2, axis=0)
    return of_points, of_centres, adjusted.position_errors


def one(case: tuple[float, float, float], seed: int) -> dict[str, tuple[np.ndarray, np.ndarray, Any]]:
    """One block of a case, by model."""
    flown = aerotri.simulate(flight(*case), seed=seed)
    control = flown.block.points[flown.block.control.point].astype(str).tolist()
    block, out = aerotri.edit(flown.block, check=control), {}
    for model in MODELS[: 3 if any(case[:2]) else 2]:
        used = aerotri.with_settings(block, gnss=settings(model, case), model_part="off")
        out[model] = shown(aerotri.adjust(used, explain=False), flown.truth)
    return out


def run(case: tuple[float, float, float], blocks: int, runs: Runs) -> dict[str, Sums]:
    """All blocks of a case."""
    sums = {model: Sums() for model in MODELS}
    for found in runs(one, case, range(1, blocks + 1)):
        for model, (of_points, of_centres, errors) in found.items():
            sums[model].points.append(of_points)
            sums[model].centres.append(of_centres)
            sums[model].found.append(errors)
    return sums


def cell(values: list[np.ndarray], axes: slice) -> str:
    """Mean of the blocks and its standard error, X and Y together."""
    per_block = np.array(values)[:, axes].mean(axis=1)
    return f"{per_block.mean():.2f} ± {per_block.std(ddof=1) / np.sqrt(len(per_block)):.2f}"


def quartiles(values: list[float], scale: float = 1.0) -> str:
    """Median with the middle half."""
    low, middle, high = np.quantile(np.array(values) * scale, [0.25, 0.5, 0.75])
    return f"{middle:.1f} ({low:.1f} to {high:.1f})"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--blocks", type=int, default=24, help="simulated blocks of each case")
    add_executor(parser)
    options = parser.parse_args()
    blocks = options.blocks
    with runs_of(options) as runs:
        outcomes = {name: run(case, blocks, runs) for name, case in CASES.items()}
    print(f"# GNSS errors that stay for seconds to minutes, {blocks} simulated blocks of each kind "
          "(tools/prove/gnss_in_time.py)\n")  # fmt: skip
    print("Errors found: medians and the middle half of the blocks. Warned: adjusted as independent, and warned of.\n")
    print("| errors | true σ plan / height cm | found in | σ plan cm | σ height cm | correlation time s | warned |")
    print("|---|---|---|---|---|---|---|")
    for name, (plan, height, _) in CASES.items():
        kept = [errors for errors in outcomes[name]["estimated"].found if errors.counts]
        size = [quartiles([e.plan_m for e in kept], 100.0), quartiles([e.height_m for e in kept], 100.0),
                quartiles([e.time for e in kept])] if len(kept) > 1 else ["", "", ""]  # fmt: skip
        warned = sum(errors.neighbours_agree for errors in outcomes[name]["independent"].found)
        print(f"| {name} | {100 * plan:.1f} / {100 * height:.1f} | {len(kept)} of {blocks} | {' | '.join(size)} | "
              f"{warned} of {blocks} |")  # fmt: skip
    print("\nMean of (error/σ)²; 1 is right.\n")
    print("| errors | positions taken as | check points XY | check points Z | centres XY | centres Z |")
    print("|---|---|---|---|---|---|")
    for name in CASES:
        for model in MODELS:
            sums = outcomes[name][model]
            if sums.points:
                cells = [cell(values, axes) for values in (sums.points, sums.centres)
                         for axes in (slice(0, 2), slice(2, 3))]  # fmt: skip
                print(f"| {name} | {model} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
