"""Our adjustment, phase by phase."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from adjusting.blocks import Start, common_start, load_block, spec_of
from adjusting.child import Memory, Timer
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.ray_status import ray_status
from aerotri.adjustment.solve import Solution, SolveOptions, minimise
from aerotri.adjustment.start_values import local_origin
from aerotri.adjustment.system import build_system
from aerotri.adjustment.unknowns import StartValues
from aerotri.functional_model.additional_parameters import parse_parameters
from aerotri.observations import Block
from aerotri.simulation import parse_spec, simulate
from aerotri.statistics.covariance import cofactors
from aerotri.statistics.summarise import count_observations, summarise

PARAMETERS = {"none": "none", "44": "bluh:1-12,ultracam_d:42-73"}
WARM_UP = 30


def with_parameters(block: Block, name: str) -> Block:
    """The block with a set of additional parameters to be estimated."""
    adjustment = replace(block.settings.adjustment, additional_parameters=parse_parameters(PARAMETERS[name]))
    return replace(block, settings=replace(block.settings, adjustment=adjustment))


def start_values(block: Block, start: Start) -> StartValues:
    """The common start, reduced to the local origin."""
    origin = local_origin(block)
    return StartValues(origin, start.rotation, start.centre - origin, start.points - origin)


def run(block: Block, start: Start, timer: Timer) -> dict[str, Any]:
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


def _gauss_newton(system: NormalSystem, solution: Solution) -> None:
    """One whole iteration, with a factor of its own."""
    equations = system.assemble(solution.state, 0.0, solution.estimator)
    x = system.factorise(equations).solve(equations.right)
    step = system.back_substitute(solution.state, x, 0.0, solution.estimator)
    system.unknowns.advance(solution.state, step)


def measure(folder: Path, job: dict[str, Any]) -> dict[str, Any]:
    """Times and peak memory of our adjustment; kernels are compiled or loaded before the clock starts."""
    small, _ = simulate(parse_spec(spec_of(WARM_UP)), 1)
    run(with_parameters(small, job["parameters"]), common_start(small), Timer())
    memory, timer = Memory(), Timer()
    block, start = load_block(folder)
    outcome = run(with_parameters(block, job["parameters"]), start, timer)
    return {"seconds": timer.seconds, "peak": memory.peak, "rays": len(block.image_points), **outcome}
