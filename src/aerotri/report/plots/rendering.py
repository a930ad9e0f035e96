"""Figures as files."""

from __future__ import annotations

import io
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import matplotlib
from matplotlib.figure import Figure

from aerotri.report.plots.canvas import STYLE

DPI = 130
"""Pixels an inch of PNG; chosen [C]: sharp on a screen; prints take the SVG."""


@dataclass(frozen=True)
class RenderedPlot:
    """A plot as the bytes of its two files."""

    svg: bytes
    png: bytes


def render_plots(figures: Mapping[str, Figure | RenderedPlot]) -> dict[str, RenderedPlot]:
    """Figures as SVG and PNG; the same figure gives the same bytes. What is rendered already is passed on."""
    rendered = {}
    with matplotlib.rc_context(cast(Any, STYLE)), warnings.catch_warnings():
        # a name in a script the font has no letters for shows boxes, which is no reason to bother the user
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        for name, figure in figures.items():
            if isinstance(figure, RenderedPlot):
                rendered[name] = figure
                continue
            svg, png = io.BytesIO(), io.BytesIO()
            figure.savefig(svg, format="svg", metadata={"Date": None})
            figure.savefig(png, format="png", dpi=DPI)
            rendered[name] = RenderedPlot(svg.getvalue(), png.getvalue())
    return rendered


def save_plots(figures: Mapping[str, Figure], folder: str | Path) -> dict[str, RenderedPlot]:
    """Write `<name>.svg` and `<name>.png` of every figure; returns what was written, for the report."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    rendered = render_plots(figures)
    for name, plot in rendered.items():
        (folder / f"{name}.svg").write_bytes(plot.svg)
        (folder / f"{name}.png").write_bytes(plot.png)
    return rendered
