"""The model part of σ: what clusters of photographs show beyond the noise of the rays.

The clustered covariance (see `cluster_influence`) holds whatever the rays of a cluster share. Of white noise it is the
part of σ0²·Q that comes from the photographs, σ0²·(Q − Q·N_0·Q), N_0 control and weighted parameters. The model part is
what it has above this, without negative eigenvalues, and σ total² = σ² + model part. It is added where a scheme of
clusters passes the test of `cluster_test`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.sparse_cholesky import Factor
from aerotri.adjustment.unknowns import Unknowns
from aerotri.quantiles import normal_quantile, student_quantile
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.model_part import ClusterTest, ModelPart, ModelRoot
from aerotri.statistics.cluster_fields import Field, compare_field
from aerotri.statistics.cluster_influence import influences, known_part
from aerotri.statistics.cluster_test import (
    LEVEL,
    Settled,
    Squares,
    candidates,
    compare_clusters,
    sum_of_squares,
    untestable,
    weakest_modes,
)
from aerotri.statistics.clusters import CAMERA, LARGE, PHOTOGRAPH, Clusters
from aerotri.statistics.covariance import InnerDatum, orientation_cofactors
from aerotri.statistics.summarise import OF_POINTS

FEWEST_PHOTOGRAPHS = 10
"""Photographs from which clusters are looked for [C]."""
LEAST_LEFT = 0.1
"""Share of a variance and of what noise explains of it, that a covariance is scaled by at least [C]."""
COVERED = 0.95
"""Probability for which the model part of few clusters is widened [C]: what a surveyor quotes."""


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


def why_not(model_part: str, photographs: int, status: str, sigma0: float) -> str:
    """Why a block has no model part from clusters, '' where it can have one.

    Parameters
    ----------
    model_part : as the settings say. status : of the adjustment.
    """
    if model_part == "off":
        return "switched off"
    if photographs < FEWEST_PHOTOGRAPHS:
        return f"there are fewer than {FEWEST_PHOTOGRAPHS} photographs"
    if status != "converged" or not sigma0 > 0.0:
        return "the adjustment has no final σ0"
    return ""


def compare_schemes(
    schemes: Sequence[Clusters], centre: np.ndarray, sigma0: float, prepare: Callable[[], Squares]
) -> tuple[ClusterTest, ...]:
    """Tests of all ways to divide the photographs, at LEVEL together (Bonferroni).

    Parameters
    ----------
    centre : (n, 3) m, of the photographs. prepare : gives what sums of squares are computed by, where they are needed.
    """
    tested = sum(not untestable(clusters) for clusters in schemes)
    if not tested:
        return tuple(ClusterTest(c.scheme, len(c), reason=untestable(c)) for c in schemes)
    squares = prepare()
    return tuple(compare_clusters(squares, clusters, centre, sigma0, LEVEL / tested) for clusters in schemes)


def squares_by(system: NormalSystem, solution: Solution, factor: Factor) -> Squares:
    """The sums of squares of clusters along the weakest modes of a block.

    Parameters
    ----------
    factor : undamped, at the solution.
    """
    if not len(candidates(system.unknowns)):
        # a test field of which all points are held: nothing of the ground can be deformed
        return lambda clusters: (0.0, 0)
    modes = weakest_modes(system, solution, factor)
    return lambda clusters: sum_of_squares(system, solution, factor, modes, clusters)


def compare_few(
    schemes: Sequence[Clusters], tests: tuple[ClusterTest, ...], centre: np.ndarray,
    fitted: Callable[[Clusters], Field],
) -> tuple[tuple[ClusterTest, ...], dict[int, Field]]:  # fmt: skip
    """Schemes of too few clusters tested by random fields, where no scheme of strips, days … could be tested otherwise.

    Parameters
    ----------
    centre : (n, 3) m, of the photographs. fitted : gives the random field that fits clusters best.

    Returns
    -------
    the tests, and the fields by the number of their scheme.
    """
    several = [k for k, one in enumerate(schemes) if one.scheme not in (CAMERA, PHOTOGRAPH)]
    if any(not tests[k].reason for k in several) or len(centre) > LARGE:
        return tests, {}
    found = {k: compare_field(fitted, schemes[k], centre, LEVEL / len(several)) for k in several}
    compared = tuple(found[k][0] if k in found else test for k, test in enumerate(tests))
    return compared, {k: field for k, (_, field) in found.items()}


def chosen_scheme(tests: Sequence[ClusterTest]) -> int | None:
    """The number of the scheme with the largest ratio of those that count; single photographs where no other does."""
    counting = [(test.scheme != PHOTOGRAPH, test.ratio, k) for k, test in enumerate(tests) if test.counts]
    return max(counting)[2] if counting else None


def why_none(tests: Sequence[ClusterTest]) -> str:
    """Why no scheme counts."""
    if tests and all(test.reason for test in tests):
        return tests[0].reason
    return "no group of photographs has errors that noise does not explain"


def excess_of_clusters(
    system: NormalSystem, solution: Solution, factor: Factor, clusters: Clusters, sigma0: float,
    q: tuple[np.ndarray, np.ndarray, np.ndarray], inner: InnerDatum | None = None,
) -> Excess:  # fmt: skip
    """The model part.

    Parameters
    ----------
    factor : undamped, at the solution; invalid afterwards.
    q : cofactors of photographs (n, 6, 6) in rotation unknowns, of shared parameters (s, s), and of points (P, 3, 3).
    inner : the inner datum of all of them, None where there is none.
    """
    m, (q_images, q_shared, q_points) = len(clusters), q
    widening = of_few(m)
    known = known_part(system, solution, factor, inner=inner)
    noise = [one - part for one, part in zip(q, known, strict=True)]
    root = ModelRoot(
        np.empty((*q_images.shape[:2], m)), np.empty((len(q_shared), m)), np.empty((len(q_points), 3, m), np.float32),
        widening * sigma0**2,
    )  # fmt: skip
    points = np.zeros_like(q_points)
    freedom = freedom_of(m)
    for c, change in enumerate(influences(system, solution, factor, clusters)):
        columns = tuple(part[..., None] for part in change)
        columns = columns if inner is None else inner.moved(*columns)
        for into, values in zip((root.images, root.shared, root.points), columns, strict=True):
            into[..., c : c + 1] = np.sqrt(freedom) * values
        points += columns[2] @ np.swapaxes(columns[2], 1, 2)
    images = positive_part(root.images @ np.swapaxes(root.images, 1, 2), root.noise * noise[0])
    shared = positive_part((root.shared @ root.shared.T)[None], root.noise * noise[1][None])[0]
    points = positive_part(freedom * points, root.noise * noise[2])
    return Excess(orientation_cofactors(system.unknowns, solution.state, images), shared, points, root)


def freedom_of(clusters: int) -> float:
    """What the sum over so many clusters is multiplied with."""
    # as of a variance of m values about their mean [L]; it makes good for what only one cluster determines
    return of_few(clusters) * clusters / (clusters - 1)


def of_few(clusters: int) -> float:
    """What a variance of so many clusters is multiplied with, because it is not well known itself.

    [L] A difference over the σ of m clusters follows Student's t with m − 1 degrees of freedom, not the normal
    distribution (Bell and McCaffrey 2002). With the ratio of both quantiles ± 1.96 σ holds the truth in 95 % again.
    """
    upper = 0.5 + 0.5 * COVERED
    return (student_quantile(upper, clusters - 1) / normal_quantile(upper)) ** 2


def excess_of_root(system: NormalSystem, solution: Settled, root: ModelRoot, points: np.ndarray) -> Excess:
    """The model part F·Fᵀ of a root that has no noise in it, of the points given (P, 3, 3)."""
    images = root.images @ np.swapaxes(root.images, 1, 2)
    shared = root.shared @ root.shared.T
    return Excess(orientation_cofactors(system.unknowns, solution.state, images), shared, points, root)


def positive_part(covariance: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """Covariances less what noise explains of them, (k, d, d) both, without negative eigenvalues.

    NaN where one is not known. Each is scaled to its own diagonal first, or to a share of both where little of the
    diagonal is left: scaled to nothing, the other variances would grow without bound.
    """
    rest = covariance - noise
    left, both = (
        np.abs(np.diagonal(part, axis1=1, axis2=2)) for part in (rest, np.abs(covariance) + np.abs(noise))
    )  # fmt: skip
    scale = np.sqrt(np.maximum(left, LEAST_LEFT * both))
    scale = np.where(scale > 0.0, scale, 1.0)
    known = np.isfinite(rest).all(axis=(1, 2))
    values, vectors = np.linalg.eigh((rest / (scale[:, :, None] * scale[:, None, :]))[known])
    kept = np.full_like(rest, np.nan)
    kept[known] = (vectors * np.maximum(values, 0.0)[:, None, :]) @ np.swapaxes(vectors, 1, 2)
    return kept * scale[:, :, None] * scale[:, None, :]


def spread_over_block(
    unknowns: Unknowns, local: AdjustedBlock, images: np.ndarray, shared: np.ndarray, points: np.ndarray
) -> AdjustedBlock:
    """The local result with the model part in the rows of the block.

    Parameters
    ----------
    images (n, 6, 6), shared (s, s), points (P, 3, 3) : as in `Excess`.
    """
    u = unknowns
    of_points, of_images = np.full_like(local.points.covariance, np.nan), np.full_like(local.images.covariance, np.nan)
    of_points[u.points], of_images[u.images] = points, images
    return replace(
        local,
        points=replace(local.points, model=of_points),
        images=replace(local.images, model=of_images),
        parameters=replace(local.parameters, model=of_parameters(u.shared.kinds, shared, len(local.parameters))),
    )


def of_parameters(kinds: Sequence[str], shared: np.ndarray, count: int) -> np.ndarray:
    """(count, count) model part of the parameters that are told, from that of all shared ones (s, s)."""
    own = np.flatnonzero(~np.isin(np.array(kinds, dtype=object).astype(str), OF_POINTS))
    model = np.zeros((count, count))
    model[: len(own), : len(own)] = shared[np.ix_(own, own)]
    return model


def growth_of(covariance: np.ndarray, model: np.ndarray) -> np.ndarray:
    """(N, 3) σ total over σ of points, from their covariance and its model part (N, 3, 3)."""
    sigma, of_model = (np.sqrt(np.diagonal(part, axis1=1, axis2=2)) for part in (covariance, model))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.sqrt(sigma**2 + of_model**2) / sigma


def with_ratios(part: ModelPart, growth: np.ndarray) -> ModelPart:
    """The record with the medians of σ total over σ of the object points, (N, 3)."""
    known = np.isfinite(growth).all(axis=1)
    if not known.any():
        return part
    plan, height = float(np.median(growth[known, :2])), float(np.median(growth[known, 2]))
    return replace(part, ratio_plan=plan, ratio_height=height)
