"""Our adjustment, phase by phase.

Measures assembly, factorisation, iterations and cofactors one by one: imports inside on purpose.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import aerotri
from adjusting.blocks import Start, common_start, load_block, plan_of
from adjusting.child import Memory, Timer
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.panels import SINGLE
from aerotri.adjustment.ray_status import ray_status
from aerotri.adjustment.robust import LEAST_SQUARES
from aerotri.adjustment.solve import Solution, SolveOptions, minimise
from aerotri.adjustment.start_values import local_origin
from aerotri.adjustment.system import build_system
from aerotri.adjustment.unknowns import StartValues
from aerotri.statistics.covariance import cofactors
from aerotri.statistics.summarise import count_observations, summarise

PARAMETERS = {"none": "none", "44": "bluh:1-12,ultracam_d:42-73"}
WARM_UP = 30


def with_parameters(block: aerotri.Block, name: str) -> aerotri.Block:
    """The block with a set of additional parameters to be estimated."""
    return aerotri.with_settings(block, parameters=PARAMETERS[name])


def start_values(block: aerotri.Block, start: Start) -> StartValues:
    """The common start, reduced to the local origin."""
    origin = local_origin(block)
    return StartValues(origin, start.rotation, start.centre - origin, start.points - origin)


def run(block: aerotri.Block, start: Start, timer: Timer) -> dict[str, Any]:
    """Adjust and take statistics; every phase timed."""
    with timer.phase("prepare"):
        values = start_values(block, start)
        status, _ = ray_status(block, values)
        system, state = build_system(block, values, status)
    redundancy = count_observations(system).redundancy
    with timer.phase("iterations"):
        solution = minimise(system, state, redundancy, SolveOptions())
    with timer.phase("iteration"):
        _gauss_newton(system, solution)
    with timer.phase("sigmas"):
        cofactors(system, solution.state, system.factorise(solution.equations), solution.estimator)
    with timer.phase("statistics"):
        factor = system.factorise(solution.equations)
        result = summarise(system, solution, factor, status, ())
    return {
        "status": solution.status,
        "iterations": solution.iterations,
        "vtpv": result.outcome.vtpv,
        "sigma0": result.outcome.sigma0,
        "redundancy": redundancy,
        "unknowns": result.outcome.unknowns,
    }


def _load_kernels(block: aerotri.Block, start: Start) -> None:
    """Those of factors in single precision, which the small block is too small for."""
    values = start_values(block, start)
    system, state = build_system(block, values, ray_status(block, values)[0])
    equations = system.assemble(state, 0.0, LEAST_SQUARES)
    system.factorise(equations, SINGLE).solve(equations.right)


def _gauss_newton(system: NormalSystem, solution: Solution) -> None:
    """One whole iteration, with a factor of its own."""
    equations = system.assemble(solution.state, 0.0, solution.estimator)
    x = system.factorise(equations).solve(equations.right)
    step = system.back_substitute(solution.state, x, 0.0, solution.estimator)
    system.unknowns.advance(solution.state, step)


def measure(folder: Path, job: dict[str, Any]) -> dict[str, Any]:
    """Times and peak memory of our adjustment; kernels are compiled or loaded before the clock starts."""
    small = aerotri.simulate(plan_of(WARM_UP), 1).block
    run(with_parameters(small, job["parameters"]), common_start(small), Timer())
    _load_kernels(with_parameters(small, job["parameters"]), common_start(small))
    memory, timer = Memory(), Timer()
    block, start = load_block(folder)
    outcome = run(with_parameters(block, job["parameters"]), start, timer)
    return {"seconds": timer.seconds, "peak": memory.peak, "rays": len(block.image_points), **outcome}
