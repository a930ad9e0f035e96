"""The model part of σ: what clusters of photographs show beyond the noise of the rays.

The clustered covariance (see `cluster_influence`) holds whatever the rays of a cluster share. Of white noise it is the
part of σ0²·Q that comes from the photographs, σ0²·(Q − Q·N_0·Q), N_0 control and weighted parameters. The model part is
what it has above this, without negative eigenvalues, and σ total² = σ² + model part. It is added where a scheme of
clusters passes the test of `cluster_test`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.sparse_cholesky import Factor
from aerotri.results.model_part import ClusterTest, ModelPart, ModelRoot
from aerotri.statistics.cluster_influence import influences, known_part
from aerotri.statistics.cluster_test import LEVEL, compare_clusters, too_few, weakest_modes
from aerotri.statistics.clusters import FEWEST, Clusters, cluster_schemes
from aerotri.statistics.covariance import orientation_cofactors

FEWEST_PHOTOGRAPHS = 10
"""Photographs from which clusters are looked for [C]."""


@dataclass(frozen=True, eq=False)
class Excess:
    """Covariances of the model part in the frame of the adjustment, rows as in `Unknowns`.

    Parameters
    ----------
    images : (n, 6, 6) of X0, Y0, Z0, ω, φ, κ, m and rad. shared : (s, s). points : (P, 3, 3) m².
    root : for functions of the unknowns.
    """

    images: np.ndarray
    shared: np.ndarray
    points: np.ndarray
    root: ModelRoot


def why_not(system: NormalSystem, solution: Solution, sigma0: float) -> str:
    """Why a block has no model part from clusters, '' where it can have one."""
    u = system.unknowns
    if u.block.settings.adjustment.model_part == "off":
        return "switched off"
    if u.block.settings.adjustment.is_free:
        return "the datum is free"
    if len(u.images) < FEWEST_PHOTOGRAPHS:
        return f"there are fewer than {FEWEST_PHOTOGRAPHS} photographs"
    if solution.status != "converged" or not sigma0 > 0.0:
        return "the adjustment has no final σ0"
    return ""


def compare_schemes(
    system: NormalSystem, solution: Solution, factor: Factor, sigma0: float
) -> tuple[tuple[Clusters, ...], tuple[ClusterTest, ...]]:
    """All ways to divide the photographs, and their tests, at LEVEL together (Bonferroni).

    Parameters
    ----------
    factor : undamped, at the solution.
    """
    schemes = cluster_schemes(system.unknowns, solution.state)
    tested = sum(len(clusters) >= FEWEST for clusters in schemes)
    if not tested:
        return schemes, tuple(ClusterTest(c.scheme, len(c), reason=too_few(len(c))) for c in schemes)
    modes = weakest_modes(system, solution, factor)
    return schemes, tuple(
        compare_clusters(system, solution, factor, modes, clusters, sigma0, LEVEL / tested) for clusters in schemes
    )


def excess_of_clusters(
    system: NormalSystem, solution: Solution, factor: Factor, clusters: Clusters, sigma0: float,
    q_images: np.ndarray, q_shared: np.ndarray, q_points: np.ndarray,
) -> Excess:  # fmt: skip
    """The model part.

    Parameters
    ----------
    factor : undamped, at the solution; invalid afterwards.
    q_images (n, 6, 6) in rotation unknowns, q_shared (s, s), q_points (P, 3, 3) : cofactors.
    """
    m = len(clusters)
    known = known_part(system, solution, factor)
    noise = [q - part for q, part in zip((q_images, q_shared, q_points), known, strict=True)]
    root = ModelRoot(
        np.empty((*q_images.shape[:2], m)), np.empty((len(q_shared), m)), np.empty((len(q_points), 3, m), np.float32),
        sigma0**2,
    )  # fmt: skip
    points = np.zeros_like(q_points)
    # as of a variance of m values about their mean [L]; it makes good for what only one cluster determines
    freedom = m / (m - 1)
    for c, change in enumerate(influences(system, solution, factor, clusters)):
        for into, values in zip((root.images, root.shared, root.points), change, strict=True):
            into[..., c] = np.sqrt(freedom) * values
        points += change.points[:, :, None] * change.points[:, None, :]
    images = positive_part(root.images @ np.swapaxes(root.images, 1, 2) - sigma0**2 * noise[0])
    shared = positive_part((root.shared @ root.shared.T - sigma0**2 * noise[1])[None])[0]
    points = positive_part(freedom * points - sigma0**2 * noise[2])
    return Excess(orientation_cofactors(system.unknowns, solution.state, images), shared, points, root)


def positive_part(covariance: np.ndarray) -> np.ndarray:
    """(k, d, d) symmetric matrices without their negative eigenvalues, each scaled to its own diagonal first."""
    scale = np.sqrt(np.abs(np.diagonal(covariance, axis1=1, axis2=2)))
    scale = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(covariance / (scale[:, :, None] * scale[:, None, :]))
    kept = (vectors * np.maximum(values, 0.0)[:, None, :]) @ np.swapaxes(vectors, 1, 2)
    return kept * scale[:, :, None] * scale[:, None, :]


def with_ratios(part: ModelPart, sigma: np.ndarray, model: np.ndarray) -> ModelPart:
    """The record with the medians of σ total over σ of the object points.

    Parameters
    ----------
    sigma, model : (N, 3) m, σ of the points and its model part.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        growth = np.sqrt(sigma**2 + model**2) / sigma
    known = np.isfinite(growth).all(axis=1)
    if not known.any():
        return part
    plan, height = float(np.median(growth[known, :2])), float(np.median(growth[known, 2]))
    return replace(part, ratio_plan=plan, ratio_height=height)
