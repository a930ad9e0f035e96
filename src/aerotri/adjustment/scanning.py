"""Rolling shutters among the unknowns: the readout time of a camera, and the motion of its photographs.

The readout time is one shared parameter of a camera. Velocities from the track are held while an adjustment is solved,
in the camera frame, and taken anew from the adjusted positions after it (`adjusted_positions`). Deviations from them
and rates of rotation are, where asked for, shared parameters of each photograph.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from aerotri.adjustment.kernel_records import Scans
from aerotri.adjustment.shared_parameters import SharedList
from aerotri.adjustment.track_velocity import STRIP, UNKNOWN, track_velocities
from aerotri.conventions import InputError, counted
from aerotri.observations import Block, Prior
from aerotri.observations.rolling_shutter import READING, RollingShutter

KIND = "rolling_shutter"
"""Kind of the shared parameters of rolling shutters."""
READOUT = "rolling_shutter.readout_ms"
VELOCITY = tuple(f"rolling_shutter.dv{axis}" for axis in "xyz")
SPIN = tuple(f"rolling_shutter.w{axis}" for axis in "xyz")
SLOWEST = 0.05
"""m/s below which a photograph stands still [C]: in the readout of a second it moves by 5 cm."""
MOST_OWN = 600
"""Unknowns of photographs' own motions that are taken [C]: they stand in the border, which is dense."""
NONE = Scans(np.zeros((0, 2)), np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3), np.int64))


