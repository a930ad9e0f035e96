"""Errors of observed positions that stay for a while: what was assumed, found and tested; of a result."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np

NAN = float("nan")
CHECK_LEVEL = 0.001
"""Probability with which white noise is taken for residuals that are alike: the test is made in every block with
positions."""


@dataclass(frozen=True)
class PositionErrors:
    """What an adjustment says of errors of its GNSS positions that neighbouring exposures share.

    Parameters
    ----------
    source : 'given' or 'estimated' where such errors are part of the model, '' where they are not.
    plan_m, height_m : their σ, m, σ̂0 included. time : after which they have fallen to 37 %, in `time_unit`.
    noise_factor_plan, noise_factor_height : of the σ of single positions in the table.
    likelihood_ratio : gain of −2 ln L by such errors over white noise alone, not smaller than stated. p : probability
        of such a gain by white noise, level : below which they are part of the model.
    neighbours : correlation of the residuals of neighbouring exposures, beyond what the adjustment itself makes;
        tested where such errors are not part of the model. neighbours_p : probability of such a correlation by white
        noise.
    exposures, flights : with positions. nodes : of the process, a coordinate.
    reason : why there is no test, '' otherwise.
    """

    source: str = ""
    plan_m: float = 0.0
    height_m: float = 0.0
    time: float = NAN
    time_unit: str = "s"
    noise_factor_plan: float = 1.0
    noise_factor_height: float = 1.0
    likelihood_ratio: float = NAN
    p: float = NAN
    level: float = NAN
    neighbours: float = NAN
    neighbours_p: float = NAN
    exposures: int = 0
    flights: int = 0
    nodes: int = 0
    reason: str = ""

    @property
    def counts(self) -> bool:
        """Whether such errors are part of the model."""
        return bool(self.source)

    @property
    def neighbours_agree(self) -> bool:
        """Whether residuals of neighbours are alike beyond chance though the model takes them for independent."""
        return self.neighbours_p < CHECK_LEVEL

    def as_dict(self) -> dict[str, Any]:
        """For JSON; None for what is not known."""
        own = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}
        return {k: None if isinstance(v, float) and not np.isfinite(v) else v for k, v in own.items()}

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> PositionErrors:
        """The record of `as_dict`."""
        known: dict[str, Any] = {key: NAN if value is None else value for key, value in content.items()}
        return cls(**known)
