"""Volumes of dense surfaces against the scatter of their errors: is the part of the adjustment in their σ right?

Two strips of four photographs over undulating ground, as in `dense_surface.py`, are rendered once; tie points of half a
pixel are drawn anew for every flight. Nine areas, circles of 35 m radius 100 m apart, are measured in every dense
surface, over a fixed height and over a base through the boundary. What changes from flight to flight is the adjustment
alone (and what the matching makes of it): the scatter of a volume over its σ should be one. The photographs of a cell
are taken from the surface (as many of the nearest as measured it); beside it what two for all cells would say.

    python tools/prove/volume_dense.py [FOLDER] [--flights 20]

Last result:

    | base | photographs of a cell | scatter over σ, all areas | smallest | largest |
    |---|---|---|---|---|
    | level:0 | own | 1.04 | 0.91 | 1.45 |
    | level:0 | two | 0.80 | 0.59 | 1.09 |
    | boundary | own | 1.01 | 0.35 | 1.49 |
    | boundary | two | 0.71 | 0.14 | 1.74 |

    99 % band of one area with 20 flights: 0.60 … 1.43
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
import shapely
from scipy.stats import chi2

import aerotri
from dense_surface import DRAWS, OTHER_SPEC, SCENES, SPEC, blocks, render, rms

SCENE, SEED, RADIUS_M, APART_M = "y-parallax", 1, 35.0, 100.0
BASES = ("level:0", "boundary")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--flights", type=int, default=DRAWS)
    arguments = parser.parse_args()
    folder = arguments.folder or Path(tempfile.mkdtemp())
    ground, look = SCENES[SCENE]
    spec = SPEC | {"terrain": {"height_m": 50.0} | ground}
    spec |= {table: SPEC[table] | other for table, other in OTHER_SPEC[SCENE].items()}
    flight = aerotri.simulate(spec, SEED)
    photographs = render(folder / "flown", flight, SCENE, look)
    results = [aerotri.adjust(block, explain=False) for block in blocks(flight.block, SCENE, SEED)[: arguments.flights]]
    areas = circles(results[0])
    found: dict[tuple[str, str], list[list[float]]] = {(base, by): [] for base in BASES for by in ("own", "two")}
    volumes: dict[str, list[list[float]]] = {base: [] for base in BASES}
    for result in results:
        dense = aerotri.dense_surface(result, photographs)
        plain = dense.save(folder / "dense").joinpath("dsm.tif").rename(folder / "alone.tif")
        for base in BASES:
            own, two = (
                [aerotri.volume(surface, area, base=base, adjustment=result).summary for area in areas]
                for surface in (dense, plain)
            )
            volumes[base].append([one["net_m3"] for one in own])
            for by, summaries in (("own", own), ("two", two)):
                found[base, by].append([one["sigma"]["parts_m3"]["adjustment"] for one in summaries])
    print("| base | photographs of a cell | scatter over σ, all areas | smallest | largest |\n|---|---|---|---|---|")
    for (base, by), sigmas in found.items():
        ratio = np.std(volumes[base], axis=0, ddof=1) / rms_of_flights(sigmas)
        print(f"| {base} | {by} | {rms(ratio):.2f} | {ratio.min():.2f} | {ratio.max():.2f} |")
    print(f"\n99 % band of one area with {len(results)} flights: {' … '.join(f'{v:.2f}' for v in band(len(results)))}")


def band(flights: int) -> np.ndarray:
    """Of the scatter of so many normal errors over their σ."""
    return np.sqrt(chi2.ppf([0.005, 0.995], flights - 1) / (flights - 1))


def rms_of_flights(sigmas: list[list[float]]) -> np.ndarray:
    """m³ of every area."""
    return np.sqrt(np.mean(np.square(sigmas), axis=0))


def circles(result: aerotri.Adjustment) -> list[shapely.Polygon]:
    """Nine areas about the middle of the block."""
    x, y = np.array(result.record.result.images.centre).mean(axis=0)[:2]
    steps = (-APART_M, 0.0, APART_M)
    return [shapely.Point(x + i, y + j).buffer(RADIUS_M) for i in steps for j in steps]


if __name__ == "__main__":
    main()