@dataclass(frozen=True, eq=False)
class Scanning:
    """The rolling shutters of an adjustment of n photographs.

    Parameters
    ----------
    rate, columns : as in `Scans`. held : (n,) ms, readout times that are no unknowns.
    velocity : (n, 3) m/s in the camera frame, from the track. source : (n,) str, where it comes from.
    speed : (n,) m/s stated for photographs without times, NaN where it is not.
    """

    rate: np.ndarray
    columns: np.ndarray
    held: np.ndarray
    velocity: np.ndarray
    source: np.ndarray
    speed: np.ndarray

    @cached_property
    def rolling(self) -> np.ndarray:
        """(n,) bool, photographs of a rolling shutter."""
        return (self.rate != 0.0).any(axis=1)

    def readout(self, shared: np.ndarray) -> np.ndarray:
        """(n,) ms, 0 without a rolling shutter."""
        column = self.columns[:, 0]
        return np.where(column >= 0, shared[np.maximum(column, 0)], self.held) if len(shared) else self.held

    def motion(self, shared: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Velocity (n, 3) m/s and rates of rotation (n, 3) rad/s in the camera frame."""
        velocity, spin = self.velocity.copy(), np.zeros_like(self.velocity)
        for values, first in ((velocity, self.columns[:, 1]), (spin, self.columns[:, 2])):
            own = np.flatnonzero(first >= 0)
            values[own] += shared[first[own, None] + np.arange(3)]
        return velocity, spin

    def arrays(self, shared: np.ndarray) -> Scans:
        """As kernels take them."""
        velocity, spin = self.motion(shared)
        return Scans(self.rate, self.readout(shared), velocity, spin, self.columns)

    def on_track(self, block: Block, images: np.ndarray, centre: np.ndarray, rotation: np.ndarray) -> Scanning:
        """With the velocities that the positions of the n photographs say."""
        found = track_velocities(block, images, centre, self.rolling, self.speed)
        velocity = np.einsum("nji,nj->ni", rotation, found.velocity)
        return replace(self, velocity=np.where(self.rolling[:, None], velocity, 0.0), source=found.source)


def scanning_of(
    block: Block, images: np.ndarray, shared: SharedList, centre: np.ndarray, rotation: np.ndarray
) -> Scanning | None:
    """The rolling shutters of the photographs `images` (n,), their unknowns appended to `shared`; None without any.

    Parameters
    ----------
    centre : (n, 3) m, rotation : (n, 3, 3).

    Raises
    ------
    InputError
        Where the motion of photographs is neither known nor an unknown, and where they are too many to have their own.
    """
    camera = block.images.camera[images]
    acting = {k: c for k, c in enumerate(block.cameras) if c.rolling_shutter is not None and (camera == k).any()}
    acting = {k: c for k, c in acting.items() if c.rolling_shutter is not None and c.rolling_shutter.acts}
    if not acting:
        return None
    n = len(images)
    rate, columns, held = np.zeros((n, 2)), np.full((n, 3), -1, dtype=np.int64), np.zeros(n)
    speed = np.full(n, np.nan)
    for k, one in acting.items():
        own, shutter, half = camera == k, one.rolling_shutter or RollingShutter(), one.half_format_mm
        reading = READING[shutter.row_direction]
        rate[own] = 1e-3 * np.array(reading) / (2.0 * np.array(half))
        held[own] = shutter.readout_ms.value
        speed[own] = np.nan if shutter.speed_m_s is None else shutter.speed_m_s
    nothing = np.zeros((n, 3)), np.full(n, UNKNOWN, dtype=object)
    scanning = Scanning(rate, columns, held, *nothing, speed).on_track(block, images, centre, rotation)
    for k, one in acting.items():
        rows, shutter = np.flatnonzero(camera == k), one.rolling_shutter or RollingShutter()
        _refuse_unknown_motion(block, one.name, shutter, images[rows], scanning.source[rows])
        moving = shutter.motion == "photograph" or np.abs(scanning.velocity[rows]).max() > SLOWEST
        if not shutter.readout_ms.fixed and (moving or shutter.readout_ms.sigma is not None):
            columns[rows, 0] = shared.add(READOUT, one.name, KIND, "L", shutter.readout_ms)
        own = (shutter.motion == "photograph") + (shutter.rotation == "photograph")
        if own and 3 * own * len(rows) > MOST_OWN:
            raise InputError(
                f"{len(rows)} photographs of camera '{one.name}' have {3 * own * len(rows)} unknowns of their own "
                f"motion, {MOST_OWN} at most can be adjusted",
                'use motion = "track" and rotation = "off"', file="block.toml",
            )  # fmt: skip
        for row in rows.tolist():
            image = str(block.images.names[images[row]])
            if shutter.motion == "photograph":
                columns[row, 1] = _three(shared, VELOCITY, image, shutter.motion_sigma_m_s)
            if shutter.rotation == "photograph":
                columns[row, 2] = _three(shared, SPIN, image, shutter.rotation_sigma)
    return replace(scanning, columns=columns)


def motions_in_words(block: Block, images: np.ndarray, scanning: Scanning | None) -> tuple[str, ...]:
    """What the user has to know of velocities: those that come from elsewhere than the photograph's own times."""
    if scanning is None:
        return ()
    said, source = [], np.where(scanning.rolling, scanning.source, "")
    unknown, strip = (np.flatnonzero(source == where) for where in (UNKNOWN, STRIP))
    if len(strip):
        photographs = counted(len(strip), "photograph", "photographs")
        said.append(
            f"{photographs} of a rolling shutter have no usable time and take the velocity of their strip, such as "
            f"'{block.images.names[images[strip[0]]]}'"
        )
    if len(unknown):
        photographs = counted(len(unknown), "photograph", "photographs")
        said.append(
            f"the velocity of {photographs} of a rolling shutter is not known, such as "
            f"'{block.images.names[images[unknown[0]]]}': they count as standing still. Give their times or strips in "
            "images.csv"
        )
    still = sorted({block.cameras[c].name for c in block.images.camera[images][_still(block, images, scanning)]})
    for name in still:
        said.append(
            f"the photographs of camera '{name}' hardly move: its readout time cannot be determined and is held"
        )
    return tuple(said)


def _still(block: Block, images: np.ndarray, scanning: Scanning) -> np.ndarray:
    """(n,) bool, photographs of cameras whose readout time is held although it is asked for."""
    asked = np.array([c.rolling_shutter is not None and not c.rolling_shutter.readout_ms.fixed for c in block.cameras])
    return asked[block.images.camera[images]] & (scanning.columns[:, 0] < 0)


def _three(shared: SharedList, names: tuple[str, ...], image: str, sigma: float) -> int:
    """Three unknowns about 0; the first column."""
    first = len(shared)
    for name in names:
        shared.add(name, image, KIND, "L", Prior(0.0, sigma))
    return first


def _refuse_unknown_motion(
    block: Block, camera: str, shutter: RollingShutter, images: np.ndarray, source: np.ndarray
) -> None:
    """Photographs that move nobody knows how."""
    if shutter.motion == "track" and Counter(source.tolist())[UNKNOWN] == len(source):
        raise InputError(
            f"camera '{camera}' has a rolling shutter, and the velocity of its photographs is not known: no two "
            f"photographs of a strip have usable times (such as '{block.images.names[images[0]]}')",
            f"add a column time (seconds) to images.csv, state camera.{camera}.rolling_shutter.speed_m_s, or set "
            'motion = "photograph"', file="images.csv",
        )  # fmt: skip
