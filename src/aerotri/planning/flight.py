"""Strips and exposures over an area, and what they see of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely

from aerotri.conventions import InputError
from aerotri.observations import Camera
from aerotri.planning.area import Area
from aerotri.planning.ground import Ground
from aerotri.planning.options import PlanOptions
from aerotri.planning.sight import in_sight
from aerotri.simulation.flight import AXIS_ANGLE, format_along_across_mm
from aerotri.simulation.projection import Photographs, Rays, TrueCamera, visible_rays

CHECKED = 2500
"""Places of the area that are looked at [C]: every fiftieth of its side."""
MARGINS = (0.0, 0.25, 0.5, 0.75, 1.0, 1.5)
"""How far the flight goes beyond the area, in half footprints, tried one after the other."""
CLOSEST = 0.3
"""Of the flying height, what must stay between the highest ground and the camera [C]."""
NARROWER, TRIES = 0.97, 60
"""How the distance of strips shrinks until their overlap holds on the ground [C]."""


@dataclass(frozen=True)
class Strip:
    """A strip: its name, places (n, 2) in the axes of the flight in the order flown, altitude m, heading rad."""

    name: str
    places: np.ndarray
    altitude: float
    heading: float
    is_cross: bool


@dataclass(frozen=True, eq=False)
class Flight:
    """The photographs in the order of exposure, n of them.

    Parameters
    ----------
    names, strip : (n,) str. centre : (n, 3) m. heading : (n,) rad clockwise from grid north. time : (n,) s.
    ground : (n,) m below. angles : (n, 3) rad ω, φ, κ. is_cross : (n,) bool.
    axis : rad clockwise from grid north of the main strips.
    """

    names: np.ndarray
    strip: np.ndarray
    centre: np.ndarray
    heading: np.ndarray
    time: np.ndarray
    ground: np.ndarray
    angles: np.ndarray
    is_cross: np.ndarray
    axis: float

    def __len__(self) -> int:
        return len(self.names)

    @property
    def strips(self) -> list[np.ndarray]:
        """Rows of every strip, in the order flown."""
        return [np.flatnonzero(self.strip == name) for name in dict.fromkeys(self.strip.tolist())]

    @property
    def length(self) -> float:
        """m, along the strips and from one to the next."""
        return float(np.linalg.norm(np.diff(self.centre, axis=0), axis=1).sum())


@dataclass(frozen=True, eq=False)
class Seen:
    """What the flight sees of places of the area.

    Parameters
    ----------
    places : (n, 3) m. rays : (n,) photographs that see them. framed : (n,) photographs in whose format they lie; the
        terrain may hide them there. gsd : m, at least and at most. forward, side : overlaps at least.
    """

    places: np.ndarray
    rays: np.ndarray
    framed: np.ndarray
    gsd: tuple[float, float]
    forward: float
    side: float


def true_camera(camera: Camera) -> TrueCamera:
    """The camera without errors."""
    focal, x0, y0 = (camera.interior[name].value for name in ("focal_length_mm", "x0_mm", "y0_mm"))
    return TrueCamera(camera, focal, x0, y0, np.zeros(14), np.zeros(2))


def photographs_of(flight: Flight, camera: Camera) -> Photographs:
    """The photographs as planned."""
    index = np.zeros(len(flight), dtype=np.int64)
    return Photographs.of(flight.centre, flight.angles, "omega-phi-kappa", index, (true_camera(camera),))


def rays_to(flight: Flight, camera: Camera, points: np.ndarray, margin_px: float = 20.0) -> Rays:
    """Rays to (N, 3) m that lie inside the format less a margin, whatever stands between."""
    return visible_rays(photographs_of(flight, camera), points, [-margin_px * camera.pixel_mm])


def rays_seen(flight: Flight, camera: Camera, points: np.ndarray, ground: Ground) -> Rays:
    """Of these the rays that the terrain does not hide."""
    rays = rays_to(flight, camera, points)
    return rays.take(in_sight(ground, flight.centre, points, rays))


def plan_strips(area: Area, ground: Ground, camera: Camera, options: PlanOptions) -> tuple[Flight, Seen]:
    """The flight that shows every place of the area often enough, and what it sees.

    Raises
    ------
    InputError
        When it would take too many photographs, the ground is too high for it, or places are seen too seldom.
    """
    axis = _axis(area, options)
    layout = _Layout(area, ground, camera, options, axis)
    seen = None
    for margin in MARGINS:
        flight = _flown(layout.strips(margin), layout, ground, options)
        seen = what_is_seen(flight, layout, camera)
        if seen.framed.min() >= options.rays:
            return flight, seen
    least = 0 if seen is None else int(seen.framed.min())
    raise InputError(
        f"a place of the area lies in {least} photographs, {options.rays} are asked for",
        "raise the forward or the side overlap, or lower --rays",
    )


def what_is_seen(flight: Flight, layout: _Layout, camera: Camera) -> Seen:
    """Rays and GSD at places of the area; overlaps of photographs and strips on the ground there, at least."""
    framed = rays_to(flight, camera, layout.cells)
    rays = framed.take(in_sight(layout.ground, flight.centre, layout.cells, framed))
    depth = flight.centre[rays.image, 2] - layout.cells[rays.point, 2]
    gsd = camera.pixel_mm / camera.interior["focal_length_mm"].value * depth
    forward = 1.0
    for own in flight.strips:
        if len(own) > 1:
            base = float(np.linalg.norm(flight.centre[own[1], :2] - flight.centre[own[0], :2]))
            below = np.unique(rays.point[np.isin(rays.image, own)])
            if len(below):
                high = float(layout.cells[below, 2].max())
                forward = min(forward, 1.0 - base / (layout.along * (flight.centre[own[0], 2] - high)))
    count, inside = (np.bincount(one.point, minlength=len(layout.cells)) for one in (rays, framed))
    least, most = (float(gsd.min()), float(gsd.max())) if len(gsd) else (np.nan, np.nan)
    return Seen(layout.cells, count, inside, (least, most), forward, layout.side_overlap(flight))


class _Layout:
    """An area in the axes of its flight: u along the strips, v to their left."""

    def __init__(self, area: Area, ground: Ground, camera: Camera, options: PlanOptions, axis: float):
        self.options, self.axis, self.ground = options, axis, ground
        self.image_axis = AXIS_ANGLE[camera.flight_axis or "+y"]
        along, across = format_along_across_mm(camera)
        focal = camera.interior["focal_length_mm"].value
        self.along, self.across = along / focal, across / focal
        self.height = options.gsd * focal / camera.pixel_mm
        self.turn = np.array([[np.sin(axis), np.cos(axis)], [-np.cos(axis), np.sin(axis)]])
        self.origin = np.array(area.polygon.centroid.coords[0])
        self._refuse_too_many(area.polygon.area)
        self.cells = ground.on(area.cells(CHECKED))
        self.uv = (self.cells[:, :2] - self.origin) @ self.turn.T
        self.mean = float(self.cells[:, 2].mean())

    def to_plan(self, uv: np.ndarray) -> np.ndarray:
        """(n, 2) X, Y m."""
        return self.origin + uv @ self.turn

    def _refuse_too_many(self, size: float) -> None:
        o = self.options
        photographs = size / (self.height**2 * self.along * self.across)
        photographs /= (1.0 - o.forward_overlap) * (1.0 - o.side_overlap)
        self.refuse_beyond(photographs, f"an area of {size / 1e6:.3g} km²")

    def refuse_beyond(self, photographs: float, of: str) -> None:
        """A plan of too many photographs is none."""
        if photographs > self.options.most_photographs:
            raise InputError(
                f"{of} takes about {photographs:.3g} photographs, more than {self.options.most_photographs}",
                "raise the GSD, divide the area, lower the overlaps, or raise --most-photographs",
            )

    def altitude(self, below: np.ndarray) -> float:
        """m, of a strip over some of the cells; refused where the ground comes too near."""
        if not below.any():
            below = np.ones(len(self.cells), bool)
        own = self.options.height_mode == "follow"
        level = float(self.cells[below, 2].mean()) if own else self.mean
        high = float(self.cells[below, 2].max())
        if level + self.height - high < CLOSEST * self.height:
            raise InputError(
                f"the ground rises {high - level:.0f} m above its mean, at a flying height of {self.height:.0f} m",
                "give --height-mode follow, another direction, or a larger GSD",
            )
        return level + self.height

    def strips(self, margin: float) -> list[Strip]:
        """Main strips from one side of the area to the other, then cross strips."""
        spacing, main = self.first_spacing(), list[Strip]()
        for _ in range(TRIES):
            main = list(self._main(spacing, margin))
            if self._side(np.array([s.places[0, 1] for s in main]), np.array([s.altitude for s in main])) >= (
                self.options.side_overlap - 1e-9
            ):
                break
            spacing *= NARROWER
        return main + list(self._cross(margin))

    def first_spacing(self) -> float:
        """m between strips where they overlap enough over the highest ground, flown at one altitude."""
        high = self.mean if self.options.height_mode == "follow" else float(self.cells[:, 2].max())
        clear = max(self.mean + self.height - high, CLOSEST * self.height)
        return (1.0 - self.options.side_overlap) * self.across * clear

    def _main(self, spacing: float, margin: float) -> Iterator[Strip]:
        half = 0.5 * self.across * self.height
        low, high = self.uv[:, 1].min() - margin * half, self.uv[:, 1].max() + margin * half
        count = int(np.ceil((high - low) / spacing - 1e-9)) + 1
        self.refuse_beyond(float(count), "the strips")
        for k, v in enumerate(np.linspace(low, high, count)):
            below = np.abs(self.uv[:, 1] - v) <= half
            reach = self.uv[below, 0] if below.any() else self.uv[:, 0]
            u, altitude = self._exposures(reach, below, margin)
            u = u if k % 2 == 0 else u[::-1]
            yield Strip(f"{k + 1}", np.column_stack([u, np.full(len(u), v)]), altitude, 0.0 if k % 2 == 0 else np.pi,
                        False)  # fmt: skip

    def _cross(self, margin: float) -> Iterator[Strip]:
        number = self.options.cross_strips
        half = 0.5 * self.across * self.height
        low, high = self.uv[:, 0].min(), self.uv[:, 0].max()
        for k, u in enumerate([0.5 * (low + high)] if number == 1 else np.linspace(low, high, number)):
            below = np.abs(self.uv[:, 0] - u) <= half
            v, altitude = self._exposures(self.uv[below, 1], below, margin)
            v = v if k % 2 == 0 else v[::-1]
            heading = -0.5 * np.pi if k % 2 == 0 else 0.5 * np.pi
            yield Strip(f"C{k + 1}", np.column_stack([np.full(len(v), u), v]), altitude, heading, True)

    def _exposures(self, reach: np.ndarray, below: np.ndarray, margin: float) -> tuple[np.ndarray, float]:
        """Places along a strip, and its altitude."""
        altitude = self.altitude(below)
        high = float(self.cells[below, 2].max()) if below.any() else self.mean
        base = (1.0 - self.options.forward_overlap) * self.along * (altitude - high)
        over = base + margin * 0.5 * self.along * self.height
        first, last = float(reach.min()) - over, float(reach.max()) + over
        count = int(np.ceil((last - first) / base - 1e-9)) + 1
        self.refuse_beyond(float(count), "a strip")
        return np.linspace(first, last, count), altitude

    def _side(self, v: np.ndarray, altitude: np.ndarray) -> float:
        """Smallest overlap of neighbouring strips over the cells between them."""
        least = 1.0
        for a in range(len(v) - 1):
            low, high = sorted((v[a], v[a + 1]))
            between = (self.uv[:, 1] >= low) & (self.uv[:, 1] <= high)
            if between.any():
                top = float(self.cells[between, 2].max())
                both = 0.5 * self.across * (altitude[a] + altitude[a + 1] - 2.0 * top)
                least = min(least, 1.0 - (high - low) / both if both > 0.0 else -1.0)
        return least

    def side_overlap(self, flight: Flight) -> float:
        """Smallest overlap of neighbouring main strips on the ground of the area."""
        first = np.array([own[0] for own in flight.strips if not flight.is_cross[own[0]]])
        v = ((flight.centre[first, :2] - self.origin) @ self.turn.T)[:, 1]
        return self._side(v, flight.centre[first, 2])


def _axis(area: Area, options: PlanOptions) -> float:
    """rad clockwise from grid north: as asked, else along the longest side of the smallest rectangle."""
    if options.direction is not None:
        return float(np.radians(options.direction % 360.0))
    corners = shapely.get_coordinates(shapely.minimum_rotated_rectangle(area.polygon))
    sides = np.diff(corners, axis=0)[:2]
    along = sides[int(np.argmax(np.linalg.norm(sides, axis=1)))]
    return float(np.arctan2(along[0], along[1]) % np.pi)


def _flown(strips: list[Strip], layout: _Layout, ground: Ground, options: PlanOptions) -> Flight:
    counts = [len(one.places) for one in strips]
    layout.refuse_beyond(float(sum(counts)), "the plan")
    xy = layout.to_plan(np.concatenate([one.places for one in strips]))
    heading = np.repeat([layout.axis + one.heading for one in strips], counts) % (2.0 * np.pi)
    time, begun = [], 0.0
    for one in strips:
        own = begun + np.linalg.norm(one.places - one.places[0], axis=1) / options.speed
        time.append(own)
        begun = float(own[-1]) + options.turn
    angles = np.zeros((len(xy), 3))
    # kappa turns the image axis that points along the flight into the heading, counted from east to north
    angles[:, 2] = (0.5 * np.pi - heading - layout.image_axis + np.pi) % (2.0 * np.pi) - np.pi
    return Flight(
        np.array([f"{one.name}_{k + 1:03d}" for one in strips for k in range(len(one.places))]),
        np.repeat([one.name for one in strips], counts),
        np.column_stack([xy, np.repeat([one.altitude for one in strips], counts)]),
        heading, np.concatenate(time), ground.heights(xy), angles,
        np.repeat([one.is_cross for one in strips], counts), layout.axis,
    )  # fmt: skip
