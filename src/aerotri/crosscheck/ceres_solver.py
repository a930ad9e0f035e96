"""The independent adjustment solved by Ceres: one cost function an object point, its rays evaluated together.

pyceres is an extra and is imported by this module alone, which is itself imported only where a check runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from aerotri.crosscheck.paper_block import Antennas, Owner, PaperBlock
from aerotri.crosscheck.paper_rays import linearise, linearise_antenna, predict
from aerotri.crosscheck.paper_system import PaperSolution, observed_entries
from aerotri.crosscheck.paper_unknowns import Layout
from aerotri.signal_handlers import handlers_kept

with handlers_kept():
    import pyceres

MAX_ITERATIONS = 60
"""Of Ceres [C]: the blocks of benchmark_adjust.md take it 3 to 8; a cross-check that needs 60 says 'not converged'."""
FUNCTION_TOLERANCE = 1e-13
"""Relative change of vᵀPv that ends the iteration [C]: just above the rounding of a sum of squares; a larger one would
leave differences that are not errors of the adjustment compared."""


def solver_options(threads: int) -> Any:
    """Ceres' options: SPARSE_SCHUR, hardly damped from the start, until the cost stands still."""
    options = pyceres.SolverOptions()
    options.linear_solver_type = pyceres.LinearSolverType.SPARSE_SCHUR
    options.initial_trust_region_radius = 1e12
    options.function_tolerance = FUNCTION_TOLERANCE
    options.gradient_tolerance = 0.0
    options.parameter_tolerance = 0.0
    options.max_num_iterations = MAX_ITERATIONS
    options.num_threads = threads
    options.logging_type = pyceres.LoggingType.SILENT
    return options


def run_solver(problem: Any, threads: int) -> tuple[float, int, bool]:
    """vᵀPv (twice Ceres' cost) at the minimum, the number of iterations, and whether Ceres calls it converged."""
    summary = pyceres.SolverSummary()
    pyceres.solve(solver_options(threads), problem, summary)
    converged = summary.termination_type == pyceres.TerminationType.CONVERGENCE
    # Ceres counts the evaluation of the start as a step
    return 2.0 * summary.final_cost, summary.num_successful_steps + summary.num_unsuccessful_steps - 1, converged


def solve_with_ceres(paper: PaperBlock, layout: Layout, start: np.ndarray) -> PaperSolution:
    """Minimise vᵀPv by Ceres from `start` (N,)."""
    x, spans = start.copy(), paper.shared.spans()
    problem = pyceres.Problem()
    costs = [*_point_costs(paper, layout, x, spans), *_observed_costs(paper, layout, x, spans)]
    costs += _antenna_costs(paper, layout, x, spans)
    for cost in costs:
        problem.add_residual_block(cost, None, cost.blocks)
    manifolds = _hold(problem, layout, x, spans)
    # the costs are Python: more threads would only wait for the interpreter
    vtpv, iterations, converged = run_solver(problem, 1)
    del manifolds
    return PaperSolution(x, vtpv, iterations, converged, "Ceres, SPARSE_SCHUR")


def _hold(problem: Any, layout: Layout, x: np.ndarray, spans: dict[Owner, slice]) -> list[Any]:
    """Hold what is not free; blocks are pieces of x."""
    pieces = [*layout.poses, *(layout.shared[span] for span in spans.values()), *layout.points]
    manifolds = []
    for piece in pieces:
        held = np.flatnonzero(~layout.free[piece])
        block = x[piece[0] : piece[-1] + 1]
        if not len(held) or not problem.has_parameter_block(block):
            continue
        if len(held) == len(piece):
            problem.set_parameter_block_constant(block)
        else:
            manifolds.append(pyceres.SubsetManifold(len(piece), held.tolist()))
            problem.set_manifold(block, manifolds[-1])
    return manifolds


@dataclass(frozen=True, eq=False)
class _LocalEntries:
    """Shared entries of the rays of a point, counted within the blocks they lie in.

    Parameters
    ----------
    owners : the blocks. size : of all together. elements : (k, 24). linear : (k, q), `size` where there is none.
    """

    owners: tuple[Owner, ...]
    size: int
    elements: np.ndarray
    linear: np.ndarray


