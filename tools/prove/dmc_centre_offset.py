"""What an offset of the DMC's projection centres (dmc.29) does over ground of more or less relief.

Blocks of 18 photographs and 5 across, GSD 12 cm, 1200 m over ground whose heights differ by the relief (RMS). The heads
stand 15 cm from where the composed image takes them to be. Each row: RMS of the image errors by it; the estimate with
its σ, or why there is none; RMS errors of all heights, adjusted without and with dmc:29. Means over the seeds.
Prints Markdown; the last answer stands in tools/results/dmc_centre_offset.md.

Measures what no simulation of a flight has: the pattern is added to the image points. Imports inside on purpose.

Example: python tools/prove/dmc_centre_offset.py --seeds 4
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

import aerotri
from aerotri.functional_model.additional_parameters import dmc
from aerotri.observations import ImagePoints
from aerotri.simulation import parse_spec, simulate
from runs_elsewhere import add_executor, runs_of

OFFSET = 0.15
RELIEF = (0.0, 5.0, 15.0, 50.0, 150.0)


def spec(relief: float) -> dict:
    return {
        "name": "dmc", "camera": {"dmc": {"preset": "dmc"}},
        "flight": {"gsd_m": 0.12, "strips": 3, "images_per_strip": 6, "end_lap": 0.6, "side_lap": 0.3,
                   "cross_strips": [{"position": 0.5, "images": 5}]},
        "terrain": {"kind": "undulating", "height_m": 100.0, "relief_rms_m": relief, "wavelength_m": 900.0},
        "tie_points": {"per_image": 100, "probability": 0.9, "sigma_um": 2.0},
        "control": {"distance_bases": 3.0, "sigma_m": [0.03, 0.03, 0.05], "check_points": 8},
        "start_values": {"kind": "perturbed", "position_sigma_m": 1.0, "angle_sigma_deg": 0.05},
    }  # fmt: skip


def block_of(relief: float, seed: int):
    """A block with the offset, the image errors by it (m, 2) µm, and the true points."""
    block, truth = simulate(parse_spec(spec(relief)), seed)
    rays = block.image_points
    above = truth.points[:, 2] - truth.points[np.unique(rays.point), 2].mean()
    flying = truth.centre[rays.image, 2] - (truth.points[rays.point, 2] - above[rays.point])
    errors = OFFSET * dmc.centre_offset(block.cameras[0], *rays.xy.T, flying, above[rays.point])
    xy = rays.xy + errors
    keep = (np.sign(xy) == np.sign(rays.xy)).all(axis=1)
    keep &= np.bincount(rays.point[keep], minlength=len(block.points))[rays.point] > 1
    points = ImagePoints(rays.image[keep], rays.point[keep], xy[keep], rays.sigma[keep])
    return replace(block, image_points=points), 1e3 * errors, truth.points


def height_error(result, true: np.ndarray) -> float:
    """RMS over the points, m."""
    error = result.adjusted.points.xyz[:, 2] - true[:, 2]
    return float(np.sqrt(np.nanmean(error**2)))


def run(relief: float, seed: int) -> tuple[float, float, tuple[float, float, float] | str]:
    """Image errors µm, heights without dmc:29 m; the estimate, its σ and heights with it, or why there is none."""
    block, errors, true = block_of(relief, seed)
    size = float(np.sqrt(np.mean(errors**2)))
    without = height_error(aerotri.adjust(block, parameters="none"), true)
    try:
        result = aerotri.adjust(block, parameters="dmc:29")
    except aerotri.InputError as error:
        return size, without, error.message.partition(",")[2].partition(":")[0].removeprefix(" and ")
    p = result.adjusted.parameters
    return size, without, (float(p.value[0]), float(p.sigma[0]), height_error(result, true))


def row(relief: float, outcomes: list[tuple[float, float, tuple[float, float, float] | str]]) -> list[str]:
    size, without = (np.mean([outcome[k] for outcome in outcomes]) for k in range(2))
    there = [outcome[2] for outcome in outcomes if not isinstance(outcome[2], str)]
    refused = next((outcome[2] for outcome in outcomes if isinstance(outcome[2], str)), "")
    mean = [f"{value:.3f}" for value in np.mean(there, axis=0)] if there else [str(refused), "–", "–"]
    return [f"{relief:g}", f"{size:.2f}", mean[0], mean[1], f"{without:.3f}", mean[2]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=4)
    add_executor(parser)
    options = parser.parse_args()
    print(f"# Offset of the projection centres of the DMC, {OFFSET} m (tools/prove/dmc_centre_offset.py)\n")
    print(f"{options.seeds} blocks a row\n")
    print("| relief m | image error µm | dmc.29 m | σ m | heights without m | with m |\n|---|---|---|---|---|---|")
    with runs_of(options) as runs:
        for relief in RELIEF:
            print("| " + " | ".join(row(relief, runs(run, relief, range(options.seeds)))) + " |", flush=True)


if __name__ == "__main__":
    main()
