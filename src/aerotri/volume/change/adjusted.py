"""What the adjustments of two epochs bring into a change, with what they have in common.

[D] A volume of the change is Σw·(z₂ − z₁ − a·x̂), and the alignment x̂ = Σm·(z₂ − z₁) is linear in the heights of stable
cells: together one functional of z₂ − z₁ with the weights w − m·(Σw·a). Its response to both adjustments tells what
their errors leave in the volume after the alignment; one adjustment counts by the difference of the responses, control
and camera that two have in common by their covariance (`volume.shared`). Such errors change slowly over the ground:
cells are put together in blocks, and σ of single cells is found at some places and linear between them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates

from aerotri.conventions import InputError
from aerotri.rasters.between_places import between_places, spread_places
from aerotri.rasters.grids import Grid
from aerotri.results.adjustment import Adjustment
from aerotri.statistics.image_sigma import image_sigma_of_cameras
from aerotri.volume.bases import Surface
from aerotri.volume.cell_noise import photographs_at
from aerotri.volume.change.alignment import Alignment, slopes_of
from aerotri.volume.functionals import together
from aerotri.volume.parts import Measured, Part
from aerotri.volume.pickets import Pickets, pickets_where_seen
from aerotri.volume.response import respond_to_all
from aerotri.volume.settings import PER_POINT
from aerotri.volume.shared import (
    difference_responses,
    same_adjustment,
    shared_camera_covariance,
    shared_control_covariance,
    shared_in_words,
)

MOST_BLOCKS = 64
"""Blocks of cells along the longer side; chosen [C]: deformations of a block change over tenths of a model, and a
change covers some models."""
PLACES = 8
"""Places along a side at which σ of single cells is found."""
NAMES = ("the first surface", "the second")
Functional = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Its gradients (b, 3) by the places of both surfaces, and (u,) by what the second was moved by."""


@dataclass(frozen=True, eq=False)
class AdjustedEpoch:
    """The cells of a surface as points of its adjustment, a block of cells each.

    Parameters
    ----------
    pickets : of the blocks that photographs see. slope : (2, rows, columns) m/m along X and Y, 0 where not known.
    seen : (b,) bool, of all blocks.
    """

    calibration: Adjustment
    pickets: Pickets
    slope: np.ndarray
    seen: np.ndarray

    def gradient(self, weight: np.ndarray, factor: int) -> np.ndarray:
        """(b, 3) of Σ weight·z by the places of all blocks, weight (rows, columns)."""
        sums = [together(-slope * weight, factor).ravel() for slope in self.slope]
        return np.stack([*sums, together(weight, factor).ravel()], axis=-1)

    def parts(self, gradients: Sequence[np.ndarray]) -> list[Part]:
        """The shares of functionals with gradients (b, 3)."""
        pickets, own = self.pickets, [gradient[self.seen] for gradient in gradients]
        responses = respond_to_all(self.calibration, pickets, own)
        return [
            Part(self.calibration, response, None, len(pickets), len(pickets.image), 0.0, Measured(pickets, gradient))
            for response, gradient in zip(responses, own, strict=True)
        ]


@dataclass(frozen=True, eq=False)
class AdjustedPair:
    """Two epochs with their adjustments.

    Parameters
    ----------
    factor : cells along a side of a block. known : (rows, columns) bool, heights in both.
    """

    first: AdjustedEpoch
    second: AdjustedEpoch
    factor: int
    known: np.ndarray

    def aligned(self, alignment: Alignment, design: np.ndarray) -> AlignedPair:
        """With what the second surface was moved by; design (rows, columns, u) of every cell."""
        size = len(alignment.names)
        gains = tuple(
            np.stack([one.gradient(alignment.gain[:, :, k], self.factor) for k in range(size)], axis=-1)
            if alignment.gain is not None and size else np.zeros((len(one.seen), 3, 0))
            for one in (self.first, self.second)
        )  # fmt: skip
        return AlignedPair(self, np.nan_to_num(design), (gains[0], gains[1]))

    def in_words(self) -> str:
        """What both have in common."""
        one, two = (epoch.parts([np.zeros((len(epoch.seen), 3))])[0] for epoch in (self.first, self.second))
        return in_common(one, two, NAMES)