def _local_entries(paper: PaperBlock, setups: np.ndarray, spans: dict[Owner, slice]) -> _LocalEntries:
    elements, linear = paper.rays.elements[setups], paper.rays.linear[setups]
    touched = set(elements.ravel().tolist()) | set(linear.ravel().tolist())
    owners = tuple(owner for owner, span in spans.items() if touched & set(range(span.start, span.stop)))
    local = np.full(len(paper.shared.names) + 1, 0)
    size = 0
    for owner in owners:
        span = spans[owner]
        local[span] = size + np.arange(span.stop - span.start)
        size += span.stop - span.start
    local[-1] = size
    return _LocalEntries(owners, size, local[elements], local[linear])


def _point_costs(paper: PaperBlock, layout: Layout, x: np.ndarray, spans: dict[Owner, slice]) -> list[_PointCost]:
    bounds = np.searchsorted(paper.rays.point, np.arange(len(paper.points) + 1))
    known: dict[bytes, _LocalEntries] = {}
    costs = []
    for first, last in zip(bounds[:-1].tolist(), bounds[1:].tolist(), strict=True):
        setups = paper.rays.setup[first:last]
        key = setups.tobytes()
        if key not in known:
            known[key] = _local_entries(paper, setups, spans)
        costs.append(_PointCost(paper, layout, x, spans, slice(first, last), known[key]))
    return costs


class _PointCost(pyceres.CostFunction):  # pyright: ignore[reportUntypedBaseClass] -- pyceres has no types
    """The rays of one object point. Blocks: the point, a pose for each ray, the shared blocks its rays depend on."""

    def __init__(
        self,
        paper: PaperBlock,
        layout: Layout,
        x: np.ndarray,
        spans: dict[Owner, slice],
        rows: slice,
        local: _LocalEntries,
    ):
        super().__init__()
        rays, image = paper.rays, paper.rays.image[rows]
        self._order, self._active, self._local = paper.order, layout.active, local
        self._mount = None if layout.mount is None else layout.mount[image]
        self._xy, self._inv_sigma, self._patterns = rays.xy[rows], rays.inv_sigma[rows], rays.patterns[rows]
        self._at = rays.at[rows]
        self._rays = len(image)
        shared = int(layout.shared[0])
        point = layout.points[rays.point[rows.start]]
        self.blocks = [x[point[0] : point[2] + 1]]
        self.blocks += [x[6 * i : 6 * i + 6] for i in image.tolist()]
        self.blocks += [x[shared + spans[owner].start : shared + spans[owner].stop] for owner in local.owners]
        self.set_num_residuals(2 * len(image))
        self.set_parameter_block_sizes([len(block) for block in self.blocks])

    def Evaluate(
        self, parameters: Sequence[np.ndarray], residuals: np.ndarray, jacobians: Sequence[np.ndarray] | None
    ) -> bool:
        """Residuals predicted − measured in σ; partials where they are asked for."""
        k, local = self._rays, self._local
        pose, shared = np.array(parameters[1 : k + 1]), np.concatenate([*parameters[k + 1 :], [0.0]])
        point, elements = np.broadcast_to(parameters[0], (k, 3)), shared[local.elements]
        linear = np.einsum("kiq,kq->ki", self._patterns, shared[local.linear])
        if jacobians is None:
            ideal = predict(pose, self._mount, point, elements, self._at, self._order)
            residuals[:] = ((np.stack(ideal, axis=1) + linear - self._xy) * self._inv_sigma).ravel()
            return True
        prediction, by_pose, by_elements = linearise(
            pose, self._mount, point, elements, self._at, self._order, self._active
        )
        inv_sigma = self._inv_sigma[:, :, None]
        residuals[:] = ((prediction + linear - self._xy) * self._inv_sigma).ravel()
        by_pose = by_pose * inv_sigma
        jacobians[0][:] = -by_pose[:, :, :3].ravel()
        for ray in range(k):
            own = np.zeros((2 * k, 6))
            own[2 * ray : 2 * ray + 2] = by_pose[ray]
            jacobians[1 + ray][:] = own.ravel()
        by_shared = np.zeros((k, 2, local.size + 1))
        ray, axis = np.arange(k)[:, None, None], np.arange(2)[:, None]
        by_shared[ray, axis, local.linear[:, None, :]] = self._patterns * inv_sigma
        by_shared[ray, axis, local.elements[:, None, self._active]] = by_elements * inv_sigma
        first = 0
        for jacobian in jacobians[k + 1 :]:
            size = len(jacobian) // (2 * k)
            jacobian[:] = by_shared[:, :, first : first + size].ravel()
            first += size
        return True


