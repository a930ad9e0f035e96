"""Orientation from projection centres alone: vertical photographs, κ from the direction of flight [C].

Strips are taken from the images' strip names, or found where the track turns. Which image axis points along the flight
is the camera's `flight_axis`; where it is not stated, all four are tried by the caller.
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from aerotri.conventions import InputError
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations import Block
from aerotri.observations.rigs import station_places

TURN = np.radians(45.0)
"""Change of direction between two legs that ends a strip."""
LONG_LEG = 3.0
"""A leg this many times the usual one ends a strip."""

AXIS_ANGLE = {"+x": 0.0, "+y": np.pi / 2.0, "-x": np.pi, "-y": -np.pi / 2.0}
"""Direction of the flight in the image, counted from the x axis."""


def along_strip(centre: np.ndarray) -> np.ndarray:
    """(n,) order of the photographs of a strip (n, 3) along its line, from west to east, or south to north."""
    middle = centre.mean(axis=0)
    along = np.linalg.svd(centre - middle)[2][0]
    # a direction has no sign of its own
    along = along * np.sign(along[np.argmax(np.abs(along))])
    return np.argsort((centre - middle) @ along, kind="stable")


def exposure_times(block: Block) -> np.ndarray:
    """(n,) s, time of every photograph as GNSS or a column `time` of images.csv gives it, NaN where unknown."""
    time = np.full(len(block.images), np.nan)
    if "time" in block.images.columns:
        for k, text in enumerate(block.images.columns["time"]):
            try:
                time[k] = float(text)
            except ValueError:
                continue
    if block.gnss_ins is not None:
        time[block.gnss_ins.image] = np.where(
            np.isfinite(block.gnss_ins.time), block.gnss_ins.time, time[block.gnss_ins.image]
        )
    return time


def one_an_exposure(block: Block, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """One photograph of every exposure, since the cameras of a rig fly one track together.

    Parameters
    ----------
    rows : (n,) photographs, rows of the block.

    Returns
    -------
    (e,) which of the n stand for the exposures, in their order: of a rig the reference camera where it is among them;
    (n,) which of the e exposures every photograph belongs to.
    """
    lead = station_places(block, off_too=True).lead[rows]
    _, first, exposure = np.unique(lead, return_index=True, return_inverse=True)
    at_lead = np.flatnonzero(lead == rows)
    first[exposure[at_lead]] = at_lead
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return first[order], rank[exposure.ravel()]


def order_of_exposure(centre: np.ndarray, strips: np.ndarray, names: np.ndarray, time: np.ndarray) -> np.ndarray:
    """(n,) order in which photographs were taken, or the other way round.

    By their time where all have one, else along the named strips, else in the order of the rows or of the names
    (numbers in them counted as such), whichever makes the shorter track.

    Parameters
    ----------
    centre : (n, 3) m. strips, names : (n,) str, strips '' where unknown. time : (n,) s, NaN where unknown.
    """
    if np.isfinite(time).all():
        return np.argsort(time, kind="stable")
    if all(strips.tolist()):
        own = [np.flatnonzero(strips == strip) for strip in dict.fromkeys(strips.tolist())]
        return np.concatenate([rows[along_strip(centre[rows])] for rows in own])
    by_name = np.array(sorted(range(len(names)), key=lambda k: natural_key(str(names[k]))), dtype=np.int64)
    orders = (np.arange(len(names)), by_name)
    return min(orders, key=lambda rows: float(np.linalg.norm(np.diff(centre[rows, :2], axis=0), axis=1).sum()))


def natural_key(name: str) -> list[tuple[int, int, str]]:
    """A name as a key to sort by, 'IMG_9' before 'IMG_10'."""
    return [(1, int(part), "") if part.isdecimal() else (0, 0, part) for part in re.split(r"(\d+)", name)]


def strips_of_track(centre: np.ndarray, names: np.ndarray) -> np.ndarray:
    """(n,) number of the strip every photograph belongs to.

    Parameters
    ----------
    centre : (n, 3) m in the order of exposure. names : (n,) strip names, '' where unknown.
    """
    if len(names) and all(str(name) for name in names):
        return np.unique(names.astype(str), return_inverse=True)[1]
    leg = np.diff(centre[:, :2], axis=0)
    length = np.hypot(leg[:, 0], leg[:, 1])
    usual = np.median(length[length > 0]) if (length > 0).any() else 1.0
    heading = np.arctan2(leg[:, 1], leg[:, 0])
    strip, number = np.zeros(len(centre), dtype=np.int64), 0
    for k in range(1, len(centre)):
        turned = k >= 2 and strip[k - 2] == number and abs(_wrapped(heading[k - 1] - heading[k - 2])) > TURN
        if length[k - 1] > LONG_LEG * usual or turned:
            number += 1
        strip[k] = number
    return strip


def with_named_strips(block: Block) -> Block:
    """The block with strips found where the track turns, if its photographs have none and its groups are strips.

    Raises
    ------
    InputError
        When there is no position to find them from.
    """
    images = block.images
    if block.settings.adjustment.parameter_groups != "strip" or all(images.strip.astype(str).tolist()):
        return block
    centre = images.centre.copy()
    if block.gnss_ins is not None:
        known = np.isfinite(block.gnss_ins.xyz).all(axis=1)
        centre[block.gnss_ins.image[known]] = block.gnss_ins.xyz[known]
    if not np.isfinite(centre).all():
        raise InputError(
            'parameter_groups = "strip", but images.csv names no strips and not every photograph has a position',
            "add a column strip to images.csv, or positions",
            file="images.csv",
        )
    alone, exposure = one_an_exposure(block, np.arange(len(images)))
    nameless = np.full(len(alone), "")
    order = order_of_exposure(centre[alone], nameless, images.names[alone], exposure_times(block)[alone])
    number = np.empty(len(alone), dtype=np.int64)
    number[order] = strips_of_track(centre[alone][order], nameless)
    strip = np.array([f"strip {k + 1}" for k in number[exposure]], dtype=object)
    return replace(block, images=replace(images, strip=strip))


def headings(centre: np.ndarray, strip: np.ndarray) -> np.ndarray:
    """(n,) rad, direction of flight of every photograph, counted from the X axis; NaN for a strip of one.

    The direction of a strip is that from its first to its last half; of a single photograph, of the nearest one.
    """
    heading = np.full(len(centre), np.nan)
    for number in np.unique(strip):
        own = np.flatnonzero(strip == number)
        if len(own) > 1:
            half = len(own) // 2
            way = centre[own[-half:], :2].mean(axis=0) - centre[own[:half], :2].mean(axis=0)
            heading[own] = np.arctan2(way[1], way[0])
    known = np.flatnonzero(np.isfinite(heading))
    for k in np.flatnonzero(~np.isfinite(heading)):
        if len(known):
            heading[k] = heading[known[np.argmin(np.linalg.norm(centre[known] - centre[k], axis=1))]]
    return heading


def vertical_rotations(heading: np.ndarray, axis: str | np.ndarray) -> np.ndarray:
    """(n, 3, 3) rotations of vertical photographs whose image axis `axis` points along the flight."""
    angle = np.array([AXIS_ANGLE[a] for a in np.broadcast_to(axis, heading.shape)])
    zero = np.zeros_like(heading)
    return rotation_from_angles(np.column_stack([zero, zero, np.nan_to_num(heading) - angle]))


def _wrapped(angle: float) -> float:
    return float((angle + np.pi) % (2.0 * np.pi) - np.pi)
