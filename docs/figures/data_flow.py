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

WIDTH, HEIGHT = 2.1, 0.74
"""Of a box, in the units of its places."""
DATA, WORK = "#ffffff", "#dfe5ea"
"""Fill of what lies in files or records, and of what computes: apart in black and white too, by the rounded corners."""

BOXES: dict[str, tuple[float, float, str, str]] = {
    "photographs": (0.0, 9.0, "photographs", DATA),
    "foreign": (2.7, 9.0, "files of other\nprograms", DATA),
    "specification": (5.4, 9.0, "flight plan", DATA),
    "tie points": (0.0, 7.8, "tie_points", WORK),
    "formats": (2.7, 7.8, "formats", WORK),
    "simulation": (5.4, 7.8, "simulation", WORK),
    "block": (2.7, 6.6, "Block\n(what was measured)", DATA),
    "crosscheck": (5.4, 6.6, "crosscheck\n(pycolmap, Ceres)", WORK),
    "coordinates": (0.0, 5.4, "coordinates\n(CRS, local frame)", WORK),
    "adjustment": (2.7, 5.4, "functional_model,\nadjustment", WORK),
    "statistics": (5.4, 5.4, "statistics,\nstrategies", WORK),
    "diagnosis": (5.4, 4.2, "diagnosis\n(verdict, causes)", WORK),
    "results": (2.7, 4.2, "results\n(AdjustedBlock)", DATA),
    "image errors": (0.0, 3.0, "image_errors\n(ideal photographs)", WORK),
    "terrain": (2.7, 3.0, "terrain", WORK),
    "report": (5.4, 3.0, "report", WORK),
    "deformation": (0.0, 1.8, "deformation", WORK),
    "volume": (2.7, 1.8, "volume", WORK),
    "files": (5.4, 1.8, "result folder", DATA),
    "dem": (0.0, 0.6, "corrected DEM", DATA),
}
"""Place (column, row), text and kind of every box."""
ARROWS = (
    ("photographs", "tie points"), ("foreign", "formats"), ("specification", "simulation"), ("tie points", "block"),
    ("formats", "block"), ("simulation", "block"), ("block", "crosscheck"), ("block", "adjustment"),
    ("coordinates", "adjustment"), ("adjustment", "statistics"), ("adjustment", "results"), ("statistics", "diagnosis"),
    ("diagnosis", "results"), ("results", "image errors"), ("results", "terrain"), ("results", "report"),
    ("image errors", "deformation"), ("terrain", "volume"), ("report", "files"), ("deformation", "dem"),
)  # fmt: skip


def draw() -> Figure:
    """The picture."""
    figure = Figure(figsize=(8.2, 9.6))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    for name in BOXES:
        _box(axes, name)
    for first, second in ARROWS:
        _arrow(axes, first, second)
    axes.set_xlim(-0.1, 5.4 + WIDTH + 0.1)
    axes.set_ylim(0.5, 9.0 + HEIGHT + 0.1)
    axes.axis("off")
    return figure


def _box(axes: Axes, name: str) -> None:
    x, y, text, fill = BOXES[name]
    style = "round,pad=0,rounding_size=0.18" if fill == WORK else "square,pad=0"
    axes.add_patch(FancyBboxPatch((x, y), WIDTH, HEIGHT, boxstyle=style, facecolor=fill, edgecolor="#1f2a33"))
    axes.text(x + WIDTH / 2, y + HEIGHT / 2, text, ha="center", va="center", fontsize=11, color="#1f2a33")


def _arrow(axes: Axes, first: str, second: str) -> None:
    (x0, y0, *_), (x1, y1, *_) = BOXES[first], BOXES[second]
    if y0 == y1:
        y, (left, right) = y0 + HEIGHT / 2, (WIDTH, 0.0) if x1 > x0 else (0.0, WIDTH)
        start, end = (x0 + left, y), (x1 + right, y)
    else:
        shift = 0.0 if x0 == x1 else 0.25 * WIDTH * (1 if x0 > x1 else -1)
        start, end = (x0 + WIDTH / 2 - shift, y0), (x1 + WIDTH / 2 + shift, y1 + HEIGHT)
    axes.add_patch(FancyArrowPatch(start, end, arrowstyle="-|>", mutation_scale=13, color="#1f2a33", linewidth=1.2))


def main() -> None:
    """Write the picture to the path given; the same input gives the same bytes."""
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "data_flow.svg")
    with matplotlib.rc_context({"svg.hashsalt": "aerotri", "svg.fonttype": "path"}):
        draw().savefig(target, metadata={"Date": None})


if __name__ == "__main__":
    main()
