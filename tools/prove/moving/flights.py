"""A block held by positions and control, adjusted, with what is known of how its photographs were taken.

Measures by strips that are found where the track turns, as an adjustment finds them: it looks within the package on
purpose.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

import aerotri
from aerotri.adjustment.track import strips_of_track

TURNED = np.radians(20.0)
"""Courses that differ by less were flown the same way."""
PAUSE_S = 60.0
"""Without a photograph for so long within a strip the drone had landed: the flight after it is another."""


@dataclass(frozen=True, eq=False)
class Flight:
    """An adjusted block, n photographs, m rays.

    Parameters
    ----------
    name : of the block. adjusted : its result.
    strip : (n,) number of the strip. course : (n,) rad, direction of the strip, from the X axis to the left.
    way : (n,) int, 0 or 1 (or more), strips flown the same way have the same. time : (n,) s, NaN where unknown.
    landing : (n,) int, which flight between two landings. rank : (n,) order in which they were taken.
    """

    name: str
    adjusted: aerotri.Adjustment
    strip: np.ndarray
    course: np.ndarray
    way: np.ndarray
    time: np.ndarray
    landing: np.ndarray
    rank: np.ndarray

    @property
    def used(self) -> np.ndarray:
        """(m,) bool, rays whose residuals say something: used, with redundancy."""
        rays = self.adjusted.adjusted.rays
        there = (rays.status == 0) & np.isfinite(rays.v).all(axis=1) & np.isfinite(rays.r).all(axis=1)
        return there & (np.nan_to_num(rays.r).min(axis=1) > LEAST_REDUNDANCY)

    @property
    def remaining(self) -> np.ndarray:
        """(m, 2) µm, measured − adjusted, over √r, gross errors drawn in by their robust weight."""
        rays = self.adjusted.adjusted.rays
        with np.errstate(invalid="ignore", divide="ignore"):
            return -1e3 * rays.v * rays.weight[:, None] / np.sqrt(rays.r)

    def later(self, lag: int) -> tuple[np.ndarray, np.ndarray]:
        """Photographs of one strip of which the second was taken `lag` after the first, without a landing between."""
        order = np.lexsort((self.rank, self.strip))
        a, b = order[:-lag], order[lag:]
        same = (self.strip[a] == self.strip[b]) & (self.landing[a] == self.landing[b])
        return a[same], b[same]

    @property
    def step(self) -> np.ndarray:
        """(n,) place within the strip, −1 the first photograph, +1 the last."""
        place = np.zeros(len(self.strip))
        for number in np.unique(self.strip):
            own = np.flatnonzero(self.strip == number)
            own = own[np.argsort(self.rank[own], kind="stable")]
            place[own] = np.linspace(-1.0, 1.0, len(own)) if len(own) > 1 else 0.0
        return place


LEAST_REDUNDANCY = 0.2
"""Redundancy number below which a residual says too little of its error."""


def flight_of(name: str, adjusted: aerotri.Adjustment, time: np.ndarray) -> Flight:
    """Strips, courses and landings of a block whose photographs stand in the order in which they were taken."""
    centre = adjusted.adjusted.images.centre
    strip = strips_of_track(centre, np.full(len(centre), ""))
    course = np.empty(len(centre))
    for number in np.unique(strip):
        own = np.flatnonzero(strip == number)
        leg = centre[own[-1]] - centre[own[0]] if len(own) > 1 else np.zeros(3)
        course[own] = np.arctan2(leg[1], leg[0])
    found: list[float] = []
    way = np.empty(len(centre), dtype=np.int64)
    for k, angle in enumerate(course):
        apart = [abs((angle - other + np.pi) % (2 * np.pi) - np.pi) for other in found]
        if not apart or min(apart) > TURNED:
            found.append(float(angle))
            apart.append(0.0)
        way[k] = int(np.argmin(apart))
    pause = np.diff(time, prepend=time[:1]) > PAUSE_S
    pause[1:] &= strip[1:] == strip[:-1]
    return Flight(name, adjusted, strip, course, way, time, np.cumsum(pause), np.arange(len(centre)))


def noise_alone(
    flight: Flight, adjust: Callable[[aerotri.Block], aerotri.Adjustment], seed: int, moved: np.ndarray | None = None
) -> Flight:
    """The same block with measurements that have white noise and nothing else: what the tests find in it is chance.

    The adjusted image points and positions are taken for true. The noise is drawn from the residuals of the block
    itself, each over the root of its redundancy number, so that it has its outliers. `moved` (m, 2) mm is added to the
    image points.
    """
    result, rng = flight.adjusted.adjusted, np.random.default_rng(seed)
    block, rays, used = flight.adjusted.block, result.rays, flight.used
    noise = -rays.v[used] / np.sqrt(rays.r[used])
    there = np.isfinite(rays.v).all(axis=1)
    xy = block.image_points.xy.copy()
    xy[there] += rays.v[there] + noise[rng.integers(len(noise), size=int(there.sum()))]
    if moved is not None:
        xy += moved
    images = replace(block.images, centre=result.images.centre, angles=result.images.angles)
    gnss, control = block.gnss_ins, block.control
    if gnss is not None:
        away = result.images.centre[gnss.image] - gnss.xyz
        away -= np.median(away, axis=0)
        gnss = replace(gnss, xyz=result.images.centre[gnss.image] - rng.permutation(away, axis=0))
    if len(control):
        xyz = result.points.xyz[control.point]
        control = replace(control, xyz=np.where(np.isfinite(xyz + control.xyz), xyz, control.xyz))
    points = replace(block.image_points, xy=xy)
    return replace(
        flight,
        name="white noise" if moved is None else "white noise and shadows",
        adjusted=adjust(replace(block, images=images, image_points=points, gnss_ins=gnss, control=control)),
    )
