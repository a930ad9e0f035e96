"""Photographs about a place, in metres of the block's own frame, and the way from there to the CRS.

Rays and bases are straight in the local frame alone; the CRS bends and stretches it. About a place that is one
rotation and a bent surface of a few centimetres, which a quadratic form follows to a fraction of a millimetre.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.deformation.orientation import photo_rows
from aerotri.terrain._view_kernels import View
from aerotri.terrain.dense import _projection_kernels as kernels
from aerotri.terrain.photographs import Photographs


@dataclass(frozen=True, eq=False)
class Place:
    """Photographs in coordinates q, m, from a place on, parallel to the frame of the orientations.

    Parameters
    ----------
    centres : (n, 3) m in q. view : what kernels project with; it holds no pixels.
    origin : (3,) the place in the CRS. to_crs : (3, 10) coefficients of 1, x, y, z, x², y², z², xy, xz, yz, in units of
        `reach`, that lead from q to the CRS less its origin. reach : m.
    """

    photographs: Photographs
    centres: np.ndarray
    view: View
    local: np.ndarray
    origin: np.ndarray
    to_crs: np.ndarray
    reach: float

    def project(self, k: int, places: np.ndarray) -> np.ndarray:
        """(n, 2) column and row, px of the photograph, of places (n, 3) in q."""
        out = np.empty((len(places), 2))
        kernels.photo_places(self.view, k, np.ascontiguousarray(places), out)
        return out

    def seen(self, k: int, places: np.ndarray) -> np.ndarray:
        """(n,) whether places (n, 3) in q lie in the usable part of a photograph."""
        out = np.empty(len(places), np.bool_)
        kernels.seen_places(self.view, k, np.ascontiguousarray(places), out)
        return out

    def from_crs(self, xyz: np.ndarray) -> np.ndarray:
        """(n, 3) m in q of places in the CRS."""
        return self.photographs.places.to_local(xyz) - self.local


def place_at(photographs: Photographs, xyz: np.ndarray, reach: float, edge: float) -> Place:
    """The photographs about a place of the CRS.

    Parameters
    ----------
    reach : m, as far as the way to the CRS has to hold. edge : share of the format at its edge not used.
    """
    p = photographs
    local = p.places.to_local(xyz[None])[0]
    photos = np.ascontiguousarray(photo_rows(p.orientation, local, np.eye(3))[None])
    centres = np.ascontiguousarray(p.orientation.centre - local)
    crops, pixels = np.zeros((len(p), 5), np.int64), np.zeros(1, np.uint16)
    view = View(photos, p.source, p.tables.for_kernels, p.sensor, centres, crops, pixels, 1.0, edge)
    return Place(p, centres, view, local, xyz, _way_to_crs(photographs, xyz, local, reach), reach)


def _way_to_crs(p: Photographs, xyz: np.ndarray, local: np.ndarray, reach: float) -> np.ndarray:
    """(3, 10) by least squares over a cube of ± reach."""
    if p.places.frame is None:
        out = np.zeros((3, 10))
        out[:, 1:4] = np.eye(3) * reach
        return out
    steps = np.linspace(-1.0, 1.0, 3)
    t = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
    values = p.places.from_local(local + reach * t) - xyz
    return np.linalg.lstsq(quadratic_terms(t), values, rcond=None)[0].T


def quadratic_terms(t: np.ndarray) -> np.ndarray:
    """(n, 10) 1, x, y, z, x², y², z², xy, xz, yz."""
    x, y, z = t.T
    return np.stack([np.ones(len(t)), x, y, z, x * x, y * y, z * z, x * y, x * z, y * z], axis=1)
