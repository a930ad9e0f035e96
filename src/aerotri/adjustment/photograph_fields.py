"""Smooth errors of single photographs: a random field each, known through the nodes of a bilinear grid.

[D] The image points of photograph i have the error f_i(x, y) + e: e white, with the σ of the table, and f_i a field of
covariance σ_f²·exp(−ρ/ℓ) in x and in y, ρ the distance in the photograph, another one in every photograph. Matching
does that, film, and what moves in a camera. The nodes of f_i are unknowns, observed together as 0 with the inverse of
their covariance. Eliminated, they leave the rays of a photograph with the covariance σ_f²·B·K·Bᵀ + σ²·I, B the
interpolation: weights that are no longer diagonal. Unlike the field of a camera it has a scale, shifts and what a lens
does: its covariance is known, and nothing has to be told apart from other unknowns.
"""

from __future__ import annotations

import numpy as np

from aerotri.adjustment.shared_parameters import FamilySets, RandomField, SharedList
from aerotri.conventions import InputError
from aerotri.functional_model.additional_parameters import collocation, parameter_set
from aerotri.functional_model.additional_parameters.grid import node_items
from aerotri.observations import Block

KIND = "photograph field"
"""Kind of the shared parameters that are nodes."""
GRIDS = (5, 4), (4, 3), (3, 3)
"""Nodes along the longer and the shorter side, the most that MOST_COLUMNS allow [C]."""
MOST_COLUMNS = 4000
"""Unknowns of all fields together at most: their part of the normal equations is full [C]."""


def grid_of(photographs: int) -> tuple[int, int]:
    """Nodes along the longer and the shorter side for so many photographs.

    Raises
    ------
    InputError
        Where even the coarsest grid has too many nodes.
    """
    for grid in GRIDS:
        if 2 * grid[0] * grid[1] * photographs <= MOST_COLUMNS:
            return grid
    fewest = 2 * GRIDS[-1][0] * GRIDS[-1][1]
    raise InputError(
        f'correlated = "on" in [stochastic] gives every photograph {fewest} unknowns, too many for {photographs} '
        f"photographs: {MOST_COLUMNS // fewest} are possible",
        "leave it out: the total σ contain errors that the points of a photograph share (model_part)",
        file="block.toml",
    )


def add_photograph_fields(block: Block, images: np.ndarray, ray_image: np.ndarray, shared: SharedList) -> FamilySets:
    """The fields of the photographs, appended to `shared`.

    Parameters
    ----------
    images : (n,) photographs used. ray_image : (m,) index into `images`.
    """
    grid = grid_of(len(images))
    sets = {}
    of_camera = {}
    for row, image in enumerate(images.tolist()):
        camera = block.cameras[block.images.camera[image]]
        if camera.name not in of_camera:
            wide = camera.size_px[0] >= camera.size_px[1]
            items = node_items(*(grid if wide else grid[::-1]))
            of_camera[camera.name] = parameter_set(collocation.FAMILY.name, items, camera)
        nodes, name = of_camera[camera.name], str(block.images.names[image])
        first = len(shared)
        for item in nodes.items:
            shared.add(f"photograph.{item}", name, KIND)
        columns = slice(first, len(shared))
        shared.photograph_fields.append(
            RandomField(columns, nodes.items, camera, name, np.zeros((len(nodes.items), 0)))
        )
        sets[row] = nodes, first
    return FamilySets(sets, ray_image)
