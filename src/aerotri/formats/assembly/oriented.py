"""A block with orientations and object points: what programs that adjust without control hold and are given."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from aerotri.adjustment.ray_status import RayStatus
from aerotri.conventions import InputError, counted
from aerotri.functional_model.additional_parameters import brown, parameter_sets
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations import Block, Camera, Prior
from aerotri.observations.block import BROWN_NAMES, INTERIOR_ELEMENTS, LENS_NAMES

if TYPE_CHECKING:
    from aerotri.image_errors import ImageGroup
    from aerotri.results.adjusted_block import AdjustedBlock


@dataclass(frozen=True, eq=False)
class OrientedBlock:
    """A block, the orientation of its images and the place of its points.

    Parameters
    ----------
    block : the block; its cameras hold the values that belong to the orientation.
    centre : (n, 3) m; rotation : (n, 3, 3), camera → object. NaN where an image is not oriented.
    points : (N, 3) m, NaN where unknown.
    used : (m,) bool, the rays to be handed on.
    errors : (m, 2) mm, image errors of the rays by linear additional parameters, measured = ideal + error; None where
        there are none.
    format_errors : of every camera the same at `lens_fit.format_grid_mm`, (g, 2) mm; () where there are none.
    """

    block: Block
    centre: np.ndarray
    rotation: np.ndarray
    points: np.ndarray
    used: np.ndarray
    errors: np.ndarray | None = None
    format_errors: tuple[np.ndarray, ...] = ()

    @property
    def oriented(self) -> np.ndarray:
        """(n,) bool."""
        pose = np.concatenate([self.centre[:, :, None], self.rotation], axis=2).reshape(len(self.centre), 12)
        return np.asarray(np.isfinite(pose).all(axis=1))

    @property
    def complete(self) -> np.ndarray:
        """(m,) bool, the used rays of oriented images to known points."""
        rays = self.block.image_points
        known = np.asarray(np.isfinite(self.points).all(axis=1))
        return self.used & self.oriented[rays.image] & known[rays.point]

    def rows_with_orientation(self, what: str) -> np.ndarray:
        """(k,) the photographs that `what` can hold.

        Raises
        ------
        InputError
            When there is none.
        """
        rows = np.flatnonzero(self.oriented)
        if not len(rows):
            raise InputError(f"block '{self.block.name}' has no orientations for {what}", "adjust it first")
        return rows

    def unoriented(self) -> tuple[str, ...]:
        """A sentence on photographs without orientation, if there are any."""
        count = int((~self.oriented).sum())
        return (f"could not be carried over: {counted(count, 'photograph')} without orientation",) if count else ()

    def corrected_xy(self) -> np.ndarray:
        """(m, 2) mm, the rays free of Brown's and the linear errors; what the lens does is still in them."""
        rays = self.block.image_points
        xy = rays.xy if self.errors is None else rays.xy - self.errors
        camera_of_ray = self.block.images.camera[rays.image]
        for number, camera in enumerate(self.block.cameras):
            values = np.array([camera.brown[name].value if name in camera.brown else 0.0 for name in BROWN_NAMES])
            if values.any():
                own = np.flatnonzero(camera_of_ray == number)
                bar = rays.xy[own] - np.array(camera.principal_point_mm)
                xy = xy.copy() if xy is rays.xy else xy
                xy[own] -= brown.image_error(bar[:, 0], bar[:, 1], values)
        return xy

    def losses(self, with_rigs: bool = False) -> tuple[str, ...]:
        """What a format of orientations, points and rays alone cannot hold, in words.

        Parameters
        ----------
        with_rigs : whether it holds rigs.
        """
        from aerotri.formats.assembly.losses import THINGS, losses

        block = self.block
        lost = []
        if len(block.control):
            lost.append(counted(len(block.control), "control or check point", "control and check points"))
        if block.gnss_ins is not None:
            lost.append(
                counted(len(block.gnss_ins), "observed position or attitude", "observed positions or attitudes")
            )
        images, rays = int(np.sum(~self.oriented)), int(np.sum(~self.complete))
        if images:
            lost.append(f"{counted(images, 'photograph')} without orientation")
        if rays:
            lost.append(
                counted(rays, "image point") + " not used in the adjustment, or of a photograph or point not adjusted"
            )
        rigs = sum(rig.constraint != "off" for rig in block.rigs)
        if rigs and not with_rigs:
            lost.append(f"{counted(rigs, 'rig')}; photographs are written one by one")
        if block.crs != "local":
            lost.append(f"the coordinate system {block.crs}")
        others = losses(block, *(set(THINGS) - {"sigmas", "edits", "constraints", "fiducials"}))
        return (*(f"could not be carried over: {what}" for what in lost), *others)


