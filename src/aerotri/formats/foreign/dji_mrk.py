"""Time stamps of DJI's drones with RTK (.MRK): when each photograph was taken, and where antenna and camera were then.

A line: number of the photograph, GPS seconds of the week, [week], offsets from the antenna to the camera north, east
and down (``N``, ``E``, ``V``, mm; they turn with the drone, so no attitude is needed), latitude, longitude and
ellipsoidal height of the antenna by the drone's own solution, its σ north, east, up (m), and its quality, as NovAtel
counts them.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from aerotri.conventions import FilePath
from aerotri.formats.assembly.timed import DIFFERENTIAL, FIXED, FLOAT, NONE, PPP, SINGLE, TimeStamps
from aerotri.formats.foreign.gnss_time import WEEK_S
from aerotri.formats.text.text_lines import TextFile, first_lines

NUMBER = r"([+-]?\d+(?:\.\d*)?)"
LINE = re.compile(
    rf"(\d{{1,9}})\s+{NUMBER}\s+\[\s*(\d{{1,6}})\s*\]\s+{NUMBER}\s*,\s*N\s+{NUMBER}\s*,\s*E\s+{NUMBER}\s*,\s*V\s+"
    rf"{NUMBER}\s*,\s*Lat\s+{NUMBER}\s*,\s*Lon\s+{NUMBER}\s*,\s*Ellh\s+{NUMBER}\s*,\s*{NUMBER}\s*,\s*{NUMBER}\s+"
    r"(\d{1,3})\s*,\s*Q",
    re.IGNORECASE,
)
REMEDY = "a line has number, seconds, [week], …,N …,E …,V …,Lat …,Lon …,Ellh σ, σ, σ …,Q; is the file cut off?"
QUALITY = {
    **dict.fromkeys(range(48, 52), FIXED), **dict.fromkeys(range(32, 35), FLOAT),
    **dict.fromkeys((17, 18, 20), DIFFERENTIAL), **dict.fromkeys((68, 69, 74, 77, 78), PPP), 16: SINGLE, 0: NONE,
}  # fmt: skip
"""Kinds of position of NovAtel's receivers [L: OEM7 Commands and Logs Reference, BESTPOS], which DJI takes over."""
MRK = ".mrk"


def is_dji_mrk(path: Path) -> bool:
    """Whether the lines are time stamps of a DJI drone."""
    lines = first_lines(path, 3)
    return bool(lines) and LINE.match(lines[0]) is not None


def read_dji_mrk(path: FilePath) -> TimeStamps:
    """The time stamps of a file.

    Raises
    ------
    InputError
        With the line: one of another form, a place that is none, a number there twice, time that goes back.
    """
    file = TextFile(Path(path), any_letters=True)
    rows = list(range(len(file)))
    if not rows:
        raise file.error(0, "holds no time stamps", REMEDY)
    found = [LINE.fullmatch(line) for line in file.lines]
    for row, match in enumerate(found):
        if match is None:
            raise file.error(row, "is no time stamp", REMEDY)
    words = [[word for word in match.groups()] for match in found if match is not None]
    values = file.table(words, rows, "value")
    file.refuse_repeated([str(int(number)) for number in values[:, 0]], rows, "the number")
    time = values[:, 2] * WEEK_S + values[:, 1]
    back = np.flatnonzero((np.diff(time) <= 0.0) | ~(values[1:, 1] < WEEK_S))
    if len(back):
        raise file.error(int(back[0]) + 1, "was taken before the line above", "keep the lines of one flight, in order")
    place, sigma = values[:, [7, 6, 8]], values[:, [10, 9, 11]]
    odd = np.flatnonzero((np.abs(place[:, 0]) > 180.0) | (np.abs(place[:, 1]) > 90.0))
    if len(odd):
        raise file.error(int(odd[0]), "has no latitude and longitude", REMEDY)
    quality = np.array([QUALITY.get(int(code), "") for code in values[:, 12]])
    quality[(values[:, 6:8] == 0.0).all(axis=1)] = NONE
    return TimeStamps(
        path=file.path,
        number=values[:, 0].astype(np.int64),
        time=time,
        offset=values[:, [4, 3, 5]] * np.array([1e-3, 1e-3, -1e-3]),
        place=np.where((quality == NONE)[:, None], np.nan, place),
        sigma=np.where(sigma > 0.0, sigma, np.nan),
        quality=quality,
        messages=file.notes,
    )
