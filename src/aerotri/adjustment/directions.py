"""Ideal directions of the image points, by the cameras at their start values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.conventions import InputError, counted
from aerotri.functional_model.additional_parameters import brown, lens
from aerotri.functional_model.collinearity import FIRST_LENS, interior_row
from aerotri.observations import Block, Camera


@dataclass(frozen=True, eq=False)
class Directions:
    """Rays as directions: tangents (m, 2) in the camera, freed of known lens errors, and their tolerance (m,)."""

    tangent: np.ndarray
    tolerance: np.ndarray


def directions_of(block: Block) -> Directions:
    rays = block.image_points
    tangent, tolerance = np.empty((len(rays), 2)), np.empty(len(rays))
    camera_of_ray = block.images.camera[rays.image]
    for index, camera in enumerate(block.cameras):
        of_camera = camera_of_ray == index
        row = interior_row(camera)
        bar = rays.xy[of_camera] - row[1:3]
        distorted = (bar - brown.image_error(bar[:, 0], bar[:, 1], row[3:FIRST_LENS])) / row[0]
        tangent[of_camera] = _in_front(distorted, row[FIRST_LENS:], camera)
        tolerance[of_camera] = np.maximum(rays.sigma[of_camera].max(axis=1), camera.pixel_mm) / row[0]
    return Directions(tangent, tolerance)


def _in_front(distorted: np.ndarray, parameters: np.ndarray, camera: Camera) -> np.ndarray:
    """(n, 2) tangents of distorted positions; those that the lens records nowhere count as without distortion."""
    tangent = lens.undistort(distorted, parameters)
    lost = np.isnan(tangent).any(axis=1)
    if lost.any():
        tangent[lost] = lens.undistort(distorted[lost], lens.vector({}, camera.is_fisheye))
    missing = int(np.isnan(tangent).any(axis=1).sum())
    if missing:
        raise InputError(
            f"{counted(missing, 'image point')} of camera '{camera.name}' 90° or more off its axis",
            "check projection and focal length of the camera; leave out image points so far off the axis",
            file="block.toml",
        )
    return tangent
