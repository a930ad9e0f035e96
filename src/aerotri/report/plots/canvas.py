"""What all plots share: size and place of the axes in inches, the look, names as plain text, round scale vectors.

Figures are made without pyplot, so nothing global is left behind, and every axes stands at a place computed here, so
that title, plot and legend never meet. Everything must also be readable in black and white: meaning is carried by
shape, darkness and line style, colour only helps.
"""

from __future__ import annotations

import functools
import io
import warnings
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar, cast

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.quiver import Quiver
from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator

from aerotri.report.quality import printable

P = ParamSpec("P")
F = TypeVar("F", bound=Figure | None)

WIDTH = 8.6
"""Inches of a plot; chosen [C]: scaled into the margins of an A4 page its letters are still readable."""
INK, GREY, LIGHT, ACCENT = "#1c242c", "#6b7680", "#b4bcc4", "#0b5cad"
FRAME = 0.8
"""Points, of lines around plots; chosen [C]: thinner than the lines of data."""

# the type of its keys has a name in new matplotlib only, hence the casts below
STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "mathtext.fontset": "dejavusans",
    "axes.edgecolor": GREY,
    "axes.linewidth": FRAME,
    "axes.labelcolor": INK,
    "axes.labelsize": 8.5,
    "axes.facecolor": "white",
    "axes.formatter.useoffset": False,
    "axes.unicode_minus": True,
    "figure.facecolor": "white",
    "figure.dpi": 100,
    "text.color": INK,
    "text.usetex": False,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "lines.linewidth": 1.2,
    "svg.fonttype": "path",
    "svg.hashsalt": "aerotri",
    "path.simplify": True,
}


def styled(plot: Callable[P, F]) -> Callable[P, F]:
    """Draw with the report's look whatever the user's matplotlibrc says, and leave his settings as they were."""

    @functools.wraps(plot)
    def wrapper(*args: P.args, **kwargs: P.kwargs) -> F:
        with matplotlib.rc_context(cast(Any, STYLE)):
            return plot(*args, **kwargs)

    return wrapper


class ShownFigure(Figure):
    """A figure that a notebook shows, whether pyplot was imported there or not."""

    def _repr_png_(self) -> bytes:
        file = io.BytesIO()
        with matplotlib.rc_context(cast(Any, STYLE)), warnings.catch_warnings():
            # a script the font has no letters for shows boxes
            warnings.filterwarnings("ignore", message="Glyph .* missing from")
            self.savefig(file, format="png")
        return file.getvalue()


def new_figure(height: float, title: str, subtitle: str = "", width: float = WIDTH) -> Figure:
    """A figure of a size in inches with a title and a line of explanation at its upper left."""
    figure = ShownFigure(figsize=(width, height))
    figure.text(0.2 / width, 1 - 0.17 / height, title, fontsize=11.5, weight="bold", va="top")
    figure.text(0.2 / width, 1 - 0.41 / height, subtitle, fontsize=8.5, color=GREY, va="top", linespacing=1.35)
    return figure


def axes_at(figure: Figure, left: float, bottom: float, width: float, height: float) -> Axes:
    """Axes at a place given in inches from the lower left of the figure."""
    figure_width, figure_height = figure.get_size_inches()
    axes = figure.add_axes((left / figure_width, bottom / figure_height, width / figure_width, height / figure_height))
    axes.tick_params(length=3, width=FRAME)
    return axes


def plain(name: object, longest: int = 40) -> str:
    """A name as text that is drawn as it stands: no formula between dollars, no line breaks, not endless."""
    return printable(name, longest).replace("$", r"\$")


OWN_NAME = "a name of the user"
"""Label of texts that stay as they are in every language."""


