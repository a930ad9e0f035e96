"""Do tie points lie on shadows? The place of a point in one strip and in the next, and how the sun moves shadows.

Errors of matching are as often to one side as to the other. Shadows all move the same way, the longer ones farther. The
adjustment takes a motion across the strips for a height in part; so what is found is compared with simulated shadows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri import geometry
from moving.flights import Flight

CELL_M = 80.0
"""Ground cells that are drawn again together for the σ of what is found: neighbours have errors in common."""
CLIP_M = 0.10
DRAWS = 400
SHADED, SHADED_CELL_M, HEIGHT_M = 0.3, 8.0, 1.5
"""Share of the ground that is shaded in the simulation, size of its cells, mean height of what throws the shadows [C]:
chosen so that strips differ by about as much as in the real block."""
AZIMUTHS = np.arange(0.0, 360.0, 15.0)
LARGE = 2.5
"""Differences of so many robust σ count as large."""


@dataclass(frozen=True, eq=False)
class Differences:
    """Points seen in two strips, k pairs.

    Parameters
    ----------
    d : (k, 2) m, east and north, place from the later strip − place from the earlier one, less the median of its pair
        of strips. time : (k,) s between them. cell : (k,) of the ground.
    """

    d: np.ndarray
    time: np.ndarray
    cell: np.ndarray

    def along(self, azimuth: np.ndarray) -> np.ndarray:
        """(k, a) m along azimuths (a,) in degrees, clipped."""
        angle = np.radians(azimuth)
        return np.clip(self.d @ np.stack([np.sin(angle), np.cos(angle)]), -CLIP_M, CLIP_M)


def differences(flight: Flight) -> Differences:
    """Of all points with two rays at least in each of two strips."""
    result = flight.adjusted.adjusted
    block, rays = result.block, result.rays
    points = block.image_points
    used = np.flatnonzero((rays.status == 0) & np.isfinite(rays.v).all(axis=1))
    image = points.image[used]
    rotation = geometry.rotation_from_angles(result.images.angles, block.rotation)[:, :2, :2]
    height = result.images.centre[image, 2] - result.points.xyz[points.point[used], 2]
    c = np.array([camera.focal_length_mm for camera in block.cameras])[block.images.camera[image]]
    on_ground = np.einsum("mij,mj->mi", rotation[image], -rays.v[used]) * (height / c)[:, None]
    group = (flight.strip * 8 + flight.landing)[image]
    key = points.point[used].astype(np.int64) * 1024 + group
    known, row, count = np.unique(key, return_inverse=True, return_counts=True)
    mean = np.stack([np.bincount(row, on_ground[:, k]) / count for k in (0, 1)], axis=1)
    time = np.bincount(row, flight.time[image]) / count
    keep = count >= 2
    point, strip, mean, time = known[keep] // 1024, known[keep] % 1024, mean[keep], time[keep]
    first, second = [], []
    for step in range(1, 6):
        same = np.flatnonzero(point[step:] == point[:-step])
        first.append(same)
        second.append(same + step)
    a, b = np.concatenate(first), np.concatenate(second)
    a, b = np.where(time[a] <= time[b], a, b), np.where(time[a] <= time[b], b, a)
    d = mean[b] - mean[a]
    pair = strip[a] * 1024 + strip[b]
    for number in np.unique(pair):
        d[pair == number] -= np.median(d[pair == number], axis=0)
    xy = np.floor(result.points.xyz[point[a], :2] / CELL_M).astype(np.int64)
    cell = np.unique(xy, axis=0, return_inverse=True)[1].ravel()
    return Differences(d, time[b] - time[a], cell)


def skewness(found: Differences, azimuth: np.ndarray) -> np.ndarray:
    """(a,) along azimuths: 0 where errors are as often to one side as to the other."""
    along = found.along(azimuth)
    return np.mean(along**3, axis=0) / np.mean(along**2, axis=0) ** 1.5


@dataclass(frozen=True)
class Skew:
    """Greatest skewness, its σ, its azimuth in degrees, and the σ of that."""

    value: float
    sigma: float
    azimuth: float
    azimuth_sigma: float


def greatest_skewness(found: Differences, rng: np.random.Generator) -> Skew:
    """With σ from ground cells drawn again with replacement."""
    fine = np.arange(0.0, 180.0, 5.0)
    along = found.along(fine)
    order = np.argsort(found.cell, kind="stable")
    first = np.flatnonzero(np.diff(found.cell[order], prepend=-1))
    square, cube = (np.add.reduceat(along[order] ** power, first, axis=0) for power in (2, 3))
    count = np.diff(np.append(first, len(order)))

    def of(rows: np.ndarray) -> np.ndarray:
        n = count[rows].sum()
        half = cube[rows].sum(axis=0) / n / (square[rows].sum(axis=0) / n) ** 1.5
        return np.append(half, -half)

    whole = of(np.arange(len(first)))
    k = int(whole.argmax())
    again = np.array([of(rng.integers(len(first), size=len(first))) for _ in range(DRAWS)])
    away = (5.0 * (again.argmax(axis=1) - k) + 180.0) % 360.0 - 180.0
    return Skew(float(whole[k]), float(again[:, k].std()), 5.0 * k, float(np.sqrt(np.mean(away**2))))


def large_by_azimuth(found: Differences) -> tuple[np.ndarray, float]:
    """Share of the differences that are large, by the azimuth (`AZIMUTHS`, middle of the sector); what is large, m."""
    limit = LARGE * 1.4826 * float(np.median(np.abs(found.d)))
    return share_beyond(found, limit), limit


def share_beyond(found: Differences, limit: float) -> np.ndarray:
    """Share of the differences larger than a limit (m), by the azimuth."""
    size = np.hypot(*found.d.T)
    large = size > limit
    step = AZIMUTHS[1] - AZIMUTHS[0]
    azimuth = np.degrees(np.arctan2(found.d[large, 0], found.d[large, 1]))
    sector = np.round(azimuth / step).astype(np.int64) % len(AZIMUTHS)
    return np.bincount(sector, minlength=len(AZIMUTHS)) / len(size)


def sun(latitude: float, longitude: float, day_of_year: int, hour_utc: float) -> tuple[float, float]:
    """Azimuth and elevation of the sun in degrees, to a tenth of a degree.

    [L: NOAA, General Solar Position Calculations]
    """
    g = 2.0 * np.pi / 365.0 * (day_of_year - 1 + (hour_utc - 12.0) / 24.0)
    minutes = 229.18 * (
        0.000075 + 0.001868 * np.cos(g) - 0.032077 * np.sin(g) - 0.014615 * np.cos(2 * g) - 0.040849 * np.sin(2 * g)
    )
    declination = (
        0.006918
        - 0.399912 * np.cos(g)
        + 0.070257 * np.sin(g)
        - 0.006758 * np.cos(2 * g)
        + 0.000907 * np.sin(2 * g)
        - 0.002697 * np.cos(3 * g)
        + 0.00148 * np.sin(3 * g)
    )
    angle = np.radians((60.0 * hour_utc + minutes + 4.0 * longitude) / 4.0 - 180.0)
    phi = np.radians(latitude)
    elevation = np.arcsin(np.sin(phi) * np.sin(declination) + np.cos(phi) * np.cos(declination) * np.cos(angle))
    azimuth = np.arctan2(-np.sin(angle), np.tan(declination) * np.cos(phi) - np.sin(phi) * np.cos(angle))
    return float(np.degrees(azimuth)) % 360.0, float(np.degrees(elevation))


def shadow_motion(before: tuple[float, float], after: tuple[float, float]) -> tuple[float, float]:
    """How the shadow of the top of an object 1 m high moves between two places of the sun: azimuth, length in m."""
    tip = [
        -np.array([np.sin(np.radians(a)), np.cos(np.radians(a))]) / np.tan(np.radians(e)) for a, e in (before, after)
    ]
    move = tip[1] - tip[0]
    return float(np.degrees(np.arctan2(*move))) % 360.0, float(np.hypot(*move))


def simulated_shift(flight: Flight, sun_at: list[tuple[float, float]], rng: np.random.Generator) -> np.ndarray:
    """(m, 2) mm, how shadows move the image points between the first and the last photograph.

    A share of the ground is shaded, in cells; a point there lies on the shadow of something of a height that is common
    to the cell up to a factor. The sun moves evenly between its two places (azimuth and elevation, degrees).
    """
    result, block = flight.adjusted.adjusted, flight.adjusted.block
    points, xyz = block.image_points, result.points.xyz
    cell = np.unique(np.floor(np.nan_to_num(xyz[:, :2]) / SHADED_CELL_M), axis=0, return_inverse=True)[1].ravel()
    cells = cell.max() + 1
    height = np.where(rng.random(cells) < SHADED, rng.exponential(HEIGHT_M, cells), 0.0)[cell]
    height *= rng.uniform(0.5, 1.5, len(cell))
    share = (flight.time / np.ptp(flight.time) - 0.5)[points.image]
    azimuth, length = shadow_motion(*sun_at)
    step = (height[points.point] * share * length)[:, None]
    move = step * [np.sin(np.radians(azimuth)), np.cos(np.radians(azimuth))]
    rotation = geometry.rotation_from_angles(result.images.angles, block.rotation)[:, :2, :2]
    above = result.images.centre[points.image, 2] - np.nanmedian(xyz[:, 2])
    c = np.array([camera.focal_length_mm for camera in block.cameras])[block.images.camera[points.image]]
    return np.einsum("mji,mj->mi", rotation[points.image], move) * (c / above)[:, None]
