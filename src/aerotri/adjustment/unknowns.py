"""The unknowns of an adjustment: which there are, in which order, and how a step changes them.

This is the only map between parameters and the vector x: six values a photograph (centre, small rotation about the
object axes), then the shared parameters, then three values an object point.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.height_columns import relief_of
from aerotri.adjustment.kernel_records import RayArrays, Scans
from aerotri.adjustment.photograph_fields import add_photograph_fields
from aerotri.adjustment.photograph_pairs import ordered, photograph_pairs
from aerotri.adjustment.rig_ties import Ties
from aerotri.adjustment.rigging import Chain, Mountings, OnRigs, Rigging, photographs_on_rigs, with_leads
from aerotri.adjustment.scanning import NONE, Scanning, scanning_of
from aerotri.adjustment.shared_parameters import LensTable, LinearParameters, SharedList, lens_table, linear_parameters
from aerotri.conventions import InputError
from aerotri.functional_model.rotation import (
    angles_from_rotation,
    exponential,
    rotation_from_angles,
    small_rotation_per_angle,
)
from aerotri.observations import Block, Prior

ORIENTATION_ELEMENTS = ("X0", "Y0", "Z0", "omega", "phi", "kappa")
HELD_IN_CONDITIONS_M = 1e-6
"""σ of a held coordinate whose point is in a condition: there it stays an unknown [C]."""


@dataclass(frozen=True, eq=False)
class State:
    """Values of all unknowns; coordinates count from the local origin.

    Parameters
    ----------
    centre : (n, 3) m; rotation : (n, 3, 3); points : (P, 3) m; shared : (s,).
    """

    centre: np.ndarray
    rotation: np.ndarray
    points: np.ndarray
    shared: np.ndarray


@dataclass(frozen=True, eq=False)
class Step:
    """A change of all unknowns: images (n, 6), shared (s,), points (P, 3)."""

    images: np.ndarray
    shared: np.ndarray
    points: np.ndarray


@dataclass(frozen=True, eq=False)
class Rays:
    """Rays as `kernel_records` describes them.

    Parameters
    ----------
    source : (m,) their row in the block.
    held : (m, 2) mm, image errors by additional parameters that are held; None where there are none.
    """

    start: np.ndarray
    image: np.ndarray
    lens_row: np.ndarray
    xy: np.ndarray
    at: np.ndarray
    inv_sigma: np.ndarray
    ap_index: np.ndarray
    ap_value: np.ndarray
    source: np.ndarray
    held: np.ndarray | None = None

    def arrays(self) -> RayArrays:
        """As kernels take them: free of the image errors that are held."""
        xy = self.xy if self.held is None else self.xy - self.held
        return RayArrays(
            self.start, self.image, self.lens_row, xy, self.at, self.inv_sigma, self.ap_index, self.ap_value,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class FreeMotions:
    """What the observations leave free of the seven motions of the whole block: d independent ones.

    Parameters
    ----------
    basis : (7, d) combinations of X, Y, Z, the rotations and the scale.
    shared : (s, d) what shifts, drifts and conditions do along with them.
    """

    basis: np.ndarray
    shared: np.ndarray

    @property
    def count(self) -> int:
        return self.basis.shape[1]


@dataclass(frozen=True, eq=False)
class Unknowns:
    """The unknowns of one adjustment.

    Parameters
    ----------
    block : the block.
    images : (n,), points : (P,) rows of the block that take part.
    origin : (3,) m, the local origin.
    rays : the rays that take part.
    lens : interior orientation rows. linear : the linear additional parameters at every ray.
    shared : the shared parameters.
    eo_free : (n, 6) bool, point_free : (P, 3) bool: False where a value is held.
    by_angles : (n,) bool: small rotations run along ω, φ, κ, so that single angles can be held.
    prior_xyz, prior_weight : (P, 3) observed coordinates (local, m) and 1/σ², 0 where not observed.
    control_held : (P, 3) bool, coordinates of control without error (σ = 0): they keep their given value.
    kept : (P,) first of the three shared parameters that stand for a point which is not eliminated, −1 for the others.
    motions : what is free in a free block.
    pair_start, pair_block, block_row, block_col : pattern of the reduced normal matrix.
    rigging : which photographs follow others on a rigid rig; None where none does.
    scanning : the rolling shutters; None where there is none.
    ties : which photographs are tied to others on a weighted rig; None where none is.
    """

    block: Block
    images: np.ndarray
    points: np.ndarray
    origin: np.ndarray
    rays: Rays
    lens: LensTable
    linear: LinearParameters
    shared: SharedList
    eo_free: np.ndarray
    by_angles: np.ndarray
    point_free: np.ndarray
    prior_xyz: np.ndarray
    prior_weight: np.ndarray
    control_held: np.ndarray
    kept: np.ndarray
    motions: FreeMotions
    pair_start: np.ndarray
    pair_block: np.ndarray
    block_row: np.ndarray
    block_col: np.ndarray
    rigging: Rigging | None = None
    scanning: Scanning | None = None
    ties: Ties | None = None

    @property
    def mountings(self) -> Mountings | None:
        """The cameras on rigs; None where there are none."""
        if self.rigging is not None:
            return self.rigging.mountings
        return None if self.ties is None else self.ties.mountings

    @property
    def count(self) -> int:
        """Number of unknowns."""
        followers = 0 if self.rigging is None else len(self.rigging.followers)
        return int(self.eo_free.sum() - 6 * followers + self.point_free.sum() + len(self.shared))

    def chain(self, state: State) -> Chain | None:
        """What the orientations of photographs at `state` are of stations and mountings; None without rigid rigs."""
        if self.rigging is None:
            return None
        return self.rigging.chain(state.rotation, state.shared, self.turn(state), self.eo_free)

    def interior(self, state: State) -> np.ndarray:
        """(L, 24) interior elements and lens parameters at `state`."""
        table = self.lens.base.copy()
        free = self.lens.columns >= 0
        table[free] = state.shared[self.lens.columns[free]]
        return table

    def scans(self, state: State) -> Scans:
        """What photographs of rolling shutters do while they are read, as kernels take it."""
        return NONE if self.scanning is None else self.scanning.arrays(state.shared)

    def turn(self, state: State) -> np.ndarray:
        """(n, 3, 3) δ = turn·q for the three rotation unknowns q: the identity, or ω, φ, κ where angles are held."""
        turn = np.broadcast_to(np.eye(3), (len(self.images), 3, 3)).copy()
        if self.by_angles.any():
            angles = angles_from_rotation(state.rotation[self.by_angles], self.block.rotation)
            turn[self.by_angles] = small_rotation_per_angle(angles, self.block.rotation)
        return turn

    def advance(self, state: State, step: Step) -> State:
        """The state after a step."""
        rotation = exponential(step.images[:, 3:]) @ state.rotation
        if self.by_angles.any():
            # adding to the angles themselves keeps a held angle exactly, where turning would do so to first order
            angles = angles_from_rotation(state.rotation[self.by_angles], self.block.rotation)
            rotation[self.by_angles] = rotation_from_angles(
                angles + step.images[self.by_angles, 3:], self.block.rotation
            )
        return self.with_kept_points(
            self.with_followers(
                State(
                    centre=state.centre + step.images[:, :3],
                    rotation=rotation,
                    points=state.points + step.points,
                    shared=state.shared + step.shared,
                )
            )
        )

    def with_followers(self, state: State) -> State:
        """The state with the photographs of rigid rigs where their stations and mountings put them."""
        if self.rigging is None:
            return state
        centre, rotation = self.rigging.placed(state.centre, state.rotation, state.shared)
        return replace(state, centre=centre, rotation=rotation)

    @property
    def point_held(self) -> np.ndarray:
        """(P, 3) bool, coordinates held: for the datum, or as control without error."""
        return ~self.point_free & (self.kept < 0)[:, None]

    @property
    def given(self) -> np.ndarray:
        """(P, 3) bool, coordinates that control gives: observed, or held."""
        return (self.prior_weight > 0.0) | self.control_held

    @property
    def kept_rows(self) -> np.ndarray:
        """Rows of the points that are not eliminated."""
        return np.flatnonzero(self.kept >= 0)

    @property
    def kept_columns(self) -> np.ndarray:
        """(·, 3) shared parameters of `kept_rows`."""
        return self.kept[self.kept_rows][:, None] + np.arange(3)

    def with_kept_points(self, state: State) -> State:
        """The state with the points that are not eliminated taken from the shared parameters."""
        if (self.kept < 0).all():
            return state
        points = state.points.copy()
        points[self.kept_rows] = state.shared[self.kept_columns]
        return replace(state, points=points)

    def name_of(self, column: int) -> str:
        """Name of an unknown of the reduced system, for messages: 'X0 of photo 1' or 'bluh.1 (ucd8)'."""
        n = 6 * len(self.images)
        if column < n:
            image = self.block.images.names[self.images[column // 6]]
            return f"{ORIENTATION_ELEMENTS[column % 6]} of {image}"
        return f"{self.shared.names[column - n]} ({self.shared.groups[column - n]})"


@dataclass(frozen=True, eq=False)
class StartValues:
    """Where the adjustment begins, in local coordinates; NaN where there is no value.

    Parameters
    ----------
    origin : (3,) m. rotation : (n, 3, 3), centre : (n, 3), points : (N, 3), rows as in the block.
    at : (m, 2) mm, where the rays are evaluated; as measured where None.
    """

    origin: np.ndarray
    rotation: np.ndarray
    centre: np.ndarray
    points: np.ndarray
    at: np.ndarray | None = None


def build_unknowns(block: Block, start: StartValues, active: np.ndarray) -> tuple[Unknowns, State]:
    """Unknowns and start state of the rays that take part.

    Parameters
    ----------
    active : (m,) bool, rays of the block to adjust; their photographs and points have start values.
    """
    source, images, points, ray_image, row_start = _sort_rays(block, active, start.centre)
    shared = SharedList()
    lens = lens_table(block, images, shared)
    # by `take`, which is three times as fast as an index
    xy = block.image_points.xy.take(source, axis=0)
    at = xy if start.at is None else start.at.take(source, axis=0)
    linear = linear_parameters(block, images, ray_image, shared)
    if block.settings.photograph_fields.correlated == "on":
        linear = linear.beside(add_photograph_fields(block, images, ray_image, shared))
    on_rigs = photographs_on_rigs(block, images, shared, start.centre, start.rotation)
    tied = np.zeros((0, 2), dtype=np.int64)
    if on_rigs is not None:
        tied = np.stack([on_rigs.lead[on_rigs.tied], on_rigs.tied], axis=1)
    scanning = scanning_of(block, images, shared, start.centre[images], start.rotation[images])
    if linear.heights is not None:
        linear = linear.at(relief_of(start.centre[images], start.points[points], ray_image, row_start))
    columns = linear.columns(at)
    rays = Rays(
        row_start, ray_image, lens.of_image[ray_image], xy, at, 1.0 / block.image_points.sigma.take(source, axis=0),
        columns.index, columns.value, source, linear.held.image_errors(at),
    )  # fmt: skip
    pair_start, pair_block, block_row, block_col, tie_block = _pattern(len(images), row_start, ray_image, tied)
    prior_xyz, prior_weight, held = _control_priors(block, points, start.origin)
    unknowns = Unknowns(
        block=block,
        images=images,
        points=points,
        origin=start.origin,
        rays=rays,
        lens=lens,
        linear=linear,
        shared=shared,
        eo_free=np.ones((len(images), 6), dtype=bool),
        by_angles=np.zeros(len(images), dtype=bool),
        point_free=~held,
        prior_xyz=prior_xyz,
        prior_weight=prior_weight,
        control_held=held,
        kept=np.full(len(points), -1, dtype=np.int64),
        motions=FreeMotions(np.eye(7), np.zeros((len(shared), 7))),
        pair_start=pair_start,
        pair_block=pair_block,
        block_row=block_row,
        block_col=block_col,
        rigging=None if on_rigs is None else on_rigs.rigging,
        ties=None if on_rigs is None or not len(tied) else _ties(on_rigs, tie_block),
        scanning=scanning,
    )
    xyz = np.where(held, prior_xyz, start.points[points])
    state = State(start.centre[images].copy(), start.rotation[images].copy(), xyz, np.array(shared.start))
    return unknowns, unknowns.with_followers(state)


def _sort_rays(block: Block, active: np.ndarray, centre: np.ndarray):
    """Active rays by point, points by their first photograph: neighbours in memory are neighbours in the air."""
    rows = np.flatnonzero(active)
    ray_image, ray_point = block.image_points.image[rows], block.image_points.point[rows]
    there = np.flatnonzero(np.bincount(ray_image, minlength=len(block.images)))
    images = with_leads(block, there, centre)
    row_of_image = np.zeros(len(block.images), dtype=np.int64)
    row_of_image[images] = np.arange(len(images))
    ray_image = row_of_image[ray_image]
    counts = np.bincount(ray_point, minlength=len(block.points))
    points = np.flatnonzero(counts)
    first_image = np.full(len(block.points), len(images))
    np.minimum.at(first_image, ray_point, ray_image)
    points = points[np.argsort(first_image[points], kind="stable")]
    rank = np.empty(len(block.points), dtype=np.int64)
    rank[points] = np.arange(len(points))
    row_start = np.concatenate([[0], np.cumsum(counts[points])]).astype(np.int64)
    first_of_image = np.concatenate([[0], np.cumsum(np.bincount(ray_image, minlength=len(images)))[:-1]])
    by_image = ordered(ray_image, first_of_image, np.arange(len(rows)))
    order = ordered(rank[ray_point], row_start[:-1], by_image)
    return rows[order], images, points, ray_image[order], row_start


def _ties(on_rigs: OnRigs, block: np.ndarray) -> Ties:
    """The photographs on weighted rigs, with the σ of their movements; those to be estimated begin without."""
    rows = on_rigs.tied
    return Ties(rows, on_rigs.lead[rows], block, on_rigs.mounting[rows], on_rigs.mountings, on_rigs.movement)


def _pattern(n: int, row_start: np.ndarray, ray_image: np.ndarray, tied: np.ndarray):
    """Pairs of photographs that share a point, as blocks of the reduced matrix: diagonal first, then row < column.

    Pairs that are tied (t, 2) have a block of their own; its place comes last.
    """
    pairs = photograph_pairs(row_start, ray_image, n, tied, first_number=n)
    block_row = np.concatenate([np.arange(n), pairs.first])
    block_col = np.concatenate([np.arange(n), pairs.second])
    return pairs.start, pairs.of_rays, block_row, block_col, pairs.of_ties


def _control_priors(block: Block, points: np.ndarray, origin: np.ndarray):
    """(P, 3) given coordinates, their weights, and which of them are held."""
    xyz, weight, held = np.zeros((len(points), 3)), np.zeros((len(points), 3)), np.zeros((len(points), 3), dtype=bool)
    if block.settings.adjustment.datum != "control":
        return xyz, weight, held
    row_of_point = np.full(len(block.points), -1)
    row_of_point[points] = np.arange(len(points))
    control = block.control
    used = np.flatnonzero(~control.is_check & (row_of_point[control.point] >= 0))
    rows = row_of_point[control.point[used]]
    known = np.isfinite(control.xyz[used])
    xyz[rows] = np.where(known, control.xyz[used] - origin, 0.0)
    held[rows] = known & (control.sigma[used] == 0.0)
    observed = known & ~held[rows]
    weight[rows] = np.where(observed, 1.0 / np.where(observed, control.sigma[used], 1.0) ** 2, 0.0)
    return xyz, weight, held


def keep_points(unknowns: Unknowns, state: State, rows: np.ndarray) -> Unknowns:
    """The unknowns with points that conditions tie together moved from elimination to the shared parameters."""
    kept, point_free = unknowns.kept.copy(), unknowns.point_free.copy()
    weights = unknowns.prior_weight.copy()
    weights[rows] = np.where(unknowns.control_held[rows], HELD_IN_CONDITIONS_M**-2, weights[rows])
    for row in rows:
        name = str(unknowns.block.points[unknowns.points[row]])
        columns = []
        for axis, letter in enumerate("XYZ"):
            weight = weights[row, axis]
            prior = Prior(unknowns.prior_xyz[row, axis], weight**-0.5 if weight > 0.0 else None)
            columns.append(unknowns.shared.add(letter, name, "point", prior=prior, start=state.points[row, axis]))
        kept[row] = columns[0]
        point_free[row] = False
    return replace(unknowns, kept=kept, point_free=point_free, prior_weight=weights)


def hold_orientation(unknowns: Unknowns, held: tuple[tuple[str, str], ...]) -> Unknowns:
    """The unknowns with single orientation elements held at their start values.

    Parameters
    ----------
    held : (image name, element) pairs, elements of `ORIENTATION_ELEMENTS`.
    """
    eo_free, by_angles = unknowns.eo_free.copy(), unknowns.by_angles.copy()
    row = {str(name): k for k, name in enumerate(unknowns.block.images.names[unknowns.images])}
    for image, element in held:
        if image in row:
            if unknowns.rigging is not None and unknowns.rigging.mounting[row[image]] >= 0:
                raise InputError(
                    f"datum_fixed holds '{image}:{element}', but the photograph follows another one on a rigid rig",
                    "hold elements of photographs of the reference camera",
                    file="block.toml",
                )
            column = ORIENTATION_ELEMENTS.index(element)
            eo_free[row[image], column] = False
            by_angles[row[image]] |= column >= 3
    return replace(unknowns, eo_free=eo_free, by_angles=by_angles)


def hold_points(unknowns: Unknowns, held: list[tuple[int, int]]) -> Unknowns:
    """The unknowns with single point coordinates held: (row of `unknowns.points`, axis) pairs."""
    point_free = unknowns.point_free.copy()
    for row, axis in held:
        point_free[row, axis] = False
    return replace(unknowns, point_free=point_free)
