"""Cofactors of all unknowns from the factor of the final normal equations; the datum transformation of a free block."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.adjustment.datum import datum_rows, motions_of_images, motions_of_points
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.robust import Estimator
from aerotri.adjustment.sparse_cholesky import Factor, InverseOnPattern
from aerotri.adjustment.unknowns import State, Unknowns
from aerotri.functional_model.rotation import angles_from_rotation, small_rotation_per_angle


@dataclass(frozen=True, eq=False)
class Cofactors:
    """Cofactors (covariance divided by σ0²) at the solution.

    Parameters
    ----------
    images : (n, 6, 6) of X0, Y0, Z0 and the three rotation unknowns.
    shared : (s, s). points : (P, 3, 3).
    image_shared : (n, 6, s).
    ray_redundancy : (m, 2), in the order of `unknowns.rays`.
    """

    images: np.ndarray
    shared: np.ndarray
    points: np.ndarray
    image_shared: np.ndarray
    ray_redundancy: np.ndarray


def cofactors(system: NormalSystem, state: State, factor: Factor, estimator: Estimator) -> Cofactors:
    """All cofactors on the pattern of the normal matrix, and the redundancy numbers of the rays.

    An inner datum is reached by the S-transformation; redundancy numbers do not depend on the datum.
    """
    inverse = factor.inverse_on_pattern()
    points, redundancy = system.point_cofactors(state, inverse, estimator)
    images, border = _without_held(system.unknowns, inverse)
    result = Cofactors(images, inverse.corner, points, border, redundancy)
    if system.unknowns.block.settings.adjustment.datum == "inner" and system.unknowns.motions.count:
        return transform_datum(system, state, factor, estimator, result)
    return result


def _without_held(unknowns: Unknowns, inverse: InverseOnPattern) -> tuple[np.ndarray, np.ndarray]:
    images, border = inverse.blocks[: len(unknowns.images)].copy(), np.swapaxes(inverse.border, 1, 2).copy()
    held = ~unknowns.eo_free
    images[held] = 0.0
    np.swapaxes(images, 1, 2)[held] = 0.0
    border[held] = 0.0
    return images, border


def transform_datum(system: NormalSystem, state: State, factor: Factor, estimator: Estimator, minimal: Cofactors):
    """Cofactors in the inner datum over the datum points, from those in a minimal datum.

    With A = (GᵀDG)⁻¹GᵀD, D choosing the datum points, and S = I − G·A: SQSᵀ = Q − G(AQ) − (AQ)ᵀGᵀ + G(AQAᵀ)Gᵀ. Only
    the columns Q·Aᵀ, as many as motions are free, are needed beyond the pattern.
    """
    free = system.unknowns.motions
    d = free.count
    g_points = motions_of_points(state.points) @ free.basis
    g_images = motions_of_images(state.centre) @ free.basis
    turn = system.unknowns.turn(state)
    g_images[:, 3:] = np.linalg.solve(turn, g_images[:, 3:])
    g_shared = free.shared.copy()
    g_shared[system.unknowns.kept_columns] = g_points[system.unknowns.kept_rows]
    rows = datum_rows(system.unknowns)
    g_datum = g_points[rows].reshape(-1, d)
    a = np.zeros((len(state.points), 3, d))
    a[rows] = np.linalg.solve(g_datum.T @ g_datum, g_datum.T).T.reshape(-1, 3, d)
    qa_images, qa_shared, qa_points = system.solve_sides(state, factor, a, estimator)
    aqa = np.einsum("pia,pib->ab", a, qa_points)
    mixed = np.einsum("nia,sa->nis", g_images, qa_shared) + np.einsum("nia,sa->nis", qa_images, g_shared)
    return Cofactors(
        images=_transformed(minimal.images, g_images, qa_images, aqa),
        shared=_transformed(minimal.shared[None], g_shared[None], qa_shared[None], aqa)[0],
        points=_transformed(minimal.points, g_points, qa_points, aqa),
        image_shared=minimal.image_shared - mixed + np.einsum("nia,ab,sb->nis", g_images, aqa, g_shared),
        ray_redundancy=minimal.ray_redundancy,
    )


def _transformed(q: np.ndarray, g: np.ndarray, qa: np.ndarray, aqa: np.ndarray) -> np.ndarray:
    mixed = np.einsum("nia,nja->nij", g, qa)
    return q - mixed - np.swapaxes(mixed, 1, 2) + np.einsum("nia,ab,njb->nij", g, aqa, g)


def orientation_cofactors(unknowns: Unknowns, state: State, q_images: np.ndarray) -> np.ndarray:
    """(n, 6, 6) cofactors of X0, Y0, Z0, ω, φ, κ; NaN in the angles where the middle angle is ±90°."""
    angles = angles_from_rotation(state.rotation, unknowns.block.rotation)
    per_angle = small_rotation_per_angle(angles, unknowns.block.rotation)
    singular = np.abs(np.linalg.det(per_angle)) < 1e-9
    per_angle[singular] = np.eye(3)
    jacobian = np.zeros((len(angles), 6, 6))
    jacobian[:, :3, :3] = np.eye(3)
    jacobian[:, 3:, 3:] = np.linalg.solve(per_angle, unknowns.turn(state))
    q = jacobian @ q_images @ np.swapaxes(jacobian, 1, 2)
    q[singular, 3:] = np.nan
    q[singular, :, 3:] = np.nan
    return q


def correlations(q: np.ndarray) -> np.ndarray:
    """(s, s) correlation matrix of a cofactor matrix."""
    sigma = np.sqrt(np.diagonal(q))
    with np.errstate(divide="ignore", invalid="ignore"):
        return q / np.outer(sigma, sigma)


def total_correlations(q: np.ndarray) -> np.ndarray:
    """(s,) B_i = 1 − 1/(N_ii·Q_ii), N = Q⁻¹ the normals reduced to these parameters [L]."""
    if not len(q):
        return np.zeros(0)
    sigma = np.sqrt(np.diagonal(q))
    r = q / np.outer(sigma, sigma)
    return 1.0 - 1.0 / np.diagonal(np.linalg.inv(r))
