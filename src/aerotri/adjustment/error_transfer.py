"""Lens and additional parameters that say the image errors which another set said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import lstsq
from scipy.sparse import csr_array

from aerotri.adjustment.normal_equations import NormalSystem
from aerotri.adjustment.robust import LEAST_SQUARES
from aerotri.adjustment.scanned_rays import linearise_unknown_rays
from aerotri.adjustment.unknowns import State, Unknowns

RAYS_AT_ONCE = 20_000
"""Rays linearised at once: some 30 MB."""
NOT_SEEN = 1e-10
"""Singular value, relative to the largest, of what the image points do not tell apart [C]: it is left alone."""


def with_image_errors(system: NormalSystem, start: State, old: NormalSystem, ended: State) -> State:
    """The start with the parameters whose image errors come nearest to those of an adjustment with another set.

    By least squares over the image points, random fields with their prior. Orientations and points are those of the
    start, which has to be where the other adjustment ended.

    Parameters
    ----------
    system : with the new set. start : of it, other shared parameters as they shall stay.
    old : with the other set and the same rays. ended : where its adjustment ended.
    """
    u = system.unknowns
    own = np.flatnonzero(_acts_on_rays(u))
    if not len(own) or not np.array_equal(u.rays.source, old.unknowns.rays.source):
        return start
    missing = (
        system.right_side(start, LEAST_SQUARES).residual - old.right_side(ended, LEAST_SQUARES).residual
    ) * u.rays.inv_sigma
    normals, right = np.zeros((len(own), len(own))), np.zeros(len(own))
    for first in range(0, len(missing), RAYS_AT_ONCE):
        rays = np.arange(first, min(first + RAYS_AT_ONCE, len(missing)))
        columns = _whitened_columns(u, start, rays)[:, own]
        normals += (columns.T @ columns).toarray()
        right += columns.T @ missing[rays].ravel()
    place = np.full(len(u.shared), -1)
    place[own] = np.arange(len(own))
    for prior in system.priors.joint:
        if (place[prior.columns] >= 0).all():
            at = place[prior.columns]
            normals[np.ix_(at, at)] += prior.weight
            right[at] -= prior.weight @ start.shared[prior.columns]
    scale = np.sqrt(np.maximum(np.diagonal(normals), np.finfo(float).tiny))
    scaled = lstsq(normals / np.outer(scale, scale), right / scale, cond=NOT_SEEN)
    assert scaled is not None
    shared = start.shared.copy()
    shared[own] += scaled[0] / scale
    return u.with_followers(replace(start, shared=shared))


def _acts_on_rays(unknowns: Unknowns) -> np.ndarray:
    """(s,) bool, whether a shared parameter is one of the interior orientation, the lens or an additional one."""
    acts = np.zeros(len(unknowns.shared), dtype=bool)
    for index in (unknowns.lens.columns, unknowns.rays.ap_index):
        acts[index[index >= 0]] = True
    return acts


def _whitened_columns(unknowns: Unknowns, state: State, rays: np.ndarray) -> csr_array:
    """(2 k, s) partials of the image coordinates of rays by the shared parameters that act on them, over σ."""
    u = unknowns.rays
    partials = linearise_unknown_rays(unknowns, state, rays)[0]
    index = np.concatenate([unknowns.lens.columns[u.lens_row[rays]], u.ap_index[rays]], axis=1)
    value = np.concatenate([partials.by_interior, u.ap_value[rays]], axis=2) * u.inv_sigma[rays][:, :, None]
    index = np.repeat(index[:, None, :], 2, axis=1)
    row = np.broadcast_to(np.arange(2 * len(rays)).reshape(-1, 2, 1), index.shape)
    there = index >= 0
    return csr_array((value[there], (row[there], index[there])), shape=(2 * len(rays), len(unknowns.shared)))
