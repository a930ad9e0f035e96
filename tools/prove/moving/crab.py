"""A constant lens error that the parameters do not have, seen as a change with the crab angle.

Along its track through the photographs of a strip a ground point moves against the course. An error that depends on the
coordinate across the track alone goes into the place of the point and is not seen. If the camera is turned by the crab
angle δ against the course, the tracks are oblique: x = x0 + δ·y, and of an error f(x) the part δ·y·f'(x) is seen. Its
sign changes with that of δ.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import aerotri
from moving.flights import Flight
from moving.photographs import conditions_of
from moving.strips import SET, StripValues

ACROSS_DEG = -90.0
"""κ less course where the image's y axis points along the flight."""


@dataclass(frozen=True, eq=False)
class CrabEffect:
    """What crab does to the parameters of the groups.

    Parameters
    ----------
    crab : (G,) degrees, mean of the groups. expected : (K,) µm for a degree, from a finer set.
    found, sigma : (K,) µm for a degree, one parameter by itself; sigma from the scatter that is left.
    factor, factor_sigma : found over expected, all parameters together.
    """

    crab: np.ndarray
    expected: np.ndarray
    found: np.ndarray
    sigma: np.ndarray
    factor: float
    factor_sigma: float


def crab_effect(flight: Flight, finer: aerotri.Adjustment, values: StripValues, group: np.ndarray) -> CrabEffect:
    """From the groups' parameters, and from the part of the finer set's image errors that the usual set has not."""
    angle = conditions_of(flight)["crab angle"]
    crab = np.array([angle[group == k].mean() for k in range(len(values.time))]) - ACROSS_DEG
    expected = values.project @ expected_for_a_degree(flight, finer, values)
    away = crab - crab.mean()
    weight = away / (away @ away)
    found = weight @ values.value
    rest = values.value - values.value.mean(axis=0) - np.outer(away, found)
    sigma = np.sqrt(np.sum(rest**2, axis=0) / (len(crab) - 2) / (away @ away))
    own = 1.0 / np.maximum(sigma, np.median(sigma)) ** 2
    strong = np.abs(expected) > 0.1 * np.abs(expected).max()
    norm = np.sum(own[strong] * expected[strong] ** 2)
    factor = float(np.sum((own * expected * found)[strong]) / norm)
    return CrabEffect(crab, expected, found, sigma, factor, float(1.0 / np.sqrt(norm)))


def expected_for_a_degree(flight: Flight, finer: aerotri.Adjustment, values: StripValues) -> np.ndarray:
    """(K,) µm: y·f'(x) for a degree as the usual set and the orientation of a photograph describe it."""
    camera = flight.adjusted.block.cameras[0]
    bx, by = camera.half_format_mm
    nx, ny = 81, 55
    xs, ys = np.linspace(-bx, bx, nx), np.linspace(-by, by, ny)
    at = np.stack([a.ravel() for a in np.meshgrid(xs, ys)], axis=1)
    names, unit = aerotri.parameters.patterns(SET, camera, at)
    turn = aerotri.parameters.orientation_patterns(at, camera.focal_length_mm)
    design = np.concatenate([unit, turn / np.abs(turn).max(axis=(0, 1))], axis=2).reshape(2 * len(at), -1)
    error = 1e3 * finer.image_errors_at(at)

    def described(field: np.ndarray) -> np.ndarray:
        return np.linalg.lstsq(design, field.ravel(), rcond=None)[0]

    left = error - (design @ described(error)).reshape(error.shape)
    across = left.reshape(ny, nx, 2).mean(axis=0)
    slope = np.gradient(across, xs, axis=0)
    seen = np.radians(1.0) * at[:, 1:2] * np.tile(slope, (ny, 1))
    amount = dict(zip(names, described(seen), strict=False))
    return np.array([amount[name] for name in values.names]) * values.size * 1e-3
