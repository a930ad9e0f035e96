"""Tests of all observations while some of them are switched off: what takes part, and what each would say.

An observation that takes part is tested by w = −v/(σ√r). One that is switched off is predicted by the others, with the
cofactor q of the prediction, and the same w comes out as gap/(σ√(1 + q)), with r = 1/(1 + q) and the gap itself as the
estimated error [D: what a single observation with that value would have got, by the rank-one update of the inverse]. So
what was removed can be judged again at any time, as if it were the only doubtful one.

The two coordinates of a ray, three of a control point, three of a position or attitude are wrong together: their joint
test is T² = vᵀ·Q_vv⁻¹·v, by which vᵀPv shrinks when all of them are taken out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment import _reliability_kernels
from aerotri.adjustment.kernel_records import Inverse
from aerotri.adjustment.normal_equations import ExtraObservations, NormalSystem
from aerotri.adjustment.robust import LEAST_SQUARES
from aerotri.adjustment.solve import Solution
from aerotri.adjustment.unknowns import State, Unknowns
from aerotri.functional_model.observed_unknowns import AttitudeObservations, CentreObservations, Rows
from aerotri.statistics.covariance import Cofactors
from aerotri.statistics.summarise import row_cofactors

LEAST_CONTROLLED = 1e-3
"""Redundancy number below which nothing is concluded from a residual: rounding and slow convergence show up there."""


@dataclass(frozen=True, eq=False)
class Switches:
    """What is on, in the order of the system: rays (m,), control of points (P,), rows (g,) of each of the extras."""

    rays: np.ndarray
    control: np.ndarray
    extras: tuple[np.ndarray, ...]

    @classmethod
    def none_of(cls, system: NormalSystem) -> Switches:
        u = system.unknowns
        extras = tuple(np.zeros(len(photographs_of(extra)), dtype=bool) for extra in system.extras)
        return cls(np.zeros(len(u.rays.image), dtype=bool), np.zeros(len(u.points), dtype=bool), extras)

    @classmethod
    def all_on(cls, system: NormalSystem) -> Switches:
        return cls.none_of(system).off()

    def off(self) -> Switches:
        """What is switched off."""
        return Switches(~self.rays, ~self.control, tuple(~rows for rows in self.extras))

    def any(self) -> bool:
        return bool(self.rays.any() or self.control.any() or any(rows.any() for rows in self.extras))

    def combined(self, other: Switches, how: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> Switches:
        """Every array combined with the other's by a function of two arrays."""
        extras = tuple(how(a, b) for a, b in zip(self.extras, other.extras, strict=True))
        return Switches(how(self.rays, other.rays), how(self.control, other.control), extras)

    def without(self, off: Switches) -> Switches:
        return self.combined(off, lambda on, gone: on & ~gone)

    def with_again(self, back: Switches) -> Switches:
        return self.combined(back, np.logical_or)


@dataclass(frozen=True, eq=False)
class Participants:
    """Which rays (m,) take part, which points (P,) are determined, which photographs (n,) have rays.

    A point needs two rays, or a known place.
    """

    rays: np.ndarray
    points: np.ndarray
    images: np.ndarray


@dataclass(frozen=True, eq=False)
class Tests:
    """Tests w of the components of observations with their estimated errors, and joint tests; 0 where there is none.

    Parameters
    ----------
    w, error : (k, c), error in the unit of the observation. joint : (k,) T.
    """

    w: np.ndarray
    error: np.ndarray
    joint: np.ndarray

    @property
    def largest(self) -> np.ndarray:
        """(k,) largest |w| of the components."""
        return np.abs(self.w).max(axis=1, initial=0.0)


@dataclass(frozen=True, eq=False)
class AllTests:
    """Tests of the rays (mm), of the control of points (m; P rows) and of the rows of each of the extras (m, rad).

    smallest_pivot : of the factor, see `sparse_cholesky.Factor`.
    """

    rays: Tests
    control: Tests
    extras: tuple[Tests, ...]
    smallest_pivot: float


