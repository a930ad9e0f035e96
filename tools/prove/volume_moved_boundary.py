"""σ of a volume by a boundary that is not drawn exactly, where the base follows from the surface along it.

A cone of 6 m on level ground, an outline of twelve corners on its flank; every corner is off by 0.1 m in either
coordinate. The scatter of the volume over many draws, the base laid anew in each, stands beside the part "boundary" of
the stated σ, of every kind of base. Prints Markdown.

Example: python tools/prove/volume_moved_boundary.py --runs 100

Last result, 100 runs:

    | base | scatter m³ | stated m³ |
    |---|---|---|
    | boundary | 4.05 | 4.10 |
    | plane | 3.93 | 4.23 |
    | lowest | 24.07 | 24.02 |
    | level:100 | 1.91 | 1.93 |
"""

from __future__ import annotations

import argparse

import numpy as np
import shapely

import aerotri

CELL, CELLS, RADIUS, CORNERS, SIGMA = 0.25, 240, 10.0, 12, 0.1
BASES = "boundary", "plane", "lowest", "level:100"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=100)
    runs = parser.parse_args().runs
    surface, ring, rng = cone(), outline(), np.random.default_rng(2)
    print("| base | scatter m³ | stated m³ |\n|---|---|---|")
    for base in BASES:
        stated = aerotri.volume(surface, shapely.Polygon(ring), base=base, boundary_sigma=SIGMA)
        errors = [
            aerotri.volume(surface, shapely.Polygon(ring + more), base=base).net - stated.net
            for more in rng.normal(scale=SIGMA, size=(runs, *ring.shape))
        ]
        part = stated.summary["stated_sigma"]["parts_m3"]["boundary"]
        print(f"| {base} | {np.sqrt(np.mean(np.square(errors))):.2f} | {part:.2f} |", flush=True)


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
