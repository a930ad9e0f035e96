"""Which photographs share one set of systematic image errors: those of a parameter group taken with one camera."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.adjustment.shared_parameters import group_of_images
from aerotri.observations import Block, Camera
from aerotri.observations.block import INTERIOR_ELEMENTS
from aerotri.results.adjusted_block import AdjustedBlock


@dataclass(frozen=True, eq=False)
class ImageGroup:
    """Photographs with the same additional parameters and the same format.

    Parameters
    ----------
    name : the parameter group: a camera, 'block', a strip or a value of the grouping column.
    camera : the camera of all of them.
    images : (n,) bool over the block's images.
    """

    name: str
    camera: Camera
    images: np.ndarray


def image_groups(block: Block) -> tuple[ImageGroup, ...]:
    """The groups of a block, in the order in which their first photographs appear; groups without any are left out."""
    names = group_of_images(block)
    groups: dict[tuple[str, int], None] = {}
    for name, camera in zip(names.tolist(), block.images.camera.tolist(), strict=True):
        groups.setdefault((name, camera))
    return tuple(
        ImageGroup(str(name), block.cameras[camera], (names == name) & (block.images.camera == camera))
        for name, camera in groups
    )


def image_group(block: Block, name: str, camera: str | None = None) -> ImageGroup:
    """The group of that name.

    Parameters
    ----------
    camera : name of the camera; needed only where photographs of several cameras share the parameter group.

    Raises
    ------
    ValueError
        When there is none, or the camera has to be named.
    """
    groups = image_groups(block)
    found = [g for g in groups if g.name == name and camera in (None, g.camera.name)]
    if len(found) == 1:
        return found[0]
    known = ", ".join(f"{g.name} ({g.camera.name})" for g in groups)
    problem = "several cameras belong to" if found else "there is no"
    raise ValueError(f"{problem} image group '{name}'; groups and their cameras: {known}")


def parameters_of_group(adjusted: AdjustedBlock, group: ImageGroup) -> np.ndarray:
    """(s,) bool: the additional parameters in force in the photographs of a group; what was removed is not."""
    p = adjusted.parameters
    return (p.groups == group.name) & (p.kinds == "additional") & (p.status != "removed")


def interior_elements(adjusted: AdjustedBlock, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Principal distance and principal point of a camera after the adjustment.

    Interior elements belong to the camera, whatever the groups of the additional parameters are.

    Returns
    -------
    values, sigmas : (3,) mm each, c, x0, y0; σ is 0 for an element that was held.
    """
    values = np.array([camera.interior[name].value for name in INTERIOR_ELEMENTS])
    row = _interior_rows(adjusted, camera)
    values[row >= 0] = adjusted.parameters.value[row[row >= 0]]
    return values, _of_interior(adjusted, row, adjusted.parameters.sigma)


def interior_model_sigmas(adjusted: AdjustedBlock, camera: Camera) -> np.ndarray | None:
    """(3,) mm, the model part of σ of c, x0, y0, 0 for an element that was held; None where there is none."""
    model = adjusted.parameters.model_sigma
    return None if model is None else _of_interior(adjusted, _interior_rows(adjusted, camera), model)


def _interior_rows(adjusted: AdjustedBlock, camera: Camera) -> np.ndarray:
    """(3,) rows of c, x0, y0 among the shared parameters, −1 for one that is none."""
    p = adjusted.parameters
    own = (p.groups == camera.name) & (p.status != "removed")
    rows = [np.flatnonzero(own & (p.names == name)) for name in INTERIOR_ELEMENTS]
    return np.array([found[0] if len(found) else -1 for found in rows])


def _of_interior(adjusted: AdjustedBlock, row: np.ndarray, values: np.ndarray) -> np.ndarray:
    free = np.array([k >= 0 and adjusted.parameters.status[k] != "fixed" for k in row.tolist()])
    return np.where(free, values[row] if len(values) else 0.0, 0.0)
