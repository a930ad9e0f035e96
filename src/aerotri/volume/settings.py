"""What a user may say about a volume and its σ, with what holds where nothing is said."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot
from typing import Literal, get_args

from aerotri.conventions import InputError

Method = Literal["prisms", "grid", "trapezoidal", "simpson", "simpson38"]
METHODS: tuple[Method, ...] = get_args(Method)
RULES: tuple[Method, ...] = METHODS[2:]
"""Those that integrate areas of cross sections."""
PER_POINT = 2
"""Photographs a point of a surface is taken to be measured in where nobody says in how many: the nearest model [C]."""
MOST_PER_POINT = 8
"""Of more photographs that measured a cell the nearest count; chosen [C], as for σ of the cells of a dense surface:
more change σ little."""


@dataclass(frozen=True)
class SectionPlan:
    """spacing : m, None for a round number. azimuth : degrees in which the sections follow one another."""

    spacing: float | None = None
    azimuth: float = 0.0


BoundaryFrom = Literal["survey", "product"]
BOUNDARIES_FROM: tuple[BoundaryFrom, ...] = get_args(BoundaryFrom)


@dataclass(frozen=True)
class SigmaOptions:
    """What is known beside the adjustment.

    Parameters
    ----------
    matching_sigma_um : of an image coordinate of a picket; None: σ̂0 of the adjustment's image coordinates.
    matching_window_m : side of the matching window on the ground, within which neighbouring cells share their noise;
        None: the noise length of a dense surface, 0 of others.
    per_point : photographs a cell is measured in. base_sigma : m, common to the whole base.
    boundary_sigma : m, of either coordinate of every corner. corrected : the photographs were corrected.
    boundary_from : 'survey', the boundary is fixed in space, or 'product', it was drawn on the surface or on an
        orthophoto of the same adjustment and moves with it.

    Raises
    ------
    InputError
        When a σ is negative or no number.
    """

    matching_sigma_um: float | None = None
    matching_window_m: float | None = None
    per_point: int = PER_POINT
    base_sigma: float = 0.0
    boundary_sigma: float = 0.0
    corrected: bool = True
    boundary_from: BoundaryFrom = "survey"

    def __post_init__(self) -> None:
        for name, value, unit in (
            ("base_sigma", self.base_sigma, "m"), ("boundary_sigma", self.boundary_sigma, "m"),
            ("matching_sigma_um", self.matching_sigma_um, "µm"), ("matching_window", self.matching_window_m, "m"),
        ):  # fmt: skip
            if value is not None and not 0.0 <= value < float("inf"):
                raise InputError(f"{name} = {value:g} {unit} is not possible", "give a number that is not negative")


@dataclass(frozen=True)
class Density:
    """Tonnes of a cubic metre, and their σ, common to all that is measured.

    Raises
    ------
    InputError
        When the density is not positive, or its σ negative or larger than the density.
    """

    t_per_m3: float
    sigma: float = 0.0

    def __post_init__(self) -> None:
        if not (0.0 < self.t_per_m3 < MOST_DENSE and 0.0 <= self.sigma < MOST_DENSE):
            raise InputError(
                f"a density of {self.t_per_m3:g} ± {self.sigma:g} t/m³ is not possible", "give tonnes per cubic metre"
            )
        if self.sigma > self.t_per_m3:
            raise InputError(
                f"σ of the density, {self.sigma:g} t/m³, is larger than the density, {self.t_per_m3:g} t/m³",
                "give σ in tonnes per cubic metre, not per cent",
            )

    def tonnes(self, volume: float) -> float:
        """t of a volume, m³."""
        return self.t_per_m3 * volume

    def tonnes_sigma(self, volume: float, sigma: float) -> float:
        """t, σ of the tonnes of a volume with its σ, m³: √(ρ²σ_V² + V²σ_ρ²)."""
        return float(hypot(self.t_per_m3 * sigma, volume * self.sigma))


MOST_DENSE = 30.0
"""t/m³ that nothing on Earth exceeds; kilograms per cubic metre do."""
Layer = Literal["dsm", "dtm"]
LAYERS: tuple[Layer, ...] = get_args(Layer)
LAYER: Layer = "dsm"
RUN_LAYER: Layer = "dtm"
"""Of `aerotri run`, which measures the DTM with all within the boundary as ground, a pile too; beside it objects are
taken off, so that a tree does not lift the base."""
"""Of a terrain model the surface with objects: a filter that seeks the ground takes a pile for an object."""
BASE, METHOD = "boundary", METHODS[0]
"""The base and the method that count where none is stated."""
SECTIONS, SIGMA = SectionPlan(), SigmaOptions()
