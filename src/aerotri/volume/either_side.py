"""What straight triangles lose of a cut and of a fill alike, told by the heights at their corners.

[D] Over a net of triangles whose corners lie where chance has put them, the mean of straight lines between values f of
the corners is that of f, whatever f is: ∫I(f) dA = ∫f dA + c·∮∂f/∂n ds, the line integral along the edge of the area,
c = 3/8 of the mean second moment of the corners along an axis. A cut and a fill are ½∫(|h| ± h) dA, h the height over
the base. With f = |h|, what both lose beside what the net volume loses is

  S = ½·∫(I(|h|) − |I(h)|) dA − ½·c·∮∂|h|/∂n ds.

Only triangles that the base cuts have a part in the first term. Nothing is assumed of how heights are distributed.
Summed by parts, with k the kinks of the straight triangles (change of the slope across an edge), l the length of an
edge and L that of the line h = 0 in a triangle,

  S = −½·c·Σ mean sgn(h)·k·l + Σ D(h),  D(h) = ½·∫(I(|h|) − |I(h)|) dA − c·|∇h|·L.

Over a plane D scatters about zero, so that D of the plane nearest to the heights around is taken off: a plane loses
nothing then, wherever its points lie. What a measured base bends within a triangle is added.

Noise of variance s² of a height makes Σ|h| at the corners larger, and that of straight lines over a triangle, where its
variance is s²/2 in the mean (the sum of the squares of barycentric coordinates), less so. Where heights over the base
scatter by v, both as of normal heights, the difference E⁺(v) − E⁺(v − s²/2), E⁺ the mean of what is above, is taken off
S. What noise adds to the cut itself, E⁺(v − s²/2) − E⁺(v − s²), is told apart; noise of a measured base belongs to both
variances there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from aerotri.volume.bases import PlaneBase
from aerotri.volume.counted import PLACES, Counted
from aerotri.volume.rectified import expected_above

MOMENT = 3.0 / 8.0
"""Mean of a quadratic form over the corners of a triangle less over its area, over that of the corners."""
WITHIN = 0.5
"""Mean of the sum of the squares of barycentric coordinates over a triangle."""
AROUND = 20
"""Heights through which a plane is laid, as many as of a neighbourhood of a roughness."""
SCATTER = 50
"""Heights by whose scatter noise is judged; chosen [C]: enough to tell their variance by a fifth, and not much more
ground than that."""
TOGETHER = 2000
"""Triangles side by side whose places are compared with the base at a time; chosen [C]: a base that is a file is read
in windows of their size."""


@dataclass(frozen=True)
class Lost:
    """m³. ground : by which straight triangles make the cut and the fill too small alike. noise : by which noise makes
    both too large. above, below : of the straight triangles, on either side of the base."""

    ground: float = 0.0
    noise: float = 0.0
    above: float = 0.0
    below: float = 0.0

    def at_least(self, net: float) -> float:
        """m³ of `ground`, so that neither cut nor fill is less than nothing; net : what the net volume loses, m³."""
        return max(self.ground, 0.5 * net - self.below, -0.5 * net - self.above)


@dataclass(frozen=True, eq=False)
class _Net:
    """Triangles with known heights over the base.

    Parameters
    ----------
    corners : (t, 3, 3) m. h : (t, 3) m over the base. inside : (t,) m² of each inside the boundary.
    own : (t, 3) rows of the corners. xy : (k, 2) m of all.
    """

    corners: np.ndarray
    h: np.ndarray
    inside: np.ndarray
    own: np.ndarray
    xy: np.ndarray


def lost_on_either_side(
    xyz: np.ndarray, triangles: np.ndarray, area: np.ndarray, counted: Counted, noise: float
) -> Lost:
    """What a cut and a fill over a base are off alike.

    Parameters
    ----------
    xyz : (k, 3) m. triangles : (t, 3) corners. area : (t,) m², of each inside the boundary.
    noise : m², variance of a height that is its own alone.
    """
    used = triangles[area > 0.0]
    corners = xyz[used]
    h = counted.at(np.broadcast_to(np.eye(3), (len(corners), 3, 3)), corners)
    known = np.isfinite(h).all(axis=1)
    if not known.any():
        return Lost()
    net = _Net(corners[known], h[known], area[area > 0.0][known], used[known], xyz[:, :2])
    plan = (net.corners - net.corners.mean(axis=1, keepdims=True))[:, :, :2]
    moment = 0.5 * np.mean(plan**2, axis=1).sum(axis=1)
    c = MOMENT * float(moment @ net.inside) / float(net.inside.sum())
    of_corners, of_lines = _by_noise(net, noise, counted.noise)
    beside = net.inside @ (_cut(net, net.h, c) - _cut(net, _planes(net), c)) + _bent_base(net, counted)
    size, mean = float(net.inside @ _mean_size(net.h)), float(net.inside @ net.h.mean(axis=1))
    lost = _by_kinks(net, c) + float(beside) - of_corners
    return Lost(lost, of_lines, 0.5 * (size + mean), 0.5 * (size - mean))


def _alone(h: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of triangles with heights (t, 3) over the base: (t,) m, size of the height that has its side alone, 0 where the
    triangle is not cut; and (t,) m², (a + b)·(a + c) of this size a and the others b and c."""
    sign, size = np.sign(h), np.abs(h)
    most = np.sign(np.median(h, axis=1))[:, None]
    alone = np.argmax(np.where(most == 0.0, sign != 0.0, sign * most < 0.0), axis=1)
    first, one, other = (np.take_along_axis(size, ((alone + k) % 3)[:, None], axis=1)[:, 0] for k in range(3))
    cut = (h.min(axis=1) < 0.0) & (h.max(axis=1) > 0.0)
    return np.where(cut, first, 0.0), np.maximum((first + one) * (first + other), 1e-300)


