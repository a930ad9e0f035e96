"""Normal equations with the object points eliminated: assembled chunk by chunk, never stored as a design matrix."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from aerotri.adjustment import _kernels, _point_kernels, _settling_kernels, position_errors, rigging
from aerotri.adjustment.chunk_sums import ChunkSums, add_gaps, add_own_squares, add_squares
from aerotri.adjustment.datum import ExtraObservations, free_motions, observes_centres, without_motion
from aerotri.adjustment.kernel_records import (
    Directions,
    Pairs,
    Points,
    Problem,
    Table,
    Values,
    Weighting,
    Work,
)
from aerotri.adjustment.panels import DOUBLE
from aerotri.adjustment.parallel import chunk_bounds, run_chunks
from aerotri.adjustment.reduced_equations import NormalEquations, RightSide
from aerotri.adjustment.rig_reduction import RigFactor, RigReduction
from aerotri.adjustment.rig_ties import TieRows
from aerotri.adjustment.rigging import Chain
from aerotri.adjustment.robust import Estimator, normalised_lengths
from aerotri.adjustment.shared_priors import SharedPriors
from aerotri.adjustment.sparse_cholesky import BorderedMatrix, Factor, NotPositiveDefiniteError, Symbolic
from aerotri.adjustment.unknowns import State, Step, Unknowns
from aerotri.adjustment.weak_datum import may_be_weak, weak_factor
from aerotri.functional_model.observed_unknowns import Rows
from aerotri.observations import Block, Settings

T = TypeVar("T")

ROUNDED = 2e-15
"""Relative error of a predicted image coordinate by rounding: some ten units in the last place [C]; the prediction of a
ray has about as many operations."""


class NormalSystem:
    """Assembles and back-substitutes for one set of unknowns; owns the buffers and the symbolic factor.

    Parameters
    ----------
    unknowns : what is to be found.
    extras : observations beside the image points.
    position : (n, 2) plan positions of the photographs, for the ordering.
    last : photographs that are eliminated last, where the block is a part of another one.
    """

    def __init__(
        self, unknowns: Unknowns, extras: Sequence[ExtraObservations], position: np.ndarray,
        last: np.ndarray | None = None,
    ):  # fmt: skip
        self.unknowns, self.extras = unknowns, tuple(extras)
        counts = np.diff(unknowns.rays.start).astype(float)
        self._bounds = chunk_bounds(counts * (counts + 4.0))
        self._max_rays = int(counts.max(initial=1))
        n, s = len(unknowns.images), len(unknowns.shared)
        pattern = unknowns.block_row, unknowns.block_col
        self._reduction = None if unknowns.rigging is None else RigReduction(unknowns.rigging, *pattern)
        if self._reduction is None:
            self.symbolic = Symbolic(n, *pattern, position, s, last)
        else:
            leads, pattern = self._reduction.leads, (self._reduction.block_row, self._reduction.block_col)
            self.symbolic = Symbolic(len(leads), *pattern, position[leads], s)
        # mountings and errors of positions act on no ray; behind the others they need no sums
        apart = position_errors.KIND, rigging.KIND
        of_rays = 1 + max((k for k, kind in enumerate(unknowns.shared.kinds) if kind not in apart), default=-1)
        self._sums = ChunkSums(unknowns, self._bounds, of_rays)
        self.priors = SharedPriors.of(unknowns)
        # the kernels see no prior of a point that is not eliminated: it stands with the shared parameters
        self._point_prior = np.where((unknowns.kept < 0)[:, None], unknowns.prior_weight, 0.0)
        self._rounding: float | None = None

    @property
    def chunks(self) -> list[tuple[int, int]]:
        """Ranges of points with about equal work, first and end of each."""
        return self._bounds

    def with_settings(self, settings: Settings) -> NormalSystem:
        """The same system with the covariances of fields and deviations that other settings say."""
        block = replace(self.unknowns.block, settings=settings)
        other = copy(self)
        other.unknowns = replace(self.unknowns, block=block)
        other.priors = self.priors.as_settings_say(self.unknowns, block)
        return other

    def work(self) -> Work:
        """Room for one thread."""
        u = self.unknowns
        most = int((u.lens.columns >= 0).sum(axis=1).max(initial=0)) + u.rays.ap_index.shape[1] + 3
        if u.scanning is not None:
            most += int(((u.scanning.columns >= 0) @ [1, 3, 3]).max(initial=0))
        return _point_kernels.scratch(self._max_rays, max(most, 1), len(u.shared))

    def problem(self, state: State, estimator: Estimator, damping: float = 0.0) -> Problem:
        """What the kernels are given at `state`; its residuals and weights are filled in by them."""
        u = self.unknowns
        m = len(u.rays.image)
        return Problem(
            rays=u.rays.arrays(),
            pairs=Pairs(u.pair_start, u.pair_block),
            table=Table(
                u.lens.used_columns,
                u.eo_free.astype(float),
                u.turn(state) if u.by_angles.any() else np.empty((0, 3, 3)),
                u.kept,
            ),
            values=Values(
                np.ascontiguousarray(state.rotation), state.centre, u.interior(state), state.shared, u.scans(state)
            ),
            points=Points(state.points, u.prior_xyz, self._point_prior, u.point_free.astype(float)),
            weighting=Weighting(estimator.code, float(estimator.limit), np.empty((m, 2)), np.empty(m)),
            damping=float(damping),
        )  # fmt: skip

    def assemble(self, state: State, damping: float, estimator: Estimator) -> NormalEquations:
        """Normal equations at `state`; `damping` λ multiplies every diagonal element by 1 + λ."""
        u, problem = self.unknowns, self.problem(state, estimator, damping)
        sums, places = self._sums.zeros(), self._sums.places
        outcomes = self.over_chunks(
            lambda k: _kernels.assemble(*self._bounds[k], problem, places[k], sums[k], self.work())
        )
        blocks, border, corner = self._sums.matrix(sums)
        squares, squares_shared = self._sums.squares(sums)
        of_rays = np.concatenate([squares.ravel(), squares_shared])
        squares_shared += self.priors.weight
        corner = corner + corner.T - np.diag(np.diagonal(corner))
        rows = self.whitened_rows(state)
        for observed in rows:
            add_squares(observed, blocks, border, corner)
            add_own_squares(observed, squares, squares_shared)
        self.priors.add_to(corner, squares_shared)
        ties = self.tie_rows(state)
        if ties is not None and u.ties is not None:
            u.ties.add_to(ties, blocks, border, corner)
            u.ties.add_squares(ties, squares, squares_shared)
        held_image, held_column = np.nonzero(~u.eo_free)
        blocks[held_image, held_column, held_column] = squares[held_image, held_column] = 1.0
        diagonal = np.arange(6)
        blocks[: len(u.images), diagonal, diagonal] *= 1.0 + damping
        corner[np.diag_indices_from(corner)] *= 1.0 + damping
        chain = u.chain(state)
        if chain is not None and u.rigging is not None:
            u.rigging.add_squares(chain, squares, squares_shared)
        side = self._summed(state, rows, ties, chain, outcomes, problem, self._sums.right(sums))
        whole = np.concatenate([squares.ravel(), squares_shared]) * (1.0 + damping)
        matrix = BorderedMatrix(blocks, border, corner)
        at = (state, estimator) if damping == 0.0 else None
        return NormalEquations(**side.__dict__, matrix=matrix, diagonal=whole, of_rays=of_rays, chain=chain, at=at)

    def right_side(self, state: State, estimator: Estimator) -> RightSide:
        """The right side of the undamped equations at `state` and the cost there: a third of the work of `assemble`."""
        problem, places = self.problem(state, estimator), self._sums.places
        right, of_chunks = self._sums.zero_right()
        outcomes = self.over_chunks(
            lambda k: _kernels.reduce_right_side(
                *self._bounds[k], problem, places[k].image, right, of_chunks[k], self.work()
            )
        )
        rows, ties, chain = self.whitened_rows(state), self.tie_rows(state), self.unknowns.chain(state)
        return self._summed(state, rows, ties, chain, outcomes, problem, self._sums.right_of(right, of_chunks))

    def _summed(
        self,
        state: State,
        rows: list[Rows],
        ties: TieRows | None,
        chain: Chain | None,
        outcomes: list[tuple[float, float, int]],
        problem: Problem,
        of_points: tuple[np.ndarray, np.ndarray],
    ) -> RightSide:
        """Points, observations beside the image points and observed shared parameters together."""
        right, right_shared = of_points
        for observed in rows:
            add_gaps(observed, right, right_shared)
        cost = sum(o[0] for o in outcomes) + sum(float(np.sum(observed.gap**2)) for observed in rows)
        together, alone = self.priors.add_gaps_to(right_shared, state.shared)
        if ties is not None and self.unknowns.ties is not None:
            self.unknowns.ties.add_gaps(ties, right, right_shared)
            cost += float(np.sum(ties.deviation**2))
        whole = np.concatenate([right.ravel(), right_shared])
        return RightSide(
            right=whole if self._reduction is None or chain is None else self._reduction.on_leads(whole, chain),
            cost=float(cost + together + alone),
            point_decrement=float(sum(o[1] for o in outcomes)),
            residual=problem.weighting.residual,
            weight=problem.weighting.weight,
            undetermined=max(o[2] for o in outcomes),
            of_photographs=whole,
            rounding=self._rounded(state),
        )

    def _rounded(self, state: State) -> float:
        """Sum of the squares of what rounding does to the whitened residuals, at the first state that is asked for.

        A predicted image coordinate is as uncertain as the coordinates that it is computed from, seen from the
        photograph: c·(|X| + |X0|)/|X − X0| units in the last place, and those of its own.
        """
        if self._rounding is None:
            rays, c = self.unknowns.rays, self.unknowns.interior(state)[:, 0]
            point, centre = np.repeat(state.points, np.diff(rays.start), axis=0), state.centre[rays.image]
            far = np.linalg.norm(point, axis=1) + np.linalg.norm(centre, axis=1)
            seen = 1.0 + far / np.maximum(np.linalg.norm(point - centre, axis=1), 1.0)
            error = ROUNDED * np.abs(c)[rays.lens_row] * seen
            self._rounding = float(np.sum(np.square(error[:, None] * rays.inv_sigma)))
        return self._rounding

    def whitened_rows(self, state: State) -> list[Rows]:
        """The observations beside the image points, linearised at `state` and divided by σ, in the unknowns' axes."""
        out = []
        turn = self.unknowns.turn(state)
        for extra in self.extras:
            rows = extra.rows(state.centre, state.rotation, state.shared)
            by_image = rows.by_image.copy()
            own = rows.image >= 0
            by_image[own, :, 3:] = by_image[own, :, 3:] @ turn[rows.image[own]]
            by_image[own] *= self.unknowns.eo_free[rows.image[own]][:, None, :]
            weight = rows.inv_sigma[:, :, None]
            out.append(
                replace(
                    rows,
                    gap=rows.gap * rows.inv_sigma,
                    by_image=by_image * weight,
                    by_shared=rows.by_shared * weight * (rows.columns >= 0)[:, None, :],
                )
            )
        return out

    def tie_rows(self, state: State) -> TieRows | None:
        """The deviations of photographs on weighted rigs, linearised at `state` and divided by σ."""
        u = self.unknowns
        if u.ties is None:
            return None
        return u.ties.whitened(u.ties.rows(state.centre, state.rotation, state.shared, u.turn(state), u.eo_free))

    def with_movements(self, sigma: np.ndarray, block: Block) -> NormalSystem:
        """The same system with other σ (k, 2) of the movements on weighted rigs, which `block` states."""
        other = copy(self)
        ties = None if self.unknowns.ties is None else self.unknowns.ties.with_sigma(sigma)
        other.unknowns = replace(self.unknowns, ties=ties, block=block)
        return other

    def products_beside(self, state: State, images: np.ndarray, shared: np.ndarray) -> np.ndarray:
        """VᵀAᵀA·V (k, k) of directions over all observations but image points, and over what is held.

        Parameters
        ----------
        images : (n, 6, k), shared : (s, k) the directions.
        """
        held = images[~self.unknowns.eo_free]
        total = held.T @ held + self.priors.products(shared)
        for rows in self.whitened_rows(state):
            value = np.zeros((*rows.gap.shape, shared.shape[1]))
            own = rows.image >= 0
            value[own] = rows.by_image[own] @ images[rows.image[own]]
            for c in range(rows.columns.shape[1]):
                there = rows.columns[:, c] >= 0
                value[there] += rows.by_shared[there, :, c, None] * shared[rows.columns[there, c]][:, None, :]
            total += np.einsum("gka,gkb->ab", value, value)
        ties = self.tie_rows(state)
        if ties is not None and self.unknowns.ties is not None:
            value = self.unknowns.ties.along(ties, images, shared)
            total += np.einsum("gka,gkb->ab", value, value)
        return total

    def with_motions_at(self, state: State) -> NormalSystem:
        """The system with what the observations leave free of a free block linearised at `state`."""
        if not self.unknowns.block.settings.adjustment.is_free:
            return self
        other = copy(self)
        other.unknowns = replace(self.unknowns, motions=free_motions(self.unknowns, self.extras, state))
        return other

    @property
    def observes_centres(self) -> bool:
        """Whether projection centres were observed."""
        return observes_centres(self.extras)

    def back_substitute(self, state: State, x: np.ndarray, damping: float, estimator: Estimator) -> Step:
        """The full step from the solution x (6·n + s,) of the reduced equations."""
        u = self.unknowns
        n = 6 * len(u.images)
        images, shared = np.ascontiguousarray(x[:n].reshape(-1, 6)), np.ascontiguousarray(x[n:])
        points = np.empty((len(u.points), 3))
        problem = self.problem(state, estimator, damping)
        step = Directions(images, shared, points)
        self.over_chunks(lambda k: _kernels.back_substitute(*self._bounds[k], problem, step, self.work()))
        return Step(images, shared, points)

    def whole_step(self, state: State, x: np.ndarray, damping: float, estimator: Estimator) -> Step | None:
        """The step of all unknowns from the solution x (6·n + s,) of the reduced equations; None where it leads beyond
        all numbers.

        Of a free block without the motion of the whole.
        """
        if not _is_within_reach(x):
            return None
        step, u = self.back_substitute(state, x, damping, estimator), self.unknowns
        if not _is_within_reach(step.points):
            return None
        if u.block.settings.adjustment.is_free and u.motions.count:
            step = without_motion(u, state, step)
        return step

    def residual_lengths(self, equations: RightSide) -> np.ndarray:
        """(m,) lengths of the residuals of the rays, each coordinate divided by its a-priori σ."""
        return normalised_lengths(equations.residual, self.unknowns.rays.inv_sigma)

    def settle_points(self, state: State, estimator: Estimator, rounds: int = 8) -> State:
        """The state with every point moved, on its own and only downhill, to where its rays want it."""
        settled = replace(state, points=state.points.copy())
        problem = self.problem(settled, estimator)
        self.over_chunks(
            lambda k: _settling_kernels.settle_points(
                *self._bounds[k], problem, rounds, _settling_kernels.NEARLY, self.work()
            )
        )
        return settled

    def looseness(self, state: State, estimator: Estimator) -> np.ndarray:
        """(P,) σ of every point in its worst direction over its distance, the photographs held; see the kernel."""
        loose = np.empty(len(self.unknowns.points))
        self.over_points(
            self.problem(state, estimator),
            lambda first, last, problem, work: _point_kernels.looseness(first, last, problem, work, loose),
        )
        return loose

    def over_points(self, problem: Problem, kernel: Callable[[int, int, Problem, Work], object]) -> None:
        """kernel(first, last, problem, work) over ranges of points, in threads."""
        self.over_chunks(lambda k: kernel(*self._bounds[k], problem, self.work()))

    def over_chunks(self, function: Callable[[int], T]) -> list[T]:
        """Of every chunk of points, in threads where there are many rays."""
        return run_chunks(function, len(self._bounds), len(self.unknowns.rays.image))

    def without(self, rays_off: np.ndarray, control_off: np.ndarray) -> NormalSystem:
        """The same system with rays (m,) bool and the given coordinates of points (P,) bool switched off.

        They keep their places with weight 0, so that nothing is sorted or ordered anew; the counts are not theirs. A
        photograph that loses all its rays is held where it is.
        """
        u, other = self.unknowns, copy(self)
        carrier = u.rays.image if u.rigging is None else u.rigging.lead[u.rays.image]
        empty = np.bincount(carrier[~rays_off], minlength=len(u.images)) == 0
        if u.rigging is not None:
            # what follows is held by its station
            empty[u.rigging.followers] = False
        if u.ties is not None:
            # what is tied has the others of its station
            empty[np.union1d(u.ties.image, u.ties.lead)] = False
        inv_sigma = np.where(rays_off[:, None], 0.0, u.rays.inv_sigma)
        weight = np.where(control_off[:, None], 0.0, u.prior_weight)
        rays, eo_free = replace(u.rays, inv_sigma=inv_sigma), u.eo_free & ~empty[:, None]
        other.unknowns = replace(u, rays=rays, prior_weight=weight, eo_free=eo_free)
        other._point_prior = np.where((u.kept < 0)[:, None], weight, 0.0)
        other.priors = self.priors.without(u.kept_columns[control_off[u.kept_rows]])
        return other

    def factorise(self, equations: NormalEquations, precision: np.dtype[Any] = DOUBLE) -> Factor:
        """Factor of the reduced matrix; valid until the next one. See `Symbolic.factorise` on the precision.

        Of a block that its observations hardly hold in place one that keeps its digits nevertheless (`weak_datum`).
        """
        try:
            factor = self.factorise_like(equations, equations.matrix, precision)
        except NotPositiveDefiniteError:
            factor = None
        if equations.at is not None and precision == DOUBLE and may_be_weak(factor, equations):
            held = weak_factor(self, equations, equations.at, lambda matrix: self.factorise_like(equations, matrix))
            factor = held or factor
        if factor is None:
            raise NotPositiveDefiniteError
        return factor

    def factorise_like(
        self, equations: NormalEquations, matrix: BorderedMatrix, precision: np.dtype[Any] = DOUBLE
    ) -> Factor:
        """Factor of another matrix over the unknowns of some equations; valid until the next one."""
        if self._reduction is None or equations.chain is None:
            return self.symbolic.factorise(matrix, precision)
        reduced = self._reduction.reduced(matrix, equations.chain)
        return RigFactor(self.symbolic.factorise(reduced, precision), self._reduction, equations.chain)

    def own_blocks(self, equations: NormalEquations) -> np.ndarray:
        """(n, 6, 6) of the photographs, or of the stations where there are rigid rigs, all others known."""
        if self._reduction is None or equations.chain is None:
            return equations.matrix.blocks[: len(self.unknowns.images)].copy()
        return self._reduction.reduced(equations.matrix, equations.chain).blocks[: len(self._reduction.leads)]


def _is_within_reach(step: np.ndarray) -> bool:
    """Whether a step is made of numbers, none of them beyond `FARTHEST`."""
    return bool((np.abs(step) < _point_kernels.FARTHEST).all())
