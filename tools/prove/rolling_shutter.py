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
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

import aerotri
from aerotri import observations
from runs_elsewhere import Runs, add_executor, runs_of

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


@dataclass(frozen=True)
class Flown:
    """How the flights of a row are flown and changed before they are adjusted."""

    readout_ms: float
    change: Change | None = None
    flat: bool = False
    shutter: Mapping[str, object] = field(default_factory=dict)


def one(flown: Flown, seed: int) -> tuple[float, np.ndarray, np.ndarray, tuple[float, float] | None, str]:
    """Of one flight: σ0, w and d of check points, readout time and its σ where estimated, verdict of the test."""
    block = aerotri.simulate(spec(flown.readout_ms, flown.flat, **flown.shutter), seed).block
    result = aerotri.adjust(block if flown.change is None else flown.change(block))
    shutters = result.adjusted.rolling_shutters
    estimated = shutters is not None and shutters.readouts[0].sigma_ms > 0.0
    verdict = "" if shutters is None or shutters.test is None else shutters.test.verdict
    time = readout(result) if estimated else None
    return result.sigma0, columns(result.check, "w"), columns(result.check, "d"), time, verdict


def case(name: str, seeds: int, flown: Flown, runs: Runs) -> str:
    """A row of the table: readout times, errors at check points and verdicts over the seeds."""
    sigma0, check_w, check_d, times, said_of = zip(*runs(one, flown, range(1, seeds + 1)), strict=True)
    found = [time for time in times if time is not None]
    w, sigma = [(value - flown.readout_ms) / s for value, s in found], [s for _, s in found]
    verdicts = Counter(verdict for verdict in said_of if verdict)
    of_w = f"{np.mean(w):+.2f} | {np.sqrt(np.mean(np.square(w))):.2f} | {np.median(sigma):.3f}" if w else "– | – | –"
    rms = " ".join(f"{1e3 * v:.0f}" for v in np.sqrt(np.mean(np.concatenate(check_d) ** 2, axis=0)))
    said = ", ".join(f"{what} {count}" for what, count in verdicts.most_common()) or "–"
    whole = float(np.sqrt(np.mean(np.concatenate(check_w) ** 2)))
    return f"| {name} | {np.mean(sigma0):.2f} | {of_w} | {rms} | {whole:.2f} | {said} |"


def by_photograph(block: aerotri.Block) -> aerotri.Block:
    """30 ± 1 ms, and a motion and a rotation of every photograph."""
    own = observations.RollingShutter(observations.Prior(TRUE_MS, 1.0), motion="photograph", rotation="photograph")
    return with_shutter(block, own)


def simulated(seeds: int, runs: Runs) -> None:
    """All cases."""
    none = {"stated": {"value": 0.0, "fixed": True}}
    head = "σ0 | readout: mean w | RMS w | σ ms | check points: RMS X Y Z mm | RMS w | verdict of the test"
    few = min(seeds, FEW)
    print(f"{seeds} flights each, the last three {few}\n\n| flight | {head} |\n|" + "---|" * 9)
    turning = Flown(TRUE_MS, by_photograph, shutter={"rotation_rate_sigma_deg_s": 3.0})
    for name, count, flown in (
        ("all rows at once, adjusted so", seeds, Flown(0.0, shutter=none)),
        ("all rows at once, readout time free", seeds, Flown(0.0)),
        ("30 ms, ignored", seeds, Flown(TRUE_MS, shutter=none)),
        ("30 ms, readout time free", seeds, Flown(TRUE_MS)),
        ("30 ms, times in whole seconds", few, Flown(TRUE_MS, whole_seconds)),
        ("30 ms, turning by 3 °/s, motion by photograph, 30 ± 1 ms", few, turning),
        ("30 ms, strips in one direction over a plane, no tilts", few, Flown(TRUE_MS, flat=True)),
    ):
        print(case(name, count, flown, runs), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20)
    add_executor(parser)
    options = parser.parse_args()
    with runs_of(options) as runs:
        simulated(options.seeds, runs)


if __name__ == "__main__":
    main()
