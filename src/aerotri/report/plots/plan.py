"""The frame of a plan: extent, equal scales, footprints, point symbols and names that do not cover one another."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from aerotri.functional_model.additional_parameters import lens
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations import Camera
from aerotri.report.plots.canvas import GREY, INK, LIGHT, axes_at, coordinate_axes, plain
from aerotri.results.adjusted_block import AdjustedBlock, GroundPointResults

FARTHEST_FOOTPRINT = 6.0
"""Corners farther from the nadir than this many heights above ground (oblique photographs) are not drawn."""


@dataclass(frozen=True)
class Extent:
    """A rectangle on the ground, m."""

    left: float
    right: float
    bottom: float
    top: float

    @property
    def width(self) -> float:
        return self.right - self.left

    @property
    def height(self) -> float:
        return self.top - self.bottom

    def widened(self, left_right: float, bottom_top: float) -> Extent:
        return Extent(self.left - left_right, self.right + left_right, self.bottom - bottom_top, self.top + bottom_top)


def extent_of(*xy: np.ndarray) -> Extent:
    """The rectangle around all finite positions, (n, 2) m each; a square of 1 m where there is none."""
    together = np.concatenate([np.reshape(a, (-1, 2)) for a in xy])
    together = together[np.isfinite(together).all(axis=1)]
    if not len(together):
        return Extent(-0.5, 0.5, -0.5, 0.5)
    (left, bottom), (right, top) = together.min(axis=0), together.max(axis=0)
    least = 0.5 * max(right - left, top - bottom, 1e-3) * 0.1
    return Extent(left, right, bottom, top).widened(
        max(0.0, least - (right - left) / 2), max(0.0, least - (top - bottom) / 2)
    )


def plan_size(extent: Extent, widest: float, highest: float, lowest: float = 2.2) -> tuple[float, float]:
    """Width and height in inches of axes that show an extent with equal scales."""
    ratio = extent.height / extent.width
    width = min(widest, max(highest / ratio, 2.6))
    return width, float(np.clip(width * ratio, lowest, highest))


def plan_axes(
    figure: Figure, place: tuple[float, float, float, float], extent: Extent, labels: tuple[str, str]
) -> Axes:
    """Axes with equal scales that hold an extent and a margin of 5 % around it.

    Parameters
    ----------
    place : left, bottom, width, height, inches.
    labels : of the two axes, with unit.
    """
    axes = axes_at(figure, *place)
    _, _, width, height = place
    metres_per_inch = 1.10 * max(extent.width / width, extent.height / height)
    x, y = (extent.left + extent.right) / 2, (extent.bottom + extent.top) / 2
    axes.set_xlim(x - metres_per_inch * width / 2, x + metres_per_inch * width / 2)
    axes.set_ylim(y - metres_per_inch * height / 2, y + metres_per_inch * height / 2)
    coordinate_axes(axes, width, height, labels)
    return axes


def axis_names(adjusted: AdjustedBlock) -> tuple[str, str]:
    """Labels of the plan's axes."""
    return ("X (local) [m]", "Y (local) [m]") if adjusted.block.crs == "local" else ("E [m]", "N [m]")


def footprints(adjusted: AdjustedBlock) -> np.ndarray:
    """(n, 4, 2) m, corners of every photograph on the mean height of the ground; NaN where they do not reach it."""
    block = adjusted.block
    ground = np.nanmedian(adjusted.points.xyz[:, 2]) if np.isfinite(adjusted.points.xyz[:, 2]).any() else np.nan
    rotation = rotation_from_angles(np.nan_to_num(adjusted.images.angles), block.rotation)
    corners = np.array([corner_directions(camera) for camera in block.cameras])[block.images.camera]
    direction = np.einsum("nij,nkj->nki", rotation, corners)
    centre = adjusted.images.centre
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (ground - centre[:, None, 2]) / direction[..., 2]
        offset = along[..., None] * direction[..., :2]
        far = np.hypot(offset[..., 0], offset[..., 1]) > FARTHEST_FOOTPRINT * np.abs(centre[:, None, 2] - ground)
    corners_xy = centre[:, None, :2] + offset
    hidden = ~np.isfinite(along) | (along <= 0.0) | far
    return np.where(hidden.any(axis=1)[:, None, None], np.nan, corners_xy)


def corner_directions(camera: Camera) -> np.ndarray:
    """(4, 3) directions of the corners in the camera frame."""
    (half_x, half_y), (x0, y0) = camera.half_format_mm, camera.principal_point_mm
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    corners = signs * np.array([half_x, half_y]) - np.array([x0, y0])
    tangent = lens.undistort(corners / camera.focal_length_mm, lens.vector({}, camera.is_fisheye))
    return np.column_stack([tangent, np.full(4, -1.0)])


