"""Base, height, end lap of a stereo model, and the normal-case model at a stated end lap.

[D] b = (1 − end lap)·format along the flight; h/b = c/b. The normal case: two vertical photographs at one height over
flat ground, X along the base, Y to its left, Z up, origin on the ground below the middle of the base. dp = dx' − dx''
at corresponding points, x along the base, changes the height by dZ = h/b·dp.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerotri.adjustment.kernel_records import Scans
from aerotri.conventions import InputError
from aerotri.deformation.orientation import Orientation
from aerotri.deformation.restitution import Restitution
from aerotri.deformation.stereo_model import StereoModel
from aerotri.functional_model.rotation import exponential, logarithm
from aerotri.image_errors import image_groups
from aerotri.observations import Camera
from aerotri.results.adjustment import Adjustment

AXES = {"+x": (1.0, 0.0), "-x": (-1.0, 0.0), "+y": (0.0, 1.0), "-y": (0.0, -1.0)}
"""Direction of flight in image coordinates, by `flight_axis` of the camera."""
DEFAULT_AXIS = "+x"
"""Of a camera that does not state its flight axis [C]."""


@dataclass(frozen=True)
class ModelGeometry:
    """The numbers of a stereo model.

    Parameters
    ----------
    base_mm : base in the image, b = c·B/h. base_m, height_m : B and h, the height above the ground.
    end_lap : 1 − b/format along the base.
    gsd_m : of a vertical photograph.
    """

    base_mm: float
    base_m: float
    height_m: float
    end_lap: float
    gsd_m: float

    @property
    def h_over_b(self) -> float:
        return self.height_m / self.base_m

    @property
    def cm_per_um(self) -> float:
        """dZ in cm for 1 µm of x-parallax: h/b·(h/c) = h/base_mm, m per mm."""
        return 0.1 * self.height_m / self.base_mm


def geometry_of(model: StereoModel, ground: float) -> ModelGeometry:
    """Of a model over ground of the height Z = `ground` in the frame of its orientations.

    The base is what lies across the mean direction of view; its direction in the left photograph decides along which
    side of the format the end lap counts.
    """
    camera, c = model.errors[0].camera, float(model.true.interior[0, 0])
    axis = model.true.rotation[:, :, 2].mean(axis=0)
    axis = axis / np.linalg.norm(axis)
    base = model.true.centre[1] - model.true.centre[0]
    across = base - axis * (base @ axis)
    base_m = float(np.linalg.norm(across))
    height = float(model.true.centre[:, 2].mean()) - ground
    in_image = np.abs(across @ model.true.rotation[0])[:2]
    length = 2.0 * camera.half_format_mm[int(np.argmax(in_image))]
    base_mm = c * base_m / height
    return ModelGeometry(base_mm, base_m, height, 1.0 - base_mm / length, height / c * camera.pixel_mm)


def normal_geometry(camera: Camera, c: float, end_lap: float, height: float) -> ModelGeometry:
    """Of the normal case.

    Parameters
    ----------
    c : mm. end_lap : 0 … 1, exclusive. height : m.
    """
    if not 0.0 < end_lap < 1.0:
        raise InputError(f"the end lap {end_lap:g} is not possible", "give a part of 1, such as 0.6")
    along = AXES[camera.flight_axis or DEFAULT_AXIS]
    length = 2.0 * float(np.abs(along) @ np.array(camera.half_format_mm))
    base_mm = (1.0 - end_lap) * length
    return ModelGeometry(base_mm, base_mm * height / c, height, end_lap, height / c * camera.pixel_mm)


def normal_model(
    calibration: Adjustment,
    restitution: Restitution,
    end_lap: float,
    group: str | None = None,
    gsd: float | None = None,
) -> tuple[StereoModel, ModelGeometry]:
    """The normal-case model of a group of photographs.

    In the absorbed variant both photographs take the change of orientation that the photographs of the group have on
    average, each in its own camera axes: the image errors are the same in all of them, so most of what they swallow
    is [C].

    Parameters
    ----------
    group : parameter group; that of most photographs unless given.
    gsd : m; the block's own, from its median flying height, unless given.
    """
    members, number = _members(calibration, restitution, group)
    errors = restitution.errors[number]
    interior = restitution.true.interior[members[0]]
    if gsd is None:
        points = calibration.local.points.xyz
        height = float(np.median(restitution.true.centre[members, 2]) - np.nanmedian(points[:, 2]))
    else:
        height = gsd / errors.camera.pixel_mm * interior[0]
    geometry = normal_geometry(errors.camera, float(interior[0]), end_lap, height)
    scale = height / float(
        np.median(restitution.true.centre[members, 2]) - np.nanmedian(calibration.local.points.xyz[:, 2])
    )
    true = _normal_orientation(errors.camera, interior, geometry, _normal_motion(errors.camera, restitution, members))
    used, follows = _with_mean_change(true, restitution, members, scale)
    names = ("first", "second")
    return StereoModel(names, (errors, errors), true, used, follows, restitution.covariance), geometry


def _members(calibration: Adjustment, restitution: Restitution, group: str | None) -> tuple[np.ndarray, int]:
    """Rows of the oriented photographs of a group, and its number."""
    groups = image_groups(calibration.local.block)
    known = restitution.true.known & restitution.used.known
    if group is None:
        number = int(np.argmax([np.sum(g.images & known) for g in groups]))
    else:
        found = [k for k, g in enumerate(groups) if g.name == group]
        if not found:
            there = ", ".join(dict.fromkeys(g.name for g in groups))
            raise InputError(f"there is no parameter group '{group}'", f"there are {there}")
        number = found[0]
    members = np.flatnonzero(groups[number].images & known)
    if not len(members):
        raise InputError(f"no photograph of group '{groups[number].name}' is oriented", "choose another --group")
    return members, number


def _normal_motion(camera: Camera, restitution: Restitution, members: np.ndarray) -> Scans | None:
    """Of two photographs of a rolling shutter: along the flight with the usual speed of the group, without turning."""
    s = restitution.true.scans
    if s is None or not s.rate[members].any():
        return None
    x, y = AXES[camera.flight_axis or DEFAULT_AXIS]
    velocity = float(np.median(np.linalg.norm(s.velocity[members], axis=1))) * np.array([x, y, 0.0])
    first = members[0]
    columns = np.array([s.columns[first, 0], -1, -1])
    one = Scans(s.rate[first], s.readout[first], velocity, np.zeros(3), columns)
    return Scans(*(np.stack([part, part]) for part in one))


def _normal_orientation(
    camera: Camera, interior: np.ndarray, geometry: ModelGeometry, motion: Scans | None
) -> Orientation:
    """Two vertical photographs whose flight axis points along X."""
    x, y = AXES[camera.flight_axis or DEFAULT_AXIS]
    rotation = np.array([[x, y, 0.0], [-y, x, 0.0], [0.0, 0.0, 1.0]])
    half, height = geometry.base_m / 2.0, geometry.height_m
    centre = np.array([[-half, 0.0, height], [half, 0.0, height]])
    return Orientation(centre, np.stack([rotation, rotation]), np.stack([interior, interior]), motion)


def _with_mean_change(
    true: Orientation, restitution: Restitution, members: np.ndarray, scale: float
) -> tuple[Orientation, np.ndarray]:
    """The orientation in use, and how it follows the parameters.

    Parameters
    ----------
    scale : of the model to the block; shifts of the projection centres go with it.
    """
    to_camera = np.swapaxes(restitution.true.rotation[members], 1, 2)
    moved = restitution.used.centre[members] - restitution.true.centre[members]
    turned = logarithm(restitution.used.rotation[members] @ to_camera)
    shift = scale * np.einsum("nij,nj->ni", to_camera, moved).mean(axis=0)
    turn = np.einsum("nij,nj->ni", to_camera, turned).mean(axis=0)
    interior = (restitution.used.interior[members] - restitution.true.interior[members]).mean(axis=0)
    rotation = true.rotation[0]
    used = Orientation(
        true.centre + rotation @ shift, exponential(rotation @ turn) @ true.rotation, true.interior + interior
    )
    follows = np.zeros((9, restitution.follows.shape[2]))
    follows[:3] = scale * rotation @ (to_camera @ restitution.follows[members, :3]).mean(axis=0)
    follows[3:6] = rotation @ (to_camera @ restitution.follows[members, 3:6]).mean(axis=0)
    follows[6:] = restitution.follows[members, 6:].mean(axis=0)
    return used, np.stack([follows, follows])
