"""Volumes from cross sections: areas by exact line integration of the bilinear surface, then a rule over the sections.

Sections stand at right angles to their azimuth, the direction in which they follow one another, clockwise from north.
The first and the last one touch the boundary, so that all rules begin and end with what is there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import shapely

from aerotri.conventions import InputError, in_digits
from aerotri.volume import _kernels
from aerotri.volume.bases import Base, Surface, sampled
from aerotri.volume.boundary import Boundary
from aerotri.volume.quantity import Volume

INSET = 1e-9
"""Of the extent: the outermost sections lie so much inside, where the boundary has a length along them."""
PIECES_AT_ONCE = 4096
"""Pieces of a line that are sampled at a time; chosen [C]: enough for numpy to be busy, a few hundred kB."""
MOST_SECTIONS = 1_000_000
"""Sections cut at most; chosen [C]: a spacing that asks for more is a mistake in the unit."""


@dataclass(frozen=True, eq=False)
class Sections:
    """Cross sections of a volume, k of them.

    Parameters
    ----------
    azimuth : degrees. origin : (2,) m; section i lies at origin + station[i]·direction.
    station : (k,) m. sums : (k, 5) cut area, fill area, cut length, fill length, length not known, m² and m.
    """

    azimuth: float
    origin: np.ndarray
    station: np.ndarray
    sums: np.ndarray

    @property
    def spacing(self) -> float:
        """m, between sections; the last interval may be shorter."""
        return float(self.station[1] - self.station[0])

    def chosen(self, count: int = 3) -> np.ndarray:
        """(k,) stations of at most so many sections to be shown: they divide cut and fill into equal parts.

        So a section between two piles, where nothing lies, is none of them.
        """
        area = self.sums[:, 0] + self.sums[:, 1]
        share = np.cumsum(area if area.sum() > 0.0 else np.ones_like(area))
        wanted = share[-1] * (np.arange(count) + 1.0) / (count + 1.0)
        return self.station[np.unique(np.searchsorted(share, wanted))]


def direction_of(azimuth: float) -> np.ndarray:
    """(2,) unit vector of an azimuth in degrees, clockwise from north."""
    a = np.radians(azimuth)
    return np.array([np.sin(a), np.cos(a)])


def cross_sections(
    surface: Surface,
    base: Base,
    boundary: Boundary,
    spacing: float,
    azimuth: float = 0.0,
    progress: Callable[[int, int], None] | None = None,
) -> Sections:
    """Cut the volume into cross sections.

    Parameters
    ----------
    spacing : m between sections. azimuth : degrees.

    Raises
    ------
    InputError
        When the spacing does not fit the boundary.
    """
    along = direction_of(azimuth)
    across = np.array([along[1], -along[0]])
    corners = np.concatenate(boundary.rings)
    low, high = (corners @ along).min(), (corners @ along).max()
    if not 0.0 < spacing <= high - low:
        raise InputError(
            f"sections every {spacing:g} m do not fit a boundary {in_digits(high - low, 6)} m long",
            "choose a smaller --section-spacing",
        )
    length = high - low
    if length / spacing > MOST_SECTIONS:
        raise InputError(
            f"sections every {spacing:g} m would be {in_digits(length / spacing, 3)}, {MOST_SECTIONS} at most are cut",
            f"choose a --section-spacing of at least {in_digits(length / MOST_SECTIONS, 2)} m",
        )
    station = spacing * np.arange(int(np.floor(length / spacing * (1.0 + 1e-12))) + 1)
    if length - station[-1] > 1e-9 * length:
        station = np.append(station, length)
    else:
        station[-1] = length
    origin = low * along + ((corners @ across).min() + (corners @ across).max()) / 2.0 * across
    half = ((corners @ across).max() - (corners @ across).min()) / 2.0 + spacing
    sums = np.zeros((len(station), 5))
    for k, at in enumerate(np.clip(station, INSET * length, (1.0 - INSET) * length)):
        middle = origin + at * along
        line = shapely.LineString([middle - half * across, middle + half * across])
        for start, end in _spans(boundary, line):
            _add_span(surface, base, start, end, sums[k : k + 1])
        if progress is not None:
            progress(k + 1, len(station))
    return Sections(azimuth, origin, station, sums)


@dataclass(frozen=True, eq=False)
class Profile:
    """A section as it is drawn: heights along it, m; NaN where not known.

    Parameters
    ----------
    station : m. ends : (2, 2) m, where it begins and ends. distance, surface, base : (n,) m.
    inside : (n,) bool, within the boundary.
    """

    station: float
    ends: np.ndarray
    distance: np.ndarray
    surface: np.ndarray
    base: np.ndarray
    inside: np.ndarray


def chosen_profiles(
    surface: Surface, base: Base, boundary: Boundary, sections: Sections, count: int = 3, places: int = 400
) -> list[Profile]:
    """Those that `Sections.chosen` names."""
    along = direction_of(sections.azimuth)
    across = np.array([along[1], -along[0]])
    reach = (np.concatenate(boundary.rings) - sections.origin) @ across
    out = []
    for station in sections.chosen(count):
        ends = sections.origin + station * along + np.array([reach.min(), reach.max()])[:, None] * across
        at = ends[0] + np.linspace(0.0, 1.0, places)[:, None] * (ends[1] - ends[0])
        z = sampled(surface, at[:, 0], at[:, 1])
        inside = np.asarray(shapely.contains_xy(boundary.polygon, at[:, 0], at[:, 1]))
        distance = np.linalg.norm(at - ends[0], axis=1)
        out.append(Profile(float(station), ends, distance, z, base.heights(at[:, 0], at[:, 1]), inside))
    return out


def _spans(boundary: Boundary, line: shapely.LineString) -> list[tuple[np.ndarray, np.ndarray]]:
    """Ends (2,) of the parts of a line inside the boundary."""
    inside = shapely.get_parts(shapely.intersection(line, boundary.polygon))
    coordinates = [np.asarray(part.coords) for part in inside if part.geom_type == "LineString"]
    return [(part[k], part[k + 1]) for part in coordinates for k in range(len(part) - 1)]


def _add_span(surface: Surface, base: Base, start: np.ndarray, end: np.ndarray, sums: np.ndarray) -> None:
    """Add a straight part: between the lines through centres of cells a bilinear surface is a quadratic along it."""
    grid = surface.grid
    column, row = grid.column(np.array([start[0], end[0]])), grid.row(np.array([start[1], end[1]]))
    cuts = [np.array([0.0, 1.0])]
    for a, b in (column, row):
        if abs(b - a) > 1e-9:
            lines = np.arange(np.ceil(min(a, b)), np.floor(max(a, b)) + 1.0)
            cuts.append((lines - a) / (b - a))
    t = np.unique(np.clip(np.concatenate(cuts), 0.0, 1.0))
    length = float(np.linalg.norm(end - start)) * np.diff(t)
    keep = length > 0.0
    t0, t1, length = t[:-1][keep], t[1:][keep], length[keep]
    for first in range(0, len(t0), PIECES_AT_ONCE):
        piece = slice(first, first + PIECES_AT_ONCE)
        at = np.concatenate([t0[piece], (t0[piece] + t1[piece]) / 2.0, t1[piece]])
        xy = start + at[:, None] * (end - start)
        f = (sampled(surface, xy[:, 0], xy[:, 1], 1024) - base.heights(xy[:, 0], xy[:, 1])).reshape(3, -1).T
        own = np.zeros(len(f), np.int64)
        _kernels.add_pieces(np.ascontiguousarray(f), length[piece], own, sums)


def section_volume(sections: Sections, rule: str) -> Volume:
    """The volume of cross sections by a rule; what the rule does not take in is added by the trapezoid.

    Parameters
    ----------
    rule : 'trapezoidal', 'simpson' (even number of intervals) or 'simpson38' (a multiple of three).
    """
    s, values = sections.station, sections.sums
    weights = np.zeros(len(s))
    equal = _equal_intervals(s)
    used = {"trapezoidal": 0, "simpson": equal - equal % 2, "simpson38": equal - equal % 3}[rule]
    h = s[1] - s[0]
    if rule == "simpson":
        for k in range(0, used, 2):
            weights[k : k + 3] += h / 3.0 * np.array([1.0, 4.0, 1.0])
    elif rule == "simpson38":
        for k in range(0, used, 3):
            weights[k : k + 4] += 3.0 * h / 8.0 * np.array([1.0, 3.0, 3.0, 1.0])
    steps = np.diff(s[used:])
    weights[used:-1] += steps / 2.0
    weights[used + 1 :] += steps / 2.0
    return Volume.of_sums(f"sections, {rule}", weights @ values, _note(rule, used, len(s) - 1, sections))


def _equal_intervals(station: np.ndarray) -> int:
    """Number of leading intervals of the full spacing."""
    steps = np.diff(station)
    whole = np.isclose(steps, steps[0], rtol=1e-6)
    return len(steps) if whole.all() else int(np.argmin(whole))


def _note(rule: str, used: int, intervals: int, sections: Sections) -> str:
    text = f"{intervals + 1} sections every {in_digits(sections.spacing, 4)} m, azimuth {sections.azimuth:g}°"
    if rule != "trapezoidal" and used < intervals:
        text += f"; {intervals - used} of {intervals} intervals by the trapezoid"
    return text
