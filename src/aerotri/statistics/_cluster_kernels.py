"""Kernels over object points for clusters of photographs: how their rays pull at the unknowns.

A cluster is a set of photographs with all their rays; `label` (n,) has the number of every photograph's cluster.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aerotri.adjustment._point_kernels import E, linearise_point, reduce_point
from aerotri.adjustment.kernel_records import Elimination
from aerotri.compiled import kernel, leaf_kernel
from aerotri.compiled_records import record


@record
class Sides(NamedTuple):
    """Right sides of clusters with the points eliminated, added to; column c·k + f is side f of cluster c.

    Parameters
    ----------
    images : (n, 6, m·k). shared : (s, m·k). own : (m·k, m·k) what the points take away of the products of the sides.
    """

    images: np.ndarray
    shared: np.ndarray
    own: np.ndarray


@record
class Scores(NamedTuple):
    """Of every photograph, added to: scores (n, k) of k directions y, Σ yᵀaᵀPv, and products (n, k, k), yᵀaᵀPay."""

    scores: np.ndarray
    products: np.ndarray


@leaf_kernel
def ray_values(q, i, p, images, shared, points, work, values):
    """Whitened changes (2, k), out, of the ray q of point p in photograph i along k directions."""
    by_eo, by_pt, by_sh = work.by_eo, work.by_pt, work.by_sh
    columns, n_columns, union = work.columns, work.n_columns, work.union
    for row in range(2):
        for f in range(values.shape[1]):
            value = 0.0
            for t in range(E):
                value += by_eo[q, row, t] * images[i, t, f]
            for t in range(3):
                value += by_pt[q, row, t] * points[p, t, f]
            for t in range(n_columns[q]):
                value += by_sh[q, row, t] * shared[union[columns[q, t]], f]
            values[row, f] = value


@kernel
def mode_scores(first, last, problem, modes, found, work):
    """Scores of the directions `modes` (see `Directions`) by photograph, over the points first..last, into `found`."""
    rays, table, at, points, weighting = (
        problem.rays, problem.table, problem.values, problem.points, problem.weighting,
    )  # fmt: skip
    start, image, whitened = rays.start, rays.image, work.whitened
    images, shared, by_point = modes.images, modes.shared, modes.points
    k = images.shape[2]
    values = np.empty((2, k))
    for p in range(first, last):
        linearise_point(p, rays, table, at, points, weighting, work)
        for q in range(start[p + 1] - start[p]):
            i = image[start[p] + q]
            ray_values(q, i, p, images, shared, by_point, work, values)
            for f in range(k):
                found.scores[i, f] += values[0, f] * whitened[q, 0] + values[1, f] * whitened[q, 1]
                for g in range(k):
                    found.products[i, f, g] += values[0, f] * values[0, g] + values[1, f] * values[1, g]


@kernel
def cluster_sides(first, last, problem, label, modes, sides, work):
    """Sides A_cᵀP·(A·y) of every cluster c and direction y; of the misclosures A_cᵀPv where `modes` has none (k = 0).

    With the points first..last eliminated, see `Sides`.
    """
    rays, table, at, points, weighting = (
        problem.rays, problem.table, problem.values, problem.points, problem.weighting,
    )  # fmt: skip
    start, image = rays.start, rays.image
    by_eo, by_pt, by_sh, whitened = work.by_eo, work.by_pt, work.by_sh, work.whitened
    columns, n_columns, union = work.columns, work.n_columns, work.union
    couple, couple_shared = work.couple, work.couple_shared
    images, shared, by_point = modes.images, modes.shared, modes.points
    k = max(images.shape[2], 1)
    values, lower = np.empty((2, k)), np.zeros((3, 3))
    elimination = Elimination(lower, np.zeros(3))
    slots, pull = np.empty(by_eo.shape[0], np.int64), np.empty((by_eo.shape[0], 3, k))
    for p in range(first, last):
        n_rays, n_slots = start[p + 1] - start[p], 0
        _, n_union = linearise_point(p, rays, table, at, points, weighting, work)
        reduce_point(p, n_rays, n_union, points, 0.0, work, elimination)
        for q in range(n_rays):
            i = image[start[p] + q]
            slot = 0
            while slot < n_slots and slots[slot] != label[i]:
                slot += 1
            if slot == n_slots:
                slots[slot] = label[i]
                n_slots += 1
                for a in range(3):
                    for f in range(k):
                        pull[slot, a, f] = 0.0
            if images.shape[2]:
                ray_values(q, i, p, images, shared, by_point, work, values)
            else:
                values[0, 0], values[1, 0] = whitened[q, 0], whitened[q, 1]
            first_column = label[i] * k
            for f in range(k):
                x, y = values[0, f], values[1, f]
                for a in range(3):
                    pull[slot, a, f] += by_pt[q, 0, a] * x + by_pt[q, 1, a] * y
                for t in range(E):
                    sides.images[i, t, first_column + f] += by_eo[q, 0, t] * x + by_eo[q, 1, t] * y
                for t in range(n_columns[q]):
                    sides.shared[union[columns[q, t]], first_column + f] += by_sh[q, 0, t] * x + by_sh[q, 1, t] * y
        for slot in range(n_slots):
            for f in range(k):
                for a in range(3):
                    for c in range(a):
                        pull[slot, a, f] -= lower[a, c] * pull[slot, c, f]
                    pull[slot, a, f] /= lower[a, a]
        for slot in range(n_slots):
            for f in range(k):
                column = slots[slot] * k + f
                p0, p1, p2 = pull[slot, 0, f], pull[slot, 1, f], pull[slot, 2, f]
                for q in range(n_rays):
                    i = image[start[p] + q]
                    for t in range(E):
                        sides.images[i, t, column] -= couple[q, 0, t] * p0 + couple[q, 1, t] * p1 + couple[q, 2, t] * p2
                for t in range(n_union):
                    sides.shared[union[t], column] -= (
                        couple_shared[0, t] * p0 + couple_shared[1, t] * p1 + couple_shared[2, t] * p2
                    )
                for other in range(n_slots):
                    for g in range(k):
                        sides.own[column, slots[other] * k + g] += (
                            p0 * pull[other, 0, g] + p1 * pull[other, 1, g] + p2 * pull[other, 2, g]
                        )


@kernel
def point_pulls(first, last, problem, label, first_label, sides, work):
    """A_cᵀPv of the points first..last, added to `sides` (P, 3, m), of the clusters first_label .. first_label + m."""
    rays, table, at, points, weighting = (
        problem.rays, problem.table, problem.values, problem.points, problem.weighting,
    )  # fmt: skip
    start, image, by_pt, whitened = rays.start, rays.image, work.by_pt, work.whitened
    for p in range(first, last):
        linearise_point(p, rays, table, at, points, weighting, work)
        for q in range(start[p + 1] - start[p]):
            column = label[image[start[p] + q]] - first_label
            if column < 0 or column >= sides.shape[2]:
                continue
            for a in range(3):
                sides[p, a, column] += by_pt[q, 0, a] * whitened[q, 0] + by_pt[q, 1, a] * whitened[q, 1]
