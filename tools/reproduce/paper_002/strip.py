"""The strip of paper 002 (ISPRS Congress Vienna 1996, vol. XXXI part B3, p. 155, table 1), simulated and adjusted.

[P] 50 photographs 1:5000, f = 152 mm, 23 cm × 23 cm, 60 % end lap, 150 m of relief, 15 pass points a photograph,
σ of image coordinates 5 µm, of control 0.1 m, of projection centres 0.25–1.0 m, a tower of 15 m for each photograph.
[C] What it does not say: the flight wanders by 5 m and tilts by 1°; towers stand upright within 1 cm; the pass points
lie in three columns of five; the two control points stand at opposite corners of the strip; full control is a pair
left and right every two bases.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import aerotri

PHOTOGRAPHS = 50
FOCAL_LENGTH_MM, SCALE = 152.0, 5000.0
ABOVE_GROUND_M = FOCAL_LENGTH_MM * 1e-3 * SCALE
"""760 m: what the scale and the focal length of the paper make; see `table.EXPLANATION` for its 900 m."""
GROUND_M = 140.0
RELIEF_RMS_M = 37.0
"""± 2 σ are the 150 m of the paper."""

Positions = tuple[tuple[float, float], ...]
TWO_POINTS: Positions = ((0.0, 0.1), (1.0, 0.9))


@dataclass(frozen=True)
class Case:
    """One adjustment of the strip.

    Parameters
    ----------
    method : of the paper, '1' to '3', or '' for a case of ours. name : in words.
    gnss_m : σ of observed projection centres, None without. towers : with plumb lines.
    control : positions along and across the strip, 0 to 1. heights_every : bases between control points with a height,
        None where all have one. above_ground_m : flying height. wander_m : σ of the flight about its straight line.
    exact : observations without errors, so that σ are those at the true geometry.
    """

    method: str
    name: str
    gnss_m: float | None = None
    towers: bool = False
    control: Positions = ()
    heights_every: int | None = None
    above_ground_m: float = ABOVE_GROUND_M
    wander_m: float = 5.0
    exact: bool = False


@dataclass(frozen=True, eq=False)
class Precision:
    """Precision of the pass points of a case over several simulations.

    Parameters
    ----------
    theoretical : (3,) m, μ = √(mean variance of a coordinate), over all points and simulations.
    practical : (3,) m, RMS of adjusted minus true coordinates. spread : (3,) m, of the RMS of single simulations.
    roll_deg : mean over the simulations of the median σ of the roll of a photograph.
    z_roll, z_point : (runs,) and (runs, 3), errors of the roll and a pass point in the middle over their σ.
    failure : why there is no result, '' where there is one.
    """

    theoretical: np.ndarray
    practical: np.ndarray
    spread: np.ndarray
    roll_deg: float
    z_roll: np.ndarray
    z_point: np.ndarray
    failure: str = ""


def pairs_every(bases: int, photographs: int = PHOTOGRAPHS, across: float = 0.4) -> Positions:
    """Control left and right of the axis every so many bases, and at the end.

    Parameters
    ----------
    across : distance from the axis over the width of the strip of control (805 m).
    """
    last = photographs - 1
    along = sorted({*range(0, last, bases), last})
    return tuple((a / last, 0.5 + side * across) for a in along for side in (-1, 1))


def strip_plan(case: Case, photographs: int = PHOTOGRAPHS) -> dict:
    """The flight plan of a case, flown from west to east: roll is ω."""
    tables = {
        "name": "paper_002",
        "camera": {
            "rmk": {
                "model": "frame",
                "size_px": [18400, 18400],
                "pixel_um": 12.5,
                "focal_length_mm": FOCAL_LENGTH_MM,
                "flight_axis": "+x",
            }
        },
        "flight": {
            "height_m": case.above_ground_m,
            "strips": 1,
            "images_per_strip": photographs,
            "end_lap": 0.6,
            "heading_deg": 90.0,
            "attitude_sigma_deg": [1.0, 1.0, 1.0],
            "position_sigma_m": [case.wander_m] * 3,
        },
        "terrain": {
            "kind": "undulating",
            "height_m": GROUND_M,
            "relief_rms_m": RELIEF_RMS_M,
            "wavelength_m": 2000.0,
        },
        "tie_points": {
            "per_image": 15,
            "distribution": "nodes",
            "pattern": [1, 5],
            "cluster_sigma": 0.03,
            "sigma_um": 5.0,
        },
        "control": {"positions": case.control, "sigma_m": [0.1, 0.1, 0.1]},
        "start_values": {"kind": "perturbed", "position_sigma_m": 1.0, "angle_sigma_deg": 0.05},
    }
    if case.gnss_m is not None:
        tables["gnss"] = {"sigma_m": [case.gnss_m] * 3}
    if case.towers:
        tables["towers"] = {"height_m": 15.0, "sigma_m": 0.01}
    return tables


def with_fewer_heights(block: aerotri.Block, case: Case, photographs: int) -> aerotri.Block:
    """The block with the heights of its control left out but for the first and last and every so many bases between."""
    if case.heights_every is None:
        return block
    # control points are numbered in the order of their positions
    number = np.array([int(str(name)[1:]) - 1 for name in block.points[block.control.point]])
    base = np.round(np.array(case.control)[number, 0] * (photographs - 1)).astype(int)
    without = (base % case.heights_every != 0) & (base != photographs - 1)
    xyz, sigma = block.control.xyz.copy(), block.control.sigma.copy()
    xyz[without, 2] = sigma[without, 2] = np.nan
    return replace(block, control=replace(block.control, xyz=xyz, sigma=sigma))


def without_errors(block: aerotri.Block, centre: np.ndarray, plan: dict) -> aerotri.Block:
    """The block with true projection centres and true image coordinates in place of the observed ones."""
    exact = plan["tie_points"] | {"sigma_um": 0.0, "stated_sigma_um": plan["tie_points"]["sigma_um"]}
    clean = aerotri.simulate(plan | {"tie_points": exact}, 1).block
    gnss = block.gnss_ins
    if gnss is not None:
        gnss = replace(gnss, xyz=centre[gnss.image])
    return replace(block, image_points=clean.image_points, gnss_ins=gnss)


@dataclass(frozen=True, eq=False)
class _Run:
    """One simulation: mean variances and squared errors (3,) m², σ of the roll in degrees, errors over their σ."""

    variance: np.ndarray
    square: np.ndarray
    roll_deg: float
    z_roll: float
    z_point: np.ndarray


def run(case: Case, seeds: Iterable[int], computed: Any, photographs: int = PHOTOGRAPHS) -> Precision:
    """Simulate and adjust a case, where `computed` computes runs; theoretical and practical precision of its pass
    points."""
    found = computed(_run_or_failure, (case, photographs), (1,) if case.exact else seeds)
    failures = [one for one in found if isinstance(one, str)]
    if failures:
        nothing = np.full(3, np.nan)
        return Precision(nothing, nothing, nothing, np.nan, np.zeros(0), np.zeros((0, 3)), failures[0])
    runs: list[_Run] = found
    squares = np.array([one.square for one in runs])
    return Precision(
        theoretical=np.sqrt(np.mean([one.variance for one in runs], axis=0)),
        practical=np.full(3, np.nan) if case.exact else np.sqrt(squares.mean(axis=0)),
        spread=np.std(np.sqrt(squares), axis=0),
        roll_deg=float(np.mean([one.roll_deg for one in runs])),
        z_roll=np.array([one.z_roll for one in runs]),
        z_point=np.array([one.z_point for one in runs]),
    )


def _run_or_failure(shared: tuple[Case, int], seed: int) -> _Run | str:
    """One simulation, or why there is no result."""
    case, photographs = shared
    try:
        return _run(case, seed, photographs)
    except aerotri.AdjustmentFailedError as failure:
        return str(failure)


def _run(case: Case, seed: int, photographs: int) -> _Run:
    plan = strip_plan(case, photographs)
    flight = aerotri.simulate(plan, seed)
    truth, block = flight.truth, with_fewer_heights(flight.block, case, photographs)
    observed = without_errors(block, truth.centre, plan) if case.exact else block
    result = aerotri.adjust(observed, explain=False).adjusted
    # where there are no errors σ̂0 says nothing, and the σ are those of the weights
    scale = result.outcome.sigma0 if case.exact else 1.0
    image_sigma, point_sigma = result.images.sigma / scale, result.points.sigma / scale
    is_pass = np.char.startswith(block.points.astype(str), "T") & np.isfinite(result.points.xyz[:, 0])
    passes = np.flatnonzero(is_pass)
    error = result.points.xyz - truth.points
    middle, point = photographs // 2, passes[len(passes) // 2]
    return _Run(
        variance=np.mean(point_sigma[passes] ** 2, axis=0),
        square=np.mean(error[passes] ** 2, axis=0),
        roll_deg=float(np.degrees(np.median(image_sigma[:, 3]))),
        z_roll=float((result.images.angles - truth.angles)[middle, 0] / image_sigma[middle, 3]),
        z_point=error[point] / point_sigma[point],
    )
