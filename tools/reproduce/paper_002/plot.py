"""Precision of the pass points over the σ of GNSS, as in figures 1 and 2 of paper 002, with method 3 beside them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from paper_002.cases import PAPER_MM
from paper_002.strip import Case, Precision

LOOKS: tuple[tuple[str, str, str, Any], ...] = (
    ("X", "#1c242c", "o", "-"),
    ("Y", "#0b5cad", "s", "--"),
    ("Z", "#b04a00", "^", ":"),
)
"""Coordinate, colour, marker, line: readable without the colour."""

TITLES = {
    "1": "1  GNSS, 2 control points,\nno towers",
    "2": "2  GNSS, towers,\nno control",
    "3": "3  full control,\nno GNSS",
}


def precision_plot(rows: Sequence[tuple[Case, Precision]]) -> Figure:
    """Three panels on one scale: lines theoretical, markers practical precision, hollow markers the paper's."""
    figure = Figure(figsize=(8.6, 4.4), layout="constrained")
    panels = figure.subplots(1, 3, sharey=True, width_ratios=[1.0, 1.0, 0.62])
    for panel, method in zip(panels, TITLES, strict=True):
        own = [(case, found) for case, found in rows if case.method == method]
        panel.set_title(TITLES[method], fontsize=9.5, loc="left")
        if method == "3":
            _bars(panel, own[0][1])
        else:
            _lines(panel, own)
        panel.grid(axis="y", color="#d5dadd", linewidth=0.6)
        panel.set_axisbelow(True)
        panel.spines[["top", "right"]].set_visible(False)
    panels[0].set_ylabel("precision of the pass points, mm")
    panels[0].set_ylim(bottom=0.0)
    figure.legend(handles=_keys(), loc="outside lower center", ncols=6, frameon=False, fontsize=8.5)
    return figure


def _lines(panel: Axes, rows: Sequence[tuple[Case, Precision]]) -> None:
    gnss = np.array([case.gnss_m or 0.0 for case, _ in rows])
    for axis, (_, colour, marker, line) in enumerate(LOOKS):
        panel.plot(gnss, [1e3 * found.theoretical[axis] for _, found in rows], color=colour, linestyle=line, zorder=2)
        # moved apart a little, so that none hides another
        for at, (_, found) in zip(gnss + 0.02 * (axis - 1), rows, strict=True):
            _practical(panel, at, found, axis, colour, marker)
    panel.set_xlabel("σ of the projection centres, m")
    panel.set_xticks(gnss)
    panel.set_xlim(0.0, 1.1 * float(gnss.max()))


def _bars(panel: Axes, found: Precision) -> None:
    for axis, (_, colour, marker, line) in enumerate(LOOKS):
        at = [axis - 0.32, axis + 0.32]
        panel.plot(at, [1e3 * found.theoretical[axis]] * 2, color=colour, linestyle=line, zorder=2)
        _practical(panel, axis - 0.16, found, axis, colour, marker)
        panel.plot(
            axis + 0.16, PAPER_MM["3"][axis], color=colour, marker=marker, markersize=8, markerfacecolor="white",
            zorder=4,
        )  # fmt: skip
    panel.set_xticks(range(3), [name for name, *_ in LOOKS])
    panel.set_xlim(-0.7, 2.7)


def _practical(panel: Axes, at: float, found: Precision, axis: int, colour: str, marker: str) -> None:
    """RMS with the standard deviation that it has as a mean over the simulations."""
    uncertain = 1e3 * found.spread[axis] / np.sqrt(max(len(found.z_roll), 1))
    panel.errorbar(
        at, 1e3 * found.practical[axis], yerr=uncertain, color=colour, marker=marker, markersize=5.5, linewidth=1.0,
        zorder=3,
    )  # fmt: skip


def _keys() -> list[Line2D]:
    coordinates = [
        Line2D([], [], color=colour, marker=marker, linestyle=line, label=name) for name, colour, marker, line in LOOKS
    ]
    grey = "#6b7680"
    return [
        *coordinates,
        Line2D([], [], color=grey, label="line: theoretical μ"),
        Line2D([], [], color=grey, marker="o", linestyle="none", label="filled: practical RMS ± σ"),
        Line2D(
            [], [], color=grey, marker="o", markersize=9, markerfacecolor="white", linestyle="none",
            label="hollow: the paper's RMS",
        ),
    ]  # fmt: skip
