"""A rolling shutter: the rows of a photograph are exposed one after the other, while the camera moves.

A ray in row r is exposed at τ = T·(r/rows − ½) from the middle of the readout time T: its projection centre is
X0 + v·τ, its rotation R·exp([ω]×·τ) [L: Vautherin et al. 2016].
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians

from aerotri.observations.prior import Prior

READING = {"down": (0.0, -1.0), "up": (0.0, 1.0), "right": (1.0, 0.0), "left": (-1.0, 0.0)}
"""Direction in the image, x right and y up, in which the rows are read one after the other."""

FREE = Prior()


@dataclass(frozen=True)
class RollingShutter:
    """The rolling shutter of a camera.

    Parameters
    ----------
    readout_ms : time from the first row to the last.
    row_direction : a key of `READING`.
    motion : 'track', velocities of the photographs from their times and positions; 'photograph', besides a deviation
        from that as unknowns of every photograph, with σ `motion_sigma_m_s`.
    rotation : 'off', or 'photograph': rates of rotation as unknowns of every photograph, with σ `rotation_sigma`,
        rad/s.
    speed_m_s : of photographs whose times are not known.
    test : 'on' where it is tested whether the block needs it.
    """

    readout_ms: Prior = FREE
    row_direction: str = "down"
    motion: str = "track"
    motion_sigma_m_s: float = 1.0
    rotation: str = "off"
    rotation_sigma: float = radians(5.0)
    speed_m_s: float | None = None
    test: str = "on"

    @property
    def acts(self) -> bool:
        """Whether it does anything: its readout time is an unknown, or not zero."""
        return not self.readout_ms.fixed or self.readout_ms.value != 0.0
