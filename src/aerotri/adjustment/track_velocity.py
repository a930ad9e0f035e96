"""Velocity of photographs from their positions and times: the motion of a rolling shutter while it is read.

Every camera is looked at alone, within a flight and a strip: two aircraft with the same camera model do not mix as long
as their cameras, flights or strips are named apart. The path between exposures is a cubic spline over time; where times
are rounded to seconds, a velocity is the slope through a photograph and its neighbours. What does not hang together
(times that stand still or jump, steps of different speed and direction) is not used, so that no velocity is wild; such
a photograph takes the velocity of its strip.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.adjustment.exposures import FLIGHT_COLUMNS
from aerotri.adjustment.track import TURN, exposure_times, order_of_exposure, strips_of_track
from aerotri.observations import Block
from aerotri.observations.rigs import station_places

TIMED, STRIP, STATED, UNKNOWN = "time", "strip", "speed", "unknown"
"""Where a velocity comes from: the times of the photograph and its neighbours, the others of its strip, the direction
of its neighbours and a speed that is stated, or nowhere (then it is 0)."""
LONGEST_STEP = 4.0
"""Usual steps of time beyond which two photographs are no neighbours [C]: a turn or a pause lies between."""
MOST_BESIDE = 3
"""Neighbours on either side that a velocity is taken over, at most."""
ROUNDED = 1.0 / np.sqrt(12.0)
"""σ of a time that was rounded, in units of the rounding [D: of a uniform distribution]."""
ENOUGH = 0.03
"""Relative σ of a speed from rounded times with which no more neighbours are asked for [C]."""
CORRELATED = 0.7
"""Squared correlation of positions and times above which an aircraft flies on and its times are rounded [C]."""
SMOOTH = 0.5
"""Speed of a step over that of the next or the last one, below which they do not hang together [C]."""
SLOW = 1.0 / 3.0
"""Share of the usual speed below which steps are those of an aircraft that hovers, whatever their direction [C]."""
WILD = 3.0
"""Times the usual speed above which a velocity is not believed [C]."""


@dataclass(frozen=True, eq=False)
class TrackVelocities:
    """Of n photographs: velocity (n, 3) m/s in the object frame, and source (n,) str, of the four above."""

    velocity: np.ndarray
    source: np.ndarray


def track_velocities(
    block: Block, images: np.ndarray, centre: np.ndarray, wanted: np.ndarray, speed: np.ndarray
) -> TrackVelocities:
    """Velocities of photographs.

    Parameters
    ----------
    images : (n,) rows of the block. centre : (n, 3) m.
    wanted : (n,) bool, photographs whose velocity is asked for.
    speed : (n,) m/s, that of photographs without times; NaN where it is not stated.
    """
    time = times_of(block)[images]
    velocity, source = np.zeros((len(images), 3)), np.full(len(images), UNKNOWN, dtype=object)
    for own in _passes(block, images, wanted):
        found, known = _by_times(centre[own], time[own], _strips(block, images[own], centre[own], time[own]))
        velocity[own], source[own] = found, known
        left = own[(source[own] == UNKNOWN) & np.isfinite(speed[own])]
        if len(left):
            strips = _strips(block, images[own], centre[own], np.full(len(own), np.nan))
            along = _along(block, images[own], centre[own], strips)
            at = np.isin(own, left) & (along != 0.0).any(axis=1)
            velocity[own[at]], source[own[at]] = along[at] * speed[own[at], None], STATED
    return TrackVelocities(velocity, source)


def times_of(block: Block) -> np.ndarray:
    """(n,) s, of every photograph; on a rig that of the reference photograph where its own is not known."""
    time, places = exposure_times(block), station_places(block)
    return np.where(np.isfinite(time), time, time[places.lead])


def _passes(block: Block, images: np.ndarray, wanted: np.ndarray) -> list[np.ndarray]:
    """Rows of the photographs of one camera and one flight each."""
    column = next((name for name in FLIGHT_COLUMNS if name in block.images.columns), None)
    flight = np.full(len(images), "") if column is None else np.asarray(block.images.columns[column])[images]
    keys = list(zip(block.images.camera[images].tolist(), flight.astype(str).tolist(), strict=True))
    number = {key: k for k, key in enumerate(dict.fromkeys(keys))}
    of = np.array([number[key] for key in keys], dtype=np.int64)
    return [np.flatnonzero((of == k) & wanted) for k in range(len(number)) if ((of == k) & wanted).any()]


def _strips(block: Block, images: np.ndarray, centre: np.ndarray, time: np.ndarray) -> np.ndarray:
    """(n,) number of the strip of each; found where the track turns if they are not named."""
    names = block.images.strip[images].astype(str)
    if all(names.tolist()):
        return np.unique(names, return_inverse=True)[1]
    strip, known = np.full(len(images), -1), np.isfinite(time)
    rows = np.flatnonzero(known) if known.any() else np.arange(len(images))
    nameless = np.full(len(rows), "")
    order = rows[order_of_exposure(centre[rows], nameless, block.images.names[images[rows]], time[rows])]
    strip[order] = strips_of_track(centre[order], nameless)
    return strip


def _by_times(centre: np.ndarray, time: np.ndarray, strip: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Velocities (n, 3) of the photographs of a camera by their times, and where they come from."""
    n = len(time)
    velocity, source = np.zeros((n, 3)), np.full(n, UNKNOWN, dtype=object)
    runs = [_in_time(np.flatnonzero((strip == one) & np.isfinite(time)), time) for one in np.unique(strip)]
    steps = np.concatenate([np.diff(time[run]) for run in runs] or [np.zeros(0)])
    steps = steps[steps > 0.0]
    if not len(steps):
        return velocity, source
    longest, rounding = LONGEST_STEP * float(np.median(steps)), time_rounding(time)
    lengths = [np.linalg.norm(_step_velocities(centre[run], time[run], longest), axis=1) for run in runs]
    speeds = np.concatenate(lengths)
    speeds = speeds[np.isfinite(speeds)]
    usual = float(np.median(speeds)) if len(speeds) else 0.0
    for one, run in zip(np.unique(strip), runs, strict=True):
        found = _of_run(centre[run], time[run], longest, rounding, usual)
        known = np.isfinite(found[:, 0]) & ~(np.linalg.norm(np.nan_to_num(found), axis=1) > WILD * usual)
        velocity[run[known]], source[run[known]] = found[known], TIMED
        if known.any():
            left = np.flatnonzero((strip == one) & (source == UNKNOWN))
            velocity[left], source[left] = np.median(found[known], axis=0), STRIP
    return velocity, source


