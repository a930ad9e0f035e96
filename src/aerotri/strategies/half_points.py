"""Ground points of two halves compared, in plan and height, by cells in plan with their joint covariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from aerotri.adjustment.datum import motions_of_points
from aerotri.strategies.half_covariance import HalfPair, PairCofactors, pair_cofactors

MOST_CELLS, FEWEST_CELLS = 60, 4
"""Cells in plan [C]: of so many means the joint covariance is had by a few solutions with the factor."""
POINTS_A_CELL = 12
"""Points that a cell should have [C]; one with fewer than `FEWEST_POINTS` is left out."""
FEWEST_POINTS = 3
WEAK_DATUM = 3.0
"""σ of the differences over that after a transformation with seven parameters, from which the datum hides the shape
[C]."""


@dataclass(frozen=True, eq=False)
class ComparedPoints:
    """Common points of two halves: what is compared, and its cofactors.

    Parameters
    ----------
    pair : the halves. motions : (P, 3, 7), solver : (7, P, 3), see `pair_cofactors`. cofactors : of the differences.
    difference : (P, 3) m, first − second, in the local frame, transformed where that is asked for.
    transformed : whether it is.
    """

    pair: HalfPair
    motions: np.ndarray
    solver: np.ndarray
    cofactors: PairCofactors
    difference: np.ndarray
    transformed: bool

    @property
    def of_points(self) -> np.ndarray:
        """(P, 3, 3) cofactors of `difference`."""
        return self.cofactors.transformed if self.transformed else self.cofactors.points


def compare_points(pair: HalfPair, free: bool) -> ComparedPoints:
    """The differences of the common points, after a transformation where the datum of the halves is free or weak.

    Parameters
    ----------
    free : whether the datum of the block is free.
    """
    one, two = (half.solution.state.points[rows] for half, rows in zip(pair.halves, pair.rows, strict=True))
    difference, middle = one - two, two.mean(axis=0)
    motions = motions_of_points(two - middle)
    weight = _precision(pair)
    weighted = motions * weight[:, None, None]
    normal = np.einsum("pim,pin->mn", weighted, motions)
    size = np.sqrt(np.diagonal(normal))
    inverse = np.linalg.inv(normal / np.outer(size, size)) / np.outer(size, size)
    solver = np.einsum("mn,pin->mpi", inverse, weighted)
    cofactors = pair_cofactors(pair, motions, solver)
    ratio = np.median(np.einsum("pii->p", cofactors.points)) / np.median(np.einsum("pii->p", cofactors.transformed))
    transformed = bool(free or not ratio <= WEAK_DATUM**2)
    if transformed:
        difference = difference - motions @ np.einsum("mpi,pi->m", solver, difference)
    return ComparedPoints(pair, motions, solver, cofactors, difference, transformed)


def _precision(pair: HalfPair) -> np.ndarray:
    """(P,) weights of the points: 1/σ² of the difference in the worst direction, the photographs held."""
    variance = np.zeros(pair.n_points)
    for half, rows in zip(pair.halves, pair.rows, strict=True):
        loose = half.system.looseness(half.solution.state, half.solution.estimator)[rows]
        variance += np.where(np.isfinite(loose), loose, 1e3) ** 2
    # a point held in both halves has no variance at all
    return 1.0 / np.maximum(variance, 1e-6 * np.median(variance) + 1e-30)


@dataclass(frozen=True, eq=False)
class CellMeans:
    """Weighted means of the differences by cells in plan, three functions a cell: X, Y, Z.

    Parameters
    ----------
    weight : (k, P) sparse, a row sums to 1. turn : (P, 3, 3) from the local frame to the axes of the block.
    motions, solver : of a transformation before the mean, None without one.
    """

    weight: csr_array
    turn: np.ndarray
    motions: np.ndarray | None = None
    solver: np.ndarray | None = None

    @property
    def count(self) -> int:
        return 3 * len(self.weight.indptr[1:])

    def of(self, values: np.ndarray) -> np.ndarray:
        """(3·k, n) of values (P, 3, n)."""
        if self.motions is not None and self.solver is not None:
            values = values - np.einsum("pim,mn->pin", self.motions, np.einsum("mpi,pin->mn", self.solver, values))
        turned = np.einsum("pij,pjn->pin", self.turn, values)
        n = values.shape[2]
        return (self.weight @ turned.reshape(len(values), 3 * n)).reshape(-1, n)

    def sides(self, first: int, last: int) -> np.ndarray:
        """(P, 3, last − first)."""
        wanted = np.arange(first, last)
        rows = self.weight[wanted // 3].toarray()
        sides = np.einsum("kp,pki->pik", rows, self.turn[:, wanted % 3])
        if self.motions is not None and self.solver is not None:
            sides = sides - np.einsum("mpi,mn->pin", self.solver, np.einsum("pim,pin->mn", self.motions, sides))
        return sides


def cells_in_plan(xy: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Square cells over points in plan (P, 2) m: the cell of each, −1 in none, their middles (k, 2) and size, m."""
    wanted = int(np.clip(len(xy) // POINTS_A_CELL, FEWEST_CELLS, MOST_CELLS))
    low, extent = xy.min(axis=0), np.maximum(np.ptp(xy, axis=0), 1e-9)
    size = float(np.sqrt(np.prod(np.maximum(extent, extent.max() / wanted)) / wanted))
    while True:
        shape = np.maximum(np.ceil(extent / size - 1e-9).astype(np.int64), 1)
        start = low - 0.5 * (shape * size - extent)
        index = np.clip(((xy - start) / size).astype(np.int64), 0, shape - 1)
        code, cell, count = np.unique(index @ np.array([shape[1], 1]), return_inverse=True, return_counts=True)
        kept = np.flatnonzero(count >= FEWEST_POINTS)
        if len(kept) <= MOST_CELLS:
            break
        size *= 1.05
    number = np.full(len(code), -1)
    number[kept] = np.arange(len(kept))
    column_row = np.stack([code[kept] // shape[1], code[kept] % shape[1]], axis=1)
    return number[cell], start + (column_row + 0.5) * size, size


def mean_functions(compared: ComparedPoints, cell: np.ndarray, turn: np.ndarray) -> CellMeans:
    """The means of the differences by cells; points count by their precision."""
    inside = np.flatnonzero(cell >= 0)
    weight = _precision(compared.pair)[inside]
    total = np.bincount(cell[inside], weight)
    entries = weight / total[cell[inside]]
    matrix = csr_array((entries, (cell[inside], inside)), shape=(len(total), len(cell)))
    if not compared.transformed:
        return CellMeans(matrix, turn)
    return CellMeans(matrix, turn, compared.motions, compared.solver)
