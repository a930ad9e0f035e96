"""What the adjustment says of a block, and what dense algebra says of the same.

Measures the search for rank defects: pivots of the factor, free directions, eigenvalues. Imports inside on purpose.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.adjustment.block_motions import unnoticed_motions
from aerotri.adjustment.defects import checked_factor, free_besides
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.null_space import smallest_eigenvalue
from aerotri.adjustment.prepare import prepare
from aerotri.adjustment.robust import LEAST_SQUARES
from aerotri.adjustment.unknowns import State
from aerotri.functional_model.collinearity import linearise
from defects_proof.cases import Case, cases
from defects_proof.variants import VARIANTS

DENSE_ZERO = 1e-9
"""Singular value of the design matrix with rows and columns of length one, below which a direction is free."""


@dataclass(frozen=True)
class Look:
    """One block looked at.

    Parameters
    ----------
    case, seed, variant : which. expected : directions free. dense : of them found by the singular values.
    said : sentences. pivot, estimate : smallest pivot and smallest λ by the factor, NaN without one.
    free : directions found free. singular : the largest singular value that is zero, and the smallest that is not.
    sigma_error : largest relative error of σ of orientations and shared parameters; NaN where something is free.
    """

    case: str
    seed: int
    variant: str
    expected: int
    dense: int
    words: str
    said: str
    pivot: float
    estimate: float
    free: int
    singular: tuple[float, float]
    sigma_error: float

    @property
    def is_right(self) -> bool:
        """Whether everybody agrees, and the σ are right."""
        if self.expected:
            return self.dense == self.expected and self.free == self.expected and self.words in self.said != ""
        return self.dense == 0 and not self.said and self.sigma_error < 1e-3


def looks(seeds: range) -> list[Look]:
    """Every case in every variant."""
    return [look_at(case, seed, name) for seed in seeds for case in cases(seed) for name in VARIANTS]


def look_at(case: Case, seed: int, variant: str) -> Look:
    """One block in one variant."""
    prepared = prepare(VARIANTS[variant](case.block))
    system, state = prepared.system, prepared.state
    equations = system.assemble(state, 0.0, LEAST_SQUARES)
    factor, said = checked_factor(system, state, equations, LEAST_SQUARES)
    design = dense_design(system, state)
    length = np.linalg.norm(design, axis=0)
    values = _singular_values(design[:, length > 0.0])
    null = values < DENSE_ZERO
    singular = float(values[null].max(initial=0.0)), float(values[~null].min())
    pivot, estimate, error, free = np.nan, np.nan, np.nan, 0
    if factor is not None:
        pivot, estimate = factor.smallest_pivot, smallest_eigenvalue(factor, equations.diagonal)
        error = _sigma_error(system, factor, design, length)
    else:
        motions = unnoticed_motions(system, state)
        free = motions.count + free_besides(system, state, equations, LEAST_SQUARES, motions).shape[1]
    return Look(
        case.name, seed, variant, case.free, int(null.sum()), case.words, "; ".join(said), pivot, estimate, free,
        singular, error,
    )  # fmt: skip


def _singular_values(design: np.ndarray) -> np.ndarray:
    """Of the matrix with rows and then columns of length one, as many as it has columns: σ take no part."""
    lengths = np.linalg.norm(design, axis=1, keepdims=True)
    rows = design / np.where(lengths > 0.0, lengths, 1.0)
    scaled = rows / np.linalg.norm(rows, axis=0)
    values = np.linalg.svd(np.linalg.qr(scaled, mode="r"), compute_uv=False)
    return np.concatenate([values, np.zeros(scaled.shape[1] - len(values))])


def _sigma_error(system: NormalSystem, factor, design: np.ndarray, length: np.ndarray) -> float:
    """Largest relative difference of σ from the singular value decomposition, of the reduced unknowns."""
    scaled = design[:, length > 0.0] / length[length > 0.0]
    _, values, right = np.linalg.svd(np.linalg.qr(scaled, mode="r"))
    root = right.T / values
    size = system.symbolic.size
    there = np.flatnonzero(length > 0.0)
    dense = np.zeros(len(length))
    dense[there] = np.sqrt(np.sum(root**2, axis=1)) / length[there]
    free = there[there < size]
    ours = np.sqrt(np.diagonal(factor.columns(free)[free]))
    return float(np.abs(ours / dense[free] - 1.0).max())


def dense_design(system: NormalSystem, state: State) -> np.ndarray:
    """The whitened design matrix in full, over photographs, shared parameters and points."""
    u = system.unknowns
    rays, n, s, count = u.rays, len(u.images), len(u.shared), len(u.points)
    point = np.repeat(np.arange(count), np.diff(rays.start))
    by = linearise(
        state.rotation, state.centre, state.points, u.interior(state), rays.image, point, rays.lens_row, rays.xy
    )
    m, first = len(point), 6 * n + s
    design = np.zeros((m, 2, first + 3 * count))
    ray, turn = np.arange(m)[:, None], u.turn(state)
    of_image = by.by_orientation.copy()
    of_image[:, :, 3:] = of_image[:, :, 3:] @ turn[rays.image]
    of_image *= u.eo_free[rays.image][:, None, :]
    for axis in range(2):
        design[ray, axis, 6 * rays.image[:, None] + np.arange(6)] = of_image[:, axis]
        eliminated = first + 3 * point[:, None] + np.arange(3)
        design[ray, axis, eliminated] = by.by_point[:, axis] * u.point_free[point]
        kept = np.flatnonzero(u.kept[point] >= 0)
        design[kept[:, None], axis, 6 * n + u.kept[point[kept]][:, None] + np.arange(3)] = by.by_point[kept, axis]
        for t in range(u.lens.columns.shape[1]):
            column = u.lens.columns[rays.lens_row, t]
            there = np.flatnonzero(column >= 0)
            design[there, axis, 6 * n + column[there]] += by.by_interior[there, axis, t]
        for t in range(rays.ap_index.shape[1]):
            design[np.arange(m), axis, 6 * n + rays.ap_index[:, t]] += rays.ap_value[:, axis, t]
    whitened = (design * rays.inv_sigma[:, :, None]).reshape(2 * m, -1)
    return np.concatenate(
        [whitened, *_observed(system, whitened.shape[1], n, s), *_beside(system, state, n, whitened.shape[1])]
    )


def _observed(system: NormalSystem, size: int, n: int, s: int) -> list[np.ndarray]:
    """Rows of observed coordinates and shared parameters."""
    u = system.unknowns
    point, axis = np.nonzero(u.prior_weight * (u.kept < 0)[:, None])
    of_points = np.zeros((len(point), size))
    of_points[np.arange(len(point)), 6 * n + s + 3 * point + axis] = np.sqrt(u.prior_weight[point, axis])
    sigma = np.array(u.shared.sigma, dtype=float)
    known = np.flatnonzero(np.isfinite(sigma))
    of_shared = np.zeros((len(known), size))
    of_shared[np.arange(len(known)), 6 * n + known] = 1.0 / sigma[known]
    return [of_points, of_shared]


def _beside(system: NormalSystem, state: State, n: int, size: int) -> list[np.ndarray]:
    """Rows of the observations beside image points and control."""
    parts = []
    for rows in system.whitened_rows(state):
        g, k = rows.gap.shape
        part = np.zeros((g, k, size))
        for i in range(g):
            if rows.image[i] >= 0:
                part[i, :, 6 * rows.image[i] : 6 * rows.image[i] + 6] = rows.by_image[i]
            for c, column in enumerate(rows.columns[i]):
                if column >= 0:
                    part[i, :, 6 * n + column] += rows.by_shared[i, :, c]
        parts.append(part.reshape(g * k, size))
    return parts
