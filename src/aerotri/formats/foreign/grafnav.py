"""Trajectories of NovAtel's GrafNav and Inertial Explorer: a text of aligned columns whose names stand above them.

Two lines name the columns and, below, their units in brackets: UTC or GPS times as seconds (of the week), weeks, date
and time of day; latitude and longitude in degrees, or in degrees, minutes and seconds; the height and σ, in metres or
feet; a quality from 1 (best) to 6. What is used of the times are GPS seconds where the file has them, else UTC with the
leap seconds.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.formats.assembly.timed import DIFFERENTIAL, FIXED, FLOAT, SINGLE, Trajectory
from aerotri.formats.foreign.gnss_time import WEEK_S, calendar_seconds, in_week_of, leap_seconds
from aerotri.formats.text.csv_text import read_bytes
from aerotri.formats.text.encodings import decoded
from aerotri.formats.text.notes import left_behind, taken
from aerotri.formats.text.text_lines import TextFile, first_lines, is_number

QUALITY = {1: FIXED, 2: FLOAT, 3: FLOAT, 4: DIFFERENTIAL, 5: DIFFERENTIAL, 6: SINGLE}
"""[L: GrafNav User Guide, quality number]: 1 fixed integer, 2 converged float or noisy fixed integer, 3 converging
float, 4 and 5 DGPS, 6 single point."""
HEAD = 200
"""Lines among which the names of the columns stand at most [C]."""
HEIGHTS = ("h-ell", "ellheight", "h-msl", "orthoheight")
TIMES = ("gpstime", "utctime", "localtime", "gpsseconds", "utcseconds")
OF_DAY = ("hms", "h:m:s", "hh:mm:ss")
OF_WEEK = ("sec", "s", "secs", "seconds", "sow")
"""Units of times."""
METRES = {"": 1.0} | {
    name: factor
    for factor, names in (
        (1.0, ("m", "metre", "metres", "meter", "meters")),
        (0.3048, ("ft", "feet", "ift")),
        (1200.0 / 3937.0, ("usft", "ftus", "us-ft", "us ft", "sft")),
    )
    for name in names
}
"""Metres by the unit of a height or σ; without one they count in metres."""
HEIGHT_SIGMAS = ("sdheight", "sdheigh")
"""σ of the height, whose name GrafNav cuts off where its column is narrow."""
ATTITUDE = ("roll", "pitch", "heading")
DATUM = re.compile(r"datum\s*:\s*([^,]+)", re.IGNORECASE)
"""Of ``Datum: ETRS89, (processing datum)`` the part before the comma."""
OFFSET = re.compile(r"utc\s+offset\s*:\s*(-?\d+(?:\.\d+)?)", re.IGNORECASE)


@dataclass(frozen=True)
class _Column:
    """A column: name and unit in small letters, its first word in a row, how many words it has."""

    name: str
    unit: str
    word: int
    words: int


def is_grafnav(path: Path) -> bool:
    """Whether a line names latitude, longitude, a height and a time of GPS or UTC."""
    return any(_is_header(line) for line in first_lines(path, HEAD, comments=False))


def _is_header(line: str) -> bool:
    names = {word.lower() for word in re.split(r"[\s,;]+", line)}
    return {"latitude", "longitude"} <= names and bool(names & set(HEIGHTS)) and bool(names & set(TIMES))


def read_grafnav(path: FilePath) -> Trajectory:
    """The trajectory of a file.

    Raises
    ------
    InputError
        With the line: a row that is cut off, a time that is none or is missing, a place that is none.
    """
    file = TextFile(Path(path), comments=False, any_letters=True)
    head = next((row for row, line in enumerate(file.lines) if _is_header(line)), None)
    if head is None:
        raise file.error(0, "does not name its columns", "export latitude, longitude, height and GPS time with names")
    reader = _body(file, head)
    time, week_known = _times(reader, file, head)
    back = np.flatnonzero(np.diff(time) <= 0.0)
    if len(back):
        raise file.error(
            reader.rows[int(back[0]) + 1], "time does not go on", "export the epochs in their order, each once"
        )
    height = next(name for name in HEIGHTS if reader.has(name))
    datum = next((match[1].strip() for line in file.lines[:head] if (match := DATUM.match(line))), "WGS 84")
    codes = reader.numbers("q") if reader.has("q") else np.full(len(time), np.nan)
    return Trajectory(
        path=file.path,
        time=time,
        place=_places(reader, height),
        sigma=_sigmas(reader),
        quality=np.array([QUALITY.get(int(code), "") if np.isfinite(code) else "" for code in codes], dtype="<U12"),
        heights="ellipsoidal" if height in HEIGHTS[:2] else "sea level",
        datum=datum,
        week_known=week_known,
        messages=(*file.notes, *_about(reader, height)),
    )


def _about(reader: _Rows, height: str) -> tuple[str, ...]:
    """On units and on columns that are not used."""
    said: list[str] = []
    column = reader.column(height)
    if column is not None and METRES.get(column.unit) != 1.0:
        said.append(taken(f"{reader.file.path.name}: heights in {column.unit}, brought to metres"))
    used = {*_sigma_columns(reader), *(("sdhoriz",) if reader.has("sdeast") and reader.has("sdnorth") else ())}
    unused = [column.name for column in reader.columns if column.name.startswith("sd") and column.name not in used]
    if unused:
        said.append(left_behind(f"{reader.file.path.name}: not used: {', '.join(unused)[:120]}"))
    angles = [column.name for column in reader.columns if column.name in ATTITUDE]
    if angles:
        words = "positions may be those of the IMU instead of the antenna: check which were exported"
        said.append(left_behind(f"{reader.file.path.name}: not used: {', '.join(angles)}; {words}"))
    return tuple(said)


def _split(line: str) -> list[str]:
    return line.split() if "," not in line else [word.strip() for word in line.split(",")]


def _columns(file: TextFile, head: int) -> list[_Column]:
    """The columns, with the units that stand below the ends of their names."""
    separated = "," in file.lines[head]
    if separated:
        names = [word.lower() for word in _split(file.lines[head])]
        below = _split(file.lines[head + 1]) if head + 1 < len(file) else []
        units = [word.strip("()").lower() for word in below] if len(below) == len(names) and "(" in below[0] else []
        units = units or [""] * len(names)
    else:
        names, units = _aligned(*_raw_lines(file, file.numbers[head], 2))
    found, word = [], 0
    for name, unit in zip(names, units, strict=True):
        in_minutes = name in ("latitude", "longitude") and unit not in ("", "deg", "degrees", "decimal degrees")
        words = 3 if in_minutes and not separated else 1
        found.append(_Column(name, unit, word, words))
        word += words
    return found


def _raw_lines(file: TextFile, number: int, count: int) -> list[str]:
    """Lines of the file from a number as they stand there: columns are aligned."""
    lines = decoded(read_bytes(file.path), file.path, any_letters=True).text.split("\n")
    found = [line.expandtabs() for line in lines[number - 1 : number - 1 + count]]
    return [*found, *[""] * (count - len(found))]


def _aligned(head: str, below: str) -> tuple[list[str], list[str]]:
    """Names of the columns and the unit of each, '' where there is none: both end at the same place, or nearly."""
    names = [(match.group().lower(), match.start(), match.end()) for match in re.finditer(r"\S+", head)]
    units = [""] * len(names)
    for match in re.finditer(r"\(([^)]*)\)", below):
        overlap = [min(match.end(), end) - max(match.start(), start) for _, start, end in names]
        nearest = max(range(len(names)), key=lambda k: (overlap[k], -abs(match.end() - names[k][2])))
        units[nearest] = match[1].strip().lower()
    return [name for name, _, _ in names], units


@dataclass(frozen=True, eq=False)
class _Rows:
    """The rows of a file by the names of their columns."""

    file: TextFile
    columns: Sequence[_Column]
    words: Sequence[list[str]]
    rows: list[int]

    def column(self, name: str, *units: str) -> _Column | None:
        """The column of a name and one of some units; of any unit where none is given."""
        return next((c for c in self.columns if c.name == name and (not units or c.unit in units)), None)

    def has(self, name: str) -> bool:
        return self.column(name) is not None

    def texts(self, column: _Column) -> list[str]:
        return [line[column.word] for line in self.words]

    def numbers(self, name: str, *units: str) -> np.ndarray:
        """(n,) of a column that is there."""
        column = self.column(name, *units)
        assert column is not None
        return self.file.values(self.texts(column), self.rows, name)

    def metres(self, name: str) -> np.ndarray:
        """(n,) m of a column of lengths that is there.

        Raises
        ------
        InputError
            When its unit is not known.
        """
        column = self.column(name)
        assert column is not None
        if column.unit not in METRES:
            message = f"the column {name} counts in '{column.unit[:20]}', which is no unit of lengths that is known"
            raise InputError(message, "export heights and standard deviations in metres", self.file.path)
        return self.numbers(name) * METRES[column.unit]

    def degrees(self, name: str) -> np.ndarray:
        column = self.column(name)
        assert column is not None
        if column.words == 1 and column.unit in ("", "deg", "degrees", "decimal degrees"):
            return self.file.values(self.texts(column), self.rows, name)
        parts = [" ".join(line[column.word : column.word + column.words]).split() for line in self.words]
        short = next((k for k, part in enumerate(parts) if len(part) != 3), None)
        if short is not None:
            raise self.file.error(self.rows[short], f"the {name} is not in degrees, minutes, seconds", "export degrees")
        size = np.abs(self.file.table(parts, self.rows, name)) @ np.array([1.0, 1.0 / 60.0, 1.0 / 3600.0])
        return np.where([part[0].startswith("-") for part in parts], -size, size)


def _body(file: TextFile, head: int) -> _Rows:
    """The rows below the names of the columns.

    Raises
    ------
    InputError
        When there are none, or one is cut off.
    """
    columns = _columns(file, head)
    width = columns[-1].word + columns[-1].words
    rows = [row for row in range(head + 1, len(file)) if not file.lines[row].lstrip(" ,;").startswith("(")]
    words = [_split(file.lines[row]) for row in rows]
    if not rows:
        raise file.error(len(file), "holds no epochs", "export the file anew")
    for row, line in zip(rows, words, strict=True):
        if len(line) != width:
            raise file.error(row, f"the row has {len(line)} entries, {width} are named", "is the file cut off?")
    return _Rows(file, columns, words, rows)


def _places(reader: _Rows, height: str) -> np.ndarray:
    """(n, 3) longitude, latitude, and the height of a column."""
    place = np.column_stack([reader.degrees("longitude"), reader.degrees("latitude"), reader.metres(height)])
    odd = np.flatnonzero((np.abs(place[:, 0]) > 360.0) | (np.abs(place[:, 1]) > 90.0))
    if len(odd):
        raise reader.file.error(reader.rows[odd[0]], "the latitude or longitude is none", "check the columns")
    place[:, 0] -= 360.0 * (place[:, 0] > 180.0)
    return place


def _times(reader: _Rows, file: TextFile, head: int) -> tuple[np.ndarray, bool]:
    """(n,) GPS seconds, and whether their week is known."""
    stated = next((float(match[1]) for line in file.lines[:head] if (match := OFFSET.match(line))), None)
    day = _days(reader)
    for clock, name in (("gps", "gpstime"), ("gps", "gpsseconds"), ("utc", "utctime"), ("utc", "utcseconds")):
        if reader.column(name, *OF_WEEK) is not None:
            found = reader.numbers(name, *OF_WEEK)
            near = day if day is not None else _weeks(reader)
            found, known = (found, False) if near is None else (in_week_of(found, near), True)
        elif day is not None and (column := reader.column(name, *OF_DAY)) is not None:
            seconds = np.array([_of_day(file, *pair) for pair in zip(reader.rows, reader.texts(column), strict=True)])
            # the date may be that of the other clock
            found, known = seconds + 86400.0 * np.round((day - seconds) / 86400.0), True
        else:
            continue
        if clock == "gps":
            return found, known
        if not known and stated is None:
            break
        ahead = leap_seconds(found) if known else np.full(len(found), stated)
        if stated is not None and (ahead != stated).any():
            message = f"states that GPS is {stated:g} s ahead of UTC; at its time it is {ahead[0]:g} s"
            raise InputError(message, "export GPS time", file.path)
        return found + ahead, known
    raise file.error(
        head, "has no time that can be used", "export GPSTime in seconds of the week, and the date or week"
    )


def _days(reader: _Rows) -> np.ndarray | None:
    """(n,) s of the time of day by whatever date and time of day there are, within a day; None without a date."""
    column = next((c for c in reader.columns if c.name.endswith("date")), None)
    if column is None:
        return None
    order = {"mdy": (2, 0, 1), "m/d/y": (2, 0, 1), "dmy": (2, 1, 0), "d/m/y": (2, 1, 0)}.get(column.unit, (0, 1, 2))
    clock = next((c for c in reader.columns if c.name.endswith("time") and c.unit in OF_DAY), None)
    texts = reader.texts(column)
    days = {
        text: _of_date(reader.file, row, text, order)
        for text, row in dict(zip(texts, reader.rows, strict=True)).items()
    }
    found = np.array([days[text] for text in texts])
    if clock is None:
        return found + 43200.0
    pairs = zip(reader.rows, reader.texts(clock), strict=True)
    return found + np.array([_of_day(reader.file, row, text) for row, text in pairs])


def _weeks(reader: _Rows) -> np.ndarray | None:
    """(n,) s of the middle of the week that a column names."""
    column = next((c for c in reader.columns if c.unit in ("weeks", "week") or c.name in ("week", "gpsweek")), None)
    if column is None:
        return None
    return (np.floor(reader.file.values(reader.texts(column), reader.rows, "week")) + 0.5) * WEEK_S


def _of_date(file: TextFile, row: int, text: str, order: tuple[int, int, int]) -> float:
    words = re.split(r"[/.\-]", text)
    try:
        return calendar_seconds(*(int(words[k]) for k in order))
    except (ValueError, IndexError, OverflowError):
        raise file.error(row, f"'{text[:40]}' is no date", "export the date as year/month/day") from None


def _of_day(file: TextFile, row: int, text: str) -> float:
    words = text.split(":")
    if len(words) != 3 or not all(map(is_number, words)):
        raise file.error(row, f"'{text[:40]}' is no time of day", "export times as hours:minutes:seconds")
    hour, minute, second = map(float, words)
    return 3600.0 * hour + 60.0 * minute + second


def _sigma_columns(reader: _Rows) -> tuple[str, str, str]:
    """Names of the columns of σ east, north, up; '' where there is none."""
    height = next((name for name in HEIGHT_SIGMAS if reader.has(name)), "")
    if reader.has("sdeast") and reader.has("sdnorth"):
        return "sdeast", "sdnorth", height
    return ("sdhoriz", "sdhoriz", height) if reader.has("sdhoriz") else ("", "", height)


def _sigmas(reader: _Rows) -> np.ndarray:
    """(n, 3) m σ east, north, up; that of the plan is taken as √2 times that of a coordinate."""
    found = np.full((len(reader.rows), 3), np.nan)
    for k, name in enumerate(_sigma_columns(reader)):
        if name:
            found[:, k] = reader.metres(name) / (np.sqrt(2.0) if name == "sdhoriz" else 1.0)
    return np.where(found > 0.0, found, np.nan)
