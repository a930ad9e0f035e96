"""Solutions of RTKLIB and of programs that write as it does, such as Emlid Studio (.pos).

Lines that begin with % are comments; one of them names the columns and begins with the time system. Time is a calendar
date or week and seconds; places are latitude and longitude in degrees or in degrees, minutes and seconds, earth-centred
X, Y, Z, or a baseline east, north, up from the base. sdn, sde, sdu are σ; of the covariances, sdne …, RTKLIB writes the
root with their sign.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.coordinates.ellipsoid import east_north_up, from_geocentric, to_geocentric
from aerotri.formats.assembly.timed import DIFFERENTIAL, FIXED, FLOAT, NONE, PPP, SINGLE, Trajectory
from aerotri.formats.foreign.gnss_time import JST_AHEAD_S, WEEK_S, calendar_seconds, gps_of_utc
from aerotri.formats.text.notes import left_behind
from aerotri.formats.text.text_lines import TextFile, first_lines, is_number

COLUMNS = re.compile(r"%\s*(GPST|UTC|JST)\b(.*)")
QUALITY = {0: NONE, 1: FIXED, 2: FLOAT, 3: DIFFERENTIAL, 4: DIFFERENTIAL, 5: SINGLE, 6: PPP}
"""[L: RTKLIB manual 2.4.2, appendix B.1]: fix, float, SBAS, DGPS, single, PPP."""
GEOGRAPHIC, GEOCENTRIC, BASELINE = "latitude", "x-ecef", "e-baseline"
ANGLES = ("latitude", "longitude")
AXES = {
    GEOGRAPHIC: ("latitude", "longitude", "height"), GEOCENTRIC: ("x-ecef", "y-ecef", "z-ecef"),
    BASELINE: ("e-baseline", "n-baseline", "u-baseline"),
}  # fmt: skip
SIGMAS = {
    GEOGRAPHIC: ("sde", "sdn", "sdu", "sdne", "sdun", "sdeu"),
    GEOCENTRIC: ("sdx", "sdy", "sdz", "sdxy", "sdyz", "sdzx"),
    BASELINE: ("sde", "sdn", "sdu", "sden", "sdnu", "sdue"),
}  # fmt: skip
"""σ of the first, second and third axis, and roots of the covariances of first and second, second and third, third and
first; the axes of latitude, longitude and height are east, north, up."""
REMEDY = "let the program write the header too, and the file to its end"


@dataclass(frozen=True)
class _Columns:
    """What the header says: the clock, the form of places, how many words a column has, and their names."""

    clock: str
    form: str
    in_minutes: bool
    names: tuple[str, ...]

    def first_word(self, name: str) -> int:
        """The word of a row, the time being its first two, with which a column begins."""
        before = self.names[: self.names.index(name)]
        return 2 + len(before) + (2 * sum(n in ANGLES for n in before) if self.in_minutes else 0)

    @property
    def used_words(self) -> int:
        """Words that a row has at least: up to the last column that is read."""
        used = [name for name in (*AXES[self.form], "q", *SIGMAS[self.form]) if name in self.names]
        return max(self.first_word(name) + (3 if self.in_minutes and name in ANGLES else 1) for name in used)


def is_rtklib(path: Path) -> bool:
    """Whether a comment names the columns of RTKLIB."""
    return any(_columns(line) is not None for line in first_lines(path, 200, comments=False) if line[0] == "%")


def _columns(line: str) -> _Columns | None:
    found = COLUMNS.match(line)
    if found is None:
        return None
    words = re.split(r"[\s,;]+", found[2].strip(" ,;"))
    names = tuple(word.partition("(")[0].lower() for word in words)
    form = next((form for form, axes in AXES.items() if set(axes) <= set(names)), None)
    return None if form is None else _Columns(found[1], form, "latitude(d'\")" in words, names)


def read_rtklib(path: FilePath) -> Trajectory:
    """The solution of a file; epochs without one are left out.

    Raises
    ------
    InputError
        With the line: a row that is cut off, a time or a place that is none, a baseline whose base is not named.
    """
    file = TextFile(Path(path), any_letters=True)
    columns, rows, words = _body(file)
    time = _times(file, columns, [line[:2] for line in words], rows)
    place, axes, heights = _places(file, columns, words, rows)
    sigma = _sigmas(file, columns, words, rows, axes)
    quality = _quality(file, columns, words, rows)
    solved = np.flatnonzero(quality != NONE)
    without = left_behind(f"{file.path.name}: {len(rows) - len(solved)} epochs without solution")
    said = () if len(solved) == len(rows) else (without,)
    found = Trajectory(
        file.path, time, place, sigma, quality, heights, messages=(*file.notes, *said)
    ).at(solved[np.argsort(time[solved], kind="stable")])  # fmt: skip
    again = np.flatnonzero(np.diff(found.time) <= 0.0)
    if len(again):
        twice = int(np.flatnonzero(time == found.time[again[0]])[-1])
        raise file.error(rows[twice], "the time is there twice", "give one solution: forward, backward or combined")
    return found


def _body(file: TextFile) -> tuple[_Columns, list[int], list[list[str]]]:
    """The columns, and the rows of epochs with their words.

    Raises
    ------
    InputError
        When there are none, or one is cut off.
    """
    headed = [(row, found) for row, line in enumerate(file.lines) if (found := _columns(line)) is not None]
    if not headed:
        raise file.error(0, "does not name its columns", REMEDY)
    columns = headed[0][1]
    other = next((row for row, found in headed if found != columns), None)
    if other is not None:
        raise file.error(other, "names other columns than above", "give a file for each solution")
    rows = [row for row, line in enumerate(file.lines) if line[0] not in "%#"]
    if not rows:
        raise file.error(len(file), "holds no epochs", REMEDY)
    words = [re.split(r"[\s,;]+", file.lines[row]) for row in rows]
    for row, line in zip(rows, words, strict=True):
        if len(line) < columns.used_words:
            raise file.error(row, f"the row has {len(line)} entries", f"{len(columns.names) + 2} are named; {REMEDY}")
    return columns, rows, words


def _values(
    file: TextFile, columns: _Columns, words: Sequence[list[str]], rows: list[int], names: Sequence[str]
) -> np.ndarray:
    """(n, k) numbers of columns that are one word each."""
    places = [columns.first_word(name) for name in names]
    return file.table([[line[place] for place in places] for line in words], rows, "value")


def _times(file: TextFile, columns: _Columns, words: Sequence[list[str]], rows: list[int]) -> np.ndarray:
    """(n,) GPS seconds."""
    if "/" not in words[0][0]:
        week, seconds = file.table(words, rows, "week or time").T
        found = week * WEEK_S + seconds
    else:
        found = np.array([_of_date(file, row, *line) for row, line in zip(rows, words, strict=True)])
    if columns.clock == "GPST":
        return found
    return gps_of_utc(found - (JST_AHEAD_S if columns.clock == "JST" else 0.0))


def _of_date(file: TextFile, row: int, day: str, time: str) -> float:
    date, clock = day.split("/"), time.split(":")
    try:
        if len(date) != 3 or len(clock) != 3 or not is_number(clock[2]):
            raise ValueError
        return calendar_seconds(*(int(word) for word in (*date, *clock[:2])), second=float(clock[2]))
    except (ValueError, OverflowError):
        raise file.error(row, f"'{day[:20]} {time[:20]}' is no time", "times are 2024/05/18 09:30:00.200") from None


def _places(
    file: TextFile, columns: _Columns, words: Sequence[list[str]], rows: list[int]
) -> tuple[np.ndarray, np.ndarray | None, str]:
    """(n, 3) longitude, latitude, height; (n, 3, 3) east, north, up by the axes of σ, None where they are these."""
    if columns.form == GEOGRAPHIC:
        comments = " ".join(line for line in file.lines if line[0] == "%")
        heights = "sea level" if "wgs84/geodetic" in comments.lower().replace(" ", "") else "ellipsoidal"
        return _geographic(file, columns, words, rows), None, heights
    if columns.form == GEOCENTRIC:
        place = from_geocentric(_values(file, columns, words, rows, AXES[GEOCENTRIC]))
        return place, east_north_up(place), "ellipsoidal"
    base = _base(file)
    axes = east_north_up(base)[0]
    baseline = _values(file, columns, words, rows, AXES[BASELINE])
    place = from_geocentric(to_geocentric(base) + baseline @ axes)
    return place, np.einsum("nij,kj->nik", east_north_up(place), axes), "ellipsoidal"


def _geographic(file: TextFile, columns: _Columns, words: Sequence[list[str]], rows: list[int]) -> np.ndarray:
    height = _values(file, columns, words, rows, ("height",))
    degrees = []
    for name in ("longitude", "latitude"):
        first = columns.first_word(name)
        if columns.in_minutes:
            signed = file.table([line[first : first + 3] for line in words], rows, name)
            size = np.abs(signed) @ np.array([1.0, 1.0 / 60.0, 1.0 / 3600.0])
            negative = np.array([line[first].startswith("-") for line in words])
            degrees.append(np.where(negative, -size, size))
        else:
            degrees.append(file.values([line[first] for line in words], rows, name))
    lon, lat = degrees
    odd = np.flatnonzero((np.abs(lon) > 360.0) | (np.abs(lat) > 90.0))
    if len(odd):
        raise file.error(rows[odd[0]], "the latitude or longitude is none", "check the columns")
    return np.column_stack([lon - 360.0 * (lon > 180.0), lat, height])


def _base(file: TextFile) -> np.ndarray:
    """(1, 3) longitude, latitude, height of the base that the header names.

    Raises
    ------
    InputError
    """
    line = next((line for line in file.lines if re.match(r"%\s*ref pos", line)), "")
    words = line.partition(":")[2].split()
    if len(words) not in (3, 7) or not all(map(is_number, words)):
        remedy = "write latitude, longitude and height, or keep the comment '% ref pos : …' with the base"
        raise InputError("has baselines, and does not say where the base is", remedy, file.path)
    values = [float(word) for word in words]
    if len(words) == 7:
        size = np.abs(np.reshape(values[:6], (2, 3))) @ np.array([1.0, 1.0 / 60.0, 1.0 / 3600.0])
        lat, lon = (-s if words[3 * k].startswith("-") else s for k, s in enumerate(size))
        return np.array([[lon, lat, values[6]]])
    if abs(values[0]) > 90.0:
        return from_geocentric(np.array([values]))
    return np.array([[values[1], values[0], values[2]]])


def _sigmas(
    file: TextFile, columns: _Columns, words: Sequence[list[str]], rows: list[int], axes: np.ndarray | None
) -> np.ndarray:
    """(n, 3) σ east, north, up; NaN where the file has none, or 0."""
    names = SIGMAS[columns.form]
    if not set(names[:3]) <= set(columns.names):
        return np.full((len(rows), 3), np.nan)
    sigma = _values(file, columns, words, rows, names[:3])
    if axes is not None and set(names) <= set(columns.names):
        root = _values(file, columns, words, rows, names[3:])
        covariance = np.empty((len(rows), 3, 3))
        covariance[:, range(3), range(3)] = sigma**2
        for k, (i, j) in enumerate(((0, 1), (1, 2), (2, 0))):
            covariance[:, i, j] = covariance[:, j, i] = np.sign(root[:, k]) * root[:, k] ** 2
        sigma = np.sqrt(np.maximum(np.einsum("nij,njk,nik->ni", axes, covariance, axes), 0.0))
    elif axes is not None:
        sigma = np.sqrt(np.einsum("nij,nj->ni", axes**2, sigma**2))
    return np.where(sigma > 0.0, sigma, np.nan)


def _quality(file: TextFile, columns: _Columns, words: Sequence[list[str]], rows: list[int]) -> np.ndarray:
    if "q" not in columns.names:
        return np.full(len(rows), "", dtype="<U12")
    codes = _values(file, columns, words, rows, ("q",))[:, 0]
    return np.array([QUALITY.get(int(code), "") for code in codes], dtype="<U12")
