"""What a boundary that is not drawn exactly does to a volume.

[D] The area changes along the two edges of a corner, and a base that follows from heights along the boundary moves as
well: its places go with the edges, and get other heights.
"""

from __future__ import annotations

import numpy as np
import shapely

from aerotri.volume.bases import (
    Base,
    Nodes,
    PlaneBase,
    SplineBase,
    Surface,
    boundary_heights,
    by_places_of_kernels,
    level,
    nodes_of,
    quadrature_of,
    sampled,
)
from aerotri.volume.boundary import Boundary
from aerotri.volume.regions import Region, base_over

ALONG_EDGE = 33
"""Places along every edge of the boundary."""
DRAWS = 400
"""Of corners, where σ has no derivative; chosen [C]: it is good to 4 % then."""


def boundary_variance(
    surface: Surface, base: Base, boundary: Boundary, sigma: float, sign: int = 0, region: Region | None = None
) -> float:
    """m⁶, from corners of the boundary that are each off by σ in either coordinate, independently.

    Parameters
    ----------
    sigma : m. sign : 1 of the cut alone, −1 of the fill. region : what counts of the boundary; None: all.
    """
    if sigma <= 0.0:
        return 0.0
    rings = boundary.rings
    by_corner = _by_area(surface, base, rings, sign)
    nodes = nodes_of(base_over(base, region))
    if nodes is None:
        return sigma**2 * float(np.sum(by_corner**2))
    step = max(sigma, surface.grid.cell_x, surface.grid.cell_y)
    # where the base rises a fill becomes larger, what is above it smaller
    above = -1.0 if sign < 0 else 1.0
    if len(nodes.xy) == 1:
        return _with_lowest(surface, boundary, sigma, by_corner, above * float(nodes.integral[0]), step)
    over = quadrature_of(boundary) if region is None else (region.places, region.weight)
    by_corner -= above * _to_corners(nodes.xy, _by_nodes(surface, base, nodes, step, over), rings)
    return sigma**2 * float(np.sum(by_corner**2))


