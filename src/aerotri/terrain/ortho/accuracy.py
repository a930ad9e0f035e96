"""How exactly a detail lies in an orthophoto: standard deviations of the plan position, cell by coarse cell.

[D] A cell at (X, Y, Z) shows what a ray through it meets. An error dZ of the surface moves that by (tan ν)·dZ away from
the foot of the projection centre, ν the angle of the ray off the vertical. Errors of orientation, camera and additional
parameters x move it by dP = −G·(∂π/∂x)·dx, G the inverse of the partials of the image position by X and Y. An error of
the measured image position, in which the detail is pointed at, moves it by G·σ. The three count as independent: of a
surface measured with the same orientation the height and the plan position have common errors, which cancel in part.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.rasters.grids import RasterReader
from aerotri.results.adjustment import Adjustment
from aerotri.terrain.adjustment_part import plan_variances
from aerotri.terrain.ortho.candidates import Candidates
from aerotri.terrain.ortho.seams import Choice
from aerotri.terrain.photographs import Photographs

PLACES = 400
"""Coarse cells in which the part of the adjustment is computed, the others interpolated; chosen [C]: it changes slowly
within a block."""


@dataclass(frozen=True, eq=False)
class PlanAccuracy:
    """σ of X and Y, root mean square of both, of coarse cells (r, c) m; NaN where there is no photograph.

    Parameters
    ----------
    surface : part of the surface; None: its σ is not known. orientation, image : the other parts. total : all of them.
    tangent : tan ν.
    """

    surface: np.ndarray | None
    orientation: np.ndarray
    image: np.ndarray
    total: np.ndarray
    tangent: np.ndarray


def plan_accuracy(
    calibration: Adjustment, photographs: Photographs, candidates: Candidates, choice: Choice,
    sigma: RasterReader | None,
) -> PlanAccuracy:  # fmt: skip
    """The accuracy of an orthophoto.

    Parameters
    ----------
    sigma : σ of the heights of the surface, None where it has none.
    """
    grid, used = candidates.grid, choice.number >= 0
    i, j = np.nonzero(used)
    xyz = np.column_stack([grid.x(j), grid.y(i), candidates.z[i, j]])
    number = choice.number[i, j]
    ray = xyz - photographs.centres[number]
    tangent = np.hypot(ray[:, 0], ray[:, 1]) / np.abs(ray[:, 2])
    pixel = np.abs(ray[:, 2]) / (photographs.orientation.interior[number, 0] * photographs.sensor[number, 2])
    image = pixel * _image_sigma_px(calibration, photographs)[number]
    orientation = np.sqrt(_orientation_part(calibration, photographs, xyz, number))
    heights = None
    if sigma is not None:
        heights = tangent * _near(sigma, xyz) / np.sqrt(2.0)
    total = np.sqrt(orientation**2 + image**2 + (0.0 if heights is None else heights**2))

    def laid(values: np.ndarray) -> np.ndarray:
        out = np.full(used.shape, np.nan)
        out[i, j] = values
        return out

    return PlanAccuracy(
        None if heights is None else laid(heights), laid(orientation), laid(image), laid(total), laid(tangent)
    )  # fmt: skip


def _image_sigma_px(calibration: Adjustment, photographs: Photographs) -> np.ndarray:
    """(n,) σ of a measured image coordinate by photograph, pixels."""
    rays = calibration.local.block.image_points
    own = float(np.median(rays.sigma)) if len(rays) else 0.0
    return calibration.local.outcome.sigma0 * own * photographs.sensor[:, 2]


def _orientation_part(
    calibration: Adjustment, photographs: Photographs, xyz: np.ndarray, number: np.ndarray
) -> np.ndarray:
    """(n,) m², mean of X and Y."""
    from scipy.interpolate import NearestNDInterpolator

    # by chance, so that no pattern of strips meets one of cells
    some = np.random.default_rng(0).permutation(len(xyz))[:PLACES]
    variance = plan_variances(calibration, photographs.restitution, photographs.rows, xyz[some], number[some])
    return NearestNDInterpolator(xyz[some, :2], variance.mean(axis=1))(xyz[:, :2])


def _near(sigma: RasterReader, xyz: np.ndarray) -> np.ndarray:
    """(n,) σ of the surface at places, row by row of the coarse grid so that little is read at a time."""
    out = np.full(len(xyz), np.nan)
    starts = np.flatnonzero(np.append(True, np.diff(xyz[:, 1]) != 0.0))
    for first, last in zip(starts, np.append(starts[1:], len(xyz)), strict=True):
        out[first:last] = sigma.sample(xyz[first:last, 0], xyz[first:last, 1])
    return out
