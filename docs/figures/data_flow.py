"""The picture of docs/develop/architecture.md: how data flows through the package.

Example: python docs/figures/data_flow.py docs/develop/data_flow.svg
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("svg")

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

WIDTH, HEIGHT = 2.15, 0.72
"""Of a box, in the units of its places."""
DATA, WORK = "#ffffff", "#dfe5ea"
"""Fill of what lies in files or records, and of what computes: apart in black and white too, by the rounded corners."""

BOXES: dict[str, tuple[float, float, str, str]] = {
    "photographs": (0.0, 6.0, "photographs", DATA),
    "foreign": (0.0, 4.8, "files of other\nprograms", DATA),
    "specification": (0.0, 3.6, "flight plan\n(TOML)", DATA),
    "tie points": (2.8, 6.0, "tie_points", WORK),
    "formats": (2.8, 4.8, "formats", WORK),
    "simulation": (2.8, 3.6, "simulation", WORK),
    "block": (5.6, 4.8, "Block\n(what was measured)", DATA),
    "coordinates": (8.4, 6.0, "coordinates\n(CRS ↔ local frame)", WORK),
    "adjustment": (8.4, 4.8, "functional_model,\nadjustment", WORK),
    "statistics": (8.4, 3.6, "statistics,\nstrategies", WORK),
    "diagnosis": (8.4, 2.4, "diagnosis\n(verdict, causes)", WORK),
    "results": (11.2, 4.8, "results\n(AdjustedBlock)", DATA),
    "crosscheck": (5.6, 2.4, "crosscheck\n(pycolmap, Ceres)", WORK),
    "image errors": (14.0, 4.8, "image_errors", WORK),
    "deformation": (14.0, 3.6, "deformation", WORK),
    "terrain": (14.0, 6.0, "terrain", WORK),
    "volume": (16.8, 6.0, "volume", WORK),
    "ideal": (16.8, 4.8, "ideal photographs", DATA),
    "dem": (16.8, 3.6, "corrected DEM", DATA),
    "report": (11.2, 2.4, "report\n(plots, tables, pages)", WORK),
    "files": (14.0, 2.4, "result folder", DATA),
}
"""Place (column, row), text and kind of every box."""
ARROWS = (
    ("photographs", "tie points"), ("foreign", "formats"), ("specification", "simulation"), ("tie points", "block"),
    ("formats", "block"), ("simulation", "block"), ("block", "adjustment"), ("coordinates", "adjustment"),
    ("adjustment", "statistics"), ("statistics", "diagnosis"), ("adjustment", "results"), ("statistics", "results"),
    ("diagnosis", "results"), ("block", "crosscheck"), ("results", "terrain"), ("results", "image errors"),
    ("image errors", "deformation"), ("image errors", "ideal"), ("deformation", "dem"), ("terrain", "volume"),
    ("results", "report"), ("report", "files"),
)  # fmt: skip


def draw() -> Figure:
    """The picture."""
    figure = Figure(figsize=(13.5, 4.6))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    for name in BOXES:
        _box(axes, name)
    for first, second in ARROWS:
        _arrow(axes, first, second)
    axes.set_xlim(-0.15, 16.8 + WIDTH + 0.15)
    axes.set_ylim(1.85, 6.0 + HEIGHT + 0.1)
    axes.axis("off")
    return figure


def _box(axes: Axes, name: str) -> None:
    x, y, text, fill = BOXES[name]
    style = "round,pad=0,rounding_size=0.18" if fill == WORK else "square,pad=0"
    axes.add_patch(FancyBboxPatch((x, y), WIDTH, HEIGHT, boxstyle=style, facecolor=fill, edgecolor="#1f2a33"))
    axes.text(x + WIDTH / 2, y + HEIGHT / 2, text, ha="center", va="center", fontsize=9.5, color="#1f2a33")


def _arrow(axes: Axes, first: str, second: str) -> None:
    (x0, y0, *_), (x1, y1, *_) = BOXES[first], BOXES[second]
    if x0 == x1:
        x = x0 + WIDTH / 2
        start, end = ((x, y0), (x, y1 + HEIGHT)) if y0 > y1 else ((x, y0 + HEIGHT), (x, y1))
    else:
        start, end = (x0 + WIDTH, y0 + HEIGHT / 2), (x1, y1 + HEIGHT / 2)
        if (first, second) in (("results", "report"), ("block", "crosscheck")):
            start, end = (x0 + WIDTH / 2, y0), (x1 + WIDTH / 2, y1 + HEIGHT)
    axes.add_patch(FancyArrowPatch(start, end, arrowstyle="-|>", mutation_scale=12, color="#1f2a33", linewidth=1.1))


def main() -> None:
    """Write the picture to the path given; the same input gives the same bytes."""
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "data_flow.svg")
    with matplotlib.rc_context({"svg.hashsalt": "aerotri", "svg.fonttype": "path"}):
        draw().savefig(target, metadata={"Date": None})


if __name__ == "__main__":
    main()
