"""What a user may say about measuring and comparing surfaces, with what holds where nothing is said."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

from aerotri.conventions import LARGEST, FilePath, InputError

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

Subset = Literal["all", "even", "odd"]
SUBSETS: tuple[Subset, ...] = get_args(Subset)
Interpolation = Literal["linear", "spline"]
INTERPOLATIONS: tuple[Interpolation, ...] = get_args(Interpolation)
Movement = Literal["none", "shift", "rigid"]
ALIGNMENTS: tuple[Movement, ...] = get_args(Movement)
INTERPOLATION, ALIGNMENT = INTERPOLATIONS[0], ALIGNMENTS[0]
"""Of surfaces that are compared, where nothing is stated."""
EDGE, EDGE_OF_PAIRS = 0.02, 0.10
"""Share of the format at its edge not used: of pairs as Tran (2007) has it; where more vouch for a picket, less."""
DENSE_EDGE = 0.005
"""The same of a dense surface; chosen [C]: room for the windows."""
LARGEST_EDGE = 0.4
"""Share of the format that `edge` may take on every side; at a half nothing would be left."""
WIDEST_OBJECT_M, MOST_WIDE_M = 18.0, 200.0
"""Width of the widest object that is taken off the ground, that of PDAL's filters.smrf, and the bound of the setting:
beyond, hills go with the houses."""
MOST_PAIRS = 12
"""Pairs of a piece of ground, the bound of the setting; more take time and tell nothing new."""
FEWEST_PHOTOGRAPHS, MOST_PHOTOGRAPHS = 2, 20
"""Photographs of a picket, the bounds of the setting: a ray alone gives no height; more than 20 take time and add
hardly any base."""


@dataclass(frozen=True)
class TerrainSettings:
    """How the ground is measured by image matching; pickets are the points measured.

    Parameters
    ----------
    interval : m between pickets; None: from the GSD and the relief.
    cell : m, of the rasters; None: half the interval.
    pairs : measure every picket in its best pair, not in all photographs.
    step : with pairs: a photograph and the step-th after it; None: what comes nearest to 60 % end lap.
    subset : all photographs of every strip, or its even or odd ones.
    area : m, X and Y of the lower left, X and Y of the upper right corner; None: as far as photographs reach.
    window : pixels a side of the windows that are matched, odd.
    threshold : correlation from which a match counts.
    agreeing : the same of three photographs and more whose rays meet; 1: never.
    edge : share of the format at its edge that is not used; None: 0.02, of pairs 0.10.
    most_photographs : of a picket.
    breaklines : file of lines with heights.
    ground_within : outline within which all is ground, as `aerotri.volume` takes its boundary; None: nowhere.
    ideal : the photographs have been freed of image errors.
    """

    interval: float | None = None
    cell: float | None = None
    pairs: bool = False
    step: int | None = None
    subset: Subset = "all"
    area: tuple[float, float, float, float] | None = None
    window: int = 17
    threshold: float = 0.90
    agreeing: float = 0.50
    edge: float | None = None
    most_photographs: int = 8
    breaklines: Path | None = None
    ground_within: BaseGeometry | FilePath | None = None
    ideal: bool = False

    @property
    def in_pairs(self) -> bool:
        """Whether the best pair measures a picket: so stated, or by a step."""
        return self.pairs or self.step is not None

    @property
    def unused_edge(self) -> float:
        """Share of the format at its edge that is not used."""
        if self.edge is not None:
            return self.edge
        return EDGE_OF_PAIRS if self.in_pairs else EDGE

    def check(self) -> None:
        """Refuse what makes no sense.

        Raises
        ------
        InputError
        """
        if self.subset not in SUBSETS:
            raise InputError(f"there is no subset '{self.subset}'", f"choose one of {', '.join(SUBSETS)}")
        if self.window % 2 == 0 or self.window < 5:
            raise InputError(f"a window of {self.window} pixels is not possible", "give an odd number from 5 on")
        if self.interval is not None and not self.interval > 0.0:
            raise InputError(
                f"an interval of {self.interval:g} m is not possible", "give metres greater than 0, or leave it out"
            )
        if self.area is not None and not (self.area[0] < self.area[2] and self.area[1] < self.area[3]):
            raise InputError("the area is empty", "give X and Y of its lower left, then of its upper right corner")
        for name, value, low, high in (
            ("cell", self.cell, 1e-6, LARGEST), ("step", self.step, 1, LARGEST),
            ("threshold", self.threshold, 0.0, 1.0), ("agreeing", self.agreeing, 0.0, 1.0),
            ("edge", self.edge, 0.0, LARGEST_EDGE),
            ("most_photographs", self.most_photographs, FEWEST_PHOTOGRAPHS, MOST_PHOTOGRAPHS),
        ):  # fmt: skip
            if value is not None and not low <= value <= high:
                raise InputError(f"{name} {value:g} is not possible", f"give a number from {low:g} to {high:g}")


@dataclass(frozen=True)
class DenseSettings:
    """How the whole surface is matched.

    Parameters
    ----------
    resolution : m, cell of the surface; None: two pixels on the ground.
    area : m, X and Y of the lower left, X and Y of the upper right corner; None: as far as photographs reach.
    most_pairs : pairs of photographs that measure a piece of ground, at most; up to 8 where there are holes.
    edge : share of the format at its edge that is not used.
    ideal : the photographs have been freed of image errors.
    ground : filter the ground besides. widest_object : m, the widest object that is taken off it.
    """

    resolution: float | None = None
    area: tuple[float, float, float, float] | None = None
    most_pairs: int = 4
    edge: float = DENSE_EDGE
    ideal: bool = False
    ground: bool = False
    widest_object: float = WIDEST_OBJECT_M

    def check(self) -> None:
        """Refuse what makes no sense.

        Raises
        ------
        InputError
        """
        if self.area is not None and not (self.area[0] < self.area[2] and self.area[1] < self.area[3]):
            raise InputError("the area is empty", "give X and Y of its lower left, then of its upper right corner")
        for name, value, low, high in (
            ("resolution", self.resolution, 1e-6, LARGEST), ("most_pairs", self.most_pairs, 1, MOST_PAIRS),
            ("edge", self.edge, 0.0, LARGEST_EDGE), ("widest_object", self.widest_object, 1.0, MOST_WIDE_M),
        ):  # fmt: skip
            if value is not None and not low <= value <= high:
                raise InputError(f"{name} {value:g} is not possible", f"give a number from {low:g} to {high:g}")


DEFAULTS = TerrainSettings()
DENSE_DEFAULTS = DenseSettings()
