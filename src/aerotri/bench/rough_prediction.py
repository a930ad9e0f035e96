"""Where points appear in photographs that are not adjusted yet: from their start values or GNSS and INS.

It tells where to look, not where to measure: tens of pixels off where angles come from the direction of flight.
"""

from __future__ import annotations

import numpy as np

from aerotri.bench.records import pixels_in
from aerotri.functional_model.additional_parameters import lens
from aerotri.functional_model.rotation import angles_from_rotation, rotation_from_angles
from aerotri.observations import Block

AXIS = {"+x": 0.0, "+y": np.pi / 2, "-x": np.pi, "-y": -np.pi / 2}
"""Direction of the image axis along the flight in the image, rad from +x."""


class RoughPrediction:
    """Positions in the photographs of a block as it is given.

    Parameters
    ----------
    block : with start values, or positions by GNSS. Angles that nobody gives are those of a camera that looks straight
        down and flies from photograph to photograph.
    """

    def __init__(self, block: Block):
        self.block = block
        self._centre = known_centres(block)
        self._rotation = rotation_from_angles(np.nan_to_num(_angles(block, self._centre)), block.rotation)

    def pixels(self, image: int, xyz: np.ndarray) -> np.ndarray:
        """(n, 2) px, column and row of points in a photograph; NaN where it does not show them.

        Parameters
        ----------
        xyz : (n, 3) m in the CRS of the block.
        """
        out, camera = np.full((len(xyz), 2), np.nan), self.block.cameras[self.block.images.camera[image]]
        seen = (np.asarray(xyz, dtype=float) - self._centre[image]) @ self._rotation[image]
        with np.errstate(divide="ignore", invalid="ignore"):
            ahead = np.flatnonzero(-seen[:, 2] > 0.0)
        if not len(ahead):
            return out
        a, b = (seen[ahead, :2] / -seen[ahead, 2:]).T
        xy = camera.focal_length_mm * lens.distort(a, b, lens.vector_of(camera)) + camera.principal_point_mm
        inside = np.abs(xy) <= np.array(camera.half_format_mm)
        out[ahead] = np.where(inside.all(axis=1)[:, None], pixels_in(self.block, image, xy), np.nan)
        return out

    def images_of(self, xyz: np.ndarray) -> np.ndarray:
        """(k,) rows of the photographs that show a point (3,) m."""
        every = range(len(self.block.images))
        return np.array([k for k in every if np.isfinite(self.pixels(k, xyz[None])).all()], dtype=np.int64)


def known_centres(block: Block) -> np.ndarray:
    """(n, 3) m of the projection centres: start values, else positions by GNSS; NaN where neither is there."""
    out, gnss = block.images.centre.copy(), block.gnss_ins
    if gnss is not None:
        out[gnss.image] = np.where(np.isnan(out[gnss.image]), gnss.xyz, out[gnss.image])
    return out


def rough_prediction(block: Block) -> RoughPrediction | None:
    """None where no position is known, the block is in degrees, or a camera has no plane image."""
    fisheye = any(camera.is_fisheye for camera in block.cameras)
    if fisheye or _in_degrees(block.crs) or not np.isfinite(known_centres(block)).all(axis=1).any():
        return None
    return RoughPrediction(block)


def _in_degrees(crs: str) -> bool:
    if crs == "local":
        return False
    from pyproj import CRS

    return CRS(crs.split("+")[0]).is_geographic


def _angles(block: Block, centre: np.ndarray) -> np.ndarray:
    """(n, 3) rad: start values, else those of INS, else level in the direction of flight."""
    out, gnss = block.images.angles.copy(), block.gnss_ins
    if gnss is not None:
        out[gnss.image] = np.where(np.isnan(out[gnss.image]), gnss.angles, out[gnss.image])
    missing = np.isnan(out).any(axis=1)
    if missing.any():
        axis = np.array([AXIS[camera.flight_axis or "+y"] for camera in block.cameras])[block.images.camera]
        turn = _heading(block, centre) - axis
        c, s, zero = np.cos(turn), np.sin(turn), np.zeros(len(turn))
        rows = [[c, -s, zero], [s, c, zero], [zero, zero, zero + 1.0]]
        level = np.moveaxis(np.array(rows), 2, 0)
        out[missing] = angles_from_rotation(level[missing], block.rotation)
    return out


def _heading(block: Block, centre: np.ndarray) -> np.ndarray:
    """(n,) rad from east towards north, to the next photograph of the strip, from the one before at its end."""
    xy, strip = np.nan_to_num(centre[:, :2]), block.images.strip
    ahead = np.zeros_like(xy)
    for name in np.unique(strip):
        own = np.flatnonzero(strip == name)
        if len(own) > 1:
            steps = np.diff(xy[own], axis=0)
            ahead[own] = np.concatenate([steps, steps[-1:]])
    return np.arctan2(ahead[:, 1], ahead[:, 0])
