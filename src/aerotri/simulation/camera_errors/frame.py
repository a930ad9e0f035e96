"""A frame camera, film or chip, as a machine: lens, film deformation, unflatness [D]. Image axes, mm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.observations import Camera
from aerotri.simulation.camera_errors.lens import LensError, format_grid, random_lens, unit_rms

WEIGHTS = {"radial": 1.0, "tangential": 0.4, "affine": 0.7, "film": 0.8, "unflatness": 0.5}
"""RMS of each cause before scaling: radial and decentering lens error; affine and slow irregular film deformation;
a film or chip out of its plane. A chip camera sets affine and film to 0."""


@dataclass(frozen=True, eq=False)
class FrameError:
    """Image error of a single frame.

    Parameters
    ----------
    lens : radial, tangential and, as film deformation, the slow part.
    affine : (2, 2) per mm.
    height : unflatness, a lens error whose two parts are added up to a height, mm.
    focal_length : mm.
    """

    lens: LensError
    affine: np.ndarray
    height: LensError
    focal_length: float

    def __call__(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """(n, 2) mm."""
        position = np.stack([x, y], axis=1)
        # out of the plane by δz: the point moves along its radius by δz·r/f
        out_of_plane = self.height(x, y).sum(axis=1)[:, None] * position / self.focal_length
        return self.lens(x, y) + position @ self.affine.T + out_of_plane


def frame_error(camera: Camera, weights: dict[str, float], rng: np.random.Generator) -> FrameError:
    """A camera drawn at random.

    Parameters
    ----------
    weights : RMS in mm of each cause, the keys of `WEIGHTS`.
    """
    half = camera.half_format_mm
    lens = random_lens(half, weights["radial"], weights["tangential"], weights["film"], rng)
    x, y = format_grid(half, 15, 15)
    position = np.stack([x, y], axis=1)
    draw = rng.normal(size=(2, 2))
    affine = draw * weights["affine"] * unit_rms((position @ draw.T)[:, :, None])[0]
    height = random_lens(half, 0.0, 0.0, 1.0, rng)
    effect = height(x, y).sum(axis=1)[:, None] * position / camera.focal_length_mm
    size = weights["unflatness"] * unit_rms(effect[:, :, None])[0]
    scaled = LensError(height.axis, height.r_max, height.coefficients * size, height.wave_number, height.phase)
    return FrameError(lens, affine, scaled, camera.focal_length_mm)
