"""Collocation: the image error as a random field, known through the nodes of a bilinear grid. It knows no camera.

[D] dx and dy are independent fields of covariance σ_d²·exp(−ρ/ℓ), ρ the distance in the image; the spacing of the nodes
has to be well below ℓ. The field enters as one weighted observation of the node vector, p = 0 with the inverse of its
covariance as weight, so that every node can be estimated however few rays are near it. Items as in `grid`. Between the
nodes interpolation makes the field a little smoother than the covariance says. Shifts, rotation and tilts of the whole
field stay nearly unknown, since the orientation takes them over flat ground: pictures leave them out. Scale and what
other unknowns say the field does not, see `beside_field`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from aerotri.functional_model.additional_parameters.grid import node_family, node_positions
from aerotri.observations import Camera

FAMILY = node_family(
    "collocation", "D", "Image error as a random field, bilinear between nodes; derived for this project", (19, 13)
)
"""19 × 13 nodes unless others are asked for [D]: square cells in a format of 3 : 2, their spacing well below usual
correlation lengths; far wider ones smooth the field, narrower ones add unknowns that say nothing."""
HELD_MM = 1e-5
"""σ of what a field does not have: far below any measurement, far above rounding."""


def prior_covariance(
    camera: Camera, items: Sequence[str], sigma_d: float, length: float, held: np.ndarray | None = None
) -> np.ndarray:
    """Covariance of the nodes before anything is measured: σ_d²·exp(−ρ/ℓ) within dx and within dy, 0 between them.

    Parameters
    ----------
    items : p nodes of one grid.
    sigma_d : mm, σ of the field.
    length : mm, correlation length ℓ.
    held : (p, k) orthonormal patterns that the field does not have, within `HELD_MM`.

    Returns
    -------
    (p, p) mm², positive definite.
    """
    position, axis = node_positions(camera, items)
    covariance = np.zeros((len(axis), len(axis)))
    for own in (np.flatnonzero(axis == k) for k in (0, 1)):
        covariance[np.ix_(own, own)] = _exponential(position[own], sigma_d, length)
    if held is None or not held.size:
        return covariance
    mixed = covariance @ held
    return covariance - mixed @ np.linalg.solve(held.T @ mixed + HELD_MM**2 * np.eye(held.shape[1]), mixed.T)


def prior_weight(
    camera: Camera, items: Sequence[str], sigma_d: float, length: float, held: np.ndarray | None = None
) -> tuple[np.ndarray, float]:
    """Inverse of `prior_covariance`, and the logarithm of the determinant of the covariance.

    Returns
    -------
    (p, p) 1/mm², and a number.
    """
    position, axis = node_positions(camera, items)
    patterns = np.zeros((len(axis), 0)) if held is None else held / HELD_MM
    weight, log_determinant, seen = patterns @ patterns.T, 0.0, np.eye(patterns.shape[1])
    for own in (np.flatnonzero(axis == k) for k in (0, 1)):
        lower = cholesky(_exponential(position[own], sigma_d, length), lower=True)
        half = solve_triangular(lower, np.eye(len(own)), lower=True)
        weight[np.ix_(own, own)] += half.T @ half
        log_determinant += 2.0 * float(np.sum(np.log(np.diagonal(lower))))
        part = lower.T @ patterns[own]
        seen += part.T @ part
    return weight, log_determinant - float(np.linalg.slogdet(seen)[1])


def _exponential(position: np.ndarray, sigma_d: float, length: float) -> np.ndarray:
    distance = np.hypot(*(position[:, None, :] - position[None, :, :]).transpose(2, 0, 1))
    return sigma_d**2 * np.exp(-distance / length)
