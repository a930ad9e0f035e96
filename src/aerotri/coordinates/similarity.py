"""Similarity transformations that lead from one set of points nearest to another: Umeyama's closed form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Similarity:
    """target ≈ scale·R·source + translation.

    Parameters
    ----------
    scale : > 0. rotation : (3, 3). translation : (3,) m.
    """

    scale: float
    rotation: np.ndarray
    translation: np.ndarray

    def __call__(self, xyz: np.ndarray) -> np.ndarray:
        """(n, 3) points of the source where the target has them."""
        return self.scale * xyz @ self.rotation.T + self.translation


def nearest_similarity(source: np.ndarray, target: np.ndarray, weight: np.ndarray | None = None) -> Similarity:
    """The similarity by least squares of two sets of points (k, 3), with weights (k,)."""
    weight = np.ones(len(source)) if weight is None else weight
    scale, rotation, translation = nearest_similarities(source[None], target[None], weight[None])
    return Similarity(float(scale[0]), rotation[0], translation[0])


def nearest_similarities(
    source: np.ndarray, target: np.ndarray, weight: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Scales (t,), rotations (t, 3, 3), translations (t, 3) of t weighted sets (t, k, 3) [L: Umeyama 1991]."""
    share = weight / weight.sum(axis=1, keepdims=True)
    middle, aim = (np.einsum("tk,tki->ti", share, xyz) for xyz in (source, target))
    p, q = source - middle[:, None], target - aim[:, None]
    u, size, vt = np.linalg.svd(np.einsum("tk,tki,tkj->tij", share, q, p))
    sign = np.ones_like(size)
    sign[:, 2] = np.sign(np.linalg.det(u @ vt))
    rotation = (u * sign[:, None, :]) @ vt
    spread = np.einsum("tk,tki,tki->t", share, p, p)
    scale = (size * sign).sum(axis=1) / np.maximum(spread, 1e-300)
    translation = aim - scale[:, None] * np.einsum("tij,tj->ti", rotation, middle)
    return scale, rotation, translation
