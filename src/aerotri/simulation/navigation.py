"""Observed antenna positions and attitudes of the photographs."""

from __future__ import annotations

import numpy as np

from aerotri.functional_model.rotation import angles_from_rotation, rotation_from_angles
from aerotri.observations import GnssIns
from aerotri.simulation.flight import FlownImages
from aerotri.simulation.spec import GnssSpec, InsSpec


def observe_navigation(
    gnss: GnssSpec | None, ins: InsSpec | None, flown: FlownImages, order: str, rng: np.random.Generator
) -> GnssIns | None:
    """What GNSS and INS say, None when both are off.

    GNSS: X0 + R·lever_arm + shift + drift·(t − mean t of the strip) + noise + errors that stay for a while.
    INS: the angles of R·R_boresight + noise.

    Parameters
    ----------
    order : rotation order of the angles.
    """
    if gnss is None and ins is None:
        return None
    n = len(flown)
    nothing = np.full((n, 3), np.nan)
    xyz, sigma = _positions(gnss, flown, order, rng) if gnss is not None else (nothing, nothing)
    angles, angle_sigma = _attitudes(ins, flown, order, rng) if ins is not None else (nothing, nothing)
    if gnss is not None and any(gnss.correlated_sigma_m):
        xyz = xyz + _errors_that_stay(gnss, flown, rng)
    return GnssIns(np.arange(n), xyz, sigma, angles, angle_sigma, flown.time.copy())


def _positions(
    spec: GnssSpec, flown: FlownImages, order: str, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    strips, strip_of_image = np.unique(flown.strip, return_inverse=True)
    mean_time = np.bincount(strip_of_image, flown.time) / np.bincount(strip_of_image)
    shift = rng.normal(size=(len(strips), 3)) * np.array(spec.shift_sigma_m)
    drift = rng.normal(size=(len(strips), 3)) * np.array(spec.drift_sigma_m_s)
    sigma = np.tile(spec.sigma_m, (len(flown), 1))
    xyz = flown.centre + rotation_from_angles(flown.angles, order) @ np.array(spec.lever_arm_m)
    xyz = xyz + shift[strip_of_image] + drift[strip_of_image] * (flown.time - mean_time[strip_of_image])[:, None]
    return xyz + sigma * rng.normal(size=xyz.shape), sigma


def _errors_that_stay(spec: GnssSpec, flown: FlownImages, rng: np.random.Generator) -> np.ndarray:
    """(n, 3) m, a Gauss-Markov process of each coordinate: e(t) = e(t')·ρ + σ·√(1 − ρ²)·n, ρ = exp(−(t − t')/τ).

    It begins anew on every day.
    """
    errors, noise = np.zeros((len(flown), 3)), rng.normal(size=(len(flown), 3))
    order = np.lexsort((flown.time, flown.day))
    last = -1
    for k in order:
        kept = 0.0
        if last >= 0 and flown.day[last] == flown.day[k]:
            kept = float(np.exp(-(flown.time[k] - flown.time[last]) / (spec.correlation_time_s or 1.0)))
        before = errors[last] if last >= 0 else np.zeros(3)
        errors[k] = kept * before + np.sqrt(1.0 - kept**2) * np.array(spec.correlated_sigma_m) * noise[k]
        last = int(k)
    return errors


def _attitudes(
    spec: InsSpec, flown: FlownImages, order: str, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    boresight = rotation_from_angles(np.radians(spec.boresight_deg), order)
    angles = angles_from_rotation(rotation_from_angles(flown.angles, order) @ boresight, order)
    sigma = np.tile(np.radians(spec.sigma_deg), (len(flown), 1))
    return angles + sigma * rng.normal(size=angles.shape), sigma
