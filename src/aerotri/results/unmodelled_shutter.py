"""The way of a camera while its rows are read, where no readout time is stated, as it is found."""

from __future__ import annotations

from dataclasses import dataclass

CHANCE = 3e-4
"""Probability of a way by chance below which it counts, of all cameras together: as of the other contradictions."""
SUSPECTED = 1e-2
"""The same below which it is told without a doubt of the result [C]."""
BESIDE = 1e-3
"""Probability below which a way counts beside an affinity of the camera."""
MATERIAL = 0.5
"""σ by which the object points have to move, were it modelled (root mean square) [C]: less changes no decision."""


@dataclass(frozen=True)
class UnmodelledShutter:
    """What the photographs of a camera say of a rolling shutter that the adjustment does not have.

    Parameters
    ----------
    camera : its name. way_m, sigma_m : of the camera from the first row to the last, at the usual speed of the block.
    p : probability of as much without one, with all cameras that were tested.
    p_beside : the same beside b1 and b2 of the camera, NaN where these cannot be unknowns too, or nobody asked.
    way_px : the same way in the image, pixels.
    moves_m, moves_sigma : the way of the object points if it were modelled, RMS, in m and in their total σ.
    row_direction : the way the rows are taken to be read, a key of `rolling_shutter.READING`.
    """

    camera: str
    way_m: float
    sigma_m: float
    p: float
    p_beside: float
    way_px: float
    moves_m: float
    moves_sigma: float
    row_direction: str

    @property
    def counts(self) -> bool:
        """Whether chance does not explain it, and the object points would move."""
        return self.p < CHANCE and self.moves_sigma > MATERIAL

    @property
    def is_suspected(self) -> bool:
        """Whether it is told, though it may be chance."""
        return self.p < SUSPECTED and self.moves_sigma > MATERIAL

    @property
    def is_told_apart(self) -> bool:
        """Whether an affinity of the camera does not explain it as well."""
        return self.p_beside < BESIDE