def _in_time(rows: np.ndarray, time: np.ndarray) -> np.ndarray:
    return rows[np.argsort(time[rows], kind="stable")]


def time_rounding(time: np.ndarray) -> float:
    """s that times were rounded to: 1 where all are whole seconds, as in EXIF, else none."""
    known = time[np.isfinite(time)]
    return 1.0 if len(known) and (known == np.round(known)).all() else 0.0


def _step_velocities(centre: np.ndarray, time: np.ndarray, longest: float) -> np.ndarray:
    """(n − 1, 3) m/s from each photograph of a run to the next; NaN where they are no neighbours."""
    step = np.diff(time)
    usable = (step > 0.0) & (step <= longest)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(usable[:, None], np.diff(centre, axis=0) / step[:, None], np.nan)


def _of_run(centre: np.ndarray, time: np.ndarray, longest: float, rounding: float, usual: float) -> np.ndarray:
    """(n, 3) m/s along one strip in the order of time; NaN where nothing hangs together."""
    n = len(time)
    steps = _step_velocities(centre, time, longest)
    before, after = np.full((n, 3), np.nan), np.full((n, 3), np.nan)
    before[1:], after[:-1] = steps, steps
    lengths = np.stack([np.linalg.norm(before, axis=1), np.linalg.norm(after, axis=1)])
    shorter, longer = np.fmin(*lengths), np.fmax(*lengths)
    # a rounded time may make a step look that much shorter
    rounded = np.minimum(rounding / np.maximum(np.diff(time, prepend=np.nan, append=np.nan), 1e-9), 1.0)
    least = SMOOTH * (1.0 - np.fmax(rounded[:-1], rounded[1:]))
    with np.errstate(invalid="ignore"):
        turned = np.sum(before * after, axis=1) < np.cos(TURN) * shorter * longer
        torn = (turned | (shorter < least * longer)) & np.isfinite(lengths).all(axis=0) & (longer > SLOW * usual)
    linked = np.isfinite(steps[:, 0]) & ~torn[1:] & ~torn[:-1]
    if rounding == 0.0:
        return _on_smooth_path(centre, time, linked)
    found = np.full((n, 3), np.nan)
    for k in range(n):
        rows = _neighbours(k, linked, time, rounding)
        if len(rows) > 1:
            found[k] = _slope(centre[rows], time[rows])
    return found


