"""σ of the shape of a block: what is left of σ when the block as a whole may be moved, turned and scaled."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

AXES = ("X", "Y", "Z")


@dataclass(frozen=True)
class Neighbours:
    """Differences of height between object points near one another, median of some pairs.

    Parameters
    ----------
    distance : m in plan. pairs : how many. sigma : m, total σ of the difference as the block stands.
    relative : m, the same after a similarity of the whole block.
    """

    distance: float
    pairs: int
    sigma: float
    relative: float


@dataclass(frozen=True, eq=False)
class RelativePrecision:
    """σ of the n photographs and N object points of a block after a similarity of the whole of it; all σ are total.

    Parameters
    ----------
    points : (N, 3) m, NaN where a point could not be adjusted. centres : (n, 3) m.
    position : (3,) m, σ of the shift of the block at the middle of its points. rotation : (3,) rad about the axes.
    scale : σ of the scale, 1 = 100 %. NaN of all three where nothing determines them.
    neighbours : None where no two points lie as wanted.
    """

    points: np.ndarray
    centres: np.ndarray
    position: np.ndarray
    rotation: np.ndarray
    scale: float
    neighbours: Neighbours | None = None

    @property
    def tilt(self) -> float:
        """rad, the larger of the σ of the rotations about X and Y; NaN where one is free."""
        return float(np.max(self.rotation[:2]))

    @property
    def medians(self) -> np.ndarray:
        """(3,) m, medians over the object points."""
        return medians(self.points)


def medians(sigma: np.ndarray) -> np.ndarray:
    """(k,) medians of the columns (n, k) over the rows that are known; NaN without any."""
    known = sigma[np.isfinite(sigma).all(axis=1)]
    return np.median(known, axis=0) if len(known) else np.full(sigma.shape[1], np.nan)


def precision_json(
    found: RelativePrecision | None, points: np.ndarray, centres: np.ndarray, free: bool
) -> dict[str, Any]:
    """Absolute and relative σ side by side for JSON; None for what is not known.

    Parameters
    ----------
    points (N, 3), centres (n, 3) : m, total σ as the block stands. free : whether nothing says where the block lies.
    """
    nothing = np.full((0, 3), np.nan)
    content: dict[str, Any] = {}
    for name, absolute, relative in (
        ("points", points, None if found is None else found.points),
        ("centres", centres, None if found is None else found.centres),
    ):
        content[name] = {
            "absolute_m": _by_axis(medians(nothing if free else absolute)),
            "relative_m": _by_axis(medians(nothing if relative is None else relative)),
        }
    unknown = np.full(3, np.nan)
    content["position_m"] = _by_axis(unknown if found is None else found.position)
    content["rotation_deg"] = _by_axis(unknown if found is None else np.degrees(found.rotation))
    content["scale"] = _plain(np.nan if found is None else found.scale)
    near = None if found is None else found.neighbours
    content["neighbours"] = None if near is None else {
        "distance_m": near.distance, "pairs": near.pairs, "sigma_dZ_m": _plain(near.sigma),
        "relative_sigma_dZ_m": _plain(near.relative),
    }  # fmt: skip
    return content


def _by_axis(values: np.ndarray) -> dict[str, float | None]:
    return {axis: _plain(value) for axis, value in zip(AXES, values, strict=True)}


def _plain(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
