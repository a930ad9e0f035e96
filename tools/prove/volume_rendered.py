"""From rendered photographs to a volume whose truth is known: is the stated σ its error?

    python tools/prove/volume_rendered.py FOLDER [--seeds 5] [--out results]

15 photographs of 800 × 600 pixels, 0.1 m a pixel, by a lens that bends and a wrong interior orientation, over a hill on
undulating ground; control points measured in them with 0.1 px. From the files alone: tie points, adjustment with
self-calibration, pickets, volume over a level inside a polygon. The truth is the true ground integrated inside the same
polygon. With --out volume_rendered.md is written there. Last printed:

| seed | pickets | true, m³ | computed | error | σ | adjustment | matching | interpolation | z |
|---|---|---|---|---|---|---|---|---|---|
| 1 | 4027 | 8455.9 | 8478.9 | +23.0 | 20.0 | 18.89 | 0.08 | 6.63 | +1.15 |
| 2 | 4101 | 8361.5 | 8307.7 | -53.7 | 19.8 | 18.61 | 0.09 | 6.62 | -2.72 |
| 3 | 4415 | 8489.2 | 8461.2 | -28.0 | 18.8 | 17.76 | 0.08 | 6.24 | -1.49 |
| 4 | 4093 | 8398.2 | 8408.5 | +10.3 | 18.5 | 17.19 | 0.09 | 6.71 | +0.56 |
| 5 | 4336 | 8605.8 | 8602.5 | -3.2 | 19.7 | 17.96 | 0.08 | 8.01 | -0.16 |

Σz² 11.27, 99.9 % band 0.16 … 22.11: inside
"""

from __future__ import annotations

import argparse
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
from scipy.stats import chi2

import aerotri
from photographs_to_block import BYTES_OF_SEED, SPEC, tied_and_adjusted, write_files
from runs_elsewhere import add_executor, folder_of, runs_of

PLAN = SPEC | {
    "name": "stockpile",
    "camera": {"cam": SPEC["camera"]["cam"] | {"size_px": [800, 600], "focal_length_mm": 4.8}},
    "flight": SPEC["flight"] | {"strips": 3, "images_per_strip": 5, "cross_strips": []},
    "terrain": {"kind": "undulating", "height_m": 50.0, "relief_rms_m": 0.6, "wavelength_m": 40.0,
                "hill_height_m": 7.0, "hill_radius_m": 11.0},
    "control": {"distance_bases": 2.0, "sigma_m": [0.01, 0.01, 0.02], "check_points": 0},
}  # fmt: skip
LEVEL, RADIUS, CORNERS, INTERVAL = 48.0, 28.0, 11, 2.0
PANELS = 600


@dataclass(frozen=True)
class Outcome:
    """True volume, the computed one, its σ and their parts, m³."""

    truth: float
    volume: float
    sigma: float
    parts: dict[str, float]
    pickets: int

    @property
    def z(self) -> float:
        return (self.volume - self.truth) / self.sigma


def site() -> shapely.Polygon:
    """The polygon, not in line with the flight."""
    angle = 0.3 + 2.0 * np.pi * np.arange(CORNERS) / CORNERS
    return shapely.Polygon(RADIUS * np.column_stack([np.cos(angle), 0.8 * np.sin(angle)]))


def true_volume(seed: int, boundary: shapely.Polygon) -> float:
    """m³ over the level, by cells of a twelfth of a metre."""
    left, bottom, right, top = boundary.bounds
    cell = max(right - left, top - bottom) / PANELS
    x, y = np.meshgrid(np.arange(left, right, cell), np.arange(top, bottom, -cell))
    boxes = shapely.box(x.ravel(), y.ravel() - cell, x.ravel() + cell, y.ravel())
    shapely.prepare(boundary)
    weight = np.where(shapely.contains_properly(boundary, boxes), cell**2, 0.0)
    edge = (weight == 0.0) & shapely.intersects(boundary, boxes)
    weight[edge] = shapely.area(shapely.intersection(boxes[edge], boundary))
    middle = np.column_stack([x.ravel() + 0.5 * cell, y.ravel() - 0.5 * cell])
    ground = aerotri.simulate(PLAN, seed).true_heights(middle[weight > 0.0])
    return float(weight[weight > 0.0] @ (ground - LEVEL))


def one(whole: Path, seed: int) -> Outcome:
    """From photographs to the volume, files in between."""
    folder, boundary = whole / f"rendered_{seed}", site()
    shutil.rmtree(folder, ignore_errors=True)
    write_files(folder, seed, PLAN)
    tied_and_adjusted(folder, seed, 4.8, ())
    aerotri.terrain(folder / "result", folder / "photographs", interval=INTERVAL).save(folder / "dtm")
    found = aerotri.volume(
        folder / "dtm" / "dsm.tif", boundary, base=LEVEL, adjustment=folder / "result",
        pickets=folder / "dtm" / "pickets.parquet",
    )  # fmt: skip
    s = found.summary["sigma"]
    return Outcome(true_volume(seed, boundary), found.net, s["sigma_m3"], s["parts_m3"], s["pickets"])


def main() -> None:
    """Run, print, write where asked."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folder", type=Path, help="to work in")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--out", type=Path)
    add_executor(parser)
    options = parser.parse_args()
    boundary = site()
    lines = [
        f"# Volumes from rendered photographs, {boundary.area:.0f} m²", "",
        "| seed | pickets | true, m³ | computed | error | σ | adjustment | matching | interpolation | z |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]  # fmt: skip
    print("\n".join(lines), flush=True)
    seeds = range(1, options.seeds + 1)
    with runs_of(options) as runs:
        found: list[Outcome] = runs(one, folder_of(options.folder, options), seeds, BYTES_OF_SEED)
    for seed, o in zip(seeds, found, strict=True):
        parts = " | ".join(f"{o.parts[name]:.2f}" for name in ("adjustment", "matching", "interpolation"))
        lines.append(f"| {seed} | {o.pickets} | {o.truth:.1f} | {o.volume:.1f} | {o.volume - o.truth:+.1f} | "
                     f"{o.sigma:.1f} | {parts} | {o.z:+.2f} |")  # fmt: skip
        print(lines[-1], flush=True)
    low, high = chi2.ppf([0.0005, 0.9995], len(found))
    total = sum(o.z**2 for o in found)
    verdict = "inside" if low <= total <= high else "OUTSIDE"
    lines += ["", f"Σz² {total:.2f}, 99.9 % band {low:.2f} … {high:.2f}: {verdict}"]
    print("\n".join(lines[-2:]))
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "volume_rendered.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
