"""A block simulated part by part: as large as one likes, never held whole.

Photographs, their start values and positions, the ground and the control points are those that `simulate` makes of the
same plan and seed. Tie points are drawn for every part by itself, from random numbers of its own: the ground is cut
into cells, and a point belongs, with all its rays, to the part on whose cell it lies.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from aerotri.conventions import InputError
from aerotri.observations import Block, Control, GnssIns, Images
from aerotri.simulation.cameras import true_camera
from aerotri.simulation.flight import FlightFrame, FlownImages, plan_flight
from aerotri.simulation.ground_points import ControlPoints, lay_out_control
from aerotri.simulation.measuring import Imaging, tie_rays
from aerotri.simulation.navigation import observe_navigation
from aerotri.simulation.projection import Photographs, Rays
from aerotri.simulation.random_streams import scattered, stream
from aerotri.simulation.simulate import (
    Scene,
    control_of,
    images_of,
    imaging_of,
    in_order,
    joined,
    measured_signals,
    observe,
    parameters_of,
    sampled,
    settings_of,
)
from aerotri.simulation.spec import SimulationSpec
from aerotri.simulation.terrain import Terrain, make_terrain
from aerotri.simulation.truth import Truth

REMEDY = "leave out the parts, or what is named"


@dataclass(frozen=True, eq=False)
class Cell:
    """A rectangle of the ground: `low`, `high` (2,) m along and across the flight."""

    low: np.ndarray
    high: np.ndarray

    def holds(self, along_across: np.ndarray) -> np.ndarray:
        """(n,) bool of places (n, 2); the upper border belongs to the next cell."""
        return np.all((along_across >= self.low) & (along_across < self.high), axis=1)


@dataclass(frozen=True, eq=False)
class Flight:
    """What all parts have in common: everything but tie points.

    Parameters
    ----------
    place : (n, 2) m, projection centres along and across. cells : of the parts.
    control, blunders, blunder_m : signalised points as given, index of the wrong ones, (b, 3) m their blunders.
    """

    spec: SimulationSpec
    seed: int
    frame: FlightFrame
    flown: FlownImages
    imaging: Imaging
    terrain: Terrain
    images: Images
    gnss: GnssIns | None
    layout: ControlPoints
    signals: np.ndarray
    signal_rays: Rays
    control: Control
    blunders: np.ndarray
    blunder_m: np.ndarray
    place: np.ndarray
    cells: tuple[Cell, ...]


def simulate_parts(spec: SimulationSpec, seed: int, parts: int) -> Iterator[tuple[Block, Truth]]:
    """The parts of a block one after the other, each a block with its truth.

    Parameters
    ----------
    parts : how many, two at least.

    Raises
    ------
    InputError
        For a plan that makes no sense, or holds what parts cannot.
    """
    flight = _flight(spec, seed, parts)
    for number in range(parts):
        yield _part(flight, number)


def refuse_for_parts(spec: SimulationSpec) -> None:
    """Name what is simulated in one piece only.

    Raises
    ------
    InputError
    """
    refused = [
        (bool(spec.rig), "rigs"),
        (spec.towers is not None, "towers"),
        (spec.georeference is not None, "a georeference"),
        (any(camera.rolling_shutter is not None for camera in spec.camera.values()), "rolling shutters"),
        (spec.tie_points.distribution != "uniform", f"tie points of the distribution '{spec.tie_points.distribution}'"),
    ]
    for wrong, what in refused:
        if wrong:
            raise InputError(f"{what} in a block simulated in parts", REMEDY)


def _flight(spec: SimulationSpec, seed: int, parts: int) -> Flight:
    if parts < 2:
        raise InputError(f"{parts} parts", "a block is simulated in two parts or more")
    refuse_for_parts(spec)
    cameras = tuple(true_camera(name, camera) for name, camera in spec.camera.items())
    nominal = [camera.nominal for camera in cameras]
    flown, frame = plan_flight(spec.flight, nominal, spec.terrain.height_m, stream(seed, "flight"))
    imaging = imaging_of(spec, cameras, flown, None, seed)
    terrain = make_terrain(spec.terrain, spec.flight.centre_m, stream(seed, "terrain"))
    base = (1.0 - spec.control.base_end_lap) * frame.footprint[0]
    layout = lay_out_control(spec.control, frame, base, stream(seed, "control"))
    xyz = np.column_stack([layout.xy, terrain.height(layout.xy)])
    layout, signals, signal_rays = measured_signals(spec, layout, xyz, imaging)
    number = np.arange(len(signals))
    scene = Scene(layout.names, signals, signal_rays, number, layout.is_check, np.zeros((0, 2), np.int64))
    control, blunders, blunder_m = control_of(spec.control, scene, seed)
    place = frame.along_across(flown.centre[:, :2])
    return Flight(
        spec, seed, frame, flown, imaging, terrain, images_of(spec, flown, seed),
        observe_navigation(spec.gnss, spec.ins, flown, spec.rotation, stream(seed, "navigation")),
        layout, signals, signal_rays, control, blunders, blunder_m, place, _cells(place, frame, parts),
    )  # fmt: skip


def _cells(place: np.ndarray, frame: FlightFrame, parts: int) -> tuple[Cell, ...]:
    """The ground, cut in two where the fewest of them see both sides, again and again."""
    done: list[Cell] = []

    def cut(members: np.ndarray, cell: Cell, count: int) -> None:
        if count == 1 or len(members) < 2:
            if count > 1:
                raise InputError(f"{parts} parts of {len(place)} photographs", "give fewer parts")
            done.append(cell)
            return
        size = np.ptp(place[members], axis=0) + frame.footprint
        axis = int(frame.footprint[0] * size[1] > frame.footprint[1] * size[0])
        first = count // 2
        at = float(np.quantile(place[members, axis], first / count))
        below = place[members, axis] < at
        high, low = cell.high.copy(), cell.low.copy()
        high[axis] = low[axis] = at
        cut(members[below], Cell(cell.low, high), first)
        cut(members[~below], Cell(low, cell.high), count - first)

    cut(np.arange(len(place)), Cell(np.full(2, -np.inf), np.full(2, np.inf)), parts)
    return tuple(done)


def _part(flight: Flight, number: int) -> tuple[Block, Truth]:
    """A part and its truth."""
    spec, cell, name = flight.spec, flight.cells[number], f"part {number}"
    rng = stream(flight.seed, "tie points", name)
    home = cell.holds(flight.place)
    reach = float(np.hypot(*flight.frame.footprint))
    near = np.flatnonzero(Cell(cell.low - reach, cell.high + reach).holds(flight.place))
    imaging = _imaging_over(flight.imaging, near)
    low, high = _seen(cell, flight.place[near], flight.frame)

    def candidates(count: int) -> np.ndarray:
        xy = flight.frame.plan(low + (high - low) * scattered(count, np.random.default_rng(start)))
        return np.column_stack([xy, flight.terrain.height(xy)])

    start = int(rng.integers(2**63))
    ties, rays = tie_rays(
        spec.tie_points, imaging, candidates, lambda: stream(flight.seed, "measuring", name), int(home.sum())
    )
    own = np.flatnonzero(cell.holds(flight.frame.along_across(flight.signals[:, :2])))
    signal_rays = _rays_to(flight.signal_rays, own, near, len(flight.flown))
    is_check = flight.layout.is_check[own]
    names = np.array([*flight.layout.names[own], *(f"T{number:04d}_{k + 1:06d}" for k in range(len(ties)))])
    all_rays = joined([(signal_rays, len(own)), (rays, len(ties))])
    scene = in_order(names, np.concatenate([flight.signals[own], ties]), all_rays, is_check, 0)
    image_points, wrong, gross = observe(spec, scene, imaging, flight.seed, (name,))
    # photographs that see nothing here belong to another part
    kept = home[near]
    kept[image_points.image] = True
    rows = np.cumsum(kept) - 1
    taken = near[kept]
    control = replace(flight.control, point=scene.signals, xyz=flight.control.xyz[own],
                      sigma=flight.control.sigma[own], is_check=is_check)  # fmt: skip
    block = Block(
        name=f"{spec.name} {name}",
        cameras=flight.imaging.cameras,
        images=flight.images.take(taken),
        points=scene.names,
        image_points=replace(image_points, image=rows[image_points.image]),
        control=control,
        gnss_ins=_positions_of(flight.gnss, taken, home),
        settings=settings_of(spec),
        rotation=spec.rotation,
    )
    return block, _truth(flight, taken, scene, own, (wrong, gross))


def _seen(cell: Cell, place: np.ndarray, frame: FlightFrame) -> tuple[np.ndarray, np.ndarray]:
    """The part of a cell that photographs at some places can see, along and across."""
    half = frame.footprint / 2.0
    return np.maximum(cell.low, place.min(axis=0) - half), np.minimum(cell.high, place.max(axis=0) + half)


def _imaging_over(imaging: Imaging, images: np.ndarray) -> Imaging:
    """Of some photographs alone."""
    p = imaging.photographs
    some = Photographs(p.centre[images], p.rotation[images], p.camera[images], p.cameras)
    return replace(imaging, photographs=some, day=imaging.day[images])


def _rays_to(rays: Rays, points: np.ndarray, images: np.ndarray, count: int) -> Rays:
    """Rays to some points, of which each is numbered anew; all are in the photographs `images`, out of `count`."""
    row = np.full(count, -1)
    row[images] = np.arange(len(images))
    there = rays.take(np.isin(rays.point, points) & (row[rays.image] >= 0))
    return Rays(row[there.image], np.searchsorted(points, there.point), there.xy)


def _positions_of(gnss: GnssIns | None, taken: np.ndarray, home: np.ndarray) -> GnssIns | None:
    """Observed positions of the photographs at home in a part: each stands in one part."""
    if gnss is None:
        return None
    own = home[taken]
    rows = taken[own]
    return replace(
        gnss, image=np.flatnonzero(own), xyz=gnss.xyz[rows], sigma=gnss.sigma[rows], angles=gnss.angles[rows],
        angles_sigma=gnss.angles_sigma[rows], time=gnss.time[rows],
    )  # fmt: skip


def _truth(
    flight: Flight, taken: np.ndarray, scene: Scene, own: np.ndarray, wrong: tuple[np.ndarray, np.ndarray]
) -> Truth:
    names, groups, values = parameters_of(flight.spec)
    cameras = flight.imaging.photographs.cameras
    here = np.isin(flight.blunders, own)
    return Truth(
        centre=flight.flown.centre[taken],
        angles=flight.flown.angles[taken],
        points=scene.xyz,
        parameter_names=names,
        parameter_groups=groups,
        parameter_values=values,
        interior=np.array([(c.focal_length, c.x0, c.y0) for c in cameras]),
        image_errors=sampled(flight.imaging),
        gross_errors=wrong[0],
        gross_error_mm=wrong[1],
        control_blunders=np.searchsorted(own, flight.blunders[here]),
        control_blunder_m=flight.blunder_m[here],
    )