def _by_area(surface: Surface, base: Base, rings: list[np.ndarray], sign: int) -> np.ndarray:
    """(corners, 2) m², of all rings: ∂V/∂corner = ∮ (z − base)·φ·n ds over its two edges.

    φ falls linearly from 1 to 0, n is the outer normal.
    """
    t = np.linspace(0.0, 1.0, ALONG_EDGE)
    simpson = np.r_[1.0, np.tile([4.0, 2.0], (ALONG_EDGE - 3) // 2), 4.0, 1.0] / (3.0 * (ALONG_EDGE - 1))
    found = []
    for ring in rings:
        edges = np.diff(ring, axis=0)
        at = (ring[:-1, None] + t[None, :, None] * edges[:, None]).reshape(-1, 2)
        d = _over_base(surface, base, at)
        d = np.maximum(sign * d, 0.0) if sign else d
        d = np.where(np.isfinite(d), d, 0.0).reshape(len(edges), ALONG_EDGE)
        normal = np.column_stack([edges[:, 1], -edges[:, 0]])
        from_start, from_end = d @ (simpson * (1.0 - t)), d @ (simpson * t)
        found.append(from_start[:, None] * normal + np.roll(from_end[:, None] * normal, 1, axis=0))
    return np.concatenate(found)


def _by_nodes(
    surface: Surface, base: Base, nodes: Nodes, step: float, over: tuple[np.ndarray, np.ndarray]
) -> np.ndarray:
    """(k, 2) m², of ∫ of the base by the places that it follows from, as these move over the surface.

    [D] A place that moves by δ has δ·∇z another height; where it was, the base changes by δ·(∇z − ∇base). The plane
    nearest to many heights also turns where one that is r above it moves: by N⁻¹(0, δ)·r, N its normal matrix; what
    a spline does besides: `by_places_of_kernels`.
    That the places are spaced evenly along the outline again is left out.

    Parameters
    ----------
    step : m, to either side, for slopes. over : places (q, 2) m and weights (q,) m² of the integral.
    """
    found = nodes.integral[:, None] * _slopes(surface, base, nodes.xy, step)
    if isinstance(base, SplineBase):
        found += by_places_of_kernels(base, *over)
    elif isinstance(base, PlaneBase):
        design = np.column_stack([np.ones(len(nodes.xy)), nodes.xy - nodes.xy.mean(axis=0)])
        turned = np.linalg.solve(design.T @ design, design.T @ nodes.integral)[1:]
        found += _over_base(surface, base, nodes.xy)[:, None] * turned
    return np.where(np.isfinite(found), found, 0.0)


def _slopes(surface: Surface, base: Base, xy: np.ndarray, step: float) -> np.ndarray:
    """(k, 2), of the surface over the base at places (k, 2), from heights a step to either side."""
    found = np.zeros(xy.shape)
    for axis in (0, 1):
        aside = step * np.eye(2)[axis]
        found[:, axis] = _over_base(surface, base, xy + aside) - _over_base(surface, base, xy - aside)
    return found / (2.0 * step)


def _with_lowest(
    surface: Surface, boundary: Boundary, sigma: float, by_corner: np.ndarray, area: float, step: float
) -> float:
    """m⁶, where the base is the lowest height along the boundary: mean square over draws of the corners.

    Another place may become the lowest one, and where several are nearly as low one of them does: no derivative
    says that.

    Parameters
    ----------
    by_corner : (corners, 2) m², of the area. area : m², over which the base counts; less than 0 of a fill.
    """
    places, rings = boundary_heights(surface, boundary), boundary.rings
    xy, z = places[:, :2], places[:, 2]
    slopes = _slopes(surface, level(0.0), xy, step)
    slopes = np.where(np.isfinite(slopes), slopes, 0.0)
    edge, following, share = _between_corners(xy, rings)
    drawn = np.random.default_rng(0).normal(scale=sigma, size=(DRAWS, len(by_corner), 2))
    square = 0.0
    for one in drawn:
        moved = (1.0 - share) * one[edge] + share * one[following]
        lower = float(np.min(z + np.sum(moved * slopes, axis=1)) - z.min())
        square += (float(np.sum(by_corner * one)) - area * lower) ** 2
    return square / DRAWS


def _to_corners(places: np.ndarray, by_places: np.ndarray, rings: list[np.ndarray]) -> np.ndarray:
    """(corners, 2), what derivatives by places (k, 2) along the rings are by the corners next to each."""
    edge, following, share = _between_corners(places, rings)
    found = np.zeros((sum(len(ring) - 1 for ring in rings), 2))
    np.add.at(found, edge, (1.0 - share) * by_places)
    np.add.at(found, following, share * by_places)
    return found


def _between_corners(places: np.ndarray, rings: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(k,) corners before and after places (k, 2) along the rings, (k, 1) how far they are between both, 0 to 1."""
    starts = np.concatenate([ring[:-1] for ring in rings])
    ends = np.concatenate([ring[1:] for ring in rings])
    following = np.concatenate([_following(ring, first) for ring, first in zip(rings, _firsts(rings), strict=True)])
    tree = shapely.STRtree([shapely.LineString(pair) for pair in np.stack([starts, ends], axis=1)])
    edge = np.asarray(tree.nearest(shapely.points(places)))
    along = ends[edge] - starts[edge]
    share = np.sum((places - starts[edge]) * along, axis=1) / np.maximum(np.sum(along**2, axis=1), 1e-300)
    return edge, following[edge], np.clip(share, 0.0, 1.0)[:, None]


def _firsts(rings: list[np.ndarray]) -> np.ndarray:
    """Number of the first corner of each ring among those of all."""
    return np.concatenate([[0], np.cumsum([len(ring) - 1 for ring in rings])])[:-1]


def _following(ring: np.ndarray, first: int) -> np.ndarray:
    """Number of the corner after each of a ring."""
    return first + (np.arange(len(ring) - 1) + 1) % (len(ring) - 1)


def _over_base(surface: Surface, base: Base, xy: np.ndarray) -> np.ndarray:
    """(n,) m, heights of the surface over the base at places (n, 2)."""
    return sampled(surface, xy[:, 0], xy[:, 1]) - base.heights(xy[:, 0], xy[:, 1])
