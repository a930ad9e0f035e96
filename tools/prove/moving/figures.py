"""The pictures of docs/validation/what_moves.md."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

import aerotri
from aerotri import drawing
from moving.correlations import Products
from moving.crab import CrabEffect
from moving.strips import SET, StripValues


def save(figure: Figure, path: Path) -> None:
    """A PNG of few colours."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    with Image.open(path) as picture:
        few = picture.convert("RGB").quantize(64)
    few.save(path, optimize=True)


@drawing.styled
def draw_strips(values: StripValues, chosen: list[str], title: str) -> Figure:
    """Deviations of parameters from their mean over time, the directions of flight with different marks."""
    figure = drawing.new_figure(
        5.8, title, "deviation from the mean of all strips, µm of image error (RMS over the image), ± σ"
    )
    for place, name in enumerate(chosen):
        k = values.names.index(name)
        axes = drawing.axes_at(figure, 0.75 + 2.65 * (place % 3), 3.2 - 2.3 * (place // 3), 2.2, 1.55)
        points(axes, values, values.value[:, k], values.sigma[:, k])
        axes.set_title(name.replace("legendre.", ""), fontsize=9)
        axes.set_xlabel("minutes from the first photograph")
    handles = figure.axes[0].get_legend_handles_labels()
    figure.legend(*handles, loc="lower center", ncols=4, bbox_to_anchor=(0.5, 0.0))
    return figure


def points(axes, values: StripValues, y: np.ndarray, sigma: np.ndarray) -> None:
    """One series over time."""
    y = y - np.average(y, weights=sigma**-2.0)
    minutes = values.time / 60.0
    axes.axhline(0.0, color=drawing.LIGHT, lw=0.8)
    if values.landing.max():
        at = 0.5 * (minutes[values.landing == 0].max() + minutes[values.landing == 1].min())
        axes.axvline(at, color=drawing.GREY, lw=0.8, ls=":", label="the drone lands")
    for way, (mark, face, label) in enumerate(
        (("o", "white", "flown to the NW"), ("s", drawing.INK, "flown to the SE"))
    ):
        own = values.way == way
        axes.errorbar(
            minutes[own], y[own], sigma[own], fmt=mark, color=drawing.INK, mfc=face, ms=4.5, lw=0.8, label=label
        )


@drawing.styled
def draw_crab(values: StripValues, effect: CrabEffect, name: str) -> Figure:
    """One parameter of the groups against the crab angle, with what is expected."""
    k = values.names.index(name)
    figure = drawing.new_figure(
        3.3,
        f"{name.removeprefix('legendre.')} of the strips against the crab angle",
        "deviation from the mean, µm of image error, ± σ; line: expected from a constant error not in the set",
    )
    axes = drawing.axes_at(figure, 0.8, 0.65, 4.6, 1.95)
    y = values.value[:, k] - values.value[:, k].mean()
    away = effect.crab - effect.crab.mean()
    for way, (mark, face, label) in enumerate(
        (("o", "white", "flown to the NW"), ("s", drawing.INK, "flown to the SE"))
    ):
        own = values.way == way
        axes.errorbar(
            effect.crab[own],
            y[own],
            values.sigma[own, k],
            fmt=mark,
            color=drawing.INK,
            mfc=face,
            ms=5,
            lw=0.8,
            label=label,
        )
    ends = np.array([effect.crab.min() - 0.2, effect.crab.max() + 0.2])
    axes.plot(ends, effect.expected[k] * (ends - effect.crab.mean()), color=drawing.ACCENT, lw=1.4)
    odd = np.flatnonzero((values.way == 0) & (away > 0.0))
    for row in odd:
        axes.annotate(
            "flown to the NW after the landing,\nturned like the others flown to the SE",
            (effect.crab[row], y[row]),
            (effect.crab[row] - 3.3, y[row] - 0.17),
            arrowprops={"arrowstyle": "-", "color": drawing.GREY, "lw": 0.8},
            fontsize=8,
        )
    axes.set_xlabel("crab angle, degrees")
    figure.legend(loc="center left", bbox_to_anchor=(0.66, 0.5))
    return figure


@drawing.styled
def draw_interior(values: StripValues) -> Figure:
    """c, x0, y0 of the strips over time."""
    figure = drawing.new_figure(
        3.1, "Interior orientation of the strips", "deviation from the mean of all strips, µm, ± σ"
    )
    for k, name in enumerate(("principal distance c", "principal point x0", "principal point y0")):
        axes = drawing.axes_at(figure, 0.75 + 2.65 * k, 0.95, 2.2, 1.3)
        points(axes, values, values.interior[:, k], np.sqrt(np.diagonal(values.interior_covariance[k])))
        axes.set_title(name, fontsize=9)
        axes.set_xlabel("minutes from the first photograph")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="lower center", ncols=4, bbox_to_anchor=(0.5, 0.0))
    return figure


def field_of(values: StripValues, camera, amounts: np.ndarray, nx: int = 17) -> tuple[np.ndarray, np.ndarray]:
    """Image positions (n, 2) mm and image errors (n, 2) µm of amounts (K,) µm of the parameters."""
    bx, by = camera.half_format_mm
    ny = round(nx * by / bx)
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(-bx, bx, nx), np.linspace(-by, by, ny)))
    at = np.stack([x, y], axis=1)
    unit = aerotri.parameters.patterns(SET, camera, at)[1]
    return at, 1e3 * unit @ (amounts / values.size)


