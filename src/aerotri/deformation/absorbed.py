"""The orientation that an adjustment without additional parameters would find: it swallows part of the image errors.

[D] The noise-free observations l + v of the self-calibrated solution are adjusted without additional parameters, with
the same weights and in the same datum. Every observation takes part as it was adjusted: image points, control, GNSS,
INS, conditions. So what moves is moved by the image errors alone. Interior elements that were unknowns stay unknowns
[C]; Brown's and lens parameters count as image errors, also where they were given, and so does a rolling shutter.

To first order x_abs = x + N_xx⁻¹·N_xp·p, x all unknowns but the additional parameters p. From Q·N = I follows
N_xx⁻¹·N_xp = −Q_xp·Q_pp⁻¹: the covariances of the self-calibrated adjustment know how the orientation would follow.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.datum import restore_datum
from aerotri.adjustment.normal_equations import ExtraObservations, NormalSystem
from aerotri.adjustment.solve import Solution, SolveOptions, minimise
from aerotri.adjustment.unknowns import State, Unknowns
from aerotri.conventions import InputError
from aerotri.deformation.error_parameters import KINDS, shared_columns
from aerotri.deformation.orientation import Orientation
from aerotri.functional_model.observed_unknowns import Rows
from aerotri.results.adjustment import Adjustment
from aerotri.statistics.covariance import cofactors

N_INTERIOR = 3
"""Elements of interior orientation that an adjustment without additional parameters has: c, x0, y0."""
MAX_ITERATIONS = 50
"""[C] Of the adjustment without parameters: it starts at the solution and has only their effect to go."""


class AbsorptionFailedError(InputError):
    """The adjustment without additional parameters has no result."""


@dataclass(frozen=True, eq=False)
class Absorbed:
    """What the adjustment without additional parameters makes of noise-free observations.

    Parameters
    ----------
    orientation : of all photographs of the block.
    rms_um : RMS of the image residuals that the orientation cannot swallow, µm.
    """

    orientation: Orientation
    rms_um: float


@dataclass(frozen=True, eq=False)
class _NoiseFree:
    """Observations beside the image points, as they were adjusted: their misclosures `gap` taken off."""

    extra: ExtraObservations
    gap: np.ndarray

    @property
    def count(self) -> int:
        return self.extra.count

    def rows(self, centre: np.ndarray, rotation: np.ndarray, shared: np.ndarray) -> Rows:
        rows = self.extra.rows(centre, rotation, shared)
        return replace(rows, gap=rows.gap - self.gap)


def absorbed_orientation(calibration: Adjustment, state: State | None = None) -> Absorbed:
    """Adjust the noise-free observations without additional parameters.

    Parameters
    ----------
    state : the unknowns from which the observations are computed; those of the solution unless given.

    Raises
    ------
    AbsorptionFailedError
        When that adjustment does not converge.
    """
    system, solution = calibration.system, calibration.solution
    state = solution.state if state is None else state
    if not _has_image_errors(system.unknowns):
        return Absorbed(_orientation(system.unknowns, state), 0.0)
    plain, start = _without_parameters(system, solution, state)
    unknowns = plain.unknowns
    redundancy = max(2 * len(unknowns.rays.image) - unknowns.count, 1)
    found = minimise(plain, start, redundancy, SolveOptions(MAX_ITERATIONS))
    if found.status != "converged":
        reason = "; ".join(found.defects) or f"no convergence within {found.iterations} iterations"
        raise AbsorptionFailedError(f"the adjustment without additional parameters is {found.status}: {reason}")
    adjusted = found.state
    if unknowns.block.settings.adjustment.is_free:
        plain = plain.with_motions_at(adjusted)
        adjusted = restore_datum(plain.unknowns, adjusted, start.points)
    rms = float(np.sqrt(np.mean(found.equations.residual**2)))
    return Absorbed(_orientation(unknowns, adjusted), 1e3 * rms)


def absorbed_partials(calibration: Adjustment) -> np.ndarray:
    """How the absorbed orientation follows the additional parameters, −Q_xp·Q_pp⁻¹.

    Returns
    -------
    (n, 9, p) partials of X0, Y0, Z0 (m), the small rotation about the object axes (rad) and c, x0, y0 (mm) of all
    photographs of the block by the additional parameters, in the order of `error_rows`.
    """
    system, solution = calibration.system, calibration.solution
    u = system.unknowns
    columns = shared_columns(calibration)
    out = np.zeros((len(u.block.images), 6 + N_INTERIOR, len(columns)))
    if not len(columns):
        return out
    q = cofactors(system, solution.state, system.factorise(solution.equations), solution.estimator)
    scale = np.sqrt(np.diagonal(q.shared)[columns])
    correlation = q.shared[np.ix_(columns, columns)] / np.outer(scale, scale)

    def by_parameters(mixed: np.ndarray) -> np.ndarray:
        return -np.linalg.solve(correlation, (mixed / scale).T).T / scale

    of_images = by_parameters(q.image_shared[:, :, columns].reshape(-1, len(columns))).reshape(-1, 6, len(columns))
    of_images[:, 3:] = u.turn(solution.state) @ of_images[:, 3:]
    out[u.images, :6] = of_images
    free = u.lens.columns[u.lens.of_image][:, :N_INTERIOR]
    own, element = np.nonzero(free >= 0)
    if len(own):
        out[u.images[own], 6 + element] = by_parameters(q.shared[np.ix_(free[own, element], columns)])
    return out


def _has_image_errors(unknowns: Unknowns) -> bool:
    moved = unknowns.scanning is not None
    return moved or "additional" in unknowns.shared.kinds or bool(unknowns.lens.base[:, N_INTERIOR:].any())


def _without_parameters(system: NormalSystem, solution: Solution, state: State) -> tuple[NormalSystem, State]:
    """The same block without additional parameters and rolling shutters, its observations as `state` predicts them."""
    u = system.unknowns
    predicted = u.rays.xy - system.assemble(state, 0.0, solution.estimator).residual
    weight = np.sqrt(solution.equations.weight)[:, None]
    m = len(predicted)
    rays = replace(
        u.rays, xy=predicted, inv_sigma=u.rays.inv_sigma * weight, ap_index=np.zeros((m, 0), np.int64),
        ap_value=np.zeros((m, 2, 0)),
    )  # fmt: skip
    base, columns = u.lens.base.copy(), u.lens.columns.copy()
    base[:, N_INTERIOR:], columns[:, N_INTERIOR:] = 0.0, -1
    gone = np.isin(np.array(u.shared.kinds, dtype=object), KINDS)
    # no ray touches these columns any more: observed as zero they stay out of everything
    sigma = np.where(gone, 1.0, np.array(u.shared.sigma, dtype=float))
    values = np.where(gone, 0.0, state.shared)
    shared = replace(u.shared, sigma=sigma.tolist(), observed=values.tolist(), fields=[])
    unknowns = replace(
        u, rays=rays, lens=replace(u.lens, base=base, columns=columns), shared=shared, prior_xyz=state.points.copy(),
        scanning=None,
    )  # fmt: skip
    start = replace(state, shared=values)
    extras = [_NoiseFree(e, e.rows(state.centre, state.rotation, state.shared).gap) for e in system.extras]
    return NormalSystem(unknowns, extras, state.centre[:, :2]), start


def _orientation(unknowns: Unknowns, state: State) -> Orientation:
    n = len(unknowns.block.images)
    centre, rotation = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan)
    interior = np.full((n, N_INTERIOR), np.nan)
    centre[unknowns.images], rotation[unknowns.images] = state.centre + unknowns.origin, state.rotation
    interior[unknowns.images] = unknowns.interior(state)[unknowns.lens.of_image][:, :N_INTERIOR]
    return Orientation(centre, rotation, interior)