def write_name(axes: Axes, place: tuple[float, float], name: object) -> None:
    """A name of the user on a map, with a light edge so that it can be read over any tone.

    Parameters
    ----------
    place : X and Y of its middle.
    """
    edge = [withStroke(linewidth=2.5, foreground="white")]
    axes.text(
        *place, plain(name, 24), ha="center", va="center", fontsize=8.5, zorder=6, path_effects=edge, label=OWN_NAME
    )


def nice_number(value: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above the value; 1 for what has no size."""
    if not np.isfinite(value) or value <= 0.0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value) + 1e-12)
    return float(max(step for step in (1.0, 2.0, 5.0) if step * power <= value * (1 + 1e-9)) * power)


def length_text(metres: float) -> str:
    """A round length in the unit that suits it: '2 m', '10 cm', '5 mm', '20 µm'."""
    for unit, size in (("km", 1e3), ("m", 1.0), ("cm", 1e-2), ("mm", 1e-3), ("µm", 1e-6)):
        if abs(metres) >= size * (1 - 1e-9):
            return f"{metres / size:g} {unit}"
    return f"{metres * 1e6:.2g} µm"


def vectors(
    axes: Axes, at: np.ndarray, d: np.ndarray, per_inch: float, color: str, width: float = 0.011, **options: Any
) -> Quiver:
    """Arrows d (n, 2) that begin at positions (n, 2), `per_inch` of their unit drawn as one inch."""
    return axes.quiver(
        *at.T, *d.T, color=color, angles="uv", units="inches", scale_units="inches", scale=per_inch, width=width,
        headwidth=3.6, headlength=4.4, headaxislength=3.9, minlength=0.6, **options,
    )  # fmt: skip


def scale_vector(axes: Axes, quiver: Quiver, size: float, per_inch: float, label: str, x: float, y: float) -> None:
    """The scale vector with its label to the right of it, its left end at (x, y) inches of the figure."""
    length = size / per_inch
    axes.quiverkey(
        quiver, x + length / 2.0, y, size, label, coordinates="inches", labelpos="E", labelsep=0.08, color=INK
    )


def per_inch_for(lengths: np.ndarray, longest_inch: float) -> tuple[float, float]:
    """Drawing scale with which the longest vector is `longest_inch`, and a round size for the scale vector.

    Parameters
    ----------
    lengths : lengths of the vectors, any unit; not-finite ones do not count.

    Returns
    -------
    per_inch, size : in the unit of the lengths.
    """
    finite = lengths[np.isfinite(lengths)]
    longest = float(finite.max()) if len(finite) and finite.max() > 0.0 else 1.0
    return longest / longest_inch, nice_number(longest)


def coordinate_text(value: float, place: int | None = None) -> str:
    """A coordinate in full with the minus sign of print; `place` is its number among the ticks of an axis."""
    return f"{value:.10g}".replace("-", "−")


def value_text(value: float, place: int | None = None) -> str:
    """A number of up to six digits with the minus sign of print; `place` as in `coordinate_text`."""
    return f"{value:g}".replace("-", "−")


ROOM_OF_TWO = 1.4
"""Inches of an axis that two coordinates of seven digits take beside one another."""


def coordinate_axes(axes: Axes, width: float, height: float, labels: tuple[str, str]) -> None:
    """Round, whole coordinates along axes of so many inches, and their labels."""
    along = MaxNLocator(max(1, int(width / 1.0)), steps=[1, 2, 5, 10])
    if width < ROOM_OF_TWO:
        low, high = sorted(axes.get_xlim())
        inside = [value for value in along.tick_values(low, high) if low <= value <= high]
        middle = min(inside, key=lambda value: abs(value - 0.5 * (low + high)), default=0.5 * (low + high))
        axes.xaxis.set_major_locator(FixedLocator([middle]))
    else:
        axes.xaxis.set_major_locator(along)
    axes.yaxis.set_major_locator(MaxNLocator(max(2, int(height / 0.7)), steps=[1, 2, 5, 10]))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(coordinate_text))
    axes.set_xlabel(labels[0])
    axes.set_ylabel(labels[1])
