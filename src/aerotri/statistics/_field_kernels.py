"""Kernels over object points for random fields of image errors that clusters of photographs have.

A field is given at nodes over the format and bilinear between them; every cluster has its own. Column
(2·c + component)·nodes + node is the error of one node of cluster c in x or y.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerotri.adjustment._point_kernels import E, linearise_point, reduce_point
from aerotri.adjustment.kernel_records import Elimination
from aerotri.compiled import kernel


class Nodes(NamedTuple):
    """Where the rays lie among `count` nodes: node (r, 4) and weight (r, 4); label (n,) the photographs' clusters."""

    node: np.ndarray
    weight: np.ndarray
    label: np.ndarray
    count: int


class FieldSums(NamedTuple):
    """What the rays say of the errors at k nodes, added to.

    Parameters
    ----------
    images (n, 6, k), shared (s, k) : AᵀPB with the points eliminated. own : (k, k) BᵀPB with the points eliminated.
    scores : (k,) BᵀPv. place : (k,) −1, room of the kernel.
    """

    images: np.ndarray
    shared: np.ndarray
    own: np.ndarray
    scores: np.ndarray
    place: np.ndarray


@kernel
def field_sides(first, last, problem, nodes, found, work):
    """What the points first..last say of the nodes, into `found`."""
    rays, table, at, points, weighting = (
        problem.rays, problem.table, problem.values, problem.points, problem.weighting,
    )  # fmt: skip
    start, image, inv_sigma, weight = rays.start, rays.image, rays.inv_sigma, weighting.weight
    by_eo, by_pt, by_sh, whitened = work.by_eo, work.by_pt, work.by_sh, work.whitened
    columns, n_columns, union = work.columns, work.n_columns, work.union
    couple, couple_shared = work.couple, work.couple_shared
    node, share, label, count, place = nodes.node, nodes.weight, nodes.label, nodes.count, found.place
    lower = np.zeros((3, 3))
    elimination = Elimination(lower, np.zeros(3))
    active, pull = np.empty(8 * by_eo.shape[0], np.int64), np.empty((8 * by_eo.shape[0], 3))
    for p in range(first, last):
        n_rays, n_active = start[p + 1] - start[p], 0
        _, n_union = linearise_point(p, rays, table, at, points, weighting, work)
        reduce_point(p, n_rays, n_union, points, 0.0, work, elimination)
        for q in range(n_rays):
            ray = start[p] + q
            i = image[ray]
            for row in range(2):
                f = inv_sigma[ray, row] * np.sqrt(weight[ray])
                begun = (2 * label[i] + row) * count
                for corner in range(4):
                    column, value = begun + node[ray, corner], share[ray, corner] * f
                    found.scores[column] += value * whitened[q, row]
                    for t in range(E):
                        found.images[i, t, column] += value * by_eo[q, row, t]
                    for t in range(n_columns[q]):
                        found.shared[union[columns[q, t]], column] += value * by_sh[q, row, t]
                    for other in range(4):
                        found.own[column, begun + node[ray, other]] += value * share[ray, other] * f
                    if place[column] < 0:
                        place[column] = n_active
                        active[n_active] = column
                        for a in range(3):
                            pull[n_active, a] = 0.0
                        n_active += 1
                    for a in range(3):
                        pull[place[column], a] += value * by_pt[q, row, a]
        for k in range(n_active):
            place[active[k]] = -1
            for a in range(3):
                for c in range(a):
                    pull[k, a] -= lower[a, c] * pull[k, c]
                pull[k, a] /= lower[a, a]
        for k in range(n_active):
            column, p0, p1, p2 = active[k], pull[k, 0], pull[k, 1], pull[k, 2]
            for q in range(n_rays):
                i = image[start[p] + q]
                for t in range(E):
                    found.images[i, t, column] -= couple[q, 0, t] * p0 + couple[q, 1, t] * p1 + couple[q, 2, t] * p2
            for t in range(n_union):
                found.shared[union[t], column] -= (
                    couple_shared[0, t] * p0 + couple_shared[1, t] * p1 + couple_shared[2, t] * p2
                )
            for other in range(n_active):
                found.own[column, active[other]] -= p0 * pull[other, 0] + p1 * pull[other, 1] + p2 * pull[other, 2]


@kernel
def field_point_sides(first, last, problem, nodes, root, sides, work):
    """A_pᵀP·B·R of the points first..last, added to `sides` (P, 3, 2·m·k), R = root (m, nodes, k) in x and in y."""
    rays, table, at, points, weighting = (
        problem.rays, problem.table, problem.values, problem.points, problem.weighting,
    )  # fmt: skip
    start, image, inv_sigma, weight, by_pt = rays.start, rays.image, rays.inv_sigma, weighting.weight, work.by_pt
    node, share, label, k = nodes.node, nodes.weight, nodes.label, root.shape[2]
    for p in range(first, last):
        linearise_point(p, rays, table, at, points, weighting, work)
        for q in range(start[p + 1] - start[p]):
            ray = start[p] + q
            part = label[image[ray]]
            begun = 2 * part * k
            for f in range(k):
                value = 0.0
                for corner in range(4):
                    value += share[ray, corner] * root[part, node[ray, corner], f]
                for row in range(2):
                    whitened = value * inv_sigma[ray, row] * np.sqrt(weight[ray])
                    for a in range(3):
                        sides[p, a, begun + row * k + f] += whitened * by_pt[q, row, a]
