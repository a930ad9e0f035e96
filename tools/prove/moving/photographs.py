"""Parameters of single photographs from the residuals, against what the flight was like at each of them.

The residuals of a photograph say how its image errors differ from those of the whole block, less what its points and
its orientation took. So the sizes here are too small by a factor that is the same for all photographs; tests and
correlations are not touched by it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import aerotri
from aerotri import geometry
from moving.flights import Flight
from moving.strips import SET, pattern_sizes

FEWEST = 60
"""Rays of a photograph below which its parameters are not estimated."""
WEAK = 3.0
"""A photograph counts where no parameter has a σ so many times the usual one: the rays have to fill the image."""
SHIFTS = 2000
LAGS = (1, 2, 3, 5, 10, 20)


@dataclass(frozen=True, eq=False)
class PhotographValues:
    """Parameters (n, K) µm RMS over the format of n photographs and σ (n, K) as the rays have it; NaN where too few."""

    names: tuple[str, ...]
    value: np.ndarray
    sigma: np.ndarray


def photograph_values(flight: Flight) -> PhotographValues:
    """Least squares in every photograph by itself, its orientation beside the parameters."""
    result = flight.adjusted.adjusted
    points, used, remaining = result.block.image_points, flight.used, flight.remaining
    value = sigma = None
    names: tuple[str, ...] = ()
    for k in range(len(result.block.images)):
        own = np.flatnonzero(used & (points.image == k))
        if len(own) < FEWEST:
            continue
        camera = result.block.cameras[result.block.images.camera[k]]
        names, unit = aerotri.parameters.patterns(SET, camera, points.xy[own])
        unit = unit / pattern_sizes(camera)
        turn = aerotri.parameters.orientation_patterns(points.xy[own], camera.focal_length_mm)
        design = np.concatenate([unit, turn / np.abs(turn).max(axis=(0, 1))], axis=2).reshape(2 * len(own), -1)
        found, _, rank, _ = np.linalg.lstsq(design, remaining[own].ravel(), rcond=None)
        if rank < design.shape[1]:
            continue
        rest = remaining[own].ravel() - design @ found
        s2 = float(rest @ rest) / (len(rest) - len(found))
        if value is None or sigma is None:
            value, sigma = (np.full((len(result.block.images), len(names)), np.nan) for _ in range(2))
        value[k] = found[: len(names)]
        sigma[k] = np.sqrt(s2 * np.diagonal(np.linalg.inv(design.T @ design)))[: len(names)]
    if value is None or sigma is None:
        value = sigma = np.full((len(result.block.images), 0), np.nan)
    weak = np.nan_to_num(sigma / np.nanmedian(sigma, axis=0)).max(axis=1) > WEAK
    value[weak], sigma[weak] = np.nan, np.nan
    return PhotographValues(names, value, sigma)


def conditions_of(flight: Flight) -> dict[str, np.ndarray]:
    """(n,) what the flight was like at every photograph: crab and tilts in degrees, their rates, place and order."""
    images = flight.adjusted.adjusted.images
    rotation = geometry.rotation_from_angles(images.angles, flight.adjusted.block.rotation)
    crab = (images.angles[:, 2] - flight.course + np.pi) % (2.0 * np.pi) - np.pi
    down = -rotation[:, :, 2]
    tilt = np.degrees(np.einsum("nij,ni->nj", rotation[:, :, :2], down * [1.0, 1.0, 0.0]))
    found = {"crab angle": np.degrees(crab), "tilt along image x": tilt[:, 0], "tilt along image y": tilt[:, 1]}
    inside = flight.strip[1:] == flight.strip[:-1]
    for name in tuple(found):
        rate = np.diff(found[name], prepend=found[name][:1])
        rate[1:][~inside] = 0.0
        found[f"change of {name}"] = rate
    axis = np.array([np.cos(flight.course[0]), np.sin(flight.course[0])])
    found["place along the strips"] = images.centre[:, :2] @ axis
    found["order within the strip"] = flight.step
    found["height of the ground"] = ground_heights(flight)
    return found


def ground_heights(flight: Flight) -> np.ndarray:
    """(n,) m, median height of the points in every photograph."""
    result = flight.adjusted.adjusted
    points, z = result.block.image_points, result.points.xyz[:, 2]
    used = flight.used
    return np.array(
        [
            np.nanmedian(z[points.point[used & (points.image == k)]]) if (points.image == k).any() else np.nan
            for k in range(len(result.block.images))
        ]
    )


def within_strips(flight: Flight, values: np.ndarray, there: np.ndarray) -> np.ndarray:
    """Values (n, …) less the mean of their strip (and of their part of it, where the drone landed)."""
    out = np.array(values, dtype=float)
    label = flight.strip * 100 + flight.landing
    for number in np.unique(label):
        own = (label == number) & there
        out[own] -= out[own].mean(axis=0)
    return out


def condition_test(flight: Flight, series: np.ndarray, condition: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """χ² over all parameters of the regression on a condition, and its probability.

    Within strips alone. The probability is that of the condition moved along within each strip by a random step, round
    the end: neighbouring photographs keep what they have in common.

    Returns
    -------
    χ² by degree of freedom as for independent photographs, probability, largest share of variance, its parameter.
    """
    there = np.isfinite(series).all(axis=1) & np.isfinite(condition)
    y = within_strips(flight, np.nan_to_num(series), there)[there]
    y = y / y.std(axis=0)
    label = (flight.strip * 100 + flight.landing)[there]
    own = [np.flatnonzero(label == number) for number in np.unique(label)]
    c = np.nan_to_num(condition)[there]

    def explained(moved: np.ndarray) -> np.ndarray:
        x = moved.copy()
        for rows in own:
            x[rows] -= x[rows].mean()
        return (x @ y) ** 2 / max(float(x @ x), 1e-30)

    def moved() -> np.ndarray:
        out = c.copy()
        for rows in own:
            out[rows] = np.roll(c[rows], int(rng.integers(len(rows))))
        return out

    found = explained(c)
    chance = np.array([explained(moved()).sum() for _ in range(SHIFTS)])
    p = (1.0 + np.sum(chance >= found.sum())) / (1.0 + SHIFTS)
    return np.array([found.mean(), chance.mean() / len(found), p, found.max() / len(y), found.argmax()])


def alike_after(flight: Flight, series: np.ndarray) -> dict[int, tuple[float, float]]:
    """Correlation of photographs of one strip by how many lie between, mean over all parameters, and its σ."""
    there = np.isfinite(series).all(axis=1)
    y = within_strips(flight, np.nan_to_num(series), there)
    y /= y[there].std(axis=0)
    out = {}
    for lag in LAGS:
        a, b = flight.later(lag)
        both = there[a] & there[b]
        if both.sum() < 5:
            continue
        product = (y[a] * y[b])[both].mean(axis=0)
        out[lag] = float(product.mean()), float(product.std(ddof=1) / np.sqrt(len(product)))
    return out


def attenuation(flight: Flight, group: np.ndarray, series: np.ndarray, of_groups: np.ndarray) -> float:
    """What share of a change of a group's parameters the residuals show: the slope of one on the other."""
    there = np.isfinite(series).all(axis=1)
    mean = np.stack([series[there & (group == k)].mean(axis=0) for k in range(len(of_groups))])
    mean, own = mean - mean.mean(axis=0), of_groups - of_groups.mean(axis=0)
    return float(np.sum(mean * own) / np.sum(own**2))
