"""A block that observations of large σ alone hold in place: its factor keeps its digits, its σ are large.

The normal matrix N adds up what rays say of the block's shape and what control and the like say of its place. Where the
latter is 10¹³ times less it drowns in rounding, although nothing is free. Therefore d coordinates of photographs are
held beside, as a minimal datum would: N_s = N + UUᵀ has all its digits. With the d motions G that the rays do not
notice, F = N·G is computed from the other observations alone, free of rounding, and exactly

    N⁻¹ = N_s⁻¹ + Z·K⁻¹·Zᵀ,  Z = G − N_s⁻¹F,  K = GᵀF − FᵀN_s⁻¹F.

[D] From N_s·G = F + U·(UᵀG) and the formula of Sherman, Morrison and Woodbury; no difference of large numbers is left.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import qr

from aerotri.adjustment.block_motions import WeakMotions, weak_motions
from aerotri.adjustment.chunk_sums import add_gaps
from aerotri.adjustment.kernel_records import Inverse
from aerotri.adjustment.point_sides import reduced_sides
from aerotri.adjustment.robust import Estimator
from aerotri.adjustment.sparse_cholesky import BorderedMatrix, Factor, NotPositiveDefiniteError
from aerotri.adjustment.unknowns import State
from aerotri.functional_model.observed_unknowns import Rows

if TYPE_CHECKING:
    from aerotri.adjustment.normal_equations import NormalSystem
    from aerotri.adjustment.reduced_equations import NormalEquations

WEAKEST = 1e-11
"""λ of a motion of the whole block from which on the normal matrix holds it to four digits or better."""
WEAK = 1e-8
"""λ below which motions are held beside, where the weakest lies below `WEAKEST` [C]."""


def may_be_weak(factor: Factor | None, equations: NormalEquations) -> bool:
    """Whether motions of the whole block may be weaker than `WEAKEST`, by the smallest pivot: n times λ or less."""
    return factor is None or factor.smallest_pivot < WEAKEST * len(equations.diagonal)


def weak_factor(
    system: NormalSystem, equations: NormalEquations, at: tuple[State, Estimator],
    factorise: Callable[[BorderedMatrix], Factor],
) -> WeakFactor | None:  # fmt: skip
    """The factor of equations that hold the whole block hardly; None where they hold it well, or not at all.

    Parameters
    ----------
    at : where the equations were assembled, undamped. factorise : of matrices like that of the equations.
    """
    state, estimator = at
    if not equations.are_numbers:
        return None
    motions = weak_motions(system, state, equations.diagonal, WEAK)
    if motions is None or motions.weakest >= WEAKEST:
        return None
    pulls = _pulls(system, state, estimator, motions)
    stiff = factorise(_held_beside(system, equations, motions))
    return WeakFactor(stiff, motions.reduced, pulls, equations.matrix)


def _pulls(system: NormalSystem, state: State, estimator: Estimator, motions: WeakMotions) -> np.ndarray:
    """(size, d) F = N·G of the reduced normal matrix: of all observations but the rays, which do not notice G."""
    u, d = system.unknowns, motions.reduced.shape[1]
    n = len(u.images)
    images, shared = motions.reduced[: 6 * n].reshape(n, 6, d), motions.reduced[6 * n :]
    pulls_images, pulls_shared = np.where(u.eo_free[:, :, None], 0.0, images), system.priors.pulls(shared)
    rows = [(observed, _along(observed, images, shared)) for observed in system.whitened_rows(state)]
    ties = system.tie_rows(state)
    for k in range(d):
        right, right_shared = np.zeros((n, 6)), np.zeros(len(shared))
        for observed, value in rows:
            add_gaps(replace(observed, gap=value[:, :, k]), right, right_shared)
        if ties is not None and u.ties is not None:
            value = u.ties.along(ties, images[:, :, k : k + 1], shared[:, k : k + 1])[:, :, 0]
            u.ties.add_gaps(ties._replace(deviation=-value), right, right_shared)
        pulls_images[:, :, k] += right
        pulls_shared[:, k] += right_shared
    prior = np.where((u.kept < 0)[:, None], u.prior_weight, 0.0)
    known = np.flatnonzero(prior.any(axis=1))
    sides = prior[:, :, None] * motions.points
    of_points = reduced_sides(system, state, sides, estimator, known)
    return np.concatenate([pulls_images.reshape(6 * n, d), pulls_shared]) + of_points


def _along(observed: Rows, images: np.ndarray, shared: np.ndarray) -> np.ndarray:
    """(g, k, d) what directions change whitened observations by."""
    value = np.zeros((*observed.gap.shape, shared.shape[1]))
    own = observed.image >= 0
    value[own] = observed.by_image[own] @ images[observed.image[own]]
    for c in range(observed.columns.shape[1]):
        there = observed.columns[:, c] >= 0
        value[there] += observed.by_shared[there, :, c, None] * shared[observed.columns[there, c]][:, None, :]
    return value


def _held_beside(system: NormalSystem, equations: NormalEquations, motions: WeakMotions) -> BorderedMatrix:
    """The matrix with as many coordinates of photographs held as motions are weak: those moved most independently."""
    u, d, matrix = system.unknowns, motions.reduced.shape[1], equations.matrix
    n = 6 * len(u.images)
    length = np.sqrt(equations.diagonal[:n]) * u.eo_free.ravel()
    moved = np.linalg.qr(motions.reduced[:n] * length[:, None])[0]
    chosen = np.asarray(qr(moved.T, pivoting=True, mode="r")[-1], dtype=np.int64)[:d]
    blocks = matrix.blocks.copy()
    blocks[chosen // 6, chosen % 6, chosen % 6] += equations.diagonal[chosen]
    return BorderedMatrix(blocks, matrix.border, matrix.corner)


class WeakFactor(Factor):
    """A factor of equations that hardly hold the whole block; see above.

    Parameters
    ----------
    stiff : factor of N_s. motions : (size, d) G. pulls : (size, d) F. matrix : N.
    """

    def __init__(self, stiff: Factor, motions: np.ndarray, pulls: np.ndarray, matrix: BorderedMatrix):
        self._stiff, self._images = stiff, matrix.border.shape[0]
        self.smallest_pivot = stiff.smallest_pivot
        held = stiff.solve(pulls)
        k = motions.T @ pulls - pulls.T @ held
        value, turn = np.linalg.eigh(0.5 * (k + k.T))
        if not value.min() > 0.0:
            raise NotPositiveDefiniteError
        self._root, self._shape = ((part @ turn) / np.sqrt(value) for part in (motions - held, held))

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """x with N·x = rhs; rhs (size,) or (size, k)."""
        return self._stiff.solve(rhs) + self._root @ (self._root.T @ rhs)

    def half_solve(self, rhs: np.ndarray) -> np.ndarray:
        """H with HᵀH = rhsᵀ·N⁻¹·rhs."""
        return np.concatenate([self._stiff.half_solve(rhs), self._root.T @ rhs])

    def border_normals(self) -> np.ndarray:
        """(s, s) the normal matrix of the border with the photographs eliminated."""
        return np.linalg.inv(self.border_inverse())

    def border_inverse(self) -> np.ndarray:
        """(s, s) cofactors of the shared parameters."""
        shared = self._root[6 * self._images :]
        return self._stiff.border_inverse() + shared @ shared.T

    def columns(self, indices: np.ndarray) -> np.ndarray:
        """(size, k) columns of the inverse."""
        return self._stiff.columns(indices) + self._root @ self._root[indices].T

    def inverse_on_pattern(self) -> Inverse:
        """The inverse on the pattern of the matrix."""
        return self._with(self._root)

    def inverse_of_shape(self) -> Inverse:
        """As good for functions that no motion of the block changes, for which GᵀC = 0, and without rounding there."""
        return self._with(self._shape)

    def _with(self, root: np.ndarray) -> Inverse:
        """N_s⁻¹ + root·rootᵀ on the pattern."""
        inverse, (row, col) = self._stiff.inverse_on_pattern(), self._stiff.pattern
        images, shared = root[: 6 * self._images].reshape(self._images, 6, -1), root[6 * self._images :]
        return Inverse(
            inverse.blocks + images[row] @ np.swapaxes(images[col], 1, 2),
            inverse.border + shared[None] @ np.swapaxes(images, 1, 2),
            inverse.corner + shared @ shared.T,
        )
