"""Additional parameters that depend on the heights of the points: their columns, taken anew from the solution.

[D] Such a parameter moves an image point by its pattern at the point's height. The heights are those of the solution,
taken as known while the equations are solved and anew after it, as the positions are (`adjusted_positions`). What is
left out this way is the change of the pattern with the height, P/h of the effect of the height itself: for an offset of
10 cm at 1000 m a ten-thousandth.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri.conventions import InputError
from aerotri.functional_model.additional_parameters import FAMILIES
from aerotri.observations import Camera

FLAT = 1e-3
"""Relief, RMS of heights over the flying height, below which these parameters are refused [C]: at 1000 m 1 m, what a
ploughed field has."""


@dataclass(frozen=True, eq=False)
class Relief:
    """Heights at the rays (m,), m: of the flight over the mean ground of the block, and of the point over it."""

    flying: np.ndarray
    above: np.ndarray


def relief_of(centre: np.ndarray, points: np.ndarray, ray_image: np.ndarray, row_start: np.ndarray) -> Relief:
    """The heights at the rays of an adjustment.

    Parameters
    ----------
    centre : (n, 3), points : (P, 3) m. ray_image : (m,). row_start : (P + 1,) first ray of every point.
    """
    ground = float(np.mean(points[:, 2]))
    point = np.repeat(np.arange(len(points)), np.diff(row_start))
    return Relief(centre[ray_image, 2] - ground, points[point, 2] - ground)


@dataclass(frozen=True, eq=False)
class HeightColumns:
    """One column a ray: the parameter of its camera that depends on heights.

    Parameters
    ----------
    family, item : the parameter. sets : by the numbers in `of_ray` (m,), the camera and the shared parameter.
    relief : None before start values are known.
    """

    family: str
    item: str
    sets: dict[int, tuple[Camera, int]]
    of_ray: np.ndarray
    relief: Relief | None = None

    def at(self, relief: Relief) -> HeightColumns:
        """The same at other heights."""
        return replace(self, relief=relief)

    def refuse_flat_ground(self) -> None:
        """Say that the heights of the block do not determine the parameter.

        Raises
        ------
        InputError
        """
        if self.relief is None:
            return
        rms, flying = np.sqrt(np.mean(self.relief.above**2)), np.mean(np.abs(self.relief.flying))
        if rms < FLAT * flying:
            raise InputError(
                f"{self.family}.{self.item} acts by the heights of the points, and the ground is flat: its heights "
                f"differ by {rms:.2f} m (RMS), the flying height is {flying:.0f} m",
                f"leave {self.family}:{self.item} out: over flat ground it has no effect",
                file="block.toml",
            )

    def columns(self, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Shared parameter (m, 1) of every ray and its pattern (m, 2, 1) at positions (m, 2) mm; 0 without one."""
        index, value = np.zeros((len(xy), 1), np.int64), np.zeros((len(xy), 2, 1))
        pattern = FAMILIES[self.family].at_heights
        if self.relief is None or pattern is None:
            return index, value
        for key, (camera, column) in self.sets.items():
            rays = np.flatnonzero(self.of_ray == key)
            index[rays, 0] = column
            value[rays, :, 0] = pattern(
                camera, xy[rays, 0], xy[rays, 1], self.relief.flying[rays], self.relief.above[rays]
            )
        return index, value
