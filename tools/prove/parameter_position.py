"""Additional parameters evaluated at the measured and at the adjusted image points: what the noise does to heights.

Drone flights without positions of the projection centres, held by six control points, a free interior orientation and
a camera without systematic errors. Two check points, one in the middle and one at the border: mean and root mean square
of height error over σ. Without bias the mean lies within ±3.3/√n in 99.9 % of the cases, the square of the root mean
square in the band of χ².
The last column is the bias in σ of image coordinates of one pixel and grows in proportion to it.

Example: python tools/prove/parameter_position.py --seeds 60 > tools/results/parameter_position.md
"""

from __future__ import annotations

import argparse

import numpy as np
from scipy.stats import chi2

import aerotri
from runs_elsewhere import add_executor, runs_of

SETS = ("brown:K1+K2+K3+P1+P2", "bluh:1-12", "legendre:4x4", "lens:k1+k2+k3+p1+p2")
FEWEST_RAYS = 5
"""Rays of a control or check point at least."""
POSITIONS = ("measured", "adjusted")


def flight() -> dict:
    """Eight strips of sixteen photographs at 80/60 %; image points of one pixel."""
    return {
        "name": "drone",
        "camera": {"p1": {"model": "frame", "size_px": [8192, 5460], "pixel_um": 4.3, "focal_length_mm": 35.0,
                          "interior": {"focal_length_mm": {"fixed": False}, "x0_mm": {"fixed": False},
                                       "y0_mm": {"fixed": False}}}},
        "flight": {"gsd_m": 0.0185, "strips": 8, "images_per_strip": 16, "end_lap": 0.8, "side_lap": 0.6,
                   "attitude_sigma_deg": [1.0, 1.0, 2.0]},
        "terrain": {"kind": "undulating", "height_m": 5.0, "relief_rms_m": 4.0, "wavelength_m": 120.0},
        "tie_points": {"per_image": 120, "probability": 0.9, "sigma_um": 4.3},
        "control": {"distance_bases": 8.0, "sigma_m": [0.02, 0.02, 0.03], "check_points": 30},
        "start_values": {"kind": "perturbed", "position_sigma_m": 0.5, "angle_sigma_deg": 0.05},
    }  # fmt: skip


def held_by_six(block: aerotri.Block) -> aerotri.Block:
    """The block with six control points, spread well, one check point in the middle and one far from all control."""
    rays = np.bincount(block.image_points.point, minlength=len(block.points))
    control = block.control
    seen = np.flatnonzero(rays[control.point] >= FEWEST_RAYS)
    place, centre = control.xyz[seen, :2], np.nanmean(control.xyz[seen, :2], axis=0)
    held = [int(np.argmax(np.linalg.norm(place - centre, axis=1)))]
    while len(held) < 6:
        apart = np.min(np.linalg.norm(place[:, None] - place[None, held], axis=2), axis=1)
        held.append(int(np.argmax(apart)))
    others = np.setdiff1d(np.arange(len(seen)), held)
    apart = np.min(np.linalg.norm(place[others][:, None] - place[None, held], axis=2), axis=1)
    middle = int(others[np.argmin(np.linalg.norm(place[others] - centre, axis=1))])
    far = int(others[np.argmax(np.where(others == middle, -1.0, apart))])
    names = block.points[control.point[seen]].astype(str)
    unused = np.setdiff1d(block.points[control.point].astype(str), names[[*held, middle, far]])
    return aerotri.edit(
        block, control=names[held].tolist(), check=names[[middle, far]].tolist(),
        off=unused.tolist(),
    )  # fmt: skip


def errors_over_sigma(block: aerotri.Block, parameters: str, position: str) -> list[float]:
    """Of both check heights."""
    settings = {"parameters": parameters, "parameter_position": position, "model_part": "off"}
    result = aerotri.adjust(aerotri.with_settings(block, **settings), explain=False)
    check = result.adjusted.check
    z = check.difference[:, 2] / check.sigma[:, 2]
    return z[np.isfinite(z)].tolist()


def one(keys: list[tuple[str, str]], seed: int) -> list[list[float]]:
    """Errors over σ of a flight, by parameters and position."""
    block = held_by_six(aerotri.simulate(flight(), seed=seed).block)
    return [errors_over_sigma(block, *key) for key in keys]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=60)
    parser.add_argument("--sets", nargs="+", default=list(SETS))
    add_executor(parser)
    options = parser.parse_args()
    keys = [(s, p) for s in options.sets for p in POSITIONS]
    with runs_of(options) as runs:
        found = zip(keys, zip(*runs(one, keys, range(1, options.seeds + 1)), strict=True), strict=True)
    n = options.seeds
    low, high = np.sqrt(chi2.ppf([0.0005, 0.9995], n) / n)
    print(f"# Where additional parameters are evaluated, {n} simulated flights (tools/prove/parameter_position.py)\n")
    print(f"Height error over σ; without bias a mean within ±{3.3 / np.sqrt(n):.2f}, a root mean square in")
    print(f"{low:.2f} … {high:.2f}.\n")
    print("| parameters | evaluated at the | mean, middle | mean, border | RMS, middle | RMS, border |")
    print("|---|---|---|---|---|---|")
    for (parameters, position), values in found:
        z = np.array(values)
        mean, rms = z.mean(axis=0), np.sqrt(np.mean(z**2, axis=0))
        cells = [parameters, f"{position} point", *(f"{v:+.2f}" for v in mean), *(f"{v:.2f}" for v in rms)]
        print("| " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
