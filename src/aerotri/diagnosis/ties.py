"""How the photographs hang together, and at which angles the rays of the points meet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csr_array, diags_array
from scipy.sparse.csgraph import connected_components, minimum_spanning_tree

from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.statistics.outliers import used_rays

MOST_CUTS = 200
"""Weak links that are looked at, the weakest first [C]: each costs a pass over the block, and a report names a few."""


@dataclass(frozen=True, eq=False)
class Ties:
    """Points that photographs have in common; n photographs.

    Parameters
    ----------
    shared : (n,) points of a photograph that another one has as well. strongest : (n,) most points in common with any
        single other photograph; neighbour : (n,) that photograph.
    cuts : where the block nearly falls into parts, fewest common points first.
    """

    shared: np.ndarray
    strongest: np.ndarray
    neighbour: np.ndarray
    cuts: tuple[Cut, ...]


@dataclass(frozen=True, eq=False)
class Cut:
    """A part of the block, the smaller one, and what ties it to the rest.

    Parameters
    ----------
    part : indices of its photographs. common : points that photographs on both sides have.
    """

    part: np.ndarray
    common: int


def photograph_ties(adjusted: AdjustedBlock, fewest: int) -> Ties:
    """The ties between the photographs that were adjusted.

    Parts are looked for along the strongest tree of ties (each photograph joined by as many common points as possible):
    where one of its links has fewer than `fewest` points, the points across are counted.
    """
    rays, n = adjusted.block.image_points, len(adjusted.block.images)
    used = used_rays(adjusted)
    image, point = rays.image[used], rays.point[used]
    sees = coo_array((np.ones(len(image)), (image, point)), shape=(n, len(adjusted.block.points))).tocsr()
    sees.data[:] = 1.0
    several = np.asarray(sees.sum(axis=0)).ravel() >= 2
    shared = np.asarray(sees[:, several].sum(axis=1)).ravel().astype(int)
    common = (sees @ sees.T).tocsr()
    common = (common - diags_array(common.diagonal())).tocsr()
    common.eliminate_zeros()
    strongest = common.max(axis=1).toarray().ravel().astype(int) if n else np.zeros(0, int)
    neighbour = np.asarray(common.argmax(axis=1)).ravel() if common.nnz else np.zeros(n, int)
    cuts = _cuts(common, sees, fewest) + _parts(common, adjusted.images.rays > 0)
    return Ties(shared, strongest, neighbour, tuple(sorted(cuts, key=lambda cut: cut.common)))


def _parts(common: csr_array, there: np.ndarray) -> list[Cut]:
    """Parts without any common point, all but the largest."""
    _, label = connected_components(common, directed=False)
    sizes = np.bincount(label[there], minlength=label.max(initial=0) + 1)
    largest = int(np.argmax(sizes))
    return [Cut(np.flatnonzero(there & (label == k)), 0) for k in np.flatnonzero(sizes) if k != largest]


def _cuts(common: csr_array, sees: csr_array, fewest: int) -> list[Cut]:
    """The weak links of the strongest tree, with the common points across the whole cut."""
    if not common.nnz:
        return []
    inverse = common.copy()
    inverse.data = 1.0 / inverse.data
    tree = minimum_spanning_tree(inverse).tocoo()
    weak = np.argsort(-tree.data)[:MOST_CUTS]
    weak = weak[1.0 / tree.data[weak] < fewest]
    cuts = []
    for link in weak:
        kept = np.arange(len(tree.data)) != link
        without = coo_array((tree.data[kept], (tree.row[kept], tree.col[kept])), shape=common.shape)
        label = connected_components(without, directed=False)[1]
        sides = label == label[tree.row[link]], label == label[tree.col[link]]
        across = int(np.logical_and(*(np.asarray(sees[side].sum(axis=0)).ravel() > 0 for side in sides)).sum())
        if across < fewest:
            cuts.append(Cut(np.flatnonzero(min(sides, key=np.sum)), across))
    return cuts


def intersection_angles(adjusted: AdjustedBlock) -> np.ndarray:
    """(N,) rad, the angle at which two rays would meet as well as the rays of each point; NaN below two rays.

    For directions d of unit length 2·asin √(1 − |mean d|²): of two rays the angle between them.
    """
    rays, points = adjusted.block.image_points, adjusted.points
    used = used_rays(adjusted)
    image, point = rays.image[used], rays.point[used]
    direction = adjusted.images.centre[image] - points.xyz[point]
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    count = np.bincount(point, minlength=len(points.rays))
    mean = np.stack([np.bincount(point, direction[:, k], len(count)) for k in range(3)], axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        mean /= count[:, None]
        # 1 − |mean|² as the mean square distance from the mean: no cancellation at small angles
        apart = np.sum((direction - mean[point]) ** 2, axis=1)
        size = np.sqrt(np.bincount(point, apart, len(count)) / count)
    return np.where(count >= 2, 2.0 * np.arcsin(np.clip(size, 0.0, 1.0)), np.nan)
