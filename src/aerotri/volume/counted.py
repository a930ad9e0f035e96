"""Which places inside a boundary count: where a surface and its base are known, and above or below the base alone."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr

from aerotri.rasters.grids import Grid
from aerotri.volume.bases import Base, Surface
from aerotri.volume.rectified import BEYOND
from aerotri.volume.roughness import PARTS, RULES, places_within
from aerotri.volume.triangles import Pieces

PLACES = places_within(PARTS, RULES[0])
"""(q, 3) places within a triangle, at which its share is taken."""


@dataclass(frozen=True, eq=False)
class Counted:
    """A place counts where all is known, and of a cut or a fill with the probability that it lies on that side.

    Parameters
    ----------
    other : what the heights are compared with. sign : 1 what lies above it, −1 what lies below, 0 both.
    spread : m, σ of the height over it that all places have in common.
    known : where it has no height, nothing counts; None: known everywhere.
    band : m, beside the line: places within it count alone, by exp(−½·(h/band)²); 0: all.
    noise : m², variance of a height of the other at a place that is its own alone.
    apart : 0 … 1, how far points lie from those of the other; see `shared.places_apart`.
    """

    other: Base
    sign: int = 0
    spread: float = 0.0
    known: Surface | None = None
    band: float = 0.0
    noise: float = 0.0
    apart: float = 1.0

    def on_side(self, sign: int, spread: float) -> Counted:
        """What of it lies on one side."""
        return replace(self, sign=sign, spread=spread)

    def heights(self, x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        """(n,) m over the other, NaN where something is not known."""
        d = z - self.other.heights(x, y)
        return d if self.known is None else np.where(np.isfinite(self.known.sample(x, y)), d, np.nan)

    def at(self, weights: np.ndarray, corners: np.ndarray) -> np.ndarray:
        """Heights over the other at places of triangles: weights (n, …, 3) of their corners (n, 3, 3) m."""
        places = np.einsum("n...k,nkc->n...c", weights, corners)
        return self.heights(*places.reshape(-1, 3).T).reshape(places.shape[:-1])

    def heights_of_cells(self, z: np.ndarray, grid: Grid) -> np.ndarray:
        """(rows, columns) m over the other, NaN where something is not known."""
        return z - self.other.on_grid(grid)

    def spread_of_cells(self, sigma: np.ndarray | None) -> np.ndarray | float:
        """m, σ of the heights of cells over the other: what they share, and their own noise (rows, columns)."""
        return self.spread if sigma is None else np.hypot(self.spread, np.nan_to_num(sigma))

    def share(self, d: np.ndarray, spread: np.ndarray | float) -> np.ndarray:
        """0 … 1 of places with heights over the other, 0 where one is not known; spread : m, σ of the heights."""
        if self.sign == 0:
            near = np.exp(-0.5 * np.square(np.nan_to_num(d) / self.band)) if self.band > 0.0 else 1.0
            return np.isfinite(d) * near
        above = self.sign * np.where(np.isfinite(d), d, 0.0)
        wide = np.maximum(spread, 1e-300)
        return np.where(np.isfinite(d), ndtr(np.clip(above / wide, -40.0, 40.0)), 0.0)


def counted_pieces(xyz: np.ndarray, triangles: np.ndarray, pieces: Pieces, counted: Counted | None) -> Pieces:
    """Parts of triangles with the area and the mean place of what of them counts; those without any are left out.

    Of a part that the boundary cuts the share is that of its whole triangle.

    Parameters
    ----------
    xyz : (k, 3) m. triangles : (t, 3).
    """
    if counted is None:
        return pieces
    corners = xyz[triangles[pieces.triangle]]
    share, weights = counted.share(counted.at(pieces.weights, corners), counted.spread), pieces.weights.copy()
    near = np.flatnonzero(near_the_line(counted, corners, counted.spread))
    if counted.sign and len(near):
        each = counted.share(counted.at(np.broadcast_to(PLACES, (len(near), *PLACES.shape)), corners[near]),
                             counted.spread)  # fmt: skip
        share[near] = each.mean(axis=1)
        inside = pieces.whole[near] & (share[near] > 0.0)
        weights[near[inside]] = (each[inside] @ PLACES) / each[inside].sum(axis=1, keepdims=True)
    used = share > 0.0
    return Pieces(
        pieces.triangle[used], (pieces.area * share)[used], weights[used], pieces.whole[used], pieces.geometry[used]
    )


def near_the_line(counted: Counted, corners: np.ndarray, wide: np.ndarray | float) -> np.ndarray:
    """(n,) bool, whether triangles with corners (n, 3, 3) m may be cut by what they are compared with.

    Parameters
    ----------
    wide : m, (n,) or of all, σ of the heights; within `BEYOND` of it a triangle may be on either side.
    """
    d = counted.at(np.broadcast_to(np.eye(3), (len(corners), 3, 3)), corners)
    reach = BEYOND * np.asarray(wide)
    return np.isfinite(d).all(axis=1) & (d.min(axis=1) <= reach) & (d.max(axis=1) >= -reach)