class ObservedCost(pyceres.CostFunction):  # pyright: ignore[reportUntypedBaseClass] -- pyceres has no types
    """Directly observed elements of one block: (x − value)/σ."""

    def __init__(self, block: np.ndarray, places: np.ndarray, value: np.ndarray, inv_sigma: np.ndarray):
        super().__init__()
        self.blocks = [block]
        self._places, self._value, self._inv_sigma = places, value, inv_sigma
        self._partials = np.zeros((len(places), len(block)))
        self._partials[np.arange(len(places)), places] = inv_sigma
        self.set_num_residuals(len(places))
        self.set_parameter_block_sizes([len(block)])

    def Evaluate(
        self, parameters: Sequence[np.ndarray], residuals: np.ndarray, jacobians: Sequence[np.ndarray] | None
    ) -> bool:
        residuals[:] = (parameters[0][self._places] - self._value) * self._inv_sigma
        if jacobians is not None:
            jacobians[0][:] = self._partials.ravel()
        return True


def _observed_costs(paper: PaperBlock, layout: Layout, x: np.ndarray, spans: dict[Owner, slice]) -> list[ObservedCost]:
    place, value, inv_sigma = observed_entries(paper, layout)
    shared = int(layout.shared[0])
    spans_in_x = [(shared + span.start, shared + span.stop) for span in spans.values()]
    spans_in_x += [(int(row[0]), int(row[2]) + 1) for row in layout.points]
    first = np.array([begin for begin, _ in spans_in_x])
    owner = np.searchsorted(first, place, side="right") - 1
    costs = []
    for number in np.unique(owner).tolist():
        begin, end = spans_in_x[number]
        own = owner == number
        costs.append(ObservedCost(x[begin:end], place[own] - begin, value[own], inv_sigma[own]))
    return costs


class _AntennaCost(pyceres.CostFunction):  # pyright: ignore[reportUntypedBaseClass] -- pyceres has no types
    """One observed antenna. Blocks: the pose, and the block of shifts and drifts where there is one."""

    def __init__(self, a: Antennas, order: str, layout: Layout, x: np.ndarray, spans: dict[Owner, slice], g: int):
        super().__init__()
        self._order, self._lever_arm = order, a.lever_arm
        self._mount = None if layout.mount is None else layout.mount[a.image[g], None]
        self._xyz, self._inv_sigma = a.xyz[g], a.inv_sigma[g]
        image, shared = int(a.image[g]), int(layout.shared[0])
        self.blocks = [x[6 * image : 6 * image + 6]]
        self._by_shared = np.zeros((3, 0))
        entries = np.stack([a.shift[g], a.drift[g]])
        if (entries >= 0).any():
            span = next(span for span in spans.values() if span.start <= entries.max() < span.stop)
            self.blocks.append(x[shared + span.start : shared + span.stop])
            self._by_shared = np.zeros((3, span.stop - span.start))
            for row, factor in zip(entries, (1.0, a.since[g]), strict=True):
                axes = np.flatnonzero(row >= 0)
                self._by_shared[axes, row[axes] - span.start] = factor
        self.set_num_residuals(3)
        self.set_parameter_block_sizes([len(block) for block in self.blocks])

    def Evaluate(
        self, parameters: Sequence[np.ndarray], residuals: np.ndarray, jacobians: Sequence[np.ndarray] | None
    ) -> bool:
        """Residuals predicted − measured in σ, 0 for a coordinate that was not observed."""
        position, by_pose = linearise_antenna(parameters[0][None, :], self._mount, self._lever_arm, self._order)
        if len(parameters) > 1:
            position = position + self._by_shared @ parameters[1]
        residuals[:] = (position[0] - self._xyz) * self._inv_sigma
        if jacobians is not None:
            jacobians[0][:] = (by_pose[0] * self._inv_sigma[:, None]).ravel()
            for jacobian in jacobians[1:]:
                jacobian[:] = (self._by_shared * self._inv_sigma[:, None]).ravel()
        return True


def _antenna_costs(paper: PaperBlock, layout: Layout, x: np.ndarray, spans: dict[Owner, slice]) -> list[_AntennaCost]:
    a = paper.antennas
    if a is None:
        return []
    return [_AntennaCost(a, paper.order, layout, x, spans, g) for g in range(len(a.image))]
