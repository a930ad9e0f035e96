"""σ of a volume by a boundary that is not drawn exactly, where the base follows from the surface along it.

A cone of 6 m on level ground, an outline of twelve corners on its flank; every corner is off by 0.1 m in either
coordinate. The scatter of the volume over many draws, the base laid anew in each, stands beside the part "boundary" of
the stated σ, of every kind of base. Prints Markdown.

Example: python tools/prove/volume_moved_boundary.py --runs 100

Last result, 100 runs:

    | base | scatter m³ | stated m³ |
    |---|---|---|
    | boundary | 4.18 | 4.10 |
    | plane | 4.34 | 4.23 |
    | lowest | 22.79 | 24.02 |
    | level:100 | 1.98 | 1.93 |
"""

from __future__ import annotations

import argparse

import numpy as np
import shapely

import aerotri
from runs_elsewhere import add_executor, runs_of

CELL, CELLS, RADIUS, CORNERS, SIGMA = 0.25, 240, 10.0, 12, 0.1
BASES = "boundary", "plane", "lowest", "level:100"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=100)
    add_executor(parser)
    options = parser.parse_args()
    surface, ring = cone(), outline()
    print("| base | scatter m³ | stated m³ |\n|---|---|---|")
    with runs_of(options) as computed:
        for base in BASES:
            stated = aerotri.volume(surface, shapely.Polygon(ring), base=base, boundary_sigma=SIGMA)
            errors = np.array(computed(volume_of_draw, base, range(1, options.runs + 1))) - stated.net
            part = stated.summary["stated_sigma"]["parts_m3"]["boundary"]
            print(f"| {base} | {np.sqrt(np.mean(errors**2)):.2f} | {part:.2f} |", flush=True)


def volume_of_draw(base: str, seed: int) -> float:
    """m³, with other corners."""
    moved = outline() + np.random.default_rng(seed).normal(scale=SIGMA, size=(CORNERS, 2))
    return aerotri.volume(cone(), shapely.Polygon(moved), base=base).net


def cone() -> aerotri.Surface:
    """6 m high, half a metre down for every metre, on a level of 100 m."""
    x = CELL * (np.arange(CELLS) - 0.5 * CELLS + 0.5)
    x, y = np.meshgrid(x, x[::-1])
    z = 100.0 + np.maximum(6.0 - 0.5 * np.hypot(x, y), 0.0)
    return aerotri.Surface.of_array(z, left=-0.5 * CELL * CELLS, top=0.5 * CELL * CELLS, cell=CELL)


def outline() -> np.ndarray:
    """(corners, 2) m."""
    angle = np.linspace(0.0, 2.0 * np.pi, CORNERS, endpoint=False)
    return RADIUS * np.column_stack([np.cos(angle), np.sin(angle)])


if __name__ == "__main__":
    main()
