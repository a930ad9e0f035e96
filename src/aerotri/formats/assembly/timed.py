"""Positions of an antenna over time, and the times of photographs: what PPK and RTK leave beside the photographs.

Times are GPS seconds since 1980-01-06, positions longitude, latitude (degrees) and height (m), σ east, north, up (m).
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

FIXED, PPP, FLOAT, DIFFERENTIAL, SINGLE, NONE = "fixed", "PPP", "float", "differential", "single point", "no solution"
"""Kinds of a GNSS solution, the best first."""
RANK = {kind: rank for rank, kind in enumerate((FIXED, PPP, FLOAT, DIFFERENTIAL, SINGLE, NONE))}
LEAST_SIGMA_M = {SINGLE: (1.5, 1.5, 3.0), DIFFERENTIAL: (0.3, 0.3, 0.6)}
"""σ east, north, up of solutions of code alone, at least [C]: drones state centimetres for them, which is the noise
after filtering. Code alone has metres, more in height than in plan; corrections of code leave decimetres."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Where an antenna was, n epochs in the order of time.

    Parameters
    ----------
    path : the file.
    time : (n,) GPS seconds, rising; `week_known`: else they are those of a week that nothing names.
    place : (n, 3) longitude, latitude, degrees, and height, m; sigma : (n, 3) m, NaN where not given.
    quality : (n,) str, the kind of solution, '' where not given.
    heights : 'ellipsoidal' or 'sea level'. datum : as the file names it.
    messages : what the user should know.
    """

    path: Path
    time: np.ndarray
    place: np.ndarray
    sigma: np.ndarray
    quality: np.ndarray
    heights: str = "ellipsoidal"
    datum: str = "WGS 84"
    week_known: bool = True
    messages: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.time)

    def at(self, rows: np.ndarray) -> Trajectory:
        """Some of the epochs."""
        return replace(
            self,
            time=self.time[rows],
            place=self.place[rows],
            sigma=self.sigma[rows],
            quality=self.quality[rows],
        )


@dataclass(frozen=True, eq=False)
class TimeStamps:
    """When photographs were taken, n of them, in the order of the file.

    Parameters
    ----------
    path : the file. number : (n,) of the photographs, −1 where the file has none.
    time : (n,) GPS seconds.
    offset : (n, 3) m east, north, up, from the antenna to the camera at that time.
    place, sigma, quality : of the antenna by the drone's own solution, as in `Trajectory`; NaN and '' where unknown.
    heights : 'ellipsoidal' or 'sea level'.
    messages : what the user should know.
    """

    path: Path
    number: np.ndarray
    time: np.ndarray
    offset: np.ndarray
    place: np.ndarray
    sigma: np.ndarray
    quality: np.ndarray
    heights: str = "ellipsoidal"
    messages: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.time)


def _rank(kind: str) -> int:
    return RANK.get(kind, len(RANK))


def in_words(quality: np.ndarray) -> str:
    """'281 fixed, 3 float', the best first."""
    counts: Counter[str] = Counter(quality.tolist())
    kinds: list[str] = sorted(counts, key=_rank)
    return ", ".join(f"{counts[kind]} {kind or 'of unknown quality'}" for kind in kinds)


def true_sigma(sigma: np.ndarray, quality: np.ndarray) -> np.ndarray:
    """(n, 3) σ east, north, up, at least those that a solution of its kind has; NaN stays NaN."""
    found = sigma.copy()
    for kind, least in LEAST_SIGMA_M.items():
        found[quality == kind] = np.maximum(found[quality == kind], least)
    return found
