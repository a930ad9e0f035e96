"""Weighted rigs: photographs with six unknowns of their own, tied to the place that station and mounting give them.

[D] The deviation of a photograph from its place, in the axes of the reference camera, is observed to be zero:

    d_position = R_sᵀ(X0 − X0_s) − t_k,   d_rotation = Log(R_sᵀ·R·R_kᵀ),

each with the σ of the movements of camera k. σ → 0 is the rigid rig, σ → ∞ independent cameras.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from aerotri.adjustment.kernel_records import Inverse
from aerotri.adjustment.rigging import Mountings
from aerotri.functional_model.observed_unknowns import inverse_left_jacobian
from aerotri.functional_model.rotation import cross_matrix, logarithm

LEAST = np.array([1e-5, 1e-8])
"""σ, m and rad, in place of smaller ones [C]: no photograph would notice, and the normal equations stay well scaled."""


class TieRows(NamedTuple):
    """Deviations of t photographs, linearised.

    Parameters
    ----------
    deviation : (t, 6). by_image, by_lead, by_shared : (t, 6, 6) its partials by the photograph, the reference
        photograph, and the shared parameters `columns` (t, 6), −1 where an element is held.
    """

    deviation: np.ndarray
    by_image: np.ndarray
    by_lead: np.ndarray
    by_shared: np.ndarray
    columns: np.ndarray


@dataclass(frozen=True, eq=False)
class Ties:
    """Which photographs are tied to which, t of them.

    Parameters
    ----------
    image, lead : (t,) rows of the photograph and of the reference photograph of its station.
    block : (t,) their place in the pattern of the normal matrix.
    mounting : (t,) row of `mountings`.
    sigma : (k, 2) of the movements of every camera, m and rad; inf where it moves freely.
    """

    image: np.ndarray
    lead: np.ndarray
    block: np.ndarray
    mounting: np.ndarray
    mountings: Mountings
    sigma: np.ndarray

    @property
    def count(self) -> int:
        """Number of observations."""
        return int((self.inv_sigma > 0.0).sum())

    @property
    def inv_sigma(self) -> np.ndarray:
        """(t, 6)."""
        return np.repeat(1.0 / np.maximum(self.sigma, LEAST), 3, axis=1)[self.mounting]

    def with_sigma(self, sigma: np.ndarray) -> Ties:
        """The same with other σ (k, 2)."""
        return replace(self, sigma=sigma)

    def rows(
        self, centre: np.ndarray, rotation: np.ndarray, shared: np.ndarray, turn: np.ndarray, eo_free: np.ndarray
    ) -> TieRows:
        """Linearised.

        Parameters
        ----------
        centre : (n, 3). rotation : (n, 3, 3). shared : (s,). turn : (n, 3, 3) basis of the small rotations.
        eo_free : (n, 6) bool.
        """
        i, a, k = self.image, self.lead, self.mounting
        position, mounted = self.mountings.at(shared)
        back, arm = np.swapaxes(rotation[a], 1, 2), centre[i] - centre[a]
        turned = logarithm(back @ rotation[i] @ np.swapaxes(mounted[k], 1, 2))
        deviation = np.concatenate([np.einsum("tij,tj->ti", back, arm) - position[k], turned], axis=1)
        by_image, by_lead = np.zeros((len(i), 6, 6)), np.zeros((len(i), 6, 6))
        by_shared = np.zeros((len(i), 6, 6))
        by_delta = inverse_left_jacobian(turned) @ back
        by_image[:, :3, :3] = back
        by_image[:, 3:, 3:] = by_delta @ turn[i]
        by_lead[:, :3, :3] = -back
        by_lead[:, :3, 3:] = back @ cross_matrix(arm) @ turn[a]
        by_lead[:, 3:, 3:] = -by_delta @ turn[a]
        by_shared[:, :3, :3] = -np.eye(3)
        by_shared[:, 3:, 3:] = -inverse_left_jacobian(-turned) @ self.mountings.axes(shared)[k]
        columns = self.mountings.columns[k]
        by_image *= eo_free[i][:, None, :]
        by_lead *= eo_free[a][:, None, :]
        by_shared *= (columns >= 0)[:, None, :]
        return TieRows(deviation, by_image, by_lead, by_shared, columns)

    def whitened(self, rows: TieRows) -> TieRows:
        """The rows over σ."""
        weight = self.inv_sigma
        by_image, by_lead, by_shared = (part * weight[:, :, None] for part in rows[1:4])
        return TieRows(rows.deviation * weight, by_image, by_lead, by_shared, rows.columns)

    def add_to(self, rows: TieRows, blocks: np.ndarray, border: np.ndarray, corner: np.ndarray) -> None:
        """Add whitened rows to the matrix of photographs and shared parameters."""
        np.add.at(blocks, self.image, _products(rows.by_image, rows.by_image))
        np.add.at(blocks, self.lead, _products(rows.by_lead, rows.by_lead))
        both = _products(rows.by_lead, rows.by_image)
        upper = (self.lead < self.image)[:, None, None]
        np.add.at(blocks, self.block, np.where(upper, both, np.swapaxes(both, 1, 2)))
        for image, by in ((self.image, rows.by_image), (self.lead, rows.by_lead)):
            t, c = np.nonzero(rows.columns >= 0)
            np.add.at(border, (image[t], rows.columns[t, c]), np.einsum("tka,tk->ta", by[t], rows.by_shared[t, :, c]))
        among = _products(rows.by_shared, rows.by_shared)
        t, c, d = np.nonzero((rows.columns >= 0)[:, :, None] & (rows.columns >= 0)[:, None, :])
        np.add.at(corner, (rows.columns[t, c], rows.columns[t, d]), among[t, c, d])

    def add_squares(self, rows: TieRows, squares: np.ndarray, squares_shared: np.ndarray) -> None:
        """Add the squared columns of whitened rows, (n, 6) and (s,)."""
        np.add.at(squares, self.image, np.sum(rows.by_image**2, axis=1))
        np.add.at(squares, self.lead, np.sum(rows.by_lead**2, axis=1))
        there = rows.columns >= 0
        np.add.at(squares_shared, rows.columns[there], np.sum(rows.by_shared**2, axis=1)[there])

    def add_gaps(self, rows: TieRows, right: np.ndarray, right_shared: np.ndarray) -> None:
        """Subtract what whitened deviations pull, from the right side (n, 6) and (s,)."""
        np.add.at(right, self.image, -np.einsum("tka,tk->ta", rows.by_image, rows.deviation))
        np.add.at(right, self.lead, -np.einsum("tka,tk->ta", rows.by_lead, rows.deviation))
        there = rows.columns >= 0
        np.add.at(
            right_shared, rows.columns[there], -np.einsum("tkc,tk->tc", rows.by_shared, rows.deviation)[there]
        )  # fmt: skip

    def along(self, rows: TieRows, images: np.ndarray, shared: np.ndarray) -> np.ndarray:
        """(t, 6, m) what directions of photographs (n, 6, m) and shared parameters (s, m) change the rows by."""
        value = rows.by_image @ images[self.image] + rows.by_lead @ images[self.lead]
        if len(shared):
            value += rows.by_shared @ (shared[np.maximum(rows.columns, 0)] * (rows.columns >= 0)[:, :, None])
        return value

    def cofactors(self, rows: TieRows, inverse: Inverse) -> np.ndarray:
        """(t, 6, 6) of the deviations that rows predict, from the inverse of the normal matrix on its pattern."""
        i, a, columns = self.image, self.lead, np.maximum(rows.columns, 0)
        both = inverse.blocks[self.block]
        both = np.where((a < i)[:, None, None], both, np.swapaxes(both, 1, 2))
        q = _through(rows.by_image, inverse.blocks[i], rows.by_image)
        q += _through(rows.by_lead, inverse.blocks[a], rows.by_lead)
        mixed = _through(rows.by_lead, both, rows.by_image)
        if len(inverse.corner):
            q += _through(rows.by_shared, inverse.corner[columns[:, :, None], columns[:, None, :]], rows.by_shared)
            for image, by in ((i, rows.by_image), (a, rows.by_lead)):
                of_shared = inverse.border[image[:, None], columns]
                mixed += _through(rows.by_shared, of_shared, by)
        return q + mixed + np.swapaxes(mixed, 1, 2)


def _products(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(t, 6, 6) aᵀ·b."""
    return np.swapaxes(a, 1, 2) @ b


def _through(a: np.ndarray, q: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(t, 6, 6) a·q·bᵀ."""
    return a @ q @ np.swapaxes(b, 1, 2)
