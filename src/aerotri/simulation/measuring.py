"""From visible points to measured image points: what is measured at all, noise, gross errors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aerotri.conventions import InputError
from aerotri.memory import fitting, refuse_beyond_memory
from aerotri.observations import Camera
from aerotri.simulation.camera_errors import ImageError
from aerotri.simulation.projection import Photographs, Rays, inside_format, measured_rays, visible_rays
from aerotri.simulation.spec import GrossErrorSpec, TiePointSpec

PILOT_SHARE = 1.4
"""Candidates drawn first, over the number that the wanted rays need when every candidate counts."""
ROUNDS = 8
"""Rounds in which more candidates are drawn; chosen [C]: each round has up to four times as many as the one before; a
flight that needs more has hardly any overlap."""
BYTES_OF_RAY = 800
"""What the simulation takes for an image point at its peak, 500 measured, and its line of a table."""
HOPELESS = 1000
"""So many candidates without one usable point mean that the flight gives none."""


@dataclass(frozen=True, eq=False)
class Imaging:
    """How points become image points: the true photographs, and the image error of each.

    Parameters
    ----------
    photographs : orientations and cameras.
    day : (n,) str of each photograph.
    fields : by (camera name, day).
    reach_mm : (c,) bound of the image error, mm.
    """

    photographs: Photographs
    day: np.ndarray
    fields: Mapping[tuple[str, str], ImageError]
    reach_mm: Sequence[float]

    @property
    def cameras(self) -> tuple[Camera, ...]:
        return tuple(camera.nominal for camera in self.photographs.cameras)

    def rays(self, points: np.ndarray) -> Rays:
        """Rays to (N, 3) m with ideal positions, all that may lie inside the format once d is added."""
        return visible_rays(self.photographs, points, self.reach_mm)

    def measure(self, points: np.ndarray, ideal: Rays, margin_px: float) -> tuple[Rays, np.ndarray]:
        """The rays to (N, 3) m at their measured positions without noise, only those inside the format.

        Returns
        -------
        Rays, and (m,) index of them in `ideal`.
        """
        xy, ok = ideal.xy.copy(), np.zeros(len(ideal), bool)
        camera_of_ray, day_of_ray = self.photographs.camera[ideal.image], self.day[ideal.image]
        for k, camera in enumerate(self.cameras):
            for day in np.unique(self.day):
                own = np.flatnonzero((camera_of_ray == k) & (day_of_ray == day))
                field = self.fields[camera.name, str(day)]
                xy[own], solved = measured_rays(self.photographs, points, ideal.take(own), field)
                ok[own] = solved & inside_format(xy[own], camera, margin_px)
        kept = np.flatnonzero(ok)
        return Rays(ideal.image, ideal.point, xy).take(kept), kept


def tie_rays(
    spec: TiePointSpec,
    imaging: Imaging,
    candidates: Callable[[int], np.ndarray],
    rng_of: Callable[[], np.random.Generator],
    photographs: int | None = None,
) -> tuple[np.ndarray, Rays]:
    """Tie points and their measured rays, as many as the spec asks for.

    The number of points follows from points per image and rays per point. Candidates are drawn until enough of them
    keep the least number of rays.

    Parameters
    ----------
    candidates : (N, 3) m of the first N candidates.
    rng_of : a fresh generator, the same each time.
    photographs : for how many points are wanted; all that there are where None.

    Returns
    -------
    (N, 3) m and rays with noise-free measured positions.
    """
    count = len(imaging.photographs.centre) if photographs is None else photographs
    wanted_rays = count * spec.per_image
    refuse_beyond_memory(
        BYTES_OF_RAY * wanted_rays, f"{wanted_rays:.3g} image points",
        f"lower 'tie_points.per_image' to {fitting(BYTES_OF_RAY) / max(count, 1):.3g}",
    )  # fmt: skip
    number = int(PILOT_SHARE * wanted_rays / (spec.rays_per_point or 4.0)) + 10
    for _ in range(ROUNDS):
        points = candidates(number)
        rays = imaging.rays(points)
        draw = rng_of().random(len(rays))
        probability = spec.probability or 1.0
        if spec.rays_per_point is not None:
            probability = _probability(spec, rays, draw, len(points))
        chosen = _choose(spec, rays, draw, probability, len(points))
        measured, kept = imaging.measure(points, rays.take(chosen), spec.margin_px)
        draw = draw[chosen][kept]
        per_point = np.bincount(measured.point, minlength=len(points))
        usable = np.flatnonzero(per_point >= spec.min_rays)
        mean = per_point[usable].mean() if len(usable) else 0.0
        needed = max(round(wanted_rays / mean), 1) if mean else 2 * number
        if len(usable) >= needed:
            return _first(points, measured, usable[:needed])
        if len(usable) == 0 and number > HOPELESS:
            break
        number = int(number * np.clip(1.1 * needed / max(len(usable), 1), 1.2, 4.0)) + 10
    raise InputError(
        "'tie_points' leaves hardly a point with enough rays", "raise probability or overlap, lower min_rays"
    )


def _first(points: np.ndarray, rays: Rays, used: np.ndarray) -> tuple[np.ndarray, Rays]:
    number = np.full(len(points), -1)
    number[used] = np.arange(len(used))
    keep = number[rays.point] >= 0
    return points[used], Rays(rays.image[keep], number[rays.point[keep]], rays.xy[keep])


def _choose(spec: TiePointSpec, rays: Rays, draw: np.ndarray, probability: float, points: int) -> np.ndarray:
    """Index of the rays measured: those drawn below the probability, of a point at most max_rays."""
    chosen = np.flatnonzero(draw < probability)
    if spec.max_rays is None:
        return chosen
    order = chosen[np.lexsort((draw[chosen], rays.point[chosen]))]
    count = np.bincount(rays.point[order], minlength=points)
    rank = np.arange(len(order)) - np.repeat(np.cumsum(count) - count, count)
    return np.sort(order[rank < spec.max_rays])


def _probability(spec: TiePointSpec, rays: Rays, draw: np.ndarray, points: int) -> float:
    """The probability of a measurement that gives the wanted mean of rays over the points that keep min_rays."""

    def mean(probability: float) -> float:
        count = np.bincount(rays.point[draw < probability], minlength=points)
        count = np.minimum(count, spec.max_rays or count.max(initial=0))
        return float(count[count >= spec.min_rays].mean()) if (count >= spec.min_rays).any() else 0.0

    wanted = spec.rays_per_point or 0.0
    if mean(1.0) < wanted:
        raise InputError(
            f"'tie_points.rays_per_point' asks for {wanted:g}, the flight gives at most {mean(1.0):.2f}",
            "ask for fewer or overlap the images more",
        )
    low, high = 0.0, 1.0
    for _ in range(30):
        middle = (low + high) / 2.0
        low, high = (middle, high) if mean(middle) < wanted else (low, middle)
    if abs(mean(high) - wanted) > 0.05 * wanted:
        raise InputError(
            f"'tie_points.rays_per_point' = {wanted:g} is too few for min_rays = {spec.min_rays}", "raise it"
        )
    return high


def gross_errors(
    spec: GrossErrorSpec, xy: np.ndarray, sigma: np.ndarray, half_format: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Gross errors: uniform in size, random in direction, turned round where they would leave the format.

    Parameters
    ----------
    xy : (m, 2) mm, the rays that may get one; sigma : (m, 2) mm; half_format : (m, 2) mm of their cameras.

    Returns
    -------
    (k,) index into the rays, rising, and (k, 2) mm.
    """
    count = round(spec.fraction * len(xy))
    which = np.sort(rng.choice(len(xy), size=count, replace=False))
    size = rng.uniform(*spec.range_sigma, size=count)
    direction = rng.uniform(0.0, 2.0 * np.pi, size=count)
    error = size[:, None] * sigma[which] * np.stack([np.cos(direction), np.sin(direction)], axis=1)
    outside = np.any(np.abs(xy[which] + error) > half_format[which], axis=1)
    return which, np.where(outside[:, None], -error, error)
