"""Epipolar images of a pair over a piece of ground: rows of one are rows of the other, image errors taken out.

Both photographs are turned to one rotation whose x lies along the base, so that a place has the same row in both and
its parallax is f·B / depth. The right one is bent besides by the parallaxes P of a smooth ground known from a coarser
level: what is left to find is small, and windows on a slope do not blur. A pixel at column c of the left image that is
found δ further in the bent one has the parallax δ + P(c − δ). Each is resampled once, from its own pixels.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.interpolate import NearestNDInterpolator
from scipy.ndimage import gaussian_filter, map_coordinates

from aerotri.terrain.dense import spline
from aerotri.terrain.dense._resampling_kernels import resample, within
from aerotri.terrain.dense.grey_store import GreyStore
from aerotri.terrain.dense.place import Place
from aerotri.terrain.dense.scratch import scratch

LATTICE_PX = 8
"""Pixels between places that are projected, the others lying linearly between them; chosen [C]: the curvature of
tilts and lenses over 8 pixels is up to a hundredth of a pixel, half of which its mean has."""
MEAN_CURVATURE = 1.0 / 12.0 + 1.0 / (24.0 * LATTICE_PX**2)
"""Of the second difference of three nodes in a row, by which straight lines lie above a parabola on average [D]."""
MARGIN_PX = 24
"""By which epipolar images reach beyond the ground wanted; chosen [C]: more than windows and paths of the matching
need."""
SPARE_PX = 4.0
"""Parallaxes that are tried beyond those that the ground is known to have, at either end."""
MOST_PARALLAXES = 512
"""Parallaxes tried; chosen [C]: what is beyond leaves out the highest and the lowest alike."""
FIELD_NODES, FIELD_SMOOTHING, STEEPEST, FIELD_ROUNDS = 48, (1.0, 2.0, 4.0, 8.0, 16.0), 0.4, 8
"""Nodes along a side of the known parallaxes, σ of smoothing in nodes that is tried, largest change of parallax by
column that an image is bent by, and rounds of the fixed point; chosen [C]: beyond .4 a bent image loses half of
its pixels."""
MOST_PIXELS = 16_000_000
"""Of an epipolar image; chosen [C]: ten times a tile, and some 500 MB while it is matched. What is larger is seen from
so flat that nothing could be matched."""
TAIL = 0.005
"""Share of the ground's parallaxes that may lie beyond those tried, at either end."""


@dataclass(frozen=True, eq=False)
class EpipolarGeometry:
    """A pair turned to its base, over a window of the left image.

    Parameters
    ----------
    left, right : photographs. level : of resolution. f : px of the level. base : m.
    rotation : (3, 3) epipolar → q. centre : (3,) m, of the left one, in q.
    first : column and row, about the principal point, of the window's first pixel. shape : rows, columns.
    known : (rows, columns) float32 px, the parallaxes P taken out of the right image.
    lowest, count : parallaxes that are tried beyond them.
    bend : (·, ·) px, P at the nodes of the lattice, between which `known` is bilinear as the places of pixels are:
        what was taken out is what is added again.
    """

    left: int
    right: int
    level: int
    f: float
    base: float
    rotation: np.ndarray
    centre: np.ndarray
    first: tuple[int, int]
    shape: tuple[int, int]
    known: np.ndarray
    lowest: int
    count: int
    bend: np.ndarray


@dataclass(frozen=True, eq=False)
class EpipolarImages:
    """Pixels of a pair, (rows, columns) float32, and where each is known."""

    geometry: EpipolarGeometry
    left: np.ndarray
    right: np.ndarray
    left_known: np.ndarray
    right_known: np.ndarray


