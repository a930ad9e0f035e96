"""What a user may say about an orthophoto, with what holds where nothing is said."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from aerotri.conventions import LARGEST, InputError
from aerotri.terrain.settings import LARGEST_EDGE

Sampling = Literal["bicubic", "bilinear", "nearest"]
SAMPLINGS: tuple[Sampling, ...] = get_args(Sampling)


@dataclass(frozen=True)
class OrthoSettings:
    """How an orthophoto is made.

    Parameters
    ----------
    cell : m; None: the size of a pixel on the ground.
    area : m, X and Y of the lower left, X and Y of the upper right corner; None: as far as surface and photographs.
    edge : share of the format at its edge that is not used.
    resampling : 'bicubic', 'bilinear' or 'nearest'.
    balance : whether the colours of the photographs are brought to one another.
    seams : whether seams are laid where photographs look alike, not where another photograph becomes the best.
    ideal : the photographs have been freed of image errors.
    fill : m, holes of the surface that are at most so wide are bridged; 0: none.
    """

    cell: float | None = None
    area: tuple[float, float, float, float] | None = None
    edge: float = 0.01
    resampling: Sampling = "bicubic"
    balance: bool = True
    seams: bool = True
    ideal: bool = False
    fill: float = 0.0

    def check(self) -> None:
        """Refuse what makes no sense.

        Raises
        ------
        InputError
        """
        if self.resampling not in SAMPLINGS:
            raise InputError(f"there is no resampling '{self.resampling}'", f"choose one of {', '.join(SAMPLINGS)}")
        if self.area is not None and not (self.area[0] < self.area[2] and self.area[1] < self.area[3]):
            raise InputError("the area is empty", "give X and Y of its lower left, then of its upper right corner")
        for name, value, low, high in (("cell", self.cell, 1e-6, LARGEST), ("edge", self.edge, 0.0, LARGEST_EDGE),
                                       ("fill", self.fill, 0.0, LARGEST)):  # fmt: skip
            if value is not None and not low <= value <= high:
                raise InputError(f"{name} {value:g} is not possible", f"give a number from {low:g} to {high:g}")


DEFAULTS = OrthoSettings()
