"""Times of GNSS: weeks and seconds, calendar dates, and the leap seconds between GPS and UTC."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np

WEEK_S = 604800.0
GPS_BEGAN = datetime(1980, 1, 6, tzinfo=UTC)
LEAP_DATES = (
    "1981-07-01", "1982-07-01", "1983-07-01", "1985-07-01", "1988-01-01", "1990-01-01", "1991-01-01", "1992-07-01",
    "1993-07-01", "1994-07-01", "1996-01-01", "1997-07-01", "1999-01-01", "2006-01-01", "2009-01-01", "2012-07-01",
    "2015-07-01", "2017-01-01",
)  # fmt: skip
"""Days of UTC from which GPS is one second more ahead [L: IERS Bulletin C; none since 2017 up to Bulletin C 70]."""
LEAPS = np.array([(datetime.fromisoformat(day).replace(tzinfo=UTC) - GPS_BEGAN).total_seconds() for day in LEAP_DATES])
JST_AHEAD_S = 9.0 * 3600.0
"""Japan's time, which RTKLIB may write, less UTC."""


def calendar_seconds(year: int, month: int, day: int, hour: int = 0, minute: int = 0, second: float = 0.0) -> float:
    """s since the beginning of GPS by a calendar, leap seconds not counted.

    Raises
    ------
    ValueError
        When there is no such day or time; 60 s and 24 h are there, as rounding writes them.
    """
    if not (0 <= hour <= 24 and 0 <= minute <= 60 and 0.0 <= second <= 60.0):
        raise ValueError("no time of day")
    begun = datetime(year, month, day, tzinfo=UTC) - GPS_BEGAN
    return begun.total_seconds() + 3600.0 * hour + 60.0 * minute + second


def leap_seconds(utc: np.ndarray) -> np.ndarray:
    """(n,) s by which GPS is ahead at UTC seconds (n,) as in `calendar_seconds`."""
    return np.searchsorted(LEAPS, utc, side="right").astype(float)


def gps_of_utc(utc: np.ndarray) -> np.ndarray:
    """(n,) GPS seconds of UTC seconds."""
    return utc + leap_seconds(utc)


def in_week_of(seconds: np.ndarray, near: np.ndarray | float) -> np.ndarray:
    """(n,) GPS seconds of seconds of the week (n,), in the week in which they lie nearest to a time."""
    return seconds + WEEK_S * np.round((near - seconds) / WEEK_S)


def time_in_words(gps: float) -> str:
    """'2022-11-06 05:54:22 (week 2235, 21262.2 s)', by the GPS clock."""
    week, seconds = divmod(gps, WEEK_S)
    day = datetime.fromtimestamp(GPS_BEGAN.timestamp() + gps, UTC)
    return f"{day:%Y-%m-%d %H:%M:%S} GPS (week {week:.0f}, {seconds:.1f} s)"
