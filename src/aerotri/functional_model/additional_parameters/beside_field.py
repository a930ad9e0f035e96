"""What of a random field the other unknowns of a camera say.

[D] Scale is the orientation's: at its nodes a field is orthogonal to it, as no other set has a scale. Where the
principal point is unknown, mean dx and dy are its own, and the patterns of other smooth sets are theirs. Field and sets
together reach what they would reach otherwise, and each has a meaning. It is needed, too: residuals are formed in the
corrected plane, where errors that shrink the image by s make vᵀPv smaller by the factor (1 − s)²; over flat ground, or
beside a free principal distance or lens, nothing else speaks of s, and with many rays the likelihood would pay for any
size of the field. Patterns that jump at the seams of a camera are out of reach of a field.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from aerotri.functional_model.additional_parameters import brown, lens
from aerotri.functional_model.additional_parameters.grid import node_positions
from aerotri.functional_model.additional_parameters.registry import LINEAR_FAMILIES, is_grid, parameter_set
from aerotri.observations import Camera

Chosen = Iterable[tuple[str, Sequence[str]]]
RANK = 1e-9
"""Singular value, as a share of the largest, below which a direction says nothing new: columns have length 1, so that
it is far above their rounding and far below any real difference [C]."""


def patterns_of_other_unknowns(camera: Camera, items: Sequence[str], chosen: Chosen) -> np.ndarray:
    """Orthonormal patterns of the nodes of a field that other unknowns of the adjustment describe as well.

    Parameters
    ----------
    items : p nodes of one grid.
    chosen : families and their items in the adjustment, the field among them.

    Returns
    -------
    (p, k)
    """
    position, axis = node_positions(camera, items)
    x, y = position.T
    patterns = [_orientation(camera, x, y)] + [_patterns(camera, *one, x, y) for one in chosen]
    of_nodes = np.concatenate(patterns, axis=2)[np.arange(len(axis)), axis]
    size = np.linalg.norm(of_nodes, axis=0)
    left, weight, _ = np.linalg.svd(of_nodes[:, size > 0.0] / size[size > 0.0], full_matrices=False)
    return left[:, weight > RANK * weight.max(initial=0.0)]


def _orientation(camera: Camera, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(n, 2, k) of scale, and of the coordinates of the principal point that are unknown."""
    one, zero = np.ones_like(x), np.zeros_like(x)
    patterns = {"x0_mm": (one, zero), "y0_mm": (zero, one)}
    unknown = [p for name, p in patterns.items() if not camera.interior[name].fixed]
    return np.stack([np.stack(p, axis=1) for p in ((x, y), *unknown)], axis=2)


def _patterns(camera: Camera, family: str, items: Sequence[str], x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(n, 2, k) of one family; none of grids and of a camera's own parts."""
    x0, y0 = camera.principal_point_mm
    if family in LINEAR_FAMILIES:
        smooth = LINEAR_FAMILIES[family].camera_model is None and not is_grid(family)
        return parameter_set(family, items, camera).basis(x, y) if smooth else np.zeros((len(x), 2, 0))
    if family == brown.FAMILY.name:
        return brown.basis(x - x0, y - y0)[:, :, [brown.ITEMS.index(item) for item in items]]
    c = camera.focal_length_mm
    return lens.patterns((x - x0) / c, (y - y0) / c, lens.vector({}))[:, :, [lens.ITEMS.index(item) for item in items]]
