"""Pictures of the patterns of additional parameters: one small vector field an item."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from aerotri.functional_model.additional_parameters import FAMILIES, brown, dmc, lens, parameter_set, text_of
from aerotri.functional_model.additional_parameters.registry import INTERIOR_FAMILIES, default_items, sizes_of
from aerotri.functional_model.additional_parameters.sizes import size_of
from aerotri.observations import Camera
from aerotri.report.plots.camera import seams
from aerotri.report.plots.canvas import FRAME, GREY, INK, LIGHT, WIDTH, axes_at, new_figure, plain, styled, vectors

MOST_ON_A_SHEET = 44
"""Patterns of a sheet at most: Grün's 44 and the 44 of Legendre's M = N = 4 fill one."""
COLUMNS = ((4, 2), (20, 4), (36, 6), (MOST_ON_A_SHEET, 7))
"""Panels beside each other for up to so many patterns."""
MARGIN, GAP, HEAD, CAPTION = 0.2, 0.16, 0.92, 0.34
"""Inches: around the sheet, between panels, title of the sheet, title of a panel."""
ARROW_SPACING = 0.14
"""Inches between arrows; chosen [C]: closer ones are too short to show their direction, wider ones miss tiles."""
LONGEST_IN_CELLS = 0.95
"""Arrows are drawn about their positions and stay in their cells, so that none meets the next or a caption."""
LETTER = 0.53
"""Mean width of a letter, in its height."""
EXAMPLE_GRID = (7, 5)
"""Columns and rows of the nodes where a family needs a grid and none is stated; chosen [C]: about the ratio of a
format, with a node in the middle."""
EXAMPLE_HEIGHTS = (1000.0, 100.0)
"""Flying height, and height of the point above the mean ground, m, of patterns that depend on them."""
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def pattern_sheets(family: str) -> list[tuple[str, ...]]:
    """The items of a family's full set, as they are divided into sheets.

    The nodes of a grid all look alike: of them a corner and the centre of a coarse grid stand for all.
    """
    items, sizes = default_items(family), sizes_of(family)
    if sizes is not None and _grid_of(items[0]) is not None:
        (nx, ny), known = EXAMPLE_GRID, sizes.items(EXAMPLE_GRID)
        corner, centre = 0, ny // 2 * nx + nx // 2
        items = tuple(known[axis * nx * ny + node] for node in (corner, centre) for axis in (0, 1))
    elif sizes is None:
        # beside the full set those that cannot be in it
        own = FAMILIES[family]
        items = (*items, *(item for item in (*own.items, *own.needs_height) if item not in items))
    return [items[k : k + MOST_ON_A_SHEET] for k in range(0, len(items), MOST_ON_A_SHEET)]


def _grid_of(item: str) -> tuple[int, int] | None:
    """Nodes along x and y of the grid to which an item belongs; None for items of other families."""
    return size_of(item.partition("_")[0])


def plot_pattern_sheets(family: str, camera: Camera) -> list[Figure]:
    """Every pattern of a family's full set, on as many sheets as it takes."""
    return [plot_pattern_sheet(family, camera, items) for items in pattern_sheets(family)]


