"""What of a random field the other unknowns of a camera say.

[D] Mean dx and dy, scale and the patterns of other parameter sets are theirs where they are unknown, not the field's:
at its nodes it is orthogonal to them. Field and sets together reach what they would reach otherwise, and each has a
meaning. It is needed, too: residuals are formed in the corrected plane, and a field with a scale of its own, or one
that a free lens makes up for, would shrink that plane together with principal distance and residuals towards nothing.
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


def said_by_others(camera: Camera, items: Sequence[str], chosen: Chosen) -> np.ndarray:
    """Orthonormal patterns of the nodes of a field that unknowns beside it say.

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
    patterns = [_interior_patterns(camera, x, y)] + [_patterns(camera, *one, x, y) for one in chosen]
    of_nodes = np.concatenate(patterns, axis=2)[np.arange(len(axis)), axis]
    size = np.linalg.norm(of_nodes, axis=0)
    left, weight, _ = np.linalg.svd(of_nodes[:, size > 0.0] / size[size > 0.0], full_matrices=False)
    return left[:, weight > RANK * weight.max(initial=0.0)]


def _interior_patterns(camera: Camera, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(n, 2, k) of the elements of the interior orientation that are unknown."""
    one, zero = np.ones_like(x), np.zeros_like(x)
    patterns = {"focal_length_mm": (x, y), "x0_mm": (one, zero), "y0_mm": (zero, one)}
    unknown = [np.stack(p, axis=1) for name, p in patterns.items() if not camera.interior[name].fixed]
    return np.stack(unknown, axis=2) if unknown else np.zeros((len(x), 2, 0))


def _patterns(camera: Camera, family: str, items: Sequence[str], x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(n, 2, k) of one family."""
    x0, y0 = camera.principal_point_mm
    if family in LINEAR_FAMILIES:
        fits = LINEAR_FAMILIES[family].CAMERA_MODEL in (None, camera.model) and not is_grid(family)
        return parameter_set(family, items, camera).basis(x, y) if fits else np.zeros((len(x), 2, 0))
    if family == brown.FAMILY:
        return brown.basis(x - x0, y - y0)[:, :, [brown.ITEMS.index(item) for item in items]]
    c = camera.focal_length_mm
    unit = np.eye(len(lens.ITEMS))[[lens.ITEMS.index(item) for item in items]]
    direction = (x - x0) / c, (y - y0) / c
    ideal = np.stack(direction, axis=1)
    return np.stack([lens.distort(*direction, one) - ideal for one in unit], axis=2)
