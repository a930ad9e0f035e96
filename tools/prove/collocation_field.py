"""The camera-free random field beside the parameter sets on simulated blocks of a stitched camera.

A block of 162 photographs (UltraCamD, GSD 9 cm, 80/60 %, a cross strip) with image errors of 4 µm RMS that are BLUH
1–12 and 42–73 themselves, so that one set is the true model, the tiles' patterns as large as the others or a quarter of
that; and with errors from the physics of the camera, which no set knows. Printed are means over the seeds: check points
RMS X, Y, Z (m), its ratio in height to the best set of parameters, and how often `--parameters auto` chose the set.

Of 3 seeds, Z of check points in m and over the best set of parameters:

    image errors from           none   1–12         with 42–73    legendre:5x5  collocation 13x9, 19x13   auto
    parameters, tiles as lens   .379   .133 (2.25)  .0591 (1.00)  .0842 (1.42)  .0676, .0675 (1.14)       1.00
    parameters, tiles a quarter .561   .0678 (1.25) .0541 (1.00)  .0623 (1.15)  .0556, .0560 (1.03, 1.04) 1.00
    physics                     .493   .114 (1.98)  .0878 (1.52)  .0577 (1.00)  .0557, .0571 (.96, .99)   .99

Of 2 seeds, and with tiles and field together:

    parameters, tiles a quarter of the lens: BLUH 1–12 Z .0698 (1.21 of the true model's .0576), collocation 19x13 .0591
    (1.03), tiles with it .0605 (1.05)
    physics: BLUH 1–12 .103, with 42–73 .0774, collocation 19x13 .0566, tiles with it .0586 (chosen by auto in both)

Example: python tools/prove/collocation_field.py --seeds 5
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

import aerotri
from runs_elsewhere import add_executor, runs_of

SETS = (
    "none", "bluh:1-12", "ultracam_d:42-73", "bluh:1-12,ultracam_d:42-73", "brown", "ebner", "gruen", "legendre:5x5",
    "collocation:13x9", "collocation:19x13", "ultracam_d:42-73,collocation:19x13",
)  # fmt: skip
TRUE_MODEL = "bluh:1-12,ultracam_d:42-73"
RMS_UM, FIRST = 4.0, 100
"""Of the image errors; seed of the first block."""


def spec() -> dict:
    """The block, without image errors."""
    return {
        "name": "stitched",
        "camera": {"ucd": {"preset": "ultracam_d"}},
        "flight": {
            "gsd_m": 0.09, "strips": 6, "images_per_strip": 24, "end_lap": 0.8, "side_lap": 0.6,
            "cross_strips": [{"position": 0.5, "images": 18}], "attitude_sigma_deg": [1.0, 1.0, 2.0],
            "position_sigma_m": [5.0, 5.0, 3.0],
        },
        "terrain": {"kind": "undulating", "height_m": 100.0, "relief_rms_m": 30.0, "wavelength_m": 900.0},
        "tie_points": {"per_image": 120, "probability": 0.9, "sigma_um": 2.0},
        "control": {"distance_bases": 5.0, "base_end_lap": 0.6, "sigma_m": [0.03, 0.03, 0.03], "check_points": 60},
        "start_values": {"kind": "perturbed", "position_sigma_m": 1.0, "angle_sigma_deg": 0.05},
    }  # fmt: skip


def true_parameters(seed: int, of_tiles: float) -> dict[str, float]:
    """Values of 1–12 and 42–73, the tiles' patterns `of_tiles` times as large; together RMS_UM over the format."""
    camera = aerotri.simulate(spec(), 1).block.cameras[0]
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-1.0, 1.0, (2000, 2)) * camera.half_format_mm
    names, patterns = aerotri.parameters.patterns(TRUE_MODEL, camera, xy)
    size = np.sqrt(np.mean(patterns**2, axis=(0, 1)))
    value = rng.normal(size=len(names))
    value[12:] *= of_tiles
    value *= 1e-3 * RMS_UM / np.sqrt(np.mean((patterns / size @ value) ** 2))
    return dict(zip(names, (value / size).tolist(), strict=True))


TRUTHS = {
    "parameters, tiles as large as lens": 1.0,
    "parameters, tiles a quarter of the lens": 0.25,
    "physics": None,
}


def block(truth: str, seed: int) -> aerotri.Block:
    """A block whose camera errs by parameters or by physics."""
    content, of_tiles = spec(), TRUTHS[truth]
    errors: dict = {"physical": {"rms_um": RMS_UM}}
    if of_tiles is not None:
        errors = {"parameters": true_parameters(seed, of_tiles)}
    content["camera"]["ucd"]["errors"] = errors
    return aerotri.simulate(content, seed).block


def compared(truth: str, seed: int) -> Any:
    """The comparison of the sets on one block, without the block."""
    found = aerotri.compare_parameters(block(truth, seed), SETS)
    return found.choice, found.record.outcomes


def table(truth: str, found: list[Any]) -> list[str]:
    """Lines of the means over the seeds."""
    chosen, comparisons = zip(*found, strict=True)
    rms = np.array([[o.check.rms for o in outcomes] for outcomes in comparisons])
    mean = np.sqrt(np.mean(rms**2, axis=0))
    least = min(mean[k, 2] for k, name in enumerate(SETS) if "collocation" not in name)
    lines = [
        f"Image errors from {truth}, {len(comparisons)} seeds",
        "| set | number | σ0 µm | X | Y | Z | Z / best set | σ_d µm, ℓ mm | chosen |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for k, name in enumerate(SETS):
        own = [outcomes[k] for outcomes in comparisons]
        number, sigma0 = np.mean([o.effective for o in own]), np.mean([o.sigma0_um for o in own])
        field = ""
        if np.isfinite(own[0].sigma_um):
            field = f"{np.median([o.sigma_um for o in own]):.1f}, {np.median([o.length_mm for o in own]):.0f}"
        xyz = " | ".join(f"{v:.4f}" for v in mean[k])
        times = chosen.count(own[0].name)
        lines.append(f"| {name} | {number:.0f} | {sigma0:.2f} | {xyz} | {mean[k, 2] / least:.2f} | {field} | {times} |")
    taken = np.array([next(o.check.rms[2] for o in outcomes if o.name == choice) for choice, outcomes in found])
    lines.append(f"auto: Z {np.sqrt(np.mean(taken**2)):.4f}, {np.sqrt(np.mean(taken**2)) / least:.2f} of the best set")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=5)
    add_executor(parser)
    options = parser.parse_args()
    with runs_of(options) as runs:
        for truth in TRUTHS:
            comparisons = runs(compared, truth, range(FIRST, FIRST + options.seeds))
            print("\n".join([*table(truth, comparisons), ""]), flush=True)


if __name__ == "__main__":
    main()
