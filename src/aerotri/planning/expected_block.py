"""The block that a planned flight will bring: its geometry, measured without error."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri.conventions import InputError
from aerotri.functional_model.additional_parameters import parse_parameters
from aerotri.observations import (
    AdjustmentSettings,
    Block,
    Camera,
    Control,
    GnssIns,
    ImagePoints,
    Images,
    Settings,
)
from aerotri.planning.area import Area
from aerotri.planning.flight import Flight, photographs_of, rays_seen, true_camera
from aerotri.planning.ground import Ground
from aerotri.planning.options import PlanOptions
from aerotri.planning.piles import pile_places
from aerotri.planning.sight import in_sight
from aerotri.simulation.camera_errors import image_error_fields
from aerotri.simulation.camera_spec import ErrorSpec
from aerotri.simulation.measuring import Imaging, tie_rays
from aerotri.simulation.projection import Rays
from aerotri.simulation.random_streams import scattered, stream
from aerotri.simulation.spec import TiePointSpec
from aerotri.simulation.truth import Truth

GROUND_POINTS, CANDIDATES = 400, 60
"""Ground points over the area and places where control may be, at most [C]: the map then has twenty cells a side."""
FEWEST_TIES = 0.4
"""Share of the tie points of a photograph that is not at ground points or candidates [C], at least."""
SEED = 1


@dataclass(frozen=True, eq=False)
class Places:
    """Points of the block that stand at chosen places.

    Parameters
    ----------
    ground : (g, 3) m, ground points of the map, in the middle of its cells; step : m, size of a cell.
    candidates : (c, 3) m, where control may be. given : (k, 3) m, control given, with names and sigma (k, 3) m.
    piles : (p, 3) m, places of piles; owner : (p,) the pile of each.
    """

    ground: np.ndarray
    step: float
    candidates: np.ndarray
    given: np.ndarray
    given_names: tuple[str, ...]
    given_sigma: np.ndarray
    piles: np.ndarray
    owner: np.ndarray

    @property
    def xyz(self) -> np.ndarray:
        return np.concatenate([self.given, self.candidates, self.ground, self.piles])

    @property
    def names(self) -> list[str]:
        """Of control given, candidates P001 …, ground points G0001 … and places of piles V0001 …"""
        candidates = [f"P{k + 1:03d}" for k in range(len(self.candidates))]
        return [*self.given_names, *candidates, *(f"G{k + 1:04d}" for k in range(len(self.ground))),
                *(f"V{k + 1:04d}" for k in range(len(self.piles)))]  # fmt: skip


@dataclass(frozen=True, eq=False)
class Expected:
    """A block as expected.

    Parameters
    ----------
    block : with ground points as check points, and no candidate as control. xyz : (N, 3) m of its points, true.
    given, candidates, ground, piles : rows of its points. owner : the pile of each of `piles`.
    """

    block: Block
    xyz: np.ndarray
    given: np.ndarray
    candidates: np.ndarray
    ground: np.ndarray
    candidate_sigma: np.ndarray
    piles: np.ndarray
    owner: np.ndarray

    def with_control(self, chosen: np.ndarray) -> Block:
        """The block with some of the candidates (index into them) as control."""
        own, control = self.candidates[chosen], self.block.control
        sigma = np.tile(self.candidate_sigma, (len(own), 1))
        return replace(
            self.block,
            control=Control(
                np.concatenate([control.point, own]), np.concatenate([control.xyz, self.xyz[own]]),
                np.concatenate([control.sigma, sigma]), np.concatenate([control.is_check, np.zeros(len(own), bool)]),
            ),
        )  # fmt: skip


def places_of(
    area: Area, ground: Ground, flight: Flight, camera: Camera, options: PlanOptions,
    given: tuple[tuple[str, ...], np.ndarray, np.ndarray],
) -> Places:  # fmt: skip
    """Ground points and candidates, so many that most tie points stay where images have them."""
    names, xyz, sigma = given
    seen = (
        np.bincount(rays_seen(flight, camera, xyz, ground).point, minlength=len(xyz)) if len(xyz) else np.zeros(0, int)
    )
    if (seen < 2).any():
        name = names[int(np.argmax(seen < 2))]
        raise InputError(f"control point '{name}' lies in fewer than two photographs", "leave it out, or move it")
    mean_rays = len(rays_seen(flight, camera, ground.on(area.cells(400)), ground)) / max(len(area.cells(400)), 1)
    room = (1.0 - FEWEST_TIES) * options.tie_points * len(flight) / max(mean_rays, 1.0)
    count = int(np.clip(room - CANDIDATES, 30, GROUND_POINTS))
    step = float(np.sqrt(area.polygon.area / count))
    nodes = area.raster(step)
    candidates = _candidates(area, min(CANDIDATES, max(count, 12)))
    return Places(
        ground.on(nodes if len(nodes) else np.array(area.polygon.representative_point().coords)), step,
        ground.on(candidates), xyz, names, sigma, *pile_places(area.piles, ground),
    )  # fmt: skip


def _candidates(area: Area, count: int) -> np.ndarray:
    """Places on a grid over the area and along its border, a little inside."""
    inner = area.polygon.buffer(-0.02 * float(np.sqrt(area.polygon.area)))
    if inner.is_empty:
        return area.cells(count)
    return Area(inner, area.crs, area.name).cells(int(0.6 * count))


def expected_block(
    places: Places, area: Area, ground: Ground, flight: Flight, camera: Camera, options: PlanOptions
) -> Expected:
    """What the flight measures: tie points as they are expected, every chosen place in all photographs that see it."""
    rays = rays_seen(flight, camera, places.xyz, ground)
    left = options.tie_points - len(rays) / len(flight)
    spec = TiePointSpec(
        per_image=max(left, FEWEST_TIES * options.tie_points), probability=options.probability,
        sigma_um=options.image_sigma * camera.pixel_um,
    )  # fmt: skip
    ties, tied = tie_rays(
        spec, _imaging(flight, camera), lambda count: _scattered(flight, camera, ground, options, count),
        lambda: stream(SEED, "measuring"),
    )  # fmt: skip
    tied = _twice(tied.take(in_sight(ground, flight.centre, ties, tied)), len(ties))
    names = np.array([*places.names, *(f"T{k + 1:06d}" for k in range(len(ties)))])
    xyz = np.concatenate([places.xyz, ties])
    first = len(places.xyz)
    both = Rays(
        np.concatenate([rays.image, tied.image]), np.concatenate([rays.point, tied.point + first]),
        np.concatenate([rays.xy, tied.xy]),
    )  # fmt: skip
    return _numbered(names, xyz, both, places, flight, camera, options)


def _numbered(
    names: np.ndarray, xyz: np.ndarray, rays: Rays, places: Places, flight: Flight, camera: Camera, options: PlanOptions
) -> Expected:
    """The block, its points in the order they are first measured, as a reader of its files numbers them."""
    rays = rays.take(np.lexsort((rays.point, rays.image)))
    points, begun = np.unique(rays.point, return_index=True)
    order = points[np.argsort(begun)]
    number = np.full(len(names), -1)
    number[order] = np.arange(len(order))
    k, c = len(places.given), len(places.candidates)
    count = np.bincount(rays.point, minlength=len(names))
    g = k + c + len(places.ground)
    parts = (slice(0, k), slice(k, k + c), slice(k + c, g), slice(g, len(places.xyz)))
    own = [number[part][count[part] >= 2] for part in parts]
    owner = places.owner[count[parts[3]] >= 2]
    xyz, sigma = xyz[order], options.image_sigma * camera.pixel_mm
    checks = np.concatenate([own[2], own[3]])
    check_sigma = np.full((len(checks), 3), 0.001)
    control = Control(
        np.concatenate([own[0], checks]), xyz[np.concatenate([own[0], checks])],
        np.concatenate([places.given_sigma.reshape(-1, 3), check_sigma]),
        np.arange(len(own[0]) + len(checks)) >= len(own[0]),
    )  # fmt: skip
    n = len(flight)
    block = Block(
        name="plan", cameras=(camera,),
        images=Images(flight.names, np.zeros(n, np.int64), flight.strip, flight.centre.copy(), flight.angles.copy()),
        points=names[order], image_points=ImagePoints(
            rays.image, number[rays.point], rays.xy, np.full((len(rays), 2), sigma)
        ),
        control=control, gnss_ins=_positions(flight, options), settings=_settings(camera, options),
    )  # fmt: skip
    by_axis = np.array([options.control_sigma[0], options.control_sigma[0], options.control_sigma[1]])
    return Expected(block, xyz, own[0], own[1], own[2], by_axis, own[3], owner)


def _twice(rays: Rays, points: int) -> Rays:
    """The rays of points that two photographs see or more."""
    return rays.take(np.bincount(rays.point, minlength=points)[rays.point] >= 2)


def _imaging(flight: Flight, camera: Camera) -> Imaging:
    fields = image_error_fields([true_camera(camera)], {camera.name: ErrorSpec()}, [""], SEED)
    return Imaging(photographs_of(flight, camera), np.full(len(flight), ""), fields, [0.0])


def _scattered(flight: Flight, camera: Camera, ground: Ground, options: PlanOptions, count: int) -> np.ndarray:
    """(count, 3) m, on the ground that photographs show."""
    half = 0.5 * np.hypot(*camera.half_format_mm) / camera.interior["focal_length_mm"].value
    turn = np.array([[np.sin(flight.axis), np.cos(flight.axis)], [-np.cos(flight.axis), np.sin(flight.axis)]])
    uv = flight.centre[:, :2] @ turn.T
    reach = half * float((flight.centre[:, 2] - flight.ground).mean())
    low, high = uv.min(axis=0) - reach, uv.max(axis=0) + reach
    return ground.on((low + (high - low) * scattered(count, stream(SEED, "tie points"))) @ turn)


def _positions(flight: Flight, options: PlanOptions) -> GnssIns | None:
    if options.positions_sigma is None:
        return None
    n, nothing = len(flight), np.full((len(flight), 3), np.nan)
    plan, height = options.positions_sigma
    sigma = np.tile([plan, plan, height], (n, 1))
    return GnssIns(np.arange(n), flight.centre.copy(), sigma, nothing, nothing, flight.time)


def _settings(camera: Camera, options: PlanOptions) -> Settings:
    choice = parse_parameters(options.self_calibration)
    if choice == parse_parameters("auto"):
        raise InputError("'auto' chooses parameters by measurements, and a plan has none", "name a set, or none")
    return Settings(
        adjustment=AdjustmentSettings(choice), image_sigma_um=options.image_sigma * camera.pixel_um
    )  # fmt: skip


def truth_of(expected: Expected, flight: Flight, camera: Camera) -> Truth:
    """The true values behind the block."""
    interior = np.array([[camera.interior[name].value for name in ("focal_length_mm", "x0_mm", "y0_mm")]])
    none, plane = np.zeros(0, np.int64), np.zeros((0, 2))
    return Truth(
        flight.centre, flight.angles, expected.xyz, (), (), np.zeros(0), interior, (), none, plane, none,
        np.zeros((0, 3)),
    )  # fmt: skip


def measured(block: Block, seed: int) -> Block:
    """The block with errors of its σ in image points, control and positions; check points stay true."""
    rays, control, positions = block.image_points, block.control, block.gnss_ins
    noise = stream(seed, "image noise").normal(size=rays.xy.shape)
    drawn = stream(seed, "control coordinates").normal(size=control.xyz.shape) * ~control.is_check[:, None]
    if positions is not None:
        own = stream(seed, "navigation").normal(size=positions.xyz.shape)
        positions = replace(positions, xyz=positions.xyz + positions.sigma * own)
    return replace(
        block, image_points=replace(rays, xy=rays.xy + rays.sigma * noise),
        control=replace(control, xyz=control.xyz + control.sigma * drawn), gnss_ins=positions,
    )  # fmt: skip
