"""Rigs: cameras on one frame that are triggered together, and which photographs they took at one exposure.

For the photograph of camera k at station s: R = R_s·R_k, X0 = X0_s + R_s·t_k, with (X0_s, R_s) the orientation of the
reference camera and (t_k, R_k) the mounting of camera k in its frame.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from aerotri.observations.prior import Prior

if TYPE_CHECKING:
    from aerotri.observations.block import Block, Camera, Images

STATION = "station"
"""The column of images.csv that says which photographs belong to one exposure."""
CONSTRAINTS = ("rigid", "weighted", "off")
FREE = (Prior(), Prior(), Prior())


@dataclass(frozen=True)
class Mounting:
    """Where a camera sits in the frame of the reference camera: X_reference = position + R·X_camera.

    Parameters
    ----------
    position : m, the projection centre. rotation : rad, ω, φ, κ of R in the block's order of rotations.
    known : whether a rotation was stated; where it was not, it follows from the photographs' own orientations.
    movement_m, movement_rad : σ of its movements between exposures on a weighted rig; None: to be estimated.
    """

    position: tuple[Prior, Prior, Prior] = FREE
    rotation: tuple[Prior, Prior, Prior] = FREE
    known: bool = True
    movement_m: float | None = 0.0
    movement_rad: float | None = None

    @property
    def elements(self) -> tuple[Prior, ...]:
        """The six of them, position first."""
        return (*self.position, *self.rotation)


@dataclass(frozen=True)
class Rig:
    """Cameras on one frame.

    Parameters
    ----------
    reference : the camera whose orientation is that of the rig.
    cameras : the mounting of every other camera.
    constraint : of `CONSTRAINTS`. rigid: one mounting for all stations. weighted: every photograph may deviate from it.
        off: the cameras are independent.
    """

    name: str
    reference: str
    cameras: Mapping[str, Mounting] = field(default_factory=dict)
    constraint: str = "rigid"


@dataclass(frozen=True, eq=False)
class StationPlaces:
    """Where every photograph of a block belongs.

    Parameters
    ----------
    lead : (n,) the photograph of the reference camera at the same station; the photograph itself where it has none.
    mounting : (n,) row of `mountings`, −1 of a photograph that leads or belongs to no rig.
    mountings : (rig, camera) of every mounting that photographs have.
    """

    lead: np.ndarray
    mounting: np.ndarray
    mountings: tuple[tuple[Rig, str], ...]

    def __bool__(self) -> bool:
        return bool((self.mounting >= 0).any())


def station_places(block: Block, off_too: bool = False) -> StationPlaces:
    """Where the photographs of rigid and weighted rigs belong; with `off_too` of rigs that are off as well."""
    n = len(block.images)
    lead, mounting, found = np.arange(n), np.full(n, -1), []
    rigs = [rig for rig in block.rigs if off_too or rig.constraint != "off"]
    if rigs and STATION in block.images.columns:
        station = np.asarray(block.images.columns[STATION], dtype=object)
        names = [camera.name for camera in block.cameras]
        for rig in rigs:
            own = {k: name for k, name in enumerate(names) if name == rig.reference or name in rig.cameras}
            rows = [k for k in np.flatnonzero(np.isin(block.images.camera, list(own))).tolist() if station[k]]
            leads = {station[k]: k for k in rows if own[int(block.images.camera[k])] == rig.reference}
            number: dict[str, int] = {}
            for k in rows:
                camera = own[int(block.images.camera[k])]
                if camera != rig.reference and station[k] in leads:
                    if camera not in number:
                        number[camera] = len(found)
                        found.append((rig, camera))
                    lead[k], mounting[k] = leads[station[k]], number[camera]
    return StationPlaces(lead, mounting, tuple(found))


@dataclass(frozen=True)
class StationFault:
    """What is wrong with the stations of photographs: the first photograph it concerns, −1 for all; in words."""

    image: int
    message: str
    remedy: str


def station_fault(images: Images, cameras: tuple[Camera, ...], rigs: tuple[Rig, ...]) -> StationFault | None:
    """The first thing wrong with the stations of the rigs that are in force; None where all is well."""
    names = [camera.name for camera in cameras]
    for rig in rigs:
        own = [k for k, name in enumerate(names) if name == rig.reference or name in rig.cameras]
        rows = np.flatnonzero(np.isin(images.camera, own))
        if rig.constraint == "off" or not len(rows):
            continue
        if STATION not in images.columns:
            remedy = f'add a column station with the name of the exposure, or set rig.{rig.name}.constraint = "off"'
            return StationFault(-1, f"rig '{rig.name}' needs the stations of its photographs", remedy)
        fault = _fault_of_rig(images, names, rig, rows)
        if fault is not None:
            return fault
    return None


def _fault_of_rig(images: Images, names: list[str], rig: Rig, rows: np.ndarray) -> StationFault | None:
    """Two photographs of one camera at a station, or a station without the reference camera."""
    station = np.asarray(images.columns[STATION], dtype=object)
    seen: dict[tuple[str, str], int] = {}
    for k in rows.tolist():
        at = str(station[k]), names[int(images.camera[k])]
        if at[0] and at in seen:
            both = f"'{images.names[seen[at]]}' and '{images.names[k]}'"
            message = f"station '{at[0]}' has two photographs of camera '{at[1]}': {both}"
            return StationFault(k, message, "give every exposure of the rig a station of its own")
        seen[at] = k
    for (name, _), k in seen.items():
        if name and (name, rig.reference) not in seen:
            message = f"station '{name}' has no photograph of the reference camera '{rig.reference}'"
            remedy = "add it to images.csv (it needs no image points), or leave the station of the others empty"
            return StationFault(k, message, remedy)
    return None
