"""Plots of numbers against numbers: the histogram of residuals and the correlations of the shared parameters."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from aerotri.adjustment.ray_status import RayStatus
from aerotri.conventions import counted
from aerotri.report.plots.canvas import ACCENT, GREY, INK, LIGHT, WIDTH, axes_at, new_figure, plain, styled, value_text
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.ray_correlation import RayCorrelation

BINS = 60
"""Bars of the histogram; chosen [C]: fewer hide the shape of the tails, more show chance."""
MOST_PARAMETERS = 90
"""Parameters drawn, beyond which GNSS shifts are left out first; chosen [C]: a cell is then still wider than a line."""
LEAST_P = 1e-6
"""Probabilities below are not told apart [C]."""
MOST_LABELS = 60
"""Names along a side; chosen [C]: with more they overlap, and every second stands."""


@styled
def plot_residual_histogram(adjusted: AdjustedBlock) -> Figure:
    """Residuals vx, vy of the rays used, with the normal curve they should follow.

    A residual varies by σ̂0·√r, not by σ̂0: part of every error is absorbed by the unknowns. The curve has σ̂0·√r̄, r̄ the
    mean redundancy number; σ̂0 itself is marked.
    """
    used = adjusted.rays.status == RayStatus.USED
    v = 1e3 * adjusted.rays.v[used]
    v = v[np.isfinite(v).all(axis=1)]
    r = adjusted.rays.r[used]
    mean_r = float(np.nanmean(r)) if np.isfinite(r).any() else 1.0
    sigma0, sigma = adjusted.outcome.sigma0_um, adjusted.outcome.sigma0_um * np.sqrt(mean_r)
    reach = 4.5 * sigma if np.isfinite(sigma) and sigma > 0 else 1.0
    beyond = int(np.sum(np.abs(v) > reach))
    rms = np.sqrt(np.mean(v**2, axis=0)) if len(v) else np.full(2, np.nan)
    subtitle = (
        f"{len(v)} rays; RMS vx {rms[0]:.2f} µm, vy {rms[1]:.2f} µm; σ₀ {sigma0:.2f} µm; "
        f"{beyond} of {v.size} residuals lie beyond the axis"
    )
    figure = new_figure(4.45, f"Residuals of the image coordinates – {plain(adjusted.block.name)}", subtitle)
    axes = axes_at(figure, 0.95, 0.9, WIDTH - 1.25, 2.35)
    edges = np.linspace(-reach, reach, BINS + 1)
    vx, vy = (np.histogram(v[:, k], edges)[0] for k in (0, 1))
    axes.stairs(vx, edges, fill=True, color=LIGHT)
    axes.stairs(vy, edges, color=INK, lw=1.2)
    curve = np.linspace(-reach, reach, 300)
    density = np.exp(-0.5 * (curve / sigma) ** 2) / (sigma * np.sqrt(2 * np.pi)) if sigma > 0 else 0 * curve
    axes.plot(curve, density * len(v) * (edges[1] - edges[0]), color=ACCENT, lw=1.8, ls=(0, (6, 2)))
    for sign in (-1, 1):
        axes.axvline(sign * sigma0, color=GREY, lw=0.9, ls=":")
    axes.set_xlim(-reach, reach)
    axes.set_ylim(0, None)
    axes.yaxis.set_major_locator(MaxNLocator(5, integer=True))
    axes.set_xlabel("residual (adjusted − measured) [µm]")
    axes.set_ylabel("residuals [count]")
    _pixel_axis(adjusted, axes)
    _histogram_legend(figure, sigma)
    return figure


def _pixel_axis(adjusted: AdjustedBlock, axes: Axes) -> None:
    """The same in pixels along the top, where all cameras have one size of pixel."""
    sizes = {camera.pixel_um for camera in adjusted.block.cameras}
    if len(sizes) == 1:
        pixel = sizes.pop()
        top = axes.secondary_xaxis(
            "top", functions=(lambda um: np.asarray(um) / pixel, lambda px: np.asarray(px) * pixel)
        )
        top.set_xlabel("[px]")
        top.tick_params(length=3, width=0.8)
    else:
        axes.spines[["top", "right"]].set_visible(False)


def _histogram_legend(figure: Figure, sigma: float) -> None:
    handles = [
        Patch(color=LIGHT, label="vx"),
        Line2D([], [], color=INK, label="vy"),
        Line2D([], [], color=ACCENT, lw=1.8, ls=(0, (6, 2)), label=f"normal curve, σ = σ₀·√(mean r) = {sigma:.2f} µm"),
        Line2D([], [], color=GREY, lw=0.9, ls=":", label="±σ₀"),
    ]
    width, height = figure.get_size_inches()
    figure.legend(handles=handles, loc="center left", bbox_to_anchor=(0.85 / width, 0.25 / height), ncols=4,
                  borderaxespad=0.0, handletextpad=0.6, columnspacing=1.8)  # fmt: skip


@styled
def plot_ray_correlation(found: RayCorrelation, block_name: str) -> Figure:
    """How much residuals of two image points of one photograph are alike, by their distance.

    Raises
    ------
    ValueError
        When there is no class of distances with enough pairs.
    """
    known = np.flatnonzero(np.isfinite(found.correlation).any(axis=1))
    if not len(known):
        raise ValueError("no two image points of a photograph are near enough to one another")
    chance = f"{found.p:.2g}" if found.p >= LEAST_P else f"below {LEAST_P:.7f}".rstrip("0")
    beyond = "; above 1: near rays scatter more than all" if (found.correlation[known] > 1.0).any() else ""
    subtitle = (
        f"{int(found.pairs[known].sum())} pairs of rays; bars: ±2 σ{beyond}\n"
        f"probability that chance alone makes rays up to {found.near_px:.3g} px so alike: {chance}"
    )
    figure = new_figure(3.75, f"Residuals of neighbouring image points – {plain(block_name)}", subtitle)
    axes = axes_at(figure, 0.95, 0.9, WIDTH - 1.25, 1.95)
    place = np.arange(len(known))
    for axis, (letter, marker, face) in enumerate((("x", "o", "white"), ("y", "s", INK))):
        axes.errorbar(place + 0.12 * (2 * axis - 1), found.correlation[known, axis], 2.0 * found.sigma[known, axis],
                      fmt=marker, color=INK, mfc=face, ms=5, lw=1.0, capsize=2.5,
                      label=f"residuals in {letter}")  # fmt: skip
    axes.axhline(0.0, color=GREY, lw=0.9, ls=":")
    limits = [f"{found.limits_px[k]:.0f} to {found.limits_px[k + 1]:.0f}" for k in known]
    axes.set_xticks(place, limits)
    axes.set_xlim(-0.5, len(known) - 0.5)
    axes.set_xlabel("distance of two image points of a photograph [px]")
    axes.set_ylabel("correlation")
    axes.spines[["top", "right"]].set_visible(False)
    width, height = figure.get_size_inches()
    figure.legend(loc="center left", bbox_to_anchor=(0.85 / width, 0.25 / height), ncols=2, borderaxespad=0.0)
    return figure


def correlated_parameters(adjusted: AdjustedBlock) -> np.ndarray:
    """Rows of the shared parameters that have a correlation to show.

    Nodes of a grid have none of interest. Where there are too many to read, GNSS parameters are left out first, then
    what exceeds the number.
    """
    p = adjusted.parameters
    free = np.isin(p.status, ("estimated", "weighted")) & (np.diagonal(p.covariance) > 0.0) & ~p.is_node
    if free.sum() > MOST_PARAMETERS:
        free &= p.kinds != "gnss"
    return np.flatnonzero(free)[:MOST_PARAMETERS]


@styled
def plot_correlations(adjusted: AdjustedBlock) -> Figure:
    """Correlations of the shared parameters as a map: darkness is size, a dash marks negative ones.

    Raises
    ------
    ValueError
        When there are less than two parameters.
    """
    rows = correlated_parameters(adjusted)
    if len(rows) < 2:
        raise ValueError("correlations need at least two estimated parameters")
    p = adjusted.parameters
    sigma = p.sigma[rows]
    r = p.covariance[np.ix_(rows, rows)] / np.outer(sigma, sigma)
    np.fill_diagonal(r, np.nan)
    groups = len(np.unique(p.groups[rows]))
    labels = [plain(f"{p.groups[i]} {p.names[i]}" if groups > 1 else p.names[i], 24) for i in rows]
    room = 0.2 + 0.062 * max(len(label) for label in labels)
    side = float(np.clip(0.16 * len(rows), 2.6, WIDTH - room - 1.5))
    figure = new_figure(side + room + 1.0, f"Correlations of the parameters – {plain(adjusted.block.name)}",
                        _strongest(adjusted, rows, labels, r))  # fmt: skip
    axes = axes_at(figure, room + 0.15, room + 0.25, side, side)
    image = axes.imshow(r, cmap=_color_map(), vmin=-1, vmax=1, interpolation="nearest")
    _mark_negative(axes, r, side)
    step = int(np.ceil(len(rows) / MOST_LABELS))
    size = float(np.clip(72 * 0.8 * side / len(rows), 4.5, 8))
    axes.set_xticks(range(0, len(rows), step), labels[::step], rotation=90, fontsize=size)
    axes.set_yticks(range(0, len(rows), step), labels[::step], fontsize=size)
    bar = axes_at(figure, room + 0.15 + side + 0.25, room + 0.25, 0.18, min(side, 3.0))
    figure.colorbar(image, cax=bar, ticks=[-1, -0.5, 0, 0.5, 1]).set_label("correlation r (dash: negative)")
    return figure


def _strongest(adjusted: AdjustedBlock, rows: np.ndarray, labels: list[str], r: np.ndarray) -> str:
    limit = adjusted.block.settings.adjustment.correlation_limit
    size = np.abs(np.nan_to_num(r))
    i, j = np.unravel_index(np.argmax(size), r.shape)
    left_out = len(adjusted.parameters) - len(rows)
    return (
        f"strongest: {labels[i]} with {labels[j]}, r = {value_text(float(f'{r[i, j]:.2f}'))}; "
        f"{counted(int((size > limit).sum() / 2), 'pair')} beyond ±{limit:g}"
        + (f"; {left_out} parameters held, removed or left out" if left_out else "")
    )


def _color_map():
    """Light in the middle and equally dark at both ends, so that a black and white print keeps the size of r."""
    from matplotlib.colors import LinearSegmentedColormap

    colors = LinearSegmentedColormap.from_list("correlation", ["#7a2e0e", "#d98a5b", "#ffffff", "#6f9fd0", "#123c73"])
    return colors.with_extremes(bad="#d5d9dd")


def _mark_negative(axes: Axes, r: np.ndarray, side: float) -> None:
    row, column = np.nonzero(np.nan_to_num(r) < -0.3)
    dash = 72 * 0.45 * side / len(r)
    axes.scatter(column, row, marker="_", s=dash**2, c="white", linewidths=0.9)
