"""A simulated block at its place on Earth: from the plane in which it was made to its CRS.

The plane of the simulation is a Cartesian frame. It is laid onto the local topocentric frame of the CRS, shifted to the
origin that the plan names: a rigid motion, so that nothing measured changes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri.conventions import InputError
from aerotri.coordinates.local_frame import LocalFrame, local_frame
from aerotri.functional_model.rotation import angles_from_rotation, rotation_from_angles
from aerotri.observations import Block
from aerotri.simulation.spec import GeoreferenceSpec
from aerotri.simulation.truth import Truth


@dataclass(frozen=True, eq=False)
class Placement:
    """frame : local frame of the CRS. shift : (3,) m in it, of the plan's (0, 0, 0)."""

    frame: LocalFrame
    shift: np.ndarray

    @property
    def crs(self) -> str:
        return self.frame.crs

    def to_crs(self, xyz: np.ndarray) -> np.ndarray:
        """(n, 3) in the CRS of (n, 3) m in the plane of the simulation; NaN stays NaN."""
        return self.frame.from_local(np.asarray(xyz, dtype=float) + self.shift)

    def from_crs(self, xyz: np.ndarray) -> np.ndarray:
        """(n, 3) m in the plane of the simulation; the inverse of `to_crs`."""
        return self.frame.to_local(xyz) - self.shift

    def angles_to_crs(self, angles: np.ndarray, centre: np.ndarray, order: str) -> np.ndarray:
        """(n, 3) rad by the axes of the CRS at the projection centres (n, 3) m, both in the plane of the simulation."""
        found = np.full(angles.shape, np.nan)
        there = np.isfinite(angles).all(axis=1) & np.isfinite(centre).all(axis=1)
        axes = np.swapaxes(self.frame.axes_at(self.to_crs(centre[there])), 1, 2)
        found[there] = angles_from_rotation(axes @ rotation_from_angles(angles[there], order), order)
        return found

    def geographic(self, xyz: np.ndarray) -> np.ndarray:
        """(n, 3) longitude, latitude in degrees, ellipsoidal height of (n, 3) in the CRS."""
        return self.frame.georeference.to_geographic(xyz)


def placement(spec: GeoreferenceSpec) -> Placement:
    """Where a plan lies.

    Raises
    ------
    InputError
        For a CRS that PROJ does not know, one with a height system of its own, or an origin outside it.
    """
    if "+" in spec.crs:
        raise InputError(f"'georeference.crs' {spec.crs[:40]} names a height system", "heights are ellipsoidal: EPSG:n")
    origin = np.array([spec.origin])
    frame = local_frame(spec.crs, origin)
    return Placement(frame, frame.to_local(origin)[0])


def placed(block: Block, truth: Truth, place: Placement) -> tuple[Block, Truth]:
    """The block and its truth in the CRS.

    Standard deviations stay as they are: over a block the axes differ by less than they are known.

    Parameters
    ----------
    block, truth : as `simulate` gave them, in the plane of the simulation.
    """
    images, order, observed = block.images, block.rotation, block.gnss_ins
    centre = place.to_crs(images.centre)
    angles = place.angles_to_crs(images.angles, images.centre, order)
    if observed is not None:
        own = truth.centre[observed.image]
        attitude = place.angles_to_crs(observed.angles, own, order)
        observed = replace(observed, xyz=place.to_crs(observed.xyz), angles=attitude)
    in_crs = replace(
        block,
        crs=place.crs,
        images=replace(images, centre=centre, angles=angles),
        control=replace(block.control, xyz=place.to_crs(block.control.xyz)),
        gnss_ins=observed,
    )
    true_angles = place.angles_to_crs(truth.angles, truth.centre, order)
    return in_crs, replace(
        truth, centre=place.to_crs(truth.centre), angles=true_angles, points=place.to_crs(truth.points)
    )