def photographs_of(extra: ExtraObservations) -> np.ndarray:
    """(g,) photographs of positions or attitudes; none of conditions, which are not switched."""
    if isinstance(extra, CentreObservations | AttitudeObservations):
        return extra.image
    return np.zeros(0, dtype=np.int64)


def ray_points(unknowns: Unknowns) -> np.ndarray:
    """(m,) row of the point of every ray."""
    return np.repeat(np.arange(len(unknowns.points)), np.diff(unknowns.rays.start))


def participants(unknowns: Unknowns, switches: Switches) -> Participants:
    """What takes part when points without enough rays drop out."""
    point = ray_points(unknowns)
    count = np.bincount(point[switches.rays], minlength=len(unknowns.points))
    known = np.where(switches.control, unknowns.given.sum(axis=1), 0)
    weak = (2 * count + known < 4) | ((count == 1) & (known < 3))
    rays = switches.rays & ~weak[point]
    return Participants(rays, ~weak, np.bincount(unknowns.rays.image[rays], minlength=len(unknowns.images)) > 0)


def switched_system(system: NormalSystem, switches: Switches) -> NormalSystem:
    """The system with weight 0 for all that is switched off or drops out."""
    taking_part = participants(system.unknowns, switches)
    other = system.without(~taking_part.rays, ~switches.control)
    other.extras = tuple(_with(extra, on) for extra, on in zip(system.extras, switches.extras, strict=True))
    return other


def _with(extra: ExtraObservations, on: np.ndarray) -> ExtraObservations:
    if isinstance(extra, CentreObservations | AttitudeObservations) and not on.all():
        return replace(extra, inv_sigma=np.where(on[:, None], extra.inv_sigma, 0.0))
    return extra


def test_all(system: NormalSystem, switched: NormalSystem, solution: Solution, switches: Switches) -> AllTests:
    """Tests of all observations at a solution with some of them switched off.

    Parameters
    ----------
    system : with all on. switched : of `switched_system`. solution : of `switched`, not robust.

    Raises
    ------
    NotPositiveDefiniteError
        When what is switched on does not determine the unknowns.
    """
    u, state, taking_part = system.unknowns, solution.state, participants(system.unknowns, switches)
    factor = switched.factorise(solution.equations)
    inverse = factor.inverse_on_pattern()
    points, predicted = _predictions(system, switched, state, inverse)
    rays = _ray_tests(u, solution.equations.residual, predicted, taking_part)
    control = _control_tests(u, state, points, switches, taking_part)
    border = np.swapaxes(inverse.border, 1, 2)
    q = Cofactors(inverse.blocks[: len(u.images)], inverse.corner, points, border, predicted, inverse)
    rows = system.whitened_rows(state)
    extras = tuple(_row_tests(r, row_cofactors(r, q), on) for r, on in zip(rows, switches.extras, strict=True))
    return AllTests(rays, control, extras, factor.smallest_pivot)


def _predictions(system: NormalSystem, switched: NormalSystem, state: State, inverse: Inverse):
    """Cofactors of the points (P, 3, 3), and of the predictions of x with x, x with y, y with y (m, 3)."""
    u = system.unknowns
    m = len(u.rays.image)
    points, predicted = np.empty((len(u.points), 3, 3)), np.empty((m, 3))
    problem = switched.problem(state, LEAST_SQUARES)
    full = u.rays.arrays()
    switched.over_points(
        problem,
        lambda first, last, problem, work: _reliability_kernels.predicted_cofactors(
            first, last, problem, full, inverse, (points, predicted), work
        ),
    )
    for row, columns in zip(u.kept_rows, u.kept_columns, strict=True):
        points[row] = inverse.corner[np.ix_(columns, columns)]
    return points, predicted


def _ray_tests(unknowns: Unknowns, residual: np.ndarray, predicted: np.ndarray, taking_part: Participants) -> Tests:
    gap = residual * unknowns.rays.inv_sigma
    sign = np.where(taking_part.rays, -1.0, 1.0)[:, None, None]
    spread = np.eye(2) + sign * predicted[:, [[0, 1], [1, 2]]]
    w, r, joint = _tested(gap, spread, taking_part.rays)
    known = taking_part.points[ray_points(unknowns)] & taking_part.images[unknowns.rays.image]
    error = np.where(taking_part.rays[:, None], gap / r, gap) / unknowns.rays.inv_sigma
    return Tests(np.where(known[:, None], w, 0.0), error, np.where(known, joint, 0.0))


