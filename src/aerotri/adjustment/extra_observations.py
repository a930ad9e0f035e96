"""Observations beside the image points, from the block's tables: GNSS, INS, conditions between points.

What they need of unknowns of their own (shifts, drifts, boresight, planes) joins the shared parameters here.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerotri.adjustment.datum import ExtraObservations
from aerotri.adjustment.exposures import exposures_of
from aerotri.adjustment.joint_prior import JointPrior
from aerotri.adjustment.position_errors import KIND, error_nodes
from aerotri.adjustment.track_velocity import track_velocities
from aerotri.adjustment.unknowns import State, Unknowns, keep_points
from aerotri.conventions import InputError
from aerotri.functional_model.constraints import NO_BASIS, Constraint, ConstraintObservations, flat_basis
from aerotri.functional_model.observed_unknowns import AttitudeObservations, CentreObservations
from aerotri.functional_model.rotation import logarithm, rotation_from_angles
from aerotri.observations import Block, Prior
from aerotri.observations.block import Constraints, GnssIns
from aerotri.observations.rigs import station_places

LARGE_BORESIGHT = 0.2
"""Boresight (rad) beyond which the mean of the start values is taken out first, so that what is estimated is small."""


def extra_observations(unknowns: Unknowns, state: State) -> tuple[Unknowns, list[ExtraObservations]]:
    """The unknowns with what the observations add to them, and the observations."""
    extras: list[ExtraObservations] = []
    block = unknowns.block
    if block.gnss_ins is not None:
        for make in (_centres, _attitudes):
            observed = make(block.gnss_ins, unknowns, state)
            if observed is not None:
                extras.append(observed)
    if block.constraints is not None and len(block.constraints):
        unknowns, conditions = _constraints(block.constraints, unknowns, state)
        extras.append(conditions)
    # behind everything that acts on rays: the sums over points leave these columns out
    with_errors = [_with_errors(e, unknowns, state) if isinstance(e, CentreObservations) else e for e in extras]
    return unknowns, with_errors


def _with_errors(observed: CentreObservations, unknowns: Unknowns, state: State) -> CentreObservations:
    """The observed positions with unknowns for the errors that stay for a while, where these are known in size."""
    block, settings = unknowns.block, unknowns.block.settings.gnss
    sigma, time = settings.correlated_sigma_m, settings.correlation_time_s
    if settings.correlated == "off" or sigma is None or time is None or not any(sigma):
        return observed
    exposures = exposures_of(block, unknowns.images[observed.image], state.centre[observed.image])
    axes = [axis for axis in range(3) if sigma[axis] > 0.0]
    nodes = error_nodes(exposures, time, len(axes))
    m, first = len(nodes.rows), len(unknowns.shared)
    names = observed.labels[nodes.rows]
    columns = np.full((len(exposures), 3, 2), -1, dtype=np.int64)
    weight, precision = np.zeros((m * len(axes), m * len(axes))), nodes.precision(time)
    for number, axis in enumerate(axes):
        start = first + number * m
        for name in names:
            unknowns.shared.add(f"gnss.error_{'XYZ'[axis]}", str(name), KIND)
        columns[:, axis] = start + np.stack([nodes.before, nodes.after], axis=1)
        own = slice(number * m, (number + 1) * m)
        weight[own, own] = precision / sigma[axis] ** 2
    unknowns.shared.position_errors.append(JointPrior(np.arange(first, first + len(weight)), weight, len(weight)))
    left = nodes.left[:, None] * np.square(sigma)
    inv_sigma = np.where(
        observed.inv_sigma > 0.0, 1.0 / np.sqrt(1.0 / np.maximum(observed.inv_sigma, 1e-300) ** 2 + left), 0.0
    )
    by_nodes = np.stack([nodes.by_before, nodes.by_after], axis=1)
    return replace(observed, inv_sigma=inv_sigma, nodes=columns, by_nodes=by_nodes)


def _used_rows(observed: GnssIns, unknowns: Unknowns, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows of gnss_ins with a value whose photograph takes part, and the photographs' rows."""
    row = np.full(len(unknowns.block.images), -1)
    row[unknowns.images] = np.arange(len(unknowns.images))
    there = (row[observed.image] >= 0) & np.isfinite(values).any(axis=1)
    used = np.flatnonzero(there & once_a_station(unknowns.block, observed, there))
    return used, row[observed.image[used]]


