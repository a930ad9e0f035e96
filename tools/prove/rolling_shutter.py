"""Rolling shutter on simulated drone flights whose truth is known (on real ones: brighton_surface.py).

    python tools/prove/rolling_shutter.py [--seeds 20]

Flights: 24 photographs of 4000 × 3000 pixels of 2 cm at 8 m/s, 80/60 %, three strips and one across, relief of 2 m
(RMS); tie points with 0.33 px, GNSS with 2 and 3 cm, control with 1 and 1.5 cm. Rows are read in 30 ms or all at once.
The aircraft flies through the projection centres on a cubic spline. w is (found − true)/σ.
"""

from __future__ import annotations

import argparse
import copy
from collections import Counter
from collections.abc import Callable
from dataclasses import replace

import numpy as np

import aerotri
from aerotri import observations

TRUE_MS = 30.0
Change = Callable[[aerotri.Block], aerotri.Block]
FEW = 5
"""Flights of the cases that only show a limit."""
AXES = ("X", "Y", "Z")
SPEC = {
    "name": "drone",
    "camera": {"cam": {"size_px": [4000, 3000], "pixel_um": 2.4, "focal_length_mm": 8.8, "flight_axis": "+y",
                       "interior": {"focal_length_mm": {}, "x0_mm": {}, "y0_mm": {}}}},
    "flight": {"gsd_m": 0.02, "strips": 3, "images_per_strip": 6, "end_lap": 0.8, "side_lap": 0.6, "speed_m_s": 8.0,
               "attitude_sigma_deg": [1.0, 1.0, 2.0], "position_sigma_m": [0.3, 0.3, 0.3],
               "cross_strips": [{"position": 0.5, "images": 6}]},
    "terrain": {"kind": "undulating", "relief_rms_m": 2.0, "wavelength_m": 40.0},
    "tie_points": {"per_image": 80, "sigma_um": 0.8, "probability": 0.8},
    "control": {"distance_bases": 3, "check_points": 10, "sigma_m": [0.01, 0.01, 0.015]},
    "gnss": {"sigma_m": [0.02, 0.02, 0.03]},
}  # fmt: skip


def spec(readout_ms: float, flat: bool = False, **shutter: object) -> dict:
    """The plan of a flight; `flat`: without relief, without the strip across, without tilts."""
    plan = copy.deepcopy(SPEC)
    plan["camera"]["cam"]["rolling_shutter"] = {"readout_ms": readout_ms} | shutter
    if flat:
        plan["terrain"] = {"kind": "flat"}
        plan["flight"] |= {"cross_strips": [], "attitude_sigma_deg": [0.0, 0.0, 0.0], "position_sigma_m": [0.0] * 3,
                           "alternating": False}  # fmt: skip
    return plan


def with_shutter(block: aerotri.Block, shutter: observations.RollingShutter | None) -> aerotri.Block:
    """The block with another rolling shutter of its camera."""
    return replace(block, cameras=tuple(replace(camera, rolling_shutter=shutter) for camera in block.cameras))


def whole_seconds(block: aerotri.Block) -> aerotri.Block:
    """The block with times as EXIF has them."""
    return replace(block, gnss_ins=replace(block.gnss_ins, time=np.floor(block.gnss_ins.time)))


def readout(result: aerotri.Adjustment) -> tuple[float, float]:
    """Readout time and its σ, ms."""
    found = result.adjusted.rolling_shutters.readouts[0]
    return found.readout_ms, found.sigma_ms


def columns(table: object, letter: str) -> np.ndarray:
    """(k, 3) of a table of check points."""
    return np.column_stack([table[f"{letter}{axis}"] for axis in AXES])


def case(
    name: str, seeds: int, readout_ms: float, change: Change | None = None, flat: bool = False, **shutter: object
) -> str:
    """A row of the table: readout times, errors at check points and verdicts over the seeds."""
    w, sigma, sigma0, check_w, check_d, verdicts = [], [], [], [], [], Counter()
    for seed in range(1, seeds + 1):
        block = aerotri.simulate(spec(readout_ms, flat, **shutter), seed).block
        result = aerotri.adjust(block if change is None else change(block))
        sigma0.append(result.sigma0)
        check_w.append(columns(result.check, "w"))
        check_d.append(columns(result.check, "d"))
        shutters = result.adjusted.rolling_shutters
        if shutters is not None and shutters.readouts[0].sigma_ms > 0.0:
            value, s = readout(result)
            w.append((value - readout_ms) / s)
            sigma.append(s)
        if shutters is not None and shutters.test is not None:
            verdicts[shutters.test.verdict] += 1
    of_w = f"{np.mean(w):+.2f} | {np.sqrt(np.mean(np.square(w))):.2f} | {np.median(sigma):.3f}" if w else "– | – | –"
    rms = " ".join(f"{1e3 * v:.0f}" for v in np.sqrt(np.mean(np.concatenate(check_d) ** 2, axis=0)))
    said = ", ".join(f"{what} {count}" for what, count in verdicts.most_common()) or "–"
    whole = float(np.sqrt(np.mean(np.concatenate(check_w) ** 2)))
    return f"| {name} | {np.mean(sigma0):.2f} | {of_w} | {rms} | {whole:.2f} | {said} |"


def simulated(seeds: int) -> None:
    """All cases."""
    own = observations.RollingShutter(observations.Prior(TRUE_MS, 1.0), motion="photograph", rotation="photograph")
    none = {"stated": {"value": 0.0, "fixed": True}}
    head = "σ0 | readout: mean w | RMS w | σ ms | check points: RMS X Y Z mm | RMS w | verdict of the test"
    few = min(seeds, FEW)
    print(f"{seeds} flights each, the last three {few}\n\n| flight | {head} |\n|" + "---|" * 9)
    print(case("all rows at once, adjusted so", seeds, 0.0, **none), flush=True)
    print(case("all rows at once, readout time free", seeds, 0.0), flush=True)
    print(case("30 ms, ignored", seeds, TRUE_MS, **none), flush=True)
    print(case("30 ms, readout time free", seeds, TRUE_MS), flush=True)
    print(case("30 ms, times in whole seconds", few, TRUE_MS, whole_seconds), flush=True)
    print(case("30 ms, turning by 3 °/s, motion by photograph, 30 ± 1 ms", few, TRUE_MS,
               lambda block: with_shutter(block, own), rotation_rate_sigma_deg_s=3.0), flush=True)  # fmt: skip
    print(case("30 ms, strips in one direction over a plane, no tilts", few, TRUE_MS, flat=True), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20)
    simulated(parser.parse_args().seeds)


if __name__ == "__main__":
    main()
