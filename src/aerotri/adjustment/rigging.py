"""Rigid rigs among the unknowns: photographs that follow the reference photograph of their station.

R = R_s·R_k, X0 = X0_s + R_s·t_k [D]. The six unknowns are those of the station; position t_k and the angles of R_k are
shared parameters. Kernels go on seeing six unknowns a photograph: what these are of station and mounting is a 6 × 6
each, once a photograph and linearisation, and `rig_reduction` brings the normal equations to the stations by them.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations, product
from typing import NamedTuple

import numpy as np

from aerotri.adjustment.shared_parameters import SharedList
from aerotri.conventions import InputError
from aerotri.functional_model.rotation import (
    OMEGA_PHI_KAPPA,
    angles_from_rotation,
    cross_matrix,
    exponential,
    logarithm,
    rotation_from_angles,
    small_rotation_per_angle,
)
from aerotri.observations import Block, Prior
from aerotri.observations.rigs import Mounting, StationPlaces, station_places

KIND = "rig"
"""Kind of the shared parameters of mountings."""
ELEMENTS = ("x", "y", "z", "omega", "phi", "kappa")
STEEP = np.radians(75.0)
"""Middle angle of a mounting from which angles run from its start instead: at 90° they would be none of their own."""
SAMPLE = 400
"""Stations of which the mean of relative orientations is taken, at most."""


class Chain(NamedTuple):
    """What the orientation of every photograph is of its station and mounting; see `_rig_kernels`."""

    by_station: np.ndarray
    by_mounting: np.ndarray
    columns: np.ndarray


@dataclass(frozen=True, eq=False)
class Mountings:
    """The mountings of the cameras on rigs, k of them.

    Parameters
    ----------
    cameras : names. columns : (k, 6) shared parameters of position and angles, −1 where an element is held.
    value : (k, 6) m and rad, values of elements that are held.
    left : (k, 3, 3) R_k = left·R(angles): the identity, or the start of a mounting that is nearly steep.
    order : of the angles.
    """

    cameras: tuple[str, ...]
    columns: np.ndarray
    value: np.ndarray
    left: np.ndarray
    order: str

    def values(self, shared: np.ndarray) -> np.ndarray:
        """(k, 6) position and angles at shared parameters (s,)."""
        if not len(shared):
            return self.value
        return np.where(self.columns >= 0, shared[np.maximum(self.columns, 0)], self.value)

    def at(self, shared: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions (k, 3) m and rotations (k, 3, 3) at shared parameters (s,)."""
        values = self.values(shared)
        return values[:, :3], self.left @ rotation_from_angles(values[:, 3:], self.order)

    def axes(self, shared: np.ndarray) -> np.ndarray:
        """(k, 3, 3) small rotation about the axes of the reference camera for every angle, as columns."""
        return self.left @ small_rotation_per_angle(self.values(shared)[:, 3:], self.order)


