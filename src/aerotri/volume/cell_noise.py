"""What a dense surface says of its cells: σ of their noise, how far they share it, by how many photographs measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.deformation.orientation import calibrated_orientation
from aerotri.functional_model.collinearity import INTERIOR_COLUMNS, linearise
from aerotri.results.adjustment import Adjustment
from aerotri.volume.bases import Surface
from aerotri.volume.bridges import Bridges
from aerotri.volume.functionals import Functional
from aerotri.volume.lasting import NO_LASTING, Lasting
from aerotri.volume.pickets import Pickets
from aerotri.volume.response import in_frame

AT_A_TIME = 50_000
"""Pickets whose rays are linearised at once; chosen [C]: 50 MB."""


@dataclass(frozen=True, eq=False)
class CellNoise:
    """sigma : σ of every cell from matching alone, m, on the cells of the surface; None where not known.

    length_m : side of the square whose cells have one noise; 0 where neighbours share none.
    photographs : number that measured a cell, on the cells of the surface; None where not known.
    lasting : errors that do not average out. bridges : cells bridged below objects, whose σ from matching is 0; None
    where there are none.
    """

    sigma: Surface | None = None
    length_m: float = 0.0
    photographs: Surface | None = None
    lasting: Lasting = NO_LASTING
    bridges: Bridges | None = None


NO_NOISE = CellNoise()


def cells_sharing(length_m: float, cell: float) -> float:
    """How many cells of `cell` m² have one noise, at least 1."""
    return max(1.0, length_m**2 / cell)


def photographs_at(photographs: Surface, xyz: np.ndarray) -> np.ndarray:
    """(k,) number of photographs that measured the cells at places (k, 3) m, 0 where none is known."""
    grid, out = photographs.grid, np.zeros(len(xyz), np.int64)
    for first in range(0, len(xyz), AT_A_TIME):
        some = xyz[first : first + AT_A_TIME]
        row, column = (np.rint(at).astype(int) for at in (grid.row(some[:, 1]), grid.column(some[:, 0])))
        top, left = int(row.min()), int(column.min())
        read = photographs.read(top, left, int(np.ptp(row)) + 1, int(np.ptp(column)) + 1)
        out[first : first + AT_A_TIME] = np.nan_to_num(read[row - top, column - left])
    return out


def shares_of_noise(calibration: Adjustment, pickets: Pickets, functional: Functional) -> np.ndarray:
    """(k,) noise shares with which the rays' noise gᵀN⁻¹g of every place becomes the noise that is known of its cells.

    Parameters
    ----------
    functional : at the places of the pickets; its noise is known.
    """
    if functional.noise is None:
        return functional.noise_share
    along = _noise_of_rays(calibration, pickets, functional.gradient)
    return np.where(along > 0.0, functional.noise / np.where(along > 0.0, along, 1.0), 0.0)


def _noise_of_rays(calibration: Adjustment, pickets: Pickets, gradient: np.ndarray) -> np.ndarray:
    """(k,) gᵀN⁻¹g of every picket, its orientation known."""
    points, along = in_frame(calibration, pickets.xyz, gradient)
    orientation, origin = calibrated_orientation(calibration), calibration.system.unknowns.origin
    interior = np.zeros((len(orientation), len(INTERIOR_COLUMNS)))
    interior[:, :3] = orientation.interior
    rotation = np.ascontiguousarray(orientation.rotation)
    centre = np.ascontiguousarray(orientation.centre - origin)
    out = np.empty(len(pickets))
    for first in range(0, len(pickets), AT_A_TIME):
        rows = np.arange(first, min(first + AT_A_TIME, len(pickets)))
        some = pickets.take(rows)
        point = np.repeat(np.arange(len(rows)), np.diff(some.start))
        rays = linearise(
            rotation, centre, points[rows], interior, some.image, point, some.image, np.zeros((len(point), 2))
        )
        a = rays.by_point / some.sigma_mm[:, None, None]
        normal = np.zeros((len(rows), 3, 3))
        np.add.at(normal, point, np.einsum("rai,raj->rij", a, a))
        g = along[rows]
        out[rows] = np.einsum("ki,ki->k", g, np.linalg.solve(normal, g[..., None])[..., 0])
    return out
