"""Time over the number of photographs, both logarithmic."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from adjusting.measure import OURS, OURS_44, PROGRAMS
from adjusting.summary import Row, growth
from aerotri import drawing

HEIGHT = 4.9
LOOKS = {
    OURS.name: (drawing.ACCENT, "-", "o", 2.4),
    OURS_44.name: (drawing.ACCENT, (0, (5, 2)), "s", 2.0),
    PROGRAMS["ceres"].name: (drawing.INK, "-", "^", 1.6),
    PROGRAMS["ceres-undamped"].name: (drawing.INK, (0, (5, 2)), "v", 1.4),
    PROGRAMS["pycolmap"].name: (drawing.GREY, "-", "D", 1.4),
    PROGRAMS["scipy"].name: (drawing.GREY, (0, (1, 1.5)), "x", 1.4),
}


@drawing.styled
def plot_times(rows: Sequence[Row], threads: int) -> Figure:
    """Seconds from the start to convergence (peers: without building their problem), and of our statistics."""
    subtitle = (
        f"UltraCamD 80/40 %, 130 points a photograph, {threads} threads; from 1 m / 1 mrad off to convergence, reading "
        "excluded;\npeers without the time that building their problem takes"
    )
    figure = drawing.new_figure(HEIGHT, "Adjustment time over the number of photographs", subtitle)
    axes = drawing.axes_at(figure, 0.75, 0.6, drawing.WIDTH - 3.35, HEIGHT - 1.5)
    for program, (color, style, marker, width) in LOOKS.items():
        own = [row for row in rows if row.program == program and np.isfinite(row.solve)]
        if own:
            ours = program in (OURS.name, OURS_44.name)
            times = [row.total if ours else row.solve for row in own]
            axes.plot([row.photographs for row in own], times, color=color, ls=style, marker=marker, ms=5, lw=width,
                      mfc="white" if style != "-" else color, label=program + _exponent(rows, program))  # fmt: skip
    own = [row for row in rows if row.program == OURS.name and np.isfinite(row.statistics)]
    looks = {"color": drawing.LIGHT, "lw": 2.0, "marker": ".", "label": "aerotri, all σ and redundancy"}
    axes.plot([row.photographs for row in own], [row.statistics for row in own], **looks)
    _finish(axes, rows)
    return figure


def _exponent(rows: Sequence[Row], program: str) -> str:
    """'\\n∝ n^1.07' over the last step of size, where there are two sizes."""
    steps = dict(growth(rows, "total" if program.startswith("aerotri") else "solve")).get(program)
    return f"\n∝ n^{steps[-1][2]:.2f} at last" if steps else ""


def _finish(axes: Axes, rows: Sequence[Row]) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    sizes = sorted({row.photographs for row in rows})
    axes.set_xticks(sizes, [f"{n}" for n in sizes])
    axes.minorticks_off()
    axes.set_xlabel("photographs")
    axes.set_ylabel("time [s]")
    axes.grid(color=drawing.LIGHT, lw=0.5)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(loc="upper left", bbox_to_anchor=(1.03, 1.02), borderaxespad=0.0, labelspacing=0.7, handlelength=2.8)
