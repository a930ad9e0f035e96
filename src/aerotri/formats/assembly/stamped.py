"""Positions at time stamps: of a trajectory, or of the drone's own solution; `by_stamps` finds the photographs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from aerotri.conventions import InputError, counted
from aerotri.coordinates.ellipsoid import metres_of_units
from aerotri.formats.assembly.interpolation import LONGEST_GAP_S, interpolated
from aerotri.formats.assembly.parts import PositionList, Stamps, no_sigma
from aerotri.formats.assembly.timed import NONE, SINGLE, TimeStamps, Trajectory, in_words, true_sigma
from aerotri.formats.foreign.gnss_time import in_week_of, time_in_words
from aerotri.formats.text.notes import assumed, taken

GEOGRAPHIC = "EPSG:4326"
SHIFTS_S = np.arange(-30.0, 30.25, 0.5)
"""Errors of a clock that are looked for [C]: leap seconds, 18 s, whole seconds, and one for half of them."""
BETTER = 0.5
"""Part of the scatter that another clock has to leave for it to be right [C]."""
FEWEST_COMPARED = 10
"""Photographs that tell an error of the clock, at least [C]."""
EVEN = 0.05
"""Part of a step by which the times of a trajectory may be off; those of events are anywhere [C]."""


def positions_of_stamps(stamps: TimeStamps) -> PositionList:
    """The drone's own solution at its time stamps, moved to the camera.

    Raises
    ------
    InputError
        When there is no solution at all.
    """
    refused = np.where(stamps.quality == NONE, "the drone had no solution", "").astype("<U80")
    if (refused != "").all():
        raise InputError(
            "has times, but no positions", "give them: --positions, --time-stamps of this file", stamps.path
        )
    said = (f"{stamps.path.name}: the drone's own solution: {in_words(stamps.quality)}", *_about_poor(stamps))
    return _list_of(stamps.path, [stamps], stamps.place, true_sigma(stamps.sigma, stamps.quality), refused, said)


def _about_poor(stamps: TimeStamps) -> tuple[str, ...]:
    poor = int((stamps.quality == SINGLE).sum())
    if not poor:
        return ()
    least = ", ".join(f"{value:g}" for value in true_sigma(np.zeros((1, 3)), np.array([SINGLE]))[0])
    said = (
        f"{stamps.path.name}: single point positions get σ {least} m at least, whatever the file states, and all may "
        "be off together by much more: compute a trajectory with a base station (PPK), or add control points"
    )
    return (assumed(said),)


def events(trajectory: Trajectory) -> PositionList:
    """A trajectory that has an epoch for each photograph, as programs write for events.

    Raises
    ------
    InputError
        When the epochs are regular: then it is the path, and the times of the photographs are needed.
    """
    if _is_path(trajectory.time):
        message = f"is a trajectory of {len(trajectory)} epochs, and nothing says when photographs were taken"
        raise InputError(message, "give the time stamps of the flight: --time-stamps FLIGHT.MRK", trajectory.path)
    count = len(trajectory)
    stamps = TimeStamps(
        trajectory.path, np.full(count, -1), trajectory.time, np.zeros((count, 3)), trajectory.place, trajectory.sigma,
        trajectory.quality, trajectory.heights, trajectory.messages,
    )  # fmt: skip
    found = positions_of_stamps(stamps)
    each = f"{counted(count, 'event')}, taken as one for each photograph: {in_words(stamps.quality)}"
    said = (
        *trajectory.messages,
        assumed(f"{trajectory.path.name}: {each}"),
        assumed(
            "positions are those of the antenna: state its lever arm, if it is not 0, in block.toml as lever_arm_m"
        ),
    )
    return replace(found, messages=said, crs=_geographic_of(trajectory))


def _is_path(time: np.ndarray) -> bool:
    """Whether times (n,) are those of a receiver: at equal steps, and at whole ones of its clock."""
    step = np.diff(time)
    if not len(step):
        return False
    usual = float(np.median(step))
    clock = 1.0 / round(1.0 / usual) if usual < 1.0 else 1.0
    beside = np.abs(time - clock * np.round(time / clock))
    return bool(np.median(np.abs(step - usual)) < EVEN * usual and np.median(beside) < EVEN * clock)


def joined(trajectories: Sequence[Trajectory], path: Path) -> Trajectory:
    """Trajectories of several flights as one.

    Parameters
    ----------
    path : of their folder; of a single one its own stays.

    Raises
    ------
    InputError
        When two cover the same time, or differ in datum, heights or clock.
    """
    if len(trajectories) == 1:
        return trajectories[0]
    flights = sorted(trajectories, key=lambda one: float(one.time[0]))
    for before, after in pairwise(flights):
        if (before.datum, before.heights, before.week_known) != (after.datum, after.heights, after.week_known):
            message = f"does not have the datum, the heights and the weeks of {before.path.name}"
            raise InputError(message, "export all flights alike", after.path)
        if after.time[0] <= before.time[-1]:
            message = f"covers a time that {before.path.name} covers too"
            raise InputError(message, "keep one trajectory of each flight in the folder", after.path)
    return replace(
        flights[0],
        path=path,
        time=np.concatenate([one.time for one in flights]),
        place=np.concatenate([one.place for one in flights]),
        sigma=np.concatenate([one.sigma for one in flights]),
        quality=np.concatenate([one.quality for one in flights]),
        messages=tuple(text for one in flights for text in one.messages),
    )


def positions_at(trajectory: Trajectory, lists: Sequence[TimeStamps]) -> PositionList:
    """A trajectory at the time stamps of one or several files, moved to the camera.

    Raises
    ------
    InputError
        When the two have no time in common, or their clocks differ.
    """
    time = np.concatenate([stamps.time for stamps in lists])
    if not trajectory.week_known:
        trajectory = replace(trajectory, time=in_week_of(trajectory.time, float(np.median(time))))
    found = interpolated(trajectory, time)
    have = found.refused == ""
    if not have.any():
        spans = [
            f"{time_in_words(float(t[0]))} to {time_in_words(float(t[-1]))}" for t in (trajectory.time, np.sort(time))
        ]
        message = f"covers no time stamp of {lists[0].path.name}: it has {spans[0]}, the time stamps {spans[1]}"
        raise InputError(
            message, f"give the trajectory of this flight, with gaps below {LONGEST_GAP_S:g} s", trajectory.path
        )
    own = np.concatenate([np.where((s.quality == NONE)[:, None], np.nan, s.place) for s in lists])
    said = [*trajectory.messages, *(text for stamps in lists for text in stamps.messages)]
    said.append(_about_interpolation(trajectory, found.error[have], found.quality[have]))
    said += _about_own(trajectory, lists[0].path, time, found.place, own)
    sigma = np.where(found.sigma > 0.0, found.sigma, np.nan)
    whole = _list_of(trajectory.path, lists, found.place, sigma, found.refused, tuple(said))
    return replace(whole, heights=trajectory.heights, crs=_geographic_of(trajectory))


def _geographic_of(trajectory: Trajectory) -> str:
    """The system of longitude and latitude that a trajectory names.

    Raises
    ------
    InputError
        When it is not known.
    """
    from aerotri.coordinates.stated_systems import geographic_of, stated_system

    if trajectory.datum.upper().replace(" ", "").startswith("WGS84"):
        return GEOGRAPHIC
    system = stated_system(trajectory.datum)
    if system is None or not system.crs:
        message = f"the datum '{trajectory.datum[:60]}' is not known"
        raise InputError(message, "export the trajectory on WGS84, or on the datum of the block", trajectory.path)
    return geographic_of(system.crs)


def _list_of(
    path: Path, lists: Sequence[TimeStamps], place: np.ndarray, sigma: np.ndarray, refused: np.ndarray,
    messages: tuple[str, ...],
) -> PositionList:  # fmt: skip
    """A list of positions of the antenna (n, 3) moved to the camera."""
    number = np.concatenate([stamps.number for stamps in lists])
    offset = np.concatenate([stamps.offset for stamps in lists])
    file = np.repeat(np.arange(len(lists)), [len(stamps) for stamps in lists])
    names = [f"{lists[f].path.name}:{n}" for f, n in zip(file.tolist(), number.tolist(), strict=True)]
    if offset.any():
        length = float(np.median(np.linalg.norm(offset, axis=1)))
        moved = taken(f"positions were moved from the antenna to the camera, by {length:.3f} m (median)")
        messages = (*messages, moved)
    return PositionList(
        path=path,
        images=np.array(names, dtype=str),
        xyz=place + offset / metres_of_units(place),
        sigma=sigma,
        yaw_pitch_roll=no_sigma(len(number)),
        crs=GEOGRAPHIC,
        messages=messages,
        heights=lists[0].heights,
        time=np.concatenate([stamps.time for stamps in lists]),
        stamps=Stamps(file, tuple(stamps.path for stamps in lists), number, refused),
        of_base=True,
    )


def _about_interpolation(trajectory: Trajectory, error: np.ndarray, quality: np.ndarray) -> str:
    east, north, up = 1e3 * np.sqrt(np.mean(error**2, axis=0))
    step = float(np.median(np.diff(trajectory.time)))
    size = f"{east:.1f}, {north:.1f}, {up:.1f} mm east, north, up"
    return taken(
        f"{trajectory.path.name}: interpolated between epochs {step:g} s apart, error {size} (RMS, from epochs left "
        f"out; part of σ); at the time stamps {in_words(quality)}"
    )


def _about_own(
    trajectory: Trajectory, stamps: Path, time: np.ndarray, place: np.ndarray, own: np.ndarray
) -> tuple[str, ...]:
    """How far the drone's own solution (n, 3) is from the trajectory (n, 3), where both have a position.

    Raises
    ------
    InputError
        When another clock explains most of it.
    """
    both = np.isfinite(place).all(axis=1) & np.isfinite(own).all(axis=1)
    if not both.any():
        return ()
    apart = (own[both] - place[both]) * metres_of_units(place[both])
    _refuse_other_clock(trajectory, time[both], stamps, own[both])
    plan, height = float(np.median(np.hypot(apart[:, 0], apart[:, 1]))), float(np.median(np.abs(apart[:, 2])))
    return (
        f"{stamps.name}: the drone's own solution is {plan:.2f} m in plan and {height:.2f} m in height from "
        f"{trajectory.path.name} (median)",
    )


def _refuse_other_clock(trajectory: Trajectory, time: np.ndarray, stamps: Path, own: np.ndarray) -> None:
    """Refuse a trajectory that fits the drone's own solution (n, 3) at other times (n,) much better.

    What both differ by all along the flight is that of their base stations, and says nothing.
    """
    if len(time) < FEWEST_COMPARED:
        return
    metres = metres_of_units(own)[:, :2]
    scatter = []
    for shift in SHIFTS_S:
        there = [np.interp(time + shift, trajectory.time, trajectory.place[:, k]) for k in (0, 1)]
        apart = (own[:, :2] - np.column_stack(there)) * metres
        scatter.append(float(np.median(np.linalg.norm(apart - np.median(apart, axis=0), axis=1))))
    best = int(np.argmin(scatter))
    if SHIFTS_S[best] != 0.0 and scatter[best] < BETTER * scatter[int(np.argmin(np.abs(SHIFTS_S)))]:
        message = f"its clock is about {SHIFTS_S[best]:+.1f} s off that of {stamps.name}, by the drone's own positions"
        raise InputError(
            message, "is it UTC, or another zone, that it calls GPS time? export GPS time", trajectory.path
        )