def _mean_size(h: np.ndarray) -> np.ndarray:
    """(t,) m, mean of |h| over straight triangles."""
    first, product = _alone(h)
    return np.abs(h).mean(axis=1) - 2.0 * first * (1.0 - first**2 / product) / 3.0


def _cut(net: _Net, h: np.ndarray, c: float) -> np.ndarray:
    """(t,) m, D over the area of a triangle with heights (t, 3) over the base, zero where it is not cut."""
    first, product = _alone(h)
    slope = _slopes(net.corners[:, :, :2], h)[0]
    return 0.5 * (np.abs(h).mean(axis=1) - _mean_size(h)) - 2.0 * c * np.sum(slope**2, axis=1) * first / product


def _planes(net: _Net) -> np.ndarray:
    """(t, 3) m over the base, of the plane nearest to the heights around a triangle, at its corners."""
    rows, h = _of_points(net)
    if len(rows) < AROUND:
        return net.h
    tree, out = KDTree(net.xy[rows]), np.empty_like(net.h)
    for few in np.array_split(np.arange(len(net.h)), -(-len(net.h) // TOGETHER)):
        middle = net.corners[few].mean(axis=1)[:, :2]
        near = np.asarray(tree.query(middle, AROUND)[1])
        at = net.xy[rows[near]] - middle[:, None]
        size = np.maximum(np.abs(at).max(axis=(1, 2)), 1e-9)[:, None, None]
        design = np.concatenate([np.ones((*near.shape, 1)), at / size], axis=2)
        plane = np.einsum("tpn,tn->tp", np.linalg.pinv(design), h[near])
        corners = (net.corners[few][:, :, :2] - middle[:, None]) / size
        out[few] = plane[:, :1] + np.einsum("tkc,tc->tk", corners, plane[:, 1:])
    return out


def _of_points(net: _Net) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the points that are corners, and their heights over the base."""
    rows, place = np.unique(net.own, return_inverse=True)
    h = np.zeros(len(rows))
    h[place.ravel()] = net.h.ravel()
    return rows, h


def _bent_base(net: _Net, counted: Counted) -> float:
    """m³ that a base which is not straight over a triangle brings: nothing where it is a plane."""
    if isinstance(counted.other, PlaneBase):
        return 0.0
    total = 0.0
    for few in _side_by_side(net.corners.mean(axis=1)[:, :2]):
        at = np.abs(counted.at(np.broadcast_to(PLACES, (len(few), *PLACES.shape)), net.corners[few]))
        straight = np.abs(net.h[few] @ PLACES.T)
        known = np.isfinite(at).all(axis=1)
        total += 0.5 * float(net.inside[few[known]] @ (straight - at)[known].mean(axis=1))
    return total


def _side_by_side(middle: np.ndarray) -> list[np.ndarray]:
    """Rows of places (t, 2) in squares that hold some `TOGETHER` each."""
    span = np.maximum(np.ptp(middle, axis=0), 1e-9)
    size = max(np.sqrt(np.prod(span) * TOGETHER / len(middle)), 1e-9)
    column, row = ((middle - middle.min(axis=0)) / size).astype(np.int64).T
    number = row * (int(column.max()) + 1) + column
    order = np.argsort(number, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(number[order])) + 1)


def _by_kinks(net: _Net, c: float) -> float:
    """m³, −½·c·Σ mean sgn(h)·k·l: negative kinks are crests."""
    slope, whole = _slopes(net.corners[:, :, :2], net.h)
    ends, sides, h = _shared_edges(net)
    along = net.xy[ends[:, 1]] - net.xy[ends[:, 0]]
    # from one side to the other, as long as the edge
    across = np.column_stack([along[:, 1], -along[:, 0]])
    one, other = sides.T
    middle = net.corners.mean(axis=1)[:, :2]
    across *= np.sign(np.sum(across * (middle[other] - middle[one]), axis=1))[:, None]
    kink = np.sum(across * (slope[other] - slope[one]), axis=1)
    inside = np.minimum(net.inside / whole, 1.0)[sides].mean(axis=1)
    return -0.5 * c * float(np.sum(_mean_sign(h) * kink * inside))


def _mean_sign(h: np.ndarray) -> np.ndarray:
    """(e,) along edges with heights (e, 2) of their ends over the base."""
    total = np.abs(h).sum(axis=1)
    mixed = (np.abs(h[:, 0]) - np.abs(h[:, 1])) * np.sign(h[:, 0]) / np.maximum(total, 1e-300)
    return np.where(h.prod(axis=1) >= 0.0, np.sign(h.sum(axis=1)), mixed)


def _slopes(xy: np.ndarray, h: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(t, 2) m/m of values (t, 3) at corners (t, 3, 2), and the areas (t,) m²."""
    (a, b), (c, d) = np.moveaxis(xy[:, 1:] - xy[:, :1], 0, -1)
    double = a * d - b * c
    up = h[:, 1:] - h[:, :1]
    safe = np.where(np.abs(double) < 1e-12, np.inf, double)
    slope = np.column_stack([d * up[:, 0] - b * up[:, 1], a * up[:, 1] - c * up[:, 0]]) / safe[:, None]
    return slope, np.maximum(0.5 * np.abs(double), 1e-12)


def _shared_edges(net: _Net) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of edges between two triangles: (e, 2) corners, (e, 2) rows of the triangles, (e, 2) m over the base."""
    pairs = ([0, 1], [1, 2], [2, 0])
    ends, h = (np.concatenate([values[:, pair] for pair in pairs]) for values in (net.own, net.h))
    turned = np.argsort(ends, axis=1)
    ends, h = np.take_along_axis(ends, turned, axis=1), np.take_along_axis(h, turned, axis=1)
    of = np.tile(np.arange(len(net.own)), 3)
    order = np.lexsort(ends.T[::-1])
    ends, of, h = ends[order], of[order], h[order]
    both = np.flatnonzero((ends[1:] == ends[:-1]).all(axis=1))
    return ends[both], np.column_stack([of[both], of[both + 1]]), h[both]


def _by_noise(net: _Net, noise: float, of_base: float) -> tuple[float, float]:
    """m³ that noise makes of S, and that it adds to the cut, and as much to the fill.

    Parameters
    ----------
    noise, of_base : m², variances of a height, and of the base at a place.
    """
    if noise <= 0.0 and of_base <= 0.0:
        return 0.0, 0.0
    rows, h = _of_points(net)
    weight = np.bincount(np.searchsorted(rows, net.own.ravel()), np.repeat(net.inside / 3.0, 3))
    near = np.asarray(KDTree(net.xy[rows]).query(net.xy[rows], min(SCATTER, len(rows)))[1]).reshape(len(rows), -1)
    mean, v = h[near].mean(axis=1), h[near].var(axis=1)
    of_lines = noise * (1.0 - WITHIN)
    at_corners, straight = (expected_above(mean, np.sqrt(np.maximum(v - off, 0.0))) for off in (0.0, of_lines))
    at_least = np.maximum(v, noise + of_base)
    noisy, ground = (expected_above(mean, np.sqrt(at_least - off)) for off in (of_lines, noise + of_base))
    return float(weight @ (at_corners - straight)), float(weight @ np.maximum(noisy - ground, 0.0))
