"""Pickets: heights measured on a grid by matching (see `matching`), and how they are to be measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.memory import fitting, refuse_beyond_memory
from aerotri.terrain.photographs import Photographs
from aerotri.terrain.picket_status import PicketStatus

BYTES_OF_PICKET = 1500
"""Its row of `Pickets`, and its share of tiles, triangles and trees at their peak."""


@dataclass(frozen=True)
class MatchOptions:
    """How pickets are measured.

    Parameters
    ----------
    interval : m between pickets.
    window_px : posts a side of a window, odd. threshold : correlation from which two photographs count.
    agreeing : correlation from which three and more count whose rays meet; 1: only those that reach the threshold.
    edge : share of the format at its edge that is not used.
    most_photographs : that take part in a picket, the most upright ones.
    largest_sigma_px : of a parallax, from the texture of the window.
    search_px : posts searched along the rays when matching backwards. distinct : share of the best correlation that
        no other place there may reach.
    aside_px, most_aside : steps aside, posts, and how many.
    """

    interval: float
    window_px: int = 17
    threshold: float = 0.90
    agreeing: float = 0.50
    edge: float = 0.10
    most_photographs: int = 5
    largest_sigma_px: float = 0.3
    search_px: float = 16.0
    distinct: float = 0.9
    aside_px: float = 8.0
    most_aside: int = 24


@dataclass(frozen=True, eq=False)
class Area:
    """Rectangle (2,) … (2,) m in the CRS."""

    low: np.ndarray
    high: np.ndarray


@dataclass(frozen=True, eq=False)
class Models:
    """Pairs of photographs that are the only ones to be matched.

    Parameters
    ----------
    pairs : (k, 2) into the photographs. middles : (k, 2) m, middles of their bases in the CRS.
    """

    pairs: np.ndarray
    middles: np.ndarray


@dataclass(frozen=True, eq=False)
class Pickets:
    """What became of n nodes.

    Parameters
    ----------
    node : (n, 2) m, planned. xyz : (n, 3) in the CRS, NaN where nothing was measured.
    covariance : (n, 3, 3) m², of matching: σ̂0² of the rays of all pickets is in it.
    status : (n,) number of a `PicketStatus`. tries : (n,) steps aside.
    photographs : (n, m) into `names`, −1 where there are fewer; the first is the reference.
    correlation : (n,) lowest of the rays, or the best there was.
    model : (n,) number of the model, −1 where photographs were chosen freely.
    misfit : (n,) y-parallax of the first two photographs over the σ that texture and grey values let expect.
    names : of the photographs. sigma0 : of the rays over the same σ.
    """

    node: np.ndarray
    xyz: np.ndarray
    covariance: np.ndarray
    status: np.ndarray
    tries: np.ndarray
    photographs: np.ndarray
    correlation: np.ndarray
    model: np.ndarray
    misfit: np.ndarray
    names: np.ndarray
    sigma0: float

    def __len__(self) -> int:
        return len(self.node)

    @property
    def accepted(self) -> np.ndarray:
        """(n,) bool."""
        return self.status == PicketStatus.ACCEPTED

    @property
    def errors(self) -> np.ndarray:
        """(n,) bool, measured and found to be in error."""
        return self.status >= PicketStatus.BACKWARD

    @property
    def sigma(self) -> np.ndarray:
        """(n, 3) m, of matching."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))


def grid_nodes(area: Area, interval: float) -> np.ndarray:
    """(n, 2) whole multiples of the interval in an area, row by row: two sets of photographs get the same nodes.

    Raises
    ------
    InputError
        When they do not fit into memory.
    """
    size = area.high - area.low
    count = float((size / interval + 1.0).prod())
    least = float(np.sqrt(size.prod() / fitting(BYTES_OF_PICKET)))
    refuse_beyond_memory(
        BYTES_OF_PICKET * count, f"{count:.3g} pickets every {interval:g} m",
        f"give an --interval of at least {least:.2g} m, or a smaller --area",
    )  # fmt: skip
    x, y = (
        interval * np.arange(np.ceil(low / interval - 1e-9), np.floor(high / interval + 1e-9) + 1)
        for low, high in zip(area.low, area.high, strict=True)
    )
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def footprint(photographs: Photographs) -> Area:
    """What the photographs show at the mean height of the ground."""
    half = photographs.sensor[:, :2] / photographs.sensor[:, 2:]
    corners = []
    for sx, sy in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
        c, x0, y0 = photographs.orientation.interior.T
        ray = np.column_stack([sx * half[:, 0] - x0, sy * half[:, 1] - y0, -c])
        ray = np.einsum("nij,nj->ni", photographs.orientation.rotation, ray)
        down = np.where(ray[:, 2] < 0.0, ray[:, 2], np.nan)
        height = photographs.centres[:, 2] - photographs.ground
        reach = np.clip(np.abs(height / down), 0.0, 5.0 * height / c)
        corners.append(photographs.centres[:, :2] + ray[:, :2] * reach[:, None])
    all_corners = np.concatenate(corners)
    all_corners = all_corners[np.isfinite(all_corners).all(axis=1)]
    return Area(all_corners.min(axis=0), all_corners.max(axis=0))
