"""Solutions for right sides that act on points, and the cofactors of the points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from aerotri.adjustment import _covariance_kernels
from aerotri.adjustment.kernel_records import Directions, Inverse
from aerotri.adjustment.robust import Estimator
from aerotri.adjustment.sparse_cholesky import Factor
from aerotri.adjustment.unknowns import State

if TYPE_CHECKING:
    from aerotri.adjustment.normal_equations import NormalSystem


def point_cofactors(
    system: NormalSystem, state: State, inverse: Inverse, estimator: Estimator
) -> tuple[np.ndarray, np.ndarray]:
    """Cofactors of the points (P, 3, 3) and redundancy numbers of the rays (m, 2), in the order of `unknowns`."""
    u = system.unknowns
    cofactor, redundancy = np.empty((len(u.points), 3, 3)), np.empty((len(u.rays.image), 2))
    system.over_points(
        system.problem(state, estimator),
        lambda first, last, problem, work: _covariance_kernels.point_cofactors(
            first, last, problem, inverse, cofactor, redundancy, work
        ),
    )
    held = u.point_held
    cofactor[held] = 0.0
    np.swapaxes(cofactor, 1, 2)[held] = 0.0
    for row, columns in zip(u.kept_rows, u.kept_columns, strict=True):
        cofactor[row] = inverse.corner[np.ix_(columns, columns)]
    return cofactor, redundancy


def solve_sides(
    system: NormalSystem, state: State, factor: Factor, sides: np.ndarray, estimator: Estimator,
    shared_sides: np.ndarray | None = None, rows: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Columns Q·b for right sides b that act on the points, and on the shared parameters where given.

    Parameters
    ----------
    sides : (P, 3, k). shared_sides : (s, k).
    rows : the points that have sides or whose solution is wanted, where these are few; all unless given.

    Returns
    -------
    Solutions of photographs (n, 6, k), shared parameters (s, k) and points (P, 3, k).
    """
    u = system.unknowns
    n, k = len(u.images), sides.shape[2]
    right = reduced_sides(system, state, sides, estimator, rows)
    right[6 * n + u.kept_columns] += sides[u.kept_rows]
    if shared_sides is not None:
        right[6 * n :] += shared_sides
    x = factor.solve(right)
    images, shared = np.ascontiguousarray(x[: 6 * n].reshape(n, 6, k)), np.ascontiguousarray(x[6 * n :])
    return images, shared, expand_sides(system, state, images, shared, sides, estimator, rows)


def reduced_sides(
    system: NormalSystem, state: State, sides: np.ndarray, estimator: Estimator, rows: np.ndarray | None = None
) -> np.ndarray:
    """(6·n + s, k) what right sides of points (P, 3, k) leave for the others once the points are eliminated.

    Parameters
    ----------
    rows : the points that have sides, where these are few; all unless given.
    """
    u = system.unknowns
    n, s, k = len(u.images), len(u.shared), sides.shape[2]
    free, problem = np.ascontiguousarray(sides * u.point_free[:, :, None]), system.problem(state, estimator)
    rights = [(np.zeros((n, 6, k)), np.zeros((s, k))) for _ in system.chunks]

    def reduce(c: int) -> None:
        _covariance_kernels.reduce_point_sides(*system.chunks[c], problem, free, *rights[c], system.work())

    if rows is None:
        system.over_chunks(reduce)
    else:
        for p in rows.tolist():
            _covariance_kernels.reduce_point_sides(p, p + 1, problem, free, *rights[0], system.work())
    of_images, of_shared = (np.sum(each, axis=0) for each in zip(*rights, strict=True))
    return np.concatenate([of_images.reshape(6 * n, k), of_shared])


def expand_sides(
    system: NormalSystem, state: State, images: np.ndarray, shared: np.ndarray, sides: np.ndarray, estimator: Estimator,
    rows: np.ndarray | None = None,
) -> np.ndarray:  # fmt: skip
    """Solutions of the points (P, 3, k) from those of photographs (n, 6, k) and shared parameters (s, k).

    Parameters
    ----------
    rows : of the points that are wanted, where these are few; the others are 0.
    """
    u = system.unknowns
    points = np.zeros((len(u.points), 3, sides.shape[2]))
    free = np.ascontiguousarray(sides * u.point_free[:, :, None])
    solution, problem = Directions(images, shared, points), system.problem(state, estimator)
    if rows is None:
        system.over_points(
            problem,
            lambda first, last, problem, work: _covariance_kernels.expand_point_sides(
                first, last, problem, free, solution, work
            ),
        )
    else:
        for p in rows.tolist():
            _covariance_kernels.expand_point_sides(p, p + 1, problem, free, solution, system.work())
    points *= u.point_free[:, :, None]
    points[u.kept_rows] = shared[u.kept_columns]
    return points
