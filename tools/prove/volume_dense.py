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
    | level:0 | own | 1.04 | 0.91 | 1.44 |
    | level:0 | two | 0.80 | 0.60 | 1.08 |
    | boundary | own | 1.00 | 0.30 | 1.48 |
    | boundary | two | 0.70 | 0.13 | 1.69 |

    99 % band of one area with 20 flights: 0.60 … 1.43
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
from scipy.stats import chi2

import aerotri
from dense_surface import BYTES_OF_SEED, DRAWS, OTHER_SPEC, SCENES, SPEC, blocks, render, rms
from runs_elsewhere import add_executor, folder_of, runs_of

SCENE, SEED, RADIUS_M, APART_M = "y-parallax", 1, 35.0, 100.0
BASES = ("level:0", "boundary")


@dataclass(frozen=True, eq=False)
class Photographs:
    """What all flights share: the block without errors of tie points, its photographs, and the areas."""

    block: aerotri.Block
    folder: Path
    areas: list[shapely.Polygon]


def one(shared: Photographs, flight: int) -> tuple[dict[str, list[float]], dict[tuple[str, str], list[float]]]:
    """Volumes of the areas by base, and the part of the adjustment in their σ by base and photographs of a cell."""
    result = aerotri.adjust(blocks(shared.block, SCENE, SEED)[flight], explain=False)
    dense = aerotri.dense_surface(result, shared.folder)
    volumes, sigmas = {}, {}
    with tempfile.TemporaryDirectory() as place:
        # without the file of the photographs beside it two are taken for every cell
        plain = dense.save(Path(place) / "dense").joinpath("dsm.tif").rename(Path(place) / "alone.tif")
        for base in BASES:
            for by, surface in (("own", dense), ("two", plain)):
                found = [aerotri.volume(surface, area, base=base, adjustment=result).summary for area in shared.areas]
                sigmas[base, by] = [each["sigma"]["parts_m3"]["adjustment"] for each in found]
                if by == "own":
                    volumes[base] = [each["net_m3"] for each in found]
    return volumes, sigmas


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--flights", type=int, default=DRAWS)
    add_executor(parser)
    arguments = parser.parse_args()
    if arguments.flights < 2:
        parser.error("one flight has no scatter: give --flights 2 or more")
    folder = folder_of(arguments.folder, arguments)
    ground, look = SCENES[SCENE]
    spec = SPEC | {"terrain": {"height_m": 50.0} | ground}
    spec |= {table: SPEC[table] | other for table, other in OTHER_SPEC[SCENE].items()}
    flight = aerotri.simulate(spec, SEED)
    photographs = render(folder / "flown", flight, SCENE, look)
    shared = Photographs(flight.block, photographs, circles(flight.block))
    with runs_of(arguments) as runs:
        measured = runs(one, shared, range(arguments.flights), BYTES_OF_SEED)
    found = {key: [sigmas[key] for _, sigmas in measured] for key in measured[0][1]}
    volumes = {base: [of_bases[base] for of_bases, _ in measured] for base in BASES}
    print("| base | photographs of a cell | scatter over σ, all areas | smallest | largest |\n|---|---|---|---|---|")
    for (base, by), sigmas in found.items():
        ratio = np.std(volumes[base], axis=0, ddof=1) / rms_of_flights(sigmas)
        print(f"| {base} | {by} | {rms(ratio):.2f} | {ratio.min():.2f} | {ratio.max():.2f} |")
    print(
        f"\n99 % band of one area with {len(measured)} flights: {' … '.join(f'{v:.2f}' for v in band(len(measured)))}"
    )


def band(flights: int) -> np.ndarray:
    """Of the scatter of so many normal errors over their σ."""
    return np.sqrt(chi2.ppf([0.005, 0.995], flights - 1) / (flights - 1))


def rms_of_flights(sigmas: list[list[float]]) -> np.ndarray:
    """m³ of every area."""
    return np.sqrt(np.mean(np.square(sigmas), axis=0))


def circles(block: aerotri.Block) -> list[shapely.Polygon]:
    """Nine areas about the middle of the block."""
    x, y = aerotri.adjust(blocks(block, SCENE, SEED)[0], explain=False).adjusted.images.centre.mean(axis=0)[:2]
    steps = (-APART_M, 0.0, APART_M)
    return [shapely.Point(x + i, y + j).buffer(RADIUS_M) for i in steps for j in steps]


if __name__ == "__main__":
    main()
