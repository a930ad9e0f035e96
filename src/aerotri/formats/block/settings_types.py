"""What keys of block.toml are made of: numbers with their ranges, what is known of an unknown beforehand."""

from __future__ import annotations

from math import radians
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from aerotri.conventions import LARGEST
from aerotri.formats.text.described_key import key
from aerotri.formats.text.sigmas import impossible_sigmas, why_impossible
from aerotri.formats.text.tables import SMALLEST_POSITIVE
from aerotri.observations import Prior, RollingShutter


def _ground_sigma(value: float) -> float:
    if impossible_sigmas(np.array(value), may_be_zero=True):
        raise ValueError(f"a standard deviation {why_impossible(value, may_be_zero=True)}")
    return value


Real = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Positive = Annotated[float, Field(gt=0, ge=SMALLEST_POSITIVE, le=LARGEST)]
NotNegative = Annotated[float, Field(ge=0, le=LARGEST)]
Fraction = Annotated[float, Field(gt=0, lt=1)]
Pixels = Annotated[int, Field(gt=0, le=10_000_000)]
Two = Annotated[list[Real], Field(min_length=2, max_length=2)]
Three = Annotated[list[Real], Field(min_length=3, max_length=3)]
GroundSigma = Annotated[float, Field(ge=0, le=LARGEST), AfterValidator(_ground_sigma)]
"""m; 0 stands for a coordinate without error."""
ThreeGroundSigmas = Annotated[list[GroundSigma], Field(min_length=3, max_length=3)]
ThreePositive = Annotated[list[Positive], Field(min_length=3, max_length=3)]
OffOn = Literal["off", "on"]


class Section(BaseModel):
    """A table of block.toml: unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)


class PriorModel(Section):
    """``{ fixed = false }``: free. ``{ value, sigma }``: observed. ``{ value }``: free. ``{ fixed = true }``: held."""

    value: Real | None = key(None, "Start value, in the unit of the parameter.")
    sigma: Positive | None = key(
        None, "Standard deviation of the value, in the same unit: the value is an observation. Without it the "
        "parameter is free."
    )  # fmt: skip
    fixed: bool = key(False, "true: the value is held and is no unknown.")

    @model_validator(mode="after")
    def _fixed_or_observed(self) -> PriorModel:
        if self.fixed and self.sigma is not None:
            raise ValueError("fixed = true and a sigma exclude each other")
        return self

    def prior(self, otherwise: float = 0.0) -> Prior:
        """The record; `otherwise` is the value where none is given."""
        return Prior(otherwise if self.value is None else self.value, self.sigma, self.fixed)


class ThreePriorsModel(Section):
    """Three elements: ``{ value, sigma }``: observed. ``{ value }``: free. ``{ value, fixed = true }``: held."""

    value: Three | None = key(None, "The three values.")
    sigma: ThreePositive | None = key(None, "Their standard deviations; without them the elements are free.")
    fixed: bool | Annotated[list[bool], Field(min_length=3, max_length=3)] = key(
        False, "true: the elements are held; or a list of three, for every element whether it is held."
    )

    @model_validator(mode="after")
    def _fixed_or_observed(self) -> ThreePriorsModel:
        if self.fixed is True and self.sigma is not None:
            raise ValueError("fixed = true and a sigma exclude each other")
        return self

    def priors(self, unit: float = 1.0) -> tuple[Prior, Prior, Prior]:
        """The records, in the unit of the program."""
        value = self.value or [0.0, 0.0, 0.0]
        held = self.fixed if isinstance(self.fixed, list) else [self.fixed] * 3
        sigma = [None] * 3 if self.sigma is None else self.sigma
        a, b, c = (
            Prior(unit * v, None if s is None or h else unit * s, h) for v, s, h in zip(value, sigma, held, strict=True)
        )
        return a, b, c


class RollingShutterModel(Section):
    """Rolling shutter: the rows of a photograph are exposed one after the other, while the camera moves on."""

    readout_ms: PriorModel | None = key(
        None, "Time from the exposure of the first row to that of the last. Without it all rows are exposed at the "
        "same time.", "ms"
    )  # fmt: skip
    row_direction: Literal["down", "up", "right", "left"] = key(
        "down", "Direction in the image in which the rows are read one after the other. down: from the top row to the "
        "bottom row. right or left: photographs that were turned by a quarter after they were taken."
    )  # fmt: skip
    motion: Literal["track", "photograph"] = key(
        "track", "Velocity of a photograph during the readout. track: from the positions and times of the photographs "
        "of its strip. photograph: besides a deviation from that as three unknowns of every photograph."
    )  # fmt: skip
    motion_sigma_m_s: Positive = key(
        1.0, 'motion = "photograph": standard deviation of the deviation, in each axis of the camera.', "m/s"
    )
    rotation: Literal["off", "photograph"] = key(
        "off", "Rotation during the readout. photograph: rates of rotation as three unknowns of every photograph."
    )
    rotation_sigma_deg_s: Positive = key(
        5.0, 'rotation = "photograph": standard deviation of a rate of rotation, observed as zero.', "deg/s"
    )
    speed_m_s: Positive | None = key(
        None, "Speed of photographs whose times are not known; their direction is that of their neighbours.", "m/s"
    )
    test: OffOn = key(
        "on", "on: where readout_ms is an unknown, the block is also adjusted without a rolling shutter and with the "
        "affinity b1, b2 instead, and the report says which of them it needs. off: no such test."
    )  # fmt: skip

    @model_validator(mode="after")
    def _with_readout(self) -> RollingShutterModel:
        others = {name: field.default for name, field in type(self).model_fields.items() if name != "readout_ms"}
        if self.readout_ms is None and any(getattr(self, name) != default for name, default in others.items()):
            raise ValueError("readout_ms is missing: readout_ms = { value = 30.0 } makes it an unknown")
        return self

    def rolling_shutter(self) -> RollingShutter | None:
        """The record; None without a readout time."""
        if self.readout_ms is None:
            return None
        return RollingShutter(
            self.readout_ms.prior(), self.row_direction, self.motion, float(self.motion_sigma_m_s), self.rotation,
            radians(self.rotation_sigma_deg_s), self.speed_m_s, self.test,
        )  # fmt: skip