def draw_footprints(axes: Axes, corners: np.ndarray) -> None:
    """Thin outlines, fainter the more there are."""
    whole = corners[np.isfinite(corners).all(axis=(1, 2))]
    closed = np.concatenate([whole, whole[:, :1]], axis=1)
    alpha = float(np.clip(60.0 / max(len(whole), 1), 0.15, 0.7))
    axes.add_collection(LineCollection(list(closed), colors=GREY, linewidths=0.4, alpha=alpha, zorder=1), autolim=False)


def strip_lines(adjusted: AdjustedBlock) -> list[np.ndarray]:
    """Projection centres of every named strip, (k, 2) m each, in the order along the strip."""
    lines = []
    strips = adjusted.block.images.strip
    for name in np.unique(strips[strips != ""]):
        xy = adjusted.images.centre[strips == name, :2]
        xy = xy[np.isfinite(xy).all(axis=1)]
        if len(xy) > 1:
            direction = np.linalg.svd(xy - xy.mean(axis=0), full_matrices=False)[2][0]
            lines.append(xy[np.argsort(xy @ direction)])
    return lines


def ground_point_xy(adjusted: AdjustedBlock, points: np.ndarray) -> np.ndarray:
    """(k, 2) m, where to draw control or check points: adjusted, or as given where they could not be adjusted."""
    xy = adjusted.points.xyz[points, :2].copy()
    control = adjusted.block.control
    given = {int(point): row for row, point in enumerate(control.point)}
    for i in np.flatnonzero(~np.isfinite(xy).all(axis=1)):
        row = given.get(int(points[i]))
        if row is not None:
            xy[i] = control.xyz[row, :2]
    return xy


def control_kinds(results: GroundPointResults) -> np.ndarray:
    """(k,) str: 'full', 'height only', 'plan only', or 'off' where none is used; by the coordinates that were given."""
    given = np.isfinite(results.difference)
    plan, height = given[:, :2].any(axis=1), given[:, 2]
    return np.where(plan & height, "full", np.where(height, "height only", np.where(plan, "plan only", "off")))


def draw_names(axes: Axes, xy: np.ndarray, names: list[str], others: np.ndarray, size: float = 7.0) -> None:
    """Names beside their points, each at the first of four places that is free, or left out where none is.

    The limits of the axes must be final: places are compared in inches, a letter taken as 0.62 of its height wide.

    Parameters
    ----------
    xy : (k, 2) m, of the points; others : (j, 2) m, of symbols that the names must not cover.
    """
    box = axes.get_position()
    figure_size = cast(Figure, axes.figure).get_size_inches()
    size_inch = np.array([box.width, box.height]) * figure_size
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    place = (xy - (left, bottom)) / (right - left, top - bottom) * size_inch
    height = size / 72.0 * 1.25
    symbols = np.concatenate([place, (others - (left, bottom)) / (right - left, top - bottom) * size_inch])
    taken = [(p[0] - 0.06, p[1] - 0.06, p[0] + 0.06, p[1] + 0.06) for p in symbols]
    for (px, py), name in zip(place, names, strict=True):
        text = plain(name, 16)
        width = 0.62 * size / 72.0 * len(text)
        for dx, dy in ((0.08, 0.05), (-0.08 - width, 0.05), (0.08, -0.05 - height), (-0.08 - width, -0.05 - height)):
            rectangle = (px + dx, py + dy, px + dx + width, py + dy + height)
            inside = min(rectangle[:2]) > 0 and rectangle[2] < size_inch[0] and rectangle[3] < size_inch[1]
            if inside and not any(_overlap(rectangle, other) for other in taken):
                corner = (rectangle[0] / size_inch[0], rectangle[1] / size_inch[1])
                axes.text(*corner, text, transform=axes.transAxes, fontsize=size, color=INK, zorder=6)
                taken.append(rectangle)
                break


def _overlap(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def draw_centres(axes: Axes, adjusted: AdjustedBlock, strong: bool = True) -> None:
    """Projection centres and the lines of the strips."""
    axes.add_collection(
        LineCollection(strip_lines(adjusted), colors=GREY if strong else LIGHT, linewidths=0.7, zorder=2), autolim=False
    )
    size = 2.6 if len(adjusted.block.images) < 500 else 1.4
    axes.plot(*adjusted.images.centre[:, :2].T, "o", ms=size, mec="none", color=INK if strong else LIGHT, zorder=3)
