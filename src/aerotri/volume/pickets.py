"""Pickets: points of a surface measured in oriented photographs after the adjustment, not in it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri.conventions import InputError
from aerotri.deformation.orientation import Orientation, calibrated_orientation
from aerotri.functional_model.collinearity import INTERIOR_COLUMNS, linearise
from aerotri.observations import Block
from aerotri.results.adjustment import Adjustment
from aerotri.terrain.dense.pairs import LEAST_ANGLE, WEAKEST_ANGLE
from aerotri.volume import _response_kernels as _kernels
from aerotri.volume.settings import MOST_PER_POINT, PER_POINT

CANDIDATES_EVERY = 64
"""Points of a row that share one list of photographs to look into."""


@dataclass(frozen=True, eq=False)
class Pickets:
    """Points and the photographs they were intersected from.

    Parameters
    ----------
    xyz : (k, 3) m in the CRS of the block.
    start : (k + 1,) first ray of every picket; image : (r,) rows of the block's photographs.
    sigma_mm : (r,) of an image coordinate, the matching.
    noise_share : (k,) 1 for a picket measured on its own; 1/n where one stands for n of equal weight, and more than 1
        where neighbours share their matching windows.
    """

    xyz: np.ndarray
    start: np.ndarray
    image: np.ndarray
    sigma_mm: np.ndarray
    noise_share: np.ndarray

    def __len__(self) -> int:
        return len(self.xyz)

    def take(self, rows: np.ndarray) -> Pickets:
        """Some of them."""
        count = np.diff(self.start)[rows]
        start = np.concatenate([[0], np.cumsum(count)])
        rays = np.repeat(self.start[rows] - start[:-1], count) + np.arange(start[-1])
        return Pickets(self.xyz[rows], start, self.image[rays], self.sigma_mm[rays], self.noise_share[rows])


@dataclass(frozen=True, eq=False)
class MeasuredPickets:
    """Pickets as `aerotri dtm` delivers them.

    Parameters
    ----------
    xyz : (k, 3) m in the CRS of the block. photographs : their names for each.
    sigma_z : (k,) m, σ of the height by matching alone; None where not stated.
    """

    xyz: np.ndarray
    photographs: list[list[str]]
    sigma_z: np.ndarray | None = None


def pickets_of_names(block: Block, xyz: np.ndarray, names: list[list[str]], sigma_mm: float | np.ndarray) -> Pickets:
    """Pickets with the names of their photographs.

    Parameters
    ----------
    names : photographs of every picket. sigma_mm : of an image coordinate, or (c,) of every camera.

    Raises
    ------
    InputError
        When a photograph is not in the block.
    """
    row = {str(name): k for k, name in enumerate(block.images.names)}
    unknown = {name for own in names for name in own} - row.keys()
    if unknown:
        raise InputError(
            f"the ground points (pickets) were measured in photograph '{min(unknown)}', which is not in the block",
            "give the adjustment with which they were measured",
        )
    start = np.concatenate([[0], np.cumsum([len(own) for own in names])]).astype(np.int64)
    image = np.array([row[name] for own in names for name in own], dtype=np.int64)
    return Pickets(np.asarray(xyz, dtype=float), start, image, _of_rays(block, image, sigma_mm), np.ones(len(xyz)))


def _of_rays(block: Block, image: np.ndarray, sigma_mm: float | np.ndarray) -> np.ndarray:
    """(r,) mm of rays in photographs (r,), σ of all or of every camera."""
    return np.broadcast_to(np.asarray(sigma_mm, dtype=float), (len(block.cameras),))[block.images.camera[image]]


def pickets_where_seen(
    calibration: Adjustment, xyz: np.ndarray, sigma_mm: float | np.ndarray, per_point: int | np.ndarray = PER_POINT,
    noise_share: np.ndarray | None = None,
) -> tuple[Pickets, np.ndarray]:  # fmt: skip
    """Pickets at places of a surface, in the photographs nearest to them that see them from different places.

    The nearest photograph is taken with the nearest of those whose rays make `LEAST_ANGLE` with its own. A place that
    is seen from one place only, as by the heads of one camera station, is not seen by enough.

    Parameters
    ----------
    xyz : (k, 3) m in the CRS of the block, neighbours in the list near one another.
    sigma_mm : of an image coordinate, or (c,) of every camera.
    per_point : photographs of all, or (k,) of each: of the nearest so many as see it, and eight at most.

    Returns
    -------
    Pickets, and (k,) bool which places are seen by enough photographs: by `per_point` of all, or by two.
    """
    local = xyz if calibration.frame is None else calibration.frame.to_local(xyz)
    orientation = calibrated_orientation(calibration)
    block = calibration.local.block
    half = np.array([block.cameras[camera].half_format_mm for camera in block.images.camera])
    known = np.flatnonzero(orientation.known)
    number = np.arange(len(local)) // CANDIDATES_EVERY
    first, candidate = _candidates(local, number, orientation, half, known)
    each = isinstance(per_point, np.ndarray)
    wanted = np.clip(per_point, PER_POINT, MOST_PER_POINT) if each else np.full(len(local), per_point)
    chosen = np.empty((len(local), int(wanted.max(initial=PER_POINT))), np.int64)
    _kernels.nearest_photographs(
        local, number, first, candidate,
        _kernels.Views(
            np.ascontiguousarray(orientation.rotation), np.ascontiguousarray(orientation.centre),
            np.ascontiguousarray(orientation.interior), half,
        ),
        np.radians(LEAST_ANGLE), np.radians(WEAKEST_ANGLE), chosen,
    )  # fmt: skip
    used = np.minimum((chosen >= 0).sum(axis=1), wanted)
    seen = used >= (PER_POINT if each else per_point)
    image = chosen[seen][np.arange(chosen.shape[1]) < used[seen, None]]
    start = np.concatenate([[0], np.cumsum(used[seen])]).astype(np.int64)
    share = np.ones(len(local)) if noise_share is None else noise_share
    return Pickets(xyz[seen], start, image, _of_rays(block, image, sigma_mm), share[seen]), seen


def _candidates(
    local: np.ndarray, number: np.ndarray, orientation: Orientation, half: np.ndarray, known: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Photographs whose footprint may hold a point of a run of points: by distance in plan."""
    runs = int(number[-1]) + 1 if len(number) else 0
    edges = np.searchsorted(number, np.arange(runs + 1))
    low = np.minimum.reduceat(local, edges[:-1]) if runs else np.zeros((0, 3))
    high = np.maximum.reduceat(local, edges[:-1]) if runs else np.zeros((0, 3))
    middle, size = (low + high)[:, :2] / 2.0, np.linalg.norm((high - low)[:, :2], axis=1) / 2.0
    bottom = float(local[:, 2].min()) if len(local) else 0.0
    tilt = np.arccos(np.clip(orientation.rotation[known, 2, 2], -1.0, 1.0))
    angle = np.minimum(np.arctan(np.hypot(*half[known].T) / orientation.interior[known, 0]) + tilt, 1.4)
    reach = np.tan(angle) * np.maximum(orientation.centre[known, 2] - bottom, 0.0)
    lists = [
        known[np.linalg.norm(orientation.centre[known, :2] - middle[k], axis=1) <= reach + size[k]] for k in range(runs)
    ]
    first = np.concatenate([[0], np.cumsum([len(own) for own in lists])]).astype(np.int64)
    return first, np.concatenate([*lists, np.zeros(0, np.int64)]).astype(np.int64)