@drawing.styled
def draw_fields(values: StripValues, camera, fields: dict[str, np.ndarray], title: str, subtitle: str) -> Figure:
    """Image errors of amounts of the parameters, one panel each, all on one scale."""
    drawn = {name: field_of(values, camera, amounts) for name, amounts in fields.items()}
    lengths = np.concatenate([np.linalg.norm(d, axis=1) for _, d in drawn.values()])
    per_inch, size = drawing.per_inch_for(lengths, 0.42)
    bx, by = camera.half_format_mm
    width = 3.9
    height = width * by / bx
    figure = drawing.new_figure(height + 1.55, title, subtitle)
    for place, (name, (at, d)) in enumerate(drawn.items()):
        axes = drawing.axes_at(figure, 0.3 + 4.2 * place, 0.5, width, height)
        axes.set_xlim(-1.15 * bx, 1.15 * bx)
        axes.set_ylim(-1.15 * by, 1.15 * by)
        axes.set_xticks([])
        axes.set_yticks([])
        axes.set_title(name, fontsize=9)
        drawn_vectors = drawing.vectors(axes, at, d, per_inch, drawing.ACCENT if place else drawing.INK)
        if not place:
            drawing.scale_vector(axes, drawn_vectors, size, per_inch, f"{size:g} µm", 0.5, 0.25)
    figure.text(
        0.98,
        0.02,
        "image: x to the right, across the flight; flight upwards",
        ha="right",
        color=drawing.GREY,
        fontsize=8,
    )
    return figure


@drawing.styled
def draw_correlations(
    within: dict[str, dict[tuple[float, float], Products]], places: dict[str, dict[str, Products]]
) -> Figure:
    """Correlation of residuals: within photographs by distance, and of the same point in two photographs of a strip."""
    figure = drawing.new_figure(
        3.6,
        "Correlation of residuals",
        "left: two rays of one photograph; right: the same point in two photographs of a strip",
    )
    left, right = drawing.axes_at(figure, 0.8, 0.6, 3.3, 2.2), drawing.axes_at(figure, 5.0, 0.6, 3.3, 2.2)
    styles = (("-", drawing.INK), (":", drawing.GREY), ("--", drawing.ACCENT))
    for number, (name, found) in enumerate(within.items()):
        line, color = styles[number]
        middle = [np.sqrt(max(low, 10.0) * high) for low, high in found]
        for k, mark in enumerate("os"):
            y = [one.correlation[k] for one in found.values()]
            s = [one.sigma[k] for one in found.values()]
            left.errorbar(
                middle,
                y,
                s,
                fmt=mark + line,
                color=color,
                mfc="white" if k == 0 else color,
                ms=4,
                lw=1.0,
                label=f"{'xy'[k]}, {name}",
            )
    for number, (name, found) in enumerate(places.items()):
        line, color = styles[number]
        own = {int(key.split()[2]): one for key, one in found.items() if key.startswith("same strip")}
        for k, mark in enumerate("os"):
            right.errorbar(
                list(own),
                [one.correlation[k] for one in own.values()],
                [one.sigma[k] for one in own.values()],
                fmt=mark + line,
                color=color,
                mfc="white" if k == 0 else color,
                ms=4,
                lw=1.0,
                label=f"{'xy'[k]}, {name}",
            )
    for axes in (left, right):
        axes.axhline(0.0, color=drawing.LIGHT, lw=0.8)
        axes.set_ylabel("correlation")
    left.set_xscale("log")
    left.set_xlabel("distance in the image, px")
    left.legend()
    right.set_xlabel("photographs from one to the other")
    return figure


@drawing.styled
def draw_rose(shares: dict[str, np.ndarray], azimuths: np.ndarray, marks: dict[str, float], limit: float) -> Figure:
    """Where points seem to move from one strip to a later one: large differences by azimuth, beside white noise."""
    figure = drawing.new_figure(
        4.1,
        "Points that two strips see at different places",
        f"share of points whose place differs by over {100 * limit:.0f} cm, by direction from the earlier strip",
    )
    axes = figure.add_axes((0.06, 0.06, 0.5, 0.74), projection="polar")
    axes.set_theta_zero_location("N")
    axes.set_theta_direction(-1)
    step = np.radians(azimuths[1] - azimuths[0])
    (name, measured), *others = shares.items()
    axes.bar(
        np.radians(azimuths),
        100 * measured,
        width=0.9 * step,
        color=drawing.LIGHT,
        edgecolor=drawing.INK,
        lw=0.6,
        label=name,
    )
    ring = np.radians(np.append(azimuths, azimuths[0]))
    for (name, own), line in zip(others, ("-", ":"), strict=True):
        axes.plot(ring, 100 * np.append(own, own[0]), color=drawing.INK, lw=1.2, ls=line, label=f"simulated: {name}")
    top = 105 * measured.max()
    for (name, azimuth), line in zip(marks.items(), ("-", "--", "-."), strict=True):
        axes.plot([np.radians(azimuth)] * 2, [0.0, top], color=drawing.ACCENT, lw=1.8, ls=line, label=name)
    axes.set_rmax(top)
    axes.set_rlabel_position(225)
    axes.set_xticks(np.radians([0, 90, 180, 270]), ["N", "E", "S", "W"])
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g} %")
    figure.legend(loc="center left", bbox_to_anchor=(0.58, 0.45))
    return figure
