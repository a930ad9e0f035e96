"""The flight plan: where and how every photograph is taken."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aerotri.conventions import InputError
from aerotri.memory import fitting, refuse_beyond_memory
from aerotri.observations import Camera
from aerotri.simulation.spec import CrossStripSpec, FlightSpec

BYTES_OF_PHOTOGRAPH = 3000
"""With its name, its line of a table and its true orientation."""
AXIS_ANGLE = {"+x": 0.0, "+y": np.pi / 2, "-x": np.pi, "-y": -np.pi / 2}
"""Direction, rad, in the image frame of the axis that points along the flight."""


@dataclass(frozen=True, eq=False)
class FlightFrame:
    """The block's own plan axes: along the strips and across (to the right of the flight).

    Parameters
    ----------
    origin : (2,) m, the middle of the block.
    axes : (2, 2), rows along and across in X, Y.
    half_axes : (2,) m, half extent of the main strips' projection centres.
    footprint : (2,) m, ground extent of a photograph along and across.
    """

    origin: np.ndarray
    axes: np.ndarray
    half_axes: np.ndarray
    footprint: np.ndarray

    def plan(self, along_across: np.ndarray) -> np.ndarray:
        """(n, 2) X, Y of positions along and across, m."""
        return self.origin + np.asarray(along_across) @ self.axes

    def along_across(self, xy: np.ndarray) -> np.ndarray:
        """The inverse of `plan`."""
        return (np.asarray(xy) - self.origin) @ self.axes.T


@dataclass(frozen=True, eq=False)
class FlownImages:
    """The photographs as flown, n of them, in the order of exposure.

    Parameters
    ----------
    names, strip, day : (n,) str; day is '' throughout where the spec names no days.
    camera : (n,) index.
    planned_centre, centre : (n, 3) m.
    angles : (n, 3) rad, ω, φ, κ in the rotation order of the spec.
    time : (n,) s.
    station : (n,) str, the exposure of a rig; None without rigs.
    """

    names: np.ndarray
    camera: np.ndarray
    strip: np.ndarray
    day: np.ndarray
    planned_centre: np.ndarray
    centre: np.ndarray
    angles: np.ndarray
    time: np.ndarray
    station: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.names)


@dataclass(frozen=True)
class _Strip:
    """One planned strip: positions (along, across) of its exposures in the order flown, and its direction."""

    name: str
    positions: np.ndarray
    direction: float
    camera: int
    day: str


def format_along_across_mm(camera: Camera) -> tuple[float, float]:
    """Length of the format along and across the flight, mm."""
    width, height = 2.0 * camera.half_format_mm[0], 2.0 * camera.half_format_mm[1]
    return (width, height) if (camera.flight_axis or "+y")[1] == "x" else (height, width)


def flying_height(spec: FlightSpec, camera: Camera) -> float:
    """Height above the mean ground, m: GSD·f / pixel."""
    if spec.height_m is not None:
        return spec.height_m
    return (spec.gsd_m or 0.0) * camera.focal_length_mm / camera.pixel_mm


def plan_flight(
    spec: FlightSpec, cameras: Sequence[Camera], ground_m: float, rng: np.random.Generator,
    leading: Sequence[str] | None = None,
) -> tuple[FlownImages, FlightFrame]:  # fmt: skip
    """Projection centres and attitudes of all photographs.

    Parameters
    ----------
    spec : the plan.
    cameras : in the order of the spec.
    ground_m : mean level of the ground.
    rng : draws the deviations of the flight from the plan.
    leading : names of the cameras that the plan is made for; all where None.
    """
    index = {camera.name: i for i, camera in enumerate(cameras) if leading is None or camera.name in leading}
    used = [_known(index, name, "flight.cameras") for name in spec.cameras] or list(index.values())
    height = flying_height(spec, cameras[used[0]])
    frame = _frame(spec, cameras[used[0]], height)
    _refuse_too_many(spec, frame)
    strips = _main_strips(spec, frame, cameras, used, height)
    strips += [_cross_strip(spec, cross, i, frame, cameras, index, height) for i, cross in enumerate(spec.cross_strips)]
    return _fly(spec, strips, frame, cameras, ground_m + height, rng), frame


def _refuse_too_many(spec: FlightSpec, frame: FlightFrame) -> None:
    """Photographs are counted before any is planned.

    Raises
    ------
    InputError
        When they do not fit into memory.
    """
    step = frame.footprint * (1.0 - np.array([spec.end_lap, spec.side_lap]))
    cross = [c.images or 2.0 * frame.half_axes[1] / step[0] + 1.0 for c in spec.cross_strips]
    count = float((2.0 * frame.half_axes / step + 1.0).prod()) + sum(cross)
    refuse_beyond_memory(
        BYTES_OF_PHOTOGRAPH * count, f"{count:.3g} photographs",
        f"make the area smaller or the photographs larger on the ground; {fitting(BYTES_OF_PHOTOGRAPH):.2g} would fit",
    )  # fmt: skip
    if spec.days is not None and spec.days > count:
        raise InputError(f"'flight.days' = {spec.days} is more than the photographs", f"give {count:.0f} at most")


def _known(index: Mapping[str, int], name: str, key: str) -> int:
    if name not in index:
        raise InputError(f"'{key}' names the camera '{name}', which is not there", f"there are {', '.join(index)}")
    return index[name]


def _base(camera: Camera, height: float, end_lap: float) -> float:
    return (1.0 - end_lap) * format_along_across_mm(camera)[0] * height / camera.focal_length_mm


def _frame(spec: FlightSpec, camera: Camera, height: float) -> FlightFrame:
    heading = np.radians(spec.heading_deg)
    axes = np.array([[np.sin(heading), np.cos(heading)], [np.cos(heading), -np.sin(heading)]])
    footprint = np.array(format_along_across_mm(camera)) * height / camera.focal_length_mm
    step = footprint * (1.0 - np.array([spec.end_lap, spec.side_lap]))
    if spec.area_m is not None:
        # the outer models begin at the border along; across, the footprints of the outer strips reach it
        needed = np.array([spec.area_m[0], max(spec.area_m[1] - footprint[1], 0.0)])
        count = np.ceil(needed / step - 1e-9) + 1
    else:
        count = np.array([spec.images_per_strip or 1, spec.strips or 1])
    return FlightFrame(np.array(spec.centre_m), axes, (count - 1) * step / 2.0, footprint)


def _run(i: int, count: int, runs: int) -> int:
    """Which of `runs` runs of nearly equal length the i-th of count belongs to."""
    return min(i * runs // max(count, 1), runs - 1)


def _main_strips(
    spec: FlightSpec, frame: FlightFrame, cameras: Sequence[Camera], used: list[int], height: float
) -> list[_Strip]:
    spacing = frame.footprint[1] * (1.0 - spec.side_lap)
    count = round(2.0 * frame.half_axes[1] / spacing) + 1
    strips = []
    for i in range(count):
        camera = used[_run(i, count, len(used))]
        base = _base(cameras[camera], height, spec.end_lap)
        along = _centred(int(np.floor(2.0 * frame.half_axes[0] / base + 1.001)), base)
        back = spec.alternating and i % 2 == 1
        along = along[::-1] if back else along
        across = np.full(len(along), (i - (count - 1) / 2.0) * spacing)
        day = str(_run(i, count, spec.days) + 1) if spec.days else ""
        strips.append(_Strip(str(i + 1), np.stack([along, across], axis=1), np.pi if back else 0.0, camera, day))
    return strips


def _centred(count: int, base: float) -> np.ndarray:
    return (np.arange(count) - (count - 1) / 2.0) * base


def _cross_strip(
    spec: FlightSpec,
    cross: CrossStripSpec,
    number: int,
    frame: FlightFrame,
    cameras: Sequence[Camera],
    index: dict[str, int],
    height: float,
) -> _Strip:
    camera = next(iter(index.values()))
    if cross.camera is not None:
        camera = _known(index, cross.camera, f"flight.cross_strips.{number}.camera")
    end_lap = spec.end_lap if cross.end_lap is None else cross.end_lap
    base = _base(cameras[camera], height, end_lap)
    count = cross.images or int(np.ceil(2.0 * frame.half_axes[1] / base)) + 1
    across = _centred(count, base)
    along = np.full(count, (2.0 * cross.position - 1.0) * frame.half_axes[0])
    day = str(cross.day or spec.days) if spec.days else ""
    # to the right of the flight is a clockwise quarter turn
    return _Strip(f"C{number + 1}", np.stack([along, across], axis=1), -np.pi / 2, camera, day)


def _fly(
    spec: FlightSpec,
    strips: list[_Strip],
    frame: FlightFrame,
    cameras: Sequence[Camera],
    level: float,
    rng: np.random.Generator,
) -> FlownImages:
    counts = [len(strip.positions) for strip in strips]
    n = sum(counts)
    per_image = [np.repeat(values, counts) for values in zip(*((s.name, s.camera, s.day) for s in strips), strict=True)]
    along_across = np.concatenate([strip.positions for strip in strips])
    planned = np.column_stack([frame.plan(along_across), np.full(n, level)])
    heading = np.arctan2(frame.axes[0, 1], frame.axes[0, 0]) + np.repeat([s.direction for s in strips], counts)
    axis = np.array([AXIS_ANGLE[c.flight_axis or "+y"] for c in cameras])[per_image[1]]
    kappa = (heading - axis + np.pi) % (2.0 * np.pi) - np.pi
    angles = rng.normal(size=(n, 3)) * np.radians(spec.attitude_sigma_deg)
    angles[:, 2] += kappa
    moved = rng.normal(size=(n, 3)) * np.array(spec.position_sigma_m)
    centre = planned + np.column_stack([moved[:, :2] @ frame.axes, moved[:, 2]])
    names = [f"{s.name}_{i + 1:03d}" for s in strips for i in range(len(s.positions))]
    return FlownImages(
        np.array(names),
        per_image[1].astype(np.int64),
        per_image[0],
        per_image[2],
        planned,
        centre,
        angles,
        _times(spec, strips),
    )


def _times(spec: FlightSpec, strips: list[_Strip]) -> np.ndarray:
    times, start = [], 0.0
    for strip in strips:
        flown = np.linalg.norm(strip.positions - strip.positions[0], axis=1) / spec.speed_m_s
        times.append(start + flown)
        start += float(flown[-1]) + spec.turn_s
    return np.concatenate(times)
