"""Plots of a volume: the map of cut and fill, the budget of its σ, its sections."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap, TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, MaxNLocator

from aerotri.formats.results.volume import sigma_of_side
from aerotri.report.plots.canvas import (
    ACCENT,
    GREY,
    INK,
    LIGHT,
    WIDTH,
    axes_at,
    coordinate_text,
    new_figure,
    plain,
    styled,
    write_name,
)
from aerotri.report.quality import two_digits, with_sigma
from aerotri.volume.accuracy import BRIDGED, LASTING, MODEL
from aerotri.volume.boundary import Boundary
from aerotri.volume.compute import Volumes
from aerotri.volume.sections import Profile, Sections, direction_of
from aerotri.volume.thickness import ThicknessMap

HIGHEST = 6.4
"""Inches that a map is high at most: with its title it fits a printed page."""
CUT, FILL = "#7a2e0e", "#0b3d6b"
ONE_SIDED = 0.02
"""Share of the largest height from which both cut and fill are shown [C]: with less the other is noise at the edge."""
ZERO_LINE = (0, (1, 1.2))
# light in the middle and equally dark at both ends: in black and white the zero line tells the sides apart
# cells without a value: clear white, because clear black shows as a thin line where a PDF scales the picture
COLOURS = LinearSegmentedColormap.from_list("cut_and_fill", [FILL, "#8fb4d6", "#ffffff", "#dfa684", CUT]).with_extremes(
    bad=(1.0, 1.0, 1.0, 0.0)
)
WORDS = {
    "adjustment": "adjustment (orientation, self-calibration; all heights correlated)",
    MODEL: "image errors that photographs share",
    "matching": "matching of the points",
    LASTING: "matching, errors that neighbouring cells share",
    BRIDGED: "ground below objects, bridged",
    "interpolation": "ground between the points",
    "base": "base",
    "boundary": "position of the boundary",
}

SYSTEMATIC = {
    "free": "image errors uncorrected, calibrated orientation",
    "absorbed": "image errors uncorrected, orientation without parameters",
}
HATCH = "////"
LEAST = 0.001
"""m³, below which a volume is as good as none."""
BAR = 0.36
"""Inches of a row of bars; chosen [C]: its name of 8.5 points has room."""


@styled
def plot_thickness(found: ThicknessMap, boundary: Boundary, volumes: Volumes, content: Mapping[str, Any]) -> Figure:
    """Cut and fill as tones, zero as a bold line, the boundary, the sections' direction."""
    left, bottom, right, top = boundary.polygon.bounds
    margin = 0.04 * max(right - left, top - bottom)
    ratio = (top - bottom + 2 * margin) / (right - left + 2 * margin)
    width = min(WIDTH - 2.3, HIGHEST / ratio)
    height = width * ratio
    v = volumes.chosen
    subtitle = (
        f"surface less base: {plain(content['dtm'], 60)} over {plain(content['base']['name'], 60)}\n"
        f"cut {_with_its_sigma(v.cut, content, 'cut')} m³ on {_count(v.cut_area)} m², fill "
        f"{_with_its_sigma(v.fill, content, 'fill')} m³ on {_count(v.fill_area)} m²"
    )
    figure = new_figure(height + 1.95, "Cut and fill", subtitle)
    axes = axes_at(figure, 0.95, 0.95, width, height)
    finite = found.thickness[np.isfinite(found.thickness)]
    low, high = (float(value) for value in np.percentile(finite, [0.5, 99.5]))
    size = max(-low, high, 1e-6)
    has_both = min(-low, high) > ONE_SIDED * size
    norm = TwoSlopeNorm(0.0, -size, size)
    extent = found.grid.bounds
    image = axes.imshow(found.thickness, cmap=COLOURS, norm=norm, interpolation="nearest", aspect="auto",
                        extent=(extent[0], extent[2], extent[1], extent[3]), zorder=1)  # fmt: skip
    if has_both and min(found.thickness.shape) > 1:
        _mark_fill(axes, found)
    axes.add_collection(LineCollection(boundary.rings, colors=INK, linewidths=1.4, linestyles="-", zorder=3))
    _section_marks(axes, volumes.sections, boundary)
    for name, polygon in boundary.piles:
        write_name(axes, (polygon.representative_point().x, polygon.bounds[3] - 0.5 * margin), name)
    axes.set_xlim(left - margin, right + margin)
    axes.set_ylim(bottom - margin, top + margin)
    _coordinates(axes, width, height, content["crs"])
    scale = axes_at(figure, 0.95 + width + 0.15, 0.95, 0.16, height)
    bar = figure.colorbar(image, cax=scale)
    bar.set_label("surface − base [m]")
    scale.set_ylim(-size if has_both or high < -low else 0.0, size if has_both or high >= -low else 0.0)
    scale.yaxis.set_major_formatter(FuncFormatter(coordinate_text))
    handles: list[Artist] = [Line2D([], [], color=INK, lw=1.4, label="boundary"),
                             Line2D([], [], color=GREY, lw=0.7, ls=(0, (4, 3)), label="sections drawn")]  # fmt: skip
    if has_both:
        handles.append(Line2D([], [], color=INK, lw=1.2, ls=ZERO_LINE, label="surface on the base"))
        handles.append(Patch(facecolor=COLOURS(0.35), edgecolor=GREY, hatch=HATCH, lw=0.0, label="fill"))
    figure.legend(handles=handles, loc="center left", bbox_to_anchor=(0.9 / WIDTH, 0.25 / (height + 1.95)), ncols=4)
    return figure


