"""How much residuals are alike: within a photograph, at the same place of two photographs, on the same ground."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from aerotri import geometry
from moving.flights import Flight

DISTANCES_PX = (0.0, 25.0, 50.0, 100.0, 200.0, 400.0, 800.0, 1600.0)
GROUND_M = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0)
SAME_PLACE_PX = 120.0
LAGS = (1, 2, 3, 5, 8, 12, 20, 30)
PAIRS_OF_PHOTOGRAPHS = 1500
CLIP = 3.0
"""Residuals count with this many σ at most."""


@dataclass
class Products:
    """Products of residuals of pairs, summed: x with x and y with y."""

    sums: np.ndarray = field(default_factory=lambda: np.zeros(2))
    squares: np.ndarray = field(default_factory=lambda: np.zeros(2))
    count: int = 0

    def add(self, a: np.ndarray, b: np.ndarray) -> None:
        product = a * b
        self.sums += product.sum(axis=0)
        self.squares += (product**2).sum(axis=0)
        self.count += len(product)

    @property
    def correlation(self) -> np.ndarray:
        """(2,) of x and y."""
        return self.sums / max(self.count, 1)

    @property
    def sigma(self) -> np.ndarray:
        """(2,) as for independent pairs."""
        return np.sqrt(self.squares) / max(self.count, 1)


def normalised(flight: Flight) -> np.ndarray:
    """(m, 2) residuals of mean square 1 in x and in y, gross ones clipped; NaN where not used."""
    u = flight.remaining.copy()
    u[~flight.used] = np.nan
    u -= np.nanmean(u, axis=0)
    u = np.clip(u / (1.4826 * np.nanmedian(np.abs(u), axis=0)), -CLIP, CLIP)
    return u / np.sqrt(np.nanmean(u**2, axis=0))


def rows_by_photograph(flight: Flight, u: np.ndarray) -> list[np.ndarray]:
    """Rays of every photograph that count."""
    image = flight.adjusted.block.image_points.image
    there = np.flatnonzero(np.isfinite(u).all(axis=1))
    there = there[np.argsort(image[there], kind="stable")]
    ends = np.searchsorted(image[there], np.arange(len(flight.strip) + 1))
    return [there[a:b] for a, b in itertools.pairwise(ends)]


def within_photographs(flight: Flight, u: np.ndarray) -> dict[tuple[float, float], Products]:
    """Pairs of rays of one photograph by their distance in px."""
    block = flight.adjusted.block
    found = {pair: Products() for pair in itertools.pairwise(DISTANCES_PX)}
    for k, rows in enumerate(rows_by_photograph(flight, u)):
        if len(rows) < 2:
            continue
        px = block.image_points.xy[rows] / block.cameras[block.images.camera[k]].pixel_mm
        pairs = cKDTree(px).query_pairs(DISTANCES_PX[-1], output_type="ndarray")
        far = np.linalg.norm(px[pairs[:, 0]] - px[pairs[:, 1]], axis=1)
        for (low, high), products in found.items():
            own = pairs[(far >= low) & (far < high)]
            products.add(u[rows[own[:, 0]]], u[rows[own[:, 1]]])
    return found


def on_the_ground(flight: Flight, u: np.ndarray) -> dict[tuple[float, float], tuple[Products, Products]]:
    """Pairs of points by their distance in plan: residuals in the same photograph, and in two photographs of a strip.

    Every pair of points is looked at in all photographs that have both, and in the ones next to these.
    """
    result = flight.adjusted.adjusted
    rays = result.block.image_points
    found = {pair: (Products(), Products()) for pair in itertools.pairwise(GROUND_M)}
    rows = rows_by_photograph(flight, u)
    following = dict(zip(*flight.later(1), strict=True))
    for k, own in enumerate(rows):
        beside = rows[following[k]] if k in following else own[:0]
        for other, place in ((own, 0), (beside, 1)):
            if not len(own) or not len(other):
                continue
            a, b = result.points.xyz[rays.point[own], :2], result.points.xyz[rays.point[other], :2]
            near = cKDTree(a).sparse_distance_matrix(cKDTree(b), GROUND_M[-1], output_type="coo_matrix")
            i, j, far = own[near.row], other[near.col], near.data
            keep = rays.point[i] < rays.point[j] if place == 0 else rays.point[i] != rays.point[j]
            for (low, high), products in found.items():
                inside = keep & (far >= low) & (far < high)
                products[place].add(u[i[inside]], u[j[inside]])
    return found


def of_the_same_point(flight: Flight, u: np.ndarray) -> Iterator[tuple[str, Products]]:
    """Pairs of rays of one point: in photographs of a strip by what lies between, and in neighbouring strips.

    Strips flown the other way have their residuals turned by 180°, so that the same side of the ground is meant.
    """
    points, rows = flight.adjusted.block.image_points.point, rows_by_photograph(flight, u)

    def of(pairs: list, sign: float) -> Products:
        found = Products()
        for a, b in pairs:
            _, i, j = np.intersect1d(points[rows[a]], points[rows[b]], return_indices=True)
            found.add(u[rows[a][i]], sign * u[rows[b][j]])
        return found

    for lag in (1, 2, 3, 4, 5):
        yield f"same strip, {lag} later", of(list(zip(*flight.later(lag), strict=True)), 1.0)
    centre = flight.adjusted.adjusted.images.centre
    camera = flight.adjusted.block.images.camera
    known = np.flatnonzero(np.isfinite(centre).all(axis=1))
    near = known[cKDTree(centre[known, :2]).query_pairs(2.5 * strip_distance(flight), output_type="ndarray")]
    other = near[(flight.strip[near[:, 0]] != flight.strip[near[:, 1]]) & (camera[near[:, 0]] == camera[near[:, 1]])]
    same = flight.way[other[:, 0]] == flight.way[other[:, 1]]
    yield "another strip, same direction", of(other[same].tolist(), 1.0)
    yield "another strip, other direction (turned)", of(other[~same].tolist(), -1.0)


def strip_distance(flight: Flight) -> float:
    """m, median distance of a photograph from the nearest one of another strip of the same camera."""
    centre, found = flight.adjusted.adjusted.images.centre, []
    camera, known = flight.adjusted.block.images.camera, np.isfinite(centre).all(axis=1)
    for number in np.unique(flight.strip):
        own = (flight.strip == number) & known
        others = (flight.strip != number) & known & (camera == camera[flight.strip == number][0])
        if others.any() and own.any():
            found.append(cKDTree(centre[others, :2]).query(centre[own, :2])[0])
    return float(np.nanmedian(np.concatenate(found))) if found else 1.0


def main_direction(
    flight: Flight, low: float, high: float, rng: np.random.Generator
) -> tuple[float, float, np.ndarray]:
    """In which direction of the ground residuals of neighbouring points in successive photographs are alike.

    Returns
    -------
    Azimuth of the largest in degrees, its σ (photographs drawn again), and the two principal values over the mean
    square of a residual.
    """
    result = flight.adjusted.adjusted
    points = result.block.image_points
    u = flight.remaining.copy()
    u[~flight.used] = np.nan
    scale = 1.4826 * np.nanmedian(np.abs(u))
    turn = geometry.rotation_from_angles(result.images.angles, result.block.rotation)[:, :2, :2]
    u = np.einsum("mij,mj->mi", turn[points.image], np.clip(u / scale, -CLIP, CLIP))
    rows, each = rows_by_photograph(flight, u), []
    for a, b in zip(*flight.later(1), strict=True):
        at, to = result.points.xyz[points.point[rows[a]], :2], result.points.xyz[points.point[rows[b]], :2]
        if not len(at) or not len(to):
            continue
        near = cKDTree(at).sparse_distance_matrix(cKDTree(to), high, output_type="coo_matrix")
        i, j = rows[a][near.row], rows[b][near.col]
        keep = (near.data >= low) & (points.point[i] != points.point[j])
        product = u[i[keep]].T @ u[j[keep]]
        each.append(np.array([product[0, 0], product[1, 1], 0.5 * (product[0, 1] + product[1, 0]), keep.sum()]))
    sums = np.array(each)

    def principal(total: np.ndarray) -> tuple[np.ndarray, float]:
        size, axes = np.linalg.eigh(np.array([[total[0], total[2]], [total[2], total[1]]]) / total[3])
        return size, float(np.degrees(np.arctan2(axes[0, 1], axes[1, 1]))) % 180.0

    size, azimuth = principal(sums.sum(axis=0))
    again = [principal(sums[rng.integers(len(sums), size=len(sums))].sum(axis=0))[1] for _ in range(300)]
    away = (np.array(again) - azimuth + 90.0) % 180.0 - 90.0
    return azimuth, float(np.sqrt(np.mean(away**2))), size / float(np.nanmean(u**2))


def at_the_same_place(flight: Flight, u: np.ndarray, rng: np.random.Generator) -> Iterator[tuple[str, Products]]:
    """Pairs of rays at the same place of the image in two photographs, by what lies between the photographs."""
    rows = rows_by_photograph(flight, u)
    strip, way, landing = flight.strip, flight.way, flight.landing
    n = len(strip)
    for lag in LAGS:
        yield f"same strip, {lag} later", _same_place(flight, u, rows, list(zip(*flight.later(lag), strict=True)))
    a, b = rng.integers(n, size=(2, 40 * PAIRS_OF_PHOTOGRAPHS))
    other, same = strip[a] != strip[b], way[a] == way[b]
    time = np.nan_to_num(np.abs(flight.time[a] - flight.time[b]))
    half = 0.5 * np.nan_to_num(np.ptp(flight.time))
    kinds = {
        "another strip, same direction": other & same,
        "another strip, other direction": other & ~same,
        "same direction, less than half of the flight apart": other & same & (time < half),
        "same direction, more than half of the flight apart": other & same & (time >= half),
    }
    if landing.max():
        kinds["same direction, after the landing"] = other & same & (landing[a] != landing[b])
    for name, chosen in kinds.items():
        pairs = list(zip(a[chosen][:PAIRS_OF_PHOTOGRAPHS], b[chosen][:PAIRS_OF_PHOTOGRAPHS], strict=True))
        yield name, _same_place(flight, u, rows, pairs)
    turned = other & ~same
    pairs = list(zip(a[turned][:PAIRS_OF_PHOTOGRAPHS], b[turned][:PAIRS_OF_PHOTOGRAPHS], strict=True))
    yield "other direction, image turned by 180°", _same_place(flight, u, rows, pairs, -1.0)


def _same_place(flight: Flight, u: np.ndarray, rows: list[np.ndarray], pairs: list, sign: float = 1.0) -> Products:
    """Products of the rays of pairs of photographs that lie within `SAME_PLACE_PX`; sign −1: of the image turned."""
    block, found = flight.adjusted.block, Products()
    xy, camera = block.image_points.xy, block.images.camera
    for a, b in pairs:
        if camera[a] != camera[b] or not len(rows[a]) or not len(rows[b]):
            continue
        reach = SAME_PLACE_PX * block.cameras[camera[a]].pixel_mm
        near = cKDTree(xy[rows[a]]).query_ball_point(sign * xy[rows[b]], reach)
        i = np.concatenate([np.asarray(own, dtype=np.int64) for own in near])
        j = np.repeat(np.arange(len(rows[b])), [len(own) for own in near])
        found.add(u[rows[a][i]], sign * u[rows[b][j]])
    return found


def within_a_pixel(flight: Flight, u: np.ndarray, parts: int = 8) -> tuple[np.ndarray, np.ndarray]:
    """Mean residual (parts, 2) by the place of the measurement within its pixel, and χ² by degree of freedom (2,)."""
    block = flight.adjusted.block
    pixel = np.array([c.pixel_mm for c in block.cameras])[block.images.camera[block.image_points.image]]
    size = np.array([c.size_px for c in block.cameras])[block.images.camera[block.image_points.image]]
    at = np.mod(block.image_points.xy / pixel[:, None] + size / 2.0, 1.0)
    there = np.isfinite(u).all(axis=1)
    part = np.minimum((at * parts).astype(np.int64), parts - 1)
    mean, chi = np.zeros((parts, 2)), np.zeros(2)
    for axis in (0, 1):
        count = np.bincount(part[there, axis], minlength=parts)
        mean[:, axis] = np.bincount(part[there, axis], u[there, axis], parts) / np.maximum(count, 1)
        chi[axis] = np.sum(mean[:, axis] ** 2 * count) / (parts - 1)
    return mean, chi
