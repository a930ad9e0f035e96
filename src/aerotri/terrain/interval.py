"""The interval between pickets: Tran's formula, Ackermann's rule, and what a pilot on a part of the area says.

[P] PSI = k·√(P·Ma), P the scan resolution in µm, Ma the denominator of the photo scale, k 0.08–0.09 in mountains and
0.095–0.105 in plains (Tran 2007, equation 7; the root was lost in the printed text: the literal product would be
hundreds of kilometres). As P·Ma·10⁻⁶ is the GSD, PSI = 1000·k·√GSD, GSD in m. The older rule is 30·P·Ma = 30·GSD.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

K_MOUNTAINS, K_PLAIN = (0.08, 0.09), (0.095, 0.105)
"""Lowest and highest k of the interval k·√(P·Ma), P in µm, the interval in m: those Tran (2007, paper 004) gives for
mountains and for plains."""
FEWEST_NODES = 50_000
"""Nodes an area has at least where all photographs measure its surface, unless the older rule asks for fewer [C]."""
ROUGH_SLOPE = 0.15
"""Slope of the ground from which on `k_of_slope` takes it for mountains [C]."""


def interval_by_formula(scan_um: float, scale: float, k: float) -> float:
    """m, k·√(P·Ma)."""
    return k * float(np.sqrt(scan_um * scale))


def interval_of_gsd(gsd_m: float, k: float) -> float:
    """m, the same from the size of a pixel on the ground."""
    return interval_by_formula(1e6 * gsd_m, 1.0, k)


def interval_by_rule(gsd_m: float) -> float:
    """m, 30·GSD, the rule that the formula replaces."""
    return 30.0 * gsd_m


def interval_of_surface(gsd_m: float, k: float, area_m2: float) -> tuple[float, str]:
    """m, and what it comes from: the formula, or less where that leaves small ground few pickets [C].

    The formula is one of aerial photographs: at a GSD of 2 cm it asks for 14 m, the whole of what a drone shows in one
    photograph being 50 m wide. There the interval is the older rule's, or what gives `FEWEST_NODES`.
    """
    by_formula = interval_of_gsd(gsd_m, k)
    closer = max(interval_by_rule(gsd_m), float(np.sqrt(area_m2 / FEWEST_NODES)))
    if closer < by_formula:
        by_rule = closer == interval_by_rule(gsd_m)
        return closer, "30 times the GSD" if by_rule else f"{FEWEST_NODES} places in the area"
    return by_formula, f"{1000 * k:g} · √GSD"


def k_of_slope(slope: float) -> tuple[float, str]:
    """The middle of Tran's k for ground of a typical slope, and what it is called."""
    name, (low, high) = ("mountains", K_MOUNTAINS) if slope > ROUGH_SLOPE else ("plain", K_PLAIN)
    return 0.5 * (low + high), name


def expected_error_pickets(share: float, area_m2: float, interval_m: np.ndarray | float) -> np.ndarray | float:
    """e = p·S/PSI², p the share of error pickets (Tran 2007, equation 6)."""
    return share * area_m2 / np.square(interval_m)


@dataclass(frozen=True, eq=False)
class Pilot:
    """What pickets at several intervals say of a part of the area.

    Parameters
    ----------
    interval : (k,) m. rmse : (k,) m, error of the surface between them, noise of pickets taken off; NaN where too few.
    pickets, errors : (k,) numbers. noise : m, σ of a picket. area_m2 : of the part.
    chosen : m, the interval at which the surface between pickets is as wrong as the pickets are, or as the tolerance.
    """

    interval: np.ndarray
    rmse: np.ndarray
    pickets: np.ndarray
    errors: np.ndarray
    noise: float
    area_m2: float
    chosen: float


def chosen_interval(interval: Sequence[float] | np.ndarray, rmse: np.ndarray, tolerance: float) -> float:
    """The interval at which the error reaches a tolerance, by interpolation of their logarithms; the ends beyond."""
    interval = np.asarray(interval, dtype=float)
    known = np.isfinite(rmse) & (rmse > 0.0)
    if not known.any():
        return float(interval[-1])
    x, y = np.log(interval[known]), np.maximum.accumulate(np.log(rmse[known]))
    target = np.log(tolerance)
    if target <= y[0] and len(x) > 1 and y[1] > y[0]:
        return float(np.exp(x[0] + (target - y[0]) * (x[1] - x[0]) / (y[1] - y[0])))
    return float(np.exp(np.interp(target, y, x)))
