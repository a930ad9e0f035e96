"""Cofactors of all unknowns from the factor of the final normal equations; the datum transformation of a free block."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.datum import datum_rows, motions_of_images, motions_of_points
from aerotri.adjustment.kernel_records import Inverse
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.parallel import blas_threads
from aerotri.adjustment.point_sides import point_cofactors, solve_sides
from aerotri.adjustment.robust import Estimator
from aerotri.adjustment.sparse_cholesky import Factor
from aerotri.adjustment.unknowns import State, Unknowns
from aerotri.adjustment.weak_datum import WeakFactor
from aerotri.functional_model.rotation import angles_from_rotation, small_rotation_per_angle


@dataclass(frozen=True, eq=False)
class InnerDatum:
    """What leads from a minimal to the inner datum: Q becomes SQSᵀ, S = I − G·A, A the conditions GᵀD scaled.

    Parameters
    ----------
    images (n, 6, d), shared (s, d), points (P, 3, d) : the d free motions G in the unknowns.
    q_images, q_shared, q_points : Q·Aᵀ, of the same shapes. both : (d, d), A·Q·Aᵀ.
    conditions : (P, 3, d) Aᵀ, of the points alone.
    """

    images: np.ndarray
    shared: np.ndarray
    points: np.ndarray
    q_images: np.ndarray
    q_shared: np.ndarray
    q_points: np.ndarray
    both: np.ndarray
    conditions: np.ndarray

    def moved(
        self, images: np.ndarray, shared: np.ndarray, points: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """S·x of k columns x: photographs (n, 6, k), shared parameters (s, k), points (P, 3, k)."""
        motion = np.einsum("pid,pik->dk", self.conditions, points)
        return images - self.images @ motion, shared - self.shared @ motion, points - self.points @ motion

    def correction(self, unknowns: np.ndarray, size: int = 1) -> np.ndarray:
        """(k/size, size, size) what CᵀQC of every `size` functions gains on the way from the minimal datum.

        CᵀSQSᵀC = CᵀQC − MᵀK − KᵀM + Mᵀ·(AQAᵀ)·M with M = GᵀC and K = AQ·C.

        Parameters
        ----------
        unknowns : (6n + s, k) partials C of the functions by the unknowns of the reduced system.
        """
        n, d = 6 * len(self.images), len(self.both)
        images, shared = unknowns[:n].reshape(len(self.images), 6, -1), unknowns[n:]
        moved, known = (
            (np.einsum("nid,nik->dk", by_images, images) + by_shared.T @ shared).reshape(d, -1, size)
            for by_images, by_shared in ((self.images, self.shared), (self.q_images, self.q_shared))
        )
        mixed = np.einsum("dki,dkj->kij", moved, known)
        both = np.einsum("dki,de,ekj->kij", moved, self.both, moved, optimize=True)
        return both - mixed - np.swapaxes(mixed, 1, 2)


@dataclass(frozen=True, eq=False)
class Cofactors:
    """Cofactors (covariance divided by σ0²) at the solution.

    Parameters
    ----------
    images : (n, 6, 6) of X0, Y0, Z0 and the three rotation unknowns.
    shared : (s, s). points : (P, 3, 3).
    image_shared : (n, 6, s).
    ray_redundancy : (m, 2), in the order of `unknowns.rays`.
    inverse : of the normal matrix on its pattern, in the minimal datum where there is an inner one.
    inner : None unless the datum is an inner one.
    """

    images: np.ndarray
    shared: np.ndarray
    points: np.ndarray
    image_shared: np.ndarray
    ray_redundancy: np.ndarray
    inverse: Inverse
    inner: InnerDatum | None = None


def cofactors(system: NormalSystem, state: State, factor: Factor, estimator: Estimator) -> Cofactors:
    """All cofactors on the pattern of the normal matrix, and the redundancy numbers of the rays.

    An inner datum is reached by the S-transformation; redundancy numbers do not depend on the datum. Where rounding
    took all digits, as in a block that ran away, cofactors are NaN: not known.
    """
    # threads of BLAS that wait for work would take a processor from the kernels
    with blas_threads(0.0):
        inverse = factor.inverse_on_pattern()
        points, redundancy = point_cofactors(system, state, inverse, estimator)
        if isinstance(factor, WeakFactor):
            # no motion of the block changes a residual, and of its large cofactors none but the rounding
            redundancy = point_cofactors(system, state, factor.inverse_of_shape(), estimator)[1]
    images, border = _without_held(system.unknowns, inverse)
    result = Cofactors(images, inverse.corner, points, border, redundancy, inverse)
    if is_inner(system):
        result = transform_datum(result, inner_datum(system, state, factor, estimator))
    return replace(
        result,
        images=_with_digits(result.images),
        shared=_with_digits(result.shared[None])[0],
        points=_with_digits(result.points),
    )


def _with_digits(q: np.ndarray) -> np.ndarray:
    """Cofactors (k, a, a), NaN in the rows and columns of variances that are none: a square is not negative."""
    lost = ~(np.diagonal(q, axis1=1, axis2=2) >= 0.0)
    if not lost.any():
        return q
    return np.where(lost[:, :, None] | lost[:, None, :], np.nan, q)


def is_inner(system: NormalSystem) -> bool:
    """Whether the covariances of the block are those of an inner datum, while Q of its factor is of a minimal one."""
    return system.unknowns.block.settings.adjustment.datum == "inner" and system.unknowns.motions.count > 0


def _without_held(unknowns: Unknowns, inverse: Inverse) -> tuple[np.ndarray, np.ndarray]:
    images, border = inverse.blocks[: len(unknowns.images)].copy(), np.swapaxes(inverse.border, 1, 2).copy()
    held = ~unknowns.eo_free
    images[held] = 0.0
    np.swapaxes(images, 1, 2)[held] = 0.0
    border[held] = 0.0
    return images, border


def inner_datum(system: NormalSystem, state: State, factor: Factor, estimator: Estimator) -> InnerDatum:
    """The inner datum over the datum points: A = (GᵀDG)⁻¹GᵀD, D choosing them.

    Only the columns Q·Aᵀ, as many as motions are free, are needed beyond the pattern.
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
    q_images, q_shared, q_points = solve_sides(system, state, factor, a, estimator)
    both = np.einsum("pia,pib->ab", a, q_points)
    return InnerDatum(g_images, g_shared, g_points, q_images, q_shared, q_points, both, a)