def epipolar_geometry(
    place: Place, left: int, right: int, level: int, ground: np.ndarray, low: np.ndarray, high: np.ndarray
) -> EpipolarGeometry | None:
    """The geometry of a pair over ground; None where it has no base or both do not see it.

    Parameters
    ----------
    ground : (n, 3) m in q, places all over the piece. low, high : (n, 3) the lowest and highest place there may be.
    """
    seen = np.zeros(len(ground), np.bool_)
    for places in (ground, low, high):
        rest = np.flatnonzero(~seen)
        seen[rest] = place.seen(left, places[rest]) & place.seen(right, places[rest])
    if not seen.any():
        return None
    ground, low, high = ground[seen], low[seen], high[seen]
    a, b = place.centres[left], place.centres[right]
    along = b - a
    base = float(np.linalg.norm(along))
    if base == 0.0:
        return None
    e1 = along / base
    away = ground.mean(axis=0) - 0.5 * (a + b)
    back = -(away - (away @ e1) * e1)
    if not np.linalg.norm(back) > 0.0:
        return None
    e3 = back / np.linalg.norm(back)
    rotation = np.column_stack([e1, np.cross(e3, e1), e3])
    p = place.photographs
    f = float(np.mean(p.orientation.interior[[left, right], 0] * p.sensor[[left, right], 2])) * 0.5**level
    if not (np.concatenate([low, high, ground] - a) @ e3 < 0.0).all():
        return None
    sides = [_epipolar(places - a, rotation, f, base) for places in (ground, low, high)]
    field = _smooth_field(*sides[0])
    off = np.concatenate([field.beyond(*side) for side in sides[1:]])
    least, most = np.quantile(off, [TAIL, 1.0 - TAIL])
    lowest, highest = int(np.floor(least - SPARE_PX)), int(np.ceil(most + SPARE_PX))
    count = min(-(-(highest - lowest) // 16) * 16, MOST_PARALLAXES)
    lowest -= (count - (highest - lowest)) // 2
    column, row = (np.concatenate([side[axis] for side in sides]) for axis in (0, 1))
    first = int(column.min()) - MARGIN_PX - max(lowest + count, 0), int(row.min()) - MARGIN_PX
    last = int(column.max()) + MARGIN_PX + max(-lowest, 0), int(row.max()) + MARGIN_PX
    shape = last[1] - first[1], last[0] - first[0]
    if shape[0] * shape[1] > MOST_PIXELS:
        return None
    bend = field.at(*np.meshgrid(*_lattice(first, shape)))
    known = np.ascontiguousarray(_between_nodes(bend.astype(np.float32), shape))
    return EpipolarGeometry(left, right, level, f, base, rotation, a, first, shape, known, lowest, count, bend)


def _lattice(first: tuple[int, int], shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Columns and rows of nodes in the middle of squares of pixels, one square more around a window."""
    s = LATTICE_PX
    columns, rows = (
        start + s * np.arange(-1, -(-n // s) + 1) + 0.5 * (s - 1) for start, n in zip(first, shape[::-1], strict=True)
    )
    return columns, rows


def _between_nodes(nodes: np.ndarray, shape: tuple[int, int], room: np.ndarray | None = None) -> np.ndarray:
    """(rows, columns, …) bilinear between the nodes of the lattice, right on average where they are curved.

    room : where it is written, if given.
    """
    s = LATTICE_PX
    flat = nodes.copy()
    flat[1:-1] -= MEAN_CURVATURE * (nodes[:-2] - 2.0 * nodes[1:-1] + nodes[2:])
    flat[:, 1:-1] -= MEAN_CURVATURE * (nodes[:, :-2] - 2.0 * nodes[:, 1:-1] + nodes[:, 2:])
    size = s * nodes.shape[1], s * nodes.shape[0]
    whole = cv2.resize(flat, size, dst=room, interpolation=cv2.INTER_LINEAR)
    return whole[s : s + shape[0], s : s + shape[1]]


def _epipolar(from_centre: np.ndarray, rotation: np.ndarray, f: float, base: float) -> tuple[np.ndarray, ...]:
    """Column and row about the principal point, and parallax, px, of places (n, 3)."""
    u = from_centre @ rotation
    depth = -u[:, 2]
    return f * u[:, 0] / depth, -f * u[:, 1] / depth, f * base / depth


@dataclass(frozen=True, eq=False)
class _Field:
    """Parallaxes px (rows, columns) on a lattice, bilinear between its nodes and as at its edge beyond.

    first : column and row of the first node. step : px.
    """

    first: tuple[float, float]
    step: float
    nodes: np.ndarray

    def at(self, column: np.ndarray, row: np.ndarray) -> np.ndarray:
        i, j = (row - self.first[1]) / self.step, (column - self.first[0]) / self.step
        return map_coordinates(self.nodes, [i, j], order=1, mode="nearest")

    def beyond(self, column: np.ndarray, row: np.ndarray, parallax: np.ndarray) -> np.ndarray:
        """δ of δ + P(c − δ) = parallax."""
        found = parallax - self.at(column, row)
        for _ in range(FIELD_ROUNDS):
            found = parallax - self.at(column - found, row)
        return found


def _smooth_field(column: np.ndarray, row: np.ndarray, parallax: np.ndarray) -> _Field:
    """Parallaxes of places, smoothed until an image can be bent by them; their median where they never can."""
    first, last = (np.array([f(column), f(row)]) for f in (np.min, np.max))
    step = max(float((last - first).max()) / FIELD_NODES, 1.0)
    size = np.maximum(np.ceil((last - first) / step).astype(int) + 1, 2)
    x, y = np.meshgrid(first[0] + step * np.arange(size[0]), first[1] + step * np.arange(size[1]))
    nearest = NearestNDInterpolator(np.column_stack([column, row]), parallax)(x, y)
    for width in FIELD_SMOOTHING:
        nodes = gaussian_filter(nearest, width, mode="nearest")
        if np.abs(np.gradient(nodes, step, axis=1)).max() < STEEPEST:
            return _Field((float(first[0]), float(first[1])), step, nodes)
    nodes = np.full(nearest.shape, float(np.median(parallax)))
    return _Field((float(first[0]), float(first[1])), step, nodes)


def epipolar_images(place: Place, geometry: EpipolarGeometry, store: GreyStore) -> EpipolarImages:
    """Resample both photographs of a pair.

    Raises
    ------
    InputError
    """
    g = geometry
    (left, left_known), (right, right_known) = (
        _resampled(place, g, store, k, centre, bent)
        for k, centre, bent in ((g.left, g.centre, False), (g.right, place.centres[g.right], True))
    )
    return EpipolarImages(g, left, right, left_known, right_known)


def _resampled(
    place: Place, g: EpipolarGeometry, store: GreyStore, k: int, centre: np.ndarray, bent: bool
) -> tuple[np.ndarray, np.ndarray]:
    """(rows, columns) float32 of photograph k in the window, and where it is known."""
    rows, columns = g.shape
    column, row = np.meshgrid(*_lattice(g.first, g.shape))
    size = column.shape
    column, row = (column - g.bend if bent else column).ravel(), row.ravel()
    depth = _mean_depth(g)
    u = np.column_stack([column, -row, np.full(len(row), -g.f)]) * (depth / g.f)
    pixel = place.project(k, centre + u @ g.rotation.T) * 0.5**g.level - 0.5
    pixels = store.level(k, g.level)
    nodes = np.nan_to_num(pixel, nan=-1e6).astype(np.float32)
    on_lattice = LATTICE_PX * size[0], LATTICE_PX * size[1], 2
    room = scratch.take(1, (int(np.prod(on_lattice)),))[0].reshape(on_lattice)
    place_of = _between_nodes(nodes.reshape(*size, 2), g.shape, room)
    edge = place.view.edge * np.array([pixels.shape[1], pixels.shape[0]])
    x, y = place_of[:, :, 0], place_of[:, :, 1]
    known = np.empty((rows, columns), np.bool_)
    last = pixels.shape[1] - 2.0 - edge[0], pixels.shape[0] - 2.0 - edge[1]
    within(x, y, (edge[0] + 1.0, edge[1] + 1.0), last, known)
    if not known.any():
        return np.zeros((rows, columns), np.float32), known
    left, right = _reached(x, known, pixels.shape[1])
    above, below = _reached(y, known, pixels.shape[0])
    out = np.empty((rows, columns), np.float32)
    resample(spline.of_surface(pixels[above:below, left:right]), np.array([left, above]), x, y, known, out)
    return out, known


def _reached(at: np.ndarray, known: np.ndarray, count: int) -> tuple[int, int]:
    """First row or column of pixels, and the one after the last, that splines at the known places are made of."""
    low, high, *_ = cv2.minMaxLoc(at, known.view(np.uint8))
    return max(int(low) - spline.REACH - 1, 0), min(int(high) + spline.REACH + 3, count)


def _mean_depth(g: EpipolarGeometry) -> float:
    """m, of the middle of the window."""
    parallax = float(np.median(g.known[::LATTICE_PX, ::LATTICE_PX])) + g.lowest + 0.5 * g.count
    return g.f * g.base / max(parallax, 1e-6)
