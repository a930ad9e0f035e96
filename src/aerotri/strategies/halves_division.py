"""Photographs divided into two halves: alternate photographs, alternate strips, directions of flight, time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from aerotri.adjustment.track import exposure_times, headings, one_an_exposure, order_of_exposure, strips_of_track
from aerotri.observations import Block

FEWEST_PHOTOGRAPHS = 3
"""Photographs that a half needs [C]: with two there is one model and nothing to compare."""
OPPOSITE = np.cos(np.radians(60.0))
"""Cosine beyond which a strip counts to the main direction or to the opposite one [C]; in between it is a cross
strip."""


@dataclass(frozen=True, eq=False)
class Division:
    """Which half every photograph belongs to.

    Parameters
    ----------
    half : (n,) 0 or 1, −1 for photographs that do not take part. names : of the halves in words.
    reason : why the block cannot be divided so, '' where it can. notes : sentences on how it was divided.
    """

    half: np.ndarray
    names: tuple[str, str]
    reason: str = ""
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Flight:
    """The photographs that were adjusted, in the order of the flight.

    Parameters
    ----------
    rows : (k,) rows of the block's photographs in order of exposure. strip : (k,) number of the strip, by first
        photograph. x_axis : (k, 2) direction of the image's x axis in plan. centre : (k, 3) m.
    timed : whether every photograph has its time. named : whether the strips have names in the block.
    station : (k,) photographs of one exposure have the same number.
    """

    rows: np.ndarray
    strip: np.ndarray
    x_axis: np.ndarray
    centre: np.ndarray
    timed: bool
    named: bool
    station: np.ndarray


def flight_of(block: Block, rows: np.ndarray, centre: np.ndarray, rotation: np.ndarray) -> Flight:
    """The flight of the photographs `rows` (k,) of a block, with their adjusted centres (k, 3) and rotations."""
    images = block.images
    time, strip = exposure_times(block)[rows], np.asarray(images.strip, dtype=object)[rows]
    # the cameras of a rig fly one track, not one each
    alone, exposure = one_an_exposure(block, rows)
    track = order_of_exposure(centre[alone], strip[alone], images.names[rows[alone]].astype(str), time[alone])
    of_exposure, rank_of = np.empty(len(alone), dtype=np.int64), np.empty(len(alone), dtype=np.int64)
    of_exposure[track] = strips_of_track(centre[alone][track], strip[alone][track].astype(str))
    rank_of[track] = np.arange(len(alone))
    order = np.argsort(rank_of[exposure], kind="stable")
    rows, centre, strip, number = rows[order], centre[order], strip[order], of_exposure[exposure][order]
    timed, named = bool(np.isfinite(time).all()), all(str(name) for name in strip)
    first = {int(value): k for k, value in reversed(list(enumerate(number)))}
    rank = {value: k for k, value in enumerate(sorted(first, key=lambda value: first[value]))}
    return Flight(
        rows, np.array([rank[int(value)] for value in number]), rotation[order][:, :2, 0], centre, timed, named,
        _stations(block, rows),
    )  # fmt: skip


def _stations(block: Block, rows: np.ndarray) -> np.ndarray:
    """(k,) number of the exposure of every photograph, in order of the flight."""
    if "station" not in block.images.columns:
        return np.arange(len(rows))
    own = np.asarray(block.images.columns["station"], dtype=object)[rows]
    names = [str(name) or f"#{row}" for name, row in zip(own, rows, strict=True)]
    rank = {name: k for k, name in enumerate(dict.fromkeys(names))}
    return np.array([rank[name] for name in names])


def divide(block: Block, flight: Flight, how: str) -> Division:
    """The photographs of a block in two halves.

    Parameters
    ----------
    how : a key of `results.halves.DIVISIONS`.
    """
    makers: dict[str, Callable[[Flight], Division]] = {
        "photographs": _by_photographs, "strips": _by_strips, "directions": _by_directions, "time": _by_time,
    }  # fmt: skip
    found = makers[how](flight)
    if not found.reason:
        count = [int((found.half == k).sum()) for k in (0, 1)]
        if min(count) < FEWEST_PHOTOGRAPHS:
            few = f"one half would have {min(count)} photographs: at least {FEWEST_PHOTOGRAPHS} are needed"
            found = Division(found.half, found.names, few)
    half = np.full(len(block.images), -1)
    half[flight.rows] = found.half
    return Division(half, found.names, found.reason, found.notes)


def _by_photographs(flight: Flight) -> Division:
    half = np.zeros(len(flight.rows), dtype=np.int64)
    for strip in np.unique(flight.strip):
        own = np.flatnonzero(flight.strip == strip)
        half[own] = np.unique(flight.station[own], return_inverse=True)[1] % 2
    return Division(half, ("photographs 1, 3, 5 … of each strip", "photographs 2, 4, 6 … of each strip"))


def _by_strips(flight: Flight) -> Division:
    names = ("strips 1, 3, 5 …", "strips 2, 4, 6 …")
    count = len(np.unique(flight.strip))
    if count < 2:
        return Division(flight.strip, names, "the block has one strip: there are no alternate strips")
    notes = (f"{count} strips" + ("" if flight.named else ", found where the track turns"),)
    return Division(flight.strip % 2, names, notes=notes)


def _by_directions(flight: Flight) -> Division:
    names = ("strips flown one way", "strips flown the other way")
    by_track = flight.timed or not flight.named
    if by_track:
        angle = headings(flight.centre, flight.strip)
        way = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    else:
        way = flight.x_axis
    known = np.asarray(np.isfinite(way).all(axis=1))
    if not known.any():
        return Division(np.zeros(len(way), np.int64), names, "no strip has two photographs: no direction is known")
    half = _sides(np.where(known[:, None], way, 0.0), flight.strip)
    if half.min() == half.max():
        return Division(half, names, "all strips were flown in the same direction")
    told = "the track" if by_track else "the rotation of the images: the block has no times"
    return Division(half, names, notes=(f"directions of flight by {told}",))


def _sides(way: np.ndarray, strip: np.ndarray) -> np.ndarray:
    """(k,) 0 or 1: strips along the main axis, and those across it, by the sign of their direction."""
    angle = np.arctan2(way[:, 1], way[:, 0])
    # the main axis has no sign: doubled angles
    axis = 0.5 * np.arctan2(np.sin(2.0 * angle).sum(), np.cos(2.0 * angle).sum())
    main, cross = np.array([np.cos(axis), np.sin(axis)]), np.array([-np.sin(axis), np.cos(axis)])
    half = np.zeros(len(way), dtype=np.int64)
    for number in np.unique(strip):
        own = strip == number
        mean = way[own].mean(axis=0)
        mean = mean / max(np.linalg.norm(mean), 1e-12)
        along = float(mean @ main)
        half[own] = int((along if abs(along) > OPPOSITE else float(mean @ cross)) < 0.0)
    return half


def _by_time(flight: Flight) -> Division:
    names = ("first half of the flight", "second half of the flight")
    station = np.unique(flight.station, return_inverse=True)[1]
    half = (station >= (station.max(initial=0) + 1) // 2).astype(np.int64)
    order = "by the times of the photographs" if flight.timed else "by the order of the photographs: no times are given"
    return Division(half, names, notes=(f"divided {order}",))
