"""What all tables of a simulation's spec are made of."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, StringConstraints

from aerotri.conventions import LARGEST

Number = Annotated[float, Field(strict=True, ge=-LARGEST, le=LARGEST, allow_inf_nan=False)]
Positive = Annotated[float, Field(strict=True, gt=0.0, le=LARGEST, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(strict=True, ge=0.0, le=LARGEST, allow_inf_nan=False)]
Lap = Annotated[float, Field(strict=True, ge=0.0, le=0.95)]
Share = Annotated[float, Field(strict=True, ge=0.0, le=1.0)]
Probability = Annotated[float, Field(strict=True, gt=0.0, le=1.0)]
Count = Annotated[int, Field(strict=True, ge=1, le=2**31 - 1)]
Number0 = Annotated[int, Field(strict=True, ge=0, le=2**63 - 1)]
Name = Annotated[str, StringConstraints(min_length=1)]
InteriorName = Literal["focal_length_mm", "x0_mm", "y0_mm"]
BrownName = Literal["K1", "K2", "K3", "P1", "P2", "b1", "b2"]
LensName = Literal["k1", "k2", "p1", "p2", "k3", "k4", "q1", "q2", "q3", "sx", "sy", "b1", "b2"]
Triple = tuple[NotNegative, NotNegative, NotNegative]
Vector = tuple[Number, Number, Number]


class Table(BaseModel):
    """A table of the spec: unknown keys are refused, values never change."""

    model_config = ConfigDict(extra="forbid", frozen=True)
