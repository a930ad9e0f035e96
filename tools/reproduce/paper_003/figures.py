"""The paper's figures 9 to 15 in our form, and the check points of all blocks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from scipy.stats import chi2

from aerotri import drawing
from paper_003.cases import PRINTED, Case
from paper_003.runs import Days, Row

LOOKS = (("X", "#1c242c", "o"), ("Y", "#0b5cad", "s"), ("Z", "#b04a00", "^"))
"""Coordinate, colour, marker: readable without the colour."""


def averaged_figure(case: Case, rows: Sequence[Row]) -> Figure:
    """Averaged residuals without, with the general and with all parameters."""
    chosen = [rows[0], rows[1], *rows[3:4]]
    panels = [drawing.Panel(row.heading, row.first.averaged) for row in chosen]
    return drawing.plot_panels(
        panels, f"Averaged residuals – {case.title}", f"measured − adjusted{_number(case.figures[0])}"
    )


def errors_figure(case: Case, rows: Sequence[Row]) -> Figure:
    """Systematic image errors by set, and the true ones."""
    panels = [drawing.Panel(row.heading, row.first.field) for row in rows[1:4]]
    panels.append(drawing.Panel("truth", rows[0].true_field))
    subtitle = f"measured − ideal, less what orientation takes{_number(case.figures[1])}"
    return drawing.plot_panels(panels, f"Systematic image errors – {case.title}", subtitle)


def _number(figure: int) -> str:
    return f"; as figure {figure} of the paper" if figure else ""


def days_figure(case: Case, days: Days) -> Figure:
    """Systematic image errors of both days and their difference."""
    named = zip(("day 1", "day 2", "day 1 − day 2"), (*days.fields, days.change.field), strict=True)
    subtitle = (
        f"{case.sets[3][0]}; as figure 11 of the paper; χ² of the difference "
        f"{days.change.statistic * days.change.freedom:.1f} with "
        f"{days.change.freedom} degrees of freedom, at most {chi2.ppf(0.95, days.change.freedom):.1f} by chance (95 %)"
    )
    return drawing.plot_panels(
        [drawing.Panel(*pair) for pair in named], f"Two days of one camera – {case.title}", subtitle
    )


def check_points_figure(answers: Sequence[tuple[Case, Sequence[Row]]]) -> Figure:
    """RMS at check points of every block by set, the paper's as hollow markers."""
    shares = [len(rows) + 0.6 for _, rows in answers]
    figure = Figure(figsize=(8.6, 4.3), layout="constrained")
    panels = np.atleast_1d(figure.subplots(1, len(answers), sharey=True, width_ratios=shares))
    for panel, (case, rows) in zip(panels, answers, strict=True):
        panel.set_title(case.title.replace(", ", ",\n"), fontsize=9, loc="left")
        for k, (_, colour, marker) in enumerate(LOOKS):
            values = [100 * row.rms[k] for row in rows]
            panel.plot(values, color=colour, marker=marker, linewidth=0.9, markersize=5, zorder=3)
        for level, k in zip(_printed_cm(case, rows), (0, 2), strict=True):
            if level is not None:
                _, colour, marker = LOOKS[k]
                panel.plot(len(rows[:4]) - 0.6, level, color=colour, marker=marker, mfc="white", ms=8, zorder=4)
        panel.set_xticks(
            range(len(rows)), [row.heading for row in rows], rotation=40, ha="right", rotation_mode="anchor", fontsize=8
        )
        panel.set_xlim(-0.5, len(rows) - 0.2)
        panel.set_yscale("log")
        panel.set_yticks([2, 5, 10, 20, 50, 100], ["2", "5", "10", "20", "50", "100"], minor=False)
        panel.minorticks_off()
        panel.grid(axis="y", color="#d5dadd", linewidth=0.6)
        panel.set_axisbelow(True)
        panel.spines[["top", "right"]].set_visible(False)
    panels[0].set_ylabel("RMS at check points, cm")
    keys: list[Line2D] = [Line2D([], [], color=colour, marker=marker, label=name) for name, colour, marker in LOOKS]
    hollow = {"marker": "o", "mfc": "white", "ms": 8, "ls": "none", "color": "#6b7680"}
    keys.append(Line2D([], [], label="hollow: the paper's (X, Y together; Z)", **hollow))
    figure.legend(handles=keys, loc="outside lower center", ncols=4, frameon=False, fontsize=8.5)
    return figure


def _printed_cm(case: Case, rows: Sequence[Row]) -> tuple[float | None, float | None]:
    printed = PRINTED[case.name]
    plan = None if printed.check_px is None else 100 * printed.check_px * rows[0].first.gsd_m
    return plan, None if printed.check_z_m is None else 100 * printed.check_z_m
