"""Steps in a DEM where two models meet: its heights on either side, carried on to the border.

step = (z₁ + (z₁ − z₀)/2) − (z₂ − (z₃ − z₂)/2) over four cells in a row or column, two in either model [D]. On even
slopes it is the step alone; roughness of the terrain and noise come on top, so that the mean is the better witness.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class SeamSteps:
    """Sums over the seams between models, k of them.

    Parameters
    ----------
    pair : (k, 2) numbers of the models, the smaller first. count : (k,) places measured.
    before, after : (k, 3) Σ and Σ² of the step of the first model less the second, m, and the largest without sign.
    """

    pair: np.ndarray
    count: np.ndarray
    before: np.ndarray
    after: np.ndarray

    @classmethod
    def none(cls) -> SeamSteps:
        """Of no seams."""
        return cls(np.zeros((0, 2), np.int64), np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3)))

    def rms(self, which: str) -> float:
        """m, over all places, 'before' or 'after'; NaN without any."""
        total = self.count.sum()
        return float(np.sqrt(getattr(self, which)[:, 1].sum() / total)) if total else np.nan


def window_steps(before: np.ndarray, after: np.ndarray, number: np.ndarray) -> SeamSteps:
    """The steps within a window; seams that run along its edges are left out.

    Parameters
    ----------
    before, after : (h, w) m, NaN where there is no height. number : (h, w) model of every cell, −1 for none.
    """
    pairs, steps = [], []
    for n, z, corrected in ((number, before, after), (number.T, before.T, after.T)):
        for row, column in _borders(n):
            pairs.append(np.column_stack([n[row, column], n[row, column + 1]]))
            steps.append(np.column_stack([_step(z, row, column), _step(corrected, row, column)]))
    pair, step = np.concatenate(pairs).astype(np.int64), np.concatenate(steps).astype(float)
    known = np.isfinite(step).all(axis=1)
    pair, step = pair[known], step[known]
    turned = pair[:, 0] > pair[:, 1]
    step[turned] *= -1.0
    return _summed(np.sort(pair, axis=1), step)


def added_steps(one: SeamSteps, other: SeamSteps) -> SeamSteps:
    """The sums of two sets of places."""
    if not len(other.pair):
        return one
    pair, place = np.unique(np.concatenate([one.pair, other.pair]), axis=0, return_inverse=True)
    place = place.ravel()
    count = np.zeros(len(pair), np.int64)
    np.add.at(count, place, np.concatenate([one.count, other.count]))
    sums = []
    for first, second in ((one.before, other.before), (one.after, other.after)):
        both, total = np.concatenate([first, second]), np.zeros((len(pair), 3))
        np.add.at(total[:, :2], place, both[:, :2])
        np.maximum.at(total[:, 2], place, both[:, 2])
        sums.append(total)
    return SeamSteps(pair, count, *sums)


def _borders(number: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Rows and columns of the last cell before a border to another model in the row, two cells on both sides."""
    row, column = np.nonzero(number[:, 1:-2] != number[:, 2:-1])
    column = column + 1
    left, right = number[row, column], number[row, column + 1]
    whole = (number[row, column - 1] == left) & (number[row, column + 2] == right) & (left >= 0) & (right >= 0)
    yield row[whole], column[whole]


def _step(z: np.ndarray, row: np.ndarray, column: np.ndarray) -> np.ndarray:
    z0, z1, z2, z3 = (z[row, column + k].astype(float) for k in (-1, 0, 1, 2))
    return (1.5 * z1 - 0.5 * z0) - (1.5 * z2 - 0.5 * z3)


def _summed(pair: np.ndarray, step: np.ndarray) -> SeamSteps:
    if not len(pair):
        return SeamSteps.none()
    unique, place = np.unique(pair, axis=0, return_inverse=True)
    place, k = place.ravel(), len(unique)
    sums = []
    for column in step.T:
        total = np.zeros((k, 3))
        np.add.at(total[:, 0], place, column)
        np.add.at(total[:, 1], place, column**2)
        np.maximum.at(total[:, 2], place, np.abs(column))
        sums.append(total)
    return SeamSteps(unique, np.bincount(place, minlength=k), sums[0], sums[1])
