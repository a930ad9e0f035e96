"""The σ of groups of observations as an adjustment estimated them, and their tests."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class ChiSquareTest:
    """Two-sided test of the σ given for a group against its residuals.

    Parameters
    ----------
    ratio : σ a posteriori / σ a priori.
    statistic : freedom·ratio², distributed as χ² of `freedom` degrees of freedom where the σ is right.
    low, high : what the statistic may be at the level `alpha` of the block.
    verdict : 'agrees', 'σ given too small', 'σ given too large' or 'not testable'.
    """

    group: str
    ratio: float
    freedom: float
    statistic: float
    low: float
    high: float
    verdict: str


@dataclass(frozen=True)
class VarianceComponent:
    """The estimated σ of one group.

    Parameters
    ----------
    unit : 'µm', 'm' or 'rad'. count : observations. redundancy : Σ of their redundancy numbers.
    sigma_apriori : median σ as given, in the unit. factor : by which all σ of the group were multiplied; 1 where held.
    factor_sigma : σ of the factor. freedom : degrees of freedom behind it.
    held : why the σ was left as given, '' where it was estimated.
    """

    group: str
    unit: str
    count: int
    redundancy: float
    sigma_apriori: float
    factor: float
    factor_sigma: float
    freedom: float
    held: str
    test: ChiSquareTest

    @property
    def sigma(self) -> float:
        """The median σ used in the final adjustment, in the unit."""
        return self.sigma_apriori * self.factor


@dataclass(frozen=True)
class VarianceComponents:
    """The components of all groups, after `rounds` re-adjustments; `settled`: the last changed no σ by 1 %."""

    components: tuple[VarianceComponent, ...]
    rounds: int
    settled: bool

    @property
    def factors(self) -> dict[str, float]:
        """The factor of every group's σ."""
        return {c.group: c.factor for c in self.components}

    def as_dict(self) -> dict[str, Any]:
        """The numbers by name; None for what is not known."""
        return _without_nan(asdict(self))

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> VarianceComponents:
        """The inverse of `as_dict`."""
        components = []
        for c in content["components"]:
            test = ChiSquareTest(**_with_nan(c["test"]))
            components.append(VarianceComponent(**_with_nan({k: v for k, v in c.items() if k != "test"}), test=test))
        return cls(tuple(components), content["rounds"], content["settled"])


def _without_nan(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_nan(v) for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [_without_nan(v) for v in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _with_nan(record: Mapping[str, Any]) -> dict[str, Any]:
    return {key: float("nan") if value is None else value for key, value in record.items()}