@dataclass(frozen=True, eq=False)
class AlignedPair:
    """Two epochs with their adjustments after the alignment.

    Parameters
    ----------
    design : (rows, columns, u) partials of the difference by the alignment. gains : (b, 3, u) of both surfaces, the
        gradients of what the second was moved by.
    """

    pair: AdjustedPair
    design: np.ndarray
    gains: tuple[np.ndarray, np.ndarray]

    def variances(self, weight: np.ndarray) -> tuple[float, float]:
        """m⁶ of Σ weight·difference, weight (rows, columns) m²: what noise brings, and the model part."""
        pair, own = self.pair, np.where(self.pair.known, weight, 0.0)
        along = np.einsum("rc,rcu->u", own, self.design)
        gradients = pair.first.gradient(own, pair.factor), pair.second.gradient(own, pair.factor)
        return self._of([(*gradients, along)])[0]

    def sigma(self) -> np.ndarray:
        """(rows, columns) m, of the difference of every cell."""
        pair = self.pair
        rows, columns = _places(pair.known)
        across = -(-pair.known.shape[1] // pair.factor)
        functionals: list[Functional] = []
        for row, column in zip(rows.tolist(), columns.tolist(), strict=True):
            block = row // pair.factor * across + column // pair.factor
            first, second = np.zeros((len(pair.first.seen), 3)), np.zeros((len(pair.second.seen), 3))
            first[block] = *(-pair.first.slope[:, row, column]), 1.0
            second[block] = *(-pair.second.slope[:, row, column]), 1.0
            functionals.append((first, second, self.design[row, column]))
        values = np.sqrt([sum(both) for both in self._of(functionals)])
        return _between(pair.known.shape, rows, columns, values)

    def unknowns(self) -> np.ndarray:
        """(u,) variances of what the second surface was moved by: what the adjustments bring, with the model part."""
        still = np.zeros(self.design.shape[-1])
        one, two = self.gains
        found = self._of([(one[:, :, k], two[:, :, k], still) for k in range(len(still))])
        return np.array([sum(both) for both in found])

    def _of(self, functionals: Sequence[Functional]) -> list[tuple[float, float]]:
        """Variances of functionals by noise of the adjustments, and their model parts."""
        if not functionals:
            return []
        first, second = self.gains
        ones = self.pair.first.parts([one - first @ along for one, _, along in functionals])
        twos = self.pair.second.parts([two - second @ along for _, two, along in functionals])
        if same_adjustment(ones[0], twos[0]):
            joint = difference_responses(list(zip(twos, ones, strict=True)))
            return [(max(response.variance, 0.0), response.model) for response in joint]
        return [variances_of_difference(one, two) for one, two in zip(ones, twos, strict=True)]


def variances_of_difference(one: Part, two: Part) -> tuple[float, float]:
    """Variance of the second functional less the first by noise of the adjustments, and its model part."""
    if same_adjustment(one, two):
        joint = difference_responses([(two, one)])[0]
        return max(joint.variance, 0.0), joint.model
    own = one.response.variance + two.response.variance
    both = shared_control_covariance(one, two) + shared_camera_covariance(one, two)
    return max(own - 2.0 * both, 0.0), one.response.model + two.response.model


def in_common(one: Part, two: Part, names: tuple[str, str]) -> str:
    """What both have in common, as a sentence.

    Parameters
    ----------
    names : of the two, as 'the first surface'.
    """
    if same_adjustment(one, two):
        kind = names[0].rpartition(" ")[2]
        return f"both {kind}s come from one adjustment: errors that both share cancel"
    return shared_in_words(one, two, names)


def adjusted_pair(
    grid: Grid, heights: tuple[np.ndarray, np.ndarray], calibrations: tuple[Adjustment, Adjustment],
    photographs: tuple[Surface | None, ...] = (None, None),
) -> AdjustedPair:  # fmt: skip
    """Two surfaces on the same cells with their adjustments.

    Parameters
    ----------
    heights : of the first and the second, (rows, columns) m, NaN where not known.
    photographs : number that measured a cell, on the cells of each surface itself; None where not known.

    Raises
    ------
    InputError
        When no two photographs of an adjustment see its surface from different places.
    """
    known = np.isfinite(heights[0]) & np.isfinite(heights[1])
    factor = max(1, int(np.ceil(max(known.shape) / MOST_BLOCKS)))
    first, second = (
        _epoch(grid, z, known, factor, calibration, of_cells, name)
        for z, calibration, of_cells, name in zip(heights, calibrations, photographs, NAMES, strict=True)
    )
    return AdjustedPair(first, second, factor, known)


def _epoch(
    grid: Grid, z: np.ndarray, known: np.ndarray, factor: int, calibration: Adjustment, photographs: Surface | None,
    name: str,
) -> AdjustedEpoch:  # fmt: skip
    x, y = np.meshgrid(grid.x(np.arange(grid.columns)), grid.y(np.arange(grid.rows)))
    share = known.astype(float)
    count = together(share, factor).ravel()
    places = np.zeros((len(count), 3))
    for axis, values in enumerate((x, y, np.where(known, z, 0.0))):
        np.divide(together(share * values, factor).ravel(), count, out=places[:, axis], where=count > 0.0)
    filled = count > 0.0
    own = places[filled]
    per_point = PER_POINT if photographs is None else photographs_at(photographs, own)
    pickets, seen = pickets_where_seen(calibration, own, image_sigma_of_cameras(calibration), per_point)
    if not seen.any():
        raise InputError(
            f"no two photographs of its adjustment see {name} from different places",
            "check which result belongs to it",
        )
    every = np.zeros(len(count), bool)
    every[np.flatnonzero(filled)[seen]] = True
    slope = np.stack([np.where(known & np.isfinite(along), along, 0.0) for along in slopes_of(grid, z)])
    return AdjustedEpoch(calibration, pickets, slope, every)


def _places(known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of known cells, spread over all of them."""
    rows, columns = np.nonzero(known)
    chosen = spread_places(np.column_stack([rows, columns]).astype(float), (PLACES, PLACES))
    return rows[chosen], columns[chosen]


def _between(shape: tuple[int, ...], rows: np.ndarray, columns: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values at some cells, linear between them, on all; beyond them the nearest."""
    nodes = [np.linspace(0.0, max(n - 1, 1), 2 * PLACES) for n in shape]
    at = np.stack(np.meshgrid(*nodes, indexing="ij"), axis=-1).reshape(-1, 2)
    own = np.column_stack([rows, columns]).astype(float)
    table = between_places(own, values, at).reshape(2 * PLACES, 2 * PLACES)
    row, column = (np.arange(n) * (2 * PLACES - 1) / max(n - 1, 1) for n in shape)
    return map_coordinates(table, np.meshgrid(row, column, indexing="ij"), order=1, mode="nearest")