@dataclass(frozen=True, eq=False)
class Rigging:
    """Which photographs of an adjustment follow others, n of them.

    Parameters
    ----------
    lead : (n,) row of the reference photograph of the station; the photograph's own row where it follows none.
    mounting : (n,) row of `mountings`, −1 of a photograph that follows none.
    """

    lead: np.ndarray
    mounting: np.ndarray
    mountings: Mountings

    @property
    def followers(self) -> np.ndarray:
        """Rows of the photographs that follow."""
        return np.flatnonzero(self.mounting >= 0)

    @property
    def leads(self) -> np.ndarray:
        """Rows of the photographs that follow none: those whose six unknowns there are."""
        return np.flatnonzero(self.mounting < 0)

    def placed(self, centre: np.ndarray, rotation: np.ndarray, shared: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Centres (n, 3) and rotations (n, 3, 3) with the followers where their stations and mountings put them."""
        rows = self.followers
        at, k = self.lead[rows], self.mounting[rows]
        position, turn = self.mountings.at(shared)
        centre, rotation = centre.copy(), rotation.copy()
        centre[rows] = centre[at] + np.einsum("nij,nj->ni", rotation[at], position[k])
        rotation[rows] = rotation[at] @ turn[k]
        return centre, rotation

    def chain(self, rotation: np.ndarray, shared: np.ndarray, turn: np.ndarray, eo_free: np.ndarray) -> Chain:
        """J and M of every photograph.

        Parameters
        ----------
        rotation : (n, 3, 3). shared : (s,). turn : (n, 3, 3) basis of the small rotations. eo_free : (n, 6) bool.
        """
        n, rows = len(self.lead), self.followers
        at, k = self.lead[rows], self.mounting[rows]
        position = self.mountings.values(shared)[:, :3]
        by_station = np.broadcast_to(np.eye(6), (n, 6, 6)).copy()
        by_mounting, columns = np.zeros((n, 6, 6)), np.full((n, 6), -1, dtype=np.int64)
        arm = np.einsum("nij,nj->ni", rotation[at], position[k])
        by_station[rows, :3, 3:] = -cross_matrix(arm) @ turn[at]
        by_station[rows, 3:, 3:] = turn[at]
        by_station[rows] *= eo_free[at][:, None, :]
        by_mounting[rows, :3, :3] = rotation[at]
        by_mounting[rows, 3:, 3:] = rotation[at] @ self.mountings.axes(shared)[k]
        columns[rows] = self.mountings.columns[k]
        by_mounting[rows] *= (columns[rows] >= 0)[:, None, :]
        return Chain(by_station, by_mounting, columns)

    def add_squares(self, chain: Chain, squares: np.ndarray, squares_shared: np.ndarray) -> None:
        """Squares of the columns of stations (n, 6) and mountings (s,) from those of the photographs that follow."""
        rows = self.followers
        np.add.at(squares, self.lead[rows], (chain.by_station[rows] ** 2 * squares[rows][:, :, None]).sum(axis=1))
        there = chain.columns[rows] >= 0
        of_mounting = (chain.by_mounting[rows] ** 2 * squares[rows][:, :, None]).sum(axis=1)
        np.add.at(squares_shared, chain.columns[rows][there], of_mounting[there])


def with_leads(block: Block, images: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """Photographs that take part, and the reference photographs of their stations, which carry the unknowns.

    Parameters
    ----------
    images : rows of the block's photographs. centre : (·, 3) start values of all, NaN where there is none.
    """
    return np.union1d(images, _oriented_places(block, centre).lead[images])


def _oriented_places(block: Block, centre: np.ndarray) -> StationPlaces:
    """Where the photographs belong; those whose reference photograph has no start value follow none."""
    places = station_places(block)
    there = np.isfinite(centre[places.lead, 0])
    own = np.arange(len(there))
    return StationPlaces(np.where(there, places.lead, own), np.where(there, places.mounting, -1), places.mountings)


@dataclass(frozen=True, eq=False)
class OnRigs:
    """The photographs on rigs, n of them, as `Rigging` has them; `rigid` says of which mountings (k,) they follow."""

    lead: np.ndarray
    mounting: np.ndarray
    mountings: Mountings
    rigid: np.ndarray
    movement: np.ndarray

    @property
    def tied(self) -> np.ndarray:
        """Rows of the photographs on weighted rigs beside the reference photographs."""
        return np.flatnonzero((self.mounting >= 0) & ~self.rigid[self.mounting])

    @property
    def rigging(self) -> Rigging | None:
        """The rigid part; None where nothing follows."""
        follows = (self.mounting >= 0) & self.rigid[self.mounting]
        if not follows.any():
            return None
        own = np.arange(len(self.lead))
        return Rigging(np.where(follows, self.lead, own), np.where(follows, self.mounting, -1), self.mountings)


def photographs_on_rigs(
    block: Block, images: np.ndarray, shared: SharedList, centre: np.ndarray, rotation: np.ndarray
) -> OnRigs | None:
    """The rigs of a block, their mountings appended to `shared`; None where there are none.

    Parameters
    ----------
    images : (n,) rows of the block's photographs that take part.
    centre, rotation : (·, 3), (·, 3, 3) start values of all photographs of the block.
    """
    places = _oriented_places(block, centre)
    if not (places.mounting[images] >= 0).any():
        return None
    row = np.full(len(block.images), -1)
    row[images] = np.arange(len(images))
    lead, mounting = row[places.lead[images]], places.mounting[images]
    used = np.unique(mounting[mounting >= 0])
    number = np.full(len(places.mountings), -1)
    number[used] = np.arange(len(used))
    mounting = np.where(mounting >= 0, number[mounting], -1)
    relative = relative_rotations(lead, mounting, rotation[images], len(used))
    mountings = list_mountings(block, places, used, shared, relative)
    on = [places.mountings[k] for k in used.tolist()]
    moves = [(rig.cameras[camera].movement_m, rig.cameras[camera].movement_rad) for rig, camera in on]
    return OnRigs(
        lead, mounting, mountings, np.array([rig.constraint == "rigid" for rig, _ in on]),
        np.array([[0.0 if m is None else m, 0.0 if r is None else r] for m, r in moves]),
    )  # fmt: skip


def relative_rotations(lead: np.ndarray, mounting: np.ndarray, rotation: np.ndarray, count: int) -> list[np.ndarray]:
    """Of every mounting (·, 3, 3) the rotations relative to the reference photographs, at stations that have both."""
    out = []
    for k in range(count):
        rows = np.flatnonzero((mounting == k) & np.isfinite(rotation[:, 0, 0]) & np.isfinite(rotation[lead, 0, 0]))
        out.append(np.swapaxes(rotation[lead[rows]], 1, 2) @ rotation[rows])
    return out


def robust_mean(rotations: np.ndarray) -> np.ndarray:
    """(3, 3) the rotation in the middle of others (k, 3, 3): medians of the small ones from the most central one."""
    some = rotations[:: max(len(rotations) // SAMPLE, 1)]
    apart = np.linalg.norm(logarithm(some[:, None] @ np.swapaxes(some, 1, 2)[None]), axis=2)
    central = some[int(np.argmin(np.median(apart, axis=1)))]
    return exponential(np.median(logarithm(rotations @ central.T), axis=0)) @ central


def list_mountings(
    block: Block, places: StationPlaces, used: np.ndarray, shared: SharedList, relative: list[np.ndarray]
) -> Mountings:
    """The mountings appended to `shared`: positions start as stated, rotations at their mean over stations."""
    count, cameras = len(used), []
    columns, value, left = np.full((count, 6), -1), np.zeros((count, 6)), np.zeros((count, 3, 3))
    for k, (rig, camera) in enumerate(places.mountings[m] for m in used.tolist()):
        mounting = rig.cameras[camera]
        if not mounting.known and not len(relative[k]):
            raise InputError(
                f"nothing says how camera '{camera}' is turned on the rig '{rig.name}'",
                f"give [rig.{rig.name}.camera.{camera}] rotation_deg, or orientations of photographs in images.csv",
                file="block.toml",
            )
        priors, start, left[k] = _prepared(mounting, relative[k], block.rotation, rig.name, camera)
        cameras.append(camera)
        for t, prior in enumerate(priors):
            value[k, t] = prior.value
            if not prior.fixed:
                columns[k, t] = shared.add(f"rig.{ELEMENTS[t]}", camera, KIND, prior=prior, start=start[t])
    return Mountings(tuple(cameras), columns, value, left, block.rotation)


def _prepared(
    mounting: Mounting, relative: np.ndarray, order: str, rig: str, camera: str
) -> tuple[tuple[Prior, ...], np.ndarray, np.ndarray]:
    """Priors and start values of the six elements, and the rotation that their angles stand before."""
    stated = np.array([prior.value for prior in mounting.elements])
    at = rotation_from_angles(stated[3:], order)
    mean = robust_mean(relative) if len(relative) else at
    # of what is stated, where it is: another set-up of the same block has to come to the same unknowns
    middle = angles_from_rotation(at if mounting.known else mean, order)[1 if order == OMEGA_PHI_KAPPA else 0]
    if abs(middle) < STEEP:
        angles = angles_from_rotation(mean, order)
        # the nearest turn, so that a value observed at 180° is not 360° away
        angles = stated[3:] + np.remainder(angles - stated[3:] + np.pi, 2.0 * np.pi) - np.pi
        return mounting.elements, np.concatenate([stated[:3], angles]), np.eye(3)
    given = mounting.rotation
    if len({(prior.sigma, prior.fixed) for prior in given}) > 1:
        raise InputError(
            f"camera '{camera}' of the rig '{rig}' has a middle angle near 90 degrees: single angles mean nothing",
            "give its three angles the same σ, or hold all three",
            file="block.toml",
        )
    left = at if mounting.known else _nearest_axes(mean)
    priors = tuple(Prior(0.0, prior.sigma, prior.fixed) for prior in given)
    start = np.zeros(3) if given[0].fixed else angles_from_rotation(left.T @ mean, order)
    return (*mounting.position, *priors), np.concatenate([stated[:3], start]), left


def _nearest_axes(rotation: np.ndarray) -> np.ndarray:
    """(3, 3) of the 24 turns that lead axes into axes the one nearest to a rotation."""
    turns = [
        np.array(signs)[:, None] * np.eye(3)[list(order)]
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
    ]
    return max((turn for turn in turns if np.linalg.det(turn) > 0.0), key=lambda turn: float(np.sum(turn * rotation)))