def _slope(centre: np.ndarray, time: np.ndarray) -> np.ndarray:
    """(3,) m/s of positions over rounded times.

    [D] The slope of positions over times that err is too small by the squared correlation of the two; times over
    positions have no such bias. Of an aircraft that hardly moves the correlation says nothing, and the slope stays.
    """
    since, way = time - time.mean(), centre - centre.mean(axis=0)
    slope = since @ way / (since @ since)
    along = way @ slope / max(float(np.linalg.norm(slope)), 1e-12)
    squared = float(since @ along) ** 2 / max(float((since @ since) * (along @ along)), 1e-300)
    return slope / squared if squared > CORRELATED else slope


def _on_smooth_path(centre: np.ndarray, time: np.ndarray, linked: np.ndarray) -> np.ndarray:
    """(n, 3) m/s, the derivative of a cubic spline through the photographs that are linked; NaN for one alone."""
    from scipy.interpolate import CubicSpline

    found = np.full(centre.shape, np.nan)
    part = np.concatenate([[0], np.cumsum(~linked)])
    for one in np.unique(part):
        rows = np.flatnonzero(part == one)
        if len(rows) > 1:
            # of two or three photographs a line, a parabola
            found[rows] = CubicSpline(time[rows], centre[rows])(time[rows], 1)
    return found


def _neighbours(k: int, linked: np.ndarray, time: np.ndarray, rounding: float) -> np.ndarray:
    """Rows of a photograph and its neighbours: one on either side, more where their times are rounded."""
    first = last = k
    for _ in range(MOST_BESIDE):
        if first > 0 and linked[first - 1]:
            first -= 1
        if last < len(time) - 1 and linked[last]:
            last += 1
        since = time[first : last + 1] - time[first : last + 1].mean()
        if rounding * ROUNDED <= ENOUGH * float(np.sqrt(since @ since)):
            break
    return np.arange(first, last + 1)


def _along(block: Block, images: np.ndarray, centre: np.ndarray, strip: np.ndarray) -> np.ndarray:
    """(n, 3) unit directions of flight by the neighbours, in the order of the names; 0 for a strip of one."""
    names = block.images.names[images]
    out = np.zeros((len(images), 3))
    for one in np.unique(strip):
        rows = np.flatnonzero(strip == one)
        order = rows[order_of_exposure(centre[rows], np.full(len(rows), ""), names[rows], np.full(len(rows), np.nan))]
        if len(order) > 1:
            way = np.gradient(centre[order], axis=0)
            out[order] = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12)
    return out


def strip_velocities(block: Block, images: np.ndarray, centre: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """(n, 3) velocities of the strips of photographs in units of the usual one; 0 of a photograph alone.

    By times where all wanted photographs have them, else by the base an exposure: units of one kind for all.

    Parameters
    ----------
    images : (n,) rows of the block. centre : (n, 3) m. wanted : (n,) bool.
    """
    time, velocity = times_of(block)[images], np.zeros((len(images), 3))
    timed = bool(np.isfinite(time[wanted]).all())
    for own in _passes(block, images, wanted):
        strips = _strips(block, images[own], centre[own], time[own])
        for one in np.unique(strips):
            rows = own[strips == one]
            velocity[rows] = _mean_velocity(centre[rows], time[rows], block.images.names[images[rows]], timed)
    speed = np.linalg.norm(velocity, axis=1)
    usual = float(np.median(speed[speed > 0.0])) if (speed > 0.0).any() else 1.0
    return velocity / usual


def _mean_velocity(centre: np.ndarray, time: np.ndarray, names: np.ndarray, timed: bool) -> np.ndarray:
    """(3,) slope of positions over times, or over the number of the exposure; 0 where there is none."""
    if not timed:
        order = order_of_exposure(centre, np.full(len(centre), ""), names, np.full(len(centre), np.nan))
        time = np.empty(len(centre))
        time[order] = np.arange(len(centre))
    since = time - time.mean()
    length = float(since @ since)
    return since @ (centre - centre.mean(axis=0)) / length if length > 0.0 else np.zeros(3)