def height_cofactors(calibration: Adjustment, pickets: Pickets) -> np.ndarray:
    """(k,) m², variance of the height of every picket from the σ of its rays, its orientation known."""
    local = pickets.xyz if calibration.frame is None else calibration.frame.to_local(pickets.xyz)
    orientation = calibrated_orientation(calibration)
    interior = np.zeros((len(orientation), len(INTERIOR_COLUMNS)))
    interior[:, :3] = orientation.interior
    point = np.repeat(np.arange(len(pickets)), np.diff(pickets.start))
    rays = linearise(
        np.ascontiguousarray(orientation.rotation), np.ascontiguousarray(orientation.centre), local, interior,
        pickets.image, point, pickets.image, np.zeros((len(point), 2)),
    )  # fmt: skip
    a = rays.by_point / pickets.sigma_mm[:, None, None]
    normal = np.zeros((len(pickets), 3, 3))
    np.add.at(normal, point, np.einsum("rai,raj->rij", a, a))
    return np.linalg.inv(normal)[:, 2, 2]


def with_height_sigmas(calibration: Adjustment, pickets: Pickets, sigma: np.ndarray) -> Pickets:
    """The pickets with the noise that their own σ of height state, (k,) m; NaN keeps what their rays give."""
    stated = sigma**2 / height_cofactors(calibration, pickets)
    return replace(pickets, noise_share=np.where(np.isfinite(sigma), stated, pickets.noise_share))
