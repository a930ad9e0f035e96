"""Directions of the unknowns that no observation notices, measured so that rounding cannot hide them or make them up.

The measure of a direction v is λ = |A·v|² / |D·v|², A the whitened design matrix and D its column lengths: it knows no
units and no order. The normal matrix holds λ down to its rounding only, some 1e-15; v itself, put through the design
matrix, gives √λ down to the same. So directions are looked for with a factor of the normal matrix and judged by the
design matrix: what is free then stands at 1e-20 and below, what is determined far above `NOT_DETERMINED`.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh

from aerotri.adjustment._null_space_kernels import add_products
from aerotri.adjustment.kernel_records import Directions, Problem, Work
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.point_sides import expand_sides
from aerotri.adjustment.reduced_equations import NormalEquations
from aerotri.adjustment.robust import Estimator
from aerotri.adjustment.sparse_cholesky import BorderedMatrix, Factor
from aerotri.adjustment.unknowns import State

NOT_DETERMINED = 1e-13
"""λ below which a direction counts as free: rounding of the normal matrix would leave its σ without a sure digit."""
SUSPECT = 1e-10
"""Estimate of the smallest λ, by the factor alone, below which the directions are measured."""
REGULARISATION = 1e-8
"""Share of the diagonal added so that a singular matrix has a factor [C]: far above its rounding, and not above
`CANDIDATE`, beyond which it would hide the weak directions that are sought."""
CANDIDATE = 1e-8
"""λ by the factor below which a direction is measured by the design matrix."""
FIRST_SUBSPACE, LAST_SUBSPACE = 21, 168
"""Directions looked for at first, three times the seven motions of a block, and at most [C]: they are doubled while
all turn out to be free. With more defects than the last the block is named as undetermined anyway."""


def smallest_eigenvalue(factor: Factor, diagonal: np.ndarray) -> float:
    """Estimate of the smallest λ of the reduced matrix, by inverse iteration with the factor.

    Never below the smallest eigenvalue of the matrix as it was factorised; far smaller than the others it is found at
    once, whatever the pivots are.

    Parameters
    ----------
    diagonal : (size,) of the normal matrix before the points are eliminated.
    """
    length = np.sqrt(diagonal)
    direction, largest = np.random.default_rng(0).normal(size=len(diagonal)), 0.0
    for _ in range(2):
        direction /= np.linalg.norm(direction)
        image = length * factor.solve(length * direction)
        if not np.isfinite(image).all():
            return 0.0
        # its length is nearer to the largest than its share along the direction
        largest, direction = float(np.linalg.norm(image)), image
    return 1.0 / max(largest, 1e-300)


def free_directions(
    system: NormalSystem, state: State, equations: NormalEquations, estimator: Estimator, also: np.ndarray
) -> np.ndarray:
    """(size, k) directions of the reduced unknowns, orthonormal after multiplication by D, with λ < NOT_DETERMINED.

    Parameters
    ----------
    also : (size, ·) directions to be measured whatever the factor says of them.

    Raises
    ------
    NotPositiveDefiniteError
        Where the points' elimination left no digit of the matrix.
    """
    length = np.sqrt(equations.diagonal)
    factor = _regularised(system, equations)
    wanted = FIRST_SUBSPACE
    while True:
        basis = _weak_directions(factor, length, min(wanted, len(length)), also)
        found = _measured(system, state, equations, estimator, basis) if basis.shape[1] else basis
        if found.shape[1] < wanted or wanted >= min(LAST_SUBSPACE, len(length)):
            return found
        wanted *= 2


def _regularised(system: NormalSystem, equations: NormalEquations) -> Factor:
    """Factor of the matrix with REGULARISATION·D² added."""
    matrix = equations.matrix
    n, diagonal = len(system.unknowns.images), np.arange(6)
    blocks, corner = matrix.blocks.copy(), matrix.corner.copy()
    blocks[:n, diagonal, diagonal] += REGULARISATION * equations.diagonal[: 6 * n].reshape(n, 6)
    corner[np.diag_indices_from(corner)] += REGULARISATION * equations.diagonal[6 * n :]
    return system.factorise_like(equations, BorderedMatrix(blocks, matrix.border, corner))


def _weak_directions(factor: Factor, length: np.ndarray, count: int, also: np.ndarray) -> np.ndarray:
    """(size, k) orthonormal directions, in unknowns multiplied by `length`, that the factor holds for weak."""
    start = np.random.default_rng(0).normal(size=(len(length), count))
    basis = np.linalg.qr(np.hstack([also * length[:, None], start])[:, : len(length)])[0]
    for _ in range(4):
        basis = np.linalg.qr(length[:, None] * factor.solve(length[:, None] * basis))[0]
    image = length[:, None] * factor.solve(length[:, None] * basis)
    eigenvalue, turn = np.linalg.eigh(0.5 * (basis.T @ image + image.T @ basis))
    return (basis @ turn)[:, 1.0 / np.maximum(eigenvalue, 1e-300) - REGULARISATION < CANDIDATE]


def _measured(
    system: NormalSystem, state: State, equations: NormalEquations, estimator: Estimator, basis: np.ndarray
) -> np.ndarray:
    """Of the span of `basis`, in unknowns multiplied by their lengths, the part with λ < NOT_DETERMINED."""
    length = np.sqrt(equations.diagonal)
    effect, size = products(system, state, equations, estimator, basis / length[:, None])
    value, turn = eigh(effect, size)
    free = basis @ turn[:, value < NOT_DETERMINED]
    return np.linalg.qr(free)[0] if free.shape[1] else free


def products(
    system: NormalSystem, state: State, equations: NormalEquations, estimator: Estimator, directions: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """VᵀAᵀA·V and VᵀD²V (k, k) of directions (size, k) of the reduced unknowns, every point following as it likes."""
    u = system.unknowns
    n, k = len(u.images), directions.shape[1]
    images = np.ascontiguousarray(directions[: 6 * n].reshape(n, 6, k))
    shared = np.ascontiguousarray(directions[6 * n :])
    points = expand_sides(system, state, images, shared, np.zeros((len(u.points), 3, k)), estimator)
    sums: dict[int, tuple[np.ndarray, np.ndarray]] = {}

    def chunk(first: int, last: int, problem: Problem, work: Work) -> None:
        own = np.zeros((k, k)), np.zeros((k, k))
        add_products(first, last, problem, Directions(images, shared, points), *own, work)
        sums[first] = own

    system.over_points(system.problem(state, estimator), chunk)
    effect = np.sum([sums[first][0] for first in sorted(sums)], axis=0) + system.products_beside(state, images, shared)
    size = np.sum([sums[first][1] for first in sorted(sums)], axis=0)
    return effect, size + directions.T @ (equations.diagonal[:, None] * directions)
