"""Where a point of the ground appears in a photograph, and where a ray of one photograph runs in another."""

from __future__ import annotations

import numpy as np

from aerotri.bench.records import pixels_in
from aerotri.conventions import mm_from_px
from aerotri.deformation.model_grid import places_of
from aerotri.deformation.moving_rays import exposed
from aerotri.deformation.restitution import restitution_of
from aerotri.deformation.stereo_model import measured_in, pair_model, seen_by_both
from aerotri.functional_model.interior import mm_from_scan
from aerotri.image_errors.error_function import errors_in_force
from aerotri.image_errors.groups import image_groups
from aerotri.observations import Block
from aerotri.results.adjustment import Adjustment

STEPS = 25
"""Places along a ray that an epipolar line is drawn through."""
REACH = 0.25
"""Share of the distance of a point by which an epipolar line reaches before and behind it [C]: relief is less."""


class Prediction:
    """Positions in the photographs of an adjusted block, with its image errors.

    Parameters
    ----------
    adjustment : with its equations.

    Raises
    ------
    InputError
        For a fisheye, or a block in degrees.
    """

    def __init__(self, adjustment: Adjustment):
        self._adjustment, self._places = adjustment, places_of(adjustment)
        self._restitution = restitution_of(adjustment)
        groups = image_groups(adjustment.local.block)
        self._errors = [errors_in_force(adjustment.local, group) for group in groups]

    @property
    def block(self) -> Block:
        """The block as it was adjusted."""
        return self._adjustment.result.block

    def pixels(self, image: int, xyz: np.ndarray) -> np.ndarray:
        """(n, 2) px, column and row of points in a photograph; NaN where it does not show them.

        Parameters
        ----------
        xyz : (n, 3) m in the CRS of the block.
        """
        return self._shown(image, self._places.to_local(np.asarray(xyz, dtype=float)))

    def images_of(self, xyz: np.ndarray) -> np.ndarray:
        """(k,) rows of the photographs that show a point (3,) m in the CRS."""
        local = self._places.to_local(np.asarray(xyz, dtype=float)[None])
        known = np.flatnonzero(self._restitution.true.known)
        return np.array([k for k in known.tolist() if np.isfinite(self._shown(k, local)).all()], dtype=np.int64)

    def epipolar(self, image: int, other: int, px: np.ndarray, xyz: np.ndarray) -> np.ndarray:
        """(k, 2) px, the ray of another photograph as this one shows it, about the distance of a point.

        Parameters
        ----------
        other : photograph that the ray belongs to. px : (2,) its position there. xyz : (3,) m, the point.
        """
        orientation = self._restitution.true
        xy = millimetres_in(self.block, other, np.asarray(px, dtype=float)[None])
        direction = self._errors[self._restitution.group[other]].directions(xy)[0]
        rotation, centre = orientation.rotation[other], orientation.centre[other]
        if orientation.scans is not None:
            rotation, centre = (part[0] for part in exposed(orientation, other, xy))
        along = rotation @ direction
        along /= np.linalg.norm(along)
        distance = np.linalg.norm(self._places.to_local(np.asarray(xyz, dtype=float)[None])[0] - centre)
        reach = distance * np.linspace(1.0 - REACH, 1.0 + REACH, STEPS)
        line = self._shown(image, centre + reach[:, None] * along)
        return line[np.isfinite(line).all(axis=1)]

    def by_additional(self, image: int, px: np.ndarray) -> np.ndarray:
        """(2, p) mm, partials of a position (2,) px by the additional parameters, in the order of `shared_columns`."""
        xy = millimetres_in(self.block, image, np.asarray(px, dtype=float)[None])
        return self._restitution.errors[self._restitution.group[image]].partials(xy)[0]

    def _shown(self, image: int, local: np.ndarray) -> np.ndarray:
        out, known = np.full((len(local), 2), np.nan), np.flatnonzero(np.isfinite(local).all(axis=1))
        model = pair_model(self._restitution, ("", ""), (image, image))
        seen = known[seen_by_both(model, local[known])]
        if len(seen):
            out[seen] = pixels_in(self.block, image, measured_in(model, 0, local[seen]))
        return out


def millimetres_in(block: Block, image: int, px: np.ndarray) -> np.ndarray:
    """(k, 2) mm of positions (k, 2) px in one photograph; the inverse of `pixels_in`."""
    camera, fit = block.cameras[block.images.camera[image]], block.interior_fits.get(image)
    return mm_from_px(px, camera.size_px, camera.pixel_mm) if fit is None else mm_from_scan(fit, px)
