"""Residuals by image column and row, and by photograph."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from aerotri.image_errors.residual_profiles import ResidualProfile, ResidualProfiles
from aerotri.report.plots.canvas import GREY, INK, LIGHT, WIDTH, axes_at, new_figure, plain, styled
from aerotri.report.quality import two_digits
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.statistics.photograph_residuals import PhotographResiduals

MOST_CAMERAS = 3
"""Cameras whose curves are drawn; chosen [C]: all are tested."""
PANEL = 1.45
"""Inches a panel is high."""
MOST_DOTS = 3000
"""Photographs that are drawn, those with the largest residuals always; chosen [C]: more are not told apart."""
NAMED = 5
"""Photographs that are named at most, of those beyond chance; chosen [C]: the table has more."""


@styled
def plot_residual_profiles(found: ResidualProfiles, name: str) -> Figure | None:
    """Means of measured − adjusted with their σ in bins along columns and rows; dark where more than noise.

    Returns
    -------
    None where there are too few photographs.
    """
    profiles = found.profiles[: 2 * MOST_CAMERAS]
    if not profiles:
        return None
    rows = (len(profiles) + 1) // 2
    high = rows * (2 * PANEL + 0.75)
    figure = new_figure(high + 0.95, f"Residuals by column and row – {plain(name)}", profiles_text(found))
    width = (WIDTH - 1.9) / 2.0
    reach = max(float(np.nanmax(np.abs(one.mean) + one.sigma)) for one in profiles)
    for number, profile in enumerate(profiles):
        left = 0.85 + (number % 2) * (width + 0.7)
        bottom = high - (number // 2 + 1) * (2 * PANEL + 0.75) + 0.5
        for component in (0, 1):
            axes = axes_at(figure, left, bottom + (1 - component) * (PANEL + 0.05), width, PANEL - 0.1)
            _draw_curve(axes, profile, component, found.limit, 1.08 * reach)
        title = f"along the {('columns', 'rows')[profile.axis]}"
        several = len({one.camera.name for one in found.profiles}) > 1
        figure.text(
            left / WIDTH, (bottom + 2 * PANEL) / (high + 0.95),
            f"{plain(profile.camera.name, 20)}: {title}" if several else title[0].upper() + title[1:],
            fontsize=9, va="bottom",
        )  # fmt: skip
    return figure


def profiles_text(found: ResidualProfiles) -> str:
    """What the test says, in two lines."""
    if not np.isfinite(found.p):
        return "too few photographs for a test"
    says = "systematic errors are left" if found.systematic else "no more than noise"
    chance = f"{100 * found.p:.1f} %" if found.p >= 0.0025 else "less than 0.3 %"
    return (
        f"mean of measured − adjusted with σ; {says}: the largest mean is {found.largest:.1f} σ,\n"
        f"which chance reaches in {chance} of the cases (95 % limit of all means together: {found.limit:.1f} σ)"
    )


def _draw_curve(axes: Axes, profile: ResidualProfile, component: int, limit: float, reach: float) -> None:
    middle = 0.5 * (profile.edges[:-1] + profile.edges[1:])
    mean, sigma = profile.mean[:, component], profile.sigma[:, component]
    strong = profile.t[:, component] > limit
    axes.axhline(0.0, color=GREY, lw=0.8)
    axes.plot(middle, mean, color=LIGHT, lw=1.0, zorder=1)
    for own, color, face in ((~strong, GREY, "white"), (strong, INK, INK)):
        own = own & np.isfinite(mean)
        axes.errorbar(middle[own], mean[own], sigma[own], ls="none", marker="o", ms=3.2, mfc=face, mec=color,
                      ecolor=color, elinewidth=0.9, capsize=1.5, zorder=2)  # fmt: skip
    axes.set_xlim(0.0, profile.edges[-1])
    axes.set_ylim(-reach, reach)
    axes.set_ylabel(f"{'xy'[component]} [px]")
    if component == 0:
        axes.tick_params(labelbottom=False)
    else:
        axes.set_xlabel(f"{('column', 'row')[profile.axis]} [px]")
    axes.spines[["top", "right"]].set_visible(False)


@styled
def plot_photograph_residuals(found: PhotographResiduals, adjusted: AdjustedBlock) -> Figure | None:
    """RMS of the residuals of every photograph, in the order of the block; the worst beyond chance are named.

    Returns
    -------
    None where no photograph has residuals.
    """
    order = found.worst_first
    if not len(order):
        return None
    rms = np.sqrt(np.mean(found.rms_px**2, axis=1))
    whole = float(np.sqrt(np.mean(found.rms_all_px**2)))
    beyond = found.beyond
    says = f"beyond chance (95 %, all photographs together): {int(beyond.sum())} of {len(order)} photographs"
    text = f"RMS of all: x {two_digits(found.rms_all_px[0])}, y {two_digits(found.rms_all_px[1])} px; {says}"
    if len(order) > MOST_DOTS:
        text += f"\ndrawn: the {MOST_DOTS} photographs with the largest"
    figure = new_figure(3.6, f"Residuals by photograph – {plain(adjusted.block.name)}", text)
    axes = axes_at(figure, 0.85, 0.75, WIDTH - 1.15, 2.0)
    shown = order[:MOST_DOTS]
    for own, face, size in ((~beyond[shown], "white", 2.6), (beyond[shown], INK, 3.6)):
        axes.plot(shown[own] + 1, rms[shown[own]], ls="none", marker="o", ms=size, mfc=face, mec=INK, mew=0.6)
    axes.axhline(whole, color=GREY, lw=1.0, ls=(0, (6, 2)))
    axes.set_xlim(0.5, len(rms) + 0.5)
    axes.set_ylim(0.0, 1.2 * float(np.nanmax(rms)))
    axes.set_xlabel("number of the photograph in the block")
    axes.set_ylabel("RMS of a coordinate [px]")
    axes.spines[["top", "right"]].set_visible(False)
    _name_worst(axes, adjusted, order[beyond[order]][:NAMED], rms)
    handles = [Line2D([], [], color=GREY, lw=1.0, ls=(0, (6, 2)), label="all photographs"),
               Line2D([], [], ls="none", marker="o", ms=3.6, color=INK, label="beyond chance")]  # fmt: skip
    figure.legend(handles=handles, loc="lower right", bbox_to_anchor=(1.0 - 0.3 / WIDTH, 0.02), ncols=2)
    return figure


def _name_worst(axes: Axes, adjusted: AdjustedBlock, rows: np.ndarray, rms: np.ndarray) -> None:
    """Names of photographs, none over another one or over the dot of a neighbour."""
    taken: list[float] = []
    low, high = axes.get_xlim()
    for row in rows.tolist():
        name = plain(adjusted.block.images.names[row], 30)
        room = (0.064 * len(name) + 0.1) / (WIDTH - 1.15) * (high - low)
        if any(abs(row - other) < room for other in taken):
            continue
        taken.append(row)
        late = row + room > high
        beside = rms[int(max(row - room, 0)) : row + 1] if late else rms[row : int(row + room) + 2]
        axes.annotate(name, (row + 1, float(np.nanmax(beside))), fontsize=7,
                      xytext=(-3 if late else 3, 4), textcoords="offset points", ha="right" if late else "left",
                      annotation_clip=False)  # fmt: skip