def once_a_station(block: Block, observed: GnssIns, there: np.ndarray) -> np.ndarray:
    """(g,) bool, which rows of gnss_ins count on rigs: one a station, that of the reference camera where it has one.

    Parameters
    ----------
    there : (g,) bool, rows that have a value.
    """
    places = station_places(block)
    counts = np.ones(len(observed), dtype=bool)
    if not places:
        return counts
    lead, follows = places.lead[observed.image], places.mounting[observed.image] >= 0
    taken = set(observed.image[there & ~follows].tolist())
    for k in np.flatnonzero(there & follows).tolist():
        counts[k] = lead[k] not in taken
        taken.add(lead[k])
    return counts


def _times(observed: GnssIns, used: np.ndarray, strips: np.ndarray, wanted: str) -> np.ndarray:
    """(g,) s from the mean of the strip; an error where a time is missing that is needed."""
    time = observed.time[used]
    if wanted and not np.isfinite(time).all():
        raise InputError(
            f"{wanted} needs the time of every photograph",
            "add a column time, in seconds, or switch that parameter off in block.toml",
            file="gnss_ins.csv",
        )
    since = np.nan_to_num(time)
    for strip in set(strips.tolist()):
        since[strips == strip] -= since[strips == strip].mean()
    return since


def _groups(per: str, strips: np.ndarray) -> np.ndarray:
    return strips if per == "strip" else np.full(len(strips), "block", dtype=object)


def _columns(unknowns: Unknowns, name: str, letters: tuple[str, ...], groups: np.ndarray, known: np.ndarray):
    """(g, len(letters)) shared parameters, one per letter and group that has such an observation."""
    columns = np.full((len(groups), len(letters)), -1, dtype=np.int64)
    kind = name.partition(".")[0]
    for group in dict.fromkeys(groups.tolist()):
        own = groups == group
        for axis, letter in enumerate(letters):
            if known[own, axis].any():
                columns[own, axis] = unknowns.shared.add(f"{name}{letter}", str(group), kind)
    return columns


def _centres(observed: GnssIns, unknowns: Unknowns, state: State) -> CentreObservations | None:
    block, settings = unknowns.block, unknowns.block.settings.gnss
    used, row = _used_rows(observed, unknowns, observed.xyz)
    if not len(used):
        return None
    known = np.isfinite(observed.xyz[used])
    strips = np.asarray(block.images.strip, dtype=object)[observed.image[used]]
    needs_time = "a GNSS drift" if settings.drift != "off" else ""
    needs_time = "a GNSS time offset" if settings.time_offset != "off" else needs_time
    time = _times(observed, used, strips, needs_time)
    none = np.full((len(used), 3), -1, dtype=np.int64)
    xyz = np.where(known, observed.xyz[used] - unknowns.origin, 0.0)
    shift = (
        none
        if settings.shift == "off"
        else _columns(unknowns, "gnss.shift_", tuple("XYZ"), _groups(settings.shift, strips), known)
    )
    drift = (
        none
        if settings.drift == "off"
        else _columns(unknowns, "gnss.drift_", tuple("XYZ"), _groups(settings.drift, strips), known)
    )
    offset, velocity = np.full(len(used), -1, dtype=np.int64), np.zeros((len(used), 3))
    if settings.time_offset != "off":
        offset = _columns(unknowns, "gnss.time_offset", ("",), _groups(settings.time_offset, strips), known[:, :1])[
            :, 0
        ]
        velocity = _velocities(unknowns, state, row)
    return CentreObservations(
        labels=block.images.names[observed.image[used]],
        image=row,
        xyz=xyz,
        inv_sigma=np.where(known, 1.0 / (observed.sigma[used] * _noise_factor(unknowns)), 0.0),
        shift=shift,
        drift=drift,
        lever=_lever_columns(unknowns),
        lever_arm=np.array(settings.lever_arm_m),
        offset=offset,
        velocity=velocity,
        time=time,
    )


def _noise_factor(unknowns: Unknowns) -> np.ndarray:
    """(3,) factor of the σ of the table; 1 as long as it is not estimated."""
    plan, height = unknowns.block.settings.gnss.noise_factor or (1.0, 1.0)
    return np.array([plan, plan, height])


def _lever_columns(unknowns: Unknowns) -> np.ndarray:
    """(3,) shared parameters of a lever arm to be estimated, weighted by its σ; −1 where it is held."""
    settings = unknowns.block.settings.gnss
    if settings.lever_arm_sigma_m is None:
        return np.full(3, -1, dtype=np.int64)
    pairs = zip("xyz", settings.lever_arm_m, settings.lever_arm_sigma_m, strict=True)
    return np.array(
        [unknowns.shared.add(f"gnss.lever_arm_{a}", "block", "gnss", prior=Prior(v, s)) for a, v, s in pairs]
    )