@styled
def plot_pattern_sheet(family: str, camera: Camera, items: Sequence[str] | None = None) -> Figure:
    """Patterns of a family over the format of a camera; the first sheet of its full set unless items are given.

    Every pattern is drawn with its longest vector alike; what one unit of the parameter moves there stands above it.

    Parameters
    ----------
    items : up to 44.
    """
    items = pattern_sheets(family)[0] if items is None else tuple(items)
    if not 0 < len(items) <= MOST_ON_A_SHEET:
        raise ValueError(f"a sheet takes 1 to {MOST_ON_A_SHEET} patterns, not {len(items)}")
    columns = next(columns for most, columns in COLUMNS if len(items) <= most)
    columns, rows = min(columns, len(items)), -(-len(items) // columns)
    width, height = _panel_size(camera, columns)
    total = HEAD + rows * (height + CAPTION) + (rows - 1) * GAP + MARGIN
    figure = new_figure(total, f"Patterns of additional parameters – {plain(family)}", _subtitle(camera))
    x, y = _positions(camera, width, _grid_of(items[0]))
    patterns = _patterns(family, items, camera, x, y)
    for k, item in enumerate(items):
        left = MARGIN + (k % columns) * (width + GAP)
        bottom = total - HEAD - (k // columns + 1) * (height + CAPTION) - (k // columns) * GAP
        axes = axes_at(figure, left, bottom, width, height)
        _draw(axes, camera, item, np.column_stack([x, y]), patterns[:, :, k], width)
        _caption(figure, family, item, patterns[:, :, k], (left, bottom + height, width))
    return figure


def _subtitle(camera: Camera) -> str:
    half = camera.half_format_mm
    flight = "" if camera.flight_axis is None else f", flight along {camera.flight_axis}"
    return (
        f"image error measured − ideal over {2 * half[0]:.1f} × {2 * half[1]:.1f} mm{flight}\n"
        "every pattern drawn with its longest vector alike; that vector for one unit of the parameter is the number "
        "on the right"
    )


def _panel_size(camera: Camera, columns: int) -> tuple[float, float]:
    """Inches; no panel wider than a third of the sheet or higher than 2.2 inches."""
    half = camera.half_format_mm
    width = min((WIDTH - 2 * MARGIN - (columns - 1) * GAP) / columns, 2.7, 2.2 * half[0] / half[1])
    return width, width * half[1] / half[0]


def _positions(camera: Camera, width: float, grid: tuple[int, int] | None) -> tuple[np.ndarray, np.ndarray]:
    """(n,) mm: centres of equal cells, an even number each way, so that none lies on an axis, where parts meet.

    Of a grid the nodes and the places half way between them.
    """
    half = camera.half_format_mm
    if grid is None:
        nx = 2 * max(3, round(width / ARROW_SPACING / 2))
        ny = 2 * max(2, round(nx * half[1] / half[0] / 2))
        along = [(2.0 * (np.arange(n) + 0.5) / n - 1.0) * h for n, h in zip((nx, ny), half, strict=True)]
    else:
        along = [np.linspace(-h, h, 2 * n - 1) for n, h in zip(grid, half, strict=True)]
    x, y = np.meshgrid(*along)
    return x.ravel(), y.ravel()


def _patterns(family: str, items: Sequence[str], camera: Camera, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(n, 2, p) mm per unit."""
    if family not in INTERIOR_FAMILIES:
        full = default_items(family) if sizes_of(family) is None else items
        together = tuple(item for item in items if item in full)
        chosen = parameter_set(family, together, camera)
        basis = chosen.basis(x, y)
        patterns = dict(zip(chosen.items, np.moveaxis(basis, 2, 0), strict=True))
        for item in items:
            if item not in patterns:
                patterns[item] = _pattern_apart(family, item, camera, x, y)
        return np.stack([patterns[item] for item in items], axis=-1)
    x_bar, y_bar = x - camera.principal_point_mm[0], y - camera.principal_point_mm[1]
    if family == brown.FAMILY.name:
        return brown.basis(x_bar, y_bar)[:, :, [brown.ITEMS.index(item) for item in items]]
    c = camera.focal_length_mm
    return c * lens.patterns(x_bar / c, y_bar / c, lens.vector({}))[:, :, [lens.ITEMS.index(item) for item in items]]


def _pattern_apart(family: str, item: str, camera: Camera, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(n, 2) mm per unit of an item that is not in the full set; one that needs heights, at `EXAMPLE_HEIGHTS`."""
    if item in FAMILIES[family].needs_height:
        flying, above = (np.full(len(x), height) for height in EXAMPLE_HEIGHTS)
        return dmc.centre_offset(camera, x, y, flying, above)
    return parameter_set(family, (item,), camera).basis(x, y)[:, :, 0]


def _draw(axes: Axes, camera: Camera, item: str, at: np.ndarray, d: np.ndarray, width: float) -> None:
    half = np.array(camera.half_format_mm)
    axes.set_xlim(-half[0], half[0])
    axes.set_ylim(-half[1], half[1])
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set(color=GREY, linewidth=0.6 * FRAME)
    dashed: dict[str, Any] = {"linewidths": 0.45, "linestyles": (0, (5, 3)), "zorder": 1}
    axes.add_collection(LineCollection(seams(camera), colors=GREY, **dashed))
    axes.add_collection(LineCollection(list(_cells(item, half)), colors=LIGHT, linewidths=0.3, zorder=1))
    cell = width / len(np.unique(at[:, 0]))
    longest = np.hypot(d[:, 0], d[:, 1]).max()
    per_inch = max(longest, 1e-300) / (LONGEST_IN_CELLS * cell)
    vectors(axes, at, d, per_inch, INK, width=0.009, pivot="mid", zorder=3, clip_on=False)


def _cells(item: str, half: np.ndarray) -> Iterator[np.ndarray]:
    """Lines between the nodes of the grid to which an item belongs."""
    size = _grid_of(item)
    if size is None:
        return
    for axis in (0, 1):
        for place in np.linspace(-half[axis], half[axis], size[axis])[1:-1]:
            line = np.array([-half, half])
            line[:, axis] = place
            yield line


def number_text(value: float) -> str:
    """Two digits: '0.97', '150', '1.6·10⁴'."""
    mantissa, power = f"{value:.1e}".split("e")
    if -3 <= int(power) <= 3:
        return f"{float(f'{value:.1e}'):g}"
    return f"{mantissa}·10{str(int(power)).translate(SUPERSCRIPTS)}"


def _caption(figure: Figure, family: str, item: str, d: np.ndarray, place: tuple[float, float, float]) -> None:
    """Name, largest vector and description above a panel; `place` left, top and width of the panel, inches."""
    (left, top, width), (sheet_width, sheet_height) = place, figure.get_size_inches()
    longest = np.hypot(d[:, 0], d[:, 1]).max()
    small = 7.0 if width > 1.3 else 6.2
    options: dict[str, Any] = {"va": "bottom", "fontsize": small, "color": GREY}
    name_y, text_y = (top + 0.165) / sheet_height, (top + 0.04) / sheet_height
    figure.text(
        left / sheet_width, name_y, plain(item), va="bottom", fontsize=8.5 if width > 1.3 else 7.5, weight="bold"
    )
    figure.text((left + width) / sheet_width, name_y, f"{number_text(longest)} mm", ha="right", **options)
    letters = int(width * 72 / (small * LETTER))
    figure.text(left / sheet_width, text_y, plain(text_of(family, item), letters), **options)