def _with_its_sigma(value: float, content: Mapping[str, Any], name: str) -> str:
    """A cut or a fill to two digits of its σ; to three digits where no σ is known."""
    sigma = sigma_of_side(content, name)
    return _count(value) if sigma is None else with_sigma(value, sigma)


def _mark_fill(axes: Axes, found: ThicknessMap) -> None:
    """The line of zero, and hatches below it: in black and white fill is as dark as cut."""
    x, y = found.grid.x(np.arange(found.grid.columns)), found.grid.y(np.arange(found.grid.rows))
    thickness = np.ma.masked_invalid(found.thickness)
    axes.contour(x, y, thickness, levels=[0.0], colors=INK, linewidths=1.2, linestyles=[ZERO_LINE], zorder=2)
    below = axes.contourf(
        x, y, thickness, levels=[float(thickness.min()) - 1.0, 0.0], colors="none", hatches=[HATCH], zorder=2
    )
    below.set(edgecolor=GREY, linewidth=0.0)


@styled
def plot_budget(content: Mapping[str, Any]) -> Figure:
    """The parts of σ as bars, the total below them; what is no chance apart, with a scale of its own."""
    s = content["sigma"]
    parts = [(WORDS[name], s["parts_m3"][name]) for name in s["parts_m3"]]
    parts.append(("together (root of the sum of squares)", s["sigma_m3"]))
    apart = [] if s["curvature"] is None else [("ground beyond straight lines between points", s["curvature"])]
    apart += [(SYSTEMATIC[one["variant"]], one) for one in s["systematic"]["variants"]]
    share = 100.0 * s["sigma_m3"] / max(abs(content["net_m3"]), 1e-9)
    subtitle = (
        f"net {with_sigma(content['net_m3'], s['sigma_m3'])} m³ (1 σ, {two_digits(share)} %), "
        f"{two_digits(1e3 * s['sigma_mean_height_m'])} mm of mean height\n"
    )
    if apart:
        subtitle += f"hatched, with a scale of its own: {_hatched(s)}"
    upper, lower = BAR * len(parts), BAR * len(apart)
    figure = new_figure(upper + 1.6 + (lower + 0.75 if apart else 0.0), "How sure the volume is", subtitle)
    axes = axes_at(figure, 4.15, 0.6 + (lower + 0.75 if apart else 0.0), WIDTH - 5.35, upper)
    texts = [_count(value) if value > 0.0 else "none stated" for _, value in parts]
    if s["curvature"] is None:
        texts[list(s["parts_m3"]).index("interpolation")] = "not known"
    texts[-1] = _count(s["sigma_m3"])
    colours = [LIGHT] * len(s["parts_m3"]) + [ACCENT]
    _bars(axes, [name for name, _ in parts], [value for _, value in parts], texts, {"color": colours})
    axes.set_xlabel("σ [m³]")
    if apart:
        below = axes_at(figure, 4.15, 0.6, WIDTH - 5.35, lower)
        texts = [with_sigma(one["value_m3"], one["sigma_m3"], signed=True) for _, one in apart]
        hatched = {"color": "white", "edgecolor": INK, "hatch": "////", "lw": 0.8}
        _bars(below, [name for name, _ in apart], [one["value_m3"] for _, one in apart], texts, hatched)
        below.set_xlabel("change of the volume [m³]")
    return figure


def _hatched(s: Mapping[str, Any]) -> str:
    """What stands apart from the parts of σ."""
    held = "in the volume" if s["systematic"]["in_the_volume"] else "not in the volume"
    said = [f"uncorrected image errors ({held}, not in σ)"] if s["systematic"]["variants"] else []
    return ", ".join(said + ([] if s["curvature"] is None else ["ground between the points (in σ)"]))


def _bars(axes: Axes, labels: list[str], values: list[float], texts: list[str], style: dict[str, Any]) -> None:
    """Bars across, the first on top, each with its number; the size counts, the sign stands in the number."""
    at, size = -np.arange(len(labels)), np.abs(values)
    axes.barh(at, size, height=0.62, zorder=2, **style)
    for y, value, text in zip(at.tolist(), size, texts, strict=True):
        axes.text(value + 0.02 * size.max(), y, text, va="center", fontsize=8)
    axes.set_yticks(at, labels)
    axes.set_xlim(0.0, 1.35 * max(float(size.max()), 1e-9))
    axes.set_ylim(-len(labels) + 0.4, 0.6)
    axes.xaxis.set_major_locator(MaxNLocator(4))
    axes.xaxis.set_major_formatter(FuncFormatter(_count))
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(axis="y", length=0)