def _velocities(unknowns: Unknowns, state: State, row: np.ndarray) -> np.ndarray:
    """(g, 3) m/s along the track at photographs, rows (g,) of those that take part; 0 where nothing tells it."""
    wanted = np.zeros(len(unknowns.images), dtype=bool)
    wanted[row] = True
    unstated = np.full(len(unknowns.images), np.nan)
    return track_velocities(unknowns.block, unknowns.images, state.centre, wanted, unstated).velocity[row]


def _attitudes(observed: GnssIns, unknowns: Unknowns, state: State) -> AttitudeObservations | None:
    block, settings = unknowns.block, unknowns.block.settings.ins
    used, row = _used_rows(observed, unknowns, observed.angles)
    used_all = np.isfinite(observed.angles[used]).all(axis=1)
    if not used_all.all():
        row = int(np.argmin(used_all))
        name = block.images.names[observed.image[used[row]]]
        raise InputError(
            f"only some of omega, phi, kappa are given for photograph '{name}'",
            "give all three, or none of them",
            file="gnss_ins.csv",
        )
    if not len(used):
        return None
    image = observed.image[used]
    strips = np.asarray(block.images.strip, dtype=object)[image]
    cameras = np.array([block.cameras[c].name for c in block.images.camera[image]], dtype=object)
    known = np.ones((len(used), 3), dtype=bool)
    time = _times(observed, used, strips, "an INS drift" if settings.drift != "off" else "")
    angles = observed.angles[used]
    rotation = rotation_from_angles(angles, block.rotation)
    none = np.full((len(used), 3), -1, dtype=np.int64)
    start = np.broadcast_to(np.eye(3), (len(used), 3, 3)).copy()
    if settings.boresight != "off":
        for camera in set(cameras.tolist()):
            own = cameras == camera
            start[own] = _boresight_start(np.swapaxes(state.rotation[row[own]], 1, 2) @ rotation[own])
    boresight = (
        none if settings.boresight == "off" else _columns(unknowns, "ins.boresight_", tuple("xyz"), cameras, known)
    )
    drift = none
    if settings.drift != "off":
        drift = _columns(unknowns, "ins.drift_", ("omega", "phi", "kappa"), _groups(settings.drift, strips), known)
    return AttitudeObservations(
        labels=block.images.names[image],
        image=row,
        rotation=rotation,
        angles=angles,
        order=block.rotation,
        inv_sigma=1.0 / observed.angles_sigma[used],
        boresight=boresight,
        boresight_start=start,
        drift=drift,
        time=time,
    )


def _boresight_start(turns: np.ndarray) -> np.ndarray:
    """(3, 3) the mean of rotations INS → camera where it is large, else the identity."""
    u, _, vt = np.linalg.svd(turns.mean(axis=0))
    mean = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    return mean if np.linalg.norm(logarithm(mean)) > LARGE_BORESIGHT else np.eye(3)


def _constraints(given: Constraints, unknowns: Unknowns, state: State) -> tuple[Unknowns, ConstraintObservations]:
    block = unknowns.block
    row = np.full(len(block.points), -1)
    row[unknowns.points] = np.arange(len(unknowns.points))
    for k, points in enumerate(given.points):
        missing = [str(block.points[p]) for p in points if row[p] < 0]
        if missing:
            raise InputError(
                f"the {given.kind[k]} condition names point '{missing[0]}', which is not adjusted",
                "measure it in two photographs, or remove the condition",
                file="constraints.csv",
            )
    wanted = np.unique(np.concatenate([row[points] for points in given.points]))
    unknowns = keep_points(unknowns, state, wanted)
    conditions = []
    for k, points in enumerate(given.points):
        kind = str(given.kind[k])
        rows = row[points]
        centre, basis = flat_basis(state.points[rows], kind) if kind in ("plane", "line") else NO_BASIS
        label = f"{kind} {' '.join(str(name) for name in block.points[points][:3])}" + (" …" if len(points) > 3 else "")
        count = {"plane": 3, "line": 4}.get(kind, 0)
        conditions.append(
            Constraint(
                kind=kind,
                label=label,
                columns=unknowns.kept[rows][:, None] + np.arange(3),
                extra=np.array(
                    [unknowns.shared.add(f"{kind}.{i}", label, "constraint") for i in range(count)], dtype=int
                ),
                value=float(given.value[k]) if np.isfinite(given.value[k]) else 0.0,
                sigma=float(given.sigma[k]),
                axes=np.eye(3) if given.axes is None else given.axes[k],
                curved=given.axes is not None,
                centre=centre,
                basis=basis,
            )
        )
    return unknowns, ConstraintObservations(tuple(conditions))
