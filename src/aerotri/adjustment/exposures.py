"""When photographs were taken, as far as errors of positions hang on it: flights, and time or order within them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from aerotri.adjustment.track import exposure_times, order_of_exposure, strips_of_track
from aerotri.observations import Block

FLIGHT_COLUMNS = ("flight", "session", "day", "date")
"""Grouping columns of images.csv that name a flight; the first that is there is used."""
SECONDS, EXPOSURES = "s", "exposures"


@dataclass(frozen=True, eq=False)
class Exposures:
    """Flight and time of g exposures.

    Parameters
    ----------
    flight : (g,) number of the flight; errors of different flights have nothing to do with one another.
    time : (g,) in `unit`: seconds, or exposures counted along the strip where times are not known.
    """

    flight: np.ndarray
    time: np.ndarray
    unit: str

    def __len__(self) -> int:
        return len(self.time)

    @property
    def order(self) -> np.ndarray:
        """(g,) rows by flight and time."""
        return np.lexsort((self.time, self.flight))

    @property
    def usual_step(self) -> float:
        """Median time from one exposure of a flight to the next."""
        steps = self._steps()
        return float(np.median(steps)) if len(steps) else 1.0

    @property
    def longest_flight(self) -> float:
        """Time from the first to the last exposure of the longest flight."""
        flights = np.unique(self.flight)
        return max((float(np.ptp(self.time[self.flight == flight])) for flight in flights), default=0.0)

    def correlation(self, time: float) -> np.ndarray:
        """(g, g) exp(−|t_i − t_j|/τ) within a flight, 0 between flights."""
        apart = np.abs(self.time[:, None] - self.time) / time
        return np.where(self.flight[:, None] == self.flight, np.exp(-apart), 0.0)

    def taken(self, rows: np.ndarray) -> Exposures:
        """Some of the exposures."""
        return Exposures(self.flight[rows], self.time[rows], self.unit)

    def _steps(self) -> np.ndarray:
        order = self.order
        steps = np.diff(self.time[order])
        return steps[(np.diff(self.flight[order]) == 0) & (steps > 0.0)]


def exposures_of(block: Block, images: np.ndarray, centre: np.ndarray) -> Exposures:
    """Flight and time of photographs.

    With the times of all, a flight is what a grouping column of images.csv names so; without such a column the block
    is one flight, unless strips overlap in time: then their clocks are not the same one, and each is a flight. Without
    times every strip is a flight, its exposures counted along it.

    Parameters
    ----------
    images : (g,) rows of the block. centre : (g, 3) m.
    """
    time = exposure_times(block)[images]
    column = next((name for name in FLIGHT_COLUMNS if name in block.images.columns), None)
    named = np.asarray(block.images.columns[column], dtype=object)[images] if column else np.full(len(images), "")
    flight = np.unique(named.astype(str), return_inverse=True)[1].astype(np.int64)
    if len(time) and np.isfinite(time).all():
        strips = np.asarray(block.images.strip, dtype=object)[images].astype(str)
        if column is None and all(strips.tolist()) and _overlap(time, strips):
            flight = np.unique(strips, return_inverse=True)[1].astype(np.int64)
        return Exposures(flight, time, SECONDS)
    return _counted(block, images, centre, flight)


def _overlap(time: np.ndarray, strips: np.ndarray) -> bool:
    """Whether a strip begins before the one before it has ended."""
    spans = sorted((time[strips == strip].min(), time[strips == strip].max()) for strip in np.unique(strips))
    return any(begin < end for (_, end), (begin, _) in pairwise(spans))


def _counted(block: Block, images: np.ndarray, centre: np.ndarray, flight: np.ndarray) -> Exposures:
    """Exposures counted along their strips."""
    strips = np.asarray(block.images.strip, dtype=object)[images].astype(str)
    known = strips if all(strips.tolist()) else np.full(len(images), "")
    order = order_of_exposure(centre, known, block.images.names[images], np.full(len(images), np.nan))
    strip, number = np.empty(len(images), dtype=np.int64), np.empty(len(images))
    strip[order] = strips_of_track(centre[order], known[order])
    for one in np.unique(strip):
        own = order[strip[order] == one]
        number[own] = np.arange(len(own))
    both = np.unique(np.stack([flight, strip], axis=1), axis=0, return_inverse=True)[1]
    return Exposures(both.reshape(-1).astype(np.int64), number, EXPOSURES)