def transform_datum(minimal: Cofactors, inner: InnerDatum) -> Cofactors:
    """Cofactors in the inner datum from those in a minimal one: SQSᵀ = Q − G(AQ) − (AQ)ᵀGᵀ + G(AQAᵀ)Gᵀ."""
    mixed = np.einsum("nia,sa->nis", inner.images, inner.q_shared)
    mixed += np.einsum("nia,sa->nis", inner.q_images, inner.shared)
    return replace(
        minimal,
        images=_transformed(minimal.images, inner.images, inner.q_images, inner.both),
        shared=_transformed(minimal.shared[None], inner.shared[None], inner.q_shared[None], inner.both)[0],
        points=_transformed(minimal.points, inner.points, inner.q_points, inner.both),
        image_shared=minimal.image_shared - mixed + np.einsum("nia,ab,sb->nis", inner.images, inner.both, inner.shared),
        inner=inner,
    )


def _transformed(q: np.ndarray, g: np.ndarray, qa: np.ndarray, aqa: np.ndarray) -> np.ndarray:
    mixed = np.einsum("nia,nja->nij", g, qa)
    return q - mixed - np.swapaxes(mixed, 1, 2) + np.einsum("nia,ab,njb->nij", g, aqa, g)


def to_angles(unknowns: Unknowns, state: State) -> np.ndarray:
    """(n, 3, 3) partials of ω, φ, κ by the three rotation unknowns; NaN where the middle angle is ±90°."""
    angles = angles_from_rotation(state.rotation, unknowns.block.rotation)
    per_angle = small_rotation_per_angle(angles, unknowns.block.rotation)
    singular = np.abs(np.linalg.det(per_angle)) < 1e-9
    per_angle[singular] = np.eye(3)
    partials = np.linalg.solve(per_angle, unknowns.turn(state))
    partials[singular] = np.nan
    return partials


def orientation_cofactors(unknowns: Unknowns, state: State, q_images: np.ndarray) -> np.ndarray:
    """(n, 6, 6) cofactors of X0, Y0, Z0, ω, φ, κ; NaN in the angles where the middle angle is ±90°."""
    partials = to_angles(unknowns, state)
    jacobian = np.zeros((len(partials), 6, 6))
    jacobian[:, :3, :3] = np.eye(3)
    singular = np.isnan(partials[:, 0, 0])
    jacobian[:, 3:, 3:] = np.where(singular[:, None, None], np.eye(3), partials)
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
    r = correlations(q)
    if not np.isfinite(r).all():
        return np.full(len(q), np.nan)
    return 1.0 - 1.0 / np.diagonal(np.linalg.inv(r))
