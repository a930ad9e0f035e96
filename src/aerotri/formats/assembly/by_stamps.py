"""Which photograph belongs to which time stamp: by the number in its name, by its time, or by its place in the order.

Clocks of cameras may show any time zone, in whole seconds; between time stamps and photographs their differences are
constant all the same. A photograph or a time stamp that is missing shows in them, so that it never shifts the others.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from aerotri.adjustment.track import natural_key
from aerotri.conventions import InputError, counted
from aerotri.formats.assembly.parts import PositionList, Stamps
from aerotri.formats.text.notes import assumed, left_behind
from aerotri.observations.names import stem

DAY_S = 86400.0
TIMES_AGREE_S = 2.0
"""Difference of the clocks around its median up to which times agree [C]: EXIF has whole seconds, cut off, and some
cameras write them a second late."""
CUT_OFF_S = 0.75
"""The same where times alone tell the photographs apart [C]: half of what is cut off, and a little."""
FEWEST_TIMES = 3
"""Photographs with times from which times are compared [C]."""
FEW = 0.1
"""Part of the photographs whose times may disagree with their numbers; beyond it the numbers are not believed [C]."""
SHOWN = 5
"""Names that a sentence shows at most."""
DIGITS = re.compile(r"\d+")


@dataclass(frozen=True, eq=False)
class _Photographs:
    """The photographs: names and times (n,), s by the clock of the camera, NaN where unknown."""

    names: np.ndarray
    time: np.ndarray


def named_by_stamps(positions: PositionList, names: np.ndarray, time: np.ndarray) -> PositionList:
    """The list with the names of the photographs that its rows mean; times go on by the clock of the camera.

    Parameters
    ----------
    names : (p,) str, photographs; time : (p,) s, by the clock of the camera, NaN where unknown.

    Raises
    ------
    InputError
        When it cannot be told which belong together.
    """
    stamps, stamp_time = positions.stamps, positions.time
    if stamps is None or stamp_time is None:
        return positions
    photographs = _Photographs(names.astype(str), time)
    index, said = _matched(stamps, stamp_time, photographs, positions.path)
    said = [*said, *_about_missing(stamps, index, photographs.names)]
    there = np.flatnonzero(index >= 0)
    good = there[stamps.refused[index[there]] == ""]
    if not len(good):
        raise InputError(
            "gives no photograph a position", said[-1] if said else "check the time stamps", positions.path
        )
    rows = index[good]
    return replace(
        positions,
        images=photographs.names[good],
        xyz=positions.xyz[rows],
        sigma=positions.sigma[rows],
        yaw_pitch_roll=positions.yaw_pitch_roll[rows],
        time=stamp_time[rows] + _to_camera_clock(stamp_time, photographs, index),
        messages=(*positions.messages, *said),
        stamps=None,
    )


def _to_camera_clock(stamp_time: np.ndarray, photographs: _Photographs, index: np.ndarray) -> float:
    """What is added to GPS seconds: the camera's clock since the day of the first photograph, or the day of GPS."""
    known = np.flatnonzero((index >= 0) & np.isfinite(photographs.time))
    if not len(known):
        return -float(np.floor(stamp_time.min() / DAY_S)) * DAY_S
    day = float(np.floor(np.nanmin(photographs.time) / DAY_S)) * DAY_S
    return float(np.median(photographs.time[known] - stamp_time[index[known]])) - day


