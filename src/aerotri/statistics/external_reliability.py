"""External reliability: what the largest error that stays undetected does to the unknowns, and to which most.

[L: Baarda 1968; paper 002] An error ∇l changes the unknowns by ∇x = Q·aᵀ·P·∇l, a the row of the observation. With
∇l = ∇0l and every change counted in σ of its unknown, the largest over all functions of the unknowns is δ̄0. Here the
largest over the unknowns is looked for, and only among those that the observation itself depends on: of a ray X, Y, Z
of its point, X0, Y0, Z0, ω, φ, κ of its photograph and the shared parameters that act on it; an unknown elsewhere
changes only through these. For this the inverse on its own pattern suffices, as for redundancy numbers. All σ a priori.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerotri.adjustment import _reliability_kernels
from aerotri.adjustment.kernel_records import Datum, Effects, Scale
from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.unknowns import ORIENTATION_ELEMENTS, Unknowns
from aerotri.functional_model.observed_unknowns import Rows
from aerotri.results.adjusted_block import RayEffects
from aerotri.statistics.covariance import Cofactors, InnerDatum, orientation_cofactors, to_angles
from aerotri.statistics.reliability import detectable_share

OF_POINT, OF_IMAGE = 3, 9
"""Numbers of an unknown: below 3 of the point, below 9 of the photograph, from 9 on shared parameters."""


def ray_effects(system: NormalSystem, solution: Solution, q: Cofactors) -> RayEffects:
    """The greatest effect of an undetected error of every image coordinate."""
    u, state, estimator = system.unknowns, solution.state, solution.estimator
    m = len(u.rays.image)
    size, unknown, height = np.empty((m, 2)), np.empty((m, 2), dtype=np.int32), np.empty((m, 2))
    measures, found = (_datum(u, q.inner), _scale(system, solution, q)), Effects(size, unknown, height)
    problem = system.problem(state, estimator)
    weight = problem.weighting.weight
    system.over_points(
        problem,
        lambda first, last, problem, work: _reliability_kernels.ray_effects(
            first, last, problem, q.inverse, measures, found, work
        ),
    )
    settings = u.block.settings.adjustment
    error = detectable_share(q.ray_redundancy, settings.alpha, settings.power) * np.sqrt(weight)[:, None]
    count = len(u.block.image_points)
    effects = RayEffects(
        np.full((count, 2), np.nan), np.full((count, 2), -1, np.int32), np.full((count, 2), np.nan), shared_labels(u)
    )
    effects.size[u.rays.source] = size * error
    effects.unknown[u.rays.source] = np.where(np.isfinite(error), unknown, -1)
    effects.height[u.rays.source] = np.abs(height) * error
    return effects


def shared_labels(unknowns: Unknowns) -> np.ndarray:
    """(s,) str, 'bluh.1 (ucd8)'; of a point that is not eliminated 'Z of point 17'."""
    shared = unknowns.shared
    return np.array(
        [
            f"{name} of point {group}" if kind == "point" else f"{name} ({group})"
            for name, group, kind in zip(shared.names, shared.groups, shared.kinds, strict=True)
        ],
        dtype=object,
    )


def row_effects(system: NormalSystem, solution: Solution, q: Cofactors, rows: Rows) -> tuple[np.ndarray, np.ndarray]:
    """The greatest effect of undetected errors of observations beside the image points, and on what.

    Parameters
    ----------
    rows : g whitened observations of k components each.

    Returns
    -------
    (g, k) effects over σ of the unknown for errors of one σ, and (g, k) str; NaN and '' where nothing is touched.
    """
    g, k = rows.gap.shape
    u, own = system.unknowns, rows.image >= 0
    if not len(q.shared):
        # a column that nothing touches, so that the indices below find something
        q = replace(q, shared=np.zeros((1, 1)), image_shared=np.zeros((len(u.images), 6, 1)))
    angles = to_angles(u, solution.state)
    per_image = _inverse_sigma(orientation_cofactors(u, solution.state, q.images))
    per_shared = _inverse_sigma(q.shared[None])[0]
    image, columns = np.where(own, rows.image, 0), np.where(rows.columns >= 0, rows.columns, 0)
    mixed = np.swapaxes(q.image_shared, 1, 2)[image[:, None], columns] * own[:, None, None]
    by_image = rows.by_image * own[:, None, None]
    of_image = np.einsum("gab,gkb->gka", q.images[image], by_image) + np.einsum("gca,gkc->gka", mixed, rows.by_shared)
    of_image[:, :, 3:] = np.einsum("gab,gkb->gka", angles[image], of_image[:, :, 3:])
    of_shared = np.einsum("gca,gka->gkc", mixed, by_image)
    of_shared += np.einsum("gcd,gkd->gkc", q.shared[columns[:, :, None], columns[:, None, :]], rows.by_shared)
    ratios = np.concatenate(
        [
            np.abs(of_image * per_image[image][:, None, :]) * own[:, None, None],
            np.abs(of_shared * per_shared[columns][:, None, :]) * (rows.columns >= 0)[:, None, :],
        ],
        axis=2,
    )
    largest = np.argmax(np.nan_to_num(ratios), axis=2)
    size = np.take_along_axis(ratios, largest[:, :, None], axis=2)[:, :, 0]
    labels, names = shared_labels(u), u.block.images.names[u.images]
    on = np.full((g, k), "", dtype=object)
    for row, component in zip(*np.nonzero(np.nan_to_num(size) > 0.0), strict=True):
        t = int(largest[row, component])
        of = f"{ORIENTATION_ELEMENTS[t]} of photo {names[image[row]]}" if t < 6 else labels[columns[row, t - 6]]
        on[row, component] = of
    return np.where(on != "", size, np.nan), on


def _scale(system: NormalSystem, solution: Solution, q: Cofactors) -> Scale:
    u, state = system.unknowns, solution.state
    of_points = _inverse_sigma(q.points)
    # these stand with the shared parameters
    of_points[u.kept_rows] = 0.0
    return Scale(
        np.ascontiguousarray(to_angles(u, state)),
        _inverse_sigma(orientation_cofactors(u, state, q.images)),
        _inverse_sigma(q.shared[None])[0],
        of_points,
    )


def _datum(unknowns: Unknowns, inner: InnerDatum | None) -> Datum:
    if inner is None:
        n, s, count = len(unknowns.images), len(unknowns.shared), len(unknowns.points)
        none = np.zeros((n, 6, 0)), np.zeros((s, 0)), np.zeros((count, 3, 0))
        return Datum(*none, *none)
    parts = inner.images, inner.shared, inner.points, inner.q_images, inner.q_shared, inner.q_points
    return Datum(*(np.ascontiguousarray(part) for part in parts))


def _inverse_sigma(cofactor: np.ndarray) -> np.ndarray:
    """1/σ from (·, k, k) cofactors; 0 for what is held."""
    variance = np.diagonal(cofactor, axis1=1, axis2=2)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(variance > 0.0, 1.0 / np.sqrt(variance), 0.0)
