"""Image errors of two halves of a block compared: the difference by cell of the format, with a test of all cells.

What the orientation of a photograph takes is taken off first: shifts, scale, rotation and two tilts. Principal distance
and principal point are among these: over flat ground they are the scale and the shifts.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerotri.image_errors.field import errors_with_jacobian, grid_nodes, take_off_orientation
from aerotri.image_errors.groups import ImageGroup, image_groups
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.halves import AgreementTest, FieldDifference
from aerotri.strategies.half_tests import agreement_of_root, no_test

CELLS = 13
"""Cells along the longer side of the format [C]: what moves in a camera is wider, and each can be read in a plot."""
STEP_MM = 1e-3
"""For partials by principal distance and principal point: far below what bends an image error, far above rounding."""
RANK = 1e-6
"""Share of the largest direction of the difference below which the parameters cannot make the halves differ [C]."""


def field_differences(
    halves: tuple[AdjustedBlock, AdjustedBlock], covariance: np.ndarray, redundancy: float, alpha: float
) -> tuple[FieldDifference, ...]:
    """The differences first − second of all groups of photographs with additional parameters in both halves.

    Parameters
    ----------
    halves : with the parameters of each half, the same ones in the same order. covariance : (s, s) of the difference of
        these parameters, σ̂0² included. redundancy : from which σ̂0² is. alpha : of the test.
    """
    out = []
    for group in image_groups(halves[0].block):
        found = _difference(halves, group, covariance, redundancy, alpha)
        if found is not None:
            out.append(found)
    return tuple(out)


def _difference(
    halves: tuple[AdjustedBlock, AdjustedBlock], group: ImageGroup, covariance: np.ndarray, redundancy: float,
    alpha: float,
) -> FieldDifference | None:  # fmt: skip
    x, y = grid_nodes(group.camera, _columns(group))
    flat = x.ravel(), y.ravel()
    (one, partials, rows), (two, _, _) = (errors_with_jacobian(half, group, *flat) for half in halves)
    if not len(rows):
        return None
    whole = np.zeros((*partials.shape[:2], len(covariance)))
    whole[:, :, rows] = partials
    for row in _interior_rows(halves[0], group):
        whole[:, :, row] += _by_interior(halves[0], group, flat, row)
    d, whole = take_off_orientation(group.camera, *flat, one - two, whole)
    values, vectors = np.linalg.eigh(0.5 * (covariance + covariance.T))
    root = (whole @ (vectors * np.sqrt(np.maximum(values, 0.0)))).reshape(2 * x.size, -1)
    sigma = np.linalg.norm(root, axis=1)
    test = _tested(d.ravel(), sigma, root, redundancy, alpha)
    grid = (*x.shape, 2)
    return FieldDifference(group.camera, group.name, x, y, d.reshape(grid), sigma.reshape(grid), test)


def _columns(group: ImageGroup) -> int:
    half_x, half_y = group.camera.half_format_mm
    return CELLS if half_x >= half_y else max(1, round(CELLS * half_x / half_y))


def _interior_rows(half: AdjustedBlock, group: ImageGroup) -> np.ndarray:
    p = half.parameters
    return np.flatnonzero((p.kinds == "interior") & (p.groups == group.camera.name) & (p.status != "removed"))


def _by_interior(half: AdjustedBlock, group: ImageGroup, at: tuple[np.ndarray, np.ndarray], row: int) -> np.ndarray:
    """(n, 2) partials of the image errors by an element of the interior orientation, about which the lens lies."""
    ends = []
    for sign in (1.0, -1.0):
        value = np.array(half.parameters.value, dtype=float)
        value[row] += sign * STEP_MM
        moved = replace(half, parameters=replace(half.parameters, value=value))
        ends.append(errors_with_jacobian(moved, group, *at)[0])
    return (ends[0] - ends[1]) / (2.0 * STEP_MM)


def _tested(d: np.ndarray, sigma: np.ndarray, root: np.ndarray, redundancy: float, alpha: float) -> AgreementTest:
    """The test of all cells: as many degrees of freedom as there are independent differences of the parameters."""
    seen = sigma > RANK * sigma.max(initial=0.0)
    if not seen.any():
        return no_test(redundancy, alpha)
    left, size, _ = np.linalg.svd(root[seen] / sigma[seen, None], full_matrices=False)
    kept = size > RANK * size[0]
    return agreement_of_root(d[seen] / sigma[seen], left[:, kept] * size[kept], redundancy, alpha)
