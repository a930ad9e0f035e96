"""The standard deviation of tie points, from how the rays of two photographs miss one another."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from aerotri.conventions import SIGMA_PER_MAD
from aerotri.formats.assembly.reprojection import Reprojection, ideal_tangents
from aerotri.observations import Block

POWERS = tuple((i, j) for i in range(4) for j in range(4 - i))
"""Of x and y, up to the third together: what errors of an orientation and of a lens do to the parallaxes of a pair over
flat ground."""
UNKNOWNS = len(POWERS) + 3
"""With what the height of the ground changes in it: the place along the base in the other photograph, by 1, x and y."""
FEWEST = 10 * UNKNOWNS
"""Points of a pair from which so many unknowns can be taken off without much effect on the rest [C]."""
MOST_PAIRS = 2000
"""Pairs that are looked at [C]: the median of their parallaxes is known to a per cent long before."""
GROSS = 4.0
"""Robust standard deviations from which a parallax does not count for the polynomial [C]."""
Rays = tuple[np.ndarray, np.ndarray]


def with_sigma_of_ties(
    block: Block, orientation: tuple[np.ndarray, np.ndarray], found: Reprojection, ties: int
) -> tuple[Block, float]:
    """The block with the standard deviation of a coordinate that the misfit of its tie points shows, and it in px.

    Ratios between the rays stay.

    Parameters
    ----------
    orientation : (n, 3) m and (n, 3, 3), NaN where not known. found : how the rays fit. ties : the first so many points
        are tie points.
    """
    rays = block.image_points
    own = rays.point < ties
    rest = list(_rest_of_pairs(block, orientation, np.flatnonzero(own)))
    factor = float(SIGMA_PER_MAD * np.median(np.abs(np.concatenate(rest)))) if rest else _factor_of(block, found, own)
    if not factor > 0.0:
        factor = 1.0
    sigma = np.where(own[:, None], factor * rays.sigma, rays.sigma)
    common = float(np.median(sigma[own])) if own.any() else float(np.median(sigma))
    settings = replace(block.settings, image_sigma_um=1e3 * common)
    changed = replace(block, image_points=replace(rays, sigma=sigma), settings=settings)
    return changed, common / block.cameras[0].pixel_mm


def _factor_of(block: Block, found: Reprojection, own: np.ndarray) -> float:
    """Standard deviation over the stated one, of the rays (m,) bool; NaN without any.

    Of a point with k rays, residuals have 2k − 3 redundant coordinates of 2k; half of two-dimensional errors are less
    than √(2 ln 2) σ [L].
    """
    rays = block.image_points
    own = own & np.isfinite(found.residual_px)
    if not own.any():
        return float("nan")
    length = np.bincount(rays.point, minlength=len(block.points))[rays.point[own]]
    pixel = np.array([camera.pixel_mm for camera in block.cameras])[block.images.camera[rays.image[own]]]
    relative = found.residual_px[own] * pixel / rays.sigma[own].mean(axis=1) / np.sqrt(1.0 - 3.0 / (2.0 * length))
    return float(np.median(relative)) / np.sqrt(2.0 * np.log(2.0))


def _rest_of_pairs(
    block: Block, orientation: tuple[np.ndarray, np.ndarray], own: np.ndarray
) -> Iterator[np.ndarray]:  # fmt: skip
    """Parallaxes over their σ of every pair with points enough, without what is smooth."""
    rays, tangent = block.image_points, ideal_tangents(block)
    scale = np.array([camera.focal_length_mm for camera in block.cameras])[block.images.camera[rays.image]]
    sigma = rays.sigma.mean(axis=1) / scale
    for one, other in _pairs(rays.image, rays.point, own):
        pair = rays.image[one[0]], rays.image[other[0]]
        z = parallaxes(orientation, pair, (tangent[one], tangent[other]), (sigma[one], sigma[other]))
        known = np.isfinite(z)
        if known.sum() >= FEWEST:
            along = tangent[other] @ base_in(orientation, pair)
            yield without_smooth_part(z[known], tangent[one][known], along[known])


def _pairs(image: np.ndarray, point: np.ndarray, own: np.ndarray) -> Iterator[Rays]:
    """Rays of the first and of the second photograph of pairs, point by point."""
    from scipy.sparse import csr_array

    order = own[np.lexsort((point[own], image[own]))]
    bounds = np.searchsorted(image[order], np.arange(int(image.max(initial=-1)) + 2))
    seen = csr_array((np.ones(len(order), np.int32), point[order], bounds))
    both = (seen @ seen.T).tocoo()
    enough = (both.row < both.col) & (both.data >= FEWEST)
    pairs = sorted(zip(both.row[enough].tolist(), both.col[enough].tolist(), strict=True))
    for i, j in pairs[:: len(pairs) // MOST_PAIRS + 1]:
        first, second = (order[bounds[k] : bounds[k + 1]] for k in (i, j))
        _, at, there = np.intersect1d(point[first], point[second], assume_unique=True, return_indices=True)
        yield first[at], second[there]


def parallaxes(
    orientation: tuple[np.ndarray, np.ndarray], pair: tuple[int, int], tangent: Rays, sigma: Rays
) -> np.ndarray:
    """(k,) by how much rays of two photographs miss one another, over its standard deviation [D].

    p = b·(d₁ × d₂), b the base, d the directions of the rays; its partials by them are d₂ × b and b × d₁.

    Parameters
    ----------
    orientation : centres (n, 3) m and rotations (n, 3, 3). tangent : (k, 2) each, sigma : (k,) each, of tangents.
    """
    centre, rotation = orientation
    i, j = pair
    one, other = (np.column_stack([t, -np.ones(len(t))]) @ rotation[k].T for k, t in zip(pair, tangent, strict=True))
    base = centre[j] - centre[i]
    by_one, by_other = np.cross(other, base), np.cross(base, one)
    variance = (sigma[0] ** 2) * ((by_one @ rotation[i])[:, :2] ** 2).sum(axis=1)
    variance += (sigma[1] ** 2) * ((by_other @ rotation[j])[:, :2] ** 2).sum(axis=1)
    with np.errstate(all="ignore"):
        return np.einsum("ki,ki->k", one, by_one) / np.sqrt(variance)


def base_in(orientation: tuple[np.ndarray, np.ndarray], pair: tuple[int, int]) -> np.ndarray:
    """(2,) direction of the base in the second photograph of a pair."""
    centre, rotation = orientation
    base = ((centre[pair[1]] - centre[pair[0]]) @ rotation[pair[1]])[:2]
    return base / max(float(np.linalg.norm(base)), 1e-300)


def without_smooth_part(value: np.ndarray, xy: np.ndarray, along: np.ndarray) -> np.ndarray:
    """(k,) values less a polynomial, as large as without its unknowns.

    Parameters
    ----------
    xy : (k, 2) places in the first photograph. along : (k,) those along the base in the second.
    """
    x, y = (xy / np.abs(xy).max()).T
    height = along / np.abs(along).max()
    design = np.column_stack([*(x**i * y**j for i, j in POWERS), height, height * x, height * y])
    rest, good = value, np.ones(len(value), bool)
    for _ in range(2):
        rest = value - design @ np.linalg.lstsq(design[good], value[good], rcond=None)[0]
        good = np.abs(rest) <= GROSS * SIGMA_PER_MAD * np.median(np.abs(rest))
    return rest * np.sqrt(len(value) / (len(value) - UNKNOWNS))
