"""The whitened observation equations of the independent adjustment, and their solution without Ceres."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix, diags
from scipy.sparse.linalg import splu

from aerotri.crosscheck.paper_block import PaperBlock
from aerotri.crosscheck.paper_rays import linearise, linearise_antenna
from aerotri.crosscheck.paper_unknowns import Layout

RAYS_AT_ONCE = 20_000
"""Rays whose complex partials are held at a time [C]: some tens of MB; more cost memory, fewer cost calls of NumPy."""
MAX_ITERATIONS = 60
"""[C] A block that is determined takes a few; more would only delay 'not converged'."""
STEP_TOLERANCE = 1e-5
"""A step no larger than this in units of σ ends the iteration."""
MOST_DAMPING = 1e6
"""Factor of the diagonal from which no step can help any more [C]: steps are then a millionth of Gauss-Newton's."""


@dataclass(frozen=True, eq=False)
class PaperSolution:
    """Where an independent adjustment ended: x (N,), vᵀPv there, and how it went."""

    x: np.ndarray
    vtpv: float
    iterations: int
    converged: bool
    solver: str


@dataclass(frozen=True, eq=False)
class _Rows:
    """Rows of equations: misclosure (k, d), columns and values of their partials (k, d, w)."""

    misclosure: np.ndarray
    columns: np.ndarray
    values: np.ndarray


def whole_system(paper: PaperBlock, layout: Layout, x: np.ndarray) -> tuple[np.ndarray, csr_matrix]:
    """All whitened misclosures, measured − predicted, and the partials of the predictions (rows, N)."""
    count = len(paper.rays.image)
    parts = [ray_rows(paper, layout, x, slice(k, k + RAYS_AT_ONCE)) for k in range(0, count, RAYS_AT_ONCE)]
    parts.append(_observed_rows(paper, layout, x))
    if paper.antennas is not None:
        parts.append(_antenna_rows(paper, layout, x))
    row, offset = [], 0
    for part in parts:
        own = offset + np.arange(part.misclosure.size)
        row.append(np.repeat(own, part.values.shape[-1]))
        offset += part.misclosure.size
    values = np.concatenate([part.values.ravel() for part in parts])
    columns = np.concatenate([part.columns.ravel() for part in parts])
    matrix = csr_matrix((values, (np.concatenate(row), columns)), shape=(offset, len(layout.free)))
    return np.concatenate([part.misclosure.ravel() for part in parts]), matrix


def ray_rows(paper: PaperBlock, layout: Layout, x: np.ndarray, rows: slice) -> _Rows:
    """Equations of some rays: by pose, point, active elements, linear parameters."""
    rays = paper.rays
    image, point, setup = rays.image[rows], rays.point[rows], rays.setup[rows]
    mount = None if layout.mount is None else layout.mount[image]
    elements = x[layout.shared[rays.elements]][setup]
    prediction, by_pose, by_elements = linearise(
        x[layout.poses[image]], mount, x[layout.points[point]], elements, rays.at[rows], paper.order, layout.active
    )
    linear = layout.shared[np.maximum(rays.linear, 0)][setup]
    active = layout.shared[rays.elements[:, layout.active]][setup]
    prediction += np.einsum("kiq,kq->ki", rays.patterns[rows], x[linear])
    values = np.concatenate([by_pose, -by_pose[:, :, :3], by_elements, rays.patterns[rows]], axis=2)
    columns = np.concatenate([layout.poses[image], layout.points[point], active, linear], axis=1)
    inv_sigma = rays.inv_sigma[rows]
    return _Rows(
        (rays.xy[rows] - prediction) * inv_sigma,
        np.broadcast_to(columns[:, None, :], values.shape),
        values * inv_sigma[:, :, None],
    )


