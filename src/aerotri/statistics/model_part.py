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
from aerotri.quantiles import normal_quantile, student_quantile
from aerotri.results.model_part import ClusterTest, ModelPart, ModelRoot
from aerotri.statistics.cluster_fields import Field, compare_field
from aerotri.statistics.cluster_influence import influences, known_part
from aerotri.statistics.cluster_test import LEVEL, compare_clusters, untestable, weakest_modes
from aerotri.statistics.clusters import CAMERA, LARGE, PHOTOGRAPH, Clusters, cluster_schemes
from aerotri.statistics.covariance import InnerDatum, orientation_cofactors

FEWEST_PHOTOGRAPHS = 10
"""Photographs from which clusters are looked for [C]."""
COVERED = 0.95
"""Probability for which the model part of few clusters is widened [C]: what a surveyor quotes."""
POINTS_AT_ONCE = 4096
"""Object points whose columns are held in double precision."""


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
    tested = sum(not untestable(clusters) for clusters in schemes)
    if not tested:
        return schemes, tuple(ClusterTest(c.scheme, len(c), reason=untestable(c)) for c in schemes)
    modes = weakest_modes(system, solution, factor)
    return schemes, tuple(
        compare_clusters(system, solution, factor, modes, clusters, sigma0, LEVEL / tested) for clusters in schemes
    )


def compare_few(
    system: NormalSystem, solution: Solution, factor: Factor, schemes: tuple[Clusters, ...],
    tests: tuple[ClusterTest, ...], sigma0: float,
) -> tuple[tuple[ClusterTest, ...], dict[int, Field]]:  # fmt: skip
    """Schemes of too few clusters tested by random fields, where no scheme of strips, days … could be tested otherwise.

    Returns
    -------
    the tests, and the fields by the number of their scheme.
    """
    several = [k for k, one in enumerate(schemes) if one.scheme not in (CAMERA, PHOTOGRAPH)]
    if any(not tests[k].reason for k in several) or len(system.unknowns.images) > LARGE:
        return tests, {}
    found = {
        k: compare_field(system, solution, factor, schemes[k], sigma0, LEVEL / len(several)) for k in several
    }  # fmt: skip
    compared = tuple(found[k][0] if k in found else test for k, test in enumerate(tests))
    return compared, {k: field for k, (_, field) in found.items()}


def excess_of_clusters(
    system: NormalSystem, solution: Solution, factor: Factor, clusters: Clusters, sigma0: float,
    q_images: np.ndarray, q_shared: np.ndarray, q_points: np.ndarray, inner: InnerDatum | None = None,
) -> Excess:  # fmt: skip
    """The model part.

    Parameters
    ----------
    factor : undamped, at the solution; invalid afterwards.
    q_images (n, 6, 6) in rotation unknowns, q_shared (s, s), q_points (P, 3, 3) : cofactors.
    inner : the inner datum of all of them, None where there is none.
    """
    m = len(clusters)
    widening = of_few(m)
    known = known_part(system, solution, factor, inner=inner)
    noise = [q - part for q, part in zip((q_images, q_shared, q_points), known, strict=True)]
    root = ModelRoot(
        np.empty((*q_images.shape[:2], m)), np.empty((len(q_shared), m)), np.empty((len(q_points), 3, m), np.float32),
        widening * sigma0**2,
    )  # fmt: skip
    points = np.zeros_like(q_points)
    # as of a variance of m values about their mean [L]; it makes good for what only one cluster determines
    freedom = widening * m / (m - 1)
    for c, change in enumerate(influences(system, solution, factor, clusters)):
        columns = tuple(part[..., None] for part in change)
        columns = columns if inner is None else inner.moved(*columns)
        for into, values in zip((root.images, root.shared, root.points), columns, strict=True):
            into[..., c : c + 1] = np.sqrt(freedom) * values
        points += columns[2] @ np.swapaxes(columns[2], 1, 2)
    images = positive_part(root.images @ np.swapaxes(root.images, 1, 2) - root.noise * noise[0])
    shared = positive_part((root.shared @ root.shared.T - root.noise * noise[1])[None])[0]
    points = positive_part(freedom * points - root.noise * noise[2])
    return Excess(orientation_cofactors(system.unknowns, solution.state, images), shared, points, root)


def of_few(clusters: int) -> float:
    """What a variance of so many clusters is multiplied with, because it is not well known itself.

    [L] A difference over the σ of m clusters follows Student's t with m − 1 degrees of freedom, not the normal
    distribution (Bell and McCaffrey 2002). With the ratio of both quantiles ± 1.96 σ holds the truth in 95 % again.
    """
    upper = 0.5 + 0.5 * COVERED
    return (student_quantile(upper, clusters - 1) / normal_quantile(upper)) ** 2


def excess_of_root(system: NormalSystem, solution: Solution, root: ModelRoot) -> Excess:
    """The model part F·Fᵀ of a root that has no noise in it."""
    images = root.images @ np.swapaxes(root.images, 1, 2)
    points = np.empty((len(root.points), 3, 3))
    for first in range(0, len(points), POINTS_AT_ONCE):
        own = root.points[first : first + POINTS_AT_ONCE].astype(float)
        points[first : first + POINTS_AT_ONCE] = own @ np.swapaxes(own, 1, 2)
    shared = root.shared @ root.shared.T
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
