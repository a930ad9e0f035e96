"""Maps one column wide: their frame, the scale beside them, and names on them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colorbar import Colorbar
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.textpath import TextPath

from aerotri.report.plots.canvas import (
    FRAME,
    INK,
    OWN_NAME,
    WIDTH,
    axes_at,
    coordinate_axes,
    new_figure,
    plain,
)

Bounds = tuple[float, float, float, float]
"""Left, bottom, right, top, m."""
HIGHEST = 6.4
"""Inches that a map is high at most: with its title it fits a printed page."""
LEFT, BOTTOM, SCALE, ABOVE = 0.95, 0.65, 1.0, 0.8
"""Inches beside a map for coordinates and for the scale, and below and above it."""
KEY, LINE = 0.35, 0.17
"""Inches of a key below a map, and of one more line above it."""
NAME_SIZE = 8.0
"""Points, of names on maps."""
RINGS = (0.10, 0.22, 0.38, 0.58)
"""Inches from the middle of a mark to its name, one after the other; chosen [C]."""
DIRECTIONS = ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1))
MARK = 0.08
"""Inches from the middle of a mark to its edge, which no name covers."""


def single_map(title: str, subtitle: str, bounds: Bounds, is_local: bool, key: bool = False) -> tuple[Figure, Axes]:
    """A figure with one map as wide as a column, its coordinates, and room for a scale; key : room for one below."""
    left, bottom, right, top = bounds
    ratio = (top - bottom) / (right - left)
    width = min(WIDTH - LEFT - SCALE, HIGHEST / ratio)
    height, below = width * ratio, BOTTOM + (KEY if key else 0.0)
    above = ABOVE + LINE * subtitle.count("\n")
    figure = new_figure(height + below + above, title, subtitle)
    axes = axes_at(figure, LEFT, below, width, height)
    axes.set_xlim(left, right)
    axes.set_ylim(bottom, top)
    coordinate_axes(axes, width, height, coordinate_names(is_local))
    return figure, axes


def coordinate_names(is_local: bool) -> tuple[str, str]:
    """Of the axes of a map."""
    return ("X (local) [m]", "Y (local) [m]") if is_local else ("E [m]", "N [m]")


def extent_of(bounds: Bounds) -> Bounds:
    """Left, right, bottom, top, as `imshow` has it."""
    left, bottom, right, top = bounds
    return left, right, bottom, top


def key_below(figure: Figure, handles: Sequence[Artist]) -> None:
    """What the signs of a map mean, below it."""
    place = 0.9 / WIDTH, 0.2 / float(figure.get_size_inches()[1])
    figure.legend(handles=list(handles), loc="center left", bbox_to_anchor=place, ncols=len(handles))


def scale_beside(figure: Figure, axes: Axes, image: ScalarMappable, label: str) -> Colorbar:
    """The scale of grey tones, right of a map and as high."""
    across, up = figure.get_size_inches()
    place = axes.get_position()
    bar = axes_at(figure, place.x1 * across + 0.15, place.y0 * up, 0.14, place.height * up)
    found = figure.colorbar(image, cax=bar)
    found.set_label(label)
    return found


def write_names(axes: Axes, places: np.ndarray, names: Sequence[object], marked: bool = True) -> None:
    """Names beside their marks so that none lies on another name or on a mark; a line leads to one that lies apart.

    A name for which there is no room is left out.

    Parameters
    ----------
    places : (n, 2) m, of the marks. marked : False where nothing is drawn there: a name may lie on its own place.
    """
    figure = axes.get_figure()
    if figure is None or not len(places):
        return
    box, inches = axes.get_position(), figure.get_size_inches()  # pyright: ignore[reportAttributeAccessIssue]
    room = np.array([box.width, box.height]) * inches
    low, high = np.array([axes.get_xlim(), axes.get_ylim()]).T
    at = (places - low) / (high - low) * room
    texts = [plain(name, 24) for name in names]
    sizes = np.array([_size(text) for text in texts])
    edge = [withStroke(linewidth=2.5, foreground="white")]
    middles = free_places(at, sizes, room, marked)
    for place, mark, middle, text in zip(places, at, middles, texts, strict=True):
        if middle is None:
            continue
        x, y = (low + middle / room * (high - low)).tolist()
        if marked and np.abs(middle - mark).max() > RINGS[1] + sizes.max():
            axes.plot([place[0], x], [place[1], y], color=INK, lw=FRAME, zorder=3.5)
        axes.text(x, y, text, ha="center", va="center", fontsize=NAME_SIZE, zorder=6, path_effects=edge, label=OWN_NAME)


def free_places(marks: np.ndarray, sizes: np.ndarray, room: np.ndarray, marked: bool = True) -> list[np.ndarray | None]:
    """(2,) middle of every name, inches, None without room: of the places about its mark the first that is free.

    Parameters
    ----------
    marks, sizes : (n, 2) inches, middles of the marks, and width and height of the names. room : (2,) inches.
    """
    taken = [(mark - MARK, mark + MARK) for mark in marks] if marked else []
    found: list[np.ndarray | None] = []
    for mark, size in zip(marks, sizes, strict=True):
        tried = _tried(mark, size, marked)
        middle = next((one for one in tried if _is_free(one - size / 2, one + size / 2, room, taken)), None)
        if middle is not None:
            taken.append((middle - size / 2, middle + size / 2))
        found.append(middle)
    return found


def _tried(mark: np.ndarray, size: np.ndarray, marked: bool) -> Iterator[np.ndarray]:
    """Middles of a name about its mark, the nearest first."""
    if not marked:
        yield mark
    for ring in RINGS:
        for direction in DIRECTIONS:
            yield mark + np.array(direction) * (ring + size / 2)


def _is_free(
    low: np.ndarray, high: np.ndarray, room: np.ndarray, taken: Iterable[tuple[np.ndarray, np.ndarray]]
) -> bool:
    """Whether a rectangle lies in the room and touches none of those that are taken."""
    if (low < 0.0).any() or (high > room).any():
        return False
    return not any((low < other_high).all() and (high > other_low).all() for other_low, other_high in taken)


def _size(text: str) -> tuple[float, float]:
    """Width and height of a name, inches, with its light edge."""
    box = TextPath((0.0, 0.0), text, size=NAME_SIZE).get_extents()
    return (box.width + 4.0) / 72.0, (NAME_SIZE + 2.0) / 72.0
