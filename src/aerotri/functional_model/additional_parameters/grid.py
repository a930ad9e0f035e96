"""A correction grid: dx and dy at the nodes of a grid over the format, bilinear between them.

[C] nx × ny nodes, the outer ones on the edges of the format; beyond the edges the field goes on as it is there. Its
values come from averaged residuals, iterated with a new adjustment. As free unknowns the nodes need observed positions
or weights: shift, scale and rotation of the whole image are in their reach too. The parameters are millimetres;
``13x9_x_4_7`` is dx at node (4, 7) of 13 × 9 nodes, counted from 0 at the lower left.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from aerotri.conventions import InputError
from aerotri.functional_model.additional_parameters.family import Family
from aerotri.functional_model.additional_parameters.sizes import Sizes, size_of, size_text
from aerotri.functional_model.additional_parameters.terms import Terms, only
from aerotri.observations import Camera

SMALLEST, LARGEST = (2, 2), (60, 60)
"""Nodes along x and y: two are the least between which something is linear; 60 × 60 are 7200 unknowns, whose normal
equations already take 0.4 GB [C]."""


@cache
def node_items(nx: int, ny: int) -> tuple[str, ...]:
    """Names of the values of nx × ny nodes: dx of all nodes row by row from the lower left, then dy."""
    size = size_text((nx, ny))
    return tuple(f"{size}_{axis}_{i}_{j}" for axis in "xy" for j in range(ny) for i in range(nx))


def item_text(item: str) -> str:
    """What an item is, in a few words."""
    size, axis, i, j = item.split("_")
    return f"d{axis} at node {i}, {j} of {size}"


def grid_size(items: Sequence[str]) -> tuple[int, int]:
    """Nodes along x and y of the one grid that items belong to.

    Raises
    ------
    InputError
        When they belong to several grids or to none.
    """
    texts = sorted({item.partition("_")[0] for item in items})
    size = size_of(texts[0]) if len(texts) == 1 else None
    if size is None:
        raise InputError(f"the nodes belong to {len(texts)} grids: {', '.join(texts)}", "choose one grid")
    return size


def check_items(items: Sequence[str]) -> None:
    """Refuse nodes of several grids."""
    grid_size(items)


def node_positions(camera: Camera, items: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Where the nodes are, and which coordinate each item displaces.

    Returns
    -------
    position : (p, 2) mm from the image centre.
    axis : (p,) 0 for dx, 1 for dy.
    """
    number = np.array([item.split("_")[2:] for item in items], dtype=float).reshape(-1, 2)
    last = np.array(grid_size(items)) - 1.0
    axis = np.array(["xy".index(item.split("_")[1]) for item in items], dtype=np.int64)
    return (2.0 * number / last - 1.0) * np.array(camera.half_format_mm), axis


def _along(position: np.ndarray, half: float, count: int) -> tuple[np.ndarray, np.ndarray, float]:
    """First node (n,) of the cell of each position, place in the cell (n,) from 0 to 1, and cells per mm."""
    per_mm = (count - 1) / (2.0 * half)
    at = np.clip((position + half) * per_mm, 0.0, count - 1)
    first = np.minimum(at.astype(np.int64), count - 2)
    return first, at - first, per_mm


def node_terms(camera: Camera, x: np.ndarray, y: np.ndarray, partials: bool, items: tuple[str, ...]) -> Terms:
    """Weights of the four nodes around each point, for dx and for dy.

    Up to eight columns: dx at the lower left, lower right, upper left and upper right node, then dy.

    Parameters
    ----------
    x, y : (n,) mm from the image centre. items : nodes of one grid.
    """
    nx, ny = grid_size(items)
    half_x, half_y = camera.half_format_mm
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    (i, s, per_x), (j, t, per_y) = _along(x, half_x, nx), _along(y, half_y, ny)
    weight_x, weight_y = (1.0 - s, s, 1.0 - s, s), (1.0 - t, 1.0 - t, t, t)
    value = np.zeros((len(s), 2, 8))
    partial = np.zeros((len(s), 2, 8, 2)) if partials else None
    for k in range(4):
        value[:, 0, k] = value[:, 1, 4 + k] = weight_x[k] * weight_y[k]
        if partial is not None:
            slope_x = np.where(np.abs(x) < half_x, (2 * (k % 2) - 1) * per_x, 0.0)
            slope_y = np.where(np.abs(y) < half_y, (2 * (k // 2) - 1) * per_y, 0.0)
            slope = np.column_stack([slope_x * weight_y[k], weight_x[k] * slope_y])
            partial[:, 0, k] = partial[:, 1, 4 + k] = slope
    lower_left = j * nx + i
    index = lower_left[:, None] + np.array([0, 1, nx, nx + 1, *(nx * ny + np.array([0, 1, nx, nx + 1]))])
    return only(Terms(index, value, partial), node_items(nx, ny), items)


def node_family(name: str, mark: str, reference: str, default: tuple[int, int]) -> Family:
    """A family whose parameters are the values of a grid's nodes; `default` nodes along x and y."""
    sizes = Sizes("nodes along x and along y", default, SMALLEST, LARGEST, node_items)
    return Family(
        name=name,
        items=sizes.items(sizes.default),
        mark=mark,
        reference=reference,
        text=item_text,
        unit=lambda _: "mm",
        evaluate=node_terms,
        sizes=sizes,
        check_items=check_items,
        is_grid=True,
    )


FAMILY = node_family("grid", "C", "Bilinear correction grid over the format; composition of this project", (13, 9))
"""13 × 9 nodes unless others are asked for [C]: square cells in a format of 3 : 2, twelve along its longer side. Finer
grids need more rays to fill every cell, coarser ones miss what the patterns of other families hold."""
