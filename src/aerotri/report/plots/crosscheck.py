"""The cross-check with other programs as a table and as a plot."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from aerotri.crosscheck.comparison import COVARIANCE_LIMIT, LIMIT, PATTERN_LIMIT, CrosscheckResult, PeerCheck
from aerotri.report.plots.canvas import ACCENT, GREY, INK, LIGHT, WIDTH, axes_at, new_figure, plain, styled
from aerotri.report.tables.adjustment import Column, Table

FEWEST_DECADES = 6
"""Powers of ten below the limit that are drawn at least; chosen [C]: pictures of different checks then look alike."""
MOST_STEPS = 400
"""Steps of a curve at most; chosen [C]: finer ones are below a pixel of the picture."""
LOOKS = {
    "projection centres": (INK, "-", 1.6),
    "orientation angles": (INK, (0, (5, 2)), 1.4),
    "object points": (ACCENT, "-", 2.2),
    "interior orientation": (GREY, (0, (1, 1.5)), 1.8),
    "additional parameters": (GREY, "-", 1.8),
    "GNSS shifts and drifts": (GREY, (0, (4, 1.5, 1, 1.5)), 1.6),
}
"""Colour, dashes and width of the lines, points: told apart without colours too."""


def crosscheck_table(result: CrosscheckResult) -> Table:
    """A row for every peer and kind of unknowns."""
    columns = (
        Column("peer"), Column("kind"), Column("count", "", "d"), Column("max |Δ|/σ", "", ".2e"),
        Column("RMS |Δ|/σ", "", ".2e"), Column("largest at"), Column("outcome"),
    )  # fmt: skip
    rows = []
    for check in result.checks:
        for d in check.differences:
            rows.append((check.peer, d.kind, d.count, d.max, d.rms, d.worst, _outcome(d.max, LIMIT)))
        if check.covariance is not None:
            c = check.covariance
            for what, value in (("σ of the orientation, relative", c.sigma), ("its correlations", c.correlation)):
                rows.append((check.peer, what, c.photographs, value, None, c.worst, _outcome(value, COVARIANCE_LIMIT)))
        if check.patterns is not None:
            p = check.patterns
            outcome = _outcome(p.max, PATTERN_LIMIT)
            rows.append((check.peer, "patterns, relative", len(p.names), p.max, None, p.worst, outcome))
        if check.solver:
            rows.append((check.peer, "vᵀPv, relative", None, abs(check.vtpv_difference), None, "", check.status))
        else:
            rows.append((check.peer, check.reason, None, None, None, "", check.status))
    return Table(f"Cross-check of {result.block}", columns, tuple(rows))


def _outcome(value: float, limit: float) -> str:
    return "agrees" if value <= limit else "differs"


@styled
def plot_crosscheck(result: CrosscheckResult) -> Figure:
    """Share of the unknowns whose |Δ|/σ stays below a value, for every peer and kind; the limit is marked."""
    shown = [check for check in result.checks if check.differences]
    rows = max(len(shown), 1)
    figure = new_figure(0.75 + 2.55 * rows, f"Cross-check – {plain(result.block)}", plain(result.sentence, 130))
    height = float(figure.get_size_inches()[1])
    if not shown:
        figure.text(0.5, 0.4, "no peer could be compared", ha="center", color=GREY)
        return figure
    left = _left_edge(shown)
    for row, check in enumerate(shown):
        axes = axes_at(figure, 0.75, height - 0.95 - 2.55 * row - 1.7, WIDTH - 3.1, 1.7)
        _draw(axes, check, left)
    return figure


def _left_edge(shown: list[PeerCheck]) -> float:
    """A power of ten below nearly all differences."""
    values = np.concatenate([d.normalised for check in shown for d in check.differences])
    values = values[np.isfinite(values) & (values > 0.0)]
    smallest = float(np.quantile(values, 0.02)) if len(values) else 1e-6
    return 10.0 ** min(np.floor(np.log10(smallest)), np.log10(LIMIT) - FEWEST_DECADES)


def _draw(axes: Axes, check: PeerCheck, left: float) -> None:
    right = 10.0
    axes.axvspan(LIMIT, right, color=LIGHT, alpha=0.45, lw=0)
    axes.axvline(LIMIT, color=INK, lw=0.9, ls=":")
    for d in check.differences:
        color, style, width = LOOKS[d.kind]
        share = np.linspace(0.0, 100.0, min(len(d.normalised), MOST_STEPS) + 1)
        at = np.percentile(np.nan_to_num(d.normalised, posinf=right), share, method="inverted_cdf")
        axes.step([*np.clip(at, left, right), right], [*share, 100.0], where="post", color=color, ls=style, lw=width,
                  label=f"{d.kind}\n{d.count}, largest {d.max:.1e}")  # fmt: skip
    axes.set_xscale("log")
    axes.set_xlim(left, right)
    axes.set_ylim(0.0, 104.0)
    axes.set_xlabel("|Δ|/σ, peer − ours")
    axes.set_ylabel("unknowns below [%]")
    axes.set_title(f"{check.peer}: {check.status}", loc="left", fontsize=9.5, weight="bold", pad=4)
    axes.text(LIMIT * 1.25, 6.0, f"limit {LIMIT:g}", fontsize=7.5, color=INK)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(loc="upper left", bbox_to_anchor=(1.02, 1.03), borderaxespad=0.0, fontsize=7.5, labelspacing=0.5,
                handlelength=2.6)  # fmt: skip