def oriented_block(block: Block, points: np.ndarray) -> OrientedBlock:
    """A block at its own start values.

    Parameters
    ----------
    points : (N, 3) m, the object points, NaN where unknown.

    Raises
    ------
    InputError
        When no image has start values, or the points are not those of the block.
    """
    points = np.asarray(points, dtype=float)
    if points.shape != (len(block.points), 3):
        raise InputError("the object points are not those of the block", f"give {len(block.points)} × 3 coordinates")
    known = np.isfinite(block.images.centre).all(axis=1) & np.isfinite(block.images.angles).all(axis=1)
    if not known.any():
        raise InputError(f"block '{block.name}' has no orientations", "adjust it first and export the result")
    rotation = rotation_from_angles(block.images.angles, block.rotation)
    used = np.ones(len(block.image_points), bool)
    return OrientedBlock(block, block.images.centre, rotation, points, used, *given_errors(block))


def given_errors(block: Block) -> tuple[np.ndarray | None, tuple[np.ndarray, ...]]:
    """Image errors by linear parameters whose values the cameras state: `OrientedBlock.errors` and `format_errors`."""
    from aerotri.formats.foreign.lens_fit import format_grid_mm

    rays = block.image_points
    errors, of_format = np.zeros_like(rays.xy), []
    for number, camera in enumerate(block.cameras):
        values = {name: prior.value for name, prior in camera.parameters.items()}
        own = np.flatnonzero(block.images.camera[rays.image] == number)
        errors[own] = _linear_errors(camera, values, rays.xy[own])
        of_format.append(_linear_errors(camera, values, format_grid_mm(camera)))
    return (errors, tuple(of_format)) if any(one.any() for one in of_format) else (None, ())


def oriented_from_adjusted(adjusted: AdjustedBlock) -> OrientedBlock:
    """A block after its adjustment, with a camera for every group of images that has parameters of its own."""
    # imported here: who converts blocks without results need not wait for it
    from aerotri.formats.foreign.lens_fit import format_grid_mm
    from aerotri.image_errors import image_groups

    block, rays = adjusted.block, adjusted.block.image_points
    groups = image_groups(block)
    names = [group.camera.name for group in groups]
    cameras, of_format = [], []
    of_image, errors = np.zeros(len(block.images), np.int64), np.zeros_like(rays.xy)
    for number, group in enumerate(groups):
        values = _values_in_force(adjusted, group)
        camera = _adjusted_camera(adjusted, group, values)
        alone = names.count(group.camera.name) == 1
        cameras.append(camera if alone else replace(camera, name=f"{camera.name} {group.name}"))
        of_image[group.images] = number
        own = np.flatnonzero(group.images[rays.image])
        errors[own] = _linear_errors(group.camera, values, rays.xy[own])
        of_format.append(_linear_errors(group.camera, values, format_grid_mm(group.camera)))
    return OrientedBlock(
        replace(block, cameras=tuple(cameras), images=replace(block.images, camera=of_image)),
        adjusted.images.centre,
        rotation_from_angles(adjusted.images.angles, block.rotation),
        adjusted.points.xyz,
        adjusted.rays.status == RayStatus.USED,
        errors if errors.any() else None,
        tuple(of_format) if errors.any() else (),
    )


def _values_in_force(adjusted: AdjustedBlock, group: ImageGroup) -> dict[str, float]:
    """Adjusted values by name, 'bluh.1', 'brown.K1' and so on; what the selection removed is 0."""
    p = adjusted.parameters
    rows = np.flatnonzero((p.groups == group.name) & (p.kinds == "additional"))
    values = np.where(p.status[rows] == "removed", 0.0, p.value[rows])
    given = {name: prior.value for name, prior in group.camera.parameters.items()}
    return given | dict(zip(p.names[rows].tolist(), values.tolist(), strict=True))


def _adjusted_camera(adjusted: AdjustedBlock, group: ImageGroup, values: dict[str, float]) -> Camera:
    """The camera of a group with its adjusted values, all held."""
    from aerotri.image_errors import interior_elements

    interior, _ = interior_elements(adjusted, group.camera)
    return replace(
        group.camera,
        interior={name: Prior(float(v), fixed=True) for name, v in zip(INTERIOR_ELEMENTS, interior, strict=True)},
        brown=_held(values, "brown", BROWN_NAMES, group.camera.brown),
        lens=_held(values, "lens", LENS_NAMES, group.camera.lens),
    )


def _held(
    values: dict[str, float], family: str, names: tuple[str, ...], given: Mapping[str, Prior]
) -> dict[str, Prior]:
    """The items of a family that were adjusted or given, at their values."""
    start = {f"{family}.{name}": prior.value for name, prior in given.items()}
    now = {name: (start | values).get(f"{family}.{name}") for name in names}
    return {name: Prior(value, fixed=True) for name, value in now.items() if value is not None}


def _linear_errors(camera: Camera, values: dict[str, float], xy: np.ndarray) -> np.ndarray:
    """(n, 2) mm, the image errors of the linear families."""
    errors = np.zeros_like(xy)
    for chosen in parameter_sets((name for name, value in values.items() if value), camera):
        errors += chosen.basis(xy[:, 0], xy[:, 1]) @ np.array([values[name] for name in chosen.names])
    return errors