def _matched(
    stamps: Stamps, stamp_time: np.ndarray, photographs: _Photographs, path: Path
) -> tuple[np.ndarray, list[str]]:
    """(p,) the time stamp of every photograph, −1 for none, and what to say of it."""
    index = _by_number(stamps, photographs.names)
    found = int((index >= 0).sum())
    off = _disagreeing(stamp_time, photographs.time, index)
    are_numbers = found * 2 > len(index)
    if are_numbers and not len(off):
        return index, []
    by_time = _by_time(stamp_time, photographs.time)
    if by_time is not None and not (are_numbers and len(off) <= (by_time < 0).sum()):
        told = f"{stamps.files[0].name}: photographs were matched by their times, not by numbers in their names"
        return by_time, [assumed(told)]
    if are_numbers and len(off) <= FEW * found:
        index[off] = -1
        return index, _about_off(stamps, photographs.names[off])
    if are_numbers and found == len(index) == len(stamp_time):
        about = f"the times of {len(off)} photographs do not agree with the time stamps of their numbers"
        told = f"{stamps.files[0].name}: {about}, {_some(photographs.names[off])}; the numbers, all there, are believed"
        return index, [assumed(told)]
    if are_numbers:
        raise InputError(
            f"the times of {len(off)} of {found} photographs do not agree with the time stamps of their numbers: "
            f"{_some(photographs.names[off])}",
            f"is {stamps.files[0].name} of these photographs, under the names that the drone gave them?", path,
        )  # fmt: skip
    if len(stamp_time) == len(index):
        return _in_order(stamps, stamp_time, photographs, path)
    raise InputError(
        f"has {len(stamp_time)} time stamps for {len(index)} photographs, whose names have other numbers and whose "
        "times do not tell which is which",
        "give the photographs under the names of the drone, or with their EXIF times", stamps.files[0],
    )  # fmt: skip


def _by_number(stamps: Stamps, names: np.ndarray) -> np.ndarray:
    """(p,) the time stamp whose number stands in each name, at that place of names which fits best; −1 for none."""
    best = np.full(len(names), -1)
    for place in (-1, -2, -3):
        index = np.array([_of_number(stamps, str(name), place) for name in names], dtype=np.int64)
        again = _taken_twice(index, names, place)
        index[again] = -1
        if (index >= 0).sum() > (best >= 0).sum():
            best = index
    return best


def _of_number(stamps: Stamps, name: str, place: int) -> int:
    """The time stamp of a photograph by the number at a place in its name; −1 where there is none, or more than one."""
    digits = DIGITS.findall(stem(name))
    if len(digits) < -place or len(digits[place]) > 9:
        return -1
    same = np.flatnonzero(stamps.number == int(digits[place]))
    if len(same) > 1:
        near = [row for row in same.tolist() if _is_beside(stamps.files[stamps.file[row]], name)]
        return near[0] if len(near) == 1 else -1
    return int(same[0]) if len(same) else -1


def _is_beside(stamps: Path, name: str) -> bool:
    """Whether a file of time stamps is in the folder of a photograph, or begins with the same name."""
    folders = name.replace("\\", "/").split("/")[:-1]
    begin = re.sub(r"_?timestamp$", "", stamps.stem, flags=re.IGNORECASE)
    return stamps.parent.name in folders[-1:] or (bool(begin) and stem(name).startswith(begin))


def _taken_twice(index: np.ndarray, names: np.ndarray, place: int) -> np.ndarray:
    """Rows of photographs of the same time stamp whose names do not differ behind the number, as cameras of one do."""
    seen: dict[tuple[int, str], int] = {}
    twice = []
    for row in np.flatnonzero(index >= 0).tolist():
        behind = re.split(r"\d+", stem(str(names[row])))[place:]
        first = seen.setdefault((int(index[row]), "#".join(behind)), row)
        if first != row:
            twice += [first, row]
    return np.array(sorted(set(twice)), dtype=np.int64)


def _disagreeing(stamp_time: np.ndarray, time: np.ndarray, index: np.ndarray) -> np.ndarray:
    """Rows of photographs whose clock differs from that of their time stamps otherwise than most do."""
    known = np.flatnonzero((index >= 0) & np.isfinite(time))
    if len(known) < FEWEST_TIMES:
        return known[:0]
    clock = time[known] - stamp_time[index[known]]
    return known[np.abs(clock - np.median(clock)) > TIMES_AGREE_S]


