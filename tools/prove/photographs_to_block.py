"""From photographs alone to check points: rendered blocks whose truth is known, and the real photographs beside.

    python tools/prove/photographs_to_block.py --out DIR [--seeds 4] [--data ../shared/data]

Rendered: 12 photographs of 1000 × 750 pixels, 0.1 m a pixel, 70/50 %, a lens that bends by some 10 pixels at the
corners and a wrong interior orientation; control and check points measured in the photographs with 0.1 px, given with
σ 0.01, 0.01, 0.02 m. d is adjusted − given at check points, w is d over its σ. Last printed:

| seed | check points | σ0 | RMS d X Y Z m | RMS w X Y Z | largest w |
|---|---|---|---|---|---|
| 1 | 20 | 0.29 | 0.010 0.013 0.028 | 0.96 1.29 1.13 | 2.8 |
| 2 | 20 | 0.21 | 0.012 0.012 0.041 | 1.13 1.18 1.87 | 6.1 |
| 3 | 20 | 0.25 | 0.013 0.010 0.027 | 1.23 0.97 1.21 | 3.3 |
| 4 | 20 | 0.26 | 0.011 0.011 0.032 | 1.07 1.03 1.46 | 3.0 |
all: RMS w 1.23, 10.0% beyond 1.96

σ0 below 1: these photographs have no noise, windows fit to 0.004 px, and the first orientation, from which σ of tie
points is taken, is not exact to that. σ of check points is then too small, by a quarter of the errors.

brighton, tie points and adjustment: 18 photographs, 5566 points, 24259 rays; median residual 0.34 px, 95 % below
1.06 px; GNSS residuals, RMS: 0.17, 0.60, 0.31 m; σ0 1.20
"""

from __future__ import annotations

import argparse
import shutil
import time
from pathlib import Path

import numpy as np

import aerotri
from aerotri import geometry
from runs_elsewhere import add_executor, folder_of, runs_of

SPEC = {
    "name": "rendered",
    "camera": {"cam": {"size_px": [1000, 750], "pixel_um": 6.0, "focal_length_mm": 6.0,
                       "errors": {"lens": {"k1": -0.05, "k2": 0.01},
                                  "interior": {"focal_length_mm": 0.05, "x0_mm": 0.02, "y0_mm": -0.015}}}},
    "flight": {"gsd_m": 0.1, "strips": 2, "images_per_strip": 5, "end_lap": 0.7, "side_lap": 0.5, "heading_deg": 30.0,
               "cross_strips": [{"position": 0.5, "images": 2}],
               "attitude_sigma_deg": [2.0, 2.0, 3.0], "position_sigma_m": [2.0, 2.0, 2.0]},
    "terrain": {"kind": "undulating", "height_m": 50.0, "relief_rms_m": 5.0, "wavelength_m": 120.0},
    "tie_points": {"per_image": 20, "probability": 0.9, "sigma_um": 0.6},
    "control": {"distance_bases": 1.5, "sigma_m": [0.01, 0.01, 0.02], "check_points": 20},
}  # fmt: skip
AXES = ("X", "Y", "Z")
BYTES_OF_SEED = 1_000_000_000
"""Memory of a seed with its photographs; chosen [C]."""


