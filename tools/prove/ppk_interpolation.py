"""What interpolation of a real trajectory costs, and whether its stated σ is as large as its errors.

Of the 5 Hz trajectory of a DJI M300 (../shared/data/ppk) every k-th epoch is kept, and those between are interpolated.
While the drone flies (above 3 m/s), the table has the RMS of the errors, the RMS that is stated, and the RMS of their
ratio, east, north and up. Both contain the noise of the epoch that was left out. Last, the drone's own solution at its
586 time stamps less the trajectory. Prints Markdown; the last answer stands in tools/results/ppk_interpolation.md.

Measures the interpolation alone, which no command does: imports inside on purpose.

Example: python tools/prove/ppk_interpolation.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aerotri.coordinates.ellipsoid import metres_of_units
from aerotri.formats.assembly.interpolation import interpolated
from aerotri.formats.assembly.timed import Trajectory
from aerotri.formats.foreign.dji_mrk import read_dji_mrk
from aerotri.formats.foreign.grafnav import read_grafnav

DATA = Path(__file__).resolve().parents[3] / "shared" / "data" / "ppk"
FLYING_M_S = 3.0


def speeds(path: Trajectory) -> np.ndarray:
    """(n,) m/s at the epochs."""
    metres = path.place * metres_of_units(path.place[:1])
    return np.linalg.norm(np.gradient(metres, path.time, axis=0), axis=1)


def rms(values: np.ndarray) -> np.ndarray:
    return np.sqrt(np.nanmean(values**2, axis=0))


def in_cells(values: np.ndarray, digits: int) -> str:
    return " | ".join(f"{value:.{digits}f}" for value in values)


def main() -> None:
    path, stamps = read_grafnav(DATA / "m300_grafnav_5hz.txt"), read_dji_mrk(DATA / "m300_timestamp.mrk")
    flying = speeds(path) > FLYING_M_S
    print(f"{len(path)} epochs, {flying.sum()} of them in flight\n")
    print("| epochs kept every | interpolated | error mm E | N | U | stated mm E | N | U | ratio E | N | U |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for every in (2, 3, 5, 10):
        kept = np.arange(0, len(path), every)
        out = np.setdiff1d(np.flatnonzero(flying), kept)
        out = out[out < kept[-1]]
        found = interpolated(path.at(kept), path.time[out])
        error = (found.place - path.place[out]) * metres_of_units(path.place[out])
        cells = (
            in_cells(1e3 * rms(error), 1),
            in_cells(1e3 * rms(found.error), 1),
            in_cells(rms(error / found.error), 2),
        )
        print(f"| {0.2 * every:.1f} s | {len(out)} | {' | '.join(cells)} |")
    found = interpolated(path, stamps.time)
    print(f"\nAt the {len(stamps)} time stamps: interpolation {in_cells(1e3 * rms(found.error), 1)} mm,")
    print(f"σ of the positions {in_cells(1e3 * rms(found.sigma), 1)} mm (east | north | up, RMS).\n")
    apart = (stamps.place - found.place) * metres_of_units(found.place)
    print("The drone's own solution (quality 16: single point) less the trajectory:\n")
    print("| own solution | photographs | median m E | N | U | scatter m E | N | U |")
    print("|---|---|---|---|---|---|---|---|")
    small = stamps.sigma[:, 0] < 0.1
    for words, own in (("σ of centimetres is stated", small), ("σ of metres is stated", ~small)):
        middle = np.median(apart[own], axis=0)
        scatter = 1.4826 * np.median(np.abs(apart[own] - middle), axis=0)
        print(f"| {words} | {own.sum()} | {in_cells(middle, 2)} | {in_cells(scatter, 2)} |")


if __name__ == "__main__":
    main()