def _by_time(stamp_time: np.ndarray, time: np.ndarray) -> np.ndarray | None:
    """(p,) the time stamps nearest to the photographs, by the difference of the clocks with which most have one.

    None where a time is missing, or another difference does as well.
    """
    if len(time) < FEWEST_TIMES or not np.isfinite(time).all():
        return None
    sorted_time, order = np.sort(stamp_time), np.argsort(stamp_time)
    pivots = np.sort(time)[[0, len(time) // 2, len(time) - 1]]
    clocks = np.unique(np.round(2.0 * (pivots[:, None] - sorted_time).ravel())) / 2.0
    scores = []
    for clock in clocks.tolist():
        near = _nearest(sorted_time, time - clock)
        left = time - clock - sorted_time[near]
        left = left - np.median(left)
        fits = np.abs(left) <= CUT_OFF_S
        scores.append((int(fits.sum()), -float(np.std(left[fits])) if fits.any() else 0.0, clock))
    count, spread, clock = max(scores)
    others = [s for s in scores if abs(s[2] - clock) > 2.0 * CUT_OFF_S and s[0] == count and s[1] > 2.0 * spread - 0.1]
    near = _nearest(sorted_time, time - clock)
    left = time - clock - sorted_time[near]
    fits = np.abs(left - np.median(left)) <= CUT_OFF_S
    if others or 2 * count < len(time) or len(np.unique(near[fits])) < count:
        return None
    return np.where(fits, order[near], -1)


def _nearest(values: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """(n,) index of the nearest of sorted values (k,)."""
    behind = np.clip(np.searchsorted(values, wanted), 1, max(len(values) - 1, 1))
    behind = np.minimum(behind, len(values) - 1)
    ahead = np.maximum(behind - 1, 0)
    return np.where(np.abs(wanted - values[ahead]) <= np.abs(values[behind] - wanted), ahead, behind)


def _in_order(
    stamps: Stamps, stamp_time: np.ndarray, photographs: _Photographs, path: Path
) -> tuple[np.ndarray, list[str]]:
    """One time stamp for each photograph, both in their order.

    Raises
    ------
    InputError
        When times say otherwise.
    """
    rows = sorted(range(len(photographs.names)), key=lambda k: natural_key(str(photographs.names[k])))
    index = np.empty(len(rows), dtype=np.int64)
    index[rows] = np.argsort(stamp_time, kind="stable")
    off = _disagreeing(stamp_time, photographs.time, index)
    if len(off):
        message = "photographs in the order of their names do not have the times of the stamps"
        raise InputError(message, "give the photographs under the names that the drone gave them", path)
    said = assumed(f"{stamps.files[0].name}: one time stamp for each photograph, taken in the order of their names")
    return index, [said]


def _about_off(stamps: Stamps, names: np.ndarray) -> list[str]:
    if not len(names):
        return []
    about = f"the time of {counted(len(names), 'photograph')} is not that of the time stamp of its number"
    return [left_behind(f"{stamps.files[0].name}: {about}, so it gets no position: {_some(names)}")]


def _about_missing(stamps: Stamps, index: np.ndarray, names: np.ndarray) -> list[str]:
    """What to say of photographs without time stamps or positions, and of time stamps without photographs."""
    file, said = stamps.files[0].name if len(stamps.files) == 1 else f"{len(stamps.files)} files of time stamps", []
    without = names[index < 0]
    if len(without):
        have = counted(len(without), "photograph has", "photographs have")
        said.append(left_behind(f"{file}: {have} no time stamp: {_some(without)}"))
    unused = np.setdiff1d(np.arange(len(stamps.number)), index).tolist()
    if unused:
        numbers = stamps.number.tolist()
        which = [f"number {numbers[k]}" if numbers[k] >= 0 else f"the {k + 1}. of the file" for k in unused]
        have = counted(len(unused), "time stamp has", "time stamps have")
        said.append(left_behind(f"{file}: {have} no photograph: {_some(which)}"))
    refused = [row for row in np.flatnonzero(index >= 0).tolist() if stamps.refused[index[row]]]
    if refused:
        which = [f"{names[row]} ({stamps.refused[index[row]]})" for row in refused]
        get = counted(len(refused), "photograph gets", "photographs get")
        said.append(left_behind(f"{get} no position: {_some(which)}"))
    return said


def _some(names: Sequence[str] | np.ndarray) -> str:
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(str(name) for name in names[:SHOWN]) + more