def write_files(folder: Path, seed: int, plan: dict = SPEC) -> tuple[str, ...]:
    """Photographs and gcp_list.txt of a rendered block; the names of its check points."""
    flight = aerotri.simulate(plan, seed)
    block, camera, rays = flight.block, flight.block.cameras[0], flight.block.image_points
    flight.save(folder / "flown", photographs=True)
    (folder / "flown" / "photographs").rename(folder / "photographs")
    place = dict(zip(block.control.point.tolist(), block.control.xyz.tolist(), strict=True))
    lines = ["+proj=local"]
    for image, point, xy in zip(rays.image.tolist(), rays.point.tolist(), rays.xy, strict=True):
        if point in place:
            values = [
                *place[point],
                *(geometry.px_from_mm(xy[None], camera.size_px, camera.pixel_mm)[0] - 0.5).tolist(),
            ]
            words = " ".join(f"{value:.4f}" for value in values)
            lines.append(f"{words} {block.images.names[image]}.tif {block.points[point]}")
    (folder / "gcp_list.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    measured = {line.split()[-1] for line in lines[1:]}
    check = block.points[block.control.point[block.control.is_check]].tolist()
    return tuple(name for name in check if name in measured)


def rendered(folder: Path, seed: int) -> tuple[aerotri.Adjustment, np.ndarray, np.ndarray]:
    """Tie points, adjustment; the result, d and w (k, 3) of the check points."""
    check = write_files(folder, seed)
    result = tied_and_adjusted(folder, seed, 6.0, check)
    d, w = (np.column_stack([result.check[f"{what}{axis}"] for axis in AXES]) for what in ("d", "w"))
    return result, d, w


def of_seed(out: Path, seed: int) -> tuple[float, np.ndarray, np.ndarray]:
    """σ0 of a block from its photographs, d and w of its check points."""
    folder = out / f"rendered_{seed}"
    shutil.rmtree(folder, ignore_errors=True)
    result, d, w = rendered(folder, seed)
    return result.sigma0, d, w


def tied_and_adjusted(folder: Path, seed: int, focal_length_mm: float, check: tuple[str, ...]) -> aerotri.Adjustment:
    """From the photographs and gcp_list.txt of a folder to its block and its result, which are saved there."""
    tied = aerotri.tie_points(
        folder / "photographs", control=folder / "gcp_list.txt", check=check, focal_length_mm=focal_length_mm,
        pixel_um=6.0, control_sigma_m=(0.01, 0.01, 0.02), mark_sigma_px=0.1, seed=seed,
    )  # fmt: skip
    result = aerotri.adjust(tied.save(folder / "block"))
    result.save(folder / "result", plots=False)
    return result


def brighton(folder: Path, data: Path) -> list[str]:
    """One command, and what it says; its surface against that of another program, `model.laz`."""
    begun, cpu = time.perf_counter(), time.process_time()
    project = aerotri.run(data / "images", folder)
    seconds, cpu = time.perf_counter() - begun, time.process_time() - cpu
    block, result = project.block, project.adjustment
    size = np.hypot(result.rays["vx"], result.rays["vy"]) / block.cameras[0].pixel_mm
    centre = np.column_stack([result.images[name] for name in ("X0", "Y0", "Z0")])
    off = centre[block.gnss_ins.image] - block.gnss_ins.xyz
    surface = aerotri.compare(folder / "dtm" / "dsm.tif", data / "model.laz", align="rigid").summary
    d = surface["difference_m"]
    return [
        f"{len(block.images)} photographs, {len(block.points)} points, {len(size)} rays",
        f"median residual {np.median(size):.2f} px, 95 % below {np.percentile(size, 95):.2f} px",
        "GNSS residuals, RMS: " + ", ".join(f"{v:.2f}" for v in np.sqrt((off**2).mean(axis=0))) + " m",
        f"{seconds:.0f} s with the surface, of the processors {cpu:.0f} s",
        f"surface: {surface['coverage']:.1%} covered, median {d['median']:+.3f}, NMAD {d['nmad']:.3f}, "
        f"RMSE {d['rmse']:.3f} m, cells of {surface['cell_m']:.2f} m",
    ]


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    add_executor(parser)
    arguments = parser.parse_args()
    arguments.out = folder_of(arguments.out, arguments)
    every, lines, seeds = [], [], range(1, arguments.seeds + 1)
    with runs_of(arguments) as runs:
        found = runs(of_seed, arguments.out, seeds, BYTES_OF_SEED)
    for seed, (sigma0, d, w) in zip(seeds, found, strict=True):
        every.append(w)
        rms = [np.sqrt((values**2).mean(axis=0)) for values in (d, w)]
        lines.append(
            f"| {seed} | {len(w)} | {sigma0:.2f} | "
            + " | ".join(" ".join(f"{v:.3f}" if k == 0 else f"{v:.2f}" for v in rms[k]) for k in (0, 1))
            + f" | {np.abs(w).max():.1f} |"
        )
    print("\n| seed | check points | σ0 | RMS d X Y Z m | RMS w X Y Z | largest w |\n|---|---|---|---|---|---|")
    print("\n".join(lines))
    if every:
        whole = np.concatenate(every)
        print(f"all: RMS w {np.sqrt((whole**2).mean()):.2f}, {(np.abs(whole) > 1.96).mean():.1%} beyond 1.96")
    if (arguments.data / "brighton").is_dir():
        shutil.rmtree(arguments.out / "brighton", ignore_errors=True)
        said = brighton(arguments.out / "brighton", arguments.data / "brighton")
        print("\nbrighton, one command: " + "; ".join(said))


if __name__ == "__main__":
    main()