def _control_tests(
    unknowns: Unknowns, state: State, points: np.ndarray, switches: Switches, taking_part: Participants
) -> Tests:
    given = unknowns.prior_weight > 0.0
    root = np.sqrt(unknowns.prior_weight)
    gap = (unknowns.prior_xyz - state.points) * root
    sign = np.where(switches.control, -1.0, 1.0)[:, None, None]
    spread = np.eye(3) + sign * points * root[:, :, None] * root[:, None, :]
    rows = np.flatnonzero(given.any(axis=1) & taking_part.points)
    w, error, joint = np.zeros(given.shape), np.zeros(given.shape), np.zeros(len(given))
    w[rows], r, joint[rows] = _tested(gap[rows], spread[rows], switches.control[rows])
    with np.errstate(divide="ignore", invalid="ignore"):
        error[rows] = np.where(switches.control[rows, None], gap[rows] / r, gap[rows]) / root[rows]
    return Tests(np.where(given, w, 0.0), np.where(given, error, 0.0), joint)


def _row_tests(rows: Rows, cofactor: np.ndarray, on: np.ndarray) -> Tests:
    """Of observations beside the image points; their joint test leaves the correlation of the components aside."""
    if not len(on):
        none = np.zeros((0, rows.gap.shape[1]))
        return Tests(none, none, np.zeros(0))
    known = rows.inv_sigma > 0.0
    spread = 1.0 + np.where(on, -1.0, 1.0)[:, None] * cofactor
    w, r, _ = _tested(rows.gap[..., None].reshape(-1, 1), spread.reshape(-1, 1, 1), np.repeat(on, known.shape[1]))
    w = np.where(known, w.reshape(known.shape), 0.0)
    gap = np.where(on[:, None], rows.gap / r.reshape(known.shape), rows.gap)
    error = np.where(known, gap / np.where(known, rows.inv_sigma, 1.0), 0.0)
    return Tests(w, error, np.linalg.norm(w, axis=1))


def _tested(gap: np.ndarray, spread: np.ndarray, on: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """w (k, c), redundancy numbers r (k, c) and joint tests T (k,).

    Parameters
    ----------
    gap : (k, c) observed − predicted over σ. spread : (k, c, c) its cofactors: of those switched on I − A·Q·Aᵀ, of the
        others I + A·Q·Aᵀ. on : (k,).
    """
    variance = np.maximum(np.diagonal(spread, axis1=1, axis2=2), 1e-12)
    r = np.where(on[:, None], variance, 1.0 / variance)
    w = np.where(r > LEAST_CONTROLLED, gap / np.sqrt(variance), 0.0)
    values, along = _principal_parts(gap, spread)
    values = np.maximum(values, 1e-12)
    controlled = np.where(on[:, None], values, 1.0 / values) > LEAST_CONTROLLED
    return w, r, np.sqrt(np.sum(np.where(controlled, along**2 / values, 0.0), axis=1))


def _principal_parts(gap: np.ndarray, spread: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues (k, c) of the cofactors and the gaps (k, c) along their directions; in closed form for pairs."""
    if gap.shape[1] != 2:
        values, vectors = np.linalg.eigh(spread)
        return values, np.einsum("kij,ki->kj", vectors, gap)
    x, y, xy = spread[:, 0, 0], spread[:, 1, 1], spread[:, 0, 1]
    middle, half = (x + y) / 2.0, np.hypot((x - y) / 2.0, xy)
    angle = 0.5 * np.arctan2(2.0 * xy, x - y)
    cosine, sine = np.cos(angle), np.sin(angle)
    values = np.stack([middle + half, middle - half], axis=1)
    along = np.stack([cosine * gap[:, 0] + sine * gap[:, 1], cosine * gap[:, 1] - sine * gap[:, 0]], axis=1)
    return values, along