def observed_entries(paper: PaperBlock, layout: Layout) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Directly observed unknowns: place in x, value, 1/σ (control coordinates, weighted shared parameters)."""
    row, axis = np.nonzero(paper.point_inv_sigma > 0.0)
    weighted = np.flatnonzero(np.isfinite(paper.shared.sigma) & paper.shared.free)
    return (
        np.concatenate([layout.points[row, axis], layout.shared[weighted]]),
        np.concatenate([paper.point_value[row, axis], paper.shared.start[weighted]]),
        np.concatenate([paper.point_inv_sigma[row, axis], 1.0 / paper.shared.sigma[weighted]]),
    )


def _observed_rows(paper: PaperBlock, layout: Layout, x: np.ndarray) -> _Rows:
    place, value, inv_sigma = observed_entries(paper, layout)
    misclosure = (value - x[place]) * inv_sigma
    return _Rows(misclosure[:, None], place[:, None, None], inv_sigma[:, None, None])


def _antenna_rows(paper: PaperBlock, layout: Layout, x: np.ndarray) -> _Rows:
    """Equations of the observed antennas: by pose, shift and drift."""
    a = paper.antennas
    if a is None:
        return _Rows(np.zeros((0, 3)), np.zeros((0, 3, 8), np.int64), np.zeros((0, 3, 8)))
    mount = None if layout.mount is None else layout.mount[a.image]
    position, by_pose = linearise_antenna(x[layout.poses[a.image]], mount, a.lever_arm, paper.order)
    by_entry = np.stack([a.shift >= 0, (a.drift >= 0) * a.since[:, None]], axis=2).astype(float)
    entries = layout.shared[np.maximum(np.stack([a.shift, a.drift], axis=2), 0)]
    position += np.sum(by_entry * x[entries], axis=2)
    poses = np.broadcast_to(layout.poses[a.image][:, None, :], by_pose.shape)
    values = np.concatenate([by_pose, by_entry], axis=2) * a.inv_sigma[:, :, None]
    return _Rows((a.xyz - position) * a.inv_sigma, np.concatenate([poses, entries], axis=2), values)


def solve_normal_equations(paper: PaperBlock, layout: Layout, start: np.ndarray) -> PaperSolution:
    """Gauss-Newton on the full sparse normal equations (SciPy), damped when a step fails."""
    x, damping = start.copy(), 0.0
    misclosure, matrix = whole_system(paper, layout, x)
    cost = float(misclosure @ misclosure)
    redundancy = max(len(misclosure) - int(layout.free.sum()), 1)
    for iteration in range(1, MAX_ITERATIONS + 1):
        step, decrement = _step(matrix, misclosure, layout.free, damping)
        moved = x + step
        misclosure_there, matrix_there = whole_system(paper, layout, moved)
        there = float(misclosure_there @ misclosure_there)
        if not there <= cost * (1.0 + 1e-9):
            damping = max(1e-4, 10.0 * damping)
            if damping > MOST_DAMPING:
                return PaperSolution(x, cost, iteration, False, "SciPy")
            continue
        x, misclosure, matrix, cost = moved, misclosure_there, matrix_there, there
        if damping == 0.0 and decrement <= STEP_TOLERANCE**2 * cost / redundancy:
            return PaperSolution(x, cost, iteration, True, "SciPy")
        damping = damping / 10.0 if damping > 1e-8 else 0.0
    return PaperSolution(x, cost, MAX_ITERATIONS, False, "SciPy")


def _step(matrix: csr_matrix, misclosure: np.ndarray, free: np.ndarray, damping: float) -> tuple[np.ndarray, float]:
    """The step in x (N,), zero where held, and the decrease of vᵀPv that it promises."""
    design = matrix[:, free]
    size = np.sqrt(np.asarray(design.multiply(design).sum(axis=0)).ravel())
    size[size == 0.0] = 1.0
    scaled = design @ diags(1.0 / size)
    normal = (scaled.T @ scaled + damping * diags(np.ones(len(size)))).tocsc()
    right = scaled.T @ misclosure
    factor = splu(normal, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    solved = factor.solve(right)
    step = np.zeros(len(free))
    step[free] = solved / size
    return step, float(solved @ right)
