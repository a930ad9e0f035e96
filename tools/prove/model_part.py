"""Total σ of simulated drone blocks whose lens errors change from strip to strip, against the truth.

Eight strips, or two strips and a cross strip flown to and fro (--layouts), five control points, σ of image points 2 µm;
principal distance, principal point and Brown's lens are estimated. Every strip's lens errs by other terms of second and
third order, 2 µm RMS. The table has the root mean square over the blocks of true error over σ and over total σ: of the
orientation elements, the interior orientation, the lens parameters, heights of object points, and the mean height of an
area in the middle (a volume over its area), whose ground points are measured with the same lens errors. The same blocks
without such errors have to be the same with the model part switched on and off.

Measures the model part of each of them alone, which no command prints: it looks within the package on purpose.

Example: python tools/prove/model_part.py --blocks 24 > tools/results/model_part.md
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.functional_model.additional_parameters import parse_parameters
from aerotri.observations import Block
from aerotri.pipeline.chain import adjust_keeping_system
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.adjustment import Adjustment
from aerotri.simulation import parse_spec, simulate
from aerotri.simulation.truth import Truth
from aerotri.volume.pickets import Pickets
from aerotri.volume.response import respond

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

from runs_elsewhere import Runs, add_executor, runs_of
from small_blocks import with_adjustment
from statistics_blocks import with_changing_strips

MOVING_UM, SIGMA_UM = 2.0, 2.0
INTERIOR = ("focal_length_mm", "x0_mm", "y0_mm")
FLIGHTS: dict[str, dict[str, Any]] = {
    "eight strips": {"strips": 8, "images_per_strip": 8},
    "three strips": {"strips": 3, "images_per_strip": 12},
}


def drone(flight: Mapping[str, Any]) -> dict[str, Any]:
    """A drone over undulating ground; interior orientation stated with σ."""
    stated = {name: {"sigma": 0.05} for name in INTERIOR}
    return {
        "name": "drone",
        "camera": {"p1": {"size_px": [8192, 5460], "pixel_um": 4.4, "focal_length_mm": 35.0, "interior": stated}},
        "flight": {"gsd_m": 0.02, "end_lap": 0.7, "side_lap": 0.5, "heading_deg": 30.0,
                   "attitude_sigma_deg": [1, 1, 2], "position_sigma_m": [1, 1, 1], **flight},
        "terrain": {"kind": "undulating", "height_m": 100.0, "relief_rms_m": 4.0, "wavelength_m": 200.0},
        "tie_points": {"per_image": 80, "probability": 0.9, "sigma_um": SIGMA_UM},
        "control": {"positions": [[0.05, 0.05], [0.05, 0.95], [0.95, 0.05], [0.95, 0.95], [0.5, 0.5]],
                    "sigma_m": [0.01, 0.01, 0.01], "check_points": 0},
        "start_values": {"kind": "perturbed", "position_sigma_m": 0.3, "angle_sigma_deg": 0.05},
    }  # fmt: skip


def simulated(flight: Mapping[str, Any], seed: int, moving_um: float) -> tuple[Block, Truth]:
    """A block and its truth; the lens of every strip errs by other terms of second and third order."""
    block, truth = simulate(parse_spec(drone(flight)), seed)
    block = with_adjustment(block, additional_parameters=parse_parameters("brown:K1+K2+P1+P2"))
    return (with_changing_strips(block, seed, moving_um) if moving_um else block), truth


def errors_over_sigma(found: Adjustment, truth: Truth) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """By what it is: true errors over σ, and over total σ."""
    r: AdjustedBlock = found.result
    turn = r.images.angles - truth.angles
    turn -= 2.0 * np.pi * np.round(turn / (2.0 * np.pi))
    of_images = np.concatenate([r.images.centre - truth.centre, turn], axis=1)
    out = {}
    for k, name in enumerate(("X0", "Y0", "Z0", "omega", "phi", "kappa")):
        out[name] = (of_images[:, k] / r.images.sigma[:, k], of_images[:, k] / r.images.total_sigma[:, k])
    p, known = r.parameters, dict(zip(INTERIOR, truth.interior[0], strict=True))
    for k, name in enumerate(p.names.astype(str)):
        what = "c, x0, y0" if name in known else "K1, K2, P1, P2"
        error = float(p.value[k] - known.get(name, 0.0))
        stated, total = out.setdefault(what, (np.zeros(0), np.zeros(0)))
        out[what] = (np.append(stated, error / p.sigma[k]), np.append(total, error / p.total_sigma[k]))
    z = r.points.xyz[:, 2] - truth.points[:, 2]
    out["Z of object points"] = (z / r.points.sigma[:, 2], z / r.points.total_sigma[:, 2])
    out["mean height of an area"] = _mean_height(found, truth)
    return out


def _mean_height(found: Adjustment, truth: Truth) -> tuple[np.ndarray, np.ndarray]:
    """Of the object points in the middle quarter of the block, taken for ground points that were measured later."""
    block, xyz = found.result.block, found.result.points.xyz
    low, high = np.nanquantile(xyz[:, :2], [0.25, 0.75], axis=0)
    rows = np.flatnonzero(((xyz[:, :2] > low) & (xyz[:, :2] < high)).all(axis=1))
    rays = block.image_points
    order = np.argsort(rays.point, kind="stable")
    own = order[np.isin(rays.point[order], rows)]
    count = np.bincount(rays.point[own], minlength=len(xyz))[rows]
    start = np.concatenate([[0], np.cumsum(count)]).astype(np.int64)
    sigma = np.full(len(own), 1e-3 * found.result.outcome.sigma0_um)
    pickets = Pickets(xyz[rows], start, rays.image[own].astype(np.int64), sigma, np.ones(len(rows)))
    gradient = np.zeros((len(rows), 3))
    gradient[:, 2] = 1.0 / len(rows)
    response = respond(found, pickets, gradient)
    error = np.array([np.mean(xyz[rows, 2] - truth.points[rows, 2])])
    stated = response.variance + response.noise
    return error / np.sqrt(stated), error / np.sqrt(stated + response.model)


def same_without_moving_errors(flight: Mapping[str, Any], seed: int) -> bool:
    """Whether a block of constant errors gives the same with the model part on as with it off."""
    block, _ = simulated(flight, seed, 0.0)
    on, off = (adjust_keeping_system(with_adjustment(block, model_part=value)) for value in ("on", "off"))
    return on.model is None and all(
        np.array_equal(one, other, equal_nan=True)
        for one, other in (
            (on.result.points.total_sigma, off.result.points.sigma),
            (on.result.images.total_sigma, off.result.images.sigma),
            (on.result.parameters.total_sigma, off.result.parameters.sigma),
        )
    )


def one(flight: Mapping[str, Any], seed: int) -> tuple[str, dict[str, tuple[float, float]], bool]:
    """The scheme found, mean squares of errors over σ and over total σ, and whether nothing changes where none move."""
    block, truth = simulated(flight, seed, MOVING_UM)
    found = adjust_keeping_system(block)
    part = found.result.model_part
    squares = {
        what: (float(np.nanmean(stated**2)), float(np.nanmean(total**2)))
        for what, (stated, total) in errors_over_sigma(found, truth).items()
    }
    return "" if part is None else part.scheme, squares, same_without_moving_errors(flight, 500 + seed)


def rows_of(name: str, flight: Mapping[str, Any], blocks: int, runs: Runs) -> tuple[list[str], str]:
    """Rows of the table of one layout, and a sentence about the test."""
    squares: dict[str, list[tuple[float, float]]] = defaultdict(list)
    schemes, of_blocks, same_of = zip(*runs(one, flight, range(1, blocks + 1)), strict=True)
    for of_block in of_blocks:
        for what, pair in of_block.items():
            squares[what].append(pair)
    rows = []
    for what, values in squares.items():
        stated, total = np.sqrt(np.mean(values, axis=0))
        rows.append(f"| {name} | {what} | {stated:.2f} | {total:.2f} |")
    same = sum(same_of)
    found_in = ", ".join(f"{scheme} {schemes.count(scheme)}" for scheme in sorted(set(schemes)) if scheme) or "none"
    said = f"{name}: found in {sum(map(bool, schemes))} of {blocks} blocks ({found_in})"
    return rows, f"- {said}; without moving errors {same} of {blocks} are the same with the model part on and off."


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--blocks", type=int, default=24)
    parser.add_argument("--layouts", nargs="+", choices=list(FLIGHTS), default=list(FLIGHTS))
    add_executor(parser)
    options = parser.parse_args()
    print(f"# Total σ against the truth, {options.blocks} blocks of each layout (tools/prove/model_part.py)\n")
    print("Lens errors of 2 µm RMS that change from strip to strip. 1 is right.\n")
    print("| block | of | RMS of error over σ | over total σ |\n|---|---|---|---|")
    said = []
    with runs_of(options) as runs:
        for name in options.layouts:
            rows, sentence = rows_of(name, FLIGHTS[name], options.blocks, runs)
            print("\n".join(rows), flush=True)
            said.append(sentence)
    print("\n" + "\n".join(said))


if __name__ == "__main__":
    main()
