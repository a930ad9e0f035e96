"""Where the format of every photograph lies on the ground: rays around its edge, met with the ground of the points.

Rays are those of the adjusted cameras with their image errors. Of photographs that see the horizon the footprint ends
`FARTHEST` heights from the nadir; it is cut there along a circle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from aerotri.conventions import EARTH_RADIUS_M
from aerotri.deformation.model_grid import places_of
from aerotri.deformation.orientation import calibrated_orientation
from aerotri.deformation.point_ground import PointGround, ground_of_points
from aerotri.image_errors import image_groups
from aerotri.image_errors.error_function import errors_in_force
from aerotri.observations import Camera
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.adjustment import Adjustment

FARTHEST = 6.0
"""Distance from the nadir in heights above ground at which footprints end [C]: a ray falls by 9.5° there."""
PER_SIDE = 12
"""Rays along a side of the format [C]: a chord of a barrel distortion of 5 % then errs by less than 1/1000 of the
side."""
STEPS, HALVINGS = 24, 32
"""Places along a ray at which the ground is looked for between its lowest and highest point [C], and halvings then:
10⁻⁹ of the step."""
ARC_STEP = np.radians(5.0)
MOST_ANGLE = np.radians(179.0)
"""Off the axis of a fisheye; corners of its format may be farther, outside the circle of the image."""
SLACK = 1.1
"""By which rays are followed beyond the lowest ground [C]: the curvature of the earth lowers it by less."""


@dataclass(frozen=True, eq=False)
class Footprints:
    """Footprints of the n photographs of a block, in its CRS.

    Parameters
    ----------
    polygons : (n,) shapely MultiPolygons, None of a photograph that was not adjusted or sees no ground.
    is_cut : (n,) bool, whether a part of the format looks farther than `FARTHEST` heights.
    gsd : (n,) m, size of a pixel across the ray in the middle of the photograph. height : (n,) m, of the projection
        centre above the ground below it. tilt : (n,) rad, of the camera's axis off the vertical. NaN where not known.
    notes : sentences about what was done otherwise.
    """

    polygons: np.ndarray
    is_cut: np.ndarray
    gsd: np.ndarray
    height: np.ndarray
    tilt: np.ndarray
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Sights:
    """m rays: X = centre + t·direction, the ground falling away with the square of the distance.

    Parameters
    ----------
    centre, direction : (m, 3) m, in the CRS. height : (m,) m, of the centre above the ground. curvature : 1/m.
    """

    centre: np.ndarray
    direction: np.ndarray
    height: np.ndarray
    curvature: float

    def at(self, t: np.ndarray) -> np.ndarray:
        """(m, 3) m."""
        place = self.centre + t[:, None] * self.direction
        along = t * np.hypot(self.direction[:, 0], self.direction[:, 1])
        place[:, 2] += self.curvature / 2.0 * along**2
        return place

    def take(self, rows: np.ndarray, direction: np.ndarray) -> _Sights:
        """Other rays from some of the centres."""
        return _Sights(self.centre[rows], direction, self.height[rows], self.curvature)


def footprints(calibration: Adjustment) -> Footprints:
    """The footprints of all photographs.

    Raises
    ------
    InputError
        Of a block in degrees.
    """
    adjusted, places = calibration.local, places_of(calibration)
    orientation, n = calibrated_orientation(calibration), len(calibration.local.block.images)
    ground = ground_of_points(calibration.result.points.xyz)
    outline, notes = _outlines(adjusted)
    empty = Footprints(
        np.full(n, None), np.zeros(n, bool), np.full(n, np.nan), np.full(n, np.nan), np.full(n, np.nan), notes
    )
    known = np.flatnonzero(orientation.known)
    if ground is None or not len(known):
        return empty
    centre = calibration.result.images.centre[known]
    below = np.column_stack([centre[:, :2], ground.heights(centre[:, 0], centre[:, 1])])
    axes = np.eye(3)[None] if places.frame is None else places.frame.crs_per_local(places.to_local(below))
    direction = np.einsum("nij,njk,nlk->nli", axes, orientation.rotation[known], outline[known])
    empty.height[known] = centre[:, 2] - below[:, 2]
    empty.tilt[known] = _off_nadir(-np.einsum("nij,nj->ni", axes, orientation.rotation[known][:, :, 2]))
    rays = direction.shape[1]
    curvature = 0.0 if places.frame is None else 1.0 / EARTH_RADIUS_M
    sights = _Sights(
        np.repeat(centre, rays, axis=0), direction.reshape(-1, 3), np.repeat(empty.height[known], rays), curvature
    )
    place, met = _meet(sights, ground)
    place, met = place.reshape(-1, rays, 3), met.reshape(-1, rays)
    pixel = np.array([camera.pixel_mm for camera in adjusted.block.cameras])[adjusted.block.images.camera[known]]
    distance = np.linalg.norm(place[:, -1] - centre, axis=1)
    empty.gsd[known] = np.where(met[:, -1], distance * pixel / orientation.interior[known, 0], np.nan)
    above = empty.height[known] > 0.0
    whole = above & met[:, :-1].all(axis=1)
    cut = np.flatnonzero(above & ~whole)
    empty.polygons[known[whole]] = _polygons(list(place[whole, :-1, :2]))
    empty.polygons[known[cut]] = _polygons(_cut_outlines(sights, place, met, cut, ground))
    empty.is_cut[known[cut]] = True
    return empty


def _off_nadir(axis: np.ndarray) -> np.ndarray:
    """(n,) rad, angle of directions (n, 3) off the vertical."""
    return np.arctan2(np.hypot(axis[:, 0], axis[:, 1]), -axis[:, 2])


def _outlines(adjusted: AdjustedBlock) -> tuple[np.ndarray, tuple[str, ...]]:
    """(n, 4·PER_SIDE + 1, 3) directions in the camera around the format of every photograph, the last in its middle."""
    out = np.full((len(adjusted.block.images), 4 * PER_SIDE + 1, 3), np.nan)
    notes: dict[str, None] = {}
    for group in image_groups(adjusted.block):
        xy, errors = _edge(group.camera), errors_in_force(adjusted, group)
        found = errors.directions(xy)
        lost = np.isnan(found).any(axis=1)
        if lost.any():
            found[lost] = _without_lens(xy[lost], errors.interior, group.camera.is_fisheye)
            notes[f"camera '{group.camera.name}': the lens records nothing at parts of the edge of the format; "
                  "footprints are drawn there as if it were without distortion"] = None  # fmt: skip
        out[group.images] = found / np.linalg.norm(found, axis=1)[:, None]
    return out, tuple(notes)


def _without_lens(xy: np.ndarray, interior: np.ndarray, fisheye: bool) -> np.ndarray:
    """(n, 3) directions through positions (n, 2) mm of a lens without distortion; nothing is seen behind it."""
    ideal = (xy - interior[1:]) / interior[0]
    if not fisheye:
        return np.column_stack([ideal, np.full(len(ideal), -1.0)])
    radius = np.hypot(ideal[:, 0], ideal[:, 1])
    angle = np.minimum(radius, MOST_ANGLE)
    return np.column_stack([ideal * (np.sin(angle) / radius)[:, None], -np.cos(angle)])


def _edge(camera: Camera) -> np.ndarray:
    """(4·PER_SIDE + 1, 2) mm, around the format from its lower left corner, and its middle."""
    t = np.linspace(-1.0, 1.0, PER_SIDE, endpoint=False)
    one = np.ones_like(t)
    sides = [(t, -one), (one, t), (-t, one), (-one, -t), (np.zeros(1), np.zeros(1))]
    return np.concatenate([np.column_stack(side) for side in sides]) * np.array(camera.half_format_mm)


def _meet(sights: _Sights, ground: PointGround) -> tuple[np.ndarray, np.ndarray]:
    """(m, 3) m where rays first meet the ground, and (m,) bool whether they do before they are too far."""
    d, first = sights.direction, sights.centre[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        far = FARTHEST * sights.height / np.hypot(d[:, 0], d[:, 1])
        deepest = np.where(d[:, 2] < 0.0, (ground.z.min() - first) / d[:, 2] * SLACK, np.inf)
        highest = np.where(d[:, 2] < 0.0, (ground.z.max() - first) / d[:, 2], 0.0)
    last = np.fmin(far, deepest)
    last = np.where(np.isfinite(last), np.maximum(last, 0.0), 0.0)
    start = np.clip(highest / SLACK, 0.0, last)

    def above(t: np.ndarray) -> np.ndarray:
        place = sights.at(t)
        return place[:, 2] > ground.heights(place[:, 0], place[:, 1])

    low, high, met = start.copy(), start.copy(), ~above(start) & (last > 0.0)
    for step in range(1, STEPS + 1):
        t = start + (last - start) * (step / STEPS)
        now = ~met & ~above(t)
        low[now], high[now] = high[now], t[now]
        high[~met & ~now] = t[~met & ~now]
        met |= now
    for _ in range(HALVINGS):
        middle = (low + high) / 2.0
        over = above(middle)
        low, high = np.where(over, middle, low), np.where(over, high, middle)
    return sights.at(np.where(met, high, last)), met & (sights.height > 0.0)


def _cut_outlines(
    sights: _Sights, place: np.ndarray, met: np.ndarray, photographs: np.ndarray, ground: PointGround
) -> list[np.ndarray | None]:
    """Outlines (k, 2) m of photographs that see the horizon, None of those that see no ground.

    Between two neighbouring rays of which one meets the ground, the one that just does is found by halving; beyond
    stands the circle of `FARTHEST` heights.
    """
    rays = met.shape[1]
    inside = met[photographs, :-1]
    p, i = np.nonzero(inside != np.roll(inside, -1, axis=1))
    j = (i + 1) % (rays - 1)
    seen = np.where(inside[p, i], i, j), np.where(inside[p, i], j, i)
    direction = sights.direction.reshape(-1, rays, 3)
    good, bad = (direction[photographs[p], one] for one in seen)
    rows = photographs[p] * rays
    for _ in range(HALVINGS):
        middle = (good + bad) / 2.0
        hit = _meet(sights.take(rows, middle), ground)[1][:, None]
        good, bad = np.where(hit, middle, good), np.where(hit, bad, middle)
    crossing, _ = _meet(sights.take(rows, good), ground)
    outlines: list[np.ndarray | None] = []
    for k, photograph in enumerate(photographs):
        own = p == k
        outlines.append(
            _cut_outline(
                place[photograph, :-1, :2], direction[photograph, :-1, :2], inside[k],
                dict(zip(i[own].tolist(), crossing[own, :2], strict=True)),
                sights.centre[photograph * rays, :2], FARTHEST * float(sights.height[photograph * rays]),
            )
        )  # fmt: skip
    return outlines


def _cut_outline(
    place: np.ndarray, direction: np.ndarray, inside: np.ndarray, crossing: dict[int, np.ndarray], nadir: np.ndarray,
    radius: float,
) -> np.ndarray | None:  # fmt: skip
    """The outline of one photograph.

    Parameters
    ----------
    place, direction : (k, 2) where rays meet the ground, m, and where they go in plan. inside : (k,) which do.
    crossing : where the outline leaves or enters the circle, after the ray of that number. nadir : (2,), radius : m.
    """
    count, azimuth = len(place), np.arctan2(direction[:, 0], direction[:, 1])
    if not inside.any():
        turned = _turns(np.append(azimuth, azimuth[0]))
        # the edge turns to the left about the nadir, to the right about the zenith
        return _arc(nadir, radius, 0.0, 2.0 * np.pi) if turned < -np.pi else None
    first = int(np.flatnonzero(inside)[0])
    ring: list[np.ndarray] = []
    passed: list[float] = []
    for number in np.arange(first, first + count) % count:
        if inside[number]:
            ring.append(place[number][None])
        else:
            passed.append(float(azimuth[number]))
        if int(number) in crossing:
            end = crossing[int(number)]
            bearing = float(np.arctan2(*(end - nadir)))
            if inside[number]:
                passed = [bearing]
            else:
                ring.append(_arc(nadir, radius, passed[0], _turns(np.array([*passed, bearing]))))
            ring.append(end[None])
    return np.concatenate(ring)


def _turns(azimuth: np.ndarray) -> float:
    """rad by which directions turn in all, each step the shorter way."""
    return float(np.sum((np.diff(azimuth) + np.pi) % (2.0 * np.pi) - np.pi))


def _arc(middle: np.ndarray, radius: float, begin: float, turn: float) -> np.ndarray:
    """(k, 2) m, on a circle from an azimuth on, without its ends."""
    steps = max(int(np.ceil(abs(turn) / ARC_STEP)), 1)
    azimuth = begin + turn * np.arange(1, steps + (abs(turn) > 6.2)) / steps
    return middle + radius * np.column_stack([np.sin(azimuth), np.cos(azimuth)])


def _polygons(outlines: list[Any]) -> np.ndarray:
    """(n,) MultiPolygons of outlines (k, 2) m; None of what has no area."""
    import shapely

    out = np.full(len(outlines), None)
    for k, outline in enumerate(outlines):
        if outline is None or len(outline) < 3:
            continue
        polygon = shapely.make_valid(shapely.Polygon(outline))
        parts = [part for part in shapely.get_parts(polygon, return_index=False) if part.area > 0.0]
        parts = [one for part in parts for one in shapely.get_parts(part) if one.geom_type == "Polygon"]
        if parts:
            out[k] = shapely.orient_polygons(shapely.MultiPolygon(parts), exterior_cw=False)
    return out
