"""Rigs in flight: at every exposure of the reference camera all cameras of the rig take a photograph."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from aerotri.conventions import InputError
from aerotri.functional_model.rotation import angles_from_rotation, exponential, rotation_from_angles
from aerotri.observations import Mounting, Prior, Rig
from aerotri.simulation.flight import FlownImages
from aerotri.simulation.spec import MountingSpec, RigSpec, SimulationSpec


def reference_cameras(spec: SimulationSpec) -> tuple[str, ...]:
    """The cameras that the flight plan may name: all but those that are mounted on a rig beside its reference camera.

    Raises
    ------
    InputError
        For a camera that is not there, or stands on two rigs.
    """
    taken: set[str] = set()
    for name, rig in spec.rig.items():
        for camera in (rig.reference, *rig.camera):
            if camera not in spec.camera:
                message = f"'rig.{name}' names the camera '{camera}', which is not there"
                raise InputError(message, f"there are {', '.join(spec.camera)}")
            if camera in taken:
                raise InputError(f"camera '{camera}' stands on a rig twice", "give every rig cameras of its own")
            taken.add(camera)
    mounted = {camera for rig in spec.rig.values() for camera in rig.camera}
    return tuple(name for name in spec.camera if name not in mounted)


def true_mountings(rigs: Mapping[str, RigSpec]) -> dict[str, np.ndarray]:
    """(6,) true position, m, and angles, rad, by camera."""
    return {
        camera: np.concatenate([mounting.position_m, np.radians(mounting.rotation_deg)])
        for rig in rigs.values()
        for camera, mounting in rig.camera.items()
    }


def tilted(flown: FlownImages, spec: SimulationSpec) -> FlownImages:
    """The flight with the reference cameras tilted as their rigs say."""
    names, angles = list(spec.camera), flown.angles.copy()
    for rig in spec.rig.values():
        if any(rig.tilt_deg):
            own = flown.camera == names.index(rig.reference)
            tilt = rotation_from_angles(np.radians(rig.tilt_deg), spec.rotation)
            angles[own] = angles_from_rotation(rotation_from_angles(angles[own], spec.rotation) @ tilt, spec.rotation)
    return replace(flown, angles=angles)


def with_rigs(flown: FlownImages, spec: SimulationSpec, rng: np.random.Generator) -> tuple[FlownImages, np.ndarray]:
    """The photographs of all cameras, those of a station one after the other, the reference camera first.

    A camera that has play is moved and turned anew at every exposure.

    Returns
    -------
    The photographs, and (n,) the row in `flown` of the reference photograph of each.
    """
    if not spec.rig:
        return flown, np.arange(len(flown))
    number = {name: k for k, name in enumerate(spec.camera)}
    rigs = {number[rig.reference]: rig for rig in spec.rig.values()}
    rotation = rotation_from_angles(flown.angles, spec.rotation)
    lead, name, camera, centre, turned = [], [], [], [], []
    for k in range(len(flown)):
        rig = rigs.get(int(flown.camera[k]))
        cameras = {} if rig is None else rig.camera
        own = str(flown.names[k])
        lead += [k] * (1 + len(cameras))
        name += [own, *(f"{own}_{camera}" for camera in cameras)]
        camera += [int(flown.camera[k]), *(number[camera] for camera in cameras)]
        centre.append(flown.centre[k])
        turned.append(rotation[k])
        if rig is not None:
            for at, turn in _at_exposure(rig, spec.rotation, k / max(len(flown) - 1, 1) - 0.5, rng):
                centre.append(flown.centre[k] + rotation[k] @ at)
                turned.append(rotation[k] @ turn)
    rows = np.array(lead)
    return replace(
        flown, names=np.array(name), camera=np.array(camera, dtype=np.int64), strip=flown.strip[rows],
        day=flown.day[rows], planned_centre=flown.planned_centre[rows], centre=np.array(centre),
        angles=angles_from_rotation(np.array(turned), spec.rotation), time=flown.time[rows],
        station=flown.names[rows],
    ), rows  # fmt: skip


def _at_exposure(rig: RigSpec, order: str, tau: float, rng: np.random.Generator) -> list[tuple[np.ndarray, np.ndarray]]:
    """Position (3,) and rotation (3, 3) of every mounted camera at one exposure, its play and drift included.

    Parameters
    ----------
    tau : −½ at the first exposure, ½ at the last.
    """
    out = []
    for mounting in rig.camera.values():
        position = rig.play_position_m if mounting.play_position_m is None else mounting.play_position_m
        rotation = rig.play_rotation_deg if mounting.play_rotation_deg is None else mounting.play_rotation_deg
        moved = position * rng.normal(size=3)
        about = np.radians(rotation) * rng.normal(size=3) + tau * np.radians(mounting.drift_rotation_deg)
        turn = exponential(about) @ rotation_from_angles(np.radians(mounting.rotation_deg), order)
        out.append((np.array(mounting.position_m) + moved, turn))
    return out


def stated_rigs(spec: SimulationSpec, rng: np.random.Generator) -> tuple[Rig, ...]:
    """The rigs as the block states them; what has a σ errs by it."""
    return tuple(
        Rig(
            name,
            rig.reference,
            {camera: _stated(mounting, rng) for camera, mounting in rig.camera.items()},
            rig.constraint,
        )
        for name, rig in spec.rig.items()
    )


def _stated(spec: MountingSpec, rng: np.random.Generator) -> Mounting:
    position = np.array(spec.position_m if spec.stated_position_m is None else spec.stated_position_m)
    angles = np.array(spec.rotation_deg if spec.stated_rotation_deg is None else spec.stated_rotation_deg)
    return Mounting(
        _priors(position, spec.position_sigma_m, spec.position_fixed, rng),
        _priors(np.radians(angles), _radians(spec.rotation_sigma_deg), spec.rotation_fixed, rng),
    )


def _radians(sigma: tuple[float, float, float] | None) -> tuple[float, ...] | None:
    return None if sigma is None else tuple(np.radians(sigma).tolist())


def _priors(
    value: np.ndarray, sigma: tuple[float, ...] | None, fixed: bool, rng: np.random.Generator
) -> tuple[Prior, Prior, Prior]:
    if sigma is not None:
        value = value + np.array(sigma) * rng.normal(size=3)
    a, b, c = (Prior(float(v), None if sigma is None else sigma[k], fixed) for k, v in enumerate(value))
    return a, b, c
