"""A pilot: dense pickets on a part of the area, and what they say of wider intervals."""

from __future__ import annotations

import numpy as np

from aerotri.terrain.interval import Pilot, chosen_interval, interval_of_gsd, k_of_slope
from aerotri.terrain.photographs import Photographs
from aerotri.terrain.picket_status import PicketStatus
from aerotri.terrain.pickets import Pickets, footprint
from aerotri.terrain.surface import errors_by_interval

FACTORS = (2, 3, 4, 6, 8)
"""Wider intervals that are tried, over that of the pilot."""
PILOT_SHARE, FEWEST_PX = 0.25, 10.0
"""Interval of the pilot over that of the formula, but not below so many pixels."""
MIDDLE = 0.5
"""Part of the footprint's sides that a pilot takes where no area is stated."""


def dense_interval(gsd: float, slope: float) -> float:
    """m between the pickets of a pilot.

    Parameters
    ----------
    gsd : m. slope : typical one of the ground.
    """
    return max(PILOT_SHARE * interval_of_gsd(gsd, k_of_slope(slope)[0]), FEWEST_PX * gsd)


def middle_area(photographs: Photographs) -> tuple[float, float, float, float]:
    """m, X and Y of the lower left and of the upper right corner of the middle of what the photographs show."""
    whole = footprint(photographs)
    middle, half = 0.5 * (whole.low + whole.high), 0.5 * MIDDLE * (whole.high - whole.low)
    low, high = middle - half, middle + half
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def pilot_of(pickets: Pickets, interval: float, tolerance: float | None) -> Pilot:
    """What pickets on a dense grid say of wider ones.

    The surface between wide pickets is judged by the dense ones. Without a tolerance the interval is chosen at which it
    is as wrong as a picket itself: closer pickets then show noise, wider ones lose terrain [C].

    Parameters
    ----------
    interval : m, of the dense pickets. tolerance : m, allowed RMSE between pickets; None: σ of a picket.
    """
    own = pickets.accepted
    variance = pickets.covariance[own, 2, 2]
    rmse = errors_by_interval(pickets.xyz[own], pickets.node[own], interval, FACTORS, variance)
    number = np.round(pickets.node / interval).astype(np.int64)
    kept = [(number % factor == 0).all(axis=1) for factor in FACTORS]
    noise = float(np.sqrt(np.median(variance)))
    widths = interval * np.array(FACTORS)
    return Pilot(
        interval=widths, rmse=rmse, pickets=np.array([int((own & part).sum()) for part in kept]),
        errors=np.array([int((pickets.errors & part).sum()) for part in kept]), noise=noise,
        area_m2=float((pickets.status != PicketStatus.NOT_SEEN).sum() * interval**2),
        chosen=chosen_interval(widths, rmse, noise if tolerance is None else tolerance),
    )  # fmt: skip