@styled
def plot_section_areas(sections: Sections, name: str) -> Figure:
    """Cut up, fill down over the station."""
    subtitle = f"{plain(name, 60)}; {len(sections.station)} sections every {sections.spacing:.4g} m, " + (
        f"following one another towards {sections.azimuth:g}°"
    )
    figure = new_figure(3.2, "Areas of the cross sections", subtitle)
    axes = axes_at(figure, 0.95, 0.62, WIDTH - 1.3, 1.75)
    axes.fill_between(sections.station, sections.sums[:, 0], color="#dfa684", lw=0, zorder=1)
    axes.fill_between(sections.station, -sections.sums[:, 1], color="#8fb4d6", lw=0, zorder=1)
    axes.plot(sections.station, sections.sums[:, 0], color=CUT, marker=".", ms=3, zorder=2)
    axes.plot(sections.station, -sections.sums[:, 1], color=FILL, marker=".", ms=3, ls="--", zorder=2)
    axes.axhline(0.0, color=INK, lw=0.8)
    axes.margins(x=0.01)
    axes.set_xlabel("station [m]")
    axes.set_ylabel("area [m²]")
    axes.yaxis.set_major_formatter(FuncFormatter(coordinate_text))
    axes.spines[["top", "right"]].set_visible(False)
    handles = [Line2D([], [], color=CUT, label="cut"), Line2D([], [], color=FILL, ls="--", label="fill (downwards)")]
    figure.legend(handles=handles, loc="center left", bbox_to_anchor=(0.9 / WIDTH, 0.14 / 3.2), ncols=2)
    return figure


@styled
def plot_section_profiles(profiles: Sequence[Profile], name: str) -> Figure:
    """Some sections: the surface, the base, cut and fill between them inside the boundary."""
    each = 1.55
    height = each * len(profiles) + 1.35
    figure = new_figure(height, "Cross sections", f"{plain(name, 60)}; heights and distances in m, heights exaggerated")
    for k, p in enumerate(profiles):
        axes = axes_at(figure, 0.95, height - 0.75 - (k + 1) * each + 0.45, WIDTH - 1.3, each - 0.55)
        over, under = p.inside & (p.surface >= p.base), p.inside & (p.surface < p.base)
        axes.fill_between(p.distance, p.base, p.surface, where=over.tolist(), color="#dfa684", lw=0, zorder=1)
        axes.fill_between(p.distance, p.base, p.surface, where=under.tolist(), color="#8fb4d6", lw=0, hatch="///",
                          edgecolor="white", zorder=1)  # fmt: skip
        axes.plot(p.distance, p.surface, color=INK, lw=1.1, zorder=3)
        axes.plot(p.distance, p.base, color=GREY, lw=1.0, ls="--", zorder=2)
        axes.margins(x=0.01)
        axes.set_title(f"station {p.station:.4g} m", fontsize=8.5, loc="left", pad=2)
        axes.yaxis.set_major_locator(MaxNLocator(4))
        axes.spines[["top", "right"]].set_visible(False)
        if k == len(profiles) - 1:
            axes.set_xlabel("distance [m]")
    handles = [
        Line2D([], [], color=INK, lw=1.1, label="surface"), Line2D([], [], color=GREY, ls="--", label="base"),
        Patch(color="#dfa684", label="cut"), Patch(facecolor="#8fb4d6", edgecolor="white", hatch="///", label="fill"),
    ]  # fmt: skip
    figure.legend(handles=handles, loc="center left", bbox_to_anchor=(0.9 / WIDTH, 0.17 / height), ncols=4)
    return figure


def _section_marks(axes: Axes, sections: Sections, boundary: Boundary) -> None:
    along = direction_of(sections.azimuth)
    across = np.array([along[1], -along[0]])
    reach = (np.concatenate(boundary.rings) - sections.origin) @ across
    ends = np.array([reach.min(), reach.max()])[:, None] * across
    lines = [sections.origin + s * along + ends for s in sections.chosen()]
    axes.add_collection(LineCollection(lines, colors=GREY, linewidths=0.7, linestyles=[(0, (4, 3))], zorder=3))


def _coordinates(axes: Axes, width: float, height: float, crs: str) -> None:
    axes.xaxis.set_major_locator(MaxNLocator(max(2, int(width / 1.1)), steps=[1, 2, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(max(2, int(height / 0.8)), steps=[1, 2, 5, 10]))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(coordinate_text))
    axes.set_xlabel("E [m]" if crs else "X [m]")
    axes.set_ylabel("N [m]" if crs else "Y [m]")


def _count(value: float, place: int | None = None) -> str:
    """A number of cubic metres with thin spaces between thousands; small ones with three digits."""
    if 0.0 < value < LEAST:
        return f"< {LEAST:g}"
    text = f"{value:,.0f}" if abs(value) >= 100.0 else f"{value:.3g}"
    return text.replace(",", "\u2009").replace("-", "−")
