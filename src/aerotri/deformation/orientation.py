"""Orientation of photographs as a stereo model needs it, and what this package takes of an adjustment."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.kernel_records import Scans
from aerotri.deformation.error_parameters import shared_columns
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.image_errors import interior_elements
from aerotri.observations import Block
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.results.adjustment import Adjustment


@dataclass(frozen=True, eq=False)
class Orientation:
    """Exterior and interior orientation of n photographs; NaN where there is none.

    Parameters
    ----------
    centre : (n, 3) m, in the local frame of the block.
    rotation : (n, 3, 3) camera → object.
    interior : (n, 3) mm, c, x0, y0.
    scans : what rolling shutters do while photographs are read, columns counted in `error_rows`; None without.
    """

    centre: np.ndarray
    rotation: np.ndarray
    interior: np.ndarray
    scans: Scans | None = None

    def __len__(self) -> int:
        return len(self.centre)

    @property
    def known(self) -> np.ndarray:
        """(n,) bool."""
        return np.all(np.isfinite(np.concatenate([self.centre[:, None], self.rotation], axis=1)), axis=(1, 2))

    def take(self, rows: np.ndarray | list[int]) -> Orientation:
        """The orientation of some photographs."""
        scans = None if self.scans is None else Scans(*(part[rows] for part in self.scans))
        return Orientation(self.centre[rows], self.rotation[rows], self.interior[rows], scans)

    @property
    def standing_still(self) -> Orientation:
        """The orientation in the middle of the readout for all rows: what programs use that know no rolling shutter."""
        return replace(self, scans=None)


def calibrated_orientation(calibration: Adjustment) -> Orientation:
    """The orientation of all photographs of the block after its adjustment."""
    adjusted = calibration.local
    rotation = rotation_from_angles(adjusted.images.angles, adjusted.block.rotation)
    return Orientation(adjusted.images.centre, rotation, interior_of_images(adjusted), _scans_of_images(calibration))


def _scans_of_images(calibration: Adjustment) -> Scans | None:
    """What rolling shutters do, of every photograph of the block after its adjustment; None without."""
    u = calibration.system.unknowns
    if u.scanning is None:
        return None
    own, n = u.scans(calibration.solution.state), len(calibration.local.block.images)
    place = np.full(len(u.shared) + 1, -1, dtype=np.int64)
    columns = shared_columns(calibration)
    place[columns] = np.arange(len(columns))
    found = Scans(np.zeros((n, 2)), np.zeros(n), np.zeros((n, 3)), np.zeros((n, 3)), np.full((n, 3), -1))
    for part, values in zip(found, own._replace(columns=place[own.columns]), strict=True):
        part[u.images] = values
    return found


def interior_of_images(adjusted: AdjustedBlock) -> np.ndarray:
    """(n, 3) mm, c, x0, y0 of every photograph's camera after the adjustment."""
    of_camera = np.array([interior_elements(adjusted, camera)[0] for camera in adjusted.block.cameras])
    return of_camera[adjusted.block.images.camera]


def given_orientation(calibration: Adjustment, other: Block, angles: np.ndarray, centre: np.ndarray) -> Orientation:
    """Orientation from elsewhere, by the names of the photographs, in the local frame.

    The interior orientation is that of the calibrated block.

    Parameters
    ----------
    other : gives the names, as its images have them, and the order of the angles.
    angles, centre : (k, 3) rad, and m in the CRS of the calibrated block.
    """
    frame, block = calibration.frame, calibration.local.block
    rotation = rotation_from_angles(angles, other.rotation)
    if frame is not None:
        rotation = frame.axes_at(centre) @ rotation
        centre = frame.to_local(centre)
    row = {str(name): k for k, name in enumerate(other.images.names)}
    rows = np.array([row.get(str(name), -1) for name in block.images.names])
    there = rows >= 0
    out = Orientation(
        np.full((len(rows), 3), np.nan), np.full((len(rows), 3, 3), np.nan), interior_of_images(calibration.local)
    )
    out.centre[there], out.rotation[there] = centre[rows[there]], rotation[rows[there]]
    return out


def orientation_of_result(calibration: Adjustment, other: Adjustment) -> Orientation:
    """Orientation and interior orientation of another result in the same CRS, by the names of the photographs."""
    images = other.result.images
    found = given_orientation(calibration, other.result.block, images.angles, images.centre)
    row = {str(name): k for k, name in enumerate(other.local.block.images.names)}
    rows = np.array([row.get(str(name), -1) for name in calibration.local.block.images.names])
    interior = np.where(rows[:, None] >= 0, interior_of_images(other.local)[rows], np.nan)
    return replace(found, interior=np.where(np.isfinite(interior), interior, found.interior))


def photo_rows(orientation: Orientation, local: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """(n, 23) photographs as kernels take them, for coordinates Δ of which local + axes·Δ is the place in the frame."""
    to_camera = np.swapaxes(orientation.rotation, 1, 2)
    u = np.concatenate([to_camera @ axes, to_camera @ (local - orientation.centre)[:, :, None]], axis=2)
    scan, s = np.zeros((len(u), 8)), orientation.scans
    if s is not None:
        scan = np.concatenate([s.velocity, s.spin, s.rate * s.readout[:, None]], axis=1)
    return np.concatenate([u.reshape(-1, 12), orientation.interior, scan], axis=1)


def row_of_image(block: Block, name: str) -> int:
    """The row of a photograph; −1 when the block has none of that name."""
    found = np.flatnonzero(block.images.names == name)
    return int(found[0]) if len(found) else -1
