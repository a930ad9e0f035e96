"""What straight triangles lose of a cut and of a fill where the ground bends away from the base.

[D] Over triangles whose corners lie where chance has put them, straight lines between heights of f miss −c·∫∇²f dA,
c = 3/8 of the mean second moment of the corners along an axis (a square lattice: h²/12, as Euler–Maclaurin has it). A
cut and a fill are ½∫(|h| ± h) dA, h the height over the base, so that both lose S = −½c·∫sgn(h)·∇²h dA beside what the
net volume loses. The ∇²h of a surface of triangles are its kinks: Σ over edges of (change of the slope across)·length.
Nothing is assumed of how heights are distributed: on benches they keep away from a base that runs through the faces,
which a normal random function does not know. Where the kinks are from noise, their expectation

  E[sgn(h)·k] = 2·φ(h/s)·cov(h, k)/s,  h the mean of the ends of an edge, s its σ,  cov = −½σ²·(1/a + 1/b)

is taken off; a and b are the heights of the two triangles over their edge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.volume.counted import Counted
from aerotri.volume.rectified import density

MOMENT = 3.0 / 8.0
"""Mean of a quadratic form over the corners of a triangle less over its area, over that of the corners."""


@dataclass(frozen=True, eq=False)
class _Edges:
    """Edges between two triangles.

    Parameters
    ----------
    ends, sides : (e, 2) corners of an edge, and rows of its triangles. length : (e,) m.
    """

    ends: np.ndarray
    sides: np.ndarray
    length: np.ndarray


def lost_on_either_side(
    xyz: np.ndarray, triangles: np.ndarray, area: np.ndarray, counted: Counted, noise: float
) -> float:
    """m³, by which straight triangles make the cut and the fill too small alike.

    Parameters
    ----------
    xyz : (k, 3) m. triangles : (t, 3) corners. area : (t,) m², of each inside the boundary.
    noise : m², variance of a height that is its own alone.
    """
    corners = xyz[triangles]
    h = counted.at(np.broadcast_to(np.eye(3), (len(corners), 3, 3)), corners)
    known = np.isfinite(h).all(axis=1) & (area > 0.0)
    if not known.any():
        return 0.0
    corners, h, inside, own = corners[known], h[known], area[known], triangles[known]
    slope, whole = _slopes(corners[:, :, :2], h)
    moment = 0.5 * np.mean((corners - corners.mean(axis=1, keepdims=True))[:, :, :2] ** 2, axis=1).sum(axis=1)
    c = MOMENT * float(moment @ inside) / float(inside.sum())
    edges = _shared_edges(own, xyz)
    if not len(edges.length):
        return 0.0
    of_corners = np.zeros(len(xyz))
    of_corners[own] = h
    kink = _kinks(edges, slope, corners.mean(axis=1)[:, :2], xyz)
    counts = (inside / whole)[edges.sides].mean(axis=1)
    bent = _side(of_corners[edges.ends]) * kink - _by_noise(edges, whole, of_corners, noise)
    return -0.5 * c * float(np.sum(bent * edges.length * counts))


def _slopes(xy: np.ndarray, h: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(t, 2) m/m, and the areas (t,) m²."""
    (a, b), (c, d) = np.moveaxis(xy[:, 1:] - xy[:, :1], 0, -1)
    double = a * d - b * c
    up = h[:, 1:] - h[:, :1]
    safe = np.where(np.abs(double) < 1e-12, np.inf, double)
    slope = np.column_stack([d * up[:, 0] - b * up[:, 1], a * up[:, 1] - c * up[:, 0]]) / safe[:, None]
    return slope, np.maximum(0.5 * np.abs(double), 1e-12)


def _shared_edges(triangles: np.ndarray, xyz: np.ndarray) -> _Edges:
    ends = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    of = np.tile(np.arange(len(triangles)), 3)
    order = np.lexsort(ends.T[::-1])
    ends, of = ends[order], of[order]
    both = np.flatnonzero((ends[1:] == ends[:-1]).all(axis=1))
    along = xyz[ends[both, 1], :2] - xyz[ends[both, 0], :2]
    return _Edges(ends[both], np.column_stack([of[both], of[both + 1]]), np.linalg.norm(along, axis=1))


def _kinks(edges: _Edges, slope: np.ndarray, middle: np.ndarray, xyz: np.ndarray) -> np.ndarray:
    """(e,) change of the slope from one triangle to the other across their edge: negative on a crest."""
    along = xyz[edges.ends[:, 1], :2] - xyz[edges.ends[:, 0], :2]
    across = np.column_stack([along[:, 1], -along[:, 0]]) / np.maximum(edges.length, 1e-12)[:, None]
    one, other = edges.sides.T
    across *= np.sign(np.sum(across * (middle[other] - middle[one]), axis=1))[:, None]
    return np.sum(across * (slope[other] - slope[one]), axis=1)


def _side(h: np.ndarray) -> np.ndarray:
    """(e,) mean sign along edges with heights (e, 2) of their ends over the base."""
    total = np.abs(h).sum(axis=1)
    mixed = (np.abs(h[:, 0]) - np.abs(h[:, 1])) * np.sign(h[:, 0]) / np.maximum(total, 1e-300)
    return np.where(h.prod(axis=1) >= 0.0, np.sign(h.sum(axis=1)), mixed)


def _by_noise(edges: _Edges, area: np.ndarray, h: np.ndarray, noise: float) -> np.ndarray:
    """(e,) what noise alone makes of sign times kink: a height moves both."""
    if noise <= 0.0:
        return np.zeros(len(edges.length))
    over = (0.5 * edges.length[:, None] / area[edges.sides]).sum(axis=1)
    sigma = np.sqrt(0.5 * noise)
    return -2.0 * density(h[edges.ends].mean(axis=1) / sigma) / sigma * 0.5 * noise * over
