"""The peers that adjust: Ceres with pycolmap's C++ reprojection cost, pycolmap's own adjuster, SciPy.

Measures other solvers on the equations of the independent model and on COLMAP's numbers of our points: imports inside
on purpose.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

import aerotri
from adjusting.blocks import load_block
from adjusting.child import Memory, Timer
from aerotri.formats.foreign.colmap import point_numbers

SCIPY_EVALUATIONS = 100
LSMR = {"atol": 1e-12, "btol": 1e-12, "maxiter": 5000}
"""With SciPy's own tolerances the steps are too coarse to reach the optimum within 300 evaluations."""
DEFAULT_RADIUS, UNDAMPED_RADIUS = 1e4, 1e12


def measure_ceres(folder: Path, job: dict[str, Any]) -> dict[str, Any]:
    """Ceres with its own trust region at the start."""
    return _measure_ceres(folder, job, DEFAULT_RADIUS)


def measure_ceres_undamped(folder: Path, job: dict[str, Any]) -> dict[str, Any]:
    """Ceres with a trust region so large that it begins as Gauss-Newton."""
    return _measure_ceres(folder, job, UNDAMPED_RADIUS)


def _measure_ceres(folder: Path, job: dict[str, Any], radius: float) -> dict[str, Any]:
    import pyceres
    import pycolmap  # noqa: F401 – loaded before the memory is looked at

    memory, timer = Memory(), Timer()
    block, model, sigma_px = _read(folder)
    with timer.phase("build"):
        adjuster = _adjuster(model, int(job["threads"]))
        problem = adjuster.problem
        priors = _add_control(problem, block, model, sigma_px)
    options = pyceres.SolverOptions()
    options.linear_solver_type = pyceres.LinearSolverType.SPARSE_SCHUR
    options.num_threads = int(job["threads"])
    options.initial_trust_region_radius = radius
    # the cost has to stand to 1e-9; Ceres' own tolerances may stop before
    options.function_tolerance, options.gradient_tolerance, options.parameter_tolerance = 1e-10, 0.0, 0.0
    options.max_num_iterations = 100
    options.logging_type = pyceres.LoggingType.SILENT
    summary = pyceres.SolverSummary()
    with timer.phase("solve"):
        pyceres.solve(options, problem, summary)
    del priors
    return {
        "seconds": timer.seconds,
        "peak": memory.peak,
        "rays": len(block.image_points),
        "status": str(summary.termination_type).rpartition(".")[2].lower(),
        "iterations": summary.num_successful_steps + summary.num_unsuccessful_steps - 1,
        "vtpv": 2.0 * summary.final_cost / sigma_px**2,
    }


def measure_pycolmap(folder: Path, job: dict[str, Any]) -> dict[str, Any]:
    """pycolmap's adjuster with its own options and stopping rule, control as priors in its problem."""
    import pyceres
    import pycolmap  # noqa: F401 – loaded before the memory is looked at

    memory, timer = Memory(), Timer()
    block, model, sigma_px = _read(folder)
    with timer.phase("build"):
        adjuster = _adjuster(model, int(job["threads"]))
        priors = _add_control(adjuster.problem, block, model, sigma_px)
    with timer.phase("solve"):
        summary = adjuster.solve()
    cost = 0.5 * float(np.sum(np.square(adjuster.problem.evaluate_residuals(pyceres.EvaluateOptions()))))
    del priors
    inner = getattr(summary, "ceres_summary", None)
    steps = None if inner is None else inner.num_successful_steps + inner.num_unsuccessful_steps - 1
    return {
        "seconds": timer.seconds,
        "peak": memory.peak,
        "rays": len(block.image_points),
        "status": str(summary.termination_type).rpartition(".")[2].lower(),
        "iterations": steps,
        "vtpv": 2.0 * cost / sigma_px**2,
    }


def _read(folder: Path) -> tuple[aerotri.Block, Any, float]:
    import pycolmap

    block, _ = load_block(folder)
    sigma_px = float(block.image_points.sigma[0, 0]) / block.cameras[0].pixel_mm
    return block, pycolmap.Reconstruction(folder / "colmap"), sigma_px


def _adjuster(model: Any, threads: int) -> Any:
    import pycolmap

    options = pycolmap.BundleAdjustmentOptions()
    options.refine_focal_length = options.refine_principal_point = options.refine_extra_params = False
    options.refine_sensor_from_rig = False
    options.print_summary = False
    options.ceres.solver_options.num_threads = threads
    config = pycolmap.BundleAdjustmentConfig()
    for image in model.images:
        config.add_image(image)
    return pycolmap.create_default_ceres_bundle_adjuster(options, config, model)


def _add_control(problem: Any, block: aerotri.Block, model: Any, sigma_px: float) -> list[Any]:
    """Control as Ceres' own prior on points, in the unit of the reprojection errors."""
    import pyceres

    number, control, kept = point_numbers(block.points), block.control, []
    for k in np.flatnonzero(~control.is_check).tolist():
        point = model.points3D[int(number[control.point[k]])]
        covariance = np.diag(control.sigma[k] ** 2) / sigma_px**2
        kept.append(pyceres.factors.NormalPrior(control.xyz[k], covariance))
        problem.add_residual_block(kept[-1], None, [point.xyz])
    return kept


def measure_scipy(folder: Path, job: dict[str, Any]) -> dict[str, Any]:
    """scipy.optimize.least_squares (trf, LSMR, sparse Jacobian) on the independent model's equations."""
    from scipy.optimize import least_squares

    from aerotri.crosscheck.paper_block import paper_block
    from aerotri.crosscheck.paper_system import whole_system
    from aerotri.crosscheck.paper_unknowns import KnownSolution, lay_out

    memory, timer = Memory(), Timer()
    block, start = load_block(folder)
    with timer.phase("build"):
        everything = np.ones(len(block.image_points), dtype=bool)
        paper = paper_block(block, everything, np.ones(len(everything)), np.zeros(3))
        held = np.zeros((len(paper.images), 6), dtype=bool)
        known = KnownSolution(start.centre, block.images.angles, start.points[paper.points], held, False)
        layout, x = lay_out(paper, known)
        x[layout.poses[:, :3]], x[layout.poses[:, 3:]] = start.centre, block.images.angles
        x[layout.points] = known.points
    values = x.copy()
    last: dict[str, Any] = {}

    def evaluate(free: np.ndarray) -> tuple[np.ndarray, Any]:
        if last.get("at") != (at := free.tobytes()):
            values[layout.free] = free
            misclosure, matrix = whole_system(paper, layout, values)
            last.update(at=at, both=(-misclosure, matrix[:, layout.free]))
        return last["both"]

    with timer.phase("solve"):
        found = least_squares(
            lambda free: evaluate(free)[0], x[layout.free], jac=lambda free: evaluate(free)[1],  # type: ignore[arg-type]
            method="trf", tr_solver="lsmr", x_scale="jac", ftol=1e-10, xtol=1e-15, gtol=1e-15,
            max_nfev=SCIPY_EVALUATIONS, tr_options=LSMR,
        )  # fmt: skip
    return {
        "seconds": timer.seconds,
        "peak": memory.peak,
        "rays": len(block.image_points),
        "status": "convergence" if found.status > 0 else "no convergence",
        "iterations": int(found.njev),
        "vtpv": 2.0 * float(found.cost),
        "threads": os.environ.get("OMP_NUM_THREADS", ""),
    }
