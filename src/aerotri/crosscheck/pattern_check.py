"""Our patterns and equations directly against those of the independent model, position by position.

Two adjustments agree within a share of σ although a coefficient is off by a thousandth, where the parameter is small.
The patterns themselves are therefore compared, every parameter of the block, to rounding.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from aerotri.crosscheck.comparison import PatternDifference
from aerotri.crosscheck.paper_block import PaperBlock
from aerotri.crosscheck.paper_families import LINEAR
from aerotri.crosscheck.paper_rays import ELEMENTS, linearise
from aerotri.functional_model import collinearity
from aerotri.functional_model.additional_parameters.family import Parameter
from aerotri.functional_model.additional_parameters.registry import parameter_sets
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations import Camera
from aerotri.results.adjusted_block import AdjustedBlock

POSITIONS = 400
"""Image points at least at which patterns are compared [C]: some in every tile, head and cell of the usual grids."""
POSITIONS_PER_ITEM = 4
"""Of families with many parameters: nodes of a fine grid act near themselves alone."""
RAYS = 400
"""Rays at most at which the collinearity equations are compared [C]."""
EQUATIONS = "collinearity equations"


def positions(camera: Camera, count: int) -> tuple[np.ndarray, np.ndarray]:
    """x and y (count,) mm spread evenly over the format: multiples of two irrational steps [L: Roberts 2018]."""
    # the root of t³ = t + 1 gives the two steps whose multiples lie farthest apart
    root = 1.3247179572447460
    share = np.outer(np.arange(1, count + 1), [1.0 / root, 1.0 / root**2]) % 1.0
    x, y = ((2.0 * share - 1.0) * camera.half_format_mm).T
    return x, y


def pattern_errors(camera: Camera, names: Iterable[str]) -> dict[str, float]:
    """Largest difference of the pattern of every linear parameter that acts in a camera, relative to its largest value.

    Parameters
    ----------
    names : of parameters that the independent model has a formula for, such as 'dmc.30'.
    """
    errors: dict[str, float] = {}
    for ours in parameter_sets((name for name in names if Parameter.of(name).family in LINEAR), camera):
        x, y = positions(camera, max(POSITIONS, POSITIONS_PER_ITEM * len(ours.items)))
        basis, peer = ours.basis(x, y), LINEAR[ours.family].patterns(camera, x, y, ours.items)
        errors |= dict(zip(ours.names, _relative(basis, peer), strict=True))
    return errors


def _relative(ours: np.ndarray, peer: np.ndarray) -> list[float]:
    """Largest difference of every column of (m, 2, q) arrays, over its largest value; 0 for a column that is 0."""
    size = np.maximum(np.abs(ours).max(axis=(0, 1)), np.abs(peer).max(axis=(0, 1)))
    difference = np.abs(ours - peer).max(axis=(0, 1))
    return np.where(size > 0.0, difference / np.where(size > 0.0, size, 1.0), 0.0).tolist()


def equation_errors(adjusted: AdjustedBlock, paper: PaperBlock, values: np.ndarray) -> dict[str, float]:
    """Largest difference of image points, and of their partials by interior orientation, brown and lens, relative.

    Parameters
    ----------
    values : (s,) the adjusted value of every shared entry of `paper`.
    """
    rays = paper.rays
    chosen = np.unique(np.linspace(0, len(rays.image) - 1, RAYS).astype(int))
    image, point = rays.image[chosen], rays.point[chosen]
    elements = values[rays.elements]
    centre, angles = adjusted.images.centre[paper.images] - paper.origin, adjusted.images.angles[paper.images]
    points = adjusted.points.xyz[paper.points] - paper.origin
    ours = collinearity.linearise(
        rotation_from_angles(angles, paper.order), centre, points, elements, image, point, rays.setup[chosen],
        rays.at[chosen],
    )  # fmt: skip
    used = [k for k in range(len(ELEMENTS) - 1) if paper.shared.free[rays.elements[:, k]].any() or elements[:, k].any()]
    pose = np.column_stack([centre, angles])[image]
    prediction, by_pose, by_elements = linearise(
        pose, None, points[point], elements[rays.setup[chosen]], rays.at[chosen], paper.order, np.array(used)
    )
    columns = [collinearity.INTERIOR_COLUMNS.index(ELEMENTS[k]) for k in used]
    same = max(
        *_relative(ours.prediction[:, :, None], prediction[:, :, None]), *_relative(ours.by_point, -by_pose[:, :, :3])
    )
    by_interior = _relative(ours.by_interior[:, :, columns], by_elements)
    return {EQUATIONS: same, **dict(zip((ELEMENTS[k] for k in used), by_interior, strict=True))}


def compare_patterns(adjusted: AdjustedBlock, paper: PaperBlock, values: np.ndarray) -> PatternDifference:
    """The patterns of all parameters of the block, and its collinearity equations; arguments of `equation_errors`."""
    errors = equation_errors(adjusted, paper, values)
    block = adjusted.block
    for row in sorted(set(block.images.camera[paper.images].tolist())):
        for name, error in pattern_errors(block.cameras[row], paper.shared.names).items():
            errors[name] = max(error, errors.get(name, 0.0))
    worst = max(errors, key=lambda name: np.nan_to_num(errors[name], nan=np.inf))
    return PatternDifference(tuple(errors), errors[worst], worst)
