"""The independent adjustment solved by Ceres: one cost function an object point, its rays evaluated together.

pyceres is imported here and in `colmap_problem` only, and only when a check runs.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from aerotri.crosscheck.paper_block import PaperBlock
from aerotri.crosscheck.paper_rays import linearise, linearise_antenna
from aerotri.crosscheck.paper_system import PaperSolution, observed_entries
from aerotri.crosscheck.paper_unknowns import Layout

MAX_ITERATIONS = 60
FUNCTION_TOLERANCE = 1e-14


def solver_options(pyceres: Any, threads: int) -> Any:
    """Ceres' options: SPARSE_SCHUR, undamped from the start, to a standstill of the cost."""
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


def solve_with_ceres(paper: PaperBlock, layout: Layout, start: np.ndarray) -> PaperSolution:
    """Minimise vᵀPv by Ceres.

    Raises
    ------
    ImportError
        When pyceres is not installed.
    """
    import pyceres

    problem = pyceres.Problem()
    values = _Values(paper, layout, start)
    costs = _cost_classes(pyceres)
    keep = [costs.point(paper, layout, values, row) for row in range(len(paper.points))]
    keep += costs.others(paper, layout, values)
    for cost in keep:
        problem.add_residual_block(cost, None, cost.blocks)
    values.hold(pyceres, problem, layout)
    summary = pyceres.SolverSummary()
    # the costs are Python: more threads would only wait for the interpreter
    pyceres.solve(solver_options(pyceres, 1), problem, summary)
    converged = summary.termination_type == pyceres.TerminationType.CONVERGENCE
    iterations = summary.num_successful_steps + summary.num_unsuccessful_steps - 1
    return PaperSolution(values.x(start), 2.0 * summary.final_cost, iterations, converged, "Ceres")
