"""Additional parameters that the selection took out of an adjustment."""

from __future__ import annotations

from dataclasses import asdict, dataclass


@dataclass(frozen=True)
class Removal:
    """A parameter that was taken out of an adjustment, as it stood there, and why.

    Parameters
    ----------
    value, sigma : the last estimate. correlation, correlation_with : its largest r. total_correlation : its B.
    sigma0 : σ̂0 of the adjustment in which it still stood.
    """

    name: str
    group: str
    mark: str
    value: float
    sigma: float
    correlation: float
    correlation_with: str
    total_correlation: float
    sigma0: float
    reason: str

    def as_dict(self) -> dict[str, str | float]:
        """The fields by name."""
        return asdict(self)
