"""What a user may say about a volume and its σ, with what holds where nothing is said."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

Method = Literal["prisms", "grid", "trapezoidal", "simpson", "simpson38"]
METHODS: tuple[Method, ...] = get_args(Method)
RULES: tuple[Method, ...] = METHODS[2:]
"""Those that integrate areas of cross sections."""
PER_POINT = 2
"""Photographs a point of a surface is taken to be measured in where its own are not known: the nearest model [C]."""


@dataclass(frozen=True)
class SectionPlan:
    """spacing : m, None for a round number. azimuth : degrees in which the sections follow one another."""

    spacing: float | None = None
    azimuth: float = 0.0


@dataclass(frozen=True)
class SigmaOptions:
    """What is known beside the adjustment.

    Parameters
    ----------
    matching_sigma_um : of an image coordinate of a picket; None: σ̂0 of the adjustment's image coordinates.
    matching_window_m : side of the matching window on the ground, within which neighbouring cells share their noise.
    per_point : photographs a cell is measured in. base_sigma : m, common to the whole base.
    boundary_sigma : m, of either coordinate of every corner. corrected : the photographs were corrected.
    """

    matching_sigma_um: float | None = None
    matching_window_m: float = 0.0
    per_point: int = PER_POINT
    base_sigma: float = 0.0
    boundary_sigma: float = 0.0
    corrected: bool = True


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
