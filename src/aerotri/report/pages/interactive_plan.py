"""The block plan as SVG that a script of the page lets zoom, pan and answer; without the script it is a plain drawing.

Drawn in metres from the middle of the block, y down. Names are text content, never markup.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import ndtri

from aerotri.conventions import MGON_PER_RADIAN
from aerotri.report.plots import plan
from aerotri.report.plots.canvas import length_text, nice_number
from aerotri.report.quality import metre_digits, printable
from aerotri.results.adjusted_block import AdjustedBlock, GroundPointResults

WIDTH_PX = 980.0
"""Width at which symbols have their sizes before the script measures the page."""
HIGHEST = 0.72
"""Of the width: taller blocks are drawn smaller."""
WORST_POINTS = 200
"""Points with suspicious rays that a page lets be chosen; chosen [C]: more make the page heavy and the plan crowded."""


@dataclass(frozen=True)
class Spot:
    """A place that answers: kind ('photograph', 'control', 'check' or 'point'), metres, name and lines of text."""

    kind: str
    x: float
    y: float
    name: str
    text: str
    outline: tuple[float, ...] = ()


@dataclass(frozen=True)
class InteractivePlan:
    """What the template draws.

    Parameters
    ----------
    view : left, top, width, height, m. unit : metres per pixel at first. footprints, strips : path data.
    spots : the photographs, points and residuals. bar, bar_text : scale bar, m.
    """

    view: tuple[float, float, float, float]
    unit: float
    footprints: str
    strips: str
    spots: tuple[Spot, ...]
    bar: float
    bar_text: str
    axes: tuple[str, str]
    origin: tuple[float, float]

    def of_kind(self, kind: str) -> list[Spot]:
        """The spots of a kind."""
        return [spot for spot in self.spots if spot.kind == kind]

    @property
    def data(self) -> list[list[Any]]:
        """For the script: kind, x, y, name, text, outline."""
        return [[s.kind, s.x, s.y, s.name, s.text, list(s.outline)] for s in self.spots]


def interactive_plan(adjusted: AdjustedBlock) -> InteractivePlan:
    """The plan of a block: footprints, strips, photographs, control and check points, points with large residuals."""
    corners = plan.footprints(adjusted)
    ground = [plan.ground_point_xy(adjusted, r.point) for r in (adjusted.control, adjusted.check)]
    extent = plan.extent_of(corners, adjusted.images.centre[:, :2], *ground)
    extent = extent.widened(0.03 * extent.width, 0.03 * extent.height)
    height = max(extent.height, 0.25 * extent.width)
    width = max(extent.width, height / HIGHEST)
    middle = np.array([extent.left + extent.right, extent.bottom + extent.top]) / 2.0
    unit = width / WIDTH_PX
    digits = max(0, int(np.ceil(-np.log10(unit))) + 1)

    def here(xy: np.ndarray) -> np.ndarray:
        return np.round((xy - middle) * (1.0, -1.0), digits)

    bar = nice_number(0.2 * width)
    spots = [*_photographs(adjusted, here, corners), *_worst_points(adjusted, here)]
    for kind, results, xy in zip(("control", "check"), (adjusted.control, adjusted.check), ground, strict=True):
        spots += _ground_spots(adjusted, kind, results, here(xy))
    return InteractivePlan(
        view=(-width / 2.0, -height / 2.0, width, height),
        unit=unit,
        footprints="".join(_path(here(outline), closed=True) for outline in corners if np.isfinite(outline).all()),
        strips="".join(_path(here(line)) for line in plan.strip_lines(adjusted)),
        spots=tuple(spots),
        bar=bar,
        bar_text=length_text(bar),
        axes=plan.axis_names(adjusted),
        origin=(float(middle[0]), float(middle[1])),
    )


def _sigma_word(adjusted: AdjustedBlock) -> str:
    return "σ" if adjusted.points.model is None else "total σ"


def _photographs(adjusted: AdjustedBlock, here: Callable[[np.ndarray], np.ndarray], corners: np.ndarray) -> list[Spot]:
    block, images = adjusted.block, adjusted.images
    sigma, word = images.total_sigma, _sigma_word(adjusted)
    d, at, outlines = metre_digits(sigma[:, :3]), here(images.centre[:, :2]), here(corners)
    spots = []
    for k in np.flatnonzero(np.isfinite(at).all(axis=1)):
        strip = f"strip {printable(block.images.strip[k])}, " if block.images.strip[k] else ""
        angles = ", ".join(f"{value:.1f}" for value in sigma[k, 3:] * MGON_PER_RADIAN)
        text = f"{strip}{images.rays[k]} rays; {word} X0, Y0, Z0 {_metres(sigma[k, :3], d)} m; ω, φ, κ {angles} mgon"
        outline = tuple(outlines[k].ravel().tolist()) if np.isfinite(outlines[k]).all() else ()
        spots.append(_spot("photograph", at[k], block.images.names[k], text, outline))
    return spots


def _ground_spots(adjusted: AdjustedBlock, kind: str, results: GroundPointResults, at: np.ndarray) -> list[Spot]:
    d = metre_digits(results.sigma)
    kinds = plan.control_kinds(results)
    spots = []
    for k in np.flatnonzero(np.isfinite(at).all(axis=1)):
        difference = ", ".join(f"{value:+.{d}f}" if np.isfinite(value) else "–" for value in results.difference[k])
        w = ", ".join(f"{value:+.1f}" if np.isfinite(value) else "–" for value in results.w[k])
        only = "" if kinds[k] == "full" else f"{kinds[k]}, "
        text = f"{only}{results.rays[k]} rays; adjusted − given X, Y, Z {difference} m; w {w}"
        spots.append(_spot(kind, at[k], adjusted.block.points[results.point[k]], text))
    return spots


def _worst_points(adjusted: AdjustedBlock, here: Callable[[np.ndarray], np.ndarray]) -> list[Spot]:
    """Object points with the largest |w| beyond the critical value of the block's test."""
    points, block = adjusted.points, adjusted.block
    critical = -ndtri(block.settings.adjustment.alpha / 2.0)
    size, at = np.nan_to_num(points.max_abs_w), here(points.xyz[:, :2])
    rows = np.argsort(-size, kind="stable")[:WORST_POINTS]
    rows = rows[(size[rows] > critical) & np.isfinite(at[rows]).all(axis=1)]
    d, word = metre_digits(points.total_sigma), _sigma_word(adjusted)
    return [
        _spot("point", at[k], block.points[k],
              f"{points.rays[k]} rays; largest |w| {size[k]:.1f}; {word} X, Y, Z {_metres(points.total_sigma[k], d)} m")
        for k in rows
    ]  # fmt: skip


def _spot(kind: str, at: np.ndarray, name: object, text: str, outline: tuple[float, ...] = ()) -> Spot:
    return Spot(kind, float(at[0]), float(at[1]), printable(name), text, outline)


def _metres(values: np.ndarray, digits: int) -> str:
    return ", ".join(f"{value:.{digits}f}" if np.isfinite(value) else "–" for value in values)


def _path(xy: np.ndarray, closed: bool = False) -> str:
    return "M" + "L".join(f"{x},{y}" for x, y in xy.tolist()) + ("Z" if closed else "")
