"""Tests of a rigid adjustment: whether the cameras keep their places on the rig."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

ROTATION, POSITION = "rotation", "position"


@dataclass(frozen=True, eq=False)
class HeadTest:
    """What a rigid adjustment says of movements of one camera on its rig, in rotation or in position.

    Parameters
    ----------
    rig, camera : names. what : 'rotation' (rad) or 'position' (m; beyond what rotations explain).
    stations : photographs of the camera that were tested.
    movement : σ of movements between exposures, an axis; 0 where the residuals are smaller than expected.
    movement_sigma : its own σ. movement_p : probability of such residuals if the camera does not move.
    movement_found : whether it moves, all tests of cameras taken together.
    movement_detectable : the σ that would have been found with the power of the block.
    drift : (3,) change from the first to the last exposure about or along the axes of the reference camera.
    drift_sigma : (3,). drift_p, drift_found : as of movements. drift_detectable : about its worst axis.
    """

    rig: str
    camera: str
    what: str
    stations: int
    movement: float
    movement_sigma: float
    movement_p: float
    movement_found: bool
    movement_detectable: float
    drift: np.ndarray
    drift_sigma: np.ndarray
    drift_p: float
    drift_found: bool
    drift_detectable: float


@dataclass(frozen=True, eq=False)
class StationTests:
    """Every photograph of a rig against the place that rig and station give it, n of them.

    Parameters
    ----------
    image : (n,) rows of the block. rig, camera, station : (n,) names.
    turned, sigma : (n, 3) rad, about the axes of the reference camera, what would suit its rays better, and σ.
    freedom : (n,) degrees of freedom of the test, 6 where the rays of the photograph fix all. f : (n,) its value.
    p : (n,) probability of such a value if the photograph is in its place. found : (n,) bool, all taken together.
    """

    image: np.ndarray
    rig: np.ndarray
    camera: np.ndarray
    station: np.ndarray
    turned: np.ndarray
    sigma: np.ndarray
    freedom: np.ndarray
    f: np.ndarray
    p: np.ndarray
    found: np.ndarray

    def __len__(self) -> int:
        return len(self.image)


@dataclass(frozen=True, eq=False)
class WholeStations:
    """Every exposure of a rig: whether its photographs stand to one another as the rig says, n of them.

    Parameters
    ----------
    rig, station : (n,) names. photographs : (n,) how many it has. freedom, f, p, found : as in `StationTests`.
    """

    rig: np.ndarray
    station: np.ndarray
    photographs: np.ndarray
    freedom: np.ndarray
    f: np.ndarray
    p: np.ndarray
    found: np.ndarray

    def __len__(self) -> int:
        return len(self.station)


@dataclass(frozen=True, eq=False)
class Rigidity:
    """The tests of all rigid rigs.

    Parameters
    ----------
    heads : two a camera, rotation and position. stations : photographs. whole : exposures.
    alpha : probability of a false alarm in all tests of cameras together; the same of photographs, and of exposures.
    power : with which a movement of the size `…_detectable` is found.
    station_detectable : (rig, camera) → rad, rotation of a single photograph that would be found, median.
    focal_mm : by camera: a rotation times it is the shift in the image.
    """

    heads: tuple[HeadTest, ...]
    stations: StationTests
    whole: WholeStations
    alpha: float
    power: float
    station_detectable: dict[tuple[str, str], float]
    focal_mm: dict[str, float]

    def head(self, rig: str, camera: str, what: str = ROTATION) -> HeadTest:
        """The test of one camera."""
        return next(one for one in self.heads if (one.rig, one.camera, one.what) == (rig, camera, what))
