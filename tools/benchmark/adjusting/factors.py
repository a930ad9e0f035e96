"""The factor of our reduced normal matrix by other libraries: CHOLMOD (cvxopt) and Pardiso (pypardiso, MKL).

Measures one factorisation of the normal equations: imports inside on purpose.
"""

from __future__ import annotations

import os
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix

import aerotri
from adjusting.blocks import common_start, load_block, plan_of
from adjusting.ours import WARM_UP, start_values, with_parameters
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.ray_status import ray_status
from aerotri.adjustment.robust import LEAST_SQUARES
from aerotri.adjustment.system import build_system

B = 6
REPEATS = 5


def measure(folder: Path, job: dict[str, Any]) -> dict[str, Any]:
    """Seconds of one numeric factorisation and one solution, medians of five, and the error of the solution."""
    small = aerotri.simulate(plan_of(WARM_UP), 1).block
    for block, start in ((small, common_start(small)), load_block(folder)):
        block = with_parameters(block, job["parameters"])
        values = start_values(block, start)
        system, state = build_system(block, values, ray_status(block, values)[0])
        equations = system.assemble(state, 0.0, LEAST_SQUARES)
        system.factorise(equations)
    matrix = lower_triangle(system, equations)
    scale = 1.0 / np.sqrt(matrix.diagonal())
    scaled = csc_matrix(matrix.multiply(scale[:, None]).multiply(scale[None, :]))
    right = equations.right * scale
    found = {"ours": _ours(system, equations, scale)}
    libraries: dict[str, Callable[[], dict[str, Any]]] = {
        "CHOLMOD (cvxopt)": lambda: _cholmod(scaled, right, _our_ordering(system)),
        "Pardiso (MKL)": lambda: _pardiso(scaled, right),
    }
    for name, function in libraries.items():
        try:
            found[name] = function()
        except ImportError as missing:
            found[name] = {"missing": str(missing)}
    for entry in found.values():
        solution = entry.pop("solution", None)
        if solution is not None:
            residual = scaled @ solution + scaled.T @ solution - scaled.diagonal() * solution - right
            entry["error"] = float(np.abs(residual).max() / np.abs(right).max())
    return {"factors": found, "unknowns": len(right), "flops": float(getattr(system.symbolic, "flops", np.nan))}


def lower_triangle(system: NormalSystem, equations: Any) -> csc_matrix:
    """The reduced matrix, bordered by the shared parameters, as a lower triangle."""
    u, matrix = system.unknowns, equations.matrix
    row, column = np.meshgrid(np.arange(B), np.arange(B), indexing="ij")
    # a block (i, j) with i ≤ j stands in the upper triangle: written transposed
    rows = (B * u.block_col[:, None, None] + column).ravel()
    columns = (B * u.block_row[:, None, None] + row).ravel()
    values = matrix.blocks.ravel()
    n, s = B * len(u.images), len(u.shared)
    border = np.swapaxes(matrix.border, 1, 2).reshape(n, s)
    rows = np.concatenate([rows, np.repeat(n + np.arange(s), n), np.repeat(n + np.arange(s), s)])
    columns = np.concatenate([columns, np.tile(np.arange(n), s), np.tile(n + np.arange(s), s)])
    values = np.concatenate([values, border.T.ravel(), matrix.corner.ravel()])
    keep = (rows >= columns) & (values != 0.0)
    return csc_matrix(coo_matrix((values[keep], (rows[keep], columns[keep])), shape=(n + s, n + s)))


def _our_ordering(system: NormalSystem) -> np.ndarray:
    """Nested dissection of the photographs, offered to CHOLMOD, which takes it or its own, whichever fills less."""
    order = system.symbolic.tree.order
    n, s = B * len(order), len(system.unknowns.shared)
    return np.concatenate([(B * order[:, None] + np.arange(B)).ravel(), n + np.arange(s)])


def _timed(numeric: Callable[[], Any], solve: Callable[[], np.ndarray], symbolic: float) -> dict[str, Any]:
    factor, solution = [], []
    result = np.zeros(0)
    for _ in range(REPEATS):
        begun = time.perf_counter()
        numeric()
        factor.append(time.perf_counter() - begun)
        begun = time.perf_counter()
        result = solve()
        solution.append(time.perf_counter() - begun)
    return {
        "symbolic": symbolic,
        "factor": statistics.median(factor),
        "spread": [min(factor), max(factor)],
        "solve": statistics.median(solution),
        "solution": result,
    }


def _ours(system: NormalSystem, equations: Any, scale: np.ndarray) -> dict[str, Any]:
    kept: dict[str, Any] = {}

    def numeric() -> None:
        kept["factor"] = system.factorise(equations)

    return _timed(numeric, lambda: kept["factor"].solve(equations.right) / scale, np.nan)


def _cholmod(lower: csc_matrix, right: np.ndarray, ordering: np.ndarray) -> dict[str, Any]:
    from cvxopt import cholmod, matrix, spmatrix  # type: ignore[import-not-found]

    entries = lower.tocoo()
    a = spmatrix(entries.data, entries.row, entries.col, lower.shape)
    cholmod.options["supernodal"] = 2
    begun = time.perf_counter()
    factor = cholmod.symbolic(a, matrix(ordering.tolist()))
    symbolic = time.perf_counter() - begun

    def solve() -> np.ndarray:
        x = matrix(right)
        cholmod.solve(factor, x)
        return np.array(x).ravel()

    return _timed(lambda: cholmod.numeric(a, factor), solve, symbolic)


def _pardiso(lower: csc_matrix, right: np.ndarray) -> dict[str, Any]:
    _find_mkl()
    from pypardiso import PyPardisoSolver  # type: ignore[import-not-found]

    # 2: symmetric positive definite, of which Pardiso takes the upper triangle by rows
    upper = lower.T.tocsr()
    upper.sort_indices()
    solver = PyPardisoSolver(mtype=2)
    nothing = np.zeros((upper.shape[0], 1))

    def phase(number: int, side: np.ndarray) -> np.ndarray:
        solver.set_phase(number)
        return solver._call_pardiso(upper, side)

    begun = time.perf_counter()
    phase(11, nothing)
    symbolic = time.perf_counter() - begun
    return _timed(lambda: phase(22, nothing), lambda: phase(33, right[:, None].copy()).ravel(), symbolic)


def _find_mkl() -> None:
    """pypardiso looks for MKL beside the running program; here it may lie beside pypardiso."""
    found = [library for folder in sys.path for library in Path(folder).parent.parent.glob("libmkl_rt*")]
    if found:
        os.environ.setdefault("PYPARDISO_MKL_RT", str(found[0]))
