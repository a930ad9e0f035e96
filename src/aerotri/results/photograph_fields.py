"""Smooth errors that image points of a photograph have in common: what was assumed, found and tested; of a result."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np

NAN = float("nan")


@dataclass(frozen=True)
class PhotographFields:
    """What an adjustment says of smooth errors of single photographs.

    Parameters
    ----------
    source : 'given' or 'estimated' where such errors are part of the model, '' where they are not.
    sigma_um : their σ, µm, σ̂0 included. length_mm : distance in the photograph after which they correlate by 37 %.
    likelihood_ratio : gain of −2 ln L by such errors over white noise alone. p : probability of such a gain by white
        noise, level : below which they are part of the model.
    nodes_x, nodes_y : of the grid of a photograph. photographs : with such errors.
    reason : why nothing was estimated, '' otherwise.
    """

    source: str = ""
    sigma_um: float = 0.0
    length_mm: float = NAN
    likelihood_ratio: float = NAN
    p: float = NAN
    level: float = NAN
    nodes_x: int = 0
    nodes_y: int = 0
    photographs: int = 0
    reason: str = ""

    @property
    def counts(self) -> bool:
        """Whether such errors are part of the model."""
        return bool(self.source)

    def as_dict(self) -> dict[str, Any]:
        """For JSON; None for what is not known."""
        own = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}
        return {k: None if isinstance(v, float) and not np.isfinite(v) else v for k, v in own.items()}

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> PhotographFields:
        """The record of `as_dict`."""
        known: dict[str, Any] = {key: NAN if value is None else value for key, value in content.items()}
        return cls(**known)
